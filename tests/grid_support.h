/* SPDX-License-Identifier: Apache-2.0 */
/* Worlds of pixels and lights whose visibility is a table, for the tests of grid coherence. */
#ifndef TESTS_GRID_SUPPORT_H
#define TESTS_GRID_SUPPORT_H

#include "support.h"

#include "../vcache/grid_internal.h"

typedef struct world {
    uint32_t width, height, lights;
    vcache_grid_lights *cells;
    uint8_t *blocked, *below; /* [pixels][lights]; below: its horizon */
    uint64_t *object;         /* [pixels] */
    uint8_t *empty;           /* [pixels] */
    float (*position)[3];     /* [pixels] */
    float distance;           /* of all blockers */
    float *distances;         /* [pixels][lights] in its place, or NULL */
    uint8_t *traced, *answer; /* [pixels][lights] of the last run */
    vcache_grid_statistics statistics;
} world;

static inline void *zeroes(size_t count, size_t size)
{
    void *p = calloc(count + 1, size);
    assert_non_null(p);
    return p;
}

/* All pixels on one object, all lights seen. */
static inline world world_new(uint32_t width, uint32_t height, const float *directions, const float *energy,
                              uint32_t lights)
{
    size_t pixels = (size_t)width * height;
    world w = {.width = width, .height = height, .lights = lights, .distance = 1.0f};
    char message[VCACHE_MESSAGE_BYTES];
    if (vcache_grid_create_lights(directions, energy, lights, NULL, &w.cells, message) != VCACHE_OK)
        fail_msg("%s", message);
    w.blocked = zeroes(pixels * lights, 1);
    w.below = zeroes(pixels * lights, 1);
    w.traced = zeroes(pixels * lights, 1);
    w.answer = zeroes(pixels * lights, 1);
    w.object = zeroes(pixels, sizeof *w.object);
    w.empty = zeroes(pixels, 1);
    w.position = zeroes(pixels, sizeof *w.position);
    return w;
}

static inline void world_free(world *w)
{
    vcache_grid_destroy_lights(&w->cells);
    free(w->blocked);
    free(w->below);
    free(w->traced);
    free(w->answer);
    free(w->object);
    free(w->empty);
    free(w->position);
    free(w->distances);
}

static inline size_t pair_at(const world *w, uint32_t x, uint32_t y, uint32_t light)
{
    return ((size_t)y * w->width + x) * w->lights + light;
}

static inline vcache_grid_config mode_of(const char *name)
{
    vcache_grid_config f = vcache_grid_default_config();
    char message[VCACHE_MESSAGE_BYTES];
    if (!vcache_grid_parse_mode(name, &f, message))
        fail_msg("%s", message);
    return f;
}

/* Decides the world; each pair is given out at most once, and never one that is not asked for. */
static inline void world_run(world *w, const vcache_grid_config *config)
{
    vcache_grid_config f = *config;
    f.pixels = w->width * w->height;
    f.rays = f.rays < w->lights ? w->lights : f.rays;
    vcache_grid *g;
    char message[VCACHE_MESSAGE_BYTES];
    if (vcache_grid_create(&f, w->cells, &g, message) != VCACHE_OK)
        fail_msg("%s", message);
    size_t pairs = (size_t)f.pixels * w->lights;
    memset(w->traced, 0, pairs);
    vcache_grid_begin(g, w->width, w->height);
    for (uint32_t p = 0; p < f.pixels; p++) {
        if (w->empty[p])
            continue;
        uint64_t *asked = vcache_grid_pixel(g, p % w->width, p / w->width, w->object[p], w->position[p]);
        for (uint32_t i = 0; i < w->lights; i++)
            asked[i / 64] |= (uint64_t)!w->below[(size_t)p * w->lights + i] << i % 64;
    }
    vcache_answer *answers = zeroes(f.rays, 1);
    float *distances = zeroes(f.rays, sizeof *distances);
    uint32_t count;
    const vcache_grid_ray *rays;
    while (rays = vcache_grid_next(g, &count), count > 0) {
        assert_true(count <= f.rays);
        for (uint32_t i = 0; i < count; i++) {
            size_t at = (size_t)rays[i].pixel * w->lights + rays[i].light;
            assert_true(rays[i].pixel < f.pixels && rays[i].light < w->lights && !w->empty[rays[i].pixel]);
            assert_true(i == 0 || rays[i].light >= rays[i - 1].light);
            assert_false(w->traced[at] || w->below[at]);
            w->traced[at] = 1;
            answers[i] = w->blocked[at] ? VCACHE_BLOCKED : VCACHE_VISIBLE;
            distances[i] = w->distances ? w->distances[at] : w->distance;
        }
        vcache_grid_tell(g, answers, distances);
    }
    vcache_grid_next(g, &count); /* the end stays the end */
    assert_int_equal(count, 0);
    for (uint32_t p = 0; p < f.pixels; p++)
        for (uint32_t i = 0; i < w->lights; i++)
            w->answer[(size_t)p * w->lights + i] =
                vcache_grid_visible(g, p % w->width, p / w->width)[i / 64] >> i % 64 & 1u;
    w->statistics.size = sizeof w->statistics;
    vcache_grid_statistics_of(g, &w->statistics);
    const vcache_grid_statistics *s = &w->statistics;
    uint64_t traced = 0;
    for (size_t i = 0; i < pairs; i++)
        traced += w->traced[i];
    assert_int_equal(s->traced, traced);
    assert_int_equal(s->traced, s->coarse + s->silhouette + s->uncertain + s->flooded);
    vcache_grid_destroy(&g);
    free(answers);
    free(distances);
}

static inline void run_mode(world *w, const char *name)
{
    vcache_grid_config f = mode_of(name);
    world_run(w, &f);
}

/* Lights traced at a pixel, as a mask. */
static inline uint64_t traced_at(const world *w, uint32_t x, uint32_t y)
{
    uint64_t mask = 0;
    for (uint32_t i = 0; i < w->lights && i < 64; i++)
        mask |= (uint64_t)w->traced[pair_at(w, x, y, i)] << i;
    return mask;
}

static inline uint64_t visible_at(const world *w, uint32_t x, uint32_t y)
{
    uint64_t mask = 0;
    for (uint32_t i = 0; i < w->lights && i < 64; i++)
        mask |= (uint64_t)w->answer[pair_at(w, x, y, i)] << i;
    return mask;
}

/* The number of pixels at which everything was traced. */
static inline uint32_t full_pixels(const world *w)
{
    uint32_t n = 0;
    for (uint32_t p = 0; p < w->width * w->height; p++) {
        bool all = true;
        for (uint32_t i = 0; i < w->lights; i++)
            all = all && w->traced[(size_t)p * w->lights + i];
        n += all;
    }
    return n;
}

/* Six lights; each touches all but the one behind it. */
enum { PX, NX, PY, NY, PZ, NZ, SIX };
static const float six[3 * SIX] = {1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0, 1, 0, 0, -1};
#define BIT(i) ((uint64_t)1 << (i))
#define BESIDE_X (BIT(PY) | BIT(NY) | BIT(PZ) | BIT(NZ))
#define ALL_SIX ((uint64_t)63)

/* 3 x 3 pixels at spacing 2: the corners begin, then the middle, then the edges. */
static inline world three(void)
{
    return world_new(3, 3, six, NULL, SIX);
}

static inline void block(world *w, uint32_t x, uint32_t y, uint32_t light)
{
    w->blocked[pair_at(w, x, y, light)] = 1;
}

static inline void block_corners(world *w, uint32_t light)
{
    for (uint32_t i = 0; i < 4; i++)
        block(w, 2 * (i & 1), 2 * (i >> 1), light);
}

static inline void assert_traced(const world *w, uint32_t x, uint32_t y, uint64_t expected)
{
    if (traced_at(w, x, y) != expected)
        fail_msg("pixel %u %u: traced %02llx, not %02llx", x, y, (unsigned long long)traced_at(w, x, y),
                 (unsigned long long)expected);
}

#endif
