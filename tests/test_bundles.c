/* SPDX-License-Identifier: Apache-2.0 */
/* Bundled lights: where their words lie, that answers stay what they were, and how a bundle is undone. */
#include "patchwork.h"

/* The words of one cell and lights 16 k ... 16 k + 15 fill one 64-byte line in order; of the last, incomplete sixteen
 * lights too. Other cells have other lines. */
static void lines(void **state)
{
    (void)state;
    enum { N = 37 };
    patchwork p;
    make_patchwork(&p, 1, N, (1 << 20) + 5);
    vcache_bundle_lights(p.cache, p.lights, N);
    vcache_worker *worker = make_worker(p.cache, 100, false);
    const table *t = &p.cache->table;
    assert_int_equal((uintptr_t)t->words % 64, 0);
    uint64_t first_line = 0;
    for (size_t e = 0; e < 2; e++) {
        uint64_t visible = 0, used = 0, distinct = 0, line_of[3];
        tracer rays = {0};
        assert_true(vcache_query(worker, patch_at(&p, e), p.lights, N, NULL, &visible, light_up, &rays));
        for (uint64_t i = 0; i < t->count; i++) {
            if (table_load_relaxed(t, i) == 0 || (e == 1 && i / 16 == first_line))
                continue;
            if (distinct == 0 || line_of[distinct - 1] != i / 16) {
                assert_true(distinct < 3);
                line_of[distinct++] = i / 16;
                assert_int_equal(i % 16, 0); /* each starts with its first light */
            }
            used++;
        }
        assert_int_equal(distinct, 3);
        assert_int_equal(used, N);
        first_line = line_of[0];
        for (uint64_t i = 0; i < t->count; i++)
            table_store_relaxed(&p.cache->table, i, 0);
    }
    vcache_worker_destroy(&worker);
    free_patchwork(&p);
}

/* The same queries in the same order, with and without bundles: the same rays, answers and levels, as long as no word
 * is overwritten. What a batch stored is found one by one and the other way around. */
static void answers_stay(void **state)
{
    (void)state;
    static const uint32_t capacities[] = {1, 7, 100000};
    for (int k = 0; k < 3; k++) {
        static uint64_t visible[2][EYES][2];
        vcache_statistics s[2];
        for (int bundled = 0; bundled < 2; bundled++) {
            enum { N = 100 };
            world *w = make_world(16.0f, 3, 1 << 25, VCACHE_HASH_SPLIT);
            vcache_worker *worker = make_worker(w->cache, capacities[k], false);
            tracer t = {0};
            vcache_light light[N];
            uint64_t seed = 51;
            for (uint32_t i = 0; i < N; i++) { /* no two of them in one cell */
                float v[3] = {(float)random_unit(&seed), (float)random_unit(&seed), i % 8 ? 2.0f : 0.02f};
                vcache_surface patch = {.normal = {0.0f, 0.0f, -1.0f}, .density = 1e6f, .user = i};
                memcpy(patch.position, v, sizeof v);
                if (i % 3 == 0)
                    vcache_prepare_point(w->cache, v, i, &light[i]);
                else if (i % 3 == 1)
                    vcache_prepare_direction(w->cache, v, i, &light[i]);
                else
                    vcache_prepare_patch(w->cache, &patch, &light[i]);
            }
            if (bundled)
                vcache_bundle_lights(w->cache, light, N);
            memset(visible[bundled], 0, sizeof visible[bundled]);
            for (size_t e = 0; e < EYES; e++) {
                if (w->surface[e].position[0] > 0.3f || w->surface[e].position[1] > 0.3f)
                    continue; /* cells enough */
                uint64_t *v = visible[bundled][e];
                if (e % 3)
                    assert_true(vcache_query(worker, eye_at(w, e), light, N, NULL, v, trace, &t));
                else
                    for (uint32_t i = 0; i < N; i++)
                        v[i / 64] |= (uint64_t)vcache_visible(worker, eye_at(w, e), &light[i], trace, &t) << i % 64;
            }
            s[bundled] = statistics_of(worker);
            assert_int_equal(s[bundled].overwritten, 0);
            assert_int_equal(s[bundled].traced, t.rays);
            assert_true(s[bundled].hits[1] > 0 && s[bundled].hits[2] > 0 && s[bundled].bypassed > 0);
            vcache_worker_destroy(&worker);
            free_world(w);
        }
        assert_memory_equal(visible[0], visible[1], sizeof visible[0]);
        assert_memory_equal(&s[0], &s[1], sizeof s[0]);
    }
}

/* Tables around one line, that do not divide into lines, and where two cells fight for one. */
static void small_tables(void **state)
{
    (void)state;
    static const uint64_t sizes[] = {1, 15, 16, 17, 31, 1000};
    for (int levels = 1; levels <= 2; levels++)
        for (int i = 0; i < 6; i++) {
            enum { N = 70 };
            patchwork p;
            make_patchwork(&p, levels, N, sizes[i]);
            vcache_light before[N];
            memcpy(before, p.lights, sizeof before);
            vcache_bundle_lights(p.cache, p.lights, N);
            if (sizes[i] < 16)
                assert_memory_equal(before, p.lights, sizeof before);
            else
                for (uint32_t l = 0; l < N; l++)
                    assert_int_equal(p.lights[l].lane, l % 16);
            vcache_worker *worker = make_worker(p.cache, 200, false);
            tracer t = {0};
            uint64_t visible[2];
            for (uint64_t turn = 0; turn < 400; turn++) {
                size_t e = turn / 8 % PATCHES;
                uint64_t asked[2] = {(uint64_t)0xf << 8 * (turn / 8 % 8), 0};
                assert_true(
                    vcache_query(worker, patch_at(&p, e), p.lights, N, turn % 8 ? asked : NULL, visible, light_up, &t));
                assert_lit(&p, e, visible); /* bits not asked for are still there */
            }
            vcache_statistics s = statistics_of(worker);
            assert_int_equal(s.asked, s.traced + hits_of(&s));
            assert_int_equal(s.traced, s.stored);
            assert_int_equal(s.traced, t.rays);
            /* four lights in a row have words of their own in a line: found in six turns of eight */
            if (sizes[i] >= 16 && levels == 1)
                assert_true(hits_of(&s) >= 50 * 6 * 4);
            assert_true(hits_of(&s) > 0);
            vcache_worker_destroy(&worker);
            free_patchwork(&p);
        }
}

/* Bundling moves words and changes no key; twice is once; preparing an end again undoes it. The paper's families know
 * nothing of it. */
static void undone(void **state)
{
    (void)state;
    for (int family = 0; family < 3; family++) {
        world *w = make_world(8.0f, 1, 1 << 16, (vcache_hash)family),
              *fresh = make_world(8.0f, 1, 4, (vcache_hash)family);
        vcache_bundle_lights(w->cache, w->light, 0);
        assert_memory_equal(w->light, fresh->light, sizeof w->light);
        vcache_bundle_lights(w->cache, w->light, LIGHTS);
        vcache_light once[LIGHTS];
        memcpy(once, w->light, sizeof once);
        vcache_bundle_lights(w->cache, w->light, LIGHTS);
        assert_memory_equal(w->light, once, sizeof once);
        uint64_t line[LIGHTS];
        for (int l = 0; l < LIGHTS; l++) {
            if (family != VCACHE_HASH_SPLIT) {
                assert_memory_equal(&w->light[l], &fresh->light[l], sizeof w->light[l]);
                continue;
            }
            line[l] = w->light[l].key.line;
            assert_int_equal(w->light[l].lane, l % 16);
            assert_true(line[l] == line[l / 16 * 16]);
            assert_int_equal(level_key(w, 7, l, 0, -1), level_key(fresh, 7, l, 0, -1));
            if (l % 4 == 0) {
                vcache_prepare_point(w->cache, fresh->light[l].position, fresh->light[l].user, &w->light[l]);
                assert_memory_equal(&w->light[l], &fresh->light[l], sizeof w->light[l]);
            }
        }
        if (family == VCACHE_HASH_SPLIT)
            assert_int_equal(count_distinct(line, LIGHTS), (LIGHTS + 15) / 16);
        free_world(w);
        free_world(fresh);
    }
}

/* Lights of one light cell have one key, but in a bundle a word each: they must not wait for each other in turn. */
static void one_cell_is_one_round(void **state)
{
    (void)state;
    enum { COUNT = 200 };
    vcache_config config = vcache_default_config();
    vcache *c = make_cache(&config);
    vcache_worker *w = make_worker(c, 4096, false);
    vcache_surface s = {.normal = {0.0f, 0.0f, 1.0f}, .density = 100.0f};
    vcache_eye *eye = make_eye(c, &s, 4.0f, 0);
    vcache_light lights[COUNT];
    uint64_t seed = 11, visible[4] = {0};
    for (int i = 0; i < COUNT; i++) {
        float d[3];
        random_direction(&seed, d);
        vcache_prepare_solid_angle(c, d, 1e-3f, (uint64_t)i, &lights[i]);
    }
    vcache_bundle_lights(c, lights, COUNT);
    assert_int_equal(vcache_add(w, eye, lights, 0, COUNT, NULL, visible), COUNT);
    int rounds = 0;
    const vcache_miss *misses;
    for (size_t n; (n = vcache_misses(w, &misses)) > 0; rounds++) {
        vcache_answer answers[COUNT];
        memset(answers, VCACHE_VISIBLE, n);
        vcache_commit(w, answers);
    }
    assert_int_equal(rounds, 1);
    for (int i = 0; i < COUNT; i++)
        assert_true(visible[i / 64] >> i % 64 & 1);
    free(eye);
    vcache_worker_destroy(&w);
    vcache_destroy(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lines),
        cmocka_unit_test(answers_stay),
        cmocka_unit_test(small_tables),
        cmocka_unit_test(undone),
        cmocka_unit_test(one_cell_is_one_round),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
