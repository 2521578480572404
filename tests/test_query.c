/* SPDX-License-Identifier: Apache-2.0 */
/* Alg. 2 against a version of it that is written word by word, by hand at an edge, and in what it gains. */
#include "world.h"

/* ------------------------------------------------------------------------------------------- Alg. 2, word by word */

/* V^c: a map of whole keys, so that nothing is overwritten or mistaken. */
typedef struct known {
    uint64_t key;
    bool used, visible;
} known;

enum { MAP = 1 << 20 };

static known *find(known *map, uint64_t key)
{
    size_t i = key % MAP;
    while (map[i].used && map[i].key != key)
        i = (i + 1) % MAP;
    return &map[i];
}

static bool algorithm_two(known *map, const world *w, size_t eye, int light, uint64_t *rays, int *level)
{
    bool exact = sees(w->surface[eye].position, w->light[light].position, w->light[light].side_squared < 0.0f);
    *level = -1;
    if (too_near(w, eye, light)) {
        ++*rays;
        return exact;
    }
    known *cluster = NULL;
    for (uint32_t d = 0; d < eye_at(w, eye)->levels; d++) {
        cluster = find(map, level_key(w, eye, light, d, -1));
        if (!cluster->used) {
            *cluster = (known){level_key(w, eye, light, d, -1), true, exact};
            ++*rays;
            *level = -1;
            break;
        }
        *level = (int)d;
        bool agree = true;
        for (int n = 0; n < 4; n++) {
            const known *other = find(map, level_key(w, eye, light, d, n));
            agree = agree && (!other->used || other->visible == cluster->visible);
        }
        if (agree)
            break;
    }
    return cluster->visible;
}

/* One pair after the other: vcache_visible answers, traces and counts as the algorithm does. */
static void follows_algorithm_two(void **state)
{
    (void)state;
    known *map = calloc(MAP, sizeof *map);
    assert_non_null(map);
    for (int levels = 1; levels <= 4; levels++) {
        memset(map, 0, MAP * sizeof *map);
        world *w = make_world(16.0f, levels, (uint64_t)1 << 26, VCACHE_HASH_SPLIT);
        vcache_worker *worker = make_worker(w->cache, 1, false);
        tracer t = {0};
        uint64_t rays = 0, hits[VCACHE_MAX_LEVELS] = {0};
        for (size_t e = 0; e < EYES; e++)
            for (int l = (int)(e % 5); l < LIGHTS; l += 5) {
                int level;
                bool expected = algorithm_two(map, w, e, l, &rays, &level);
                assert_int_equal(vcache_visible(worker, eye_at(w, e), &w->light[l], trace, &t), expected);
                assert_int_equal(t.rays, rays);
                if (level >= 0)
                    hits[level]++;
            }
        vcache_statistics s = statistics_of(worker);
        assert_memory_equal(s.hits, hits, sizeof hits);
        assert_true(s.hits[levels - 1] > 0); /* the last level is used */
        vcache_worker_destroy(&worker);
        free_world(w);
    }
    free(map);
}

/* ------------------------------------------------------------------------------------------- an edge, cell by cell */

static bool scripted(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    /* the answer stands in the eye's `user`; rays are counted */
    *(int *)context += (int)count;
    for (size_t i = 0; i < count; i++)
        answers[i] = (vcache_answer)misses[i].eye_user;
    return true;
}

/* Cells A | B side by side along each of the grid's four directions; C far away from both. C_E = 4: two levels. */
static void refines_at_an_edge(void **state)
{
    (void)state;
    vcache_config config = vcache_default_config();
    config.bounds_min[0] = config.bounds_min[1] = config.bounds_min[2] = -1.0f;
    for (int direction = 0; direction < 4; direction++) {
        vcache *c = make_cache(&config);
        vcache_worker *worker = make_worker(c, 8, false);
        vcache_light light;
        vcache_prepare_direction(c, (float[3]){0.0f, 0.0f, 1.0f}, 0, &light);
        float side = (float)(c->diameter / c->resolution[quantize_step(c, 12.0 * 100.0 / 16.0, c->step_limit)]);
        /* the middle of cell (0, 0): u = (0.5 - 0.4142) sides */
        float middle = 0.0857864376f * side;
        float step[2] = {(float)((direction == 0) - (direction == 2)) * side,
                         (float)((direction == 1) - (direction == 3)) * side};
        vcache_surface a = {
            .position = {middle, middle, 0.0f}, .normal = {0.0f, 0.0f, 1.0f}, .density = 100.0f, .user = 1};
        vcache_surface b = a, far = a, corner = a;
        b.position[0] += step[0], b.position[1] += step[1], b.user = 0;
        far.position[0] -= 3.0f * step[0], far.position[1] -= 3.0f * step[1];
        corner.position[0] += step[0] - step[1], corner.position[1] += step[1] + step[0];
        vcache_eye *ea = make_eye(c, &a, 4.0f, 0), *eb = make_eye(c, &b, 4.0f, 0), *ef = make_eye(c, &far, 4.0f, 0);
        vcache_eye *ec = make_eye(c, &corner, 4.0f, 0);
        assert_int_equal(ea->levels, 2);
        int rays = 0;
        assert_true(vcache_visible(worker, ea, &light, scripted, &rays)); /* A: unknown, traced */
        assert_int_equal(rays, 1);
        assert_true(vcache_visible(worker, ea, &light, scripted, &rays)); /* known, neighbours unknown: no ray */
        assert_int_equal(rays, 1);
        assert_false(vcache_visible(worker, eb, &light, scripted, &rays)); /* B: unknown, traced, A not looked at */
        assert_int_equal(rays, 2);
        assert_true(vcache_visible(worker, ef, &light, scripted, &rays));
        assert_true(vcache_visible(worker, ef, &light, scripted, &rays)); /* 3 cells away: stays at level 0 */
        assert_int_equal(rays, 3);
        assert_int_equal(statistics_of(worker).hits[0], 2);
        assert_true(
            vcache_visible(worker, ea, &light, scripted, &rays)); /* A differs from B: level 1, unknown, traced */
        assert_int_equal(rays, 4);
        assert_true(vcache_visible(worker, ea, &light, scripted, &rays)); /* level 1 known, and the last */
        assert_int_equal(rays, 4);
        assert_int_equal(statistics_of(worker).hits[1], 1);
        assert_false(vcache_visible(worker, eb, &light, scripted, &rays)); /* B differs from A as well */
        assert_int_equal(rays, 5);
        assert_true(vcache_visible(worker, ec, &light, scripted, &rays)); /* beside B: unknown */
        assert_true(vcache_visible(worker, ec, &light, scripted, &rays)); /* and differs from it: level 1 */
        assert_int_equal(rays, 7);
        vcache_statistics s = statistics_of(worker);
        assert_int_equal(s.hits[0], 2);
        assert_int_equal(s.hits[1], 1);
        assert_int_equal(s.hit_levels, 3);
        assert_int_equal(s.stored, 7);
        free(ea), free(eb), free(ef), free(ec);
        vcache_worker_destroy(&worker);
        vcache_destroy(&c);
    }
}

/* In a second pass only eyes within reach of the shadow's edge go below level 0, and refining lowers the error. */
static void refinement_pays(void **state)
{
    (void)state;
    uint64_t wrong[2] = {0, 0};
    for (int refined = 0; refined < 2; refined++) {
        world *w = make_world(8.0f, refined ? 0 : 1, (uint64_t)1 << 22, VCACHE_HASH_SPLIT);
        vcache_worker *worker = make_worker(w->cache, 64, false);
        tracer t = {0};
        uint64_t near_edge = 0, deep = 0;
        for (int l = 0; l < 32; l += 4)
            for (int pass = 0; pass < 2; pass++)
                for (size_t e = 0; e < EYES - EYES / 100; e++) {
                    vcache_worker_reset_statistics(worker);
                    const float *x = w->surface[e].position, *y = w->light[l].position;
                    bool visible = vcache_visible(worker, eye_at(w, e), &w->light[l], trace, &t),
                         exact = sees(x, y, false);
                    if (pass == 0)
                        continue;
                    wrong[refined] += visible != exact;
                    bool below = (statistics_of(worker).hit_levels & ~1u) || statistics_of(worker).traced;
                    /* Does visibility change within reach? Representatives of the cell and the 4 around it lie inside a
                     * square of 4 cells around the eye. */
                    bool changes = false;
                    float side = sqrtf(eye_at(w, e)->side_squared);
                    for (int k = 0; k < 41 * 41 && !changes; k++) {
                        float q[3] = {x[0] + side * ((float)(k % 41) - 20.0f) / 10.0f,
                                      x[1] + side * ((float)(k / 41) - 20.0f) / 10.0f, 0.0f};
                        changes = sees(q, y, false) != exact;
                    }
                    assert_true(changes || !below);
                    near_edge += changes, deep += below;
                }
        if (refined)
            assert_true(deep * 4 > near_edge); /* and many of those do go down */
        else
            assert_true(deep == 0);
        vcache_worker_destroy(&worker);
        free_world(w);
    }
    print_message("mispredicted of 31680: %llu unrefined, %llu refined\n", (unsigned long long)wrong[0],
                  (unsigned long long)wrong[1]);
    assert_true(wrong[0] > 0);
    assert_true(wrong[1] * 2 < wrong[0]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(follows_algorithm_two),
        cmocka_unit_test(refines_at_an_edge),
        cmocka_unit_test(refinement_pays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
