/* SPDX-License-Identifier: Apache-2.0 */
/* The replay of bench/ against the library itself, and what must hold for any estimator. */
/* first: cmocka's names must not meet the renderer's */
#include "bench/distances.h"
#include "bench/replay.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

static record view_record;

static int set_up(void **state)
{
    (void)state;
    const record_options o = {.scene = "atrium", .width = 48, .height = 32, .spp = 4, .vpls = 200, .threads = 1};
    return record_make(&o, &view_record, NULL) ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    record_free(&view_record);
    return 0;
}

typedef struct asking {
    const record *r;
    uint64_t rays;
} asking;

static bool answer(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    asking *a = context;
    a->rays += count;
    for (size_t i = 0; i < count; i++) {
        const uint64_t *row = a->r->visible + (size_t)misses[i].eye_user * a->r->words;
        answers[i] = row[misses[i].light_user / 64] >> misses[i].light_user % 64 & 1u;
    }
    return true;
}

/* The library with so much memory that few rows meet, one eye sample at a time in the same order. */
static void as_the_library(void **state)
{
    (void)state;
    const record *r = &view_record;
    const vpl_set *l = &r->lights;
    const grid_policy p = {.ce = 8};
    replay_result replayed = replay_grid(r, &p, NULL);

    vcache *cache = record_cache(r, vcache_default_config());
    vcache_light *ends = calloc(l->count, sizeof *ends);
    for (uint32_t i = 0; i < l->count; i++) {
        vcache_surface at = {.position = {l->x[i], l->y[i], l->z[i]},
                             .normal = {l->gx[i], l->gy[i], l->gz[i]},
                             .density = l->density[i],
                             .user = i};
        vcache_prepare_patch(cache, &at, &ends[i]);
    }
    vcache_light_set *set;
    vcache_worker *worker;
    assert_int_equal(vcache_light_set_create(cache, ends, l->count, (uint64_t)256 << 20, &set, NULL), VCACHE_OK);
    assert_int_equal(vcache_worker_create(cache, NULL, &worker, NULL), VCACHE_OK);
    uint32_t *order = malloc(r->count * sizeof *order);
    record_sort(r, ORDER_HALTON, 4.0, order);
    asking a = {.r = r};
    uint64_t visible[16], wrong = 0;
    for (uint32_t i = 0; i < r->count; i++) {
        _Alignas(8) char memory[VCACHE_EYE_BYTES];
        vcache_eye *eye = (vcache_eye *)(void *)memory;
        vcache_surface at = record_surface(r, order[i]);
        const uint64_t *asked = r->asked + (size_t)order[i] * r->words;
        vcache_prepare_eye(cache, &at, p.ce, 0, eye);
        memset(visible, 0, sizeof visible);
        assert_int_equal(vcache_add_set(worker, eye, set, 0, asked, visible), l->count);
        assert_true(vcache_resolve(worker, answer, &a));
        for (uint32_t w = 0; w < r->words; w++)
            wrong +=
                (uint32_t)__builtin_popcountll((visible[w] ^ r->visible[(size_t)order[i] * r->words + w]) & asked[w]);
    }
    assert_true(replayed.rays > 0 && replayed.wrong > 0 && replayed.rays < r->pairs / 2);
    assert_true(fabs((double)replayed.rays - (double)a.rays) <= 0.002 * (double)a.rays);
    assert_true(fabs((double)replayed.wrong - (double)wrong) <= 0.01 * (double)wrong);
    free(order);
    free(ends);
    vcache_worker_destroy(&worker);
    vcache_light_set_destroy(&set);
    vcache_destroy(&cache);
}

/* Cells far smaller than the distances of eye samples: every pair is traced, nothing is wrong. */
static void smallest_cells_are_exact(void **state)
{
    (void)state;
    const grid_policy p = {.ce = 1e-4f, .levels = 1};
    replay_result x = replay_grid(&view_record, &p, NULL);
    assert_true(x.rays == view_record.pairs && x.wrong == 0 && x.l_inf == 0.0);
}

/* Bits say of each pair what the result counts. Refinement buys errors by rays, with 8 cells around X more than with 4;
 * the 64 of both ends need lights in cells beside each other; with the light's own cell they are more than the 8. */
static void neighbours_refine(void **state)
{
    (void)state;
    const record *r = &view_record;
    size_t words = (size_t)r->count * r->words;
    replay_bits bits = {calloc(words, sizeof *bits.clustered), calloc(words, sizeof *bits.wrong)};
    const grid_policy unrefined = {.ce = 16, .levels = 1};
    replay_result none = replay_grid(r, &unrefined, NULL), of[4];
    for (int around = AROUND_4; around <= AROUND_72; around++) {
        const grid_policy p = {.ce = 16, .around = (around_cells)around};
        replay_result x = of[around] = replay_grid(r, &p, &bits);
        uint64_t wrong = 0;
        for (size_t i = 0; i < words; i++) {
            wrong += (uint32_t)__builtin_popcountll(bits.wrong[i]);
            assert_true((bits.wrong[i] & ~bits.clustered[i]) == 0 && (bits.clustered[i] & ~r->asked[i]) == 0);
        }
        print_message("%d: %llu rays, %llu wrong\n", around, (unsigned long long)x.rays, (unsigned long long)x.wrong);
        assert_int_equal(wrong, x.wrong);
        assert_true(x.rays > none.rays && x.wrong < none.wrong);
    }
    assert_true(of[AROUND_8].rays > of[AROUND_4].rays && of[AROUND_8].wrong < of[AROUND_4].wrong);
    assert_true(of[AROUND_72].rays > of[AROUND_8].rays && of[AROUND_72].wrong < of[AROUND_8].wrong);
    assert_true(of[AROUND_72].rays > of[AROUND_64].rays && of[AROUND_72].wrong < of[AROUND_64].wrong);
    free(bits.clustered);
    free(bits.wrong);
}

/* All of them by hand; where nothing is set, infinity. */
static void distances_are_the_nearest(void **state)
{
    (void)state;
    enum { W = 23, H = 14 };
    uint8_t mask[W * H];
    float found[W * H];
    for (uint32_t one_in = 1; one_in <= 1000; one_in *= 10) {
        rng random = rng_make(7, one_in);
        for (int i = 0; i < W * H; i++)
            mask[i] = rng_float(&random) * (float)one_in < 1.0f;
        mask_distances(mask, W, H, found);
        for (int i = 0; i < W * H; i++) {
            double nearest = INFINITY;
            for (int k = 0; k < W * H; k++)
                if (mask[k])
                    nearest = fmin(nearest, hypot(i % W - k % W, i / W - k / W));
            assert_true((double)found[i] == nearest || fabs((double)found[i] - nearest) < 1e-5);
        }
    }
}

/* As many rays as lights leave nothing to estimate; more rays leave less error; the cache leaves less than none. */
static void estimators_converge(void **state)
{
    (void)state;
    const record *r = &view_record;
    double last = INFINITY;
    for (float k = 4.0f; k <= 64.0f; k *= 4.0f) {
        const estimator_policy cached = {.rays = k}, alone = {.rays = k, .alone = true};
        replay_result c = replay_estimator(r, &cached, NULL, NULL), n = replay_estimator(r, &alone, NULL, NULL);
        assert_true(c.l_inf < n.l_inf && c.l_inf < last);
        assert_true((float)c.rays <= k * (float)r->count + (float)r->count);
        last = c.l_inf;
    }
    const estimator_policy all = {.rays = 1e6f, .alone = true};
    replay_result x = replay_estimator(r, &all, NULL, NULL);
    assert_true(x.rays > r->pairs - r->pairs / 1000 && x.l_inf < 1e-4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_the_library),      cmocka_unit_test(smallest_cells_are_exact),
        cmocka_unit_test(neighbours_refine),   cmocka_unit_test(distances_are_the_nearest),
        cmocka_unit_test(estimators_converge),
    };
    return cmocka_run_group_tests_name("replay", tests, set_up, tear_down);
}
