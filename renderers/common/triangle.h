/* SPDX-License-Identifier: Apache-2.0 */
/* One triangle of a scene in world space. */
#ifndef COMMON_TRIANGLE_H
#define COMMON_TRIANGLE_H

#include "scene.h"

static inline void triangle_corners(const scene *s, uint32_t instance_index, uint32_t primitive, vec3 p[3])
{
    const instance *in = &s->instances[instance_index];
    const mesh *m = &s->meshes[in->mesh];
    for (int k = 0; k < 3; k++) {
        const float *v = m->positions + 3 * (size_t)m->indices[3 * (size_t)primitive + (size_t)k];
        p[k] = transform_point(in->to_world, v3(v[0], v[1], v[2]));
    }
}

/* Unit normal by the order of the corners, 0 for an empty triangle. In double: squared areas of tiny triangles leave
 * float's range, and differences of floats are exact. */
static inline vec3 triangle_normal(const vec3 p[3], float *area)
{
    double ax = (double)p[1].x - p[0].x, ay = (double)p[1].y - p[0].y, az = (double)p[1].z - p[0].z;
    double bx = (double)p[2].x - p[0].x, by = (double)p[2].y - p[0].y, bz = (double)p[2].z - p[0].z;
    double nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
    double length = sqrt(nx * nx + ny * ny + nz * nz), inv = length > 0.0 ? 1.0 / length : 0.0;
    *area = (float)(0.5 * length);
    return v3((float)(nx * inv), (float)(ny * inv), (float)(nz * inv));
}

/* A mirroring transform turns the order of the corners around; the outside of the mesh stays the outside. */
static inline bool transform_mirrors(const float m[12])
{
    double d = m[0] * ((double)m[5] * m[10] - (double)m[6] * m[9]) -
               m[1] * ((double)m[4] * m[10] - (double)m[6] * m[8]) + m[2] * ((double)m[4] * m[9] - (double)m[5] * m[8]);
    return d < 0.0;
}

#endif
