/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of estimates share: a set of directional lights, eye ends on a floor, and what their cells know. */
#ifndef TESTS_ESTIMATE_SUPPORT_H
#define TESTS_ESTIMATE_SUPPORT_H

#include "patchwork.h"

/* C_E and density of all eye ends: cells of 1/32, 1/8 and 1/2. */
static const float fine_ce = 4.0f, fine_density = 16384.0f;

typedef struct bench {
    vcache *cache;
    vcache_light_set *set;
    vcache_predictor *predictor;
    uint32_t count, padded;
    float *contribution;  /* [padded], zero */
    float states[STATES]; /* what the predictor expects */
} bench;

static inline vcache_predictor *make_predictor(vcache_light_set *set)
{
    char message[VCACHE_MESSAGE_BYTES];
    vcache_predictor *p = NULL;
    if (vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, &p, message) != VCACHE_OK)
        fail_msg("vcache_predictor_create: %s", message);
    return p;
}

static inline bench make_bench_of(const vcache_config *config, uint32_t lights, uint64_t rows)
{
    bench b = {.cache = make_cache(config), .count = lights};
    vcache_light *ends = malloc(lights * sizeof *ends);
    assert_non_null(ends);
    for (uint32_t i = 0; i < lights; i++)
        vcache_prepare_direction(b.cache, (float[3]){1.0f, (float)i, 1.0f}, i, &ends[i]);
    b.set = make_set(b.cache, ends, lights, rows);
    free(ends);
    b.predictor = make_predictor(b.set);
    predict_states(VCACHE_DRAW_UNCERTAIN, NULL, b.states);
    b.padded = vcache_light_set_padded(b.set);
    b.contribution = calloc(b.padded, sizeof *b.contribution);
    assert_non_null(b.contribution);
    return b;
}

static inline bench make_bench(uint32_t lights, uint64_t rows, uint32_t isa)
{
    vcache_config config = vcache_default_config();
    config.levels = 1;
    config.isa = isa;
    return make_bench_of(&config, lights, rows);
}

static inline void free_bench(bench *b)
{
    vcache_predictor_destroy(&b->predictor);
    vcache_light_set_destroy(&b->set);
    vcache_destroy(&b->cache);
    free(b->contribution);
}

static inline vcache_surface floor_end(double x, double y)
{
    return (vcache_surface){
        .position = {(float)x, (float)y, 0.5f}, .normal = {0.0f, 0.0f, 1.0f}, .density = fine_density};
}

static inline vcache_prediction predict_at(bench *b, double x, double y)
{
    vcache_surface s = floor_end(x, y);
    return vcache_predict(b->predictor, &s, fine_ce, 0, b->contribution);
}

static inline void learn_one(bench *b, const vcache_cells *cells, uint32_t light, int answer)
{
    vcache_pick pick = {.light = light, .weight = 1.0f};
    vcache_answer a = (vcache_answer)answer;
    vcache_learn(b->set, cells, &pick, &a, 1);
}

enum { UNKNOWN, SEEN_BLOCKED, SEEN_BOTH, SEEN_VISIBLE };

/* What cell k knows of a light. */
static inline int known_of(const bench *b, const vcache_cells *cells, int k, uint32_t light)
{
    uint64_t known, visible;
    row_read(b->set, cells->key[k], light / 64, 1, &known, &visible);
    return (int)(known >> light % 64 & 1) | (int)(visible >> light % 64 & 1) << 1;
}

#endif
