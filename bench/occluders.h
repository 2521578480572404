/* SPDX-License-Identifier: Apache-2.0 */
/* Shadow rays that tell which triangle blocked them, and the memory of such triangles (Haines and Greenberg, "The Light
 * Buffer", 1986: what blocked a light last probably blocks it again). */
#ifndef BENCH_OCCLUDERS_H
#define BENCH_OCCLUDERS_H

#include "record.h"

/* An Embree scene of its own: all opaque triangles in world space as one mesh. */
typedef struct occluders occluders;
/* `reporting`: blockers are taken down by a filter function, which costs some speed. */
bool occluders_new(const scene *s, bool reporting, occluders **out, message *err);
void occluders_free(occluders *o);

/* As tracer_occluded and tracer_occluded16; blockers of blocked lanes go to occluders_blocker. */
bool occluders_ray(occluders *o, vec3 origin, vec3 direction, float tfar);
uint32_t occluders_packet(occluders *o, ray_packet *p, uint32_t active);
uint32_t occluders_blocker(const occluders *o, uint32_t lane);

/* Corner and edges, ready for the test. */
typedef struct remembered {
    vec3 corner, edge[2];
    uint32_t full; /* 0: nothing remembered */
} remembered;
void occluders_remember(const occluders *o, uint32_t triangle, remembered *out);

/* Moeller and Trumbore 1997, both sides, 0 < t < tfar. */
static inline bool remembered_blocks(const remembered *m, vec3 origin, vec3 direction, float tfar)
{
    if (!m->full)
        return false;
    vec3 p = v3_cross(direction, m->edge[1]), s = v3_sub(origin, m->corner);
    float determinant = v3_dot(m->edge[0], p), inverse = 1.0f / determinant;
    vec3 q = v3_cross(s, m->edge[0]);
    float u = v3_dot(s, p) * inverse, v = v3_dot(direction, q) * inverse, t = v3_dot(m->edge[1], q) * inverse;
    return (u >= 0.0f) & (v >= 0.0f) & (u + v <= 1.0f) & (t > 0.0f) & (t < tfar); /* NaN: false */
}

#endif
