/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of estimated pairs share: eye ends on a floor, lights above it, as ends and as vertices. */
#ifndef TESTS_PAIR_SUPPORT_H
#define TESTS_PAIR_SUPPORT_H

#include "support.h"

enum { PAIR_LIGHTS = 16 };

/* Both kinds of both ends. Belongs to one thread, as vertices do. */
typedef struct pair_ends {
    _Alignas(8) char eye[VCACHE_EYE_BYTES];
    vcache_vertex eye_vertex;
    vcache_light light[PAIR_LIGHTS];
    vcache_vertex light_vertex[PAIR_LIGHTS];
} pair_ends;

static inline const vcache_eye *eye_of(const pair_ends *p)
{
    return (const vcache_eye *)(const void *)p->eye;
}

static inline vcache_surface floor_end(double x, double y)
{
    return (vcache_surface){
        .position = {(float)x, (float)y, 0.2f}, .normal = {0.0f, 0.0f, 1.0f}, .density = 1024.0f, .user = 1};
}

static inline vcache_surface ceiling_end(uint32_t i)
{
    return (vcache_surface){.position = {0.125f + 0.25f * (float)(i % 4), 0.125f + 0.25f * (float)(i / 4), 0.9f},
                            .normal = {0.0f, 0.0f, -1.0f},
                            .density = 256.0f,
                            .user = i};
}

/* Cells of 1/4 of the eye, 1/16 of the light; of vertices 1/8. */
static inline void move_eye(const vcache *c, pair_ends *p, double x, double y)
{
    vcache_surface s = floor_end(x, y);
    vcache_prepare_eye(c, &s, 8.0f, 0, (vcache_eye *)(void *)p->eye);
    vcache_prepare_eye_vertex(c, &s, 8.0f, 1.0f, 0, &p->eye_vertex);
}

static inline void make_ends(const vcache *c, pair_ends *p)
{
    for (uint32_t i = 0; i < PAIR_LIGHTS; i++) {
        vcache_surface s = ceiling_end(i);
        vcache_prepare_patch(c, &s, &p->light[i]);
        vcache_prepare_light_vertex(c, &s, &p->light_vertex[i]);
    }
    move_eye(c, p, 0.3, 0.3);
}

static inline vcache_estimate estimate_of(vcache_worker *w, pair_ends *p, bool vertices, uint32_t light,
                                          float contribution)
{
    return vertices ? vcache_estimate_vertices(w, &p->eye_vertex, &p->light_vertex[light], contribution)
                    : vcache_estimate_pair(w, eye_of(p), &p->light[light], contribution);
}

static inline vcache *make_table(uint64_t words)
{
    vcache_config config = vcache_default_config();
    config.levels = 1;
    config.table_bytes = 4 * words;
    return make_cache(&config);
}

#endif
