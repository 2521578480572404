/* SPDX-License-Identifier: Apache-2.0 */
/* The light of bench/lighting.h against the renderer's own frames, and the measure of flicker. */
#include "bench/lighting.h"
#include "bench/temporal.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <string.h>

static stage of;

/* One region of the renderer, so that it has one cache as well. */
static int set_up(void **state)
{
    (void)state;
    static char *argv[] = {"lighting", "conference-lights-70", "--size", "96x80", "--spp", "4", "--vpls", "100"};
    int code;
    of = stage_defaults("lighting");
    of.cache_mb = 4;
    const option table[] = {STAGE_OPTIONS(&of)};
    return stage_open(&of, "", table, sizeof table / sizeof *table, sizeof argv / sizeof *argv, argv, &code) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    stage_free(&of);
    return 0;
}

static void assert_same(const image *a, const image *b)
{
    assert_memory_equal(a->pixels, b->pixels, (size_t)a->width * a->height * sizeof *a->pixels);
}

/* Bit for bit, and as many wrong pairs. */
static void as_the_renderer(void **state)
{
    (void)state;
    message err;
    view v = of.view;
    truth known = {0};
    frame exact, cached;
    assert_true(frame_render(&v, "", true, &known, NULL, &exact, &err));
    v.settings.visibility = VISIBILITY_CACHE;
    v.settings.ce = v.settings.ce_delta = 8.0f;
    assert_true(frame_render(&v, "", true, NULL, &known, &cached, &err));
    truth_free(&known);
    assert_true(cached.mispredicted > 100);

    eye_list eyes = eye_list_new(&of.view);
    assert_int_equal(eyes.count, exact.eye_samples);
    lit all = lighting_exact(&of.view, &of.lights, &eyes);
    assert_same(&all.image, &exact.lit);
    caches used;
    assert_true(caches_new(&v, &of.lights, &used, &err));
    visibility *by = visibility_new(&v, &of.lights, &used);
    uint32_t *order = xmalloc(eyes.count * sizeof *order);
    eyes_sort(eyes.pixel, eyes.count, v.settings.width, ORDER_HALTON, 4.0, order);
    lit some = lighting_render(&v, &of.lights, &eyes, order, lighting_resolve, by);
    assert_same(&some.image, &cached.lit);
    assert_int_equal(visibility_counts(by).traced, cached.rays.traced);
    double wrong = (double)cached.mispredicted / (double)cached.rays.asked;
    assert_float_equal(lit_mispredicted(&some, &all, eyes.count), wrong, 1e-9);
    assert_true(lit_mispredicted(&all, &all, eyes.count) == 0.0);

    visibility_free(by);
    caches_free(&used);
    free(order);
    lit_free(&some);
    lit_free(&all);
    eye_list_free(&eyes);
    frame_free(&cached);
    frame_free(&exact);
}

/* Each order has every eye sample once. */
static void orders(void **state)
{
    (void)state;
    eye_list eyes = eye_list_new(&of.view);
    uint32_t *order = xmalloc(eyes.count * sizeof *order);
    uint32_t width = of.settings.width, ascending = 0;
    for (int o = ORDER_HALTON; o <= ORDER_RANDOM; o++) {
        bool *seen = xcalloc(eyes.count, sizeof *seen);
        eyes_sort(eyes.pixel, eyes.count, width, (eye_order)o, 4.0, order);
        for (uint32_t i = 0; i < eyes.count; i++) {
            assert_true(order[i] < eyes.count && !seen[order[i]]);
            seen[order[i]] = true;
            ascending += o == ORDER_SCANLINE && (i == 0 || eyes.pixel[order[i]] >= eyes.pixel[order[i - 1]]);
        }
        free(seen);
    }
    assert_int_equal(ascending, eyes.count);
    free(order);
    eye_list_free(&eyes);
}

static image grey(float a, float b)
{
    image i = image_new(2, 1);
    i.pixels[0] = v3(a, a, a);
    i.pixels[1] = v3(b, b, b);
    return i;
}

/* A difference that stands still does not flicker, whatever the light does; one that moves does. */
static void stains_and_flicker(void **state)
{
    (void)state;
    static const float exact_of[3][2] = {{1, 3}, {2, 2}, {3, 1}};
    temporal still = {0}, moving = {0};
    for (int i = 0; i < 3; i++) {
        image exact = grey(exact_of[i][0], exact_of[i][1]);
        image stain = grey(exact_of[i][0] + 0.5f, exact_of[i][1]);
        image other = grey(exact_of[i][0] + (i == 1 ? 0.0f : 0.5f), exact_of[i][1] + (i == 1 ? 0.5f : 0.0f));
        temporal_add(&still, &exact, &stain);
        temporal_add(&moving, &exact, &other);
        image_free(&exact);
        image_free(&stain);
        image_free(&other);
    }
    assert_float_equal(still.error / 3, 0.125, 1e-6);
    assert_float_equal(moving.error / 3, 0.125, 1e-6);
    assert_true(still.change < 1e-6 && still.change_max < 1e-6);
    assert_float_equal(still.light / 2, 0.5, 1e-6);
    assert_float_equal(moving.change / 2, 1.0 / 4.5, 1e-6); /* of the frame before, as the mode has it */
    temporal_free(&still);
    temporal_free(&moving);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(as_the_renderer), cmocka_unit_test(orders),
                                       cmocka_unit_test(stains_and_flicker)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
