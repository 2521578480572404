/* SPDX-License-Identifier: Apache-2.0 */
/* Workers that verify: all is traced, errors of the cache are reported, and nothing else changes. */
#include "world.h"

/* How pairs are asked for. */
typedef enum way { ONE_BY_ONE, ARRAY, BUNDLED, ROWS, VERTICES, WAYS } way;

typedef struct reports {
    uint64_t count, leaks;
    uint32_t levels; /* mask */
    const world *w;
    bool vertices;
} reports;

static void report(void *context, const vcache_misprediction *m)
{
    reports *r = context;
    const vcache_miss *ray = &m->ray;
    r->count++;
    r->leaks += !m->visible;
    r->levels |= 1u << m->level;
    assert_int_equal(sees(ray->eye_position, ray->light_position, ray->infinite), m->visible);
    assert_in_range(ray->eye_user, 0, EYES - 1);
    assert_in_range(ray->light_user, 1000, 1000 + LIGHTS - 1);
    assert_memory_equal(ray->eye_position, r->w->surface[ray->eye_user].position, sizeof ray->eye_position);
    assert_true(r->vertices ? m->cell == 0 : m->cell == vcache_eye_cell(eye_at(r->w, ray->eye_user), m->level));
}

typedef struct result {
    vcache_statistics s;
    uint64_t answers; /* checksum */
    uint64_t wrong, leaks, rays;
    uint32_t levels; /* of cells that were wrong */
} result;

typedef struct ends {
    vcache_vertex eye[EYES], light[LIGHTS];
    vcache_vertex_pair pairs[LIGHTS];
} ends;

static void ask(vcache_worker *worker, world *w, way how, size_t eye, vcache_light_set *set, ends *v, uint64_t *visible,
                tracer *t)
{
    if (how == ONE_BY_ONE) {
        for (uint32_t i = 0; i < LIGHTS; i++)
            visible[i / 64] |= (uint64_t)vcache_visible(worker, eye_at(w, eye), &w->light[i], trace, t) << i % 64;
        return;
    }
    for (uint32_t i = 0; how == VERTICES && i < LIGHTS; i++)
        v->pairs[i] = (vcache_vertex_pair){&v->eye[eye], &v->light[i]};
    for (uint32_t first = 0; first < LIGHTS;) {
        if (how == ROWS)
            first = vcache_add_set(worker, eye_at(w, eye), set, first, NULL, visible);
        else if (how == VERTICES)
            first = vcache_add_vertices(worker, v->pairs, first, LIGHTS, visible);
        else
            first = vcache_add(worker, eye_at(w, eye), w->light, first, LIGHTS, NULL, visible);
        if (first < LIGHTS)
            assert_true(vcache_resolve(worker, trace, t));
    }
}

static void prepare_vertices(const world *w, ends *v)
{
    for (int i = 0; i < EYES; i++)
        vcache_prepare_eye_vertex(w->cache, &w->surface[i], 200.0f, 1000.0f, 0, &v->eye[i]);
    for (int i = 0; i < LIGHTS; i++) {
        vcache_surface s = {.normal = {0.0f, 0.0f, -1.0f}, .density = 0.05f, .user = (uint64_t)i + 1000};
        memcpy(s.position, w->light[i].position, sizeof s.position);
        s.position[2] = 2.0f;
        vcache_prepare_light_vertex(w->cache, &s, &v->light[i]);
    }
}

/* All pairs, several eyes in a batch; capacity is low, so that batches fill up. */
static result run(way how, bool verify, bool exact, bool silent)
{
    world *w = make_world(8.0f, 0, 1u << 18, VCACHE_HASH_SPLIT);
    ends *v = calloc(1, sizeof *v);
    uint64_t(*visible)[WORDS] = calloc(EYES, sizeof *visible);
    vcache_light_set *set = NULL;
    assert_non_null(v);
    assert_non_null(visible);
    if (how == BUNDLED)
        vcache_bundle_lights(w->cache, w->light, LIGHTS);
    prepare_vertices(w, v);
    assert_int_equal(vcache_light_set_create(w->cache, w->light, LIGHTS, 1 << 20, &set, NULL), VCACHE_OK);
    reports r = {.w = w, .vertices = how == VERTICES};
    vcache_worker_config config = vcache_default_worker_config();
    config.capacity = 300;
    config.exact = exact;
    config.verify = verify;
    config.report = silent ? NULL : report;
    config.report_context = &r;
    vcache_worker *worker = NULL;
    assert_int_equal(vcache_worker_create(w->cache, &config, &worker, NULL), VCACHE_OK);
    tracer t = {0};
    for (size_t i = 0; i < EYES; i++) {
        ask(worker, w, how, i, set, v, visible[i], &t);
        /* in the same places with and without verifying: what is known when depends on it */
        if (i % 2)
            assert_true(vcache_resolve(worker, trace, &t));
    }
    assert_true(vcache_resolve(worker, trace, &t));

    result out = {.s = statistics_of(worker), .rays = t.rays, .levels = r.levels};
    for (size_t i = 0; i < EYES; i++)
        for (uint32_t k = 0; k < LIGHTS; k++) {
            const vcache_light *l = &w->light[k];
            const float *to = how == VERTICES ? v->light[k].position : l->position;
            bool truth = sees(w->surface[i].position, to, how != VERTICES && l->side_squared < 0.0f);
            bool said = visible[i][k / 64] >> k % 64 & 1u;
            out.wrong += said != truth;
            out.leaks += said && !truth;
        }
    out.answers = checksum(0, visible, EYES * sizeof *visible);
    if (!silent && verify) {
        assert_int_equal(r.count, out.s.mispredicted);
        assert_int_equal(r.leaks, out.s.leaked);
    }
    vcache_worker_destroy(&worker);
    vcache_light_set_destroy(&set);
    free(visible);
    free(v);
    free_world(w);
    return out;
}

/* One by one nothing waits, so the answers are those of a run without; in batches, rays that verify take places, so
 * that batches end elsewhere and another point may speak for a cell: compared with a batch as large. */
static void all_errors_are_reported(void **state)
{
    (void)state;
    for (way how = ONE_BY_ONE; how < WAYS; how++) {
        result r = run(how, true, false, false);
        assert_int_equal(r.s.verified + r.s.traced, (uint64_t)EYES * LIGHTS);
        assert_int_equal(r.s.verified, hits_of(&r.s));
        assert_int_equal(r.rays, (uint64_t)EYES * LIGHTS);
        assert_int_equal(r.s.mispredicted, r.wrong);
        assert_int_equal(r.s.leaked, r.leaks);
        assert_int_equal(r.s.stored, r.s.traced - r.s.bypassed);
        assert_int_equal(r.levels, how == VERTICES ? 1u : r.s.hit_levels);
        assert_true(r.wrong > 100);
        assert_in_range(r.leaks, r.wrong / 5, r.wrong * 4 / 5);
    }
}

static void nothing_else_changes(void **state)
{
    (void)state;
    result with = run(ONE_BY_ONE, true, false, true), without = run(ONE_BY_ONE, false, false, false);
    assert_true(with.answers == without.answers);
    assert_int_equal(without.s.verified + without.s.mispredicted + without.s.leaked, 0);
    assert_int_equal(with.s.mispredicted, with.wrong);
    assert_memory_equal(&with.s.asked, &without.s.asked,
                        offsetof(vcache_statistics, verified) - offsetof(vcache_statistics, asked));
}

static void exact_workers_verify_nothing(void **state)
{
    (void)state;
    result r = run(ARRAY, true, true, false);
    assert_int_equal(r.s.traced, (uint64_t)EYES * LIGHTS);
    assert_int_equal(r.s.verified, 0);
    assert_int_equal(r.wrong, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_errors_are_reported),
        cmocka_unit_test(nothing_else_changes),
        cmocka_unit_test(exact_workers_verify_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
