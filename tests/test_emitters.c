/* SPDX-License-Identifier: Apache-2.0 */
/* Area light sampling: area, irradiance, shares, and agreement with what rays see. Estimates: fixed seed, 4 sigma. */
#include "emitters.h"
#include "scene_support.h"
#include "tracer.h"
#include "triangle.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

/* Mirrors, shears and moves. */
static const float sheared[12] = {-1.0f, 0.5f, 0.1f, 8.0f, 0.2f, 1.5f, -0.7f, -1.0f, 0.0f, 0.3f, 0.6f, 0.5f};

typedef struct estimate {
    double n, sum, squares;
} estimate;

static void add(estimate *e, double x)
{
    e->n += 1.0;
    e->sum += x;
    e->squares += x * x;
}

static void assert_estimates(estimate e, double expected)
{
    double mean = e.sum / e.n, sigma = sqrt(fmax(0.0, e.squares / e.n - mean * mean) / e.n);
    if (fabs(mean - expected) > 4.0 * sigma + 1e-5 * expected)
        print_error("estimate %g +- %g, expected %g\n", mean, sigma, expected);
    assert_true(fabs(mean - expected) <= 4.0 * sigma + 1e-5 * expected);
}

static material glow(rgb emission, bool two_sided)
{
    material m = plain_material(MATERIAL_DIFFUSE, v3(0.5f, 0.5f, 0.5f));
    m.emission = emission;
    m.two_sided = two_sided;
    return m;
}

/* The rectangle [0, a] x [0, b] at height y, facing down. */
static mesh ceiling(float a, float b, float y, uint32_t material_index)
{
    const vec3 corners[6] = {{0, y, 0}, {a, y, 0}, {a, y, b}, {0, y, 0}, {a, y, b}, {0, y, b}};
    return corners_mesh(corners, 2, material_index);
}

/* A dark soup, a one-sided rectangle (area 2), and a two-sided rectangle (1) that stands twice, once sheared. */
static scene *three_lights(double *sheared_area)
{
    rng r = rng_make(1, 1);
    scene *s = scene_new("lights");
    scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
    scene_add_material(s, glow(v3(3, 2, 1), false));
    scene_add_material(s, glow(v3(0, 0.5f, 4), true));
    place_mesh(s, scene_add_mesh(s, soup_mesh(&r, 50, 0.1f, 1.0f, v3(0, -20, 0), 0)), transform_identity);
    place_mesh(s, scene_add_mesh(s, ceiling(1, 2, 2, 1)), transform_identity);
    uint32_t m = scene_add_mesh(s, ceiling(1, 1, 4, 2));
    place_mesh(s, m, transform_identity);
    place_mesh(s, m, sheared);
    vec3 e1 = transform_vector(sheared, v3(1, 0, 0)), e2 = transform_vector(sheared, v3(0, 0, 1));
    *sheared_area = v3_length(v3_cross(e1, e2));
    return s;
}

static emitter_sample draw(const emitters *e, rng *r)
{
    float u1 = rng_float(r), u2 = rng_float(r), u3 = rng_float(r);
    return emitters_sample(e, u1, u2, u3);
}

static void areas_and_power(void **state)
{
    (void)state;
    double area;
    scene *s = three_lights(&area);
    emitters *e = emitters_new(s);
    rng r = rng_make(2, 1);
    estimate total = {0, 0, 0}, first = {0, 0, 0}, flux = {0, 0, 0};
    for (int i = 0; i < 100000; i++) {
        emitter_sample x = draw(e, &r);
        add(&total, 1.0 / (double)x.pdf_area);
        add(&first, x.radiance.x > 0.0f ? 1.0 / (double)x.pdf_area : 0.0);
        add(&flux, (double)(PI_F * luminance(x.radiance) / x.pdf_area));
    }
    double two_sides = 2.0 * (1.0 + area), dim = luminance(v3(3, 2, 1)), bright = luminance(v3(0, 0.5f, 4));
    assert_int_equal(emitters_count(e), 6);
    assert_estimates(total, 2.0 + two_sides);
    assert_estimates(first, 2.0);
    assert_estimates(flux, (double)PI_F * (2.0 * dim + two_sides * bright));
    assert_true(fabs(emitters_power(e) / ((double)PI_F * (2.0 * dim + two_sides * bright)) - 1.0) < 1e-5);
    emitters_free(e);
    scene_free(s);
}

/* Evenly spaced numbers meet each of many triangles as often as its part of the power says. */
static void shares_of_many_triangles(void **state)
{
    (void)state;
    enum { TRIANGLES = 700, STEPS = 1000000 };
    rng r = rng_make(6, 1);
    scene *s = scene_new("many");
    scene_add_material(s, glow(v3(1, 1, 1), false));
    vec3 corners[3 * TRIANGLES];
    double areas[TRIANGLES], total = 0.0, before = 0.0;
    for (int i = 0; i < TRIANGLES; i++) {
        float size = i % 50 == 7 ? 1.0f : i % 3 ? 0.003f : 0.1f; /* runs of small ones between large ones */
        corners[3 * i] = v3((float)i, 0, 0);
        corners[3 * i + 1] = v3((float)i, size * (0.5f + rng_float(&r)), 0);
        corners[3 * i + 2] = v3((float)i, 0, size);
        areas[i] = 0.5 * (double)corners[3 * i + 1].y * (double)size;
        total += areas[i];
    }
    place_mesh(s, scene_add_mesh(s, corners_mesh(corners, TRIANGLES, 0)), transform_identity);
    emitters *e = emitters_new(s);
    int step = 0;
    for (int i = 0; i < TRIANGLES; i++) {
        int count = 0;
        before += areas[i] / total;
        for (; step < STEPS; step++, count++)
            if (emitters_sample(e, (float)(((double)step + 0.5) / STEPS), 0.0f, 0.5f).position.x != (float)i)
                break;
        assert_true(fabs((double)step - before * STEPS) < 2.0); /* so no triangle is out of order either */
    }
    assert_int_equal(step, STEPS);
    emitters_free(e);
    scene_free(s);
}

/* Below a corner of a parallel rectangle: E = pi L F with the form factor of a differential patch. */
static void irradiance_under_a_rectangle(void **state)
{
    (void)state;
    const double a = 1.0, b = 2.0, h = 1.5, x = a / h, y = b / h, p = sqrt(1.0 + x * x), q = sqrt(1.0 + y * y);
    const double form_factor = (x / p * atan(y / p) + y / q * atan(x / q)) / (2.0 * (double)PI_F);
    for (int two_sided = 0; two_sided < 2; two_sided++) {
        scene *s = scene_new("ceiling");
        scene_add_material(s, glow(v3(5, 5, 5), two_sided));
        place_mesh(s, scene_add_mesh(s, ceiling((float)a, (float)b, (float)h, 0)), transform_identity);
        emitters *e = emitters_new(s);
        rng r = rng_make(3, 1);
        estimate below = {0, 0, 0};
        for (int i = 0; i < 100000; i++) {
            emitter_sample l = draw(e, &r);
            double d2 = v3_dot(l.position, l.position), cos_x = l.position.y / sqrt(d2);
            double cos_l = -v3_dot(l.normal, l.position) / sqrt(d2);
            add(&below, cos_l > 0.0 ? l.radiance.y * cos_x * cos_l / (d2 * (double)l.pdf_area) : 0.0);
        }
        assert_estimates(below, 5.0 * (double)PI_F * form_factor);
        emitters_free(e);
        scene_free(s);
    }
}

/* A ray onto a drawn point from the side drawn sees the same light, with the same density. */
static void rays_see_what_was_drawn(void **state)
{
    (void)state;
    double area;
    scene *s = three_lights(&area);
    emitters *e = emitters_new(s);
    tracer *t;
    message err = {""};
    assert_true(tracer_create(s, 1, &t, &err));
    rng r = rng_make(4, 1);
    int sides[4][2] = {{0, 0}, {0, 0}, {0, 0}, {0, 0}};
    for (int i = 0; i < 20000; i++) {
        emitter_sample x = draw(e, &r);
        surface h;
        assert_true(fabsf(v3_length(x.normal) - 1.0f) < 1e-5f);
        assert_true(tracer_closest(t, v3_mad(x.position, 0.5f, x.normal), v3_neg(x.normal), &h));
        assert_true(v3_length(v3_sub(h.position, x.position)) < 1e-5f);
        assert_true(v3_dot(h.geometric_normal, x.normal) > 0.99999f);
        assert_true(fabsf(emitters_pdf_area(e, &h) - x.pdf_area) < 1e-6f * x.pdf_area);
        rgb seen = surface_emission(&h);
        assert_true(seen.x == x.radiance.x && seen.y == x.radiance.y && seen.z == x.radiance.z);
        sides[h.instance][h.back_side]++;
    }
    assert_int_equal(sides[0][0] + sides[0][1], 0);
    assert_true(sides[1][0] > 1000 && sides[1][1] == 0);
    for (int i = 2; i < 4; i++) {
        int n = sides[i][0] + sides[i][1];
        assert_true(n > 1000 && fabs(sides[i][0] - 0.5 * n) < 4.0 * sqrt(0.25 * n));
    }
    emitters_free(e);
    tracer_free(t);
    scene_free(s);
}

/* The outside of a one-sided light stays the outside under a mirroring transform. */
static void mirrored_lights_shine_outwards(void **state)
{
    (void)state;
    const float mirror[12] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    scene *s = scene_new("mirrored");
    scene_add_material(s, glow(v3(1, 1, 1), false));
    place_mesh(s, scene_add_mesh(s, ceiling(1, 1, 2, 0)), mirror);
    emitters *e = emitters_new(s);
    emitter_sample x = emitters_sample(e, 0.5f, 0.5f, 0.5f);
    assert_true(x.position.x < 0.0f && x.normal.y == -1.0f);
    emitters_free(e);
    scene_free(s);
}

static void dark_sides_do_not_emit(void **state)
{
    (void)state;
    double area;
    scene *s = three_lights(&area);
    emitters *e = emitters_new(s);
    surface h = {.material = &s->materials[1]};
    assert_true(emitters_pdf_area(e, &h) > 0.0f && surface_emission(&h).x == 3.0f);
    h.back_side = true;
    assert_true(emitters_pdf_area(e, &h) == 0.0f && surface_emission(&h).x == 0.0f);
    h.material = &s->materials[2];
    assert_true(emitters_pdf_area(e, &h) > 0.0f && surface_emission(&h).z == 4.0f);
    h.material = &s->materials[0];
    assert_true(emitters_pdf_area(e, &h) == 0.0f && surface_emission(&h).x == 0.0f);
    emitters_free(e);
    scene_free(s);
}

static void extreme_numbers_stay_in_range(void **state)
{
    (void)state;
    double area;
    scene *s = three_lights(&area);
    emitters *e = emitters_new(s);
    const float u[] = {0.0f, 0.5f, 1.0f - 0x1p-24f};
    for (int i = 0; i < 27; i++) {
        emitter_sample x = emitters_sample(e, u[i % 3], u[i / 3 % 3], u[i / 9]);
        assert_true(isfinite(x.position.x) && fabsf(x.position.x) < 20.0f && x.pdf_area > 0.0f);
    }
    assert_true(emitters_sample(e, u[2], 0.5f, 0.5f).position.x > 4.0f); /* the last light: the sheared one */
    emitters_free(e);
    scene_free(s);
}

static void no_emitters_is_null(void **state)
{
    (void)state;
    rng r = rng_make(5, 1);
    scene *s = scene_new("dark");
    scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
    scene_add_material(s, glow(v3(1, 1, 1), false)); /* unused */
    place_mesh(s, scene_add_mesh(s, soup_mesh(&r, 50, 0.1f, 1.0f, v3(0, 0, 0), 0)), transform_identity);
    surface h = {.material = &s->materials[1]};
    assert_null(emitters_new(s));
    assert_int_equal(emitters_count(NULL), 0);
    assert_true(emitters_power(NULL) == 0.0f && emitters_pdf_area(NULL, &h) == 0.0f);
    emitters_free(NULL);
    scene_free(s);
}

/* The right normal and the right area at sizes whose squared areas no float can hold. */
static void normals_at_any_size(void **state)
{
    (void)state;
    for (int e = -50; e <= 50; e += 10)
        for (int needle = 0; needle < 2; needle++) {
            float s = ldexpf(1.0f, e), h = needle ? ldexpf(s, -20) : 2.0f * s, area;
            const vec3 p[3] = {v3(s, 2.0f * s, 3.0f * s), v3(3.0f * s, 2.0f * s, 3.0f * s),
                               v3(needle ? 3.0f * s : s, 2.0f * s + h, 3.0f * s)};
            vec3 n = triangle_normal(p, &area);
            assert_true(n.x == 0.0f && n.y == 0.0f && n.z == 1.0f);
            assert_true(area == s * h);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(areas_and_power),
        cmocka_unit_test(shares_of_many_triangles),
        cmocka_unit_test(irradiance_under_a_rectangle),
        cmocka_unit_test(rays_see_what_was_drawn),
        cmocka_unit_test(dark_sides_do_not_emit),
        cmocka_unit_test(mirrored_lights_shine_outwards),
        cmocka_unit_test(no_emitters_is_null),
        cmocka_unit_test(extreme_numbers_stay_in_range),
        cmocka_unit_test(normals_at_any_size),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
