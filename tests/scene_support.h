/* SPDX-License-Identifier: Apache-2.0 */
/* Small scenes made by hand, for tests. */
#ifndef TESTS_SCENE_SUPPORT_H
#define TESTS_SCENE_SUPPORT_H

#include "rng.h"
#include "scene.h"

#include <stdlib.h>
#include <string.h>

static inline vec3 random_vec3(rng *r, float radius)
{
    float x = rng_float(r), y = rng_float(r), z = rng_float(r);
    return v3(radius * (2.0f * x - 1.0f), radius * (2.0f * y - 1.0f), radius * (2.0f * z - 1.0f));
}

static inline vec3 random_direction(rng *r)
{
    float z = 2.0f * rng_float(r) - 1.0f, phi = 2.0f * PI_F * rng_float(r), s = sqrtf(fmaxf(0.0f, 1.0f - z * z));
    return v3(s * cosf(phi), s * sinf(phi), z);
}

static inline material plain_material(material_kind kind, rgb color)
{
    return (material){.kind = kind, .color = color, .roughness = 0.5f, .ior = 1.5f, .texture = -1};
}

/* `count` triangles with three corners each. */
static inline mesh corners_mesh(const vec3 *corners, uint32_t count, uint32_t material_index)
{
    mesh m = {.vertex_count = 3 * count, .triangle_count = count, .material = material_index};
    m.positions = xmalloc(9 * (size_t)count * sizeof(float));
    m.indices = xmalloc(3 * (size_t)count * sizeof(uint32_t));
    memcpy(m.positions, corners, 9 * (size_t)count * sizeof(float));
    for (uint32_t i = 0; i < 3 * count; i++)
        m.indices[i] = i;
    return m;
}

/* Random triangles about `size` large with centres in a cube of half edge `radius` around `center`. */
static inline mesh soup_mesh(rng *r, uint32_t count, float size, float radius, vec3 center, uint32_t material_index)
{
    vec3 *corners = xmalloc(3 * (size_t)count * sizeof *corners);
    for (uint32_t i = 0; i < count; i++) {
        vec3 c = v3_add(center, random_vec3(r, radius));
        for (uint32_t k = 0; k < 3; k++)
            corners[3 * i + k] = v3_add(c, random_vec3(r, size));
    }
    mesh m = corners_mesh(corners, count, material_index);
    free(corners);
    return m;
}

static inline uint32_t place_mesh(scene *s, uint32_t mesh_index, const float to_world[12])
{
    instance in = {.mesh = mesh_index};
    memcpy(in.to_world, to_world, sizeof in.to_world);
    return scene_add_instance(s, in);
}

/* Instances of one large mesh, so many that the tracer instances every mesh that stands more than once. */
static inline void add_ballast(scene *s, rng *r, float size, vec3 center, uint32_t material_index)
{
    uint32_t m = scene_add_mesh(s, soup_mesh(r, 40000, size, size, center, material_index));
    for (int i = 0; i < 101; i++)
        place_mesh(s, m, transform_identity);
}

#endif
