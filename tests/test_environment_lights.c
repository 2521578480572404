/* SPDX-License-Identifier: Apache-2.0 */
/* An environment as directional lights: what they bring, where they stand, and how soon they look like the map. */
#include "environment_lights.h"
#include "parallel.h"
#include "rng.h"
#include "samples.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h> /* after message.h, whose fail() is a macro there */

static const double pi = 3.14159265358979323846;
enum { MOST = 4096 };
static environment_light lights[MOST];

/* ----------------------------------------------------------------------------------------------------------- maps */

static environment *from(image map)
{
    message err = {{0}};
    environment *e = NULL;
    if (!environment_from_image(&map, &e, &err))
        fail_msg("%s", err.text);
    image_free(&map);
    return e;
}

static image plain_map(uint32_t width, uint32_t height, rgb c)
{
    image map = image_new(width, height);
    for (size_t i = 0; i < (size_t)width * height; i++)
        map.pixels[i] = c;
    return map;
}

static image noise_map(uint32_t width, uint32_t height, float contrast)
{
    image map = image_new(width, height);
    rng r = rng_make(11, width);
    for (size_t i = 0; i < (size_t)width * height; ++i)
        map.pixels[i] = v3(powf(rng_float(&r), contrast), powf(rng_float(&r), contrast), rng_float(&r));
    return map;
}

static void patch(image *map, uint32_t x, uint32_t y, uint32_t width, uint32_t height, rgb c)
{
    for (uint32_t j = y; j < y + height; j++)
        for (uint32_t i = x; i < x + width; i++)
            map->pixels[(size_t)j * map->width + i] = c;
}

/* A bright sky over dark ground, a window, three lamps and a small sun. */
static image scenery(void)
{
    image map = image_new(128, 64);
    for (uint32_t j = 0; j < 64; j++)
        for (uint32_t i = 0; i < 128; i++) {
            float up = j < 32 ? 1.0f : 0.1f, x = (float)i / 128.0f;
            map.pixels[j * 128 + i] = v3(up * (0.5f + 0.3f * x), up * (0.6f + 0.2f * sinf(7.0f * x)), up);
        }
    patch(&map, 20, 14, 10, 8, v3(6, 6, 7));
    for (uint32_t i = 0; i < 3; i++)
        patch(&map, 60 + 12 * i, 20 + 2 * i, 3, 2, v3(40, 30, 12));
    patch(&map, 105, 9, 2, 2, v3(600, 560, 500));
    return map;
}

/* --------------------------------------------------------------------------------------------------------- checks */

static uint32_t make(const environment *e, uint32_t count)
{
    memset(lights, 0, sizeof lights);
    return environment_lights(e, count, lights);
}

static int by_direction(const void *a, const void *b)
{
    return memcmp(&((const environment_light *)a)->direction, &((const environment_light *)b)->direction, sizeof(vec3));
}

/* Each of them unit, with light, nowhere two; together as bright as the environment. */
static void check_lights(const environment *e, uint32_t count)
{
    static environment_light sorted[MOST];
    double sum[3] = {0};
    assert_int_equal(make(e, count), count);
    for (uint32_t i = 0; i < count; i++) {
        const environment_light *l = &lights[i];
        assert_true(fabsf(v3_length(l->direction) - 1.0f) < 1e-6f);
        assert_true(l->irradiance.x >= 0.0f && l->irradiance.y >= 0.0f && l->irradiance.z >= 0.0f);
        assert_true(v3_max_component(l->irradiance) > 0.0f && v3_max_component(l->irradiance) < INFINITY);
        sum[0] += (double)l->irradiance.x, sum[1] += (double)l->irradiance.y, sum[2] += (double)l->irradiance.z;
    }
    rgb mean = environment_mean(e);
    const double wanted[3] = {4 * pi * (double)mean.x, 4 * pi * (double)mean.y, 4 * pi * (double)mean.z};
    for (int c = 0; c < 3; c++)
        if (fabs(sum[c] - wanted[c]) > 2e-7 * wanted[c])
            fail_msg("%u lights, colour %d: %.9g instead of %.9g", count, c, sum[c], wanted[c]);
    memcpy(sorted, lights, sizeof sorted);
    qsort(sorted, count, sizeof *sorted, by_direction);
    for (uint32_t i = 1; i < count; i++)
        assert_true(by_direction(&sorted[i - 1], &sorted[i]) != 0);
}

static void test_as_bright_as_the_map(void **state)
{
    (void)state;
    static const uint32_t counts[] = {1, 2, 3, 7, 50, 400, MOST};
    environment *maps[] = {from(scenery()),          from(noise_map(64, 32, 1)),     from(noise_map(37, 29, 9)),
                           from(noise_map(1, 1, 1)), from(noise_map(1100, 523, 30)), environment_uniform(v3(1, 2, 0))};
    for (size_t m = 0; m < sizeof maps / sizeof *maps; m++) {
        for (size_t i = 0; i < sizeof counts / sizeof *counts && m % (size_t)case_step() == 0; i++)
            check_lights(maps[m], counts[i]);
        environment_free(maps[m]);
    }
}

static void test_black(void **state)
{
    (void)state;
    environment *e = from(plain_map(32, 16, v3(0, 0, 0))), *none = environment_uniform(v3(0, 0, 0));
    assert_int_equal(make(e, 50), 0);
    assert_int_equal(make(none, 50), 0);
    assert_int_equal(environment_lights(e, 0, lights), 0);
    environment_free(e);
    environment_free(none);
}

/* The largest and the smallest numbers that a map can hold. */
static void test_extreme(void **state)
{
    (void)state;
    image map = plain_map(4, 4, v3(1e-44f, 0, 0));
    patch(&map, 0, 0, 4, 1, v3(3.4e38f, 3.4e38f, 3.4e38f));
    environment *e = from(map);
    assert_int_equal(make(e, 50), 50);
    for (int i = 0; i < 50; i++)
        assert_true(lights[i].irradiance.x > 0.0f && lights[i].irradiance.x < INFINITY);
    environment_free(e);
}

/* However small what is not black, it is divided into as many directions. */
static void test_nearly_black(void **state)
{
    (void)state;
    image map = image_new(64, 32);
    patch(&map, 20, 10, 1, 1, v3(100, 80, 60));
    environment *e = from(map);
    check_lights(e, 300);
    for (uint32_t i = 0; i < 300; i++) /* the lookup is bilinear: a pixel reaches into those around it */
        assert_true(v3_max_component(environment_radiance(e, lights[i].direction)) > 0.0f);
    environment_free(e);
}

/* ---------------------------------------------------------------------------------------------------- same for all */

typedef struct team {
    const environment *e;
    environment_light out[8][400];
    uint32_t count[8];
} team;

static void make_one(void *context, int thread, size_t index)
{
    team *t = context;
    (void)thread;
    t->count[index] = environment_lights(t->e, 400, t->out[index]);
}

static void test_deterministic(void **state)
{
    (void)state;
    static team t;
    environment *e = from(scenery());
    t.e = e;
    parallel_for(4, 8, make_one, &t);
    assert_int_equal(make(e, 400), 400);
    for (int i = 0; i < 8; i++) {
        assert_int_equal(t.count[i], 400);
        assert_memory_equal(t.out[i], lights, sizeof t.out[i]);
    }
    environment_free(e);
}

/* The same lights, turned. */
static void test_rotated(void **state)
{
    (void)state;
    static environment_light turned[400];
    environment *e = from(scenery());
    assert_int_equal(make(e, 400), 400);
    for (double degrees = -80.0; degrees < 400.0; degrees += 37.0) {
        environment_rotate(e, degrees);
        assert_int_equal(environment_lights(e, 400, turned), 400);
        for (int i = 0; i < 400; i++) {
            vec3 d = lights[i].direction;
            double s = sin(degrees * pi / 180.0), c = cos(degrees * pi / 180.0);
            vec3 expected = v3((float)(c * d.x + s * d.z), d.y, (float)(c * d.z - s * d.x));
            assert_true(v3_length(v3_sub(expected, turned[i].direction)) < 1e-6f);
            assert_memory_equal(&turned[i].irradiance, &lights[i].irradiance, sizeof(rgb));
        }
    }
    environment_free(e);
}

/* ---------------------------------------------------------------------------------------------------------- places */

/* Four pixels of a sun as bright as all the rest: its light comes from it, and from few lights. */
static void test_sun_has_lights_of_its_own(void **state)
{
    (void)state;
    image map = plain_map(256, 128, v3(1, 1, 1));
    patch(&map, 100, 40, 2, 2, v3(4000, 4000, 4000));
    environment *e = from(map);
    vec3 sun =
        v3_normalize(v3((float)(sin(pi * 41 / 128) * sin(2 * pi * (101.0 / 256 - 0.5))), (float)cos(pi * 41 / 128),
                        (float)(-sin(pi * 41 / 128) * cos(2 * pi * (101.0 / 256 - 0.5)))));
    double all = 4 * pi * (double)environment_mean(e).x, of_sun = all - 4 * pi;
    static const uint32_t counts[] = {2, 10, 50, 400};
    for (int i = 0; i < 4; i++) {
        uint32_t n = make(e, counts[i]), near = 0;
        double energy = 0.0;
        for (uint32_t k = 0; k < n; k++)
            if (v3_length(v3_sub(lights[k].direction, sun)) < 2.0 * 2.0 * pi / 256) {
                near++;
                energy += (double)lights[k].irradiance.x;
            }
        assert_in_range(near, 1, counts[i] / 2);
        assert_true(v3_length(v3_sub(lights[0].direction, sun)) < 2.0 * 2.0 * pi / 256); /* the brightest first */
        /* with what of the sky is nearest to it */
        if (counts[i] >= 50)
            assert_true(energy > 0.99 * of_sun && energy < of_sun + 4 * (all - of_sun) / counts[i]);
    }
    environment_free(e);
}

/* Two strata: lights by light times the fourth root of the solid angle. */
static void test_shares(void **state)
{
    (void)state;
    image map = plain_map(512, 256, v3(1, 1, 1)); /* so many pixels are taken one by one */
    patch(&map, 120, 80, 64, 32, v3(100, 100, 100));
    environment *e = from(map);
    double extent = 2 * pi * 64 / 512 * (cos(pi * 80 / 256) - cos(pi * 112 / 256)), rest = 4 * pi - extent;
    double bright = 100 * extent * pow(extent, 0.25), dim = rest * pow(rest, 0.25);
    uint32_t n = make(e, 400), there = 0;
    for (uint32_t i = 0; i < n; i++)
        there += environment_radiance(e, lights[i].direction).x > 50.0f;
    assert_true(fabs(there - 400 * bright / (bright + dim)) <= 1.0);
    environment_free(e);
}

static void check_even(const environment *e)
{
    static const uint32_t counts[] = {6, 50, 400, MOST};
    for (int i = 0; i < 4; i++) {
        float low = INFINITY, high = 0.0f;
        check_lights(e, counts[i]);
        for (uint32_t k = 0; k < counts[i]; k++) {
            low = float_min(low, lights[k].irradiance.x);
            high = float_max(high, lights[k].irradiance.x);
        }
        if (high > 3.0f * low)
            fail_msg("%u lights: the largest cell is %.2f times the smallest", counts[i], (double)(high / low));
    }
}

/* Cells of like size where nothing is brighter. */
static void test_even(void **state)
{
    (void)state;
    environment *maps[] = {from(plain_map(128, 64, v3(3, 2, 1))), from(plain_map(1, 1, v3(3, 2, 1))),
                           environment_uniform(v3(3, 2, 1)), from(plain_map(1024, 512, v3(0.1f, 0.7f, 1)))};
    for (size_t m = 0; m < sizeof maps / sizeof *maps; m++) {
        if (m % (size_t)case_step() == 0)
            check_even(maps[m]);
        environment_free(maps[m]);
    }
}

/* ----------------------------------------------------------------------------------------------------- convergence */

enum { SIDE = 12 };

/* Light on points of a floor and of a wall around a ball that hides a part of the sky. */
static bool seen(vec3 p, vec3 d)
{
    vec3 to_ball = v3_sub(v3(0, 0.8f, 0), p);
    float along = v3_dot(to_ball, d);
    return along < 0.0f || v3_dot(to_ball, to_ball) - along * along > 0.25f;
}

static void add(vec3 d, rgb irradiance, double image_[2 * SIDE * SIDE])
{
    for (int i = 0; i < 2 * SIDE * SIDE; i++) {
        bool wall = i >= SIDE * SIDE;
        float u = -2.0f + 4.0f * (float)(i % SIDE) / SIDE, w = -2.0f + 4.0f * (float)(i / SIDE % SIDE) / SIDE;
        vec3 p = wall ? v3(u, w, -2.0f) : v3(u, 0.0f, w), n = wall ? v3(0, 0, 1) : v3(0, 1, 0);
        float cosine = v3_dot(n, d);
        if (cosine > 0.0f && seen(p, d))
            image_[i] += (double)cosine * (double)luminance(irradiance);
    }
}

static double error_of(const double *a, const double *b)
{
    double difference = 0.0, all = 0.0;
    for (int i = 0; i < 2 * SIDE * SIDE; i++)
        difference += fabs(a[i] - b[i]), all += b[i];
    return difference / all;
}

static void whole_map(const environment *e, double *out)
{
    enum { ROWS = 256 }; /* 16 directions a pixel of the map */
    for (int j = 0; j < ROWS; j++)
        for (int i = 0; i < 2 * ROWS; i++) {
            double theta = pi * (j + 0.5) / ROWS, phi = pi * (i + 0.5) / ROWS - pi;
            double extent = pi / ROWS * (cos(pi * j / ROWS) - cos(pi * (j + 1) / ROWS));
            vec3 d = v3((float)(sin(theta) * sin(phi)), (float)cos(theta), (float)(-sin(theta) * cos(phi)));
            add(d, v3_scale(environment_radiance(e, d), (float)extent), out);
        }
}

static double error_of_random(const environment *e, uint32_t n, const double *whole, uint64_t seed)
{
    double out[2 * SIDE * SIDE] = {0};
    rng r = rng_make(5, seed);
    for (uint32_t i = 0; i < n; i++) {
        rgb radiance;
        float pdf, u1 = rng_float(&r), u2 = rng_float(&r);
        vec3 d = environment_sample(e, u1, u2, &radiance, &pdf);
        add(d, v3_scale(radiance, 1.0f / (pdf * (float)n)), out);
    }
    return error_of(out, whole);
}

static void test_converges(void **state)
{
    (void)state;
    environment *e = from(scenery());
    double whole[2 * SIDE * SIDE] = {0}, last = INFINITY;
    whole_map(e, whole);
    for (uint32_t n = 16; n <= 1024; n *= 4) {
        double out[2 * SIDE * SIDE] = {0}, random = 0.0;
        assert_int_equal(make(e, n), n);
        for (uint32_t i = 0; i < n; i++)
            add(lights[i].direction, lights[i].irradiance, out);
        double error = error_of(out, whole);
        for (uint64_t seed = 0; seed < 8; seed++)
            random += error_of_random(e, n, whole, seed) / 8;
        print_message("%u lights: error %.4f, random ones %.4f\n", n, error, random);
        if (!(error < 0.7 * last && error < 0.5 * random))
            fail_msg("%u lights: error %.4f, of fewer lights %.4f, of random ones %.4f", n, error, last, random);
        last = error;
    }
    environment_free(e);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_as_bright_as_the_map),
        cmocka_unit_test(test_black),
        cmocka_unit_test(test_extreme),
        cmocka_unit_test(test_nearly_black),
        cmocka_unit_test(test_deterministic),
        cmocka_unit_test(test_rotated),
        cmocka_unit_test(test_sun_has_lights_of_its_own),
        cmocka_unit_test(test_shares),
        cmocka_unit_test(test_even),
        cmocka_unit_test(test_converges),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
