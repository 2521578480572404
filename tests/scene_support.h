/* SPDX-License-Identifier: Apache-2.0 */
/* Small scenes made by hand, for tests. */
#ifndef TESTS_SCENE_SUPPORT_H
#define TESTS_SCENE_SUPPORT_H

#include "material.h"
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

/* Directional albedo of a surface, by quadrature. */
static inline double directional_albedo(const surface *s)
{
    enum { ROWS = 400, COLUMNS = 400 };
    double sum = 0.0;
    vec3 x, y;
    v3_basis(s->normal, &x, &y);
    for (int i = 0; i < ROWS; i++)
        for (int j = 0; j < COLUMNS; j++) {
            float cosine = sqrtf(((float)i + 0.5f) / ROWS), sine = sqrtf(1.0f - cosine * cosine);
            float phi = 2.0f * PI_F * ((float)j + 0.5f) / COLUMNS;
            vec3 wi = v3_add(v3_scale(x, sine * cosf(phi)), v3_scale(y, sine * sinf(phi)));
            sum += (double)material_eval(s, v3_mad(wi, cosine, s->normal)).y;
        }
    return sum * 3.14159265358979 / ((double)ROWS * COLUMNS);
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

static inline uint32_t add_material(scene *s, material_kind kind, float color)
{
    return scene_add_material(s, plain_material(kind, v3(color, color, color)));
}

static inline void add_triangles(scene *s, const vec3 *corners, uint32_t count, uint32_t material_index)
{
    place_mesh(s, scene_add_mesh(s, corners_mesh(corners, count, material_index)), transform_identity);
}

/* A parallelogram; its own side is that of ab x ac. */
static inline void add_quad(scene *s, vec3 a, vec3 ab, vec3 ac, uint32_t material_index)
{
    vec3 b = v3_add(a, ab), c = v3_add(a, ac), d = v3_add(b, ac), corners[6] = {a, b, d, a, d, c};
    add_triangles(s, corners, 2, material_index);
}

/* Axis-aligned box, sides bit by bit of `sides` (-x, +x, -y, +y, -z, +z); the own sides look outwards. */
static inline void add_box(scene *s, vec3 low, vec3 high, unsigned sides, uint32_t material_index)
{
    vec3 e = v3_sub(high, low), x = v3(e.x, 0, 0), y = v3(0, e.y, 0), z = v3(0, 0, e.z);
    const vec3 quads[6][3] = {{low, z, y}, {v3_add(low, x), y, z}, {low, x, z}, {v3_add(low, y), z, x},
                              {low, y, x}, {v3_add(low, z), x, y}};
    for (int i = 0; i < 6; i++)
        if (sides >> i & 1u)
            add_quad(s, quads[i][0], quads[i][1], quads[i][2], material_index);
}

static inline vec3 sphere_point(int row, int column, int rows)
{
    float theta = PI_F * (float)row / (float)rows, phi = PI_F * (float)(column % (2 * rows)) / (float)rows;
    return v3(sinf(theta) * cosf(phi), row == 0 ? 1.0f : row == rows ? -1.0f : cosf(theta), sinf(theta) * sinf(phi));
}

/* Unit sphere around the origin of `rows` x 2 `rows` facets; own sides look outwards. Smooth: with shading normals. */
static inline void add_sphere(scene *s, int rows, bool smooth, uint32_t material_index)
{
    vec3 *corners = xmalloc(12 * (size_t)rows * (size_t)rows * sizeof *corners);
    uint32_t n = 0;
    for (int i = 0; i < rows; i++)
        for (int j = 0; j < 2 * rows; j++) {
            vec3 a = sphere_point(i, j, rows), b = sphere_point(i, j + 1, rows), c = sphere_point(i + 1, j + 1, rows),
                 d = sphere_point(i + 1, j, rows);
            const vec3 both[6] = {a, b, c, a, c, d};
            int first = i == 0 ? 1 : 0, last = i == rows - 1 ? 1 : 2; /* one triangle a facet at the poles */
            memcpy(corners + n, both + 3 * first, (size_t)(3 * (last - first)) * sizeof *corners);
            n += (uint32_t)(3 * (last - first));
        }
    mesh m = corners_mesh(corners, n / 3, material_index);
    if (smooth) {
        m.normals = xmalloc(3 * (size_t)n * sizeof(float));
        memcpy(m.normals, m.positions, 3 * (size_t)n * sizeof(float));
    }
    place_mesh(s, scene_add_mesh(s, m), transform_identity);
    free(corners);
}

static inline void add_point_light(scene *s, vec3 position, float intensity)
{
    scene_add_light(
        s, (light){.kind = LIGHT_POINT, .position = position, .intensity = v3(intensity, intensity, intensity)});
}

/* Moves all of a scene by a rotation and an offset. */
static inline void move_scene(scene *s, camera *c, const float m[12])
{
    for (uint32_t i = 0; i < s->instance_count; i++) {
        float *to = s->instances[i].to_world, old[12];
        memcpy(old, to, sizeof old);
        for (int r = 0; r < 3; r++)
            for (int k = 0; k < 4; k++)
                to[4 * r + k] = m[4 * r] * old[k] + m[4 * r + 1] * old[4 + k] + m[4 * r + 2] * old[8 + k] +
                                (k == 3 ? m[4 * r + 3] : 0.0f);
    }
    for (uint32_t i = 0; i < s->light_count; i++) {
        s->lights[i].position = transform_point(m, s->lights[i].position);
        s->lights[i].direction = v3_normalize(transform_vector(m, s->lights[i].direction));
    }
    *c = camera_look(transform_point(m, c->eye), transform_point(m, v3_add(c->eye, c->forward)),
                     transform_vector(m, c->up), c->yfov);
}

/* Around (1, 2, 3), then to `offset`. */
static inline void motion(float angle, vec3 offset, float m[12])
{
    vec3 a = v3_normalize(v3(1, 2, 3));
    float c = cosf(angle), s = sinf(angle), t = 1.0f - c;
    const float rows[12] = {t * a.x * a.x + c,       t * a.x * a.y - s * a.z, t * a.x * a.z + s * a.y, offset.x,
                            t * a.x * a.y + s * a.z, t * a.y * a.y + c,       t * a.y * a.z - s * a.x, offset.y,
                            t * a.x * a.z - s * a.y, t * a.y * a.z + s * a.x, t * a.z * a.z + c,       offset.z};
    memcpy(m, rows, sizeof rows);
}

#endif
