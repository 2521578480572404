/* SPDX-License-Identifier: Apache-2.0 */
/* Environment light: orientation, lookup, and that its density is one, is drawn from, and fits the radiance. */
#include "angles.h"
#include "environment.h"
#include "rng.h"

#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h> /* after message.h, whose fail() is a macro there */

static const double pi = 3.14159265358979323846;
static message err;

static vec3 direction_at(double u, double v)
{
    double phi = 2.0 * pi * (u - 0.5), theta = pi * v;
    return v3((float)(sin(theta) * sin(phi)), (float)cos(theta), (float)(-sin(theta) * cos(phi)));
}

static environment *from(const image *map)
{
    environment *e = NULL;
    if (!environment_from_image(map, &e, &err))
        fail_msg("%s", err.text);
    return e;
}

static image noise_map(uint32_t width, uint32_t height, float contrast)
{
    image map = image_new(width, height);
    rng r = rng_make(11, width);
    for (size_t i = 0; i < (size_t)width * height; ++i)
        map.pixels[i] = v3(powf(rng_float(&r), contrast), powf(rng_float(&r), contrast), rng_float(&r));
    return map;
}

/* Black but for one very bright texel. */
static image sun_map(uint32_t width, uint32_t height, uint32_t x, uint32_t y)
{
    image map = image_new(width, height);
    map.pixels[(size_t)y * width + x] = v3(5e4f, 4e4f, 3e4f);
    return map;
}

static void close_to(rgb a, rgb b, double tolerance)
{
    const float *x = &a.x, *y = &b.x;
    for (int k = 0; k < 3; ++k)
        if (!(fabs((double)x[k] - y[k]) <= tolerance * (1.0 + fabs((double)y[k]))))
            fail_msg("channel %d: %.9g is not %.9g", k, (double)x[k], (double)y[k]);
}

/* --- lookup --- */

static void axes_map_as_documented(void **state)
{
    (void)state;
    /* 8 x 4 texels of different colours; the six axes meet edges of texels: u = 1/2 is -z, 3/4 is +x. */
    image map = image_new(8, 4);
    for (uint32_t j = 0; j < 4; ++j)
        for (uint32_t i = 0; i < 8; ++i)
            map.pixels[j * 8 + i] = v3((float)i, (float)j, 1.0f);
    environment *e = from(&map);
    close_to(environment_radiance(e, v3(0, 0, -1)), v3(3.5f, 1.5f, 1.0f), 1e-5);
    close_to(environment_radiance(e, v3(1, 0, 0)), v3(5.5f, 1.5f, 1.0f), 1e-5);
    close_to(environment_radiance(e, v3(-1, 0, 0)), v3(1.5f, 1.5f, 1.0f), 1e-5);
    close_to(environment_radiance(e, v3(0, 0, 1)), v3(3.5f, 1.5f, 1.0f), 1e-5); /* between columns 7 and 0 */
    assert_true(fabsf(environment_radiance(e, v3(0, 1, 0)).y) < 1e-6f);         /* row 0 looks up */
    assert_true(fabsf(environment_radiance(e, v3(0, -1, 0)).y - 3.0f) < 1e-6f);
    for (uint32_t j = 0; j < 4; ++j) /* texel centres give the texel */
        for (uint32_t i = 0; i < 8; ++i)
            close_to(environment_radiance(e, direction_at((i + 0.5) / 8, (j + 0.5) / 4)), map.pixels[j * 8 + i], 1e-5);
    environment_free(e);
    image_free(&map);
}

/* Against a slow bilinear lookup in double, everywhere. */
static void lookup_is_bilinear(void **state)
{
    (void)state;
    image map = noise_map(16, 9, 3.0f);
    environment *e = from(&map);
    rng r = rng_make(2, 0);
    for (int n = 0; n < 20000; ++n) {
        double u = rng_float(&r), v = rng_float(&r), s = u * 16 - 0.5, t = v * 9 - 0.5;
        double want[3] = {0, 0, 0};
        for (int y = 0; y < 2; ++y)
            for (int x = 0; x < 2; ++x) {
                int i = ((int)floor(s) + x + 16) % 16, j = (int)floor(t) + y;
                j = j < 0 ? 0 : j > 8 ? 8 : j;
                double fs = s - floor(s), ft = t - floor(t), w = (x ? fs : 1 - fs) * (y ? ft : 1 - ft);
                for (int k = 0; k < 3; ++k)
                    want[k] += w * (&map.pixels[j * 16 + i].x)[k];
            }
        close_to(environment_radiance(e, direction_at(u, v)), v3((float)want[0], (float)want[1], (float)want[2]), 3e-5);
    }
    environment_free(e);
    image_free(&map);
}

/* --- density --- */

/* Integrals over the sphere by the midpoint rule: of the density, and of the radiance / 4 pi. */
static double quadrature(const environment *e, int steps, double mean[3])
{
    double density = 0.0;
    mean[0] = mean[1] = mean[2] = 0.0;
    for (int j = 0; j < steps; ++j)
        for (int i = 0; i < 2 * steps; ++i) {
            double v = (j + 0.5) / steps, w = sin(pi * v) * pi * pi / ((double)steps * steps);
            vec3 d = direction_at((i + 0.5) / (2 * steps), v);
            density += w * environment_pdf(e, d);
            rgb c = environment_radiance(e, d);
            mean[0] += w * c.x / (4 * pi);
            mean[1] += w * c.y / (4 * pi);
            mean[2] += w * c.z / (4 * pi);
        }
    return density;
}

/* What must hold for any map. `steps` is a multiple of its height, so that no quadrature cell straddles texels. */
static void check_map(const environment *e, int steps, int samples, double tolerance)
{
    double mean[3];
    double density = quadrature(e, steps, mean);
    if (!(fabs(density - 1.0) < 1e-3))
        fail_msg("the density integrates to %.9g", density);
    rgb m = environment_mean(e);
    close_to(m, v3((float)mean[0], (float)mean[1], (float)mean[2]), tolerance);

    double sum[3] = {0, 0, 0}, squares[3] = {0, 0, 0};
    rng r = rng_make(77, 0);
    for (int n = 0; n < samples; ++n) {
        rgb c;
        float pdf, u1 = rng_float(&r), u2 = rng_float(&r);
        vec3 d = environment_sample(e, u1, u2, &c, &pdf);
        assert_true(fabsf(v3_length(d) - 1.0f) < 1e-5f);
        if (!(pdf > 0.0f && isfinite(pdf)))
            fail_msg("density %g", (double)pdf);
        float again = environment_pdf(e, d);
        if (!(fabsf(again - pdf) <= 1e-4f * pdf))
            fail_msg("drawn with density %.9g, which is then %.9g", (double)pdf, (double)again);
        close_to(environment_radiance(e, d), c, 0.0);
        const float *x = &c.x;
        for (int k = 0; k < 3; ++k) {
            double estimate = x[k] / (4 * pi * pdf);
            sum[k] += estimate / samples;
            squares[k] += estimate * estimate / samples;
        }
    }
    for (int k = 0; k < 3; ++k) {
        double sigma = sqrt(fmax(0.0, squares[k] - sum[k] * sum[k]) / samples);
        if (!(fabs(sum[k] - mean[k]) <= 4.0 * sigma + 2e-4 * mean[k]))
            fail_msg("channel %d: estimate %.9g, mean %.9g, sigma %.3g", k, sum[k], mean[k], sigma);
    }

    for (int n = 0; n < samples; ++n) { /* density where there is light */
        double y = 1.0 - 2.0 * rng_float(&r);
        vec3 d = direction_at(rng_float(&r), acos(y) / pi);
        rgb c = environment_radiance(e, d);
        if ((c.x > 0.0f || c.y > 0.0f || c.z > 0.0f) && !(environment_pdf(e, d) > 0.0f))
            fail_msg("radiance (%g, %g, %g) has no density", (double)c.x, (double)c.y, (double)c.z);
    }
}

static void maps_are_sampled_right(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {2, 1}, {1, 5}, {16, 8}, {37, 19}};
    for (size_t s = 0; s < 5; ++s) {
        image map = noise_map(sizes[s][0], sizes[s][1], 4.0f);
        environment *e = from(&map);
        int height = (int)sizes[s][1];
        check_map(e, (400 / height + 1) * height, 100000, 1e-4);
        environment_free(e);
        image_free(&map);
    }
}

static void suns_are_sampled_right(void **state)
{
    (void)state;
    static const uint32_t at[][2] = {{10, 7}, {0, 9}, {31, 4}, {5, 0}, {20, 15}};
    for (size_t s = 0; s < 5; ++s) {
        image map = sun_map(32, 16, at[s][0], at[s][1]);
        environment *e = from(&map);
        check_map(e, 16 * 25, 100000, 1e-3);
        environment_free(e);
        image_free(&map);
    }
}

/* Right-handed about +y; lookup, density and samples turn together. */
static void rotated_maps_are_the_same_turned(void **state)
{
    (void)state;
    image map = noise_map(16, 8, 4.0f);
    environment *straight = from(&map), *turned = from(&map);
    static const double degrees[] = {0.0, 90.0, 34.65, -77.85, 359.99, 1234.5};
    for (size_t k = 0; k < sizeof degrees / sizeof *degrees; ++k) {
        environment_rotate(turned, degrees[k]);
        double s = sin(degrees[k] * pi / 180.0), c = cos(degrees[k] * pi / 180.0);
        rng r = rng_make(3, k);
        for (int n = 0; n < 20000; ++n) {
            float u1 = rng_float(&r), u2 = rng_float(&r), pdf, pdf_turned;
            rgb radiance, radiance_turned;
            vec3 d = environment_sample(straight, u1, u2, &radiance, &pdf);
            vec3 expected = v3((float)(c * d.x + s * d.z), d.y, (float)(c * d.z - s * d.x));
            close_to(environment_radiance(turned, expected), radiance, 3e-5);
            assert_true(v3_length(v3_sub(environment_rotated(turned, d), expected)) < 1e-6f);
            vec3 drawn = environment_sample(turned, u1, u2, &radiance_turned, &pdf_turned);
            assert_true(v3_length(v3_sub(drawn, expected)) < 1e-5f);
            close_to(radiance_turned, radiance, 3e-5);
            if (k == 0) /* not turned: bit by bit */
                assert_true(memcmp(&drawn, &d, sizeof d) == 0 && pdf == pdf_turned);
        }
        if (k == 2 || k == 3) /* by whole cells of the quadrature */
            check_map(turned, 400, 100000, 1e-4);
    }
    environment_free(straight);
    environment_free(turned);
    image_free(&map);
    environment *uniform = environment_uniform(v3(1, 2, 3));
    environment_rotate(uniform, 50.0);
    check_map(uniform, 200, 20000, 1e-4);
    environment_free(uniform);
}

/* Texels so narrow that rounding often carries a sample over the border into the dark. */
static void rounding_never_loses_the_density(void **state)
{
    (void)state;
    image map = sun_map(1u << 17, 2, 90001, 0);
    environment *e = from(&map);
    rng r = rng_make(8, 8);
    for (int n = 0; n < 100000; ++n) {
        rgb c;
        float pdf, u1 = rng_float(&r), u2 = rng_float(&r);
        vec3 d = environment_sample(e, u1, u2, &c, &pdf);
        assert_true(pdf > 0.0f && environment_pdf(e, d) > 0.0f);
    }
    environment_free(e);
    image_free(&map);
}

/* Any number at once gives what each alone gives, and the lookups agree with each other. Widths around the 16 and 256
 * of a table's lines. */
static void batches_equal_single_samples(void **state)
{
    (void)state;
    enum { COUNT = 77 };
    static const uint32_t sizes[][2] = {{0, 0}, {1, 1}, {15, 17}, {16, 16}, {17, 300}, {256, 3}, {257, 5}, {5000, 2}};
    for (size_t k = 0; k < 2 * sizeof sizes / sizeof *sizes; ++k) {
        uint32_t width = sizes[k / 2][0], height = sizes[k / 2][1]; /* suns: with rows and columns of no probability */
        image map = width == 0 ? (image){0, 0, NULL}
                    : k & 1    ? sun_map(width, height, width / 2, height / 2)
                               : noise_map(width, height, 9.0f);
        environment *e = width ? from(&map) : environment_uniform(v3(1, 2, 3));
        rng r = rng_make(12, k);
        for (uint32_t count = 0; count <= COUNT; ++count) {
            bool masked = count & 1 && !(k & 1); /* beside a sun, rounding may move a sample below its normal */
            float u1[COUNT], u2[COUNT], pdf[COUNT + 1], one, again;
            vec3 d[COUNT + 1], normals[COUNT], at;
            rgb c[COUNT + 1], radiance;
            for (uint32_t i = 0; i < count; ++i) {
                u1[i] = i == 3 ? 0.0f : i == 4 ? 0x1.fffffep-1f : rng_float(&r);
                normals[i] = v3(rng_float(&r) - 0.5f, rng_float(&r) - 0.5f, 0.0f);
                u2[i] = i == 4 ? 0.0f : i == 5 ? 0x1.fffffep-1f : rng_float(&r);
            }
            d[count] = c[count] = v3(7, 7, 7);
            pdf[count] = 7.0f;
            environment_sample_batch(e, count, u1, u2, masked ? normals : NULL, d, c, pdf);
            assert_true(d[count].x == 7.0f && c[count].x == 7.0f && pdf[count] == 7.0f);
            for (uint32_t i = 0; i < count; ++i) {
                at = environment_sample(e, u1[i], u2[i], &radiance, &one);
                if (masked && !(v3_dot(normals[i], d[i]) > 0.0f)) {
                    assert_true(pdf[i] == 0.0f && c[i].x == 0.0f && c[i].y == 0.0f && c[i].z == 0.0f);
                    continue;
                }
                assert_memory_equal(&at, &d[i], sizeof at);
                assert_memory_equal(&radiance, &c[i], sizeof radiance);
                assert_true(one == pdf[i] && one > 0.0f && fabsf(v3_length(at) - 1.0f) < 1e-5f);
                radiance = environment_lookup(e, at, &again);
                close_to(radiance, environment_radiance(e, at), 0.0);
                assert_true(again == environment_pdf(e, at));
            }
        }
        environment_free(e);
        image_free(&map);
    }
}

static void angles_are_those_of_libm(void **state)
{
    (void)state;
    for (int i = 0; i <= 200000; ++i) {
        double t = (i - 100000) / 200000.0, sine, cosine, radius = exp2((i * 37) % 120 - 60);
        float s, c;
        angle_turn(t, &s, &c);
        sine = sin(2.0 * pi * t), cosine = cos(2.0 * pi * t);
        assert_true(fabs((double)s - sine) < 1.2e-7 && fabs((double)c - cosine) < 1.2e-7);
        float y = (float)(radius * sine), x = (float)(radius * cosine);
        double angle = atan2((double)y, (double)x);
        if (!(fabs((double)angle_atan2(y, x) - angle) <= 2.5e-7 * fabs(angle)))
            fail_msg("atan2(%g, %g): %.9g, not %.9g", (double)y, (double)x, (double)angle_atan2(y, x), angle);
    }
    assert_true(angle_atan2(0.0f, 0.0f) == 0.0f && angle_atan2(0.0f, 1.0f) == 0.0f);
    assert_true(fabs((double)angle_atan2(0.0f, -1.0f) - pi) < 2e-7 &&
                fabs((double)angle_atan2(-1.0f, 0.0f) + pi / 2) < 2e-7);
}

/* Counts per texel against the density times the solid angle. */
static void samples_follow_the_density(void **state)
{
    (void)state;
    enum { WIDTH = 12, HEIGHT = 6, SAMPLES = 400000 };
    image map = noise_map(WIDTH, HEIGHT, 5.0f);
    environment *e = from(&map);
    static int counts[WIDTH * HEIGHT];
    memset(counts, 0, sizeof counts);
    rng r = rng_make(9, 1);
    for (int n = 0; n < SAMPLES; ++n) {
        rgb c;
        float pdf, u1 = rng_float(&r), u2 = rng_float(&r);
        vec3 d = environment_sample(e, u1, u2, &c, &pdf);
        int i = (int)((0.5 + atan2(d.x, -d.z) / (2 * pi)) * WIDTH), j = (int)(acos(d.y) / pi * HEIGHT);
        ++counts[(j < HEIGHT ? j : HEIGHT - 1) * WIDTH + (i < WIDTH ? i : WIDTH - 1)];
    }
    for (int j = 0; j < HEIGHT; ++j)
        for (int i = 0; i < WIDTH; ++i) {
            double solid_angle = 2 * pi / WIDTH * (cos(pi * j / HEIGHT) - cos(pi * (j + 1) / HEIGHT));
            double p = solid_angle * environment_pdf(e, direction_at((i + 0.5) / WIDTH, (j + 0.5) / HEIGHT));
            double sigma = sqrt(SAMPLES * p * (1 - p));
            assert_true(fabs(counts[j * WIDTH + i] - SAMPLES * p) <= 4.5 * sigma);
        }
    environment_free(e);
    image_free(&map);
}

static void uniform_and_black_are_drawn_uniformly(void **state)
{
    (void)state;
    environment *e = environment_uniform(v3(1, 2, 3));
    check_map(e, 200, 20000, 1e-4);
    close_to(environment_mean(e), v3(1, 2, 3), 0.0);
    close_to(environment_radiance(e, v3(0, 0, 1)), v3(1, 2, 3), 0.0);
    assert_true(fabs(environment_pdf(e, v3(1, 0, 0)) - 1 / (4 * pi)) < 1e-7);
    double moments[3] = {0, 0, 0};
    rng r = rng_make(4, 4);
    for (int n = 0; n < 100000; ++n) {
        rgb c;
        float pdf, u1 = rng_float(&r), u2 = rng_float(&r);
        vec3 d = environment_sample(e, u1, u2, &c, &pdf);
        moments[0] += d.x / 1e5;
        moments[1] += d.y / 1e5;
        moments[2] += d.z * (double)d.z / 1e5;
    }
    assert_true(fabs(moments[0]) < 0.008 && fabs(moments[1]) < 0.008 && fabs(moments[2] - 1.0 / 3) < 0.004);
    environment_free(e);

    image map = image_new(8, 4);
    e = from(&map);
    check_map(e, 200, 1000, 0.0);
    environment_free(e);
    image_free(&map);
}

/* A white map gives 1 / (4 pi) everywhere: the rows' solid angles are right. */
static void white_map_is_uniform(void **state)
{
    (void)state;
    image map = image_new(20, 10);
    for (int i = 0; i < 200; ++i)
        map.pixels[i] = v3(2, 2, 2);
    environment *e = from(&map);
    for (int j = 0; j < 100; ++j)
        assert_true(fabs(environment_pdf(e, direction_at(0.3, (j + 0.5) / 100)) * 4 * pi - 1) < 1e-5);
    close_to(environment_mean(e), v3(2, 2, 2), 1e-6);
    environment_free(e);
    image_free(&map);
}

/* --- bad input --- */

static void bad_values_become_black(void **state)
{
    (void)state;
    image map = image_new(4, 2);
    for (int i = 0; i < 8; ++i)
        map.pixels[i] = v3(1, 1, 1);
    map.pixels[0] = v3(NAN, 1, 1);
    map.pixels[1] = v3(1, INFINITY, 1);
    map.pixels[2] = v3(1, 1, -4);
    notice_enable(false);
    environment *e = from(&map);
    notice_enable(true);
    close_to(environment_radiance(e, direction_at(0.125, 0.25)), v3(0, 1, 1), 1e-5);
    close_to(environment_radiance(e, direction_at(0.375, 0.25)), v3(1, 0, 1), 1e-5);
    close_to(environment_radiance(e, direction_at(0.625, 0.25)), v3(1, 1, 0), 1e-5);
    check_map(e, 400, 20000, 1e-4);
    environment_free(e);

    image_free(&map);

    map = image_new(4, 4); /* the largest and the smallest floats */
    for (int i = 0; i < 16; ++i)
        map.pixels[i] = i < 4 ? v3(3.4e38f, 3.4e38f, 3.4e38f) : v3(1e-44f, 0, 0);
    e = from(&map);
    assert_true(isfinite(environment_mean(e).x));
    assert_true(environment_radiance(e, v3(0, -1, 0)).x > 0.0f);
    assert_true(environment_pdf(e, v3(0, -1, 0)) > 0.0f && isfinite(environment_pdf(e, v3(0, 1, 0))));
    environment_free(e);
    image_free(&map);

    image empty = {0, 0, NULL};
    e = (environment *)&empty;
    assert_false(environment_from_image(&empty, &e, &err));
    assert_null(e);
    assert_false(environment_load("/nowhere/at/all.hdr", &e, &err));
    assert_null(e);
    assert_non_null(strstr(err.text, "/nowhere/at/all.hdr"));
    environment_free(NULL);
}

static void sample_maps_hold(void **state)
{
    (void)state;
    const char *root = getenv("VCACHE_SCENES");
    char folder[400], path[700];
    snprintf(folder, sizeof folder, "%s/hdri", root ? root : "../shared/scenes");
    DIR *d = opendir(folder);
    if (!d) {
        print_message("SKIPPED: no %s\n", folder);
        skip();
    }
    for (struct dirent *f = readdir(d); f; f = readdir(d)) {
        if (!strstr(f->d_name, ".hdr") && !strstr(f->d_name, ".exr"))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, f->d_name);
        environment *e = NULL;
        if (!environment_load(path, &e, &err))
            fail_msg("%s", err.text);
        check_map(e, strstr(f->d_name, ".exr") ? 1024 : 512, 200000, 2e-3);
        environment_free(e);
    }
    closedir(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(axes_map_as_documented),
        cmocka_unit_test(lookup_is_bilinear),
        cmocka_unit_test(maps_are_sampled_right),
        cmocka_unit_test(suns_are_sampled_right),
        cmocka_unit_test(samples_follow_the_density),
        cmocka_unit_test(batches_equal_single_samples),
        cmocka_unit_test(angles_are_those_of_libm),
        cmocka_unit_test(rotated_maps_are_the_same_turned),
        cmocka_unit_test(rounding_never_loses_the_density),
        cmocka_unit_test(uniform_and_black_are_drawn_uniformly),
        cmocka_unit_test(white_map_is_uniform),
        cmocka_unit_test(bad_values_become_black),
        cmocka_unit_test(sample_maps_hold),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
