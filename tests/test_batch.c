/* SPDX-License-Identifier: Apache-2.0 */
/* The batch of a worker: all ways to ask agree, each pair of cells costs one ray, answers that hold once, bypasses,
 * masks, salts, clearing, cancelling, statistics. */
#include "world.h"

static void assert_identities(const vcache_worker *worker, const tracer *t)
{
    vcache_statistics s = statistics_of(worker);
    assert_int_equal(s.asked, s.traced + hits_of(&s));
    assert_int_equal(s.traced, t->rays);
    assert_int_equal(s.traced, s.stored + s.bypassed); /* no answer held once */
    assert_int_equal(s.once, 0);
    assert_true(s.overwritten <= s.stored);
    for (int i = 0; i < VCACHE_MAX_LEVELS; i++)
        assert_int_equal(s.hits[i] > 0, s.hit_levels >> i & 1);
}

/* The same pairs in the same order, eye by eye: one by one, by query, by add and commit, with batches of any size. */
static void ways_agree(void **state)
{
    (void)state;
    static const uint32_t capacities[] = {1, 2, 7, 64, 65536};
    for (int family = 0; family < 3; family++) {
        static uint64_t expected[EYES][WORDS];
        uint64_t rays = 0;
        for (int way = -1; way < 10; way++) {
            /* a large table: where two keys of one eye share a word, a batch may trace one of them again */
            world *w = make_world(8.0f, 0, ((uint64_t)1 << 22) - 3, (vcache_hash)family);
            vcache_worker *worker = make_worker(w->cache, way < 0 ? 1 : capacities[way % 5], false);
            tracer t = {0};
            for (size_t e = 0; e < EYES; e += 3) {
                uint64_t visible[WORDS] = {0};
                const vcache_eye *eye = eye_at(w, e);
                if (way < 0)
                    for (uint32_t l = 0; l < LIGHTS; l++)
                        visible[l / 64] |= (uint64_t)vcache_visible(worker, eye, &w->light[l], trace, &t) << l % 64;
                else if (way < 5)
                    assert_true(vcache_query(worker, eye, w->light, LIGHTS, NULL, visible, trace, &t));
                else
                    for (uint32_t l = 0; l < LIGHTS;) {
                        const vcache_miss *misses;
                        vcache_answer answers[LIGHTS];
                        l = vcache_add(worker, eye, w->light, l, LIGHTS, NULL, visible);
                        for (size_t n; (n = vcache_misses(worker, &misses)) > 0; vcache_commit(worker, answers))
                            assert_true(trace(&t, misses, n, answers));
                    }
                if (way < 0)
                    memcpy(expected[e], visible, sizeof visible);
                else
                    assert_memory_equal(expected[e], visible, sizeof visible);
            }
            if (way < 0)
                rays = t.rays;
            assert_int_equal(t.rays, rays);
            if (way >= 0)
                assert_true(t.largest <= capacities[way % 5]);
            assert_identities(worker, &t);
            vcache_worker_destroy(&worker);
            free_world(w);
        }
    }
}

/* Many eyes pending at a time, no refinement: one ray per pair of cells that is asked for, whatever the batch's size,
 * and no key twice among the misses. */
static void one_ray_per_pair_of_cells(void **state)
{
    (void)state;
    static const uint32_t capacities[] = {1, 7, 1000, 1 << 20};
    uint64_t *keys = malloc(sizeof *keys * EYES * LIGHTS);
    assert_non_null(keys);
    for (int k = 0; k < 4; k++) {
        world *w = make_world(8.0f, 1, (uint64_t)1 << 26, VCACHE_HASH_SPLIT);
        vcache_worker *worker = make_worker(w->cache, capacities[k], false);
        tracer t = {0};
        uint64_t(*visible)[WORDS] = calloc(EYES, sizeof *visible);
        assert_non_null(visible);
        for (size_t e = 0; e < EYES; e++)
            for (uint32_t l = 0; l < LIGHTS;)
                if ((l = vcache_add(worker, eye_at(w, e), w->light, l, LIGHTS, NULL, visible[e])) < LIGHTS)
                    assert_true(vcache_resolve(worker, trace, &t));
        assert_true(vcache_resolve(worker, trace, &t));
        size_t pairs = 0, near = 0;
        for (size_t e = 0; e < EYES; e++)
            for (int l = 0; l < LIGHTS; l++)
                if (too_near(w, e, l))
                    near++;
                else
                    keys[pairs++] = level_key(w, e, l, 0, -1);
        assert_true(near > 0);
        assert_int_equal(t.rays, near + count_distinct(keys, pairs));
        assert_int_equal(statistics_of(worker).bypassed, near);
        assert_identities(worker, &t);
        free(visible);
        vcache_worker_destroy(&worker);
        free_world(w);
    }
    free(keys);
}

/* Exact mode: as many rays as pairs, and the world's own answers; nothing reaches the table. */
static void exact_mode(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 0, 4096, VCACHE_HASH_SPLIT);
    vcache_worker *worker = make_worker(w->cache, 100, true);
    tracer t = {0};
    for (size_t e = 0; e < EYES; e++) {
        uint64_t visible[WORDS] = {0};
        assert_true(vcache_query(worker, eye_at(w, e), w->light, LIGHTS, NULL, visible, trace, &t));
        for (int l = 0; l < LIGHTS; l++) {
            bool exact = sees(w->surface[e].position, w->light[l].position, w->light[l].side_squared < 0.0f);
            assert_int_equal(visible[l / 64] >> l % 64 & 1, exact);
            if (e % 100 == 0)
                assert_int_equal(vcache_visible(worker, eye_at(w, e), &w->light[l], trace, &t), exact);
        }
    }
    vcache_statistics s = statistics_of(worker);
    assert_int_equal(t.rays, EYES * LIGHTS + EYES / 100 * LIGHTS);
    assert_int_equal(s.asked, t.rays);
    assert_int_equal(s.bypassed, t.rays);
    assert_int_equal(s.stored + hits_of(&s), 0);
    assert_true(vcache_table_filled(w->cache, UINT64_MAX) == 0.0);
    vcache_worker_destroy(&worker);
    free_world(w);
}

/* Ends nearer to each other than a cell, and ends that cannot be quantized: always traced, never stored. */
static void bypasses(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 0, 4096, VCACHE_HASH_SPLIT);
    vcache_worker *worker = make_worker(w->cache, 100, false);
    tracer t = {0};
    vcache_surface s = {.position = {0.9f, 0.9f, 0.0f}, .normal = {0.0f, 0.0f, 1.0f}, .density = 16384.0f};
    vcache_eye *eye = make_eye(w->cache, &s, 8.0f, 0);
    float side = sqrtf(eye->side_squared);
    vcache_light light[4];
    vcache_prepare_point(w->cache, (float[3]){0.9f, 0.9f, side * 0.99f}, 0, &light[0]);
    vcache_prepare_point(w->cache, (float[3]){0.9f, 0.9f, 0.0f}, 0, &light[1]); /* coincident */
    vcache_prepare_point(w->cache, (float[3]){0.9f, NAN, 0.0f}, 0, &light[2]);
    vcache_surface patch = {
        .position = {0.9f, 0.9f, 0.5f}, .normal = {0.0f, 0.0f, -1.0f}, .density = 1.0f}; /* side 1 */
    vcache_prepare_patch(w->cache, &patch, &light[3]);
    for (int round = 1; round <= 3; round++) {
        uint64_t visible = 0;
        assert_true(vcache_query(worker, eye, light, 4, NULL, &visible, trace, &t));
        for (int l = 0; l < 4; l++)
            vcache_visible(worker, eye, &light[l], trace, &t);
        assert_int_equal(t.rays, 8 * round);
        assert_int_equal(visible & 1, 1);
    }
    assert_int_equal(statistics_of(worker).bypassed, 24);
    assert_true(vcache_table_filled(w->cache, UINT64_MAX) == 0.0);
    /* a little farther than a cell: stored */
    vcache_prepare_point(w->cache, (float[3]){0.9f, 0.9f, side * 1.01f}, 0, &light[0]);
    vcache_visible(worker, eye, &light[0], trace, &t);
    vcache_visible(worker, eye, &light[0], trace, &t);
    assert_int_equal(t.rays, 25);
    assert_int_equal(statistics_of(worker).stored, 1);
    free(eye);
    /* bad eyes */
    static const float bad_ce[] = {0.0f, -1.0f, NAN, INFINITY};
    for (int i = 0; i < 4; i++) {
        eye = make_eye(w->cache, &s, bad_ce[i], 0);
        uint64_t before = t.rays;
        for (int k = 0; k < 3; k++)
            vcache_visible(worker, eye, &w->light[1], trace, &t);
        assert_int_equal(t.rays, before + 3);
        assert_true(vcache_eye_cell(eye, 0) == 0);
        free(eye);
    }
    vcache_worker_destroy(&worker);
    free_world(w);
}

/* Bits that are not asked for stay as they were, and cost nothing. */
static void masks(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 0, (uint64_t)1 << 18, VCACHE_HASH_SPLIT);
    vcache_worker *worker = make_worker(w->cache, 5, false), *plain = make_worker(w->cache, 5, true);
    tracer t = {0};
    uint64_t seed = 12, wanted = 0;
    for (size_t e = 0; e < EYES; e++) {
        uint64_t asked[WORDS + 1], before[WORDS + 1], visible[WORDS + 1], all[WORDS + 1] = {0};
        for (int i = 0; i <= WORDS; i++) {
            asked[i] = random_bits(&seed) & random_bits(&seed);
            visible[i] = before[i] = random_bits(&seed);
        }
        vcache_query(worker, eye_at(w, e), w->light, LIGHTS, asked, visible, trace, &t);
        vcache_query(plain, eye_at(w, e), w->light, LIGHTS, NULL, all, trace, &(tracer){0});
        for (int l = 0; l < (WORDS + 1) * 64; l++) {
            bool is_asked = l < LIGHTS && (asked[l / 64] >> l % 64 & 1);
            wanted += is_asked;
            if (!is_asked)
                assert_int_equal(visible[l / 64] >> l % 64 & 1, before[l / 64] >> l % 64 & 1);
        }
    }
    assert_int_equal(statistics_of(worker).asked, wanted);
    assert_identities(worker, &t);
    /* nothing asked, no lights: nothing happens */
    uint64_t none[WORDS] = {0}, visible[WORDS] = {0};
    tracer idle = {0};
    assert_true(vcache_query(worker, eye_at(w, 0), w->light, LIGHTS, none, visible, trace, &idle));
    assert_true(vcache_query(worker, eye_at(w, 0), w->light, 0, NULL, visible, trace, &idle));
    assert_true(vcache_resolve(worker, trace, &idle));
    vcache_commit(worker, NULL);
    assert_int_equal(vcache_misses(worker, NULL), 0);
    assert_int_equal(idle.calls, 0);
    vcache_worker_destroy(&worker);
    vcache_worker_destroy(&plain);
    free_world(w);
}

/* ONCE: used for the pair that asked, not stored, and thousands that wait for one such cell need two rounds. */
static void once(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 0, (uint64_t)1 << 18, VCACHE_HASH_SPLIT);
    vcache_worker *worker = make_worker(w->cache, 8192, false);
    tracer t = {.extra = VCACHE_ONCE};
    enum { N = 5000 };
    static uint64_t visible[N];
    for (int i = 0; i < N; i++)
        assert_int_equal(vcache_add(worker, eye_at(w, 7), &w->light[1], 0, 1, NULL, &visible[i]), 1);
    assert_int_equal(vcache_misses(worker, NULL), 1);
    assert_true(vcache_resolve(worker, trace, &t));
    assert_int_equal(t.calls, 2);
    assert_int_equal(t.rays, N);
    bool exact = sees(w->surface[7].position, w->light[1].position, true);
    for (int i = 0; i < N; i++)
        assert_int_equal(visible[i], exact);
    vcache_statistics s = statistics_of(worker);
    assert_int_equal(s.once, N);
    assert_int_equal(s.stored + s.bypassed + hits_of(&s), 0);
    assert_true(vcache_table_filled(w->cache, UINT64_MAX) == 0.0);
    /* one by one as well */
    assert_int_equal(vcache_visible(worker, eye_at(w, 7), &w->light[1], trace, &t), exact);
    assert_int_equal(vcache_visible(worker, eye_at(w, 7), &w->light[1], trace, &t), exact);
    assert_int_equal(t.rays, N + 2);
    /* a mixture over the whole world ends, with the world's answers where all hold once */
    uint64_t *bits = calloc(EYES, WORDS * sizeof *bits);
    assert_non_null(bits);
    vcache_worker_reset_statistics(worker);
    t = (tracer){.extra = VCACHE_ONCE};
    for (size_t e = 0; e < EYES; e += 4)
        assert_true(vcache_query(worker, eye_at(w, e), w->light, LIGHTS, NULL, &bits[e * WORDS], trace, &t));
    assert_int_equal(t.rays, EYES / 4 * LIGHTS);
    for (size_t e = 0; e < EYES; e += 4)
        for (int l = 0; l < LIGHTS; l++)
            assert_int_equal(bits[e * WORDS + (size_t)l / 64] >> l % 64 & 1,
                             sees(w->surface[e].position, w->light[l].position, w->light[l].side_squared < 0.0f));
    free(bits);
    vcache_worker_destroy(&worker);
    free_world(w);
}

/* Answers of which some hold once: pairs that wait for another cell than those still share its ray. */
static bool every_third_once(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    tracer *t = context;
    t->calls++;
    t->rays += count;
    for (size_t i = 0; i < count; i++)
        answers[i] = misses[i].light_user % 3 ? VCACHE_VISIBLE : VCACHE_VISIBLE | VCACHE_ONCE;
    return true;
}

static void some_once(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 1, (uint64_t)1 << 22, VCACHE_HASH_SPLIT);
    vcache_worker *worker = make_worker(w->cache, 1 << 16, false);
    tracer t = {0};
    enum { N = 100 };
    static uint64_t visible[N];
    for (int i = 0; i < N; i++)
        vcache_add(worker, eye_at(w, 7), w->light, 0, 60, (uint64_t[]){0x333333333333333u}, &visible[i]);
    assert_true(vcache_resolve(worker, every_third_once, &t));
    uint64_t expected = 0;
    for (int l = 0; l < 60; l++)
        if (l % 4 < 2) /* point lights and directions: a key each */
            expected += (l + 1000) % 3 ? 1 : N;
    assert_int_equal(t.rays, expected);
    assert_int_equal(t.calls, 2);
    for (int i = 0; i < N; i++)
        assert_true(visible[i] == 0x333333333333333u);
    vcache_worker_destroy(&worker);
    free_world(w);
}

/* Different salts share nothing; 0 is a salt as any other. Copies of an end are the end. */
static void salts(void **state)
{
    (void)state;
    for (int family = 0; family < 3; family++) {
        world *w = make_world(8.0f, 0, (uint64_t)1 << 18, (vcache_hash)family);
        vcache_worker *worker = make_worker(w->cache, 100, false);
        tracer t = {0};
        for (uint64_t salt = 0; salt < 100; salt++) {
            vcache_eye *eye = make_eye(w->cache, &w->surface[5], 8.0f, salt < 50 ? salt : salt << 57);
            vcache_visible(worker, eye, &w->light[0], trace, &t);
            assert_int_equal(t.rays, salt + 1);
            vcache_visible(worker, eye, &w->light[0], trace, &t);
            assert_int_equal(t.rays, salt + 1);
            free(eye);
        }
        vcache_worker_destroy(&worker);
        free_world(w);
    }
}

/* Nothing of before a clear is found after it, whichever family; prepared ends stay good; many clears do not collide.
 */
static void clears(void **state)
{
    (void)state;
    for (int family = 0; family < 3; family++) {
        world *w = make_world(8.0f, 0, (uint64_t)1 << 18, (vcache_hash)family);
        vcache_worker *worker = make_worker(w->cache, 100, false);
        tracer first = {0};
        for (int frame = 0; frame < 200; frame++) {
            tracer t = {0};
            uint64_t visible[WORDS];
            for (size_t e = 0; e < 20; e++)
                vcache_query(worker, eye_at(w, e), w->light, LIGHTS, NULL, visible, trace, &t);
            if (frame == 0)
                first = t;
            /* keys of another frame collide elsewhere: a few of 1400 pairs more or less are traced again */
            assert_true(t.rays + 8 > first.rays && t.rays < first.rays + 8);
            vcache_clear(w->cache);
        }
        /* a clear while pairs wait: they are answered, and what was asked before it is not found after it */
        vcache_worker_reset_statistics(worker);
        uint64_t visible[2] = {0, 0};
        vcache_add(worker, eye_at(w, 9), &w->light[1], 0, 1, NULL, &visible[0]);
        vcache_add(worker, eye_at(w, 9), &w->light[1], 0, 1, NULL, &visible[1]);
        assert_int_equal(vcache_misses(worker, NULL), 1);
        vcache_clear(w->cache);
        vcache_commit(worker, (vcache_answer[]){VCACHE_VISIBLE});
        assert_int_equal(visible[0], 1);
        assert_int_equal(vcache_misses(worker, NULL), 1);
        vcache_commit(worker, (vcache_answer[]){VCACHE_BLOCKED});
        assert_int_equal(visible[1], 0);
        assert_int_equal(vcache_misses(worker, NULL), 0);
        vcache_worker_destroy(&worker);
        free_world(w);
    }
}

/* Cancelled pairs leave bits, table and worker as if they had not been asked. */
static void cancels(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 1, (uint64_t)1 << 18, VCACHE_HASH_SPLIT);
    vcache_worker *worker = make_worker(w->cache, 1000, false);
    tracer t = {0};
    uint64_t visible[WORDS] = {0x123456789abcdef0u, 0x3fu}, before[WORDS];
    memcpy(before, visible, sizeof visible);
    assert_int_equal(vcache_add(worker, eye_at(w, 0), w->light, 0, LIGHTS, NULL, visible), LIGHTS);
    vcache_add(worker, eye_at(w, 0), w->light, 0, LIGHTS, NULL, visible); /* these wait for the others */
    assert_true(vcache_misses(worker, NULL) > 0);
    vcache_cancel(worker);
    assert_int_equal(vcache_misses(worker, NULL), 0);
    assert_true(vcache_resolve(worker, trace, &t));
    assert_int_equal(t.rays, 0);
    assert_true(vcache_table_filled(w->cache, UINT64_MAX) == 0.0);
    uint64_t other[WORDS] = {0};
    assert_true(vcache_query(worker, eye_at(w, 0), w->light, 1, NULL, other, trace, &t));
    assert_int_equal(t.rays, 1);
    assert_memory_equal(visible, before, sizeof visible);
    vcache_clear(w->cache);
    /* a callback that gives up at once, or after some batches */
    for (uint64_t calls = 1; calls < 4; calls++) {
        vcache_worker *small = make_worker(w->cache, 8, false);
        tracer gives_up = {.cancel_after = calls};
        vcache_clear(w->cache);
        memcpy(visible, before, sizeof visible);
        assert_false(vcache_query(small, eye_at(w, 0), w->light, LIGHTS, NULL, visible, trace, &gives_up));
        assert_int_equal(gives_up.calls, calls);
        assert_int_equal(vcache_misses(small, NULL), 0);
        for (size_t l = (calls + 1) * 16; l < LIGHTS; l++) /* 8 pairs a batch, hardly any of which share a cell */
            assert_int_equal(visible[l / 64] >> l % 64 & 1, before[l / 64] >> l % 64 & 1);
        tracer goes_on = {0};
        assert_true(vcache_query(small, eye_at(w, 0), w->light, LIGHTS, NULL, visible, trace, &goes_on));
        vcache_worker_destroy(&small);
    }
    /* vcache_visible: blocked, not stored, and a pending batch stays */
    vcache_clear(w->cache);
    vcache_add(worker, eye_at(w, 1), w->light, 0, LIGHTS, NULL, visible);
    size_t pending = vcache_misses(worker, NULL);
    tracer never = {.cancel_after = 1, .calls = 1}, now = {0};
    vcache_statistics s = statistics_of(worker);
    assert_false(vcache_visible(worker, eye_at(w, 2), &w->light[0], trace, &never));
    assert_int_equal(statistics_of(worker).stored, s.stored);
    vcache_visible(worker, eye_at(w, 2), &w->light[0], trace, &now);
    assert_int_equal(now.rays, 1);
    assert_int_equal(vcache_misses(worker, NULL), pending);
    vcache_worker_destroy(&worker);
    free_world(w);
}

/* What a miss says: the points that were given, the two `user`, and whether the ray has an end. */
static void misses(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 1, (uint64_t)1 << 18, VCACHE_HASH_SPLIT);
    vcache_worker *worker = make_worker(w->cache, 1000, false);
    uint64_t visible[WORDS] = {0};
    const vcache_miss *m;
    vcache_add(worker, eye_at(w, 17), w->light, 0, LIGHTS, NULL, visible);
    size_t count = vcache_misses(worker, &m);
    assert_true(count > LIGHTS / 2);
    for (size_t i = 0; i < count; i++) {
        int l = (int)m[i].light_user - 1000;
        assert_int_equal(m[i].eye_user, 17);
        assert_int_equal(m[i].infinite, l % 2);
        assert_memory_equal(m[i].eye_position, w->surface[17].position, 12);
        assert_memory_equal(m[i].light_position, w->light[l].position, 12);
    }
    vcache_worker_destroy(&worker);
    free_world(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ways_agree), cmocka_unit_test(one_ray_per_pair_of_cells),
        cmocka_unit_test(exact_mode), cmocka_unit_test(bypasses),
        cmocka_unit_test(masks),      cmocka_unit_test(once),
        cmocka_unit_test(some_once),  cmocka_unit_test(salts),
        cmocka_unit_test(clears),     cmocka_unit_test(cancels),
        cmocka_unit_test(misses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
