/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of light sets share: sets, and a world in which each eye has cells of its own, so that visibility can
 * be any function of the cell and the light. */
#ifndef TESTS_PATCHWORK_H
#define TESTS_PATCHWORK_H

#include "../vcache/light_set.h"
#include "world.h"

static inline uint64_t row_bytes(uint32_t count)
{
    return ((uint64_t)(count + 63) / 64 * 16 + 16 + 63) / 64 * 64;
}

static inline vcache_light_set *make_set(vcache *cache, const vcache_light *lights, uint32_t count, uint64_t rows)
{
    char message[VCACHE_MESSAGE_BYTES];
    vcache_light_set *set = NULL;
    if (vcache_light_set_create(cache, lights, count, rows * row_bytes(count), &set, message) != VCACHE_OK)
        fail_msg("vcache_light_set_create: %s", message);
    return set;
}

/* Nobody holds a row any more. Two writers in one row would leave its version odd, and the row useless for good. */
static inline bool rows_are_closed(const vcache_light_set *set)
{
    for (uint64_t r = 0; r < set->rows; r++)
        if (atomic_load(&set->memory[r * set->stride + ROW_VERSION]) & 1)
            return false;
    return true;
}

static inline void query_set(vcache_worker *worker, const vcache_eye *eye, vcache_light_set *set, const uint64_t *asked,
                             uint64_t *visible, vcache_trace how, void *context)
{
    for (uint32_t i = 0; i < set->count;) {
        i = vcache_add_set(worker, eye, set, i, asked, visible);
        vcache_resolve(worker, how, context);
    }
}

static inline bool bit_of(const uint64_t *words, size_t i)
{
    return words[i / 64] >> i % 64 & 1;
}

/* ------------------------------------------------------------------------------------- a function of cell and light */

/* 36 eyes, each in cells of its own in all levels, side by side so that they are neighbours and refine. */
enum { PATCHES = 36 };

typedef struct patchwork {
    vcache *cache;
    size_t stride;
    char *eyes;
    vcache_light *lights;
    uint32_t count;
} patchwork;

static inline const vcache_eye *patch_at(const patchwork *p, size_t i)
{
    return (const vcache_eye *)(const void *)(p->eyes + i * p->stride);
}

static inline void prepare_patches(patchwork *p, uint64_t salt)
{
    for (int i = 0; i < PATCHES; i++) {
        vcache_surface s = {.normal = {0.0f, 0.0f, 1.0f}, .density = 16384.0f, .user = (uint64_t)i};
        s.position[0] = 0.036f * (float)(i % 6), s.position[1] = 0.036f * (float)(i / 6);
        vcache_prepare_eye(p->cache, &s, 4.0f, salt, (vcache_eye *)(void *)(p->eyes + (size_t)i * p->stride));
    }
}

static inline void make_patchwork(patchwork *p, int levels, uint32_t lights, uint64_t words)
{
    vcache_config config = vcache_default_config();
    config.levels = levels;
    config.table_bytes = 4 * words;
    *p = (patchwork){.cache = make_cache(&config), .count = lights};
    p->stride = vcache_eye_size(p->cache, 4.0f);
    p->eyes = malloc(p->stride * PATCHES);
    p->lights = malloc(lights * sizeof *p->lights);
    assert_true(p->eyes && p->lights);
    prepare_patches(p, 0);
    uint64_t cells[PATCHES];
    for (int d = 0; d < levels; d++) {
        for (size_t i = 0; i < PATCHES; i++)
            cells[i] = vcache_eye_cell(patch_at(p, i), d);
        assert_int_equal(count_distinct(cells, PATCHES), PATCHES);
    }
    for (uint32_t i = 0; i < lights; i++)
        vcache_prepare_direction(p->cache, (float[3]){1.0f, (float)i, 1.0f}, i, &p->lights[i]);
}

static inline void free_patchwork(patchwork *p)
{
    vcache_destroy(&p->cache);
    free(p->eyes);
    free(p->lights);
}

static inline bool lit(uint64_t eye, uint64_t light)
{
    uint64_t state = eye << 32 | light;
    return random_bits(&state) & 1;
}

static inline bool light_up(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    tracer *t = context;
    t->rays += count;
    t->calls++;
    for (size_t i = 0; i < count; i++)
        answers[i] = (vcache_answer)(lit(misses[i].eye_user, misses[i].light_user) | t->extra);
    return true;
}

static inline void assert_lit(const patchwork *p, size_t eye, const uint64_t *visible)
{
    for (uint32_t l = 0; l < p->count; l++)
        if (bit_of(visible, l) != lit(eye, p->lights[l].user))
            fail_msg("eye %zu, light %u", eye, l);
}

#endif
