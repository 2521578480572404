/* SPDX-License-Identifier: Apache-2.0 */
/* Starts of light paths one by one: what belongs to what, power, extremes. */
#include "light_sources.h"
#include "tracer.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

#include "lit_room.h"
#include "tally.h"

/* ------------------------------------------------------------------------------------------------- one by one */

/* An eye path that runs against the ray finds it with the same densities. */
static bool check_emitter(const room *r, const tracer *t, const light_emission *y)
{
    surface hit;
    float direct, ray;
    assert_true(v3_dot(v3_sub(y->origin, y->position), y->normal) > 0.0f);
    assert_true(v3_length(v3_sub(y->origin, y->position)) < 1e-4f);
    assert_true(close_to(y->cosine, v3_dot(y->normal, y->direction), 1e-6));
    assert_true(y->cosine > 0.0f);
    if (!tracer_closest_emitter(t, v3_mad(y->position, 0.3f, y->direction), v3_neg(y->direction), &hit))
        return false; /* at an edge */
    assert_true(v3_length(v3_sub(hit.position, y->position)) < 1e-3f);
    light_sources_emitter_pdf(r->l, &hit, &direct, &ray);
    assert_true(close_to(direct, y->pdf_direct, 1e-5));
    assert_true(close_to(ray, y->pdf_ray, 1e-5 + 1e-6 / (double)y->cosine));
    assert_true(same_rgb(y->radiance, surface_emission(&hit), 0.0));
    return true;
}

static void check_disc(const room *r, const light_emission *y)
{
    vec3 off = v3_sub(y->position, center_of(r->s));
    float radius = radius_of(r->s), along = v3_dot(off, y->direction);
    assert_true(along < -radius);
    assert_true(v3_length(v3_mad(off, -along, y->direction)) < 1.00001f * radius);
}

static void check_sky(const room *r, const light_emission *y)
{
    vec3 to_light = v3_neg(y->direction);
    float direct, ray;
    light_sources_environment_pdf(r->l, to_light, &direct, &ray);
    assert_true(close_to(direct, y->pdf_direct, 1e-5) && close_to(ray, y->pdf_ray, 1e-5));
    assert_true(same_rgb(y->radiance, environment_radiance(r->s->environment, to_light), 1e-5));
    check_disc(r, y);
}

static void check_punctual(const room *r, const light_emission *y)
{
    const light *from = &r->s->lights[y->light];
    if (y->kind == SOURCE_DIRECTIONAL) {
        assert_int_equal(from->kind, LIGHT_DIRECTIONAL);
        assert_memory_equal(&y->direction, &from->direction, sizeof(vec3));
        check_disc(r, y);
    } else {
        assert_int_not_equal(from->kind, LIGHT_DIRECTIONAL);
        assert_memory_equal(&y->position, &from->position, sizeof(vec3));
    }
}

static void densities_of_draws(void **state)
{
    (void)state;
    room r = room_of(furnished(), true);
    tracer *t;
    message err = {{0}};
    assert_true(tracer_create(r.s, 1, &t, &err));
    rng random = rng_make(1, 1);
    int drawn[PLACES] = {0}, lost = 0;
    for (int i = 0; i < 100000; i++) {
        light_emission y;
        if (!emit(&r, &random, &y))
            continue;
        float pdf;
        rgb sent = light_sources_radiance(r.l, &y, y.direction, &pdf);
        assert_true(same_rgb(sent, y.radiance, 1e-6));
        assert_true(fabsf(v3_length(y.direction) - 1.0f) < 1e-5f);
        assert_true(same_rgb(y.flux, v3_scale(y.radiance, y.cosine / y.pdf_ray), 1e-5));
        if (y.kind != SOURCE_ENVIRONMENT || pdf > 0.0f)
            assert_true(close_to(y.pdf_direct * pdf, y.pdf_ray, 1e-5));
        if (y.kind == SOURCE_EMITTER)
            lost += !check_emitter(&r, t, &y);
        else
            assert_true(y.cosine == 1.0f && memcmp(&y.origin, &y.position, sizeof(vec3)) == 0);
        if (y.kind == SOURCE_ENVIRONMENT)
            check_sky(&r, &y);
        if (y.kind == SOURCE_POINT || y.kind == SOURCE_DIRECTIONAL)
            check_punctual(&r, &y);
        drawn[place_of(&y)]++;
    }
    for (int k = 0; k < PLACES; k++)
        assert_true(drawn[k] > 1000);
    assert_true(lost < 5);
    assert_true(close_to(light_sources_disc_radius(r.l), radius_of(r.s), 1e-6));
    tracer_free(t);
    room_free(&r);
}

/* ---------------------------------------------------------------------------------------------------------- power */

static rgb known_power(const scene *s, place from)
{
    double area, sum = 0.0, disc = pi * (double)radius_of(s) * radius_of(s);
    const light *l = &s->lights[from >= BULB && from <= SUN ? from - BULB : 0];
    switch (from) {
    case LAMP:
        area = v3_length(v3_cross(lamp.ab, lamp.ac));
        return v3_scale(lamp_radiance, (float)(pi * area));
    case PANEL_FRONT:
    case PANEL_BACK:
        area = v3_length(v3_cross(panel.ab, panel.ac));
        return v3_scale(panel_radiance, (float)(pi * area));
    case BULB:
        return v3_scale(l->intensity, (float)(4.0 * pi));
    case SPOT: /* squared ramp of the cosine from 0.6 to 0.9, 1 beyond */
        for (int i = 0; i < 10000; i++) {
            double ramp = fmin(1.0, 0.4 * (i + 0.5) / 10000 / 0.3);
            sum += ramp * ramp * 0.4 / 10000;
        }
        return v3_scale(l->intensity, (float)(2.0 * pi * sum));
    case SUN:
        return v3_scale(l->intensity, (float)disc);
    case SKY:
        return v3_scale(environment_mean(s->environment), (float)(4.0 * pi * disc));
    case PLACES:
        break;
    }
    return v3(0, 0, 0);
}

static void flux_adds_up_to_the_power(void **state)
{
    (void)state;
    room r = room_of(furnished(), true);
    rng random = rng_make(3, 1);
    tally flux[PLACES][3] = {{{0, 0, 0}}};
    for (int i = 0; i < 300000; i++) {
        light_emission y;
        place from = emit(&r, &random, &y) ? place_of(&y) : PLACES;
        for (int k = 0; k < PLACES; k++)
            for (int c = 0; c < 3; c++)
                tally_add(&flux[k][c], k == (int)from ? (double)(&y.flux.x)[c] : 0.0);
    }
    for (int k = 0; k < PLACES; k++)
        for (int c = 0; c < 3; c++) {
            rgb power = known_power(r.s, (place)k);
            double expected = (&power.x)[c], mean = tally_mean(&flux[k][c]), error = tally_error(&flux[k][c]);
            assert_true(error < 0.03 * expected);
            if (!(fabs(mean - expected) <= 3.0 * error))
                fail_msg("place %d, channel %d: %.5f +- %.5f W, expected %.5f", k, c, mean, error, expected);
        }
    room_free(&r);
}

/* -------------------------------------------------------------------------------------------------- single values */

static void radiance_by_direction(void **state)
{
    (void)state;
    room r = room_of(furnished(), true);
    const light *spot = &r.s->lights[1];
    light_emission bulb = {.kind = SOURCE_POINT}, cone = {.kind = SOURCE_POINT, .light = 1};
    light_emission shade = {.kind = SOURCE_EMITTER, .normal = v3(0, 1, 0), .radiance = v3(1, 2, 3)};
    float pdf;
    assert_true(same_rgb(light_sources_radiance(r.l, &bulb, v3(0, 1, 0), &pdf), v3(2, 3, 1), 0.0));
    assert_true(close_to(pdf, 0.25 / pi, 1e-6));
    assert_true(same_rgb(light_sources_radiance(r.l, &cone, around(spot->direction, 0.95, 0.2), &pdf), v3(6, 4, 2), 0));
    assert_true(close_to(pdf, 1.0 / (0.8 * pi), 1e-5));
    assert_true(same_rgb(light_sources_radiance(r.l, &cone, around(spot->direction, 0.75, 0.7), &pdf),
                         v3(1.5f, 1, 0.5f), 1e-5));
    assert_true(close_to(pdf, 1.0 / (0.8 * pi), 1e-5)); /* fall-off does not count */
    assert_true(light_sources_radiance(r.l, &cone, around(spot->direction, 0.59, 0.7), &pdf).x == 0.0f && pdf == 0.0f);
    assert_true(light_sources_radiance(r.l, &shade, v3(0.6f, 0.8f, 0), &pdf).z == 3.0f);
    assert_true(close_to(pdf, 0.8 / pi, 1e-6));
    assert_true(light_sources_radiance(r.l, &shade, v3(0.6f, -0.8f, 0), &pdf).z == 0.0f && pdf == 0.0f);
    room_free(&r);
}

static void what_is_not_drawn_has_no_density(void **state)
{
    (void)state;
    room r = room_of(furnished(), false);
    surface hit = {.geometric_normal = v3(0, 1, 0), .wo = v3(0, 1, 0), .material = &r.s->materials[1]};
    float direct, ray;
    light_sources_emitter_pdf(r.l, &hit, &direct, &ray);
    assert_true(direct > 0.0f && close_to(ray, direct / pi, 1e-6));
    hit.back_side = true;
    light_sources_emitter_pdf(r.l, &hit, &direct, &ray);
    assert_true(direct == 0.0f && ray == 0.0f);
    hit.material = &r.s->materials[0];
    light_sources_emitter_pdf(r.l, &hit, &direct, &ray);
    assert_true(direct == 0.0f && ray == 0.0f);
    light_sources_environment_pdf(r.l, v3(0, 1, 0), &direct, &ray);
    assert_true(direct == 0.0f && ray == 0.0f);
    rng random = rng_make(4, 1);
    for (int i = 0; i < 10000; i++) {
        light_emission y;
        assert_false(emit(&r, &random, &y) && y.kind == SOURCE_ENVIRONMENT);
    }
    light_sources *others = light_sources_new(r.s, NULL, true); /* without emitters */
    hit.material = &r.s->materials[2];
    light_sources_emitter_pdf(others, &hit, &direct, &ray);
    assert_true(direct == 0.0f && ray == 0.0f);
    light_sources_free(others);
    room_free(&r);
}

static void nothing_emits(void **state)
{
    (void)state;
    scene *s = scene_new("dark");
    add_quad(s, v3(0, 0, 0), v3(0, 0, 1), v3(1, 0, 0), add_material(s, MATERIAL_DIFFUSE, 0.5f));
    add_point_light(s, v3(0, 1, 0), 0.0f);
    s->environment = environment_uniform(v3(0, 0, 0));
    room r = room_of(s, true);
    assert_null(r.l);
    r.s->lights[0].intensity.y = 1.0f;
    r.l = light_sources_new(r.s, r.e, true);
    assert_non_null(r.l);
    room_free(&r);
}

static void extreme_numbers_stay_in_range(void **state)
{
    (void)state;
    room r = room_of(furnished(), true);
    const float ends[] = {0.0f, 0.5f, 1.0f - 0x1p-24f};
    for (int choice = 0; choice <= 1000; choice++)
        for (int i = 0; i < 243; i++) {
            float u[6] = {float_min((float)choice / 1000.0f, ends[2])};
            for (int k = 1, rest = i; k < 6; rest /= 3, k++)
                u[k] = ends[rest % 3];
            light_emission y;
            if (!light_sources_emit(r.l, u, &y))
                continue;
            assert_true(isfinite(y.origin.x + y.origin.y + y.origin.z) && fabsf(v3_length(y.direction) - 1) < 1e-5f);
            assert_true(y.pdf_direct > 0.0f && y.pdf_ray > 0.0f && isfinite(y.pdf_ray) && y.cosine > 0.0f);
            assert_true(y.flux.y > 0.0f && isfinite(y.flux.x + y.flux.y + y.flux.z));
        }
    room_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(densities_of_draws),    cmocka_unit_test(flux_adds_up_to_the_power),
        cmocka_unit_test(radiance_by_direction), cmocka_unit_test(what_is_not_drawn_has_no_density),
        cmocka_unit_test(nothing_emits),         cmocka_unit_test(extreme_numbers_stay_in_range),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
