/* SPDX-License-Identifier: Apache-2.0 */
/* A world whose visibility is known in closed form, for the tests of queries. */
#ifndef TESTS_WORLD_H
#define TESTS_WORLD_H

#include "support.h"

/* A floor z = 0 over the unit square. At height 1 a screen covers x + 0.3 y < 0.5; a ball hangs beside its edge. */
static inline bool sees(const float eye[3], const float light[3], bool infinite)
{
    double d[3], o[3];
    for (int i = 0; i < 3; i++)
        o[i] = eye[i], d[i] = infinite ? (double)light[i] : (double)light[i] - eye[i];
    double t = (1.0 - o[2]) / d[2];
    if (t > 0.0 && (infinite || t < 1.0) && o[0] + t * d[0] + 0.3 * (o[1] + t * d[1]) < 0.5)
        return false;
    double b[3] = {o[0] - 0.8, o[1] - 0.5, o[2] - 0.7}, r = 0.1; /* |b + t d| = r */
    double dd = d[0] * d[0] + d[1] * d[1] + d[2] * d[2], bd = b[0] * d[0] + b[1] * d[1] + b[2] * d[2];
    double bb = b[0] * b[0] + b[1] * b[1] + b[2] * b[2], root = bd * bd - dd * (bb - r * r);
    if (root < 0.0)
        return true;
    t = (-bd - sqrt(root)) / dd;
    return !(t > 0.0 && (infinite || t < 1.0));
}

typedef struct tracer {
    uint64_t rays, calls, largest;
    uint64_t cancel_after; /* this many calls are answered; 0: all */
    vcache_answer extra;   /* or-ed to each answer */
} tracer;

static inline bool trace(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    tracer *t = context;
    if (t->cancel_after && t->calls == t->cancel_after)
        return false;
    t->calls++;
    t->rays += count;
    t->largest = count > t->largest ? count : t->largest;
    for (size_t i = 0; i < count; i++)
        answers[i] =
            (vcache_answer)(sees(misses[i].eye_position, misses[i].light_position, misses[i].infinite) | t->extra);
    return true;
}

/* 128 x 128 eye samples are expected on the floor, of which these are some. */
enum { EYES = 4000, LIGHTS = 70, WORDS = (LIGHTS + 63) / 64 };

typedef struct world {
    vcache *cache;
    size_t stride;
    char *eyes;
    vcache_surface surface[EYES];
    vcache_light light[LIGHTS];
} world;

static inline const vcache_eye *eye_at(const world *w, size_t i)
{
    return (const vcache_eye *)(const void *)(w->eyes + i * w->stride);
}

/* Eyes on the floor, the last hundredth of them at lights; lights of all four kinds, patches in shared cells too. */
static inline world *make_world(float ce, int levels, uint64_t words, vcache_hash family)
{
    world *w = calloc(1, sizeof *w);
    assert_non_null(w);
    vcache_config config = vcache_default_config();
    config.bounds_max[2] = 2.0f;
    config.levels = levels;
    config.table_bytes = words * 4;
    config.hash = family;
    w->cache = make_cache(&config);
    w->stride = vcache_eye_size(w->cache, ce);
    w->eyes = malloc(w->stride * EYES);
    assert_non_null(w->eyes);
    uint64_t seed = 11;
    for (int i = 0; i < LIGHTS; i++) {
        float p[3] = {(float)random_unit(&seed), (float)random_unit(&seed), 2.0f}, d[3];
        random_direction(&seed, d);
        d[2] = fabsf(d[2]) + 0.2f;
        vcache_surface s = {.normal = {0.0f, 0.0f, -1.0f}, .density = 20.0f, .user = (uint64_t)i + 1000};
        memcpy(s.position, p, sizeof p);
        if (i % 4 == 0)
            vcache_prepare_point(w->cache, p, s.user, &w->light[i]);
        else if (i % 4 == 1)
            vcache_prepare_direction(w->cache, d, s.user, &w->light[i]);
        else if (i % 4 == 2)
            vcache_prepare_patch(w->cache, &s, &w->light[i]);
        else
            vcache_prepare_solid_angle(w->cache, d, 20.0f, s.user, &w->light[i]);
    }
    for (int i = 0; i < EYES; i++) {
        vcache_surface *s = &w->surface[i];
        *s = (vcache_surface){.normal = {0.0f, 0.0f, 1.0f}, .density = 16384.0f, .user = (uint64_t)i};
        s->position[0] = (float)random_unit(&seed), s->position[1] = (float)random_unit(&seed);
        if (i >= EYES - EYES / 100) {
            memcpy(s->position, w->light[i % LIGHTS].position, sizeof s->position);
            s->position[2] = 1.9999f;
        }
        vcache_prepare_eye(w->cache, s, ce, 0, (vcache_eye *)(void *)(w->eyes + (size_t)i * w->stride));
    }
    return w;
}

static inline void free_world(world *w)
{
    vcache_destroy(&w->cache);
    free(w->eyes);
    free(w);
}

static inline uint64_t level_key(const world *w, size_t eye, int light, uint32_t level, int neighbour)
{
    const eye_level *l = &eye_at(w, eye)->level[level];
    return pair_key(w->cache->config.hash, 0, neighbour < 0 ? l->center : l->neighbour[neighbour], &w->light[light]);
}

static inline bool too_near(const world *w, size_t eye, int light)
{
    const vcache_light *l = &w->light[light];
    if (l->side_squared < 0.0f)
        return false;
    double d = 0.0, side = fmax((double)eye_at(w, eye)->side_squared, (double)l->side_squared);
    for (int i = 0; i < 3; i++)
        d += pow((double)w->surface[eye].position[i] - (double)l->position[i], 2.0);
    return d < side;
}

#endif
