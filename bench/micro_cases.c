/* SPDX-License-Identifier: Apache-2.0 */
#include "micro.h"

#include <stdio.h>
#include <stdlib.h>

volatile uint64_t micro_sink;

/* --------------------------------------------------------------------------------------------------------- prepare */

enum { SURFACES = 1024 };
enum { END_EYE_8, END_EYE_32, END_PATCH, END_POINT, END_DIRECTION, END_SOLID_ANGLE, END_VERTEX, ENDS };
static const char *const end_names[] = {"eye-ce8", "eye-ce32", "patch", "point", "direction", "solid-angle", "vertex"};

static uint64_t run_prepare(const micro_case *m, world *w, uint64_t steps)
{
    static vcache_surface s[SURFACES];
    static _Alignas(64) char out[VCACHE_EYE_BYTES];
    uint64_t seed = 5, used = 0;
    if (s[0].density == 0.0f)
        for (int i = 0; i < SURFACES; i++) {
            for (int k = 0; k < 3; k++) {
                s[i].position[k] = random_unit(&seed);
                s[i].normal[k] = random_unit(&seed) - 0.5f;
            }
            s[i].density = 1e4f + 1e6f * random_unit(&seed);
        }
    for (uint64_t i = 0; i < steps; i++) {
        const vcache_surface *f = &s[i % SURFACES];
        switch (m->variant) {
        case END_EYE_8:
        case END_EYE_32:
            vcache_prepare_eye(w->cache, f, m->variant == END_EYE_8 ? 8.0f : 32.0f, 0, (vcache_eye *)(void *)out);
            break;
        case END_PATCH:
            vcache_prepare_patch(w->cache, f, (vcache_light *)(void *)out);
            break;
        case END_POINT:
            vcache_prepare_point(w->cache, f->position, 0, (vcache_light *)(void *)out);
            break;
        case END_DIRECTION:
            vcache_prepare_direction(w->cache, f->normal, 0, (vcache_light *)(void *)out);
            break;
        case END_SOLID_ANGLE:
            vcache_prepare_solid_angle(w->cache, f->normal, 100.0f, 0, (vcache_light *)(void *)out);
            break;
        default:
            vcache_prepare_eye_vertex(w->cache, f, 8.0f, 1e5f, 0, (vcache_vertex *)(void *)out);
        }
        used += (uint64_t)out[0];
    }
    micro_sink += used;
    return steps;
}

/* ----------------------------------------------------------------------------------------------------------- query */

/* What was found to be known must not be traced; a foreign word with the same digest may come by. */
static void check_known(world *w, uint64_t units)
{
    vcache_statistics s = {.size = sizeof s};
    vcache_worker_statistics(w->worker, &s);
    if (s.traced > units / 1000)
        die("%llu of %llu known pairs were traced", (unsigned long long)s.traced, (unsigned long long)units);
    vcache_worker_reset_statistics(w->worker);
}

static uint64_t count_bits(const uint64_t *words)
{
    uint64_t n = 0;
    for (int i = 0; i < MICRO_WORDS; i++)
        n += (uint64_t)__builtin_popcountll(words[i]);
    return n;
}

static uint64_t run_single(const micro_case *m, world *w, uint64_t steps)
{
    uint64_t units = 0, seen = 0;
    for (uint64_t i = 0; i < steps; i++) {
        uint32_t at = world_next(w);
        const vcache_eye *eye = world_eye(w, m->levels, w->use[at]);
        for (uint32_t k = 0; k < MICRO_WORDS; k++)
            for (uint64_t bits = w->asked[at][k]; bits; bits &= bits - 1) {
                uint32_t light = 64 * k + (uint32_t)__builtin_ctzll(bits);
                seen += vcache_visible(w->worker, eye, vcache_light_at(w->lights, light), world_trace, NULL);
            }
        units += count_bits(w->asked[at]);
    }
    micro_sink += seen;
    check_known(w, units);
    return units;
}

static uint64_t run_batch(const micro_case *m, world *w, uint64_t steps)
{
    uint64_t units = 0, visible[MICRO_WORDS] = {0};
    for (uint64_t i = 0; i < steps; i++) {
        uint32_t at = world_next(w);
        vcache_add(w->worker, world_eye(w, m->levels, w->use[at]), w->lights, 0, MICRO_LIGHTS, w->asked[at], visible);
        if (vcache_misses(w->worker, NULL))
            vcache_cancel(w->worker);
        units += count_bits(w->asked[at]);
        micro_sink += visible[i % MICRO_WORDS];
    }
    check_known(w, units);
    return units;
}

static uint64_t run_rows(const micro_case *m, world *w, uint64_t steps)
{
    uint64_t visible[MICRO_WORDS] = {0};
    for (uint64_t i = 0; i < steps; i++) {
        vcache_add_set(w->worker, world_eye(w, m->levels, w->use[world_next(w)]), w->set, 0, NULL, visible);
        if (vcache_misses(w->worker, NULL))
            vcache_cancel(w->worker);
        micro_sink += visible[i % MICRO_WORDS];
    }
    check_known(w, steps * MICRO_LIGHTS);
    return steps * MICRO_LIGHTS;
}

/* Each of some eye vertices with each of some light vertices, whose pairs are known. */
static uint64_t run_vertices(const micro_case *m, world *w, uint64_t steps)
{
    enum { SIDE = 64, PAIRS = SIDE * SIDE };
    (void)m;
    static _Alignas(64) char ends[2][SIDE][VCACHE_VERTEX_BYTES];
    static vcache_vertex_pair pairs[PAIRS];
    uint64_t seed = 7, visible[PAIRS / 64];
    for (int i = 0; i < SIDE; i++)
        for (int side = 0; side < 2; side++) {
            vcache_surface s = {.normal = {0, 0, side ? -1.0f : 1.0f}, .user = random_bits(&seed)};
            s.position[0] = random_unit(&seed), s.position[1] = random_unit(&seed), s.position[2] = 0.98f * (float)side;
            s.density = 1.0f + 9.0f * random_unit(&seed);
            vcache_vertex *to = (vcache_vertex *)(void *)ends[side][i];
            if (side)
                vcache_prepare_light_vertex(w->cache, &s, to);
            else
                vcache_prepare_eye_vertex(w->cache, &s, 12.0f, 4e6f, 0, to);
        }
    for (int i = 0; i < PAIRS; i++)
        pairs[i] = (vcache_vertex_pair){(vcache_vertex *)(void *)ends[0][i / SIDE],
                                        (vcache_vertex *)(void *)ends[1][i % SIDE]};
    for (uint64_t i = 0; i <= steps; i++) { /* the first time they are learnt */
        for (uint32_t next = 0; next < PAIRS;) {
            next = vcache_add_vertices(w->worker, pairs, next, PAIRS, visible);
            if (i == 0)
                vcache_resolve(w->worker, world_trace, NULL);
            else if (vcache_misses(w->worker, NULL))
                vcache_cancel(w->worker);
        }
        if (i == 0)
            vcache_worker_reset_statistics(w->worker);
        micro_sink += visible[i % (PAIRS / 64)];
    }
    check_known(w, steps * PAIRS);
    return steps * PAIRS;
}

/* -------------------------------------------------------------------------------------------------------- estimate */

static vcache_prediction predict(world *w, uint32_t at)
{
    return vcache_predict(w->predictor, &w->surfaces[w->use[at]], w->ce[LEVELS_5], 0, w->contribution);
}

static uint64_t run_predict(const micro_case *m, world *w, uint64_t steps)
{
    (void)m;
    float sum = 0.0f;
    for (uint64_t i = 0; i < steps; i++)
        sum += predict(w, world_next(w)).expected;
    micro_sink += (uint64_t)sum;
    return steps;
}

static uint64_t run_pick(const micro_case *m, world *w, uint64_t steps)
{
    (void)m;
    vcache_pick picks[MICRO_RAYS + 2];
    uint64_t seed = 3, sum = 0;
    predict(w, 0);
    for (uint64_t i = 0; i < steps; i++)
        sum += vcache_pick_lights(w->predictor, MICRO_RAYS, 1, random_unit(&seed), picks, MICRO_RAYS + 2);
    micro_sink += sum;
    return steps;
}

/* Most of what is traced confirms what is known (variant 0); cells that nobody has met take over rows (1). */
static uint64_t run_learn(const micro_case *m, world *w, uint64_t steps)
{
    enum { SETS = 64 };
    static vcache_pick picks[SETS][MICRO_RAYS];
    static vcache_answer answers[SETS][MICRO_RAYS];
    static uint64_t seed = 3;
    for (int i = 0; i < SETS; i++)
        for (uint32_t k = 0; k < MICRO_RAYS; k++) {
            uint32_t part = MICRO_LIGHTS / MICRO_RAYS, light = k * part + (uint32_t)(random_bits(&seed) % part);
            vcache_miss ray = {.light_user = light};
            picks[i][k] = (vcache_pick){.light = light, .weight = 1.0f};
            world_trace(NULL, &ray, 1, &answers[i][k]);
        }
    for (uint64_t i = 0; i < steps; i++) {
        vcache_cells fresh;
        if (m->variant)
            for (int k = 0; k < VCACHE_CELLS; k++)
                fresh.key[k] = random_bits(&seed) | 1; /* as good a hash as any */
        vcache_learn(w->set, m->variant ? &fresh : &w->cells[world_next(w)], picks[i % SETS], answers[i % SETS],
                     MICRO_RAYS);
    }
    return steps;
}

/* Estimates of pairs; of those pushed out by others too, which costs the same. Variant: how many of 8 are learnt. */
static uint64_t run_pairs(const micro_case *m, world *w, uint64_t steps)
{
    float sum = 0.0f;
    for (uint64_t i = 0; i < steps; i++) {
        const vcache_eye *eye = world_eye(w, m->levels, w->use[world_next(w)]);
        for (uint32_t l = 0; l < MICRO_LIGHTS; l++) {
            vcache_estimate e = vcache_estimate_pair(w->worker, eye, vcache_light_at(w->lights, l), 0.5f);
            sum += e.mean + e.probability;
            if (l % 8 < (uint32_t)m->variant)
                vcache_learn_pair(w->worker, &e, VCACHE_VISIBLE);
        }
    }
    micro_sink += (uint64_t)sum;
    return steps * MICRO_LIGHTS;
}

/* ---------------------------------------------------------------------------------------------------------- misses */

enum { MISS_SINGLE, MISS_BATCH, MISS_ROWS };

static void commit(world *w)
{
    static vcache_answer answers[4096]; /* a worker's capacity */
    while (vcache_misses(w->worker, NULL))
        vcache_commit(w->worker, answers);
}

static uint64_t run_misses(const micro_case *m, world *w, uint64_t steps)
{
    uint64_t visible[MICRO_WORDS] = {0}, seen = 0;
    for (uint64_t i = 0; i < steps; i++) {
        uint32_t at = world_next(w);
        if (at == 0)
            vcache_clear(w->cache);
        const vcache_eye *eye = world_eye(w, m->levels, w->use[at]);
        for (uint32_t l = 0; l < MICRO_LIGHTS;) {
            if (m->variant == MISS_SINGLE)
                seen += vcache_visible(w->worker, eye, vcache_light_at(w->lights, l++), world_trace, NULL);
            else if (m->variant == MISS_BATCH)
                l = vcache_add(w->worker, eye, w->lights, l, MICRO_LIGHTS, NULL, visible);
            else
                l = vcache_add_set(w->worker, eye, w->set, l, NULL, visible);
            if (l < MICRO_LIGHTS && m->variant != MISS_SINGLE)
                commit(w);
        }
    }
    commit(w);
    micro_sink += seen;
    vcache_statistics s = {.size = sizeof s};
    vcache_worker_statistics(w->worker, &s);
    vcache_worker_reset_statistics(w->worker);
    return s.traced;
}

/* ------------------------------------------------------------------------------------------------------------ list */

static const char *const hash_names[] = {"split", "lcg-pair", "lcg-xorshift"};
static const char *const level_names[] = {"levels1", "levels5"};
static const uint32_t isas[] = {VCACHE_ISA_SCALAR, VCACHE_ISA_AVX2, VCACHE_ISA_AVX512};
static const char *const isa_names[] = {"scalar", "avx2", "avx512"};

enum { MOST_CASES = 256 };

typedef struct list {
    micro_case *items;
    size_t count;
} list;

static micro_case *append(list *l, world_spec spec, const char *unit,
                          uint64_t (*run)(const micro_case *, world *, uint64_t), int variant)
{
    if (l->count == MOST_CASES)
        die("more than %d cases", MOST_CASES);
    micro_case *m = &l->items[l->count++];
    *m = (micro_case){.unit = unit, .world = spec, .levels = LEVELS_1, .variant = variant, .run = run};
    return m;
}

static void append_queries(list *l, world_spec spec)
{
    for (int batch = 0; batch < 2; batch++)
        for (int levels = 0; levels < LEVEL_CHOICES; levels++) {
            micro_case *m = append(l, spec, "pair", batch ? run_batch : run_single, 0);
            m->levels = levels;
            snprintf(m->name, sizeof m->name, "query/%s/%s/%s%s/%s", batch ? "batch" : "single",
                     residence_names[spec.where], hash_names[spec.hash], spec.bundled ? "-bundled" : "",
                     level_names[levels]);
        }
}

static void append_rows(list *l, residence where, int isa)
{
    const world_spec rows = {.kind = WORLD_ROWS, .where = where, .isa = isas[isa]};
    const char *at = residence_names[where], *name = isa_names[isa];
    for (int levels = 0; levels < LEVEL_CHOICES; levels++) {
        micro_case *m = append(l, rows, "pair", run_rows, 0);
        m->levels = levels;
        snprintf(m->name, sizeof m->name, "rows/%s/%s/%s", at, level_names[levels], name);
    }
    micro_case *m = append(l, rows, "eye end", run_predict, 0);
    snprintf(m->name, sizeof m->name, "estimate/predict/%s/%s", at, name);
    m = append(l, rows, "eye end", run_pick, 0);
    snprintf(m->name, sizeof m->name, "estimate/pick/%s/%s", at, name);
    m = append(l, rows, "eye end", run_learn, 0);
    snprintf(m->name, sizeof m->name, "estimate/learn-known/%s/%s", at, name);
}

micro_case *cases_new(uint32_t isa, size_t *count)
{
    list l = {need(calloc(MOST_CASES, sizeof(micro_case))), 0};
    const world_spec empty = {.where = IN_L3, .isa = VCACHE_ISA_ALL};
    for (int i = 0; i < ENDS; i++)
        snprintf(append(&l, empty, "end", run_prepare, i)->name, sizeof l.items->name, "prepare/%s", end_names[i]);
    snprintf(append(&l, empty, "pair", run_vertices, 0)->name, sizeof l.items->name, "query/vertices");
    snprintf(append(&l, empty, "miss", run_misses, MISS_SINGLE)->name, sizeof l.items->name, "misses/single");
    snprintf(append(&l, empty, "miss", run_misses, MISS_BATCH)->name, sizeof l.items->name, "misses/batch");
    snprintf(append(&l, empty, "miss", run_misses, MISS_ROWS)->name, sizeof l.items->name, "misses/rows");
    for (int i = 0; i < 2 * MICRO_ADAPTIVE_SIZES; i++)
        snprintf(append(&l, empty, "point", micro_adaptive, i)->name, sizeof l.items->name, "adaptive/%s/%u",
                 i % 2 ? "sorted" : "incremental", micro_adaptive_lights[i / 2]);
    for (residence r = IN_L2; r <= IN_DRAM; r++)
        snprintf(append(&l, (world_spec){.where = r, .isa = VCACHE_ISA_ALL}, "eye end", run_learn, 1)->name,
                 sizeof l.items->name, "estimate/learn-new/%s", residence_names[r]);
    for (residence r = IN_L2; r <= IN_DRAM; r++)
        for (int learnt = 0; learnt <= 8; learnt += 4)
            snprintf(append(&l, (world_spec){.kind = WORLD_TALLIES, .where = r, .isa = VCACHE_ISA_ALL}, "pair",
                            run_pairs, learnt)
                         ->name,
                     sizeof l.items->name, "estimate/pair-%s/%s",
                     learnt == 0   ? "only"
                     : learnt == 4 ? "learn-half"
                                   : "learn-all",
                     residence_names[r]);
    for (residence r = IN_L2; r <= IN_DRAM; r++)
        for (vcache_hash h = VCACHE_HASH_SPLIT; h <= VCACHE_HASH_LCG_XORSHIFT; h++)
            for (int bundled = 0; bundled < (h == VCACHE_HASH_SPLIT ? 2 : 1); bundled++)
                append_queries(&l, (world_spec){WORLD_WORDS, r, h, bundled, VCACHE_ISA_ALL});
    for (residence r = IN_L2; r <= IN_DRAM; r++)
        for (int i = 0; i < 3; i++)
            if (isa == VCACHE_ISA_ALL || isa == isas[i])
                append_rows(&l, r, i);
    *count = l.count;
    return l.items;
}
