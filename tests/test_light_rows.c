/* SPDX-License-Identifier: Apache-2.0 */
/* Rows of a light set: one ray per cell and light, eviction, what is not stored, what is kept apart. */
#include "patchwork.h"

/* Two sets and an array of lights of the table in one batch, every cell asked for by four eyes at a time: each pair of
 * a cell and a light is traced once, and the second time around not at all. */
static bool count_pairs(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    uint8_t(*traced)[PATCHES] = context;
    for (size_t i = 0; i < count; i++) {
        traced[misses[i].light_user][misses[i].eye_user]++;
        answers[i] = lit(misses[i].eye_user, misses[i].light_user);
    }
    return true;
}

static void one_ray_per_cell_and_light(void **state)
{
    (void)state;
    static const uint32_t capacities[] = {1, 7, 500, 100000};
    for (int k = 0; k < 4; k++) {
        enum { A = 130, B = 70, TABLE = 20 };
        patchwork p;
        make_patchwork(&p, 1, A + B + TABLE, 1 << 22);
        vcache_light_set *a = make_set(p.cache, p.lights, A, 1 << 18), *b = make_set(p.cache, p.lights + A, B, 1 << 18);
        vcache_worker *worker = make_worker(p.cache, capacities[k], false);
        uint8_t(*traced)[PATCHES] = calloc(p.count, sizeof *traced);
        static uint64_t visible[2][4][PATCHES][3][3];
        assert_non_null(traced);
        memset(visible, 0, sizeof visible);
        for (int pass = 0; pass < 2; pass++) {
            for (int again = 0; again < 4; again++)
                for (size_t e = 0; e < PATCHES; e++) {
                    uint64_t(*v)[3] = visible[pass][again][e];
                    const vcache_eye *eye = patch_at(&p, e);
                    for (uint32_t i[3] = {0}; i[0] < A || i[1] < B || i[2] < TABLE;) {
                        i[0] = vcache_add_set(worker, eye, a, i[0], NULL, v[0]);
                        i[1] = vcache_add_set(worker, eye, b, i[1], NULL, v[1]);
                        i[2] = vcache_add(worker, eye, p.lights + A + B, i[2], TABLE, NULL, v[2]);
                        if (i[0] < A || i[1] < B || i[2] < TABLE)
                            assert_true(vcache_resolve(worker, count_pairs, traced));
                    }
                }
            assert_true(vcache_resolve(worker, count_pairs, traced));
            for (uint32_t l = 0; l < p.count; l++)
                for (size_t e = 0; e < PATCHES; e++) {
                    assert_int_equal(traced[l][e], 1);
                    for (int again = 0; again < 4; again++) {
                        uint64_t(*v)[3] = visible[pass][again][e];
                        bool bit = l < A ? bit_of(v[0], l) : l < A + B ? bit_of(v[1], l - A) : bit_of(v[2], l - A - B);
                        assert_int_equal(bit, lit(e, l));
                    }
                }
        }
        vcache_statistics s = statistics_of(worker);
        assert_int_equal(s.traced, PATCHES * p.count);
        assert_int_equal(s.stored, s.traced);
        assert_int_equal(s.asked, 8 * s.traced);
        assert_int_equal(hits_of(&s), 7 * s.traced);
        free(traced);
        vcache_worker_destroy(&worker);
        vcache_light_set_destroy(&a);
        vcache_light_set_destroy(&b);
        free_patchwork(&p);
    }
}

/* Rows that are fought for: the right answers, for more rays. */
static void eviction(void **state)
{
    (void)state;
    for (int levels = 1; levels <= 3; levels += 2) {
        uint64_t rays[4] = {0};
        for (uint64_t rows = 0; rows < 4; rows++) {
            patchwork p;
            make_patchwork(&p, levels, 1100, 1);
            vcache_light_set *set = make_set(p.cache, p.lights, p.count, rows ? rows : 1 << 14);
            vcache_worker *worker = make_worker(p.cache, 5000, false);
            static uint64_t visible[4][18];
            tracer t = {0};
            uint64_t seed = 41;
            for (int round = 0; round < 300; round++) {
                size_t eyes[4];
                for (int i = 0; i < 4; i++) {
                    /* two eyes take turns, so that each is found now and then; all are pending at a time */
                    eyes[i] = ((size_t)(round / 10) + random_bits(&seed) % 2) % PATCHES;
                    for (uint32_t l = 0;
                         (l = vcache_add_set(worker, patch_at(&p, eyes[i]), set, l, NULL, visible[i])) < p.count;)
                        assert_true(vcache_resolve(worker, light_up, &t));
                }
                assert_true(vcache_resolve(worker, light_up, &t));
                for (int i = 0; i < 4; i++)
                    assert_lit(&p, eyes[i], visible[i]);
            }
            vcache_statistics s = statistics_of(worker);
            assert_int_equal(s.traced, t.rays);
            assert_int_equal(s.asked, s.traced + hits_of(&s));
            assert_int_equal(s.traced, s.stored);
            assert_true(rows == 0 ? s.overwritten == 0 : s.overwritten > 100);
            assert_true(hits_of(&s) > 0);
            rays[rows] = t.rays;
            vcache_worker_destroy(&worker);
            vcache_light_set_destroy(&set);
            free_patchwork(&p);
        }
        assert_true(rays[0] < rays[3] && rays[3] < rays[1]);
    }
    /* one row, two eyes by turns: each finds it held by the other; the same eye again finds all */
    patchwork p;
    make_patchwork(&p, 1, 100, 1);
    vcache_light_set *set = make_set(p.cache, p.lights, p.count, 1);
    vcache_worker *worker = make_worker(p.cache, 5000, false);
    tracer t = {0};
    uint64_t visible[2];
    for (uint64_t i = 0; i < 20; i++)
        for (int twice = 0; twice < 2; twice++) {
            query_set(worker, patch_at(&p, i % 2), set, NULL, visible, light_up, &t);
            assert_int_equal(t.rays, 100 * (i + 1));
            assert_int_equal(statistics_of(worker).overwritten, i);
        }
    vcache_worker_destroy(&worker);
    vcache_light_set_destroy(&set);
    free_patchwork(&p);
}

/* -------------------------------------------------------------------------------------------- what is not stored */

/* Answers that hold once leave no trace: not in their own row, and the row of another cell stays as well. */
static void once(void **state)
{
    (void)state;
    patchwork p;
    make_patchwork(&p, 1, 100, 1);
    vcache_light_set *set = make_set(p.cache, p.lights, p.count, 1);
    vcache_worker *worker = make_worker(p.cache, 5000, false);
    tracer t = {0}, only_once = {.extra = VCACHE_ONCE};
    uint64_t visible[3][2];
    query_set(worker, patch_at(&p, 0), set, NULL, visible[0], light_up, &t);
    for (int i = 0; i < 3; i++)
        assert_int_equal(vcache_add_set(worker, patch_at(&p, 1), set, 0, NULL, visible[i]), 100);
    assert_int_equal(vcache_misses(worker, NULL), 100);
    assert_true(vcache_resolve(worker, light_up, &only_once));
    assert_int_equal(only_once.rays, 300);
    assert_int_equal(only_once.calls, 2);
    for (int i = 0; i < 3; i++)
        assert_lit(&p, 1, visible[i]);
    vcache_statistics s = statistics_of(worker);
    assert_int_equal(s.once, 300);
    assert_int_equal(s.stored, 100);
    assert_int_equal(hits_of(&s), 0);
    assert_int_equal(s.overwritten, 0);
    query_set(worker, patch_at(&p, 0), set, NULL, visible[0], light_up, &t);
    assert_int_equal(t.rays, 100);
    vcache_worker_destroy(&worker);
    vcache_light_set_destroy(&set);
    free_patchwork(&p);
}

/* Some of a run hold once: the others are stored. */
static bool thirds_once(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    *(uint64_t *)context += count;
    for (size_t i = 0; i < count; i++)
        answers[i] = misses[i].light_user % 3 ? VCACHE_VISIBLE : VCACHE_VISIBLE | VCACHE_ONCE;
    return true;
}

static void some_once(void **state)
{
    (void)state;
    patchwork p;
    make_patchwork(&p, 1, 100, 1);
    vcache_light_set *set = make_set(p.cache, p.lights, p.count, 1);
    vcache_worker *worker = make_worker(p.cache, 5000, false);
    uint64_t rays = 0;
    for (uint64_t i = 0; i < 5; i++) {
        uint64_t visible[2] = {0};
        query_set(worker, patch_at(&p, 0), set, NULL, visible, thirds_once, &rays);
        assert_int_equal(rays, 100 + 34 * i);
        assert_true(visible[0] == UINT64_MAX && visible[1] == (1ull << 36) - 1);
    }
    vcache_worker_destroy(&worker);
    vcache_light_set_destroy(&set);
    free_patchwork(&p);
}

/* Near lights and ends that cannot be quantized are traced each time; directions never count as near. */
static void bypasses(void **state)
{
    (void)state;
    patchwork p;
    make_patchwork(&p, 2, 100, 1);
    vcache_surface flat = {.normal = {0.0f, 0.0f, -1.0f}, .position = {0.0f, 0.0f, 0.5f}, .density = 1.0f};
    float side = sqrtf(patch_at(&p, 0)->side_squared);
    vcache_light *light = p.lights;
    /* 64 apart: near and far in both words */
    vcache_prepare_point(p.cache, (float[3]){0.0f, 0.0f, 0.99f * side}, 0, &light[1]);
    vcache_prepare_point(p.cache, (float[3]){0.0f, 0.0f, 1.01f * side}, 0, &light[2]); /* far enough */
    vcache_prepare_point(p.cache, (float[3]){0.0f, 0.0f, 0.0f}, 0, &light[65]);        /* coincident */
    vcache_prepare_point(p.cache, (float[3]){0.0f, NAN, 0.0f}, 0, &light[3]);
    vcache_prepare_point(p.cache, (float[3]){0.0f, INFINITY, 0.0f}, 0, &light[8]);
    vcache_prepare_direction(p.cache, (float[3]){0.0f, 0.0f, 0.0f}, 0, &light[16]);
    vcache_prepare_direction(p.cache, (float[3]){0.0f, -INFINITY, 0.0f}, 0, &light[23]);
    vcache_prepare_direction(p.cache, (float[3]){1e-6f, 0.0f, 0.0f}, 0, &light[24]);  /* a fine direction */
    vcache_prepare_direction(p.cache, (float[3]){3e38f, 3e38f, 0.0f}, 0, &light[25]); /* another */
    vcache_prepare_patch(p.cache, &flat, &light[99]);                                 /* its own cell reaches the eye */
    flat.density = 0.0f;
    vcache_prepare_patch(p.cache, &flat, &light[98]);
    flat.position[0] = 3e38f; /* and so far that the distance overflows */
    vcache_prepare_patch(p.cache, &flat, &light[97]);
    vcache_prepare_solid_angle(p.cache, (float[3]){0.0f, 0.0f, 1.0f}, NAN, 0, &light[96]);
    const uint32_t always[] = {1, 3, 8, 16, 23, 65, 96, 97, 98, 99};
    const uint32_t count = sizeof always / sizeof *always;
    vcache_light_set *set = make_set(p.cache, p.lights, p.count, 16);
    for (uint32_t i = 0; i < p.count; i++)
        light[i].user = i; /* the set has copies */
    vcache_worker *worker = make_worker(p.cache, 5000, false), *plain = make_worker(p.cache, 64, true);
    uint64_t visible[2] = {0};
    for (int round = 0; round < 3; round++) {
        const vcache_miss *misses;
        vcache_answer answers[100] = {0};
        assert_int_equal(vcache_add_set(worker, patch_at(&p, 0), set, 0, NULL, visible), 100);
        size_t n = vcache_misses(worker, &misses);
        assert_int_equal(n, round ? count : 100);
        for (size_t i = 0; i < n; i++)
            answers[i] = VCACHE_VISIBLE;
        vcache_commit(worker, answers);
        assert_true(visible[0] == UINT64_MAX && visible[1] == (1ull << 36) - 1);
        visible[0] = visible[1] = 0;
        /* light by light: the right ones, the same as in the table's way */
        for (uint32_t i = 0; i < p.count && round; i++) {
            bool expected = false;
            for (uint32_t k = 0; k < count; k++)
                expected |= always[k] == i;
            uint64_t one[2] = {0};
            one[i / 64] = (uint64_t)1 << i % 64;
            vcache_add_set(worker, patch_at(&p, 0), set, 0, one, visible);
            if (vcache_misses(worker, NULL) != expected)
                fail_msg("light %u: traced %d", i, !expected);
            vcache_cancel(worker);
        }
    }
    /* an eye that cannot be quantized, and an exact worker: all, always, and no row is written */
    vcache_surface s = {.normal = {0.0f, 0.0f, 0.0f}, .density = 1.0f};
    vcache_eye *bad = make_eye(p.cache, &s, 4.0f, 0);
    vcache_statistics before = statistics_of(worker);
    tracer t = {0};
    for (uint64_t round = 1; round < 3; round++) {
        query_set(worker, bad, set, NULL, visible, light_up, &t);
        query_set(plain, patch_at(&p, 0), set, NULL, visible, light_up, &t);
        assert_int_equal(t.rays, 200 * round);
    }
    vcache_statistics after = statistics_of(worker), exact = statistics_of(plain);
    assert_int_equal(after.bypassed, before.bypassed + 200);
    assert_int_equal(after.stored, before.stored);
    assert_int_equal(exact.asked, 200);
    assert_int_equal(exact.bypassed, 200);
    assert_int_equal(exact.stored + hits_of(&exact), 0);
    free(bad);
    vcache_worker_destroy(&worker);
    vcache_worker_destroy(&plain);
    vcache_light_set_destroy(&set);
    free_patchwork(&p);
}

/* --------------------------------------------------------------------------------------------- what is kept apart */

/* A clear, another salt, another set: nothing of before is found, in any family of hashes. */
static void kept_apart(void **state)
{
    (void)state;
    for (int family = 0; family < 3; family++) {
        world *w = make_world(8.0f, 1, 1, (vcache_hash)family);
        vcache_light_set *a = make_set(w->cache, w->light, LIGHTS, 1 << 16);
        vcache_light_set *b = make_set(w->cache, w->light, LIGHTS, 1 << 16);
        vcache_worker *worker = make_worker(w->cache, 1000, false);
        tracer t = {0};
        uint64_t visible[WORDS];
        for (uint64_t salt = 0; salt < 100; salt++) {
            vcache_eye *eye = make_eye(w->cache, &w->surface[5], 8.0f, salt < 50 ? salt : salt << 57);
            for (int twice = 0; twice < 2; twice++) {
                query_set(worker, eye, a, NULL, visible, trace, &t);
                assert_int_equal(t.rays, (2 * salt + 1) * LIGHTS);
            }
            for (int twice = 0; twice < 2; twice++) {
                query_set(worker, eye, b, NULL, visible, trace, &t);
                assert_int_equal(t.rays, (2 * salt + 2) * LIGHTS);
            }
            free(eye);
        }
        t = (tracer){0};
        for (uint64_t frame = 1; frame <= 100; frame++) {
            vcache_clear(w->cache);
            for (int twice = 0; twice < 2; twice++) {
                query_set(worker, eye_at(w, 5), a, NULL, visible, trace, &t);
                assert_int_equal(t.rays, frame * LIGHTS);
            }
        }
        /* a clear while pairs wait: they are answered, and what was asked before it is not found after it */
        vcache_clear(w->cache);
        uint64_t pending[2][WORDS] = {{0}}, first[WORDS] = {2};
        for (int i = 0; i < 2; i++)
            vcache_add_set(worker, eye_at(w, 5), a, 0, first, pending[i]);
        assert_int_equal(vcache_misses(worker, NULL), 1);
        vcache_clear(w->cache);
        vcache_commit(worker, (vcache_answer[]){VCACHE_VISIBLE});
        assert_int_equal(pending[0][0], 2);
        assert_int_equal(vcache_misses(worker, NULL), 1);
        vcache_commit(worker, (vcache_answer[]){VCACHE_BLOCKED});
        assert_int_equal(pending[1][0], 0);
        vcache_worker_destroy(&worker);
        vcache_light_set_destroy(&a);
        vcache_light_set_destroy(&b);
        free_world(w);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_ray_per_cell_and_light),
        cmocka_unit_test(eviction),
        cmocka_unit_test(once),
        cmocka_unit_test(some_once),
        cmocka_unit_test(bypasses),
        cmocka_unit_test(kept_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
