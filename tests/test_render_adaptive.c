/* SPDX-License-Identifier: Apache-2.0 */
/* Frames with adaptive shadow testing (Ward 1991): equal to exact ones, bounded, alike for any number of threads. */
#include "../renderers/common/metrics.h"
#include "render_support.h"

#include "../renderers/common/light_sources.h"

static stage conference(const char *name, uint32_t width, uint32_t height)
{
    scene *s = NULL;
    assert_true(scene_builtin(name, &s));
    return stage_new(s, s->cameras[0], width, height, 1);
}

/* Of all tests, what was done. */
static double tested(const frame *f)
{
    return (double)f->rays.traced / (double)f->rays.asked;
}

static frame render(stage *g, visibility_mode mode, float tolerance, float certainty)
{
    frame f;
    message err = {{0}};
    settings *s = &g->v.settings;
    s->visibility = mode;
    s->tolerance = tolerance;
    s->certainty = certainty;
    if (!frame_render(&g->v, "test", true, NULL, NULL, &f, &err))
        fail_msg("%s", err.text);
    assert_sane(&f);
    return f;
}

/* Rendered and freed: what is left is how far it is from `exact`. */
static image_error error_of(stage *g, float tolerance, float certainty, const frame *exact, double *share)
{
    frame f = render(g, VISIBILITY_ADAPTIVE, tolerance, certainty);
    image_error e = image_compare(&f.lit, &exact->lit);
    *share = tested(&f);
    frame_free(&f);
    return e;
}

/* ------------------------------------------------------------------------------------------------------- equality */

/* All kinds of light and material. At t = 0 it is the exact mode; at the least t > 0 all goes the way of the method. */
static void zero_tolerance(void **state)
{
    (void)state;
    stage stages[] = {mixed_stage(50, 40, 3), conference("conference-lights-1000", 40, 30)};
    for (size_t i = 0; i < sizeof stages / sizeof *stages; i++) {
        stage *g = &stages[i];
        frame exact = render(g, VISIBILITY_EXACT, 0.0f, 0.0f);
        for (int certain = 0; certain < 2; certain++) {
            frame none = render(g, VISIBILITY_ADAPTIVE, 0.0f, (float)certain);
            frame least = render(g, VISIBILITY_ADAPTIVE, 1e-37f, (float)certain);
            assert_true(same_images(&exact.lit, &none.lit) && same_images(&exact.image, &none.image));
            assert_true(same_images(&exact.lit, &least.lit));
            assert_int_equal(lights_of(&none)->served, VISIBILITY_EXACT);
            assert_int_equal(lights_of(&least)->served, VISIBILITY_ADAPTIVE);
            assert_int_equal(none.rays.traced, exact.rays.traced);
            assert_true(least.rays.asked > exact.rays.asked); /* the pilot */
            frame_free(&none);
            frame_free(&least);
        }
        frame_free(&exact);
        stage_free(g);
    }
}

static void threads_change_nothing(void **state)
{
    (void)state;
    stage g = conference("conference-lights-floating", 140, 75);
    frame one = render(&g, VISIBILITY_ADAPTIVE, 0.3f, 0.25f);
    const int threads[] = {2, 3, 7};
    for (int i = 0; i < 3; i++) {
        g.v.settings.threads = threads[i];
        frame more = render(&g, VISIBILITY_ADAPTIVE, 0.3f, 0.25f);
        assert_true(same_images(&one.lit, &more.lit));
        assert_int_equal(one.rays.traced, more.rays.traced);
        frame_free(&more);
    }
    frame_free(&one);
    stage_free(&g);
}

/* Rates that are learnt on the way: the same picture with one thread, about the same with several. */
static void threads_share_rates(void **state)
{
    (void)state;
    stage g = conference("conference-lights-floating", 140, 75);
    g.v.settings.shared = true;
    frame one = render(&g, VISIBILITY_ADAPTIVE, 0.3f, 0.25f), again = render(&g, VISIBILITY_ADAPTIVE, 0.3f, 0.25f);
    assert_true(same_images(&one.lit, &again.lit));
    g.v.settings.threads = 3;
    frame more = render(&g, VISIBILITY_ADAPTIVE, 0.3f, 0.25f);
    assert_true(image_compare(&more.lit, &one.lit).mean_relative < 0.02);
    assert_int_equal(more.rays.traced, one.rays.traced); /* rates do not decide what is tested */
    frame_free(&one);
    frame_free(&again);
    frame_free(&more);
    stage_free(&g);
}

/* --------------------------------------------------------------------------------------------------------- errors */

/* At c = 1 the luminance of every point is within t of the exact one, and so is that of pixels of several; of virtual
 * lights as well. */
static void bounded(void **state)
{
    (void)state;
    const char *const names[] = {"conference-lights-floating", "conference-lights-192-floating",
                                 "conference-lights-diffuse", "conference-lights"};
    for (size_t n = 0; n < sizeof names / sizeof *names; n++) {
        stage g = conference(names[n], 120, 70);
        if (n == 3)
            g.v.settings.vpls = 128, g.v.settings.spp = 2;
        frame exact = render(&g, VISIBILITY_EXACT, 0.0f, 0.0f);
        for (float t = 0.05f; t < 1.0f; t *= 3.0f) {
            frame f = render(&g, VISIBILITY_ADAPTIVE, t, 1.0f);
            double worst = 0.0;
            for (size_t i = 0; i < 120 * 70; i++) {
                double a = (double)luminance(f.lit.pixels[i]), b = (double)luminance(exact.lit.pixels[i]);
                assert_true(fabs(a - b) <= (double)t * b * (1.0 + 1e-4));
                worst = fmax(worst, b > 0.0 ? fabs(a - b) / b : 0.0);
            }
            print_message("%s, t %g: largest error %.3f, tests %.1f %%\n", names[n], (double)t, worst,
                          100.0 * tested(&f));
            assert_true(worst > 0.2 * (double)t); /* it is used */
            frame_free(&f);
        }
        frame_free(&exact);
        stage_free(&g);
    }
}

static void targets(void **state)
{
    (void)state;
    stage g = conference("conference-lights-floating", 192, 108);
    frame exact = render(&g, VISIBILITY_EXACT, 0.0f, 0.0f);
    double share;
    image_error e = error_of(&g, 0.2f, 0.5f, &exact, &share);
    print_message("floating: %.1f %% fewer tests, error %.2f %%\n", 100.0 * (1.0 - share), 100.0 * e.mean_relative);
    assert_true(share < 0.2 && e.mean_relative < 0.05);
    /* what was learnt on the way only makes it worse */
    g.v.settings.shared = true;
    image_error way = error_of(&g, 0.2f, 0.5f, &exact, &share);
    print_message("with rates learnt on the way %.2f %%\n", 100.0 * way.mean_relative);
    assert_true(e.mean_relative < 0.75 * way.mean_relative);
    frame_free(&exact);
    stage_free(&g);

    const char *const names[] = {"conference-lights-192-floating", "conference-lights-diffuse"};
    for (int n = 0; n < 2; n++) {
        g = conference(names[n], 96, 54);
        exact = render(&g, VISIBILITY_EXACT, 0.0f, 0.0f);
        double before = 0.0;
        for (float c = 0.5f; c <= 1.0f; c += 0.5f)
            for (float t = 0.1f; t < 0.5f; t += 0.2f)
                assert_true(error_of(&g, t, c, &exact, &share).mean_relative < (double)t);
        for (float c = 1.0f; c >= 0.0f; c -= 0.25f) { /* the less certain, the fewer tests, the larger errors */
            e = error_of(&g, 0.2f, c, &exact, &share);
            assert_true(e.max_relative >= 0.9 * before);
            before = e.max_relative;
        }
        frame_free(&exact);
        stage_free(&g);
    }
}

/* ------------------------------------------------------------------------------------------------------ behaviour */

/* A lid below the lights: nobody sees any, so all are tested, and nothing is guessed. */
static void nothing_visible(void **state)
{
    (void)state;
    scene *s = scene_new("lid");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f);
    add_box(s, v3(-2, -0.1f, -2), v3(2, 0, 2), 63, grey);
    add_box(s, v3(-9, 3.0f, -9), v3(9, 3.1f, 9), 63, grey);
    for (int i = 0; i < 40; i++)
        add_point_light(s, v3((float)(i % 8) - 3.5f, 4.0f, (float)(i / 8) - 2.0f), 1.0f + (float)i);
    stage g = stage_new(s, camera_look(v3(0, 2.5f, 0.1f), v3(0, 0, 0), v3(0, 1, 0), 0.8f), 40, 40, 1);
    frame f = render(&g, VISIBILITY_ADAPTIVE, 0.5f, 0.0f);
    assert_int_equal(f.rays.traced, f.rays.asked);
    assert_int_equal(f.rays.asked, (40 * 40 + 64) * 40);
    for (size_t i = 0; i < 40 * 40; i++)
        assert_true(luminance(f.lit.pixels[i]) == 0.0f);
    frame_free(&f);
    stage_free(&g);
}

/* A floor seen in a dim mirror needs fewer tests than the same seen directly, and what it is off by is still little
 * beside the tolerance of the whole. */
static void dim_reflections(void **state)
{
    (void)state;
    double share[2];
    frame bright;
    for (int dim = 0; dim < 2; dim++) {
        scene *s = scene_new("mirror");
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), mirror = add_material(s, MATERIAL_CONDUCTOR, 1.0f);
        s->materials[mirror].roughness = 0.0f;
        s->materials[mirror].color = dim ? v3(0.05f, 0.05f, 0.05f) : v3(1, 1, 1);
        add_quad(s, v3(-9, 0, -9), v3(0, 0, 18), v3(18, 0, 0), grey);
        add_quad(s, v3(-9, -1, -3), v3(18, 0, 0), v3(0, 12, 0), mirror);
        for (int i = 0; i < 36; i++)
            add_point_light(s, v3((float)(i % 6) - 2.5f, 2.0f, (float)(i / 6)), 1.0f);
        stage g = stage_new(s, camera_look(v3(0, 1, 1), v3(0, 0.6f, -3), v3(0, 1, 0), 0.4f), 32, 32, 1);
        frame f = render(&g, VISIBILITY_ADAPTIVE, 0.05f, 1.0f), exact = render(&g, VISIBILITY_EXACT, 0.0f, 0.0f);
        share[dim] = tested(&f);
        if (dim == 0)
            bright = exact;
        for (size_t i = 0; i < 32 * 32; i++) { /* within t of what an undimmed path would bring */
            double error = (double)(luminance(f.lit.pixels[i]) - luminance(exact.lit.pixels[i]));
            assert_true(fabs(error) <= 0.05 * (1.0 + 1e-4) * (double)luminance(bright.lit.pixels[i]));
        }
        frame_free(&f);
        if (dim == 1)
            frame_free(&exact);
        stage_free(&g);
    }
    frame_free(&bright);
    print_message("tested in a bright mirror %.1f %%, in a dim one %.1f %%\n", 100.0 * share[0], 100.0 * share[1]);
    assert_true(share[0] > 0.5 && share[1] < 0.7 * share[0]);
}

/* Tests that remain go through the cache: fewer rays than of both, errors that add up at most. */
static void with_cache(void **state)
{
    (void)state;
    stage g = conference("conference-lights-192-floating", 160, 90);
    g.v.settings.ce = 8.0f, g.v.settings.ce_delta = 2.0f;
    frame exact = render(&g, VISIBILITY_EXACT, 0.0f, 0.0f), cache = render(&g, VISIBILITY_CACHE, 0.0f, 0.0f);
    frame few = render(&g, VISIBILITY_ADAPTIVE, 0.2f, 0.5f), both = render(&g, VISIBILITY_ADAPTIVE_CACHE, 0.2f, 0.5f);
    frame none = render(&g, VISIBILITY_ADAPTIVE_CACHE, 0.0f, 0.5f);
    double of_cache = image_compare(&cache.lit, &exact.lit).l_inf, of_few = image_compare(&few.lit, &exact.lit).l_inf;
    double of_both = image_compare(&both.lit, &exact.lit).l_inf;
    print_message("rays: cache %.3f, adaptive %.3f, both %.3f; error: %.4f, %.4f, %.4f\n", tested(&cache), tested(&few),
                  tested(&both), of_cache, of_few, of_both);
    assert_true(both.rays.traced < few.rays.traced && both.rays.traced < cache.rays.traced);
    assert_true(of_both < 1.2 * (of_cache + of_few));
    assert_int_equal(lights_of(&both)->served, VISIBILITY_ADAPTIVE_CACHE);
    assert_int_equal(lights_of(&none)->served, VISIBILITY_CACHE);
    assert_true(same_images(&none.lit, &cache.lit));
    frame *all[] = {&exact, &cache, &few, &both, &none};
    for (int i = 0; i < 5; i++)
        frame_free(all[i]);
    stage_free(&g);
}

/* Area lights and sky, whose samples are sources, and virtual point lights: all of them at once. */
static void every_kind_of_light(void **state)
{
    (void)state;
    stage g = mixed_stage(96, 64, 1);
    frame exact = render(&g, VISIBILITY_EXACT, 0.0f, 0.0f);
    double share;
    image_error e = error_of(&g, 0.2f, 1.0f, &exact, &share);
    print_message("all kinds: tests %.1f %%, error %.2f %%\n", 100.0 * share, 100.0 * e.mean_relative);
    assert_true(share < 0.9 && e.mean_relative < 0.1);
    frame_free(&exact);
    stage_free(&g);
}

/* Rows of lights say what one light at a time does, whatever its fall-off. */
static void fall_offs(void **state)
{
    (void)state;
    static const uint32_t powers[] = {0, 1, 2, 3, 5, 8, 21, LIGHT_POWER_MAX};
    scene *s = scene_new("spots");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), gloss = add_material(s, MATERIAL_GLOSSY, 0.4f);
    add_box(s, v3(-2, -0.1f, -2), v3(2, 0, 2), 63, grey);
    add_box(s, v3(-0.8f, 0, -0.8f), v3(0.2f, 0.7f, 0.3f), 63, gloss);
    for (int i = 0; i < 8; i++)
        for (int hard = 0; hard < 2; hard++)
            scene_add_light(s, (light){.kind = LIGHT_SPOT,
                                       .position = v3(0.2f * (float)i - 0.8f, 2.0f, 0.3f),
                                       .direction = v3_normalize(v3(0.1f, -1, 0.1f * (float)i)),
                                       .intensity = v3(1, 2, 3),
                                       .cos_inner = hard ? 0.8f : 1.0f,
                                       .cos_outer = hard ? 0.8f : 0.1f * (float)i,
                                       .power = powers[i]});
    stage g = stage_new(s, camera_look(v3(0, 3, 2), v3(0, 0, 0), v3(0, 1, 0), 0.8f), 32, 32, 1);
    punctual_set rows = punctuals_new(s, s->light_count);
    float *geometry = floats_new(rows.padded);
    uint32_t lit = 0, dark = 0;
    for (int y = 0; y < 32; y++)
        for (int x = 0; x < 32; x++) {
            vec3 p = floor_point(&g.v, x + 0.5, y + 0.5);
            eye_sample e = {.weight = v3(1, 1, 1)};
            vec3 d = v3_normalize(v3_sub(p, g.v.camera.eye));
            if (!tracer_closest(g.t, g.v.camera.eye, d, &e.surface))
                continue;
            e.origin = surface_offset(&e.surface, e.surface.geometric_normal);
            punctuals_geometry(&rows, &e, geometry);
            for (uint32_t i = 0; i < s->light_count; i++) {
                float one = luminance(direct_punctual(&e, &s->lights[i]).value);
                float row = geometry[i] > 0.0f ? geometry[i] * luminance(punctuals_response(&rows, &e, i)) : 0.0f;
                assert_true(fabsf(one - row) <= 1e-4f * one + 1e-9f);
                lit += one > 0.0f, dark += one == 0.0f;
            }
        }
    assert_true(lit > 1000 && dark > 1000);
    free(geometry);
    punctuals_free(&rows);
    stage_free(&g);
    const light flat = {.direction = {0, -1, 0}, .cos_inner = 1.0f, .power = 1}; /* a diffuse emitter */
    assert_true(fabsf(spot_fall_off(&flat, v3_normalize(v3(1, -1, 0))) - sqrtf(0.5f)) < 1e-6f);
    assert_true(spot_fall_off(&flat, v3(0, 1, 0)) == 0.0f);
}

int main(int argc, char *argv[])
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(zero_tolerance),
        cmocka_unit_test(threads_change_nothing),
        cmocka_unit_test(threads_share_rates),
        cmocka_unit_test(bounded),
        cmocka_unit_test(targets),
        cmocka_unit_test(nothing_visible),
        cmocka_unit_test(dim_reflections),
        cmocka_unit_test(with_cache),
        cmocka_unit_test(every_kind_of_light),
        cmocka_unit_test(fall_offs),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
