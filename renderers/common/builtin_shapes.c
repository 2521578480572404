/* SPDX-License-Identifier: Apache-2.0 */
/* Shapes of the generated scenes: boxes, lathed and swept solids, and their smooth normals. */
#include "builtin.h"

#include <assert.h>
#include <stdlib.h>
#include <string.h>

#define DEGREE (PI_F / 180.0f)

uint32_t shape_vertex(shape *s, vec3 p)
{
    if (s->vertex_count == s->vertex_capacity) {
        s->vertex_capacity = s->vertex_capacity ? 2 * s->vertex_capacity : 64;
        s->positions = xrealloc(s->positions, (size_t)s->vertex_capacity * 3 * sizeof(float));
    }
    float *to = s->positions + 3 * (size_t)s->vertex_count;
    to[0] = p.x, to[1] = p.y, to[2] = p.z;
    return s->vertex_count++;
}

void shape_triangle(shape *s, uint32_t a, uint32_t b, uint32_t c)
{
    if (s->triangle_count == s->triangle_capacity) {
        s->triangle_capacity = s->triangle_capacity ? 2 * s->triangle_capacity : 64;
        s->indices = xrealloc(s->indices, (size_t)s->triangle_capacity * 3 * sizeof(uint32_t));
    }
    uint32_t *to = s->indices + 3 * (size_t)s->triangle_count++;
    to[0] = a, to[1] = b, to[2] = c;
}

void shape_quad(shape *s, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    shape_triangle(s, a, b, c);
    shape_triangle(s, a, c, d);
}

void shape_free(shape *s)
{
    free(s->positions);
    free(s->indices);
    *s = (shape){0};
}

static vec3 vertex_at(const shape *s, uint32_t i)
{
    const float *p = s->positions + 3 * (size_t)i;
    return v3(p[0], p[1], p[2]);
}

/* Corner k has the high end of axis a where bit a is set. With a bevel each corner is three vertices, one on each face.
 */
void shape_box(shape *s, vec3 lo, vec3 hi, float bevel)
{
    const float ends[2][3] = {{lo.x, lo.y, lo.z}, {hi.x, hi.y, hi.z}};
    const uint32_t base = s->vertex_count, per_corner = bevel > 0.0f ? 3 : 1;
    for (uint32_t k = 0; k < 8; ++k)
        for (uint32_t face = 0; face < per_corner; ++face) {
            float p[3];
            for (uint32_t a = 0; a < 3; ++a) {
                uint32_t side = k >> a & 1u;
                p[a] = ends[side][a] + (a == face ? 0.0f : side ? -bevel : bevel);
            }
            shape_vertex(s, v3(p[0], p[1], p[2]));
        }
    for (uint32_t a = 0; a < 3; ++a) {
        uint32_t b = (a + 1) % 3, c = (a + 2) % 3, on_face = bevel > 0.0f ? a : 0;
        for (uint32_t side = 0; side < 2; ++side) {
            uint32_t v[4];
            for (uint32_t i = 0; i < 4; ++i)
                v[i] = base + per_corner * (side << a | (uint32_t)(i == 1 || i == 2) << b | (i >> 1) << c) + on_face;
            shape_quad(s, v[0], v[side ? 1 : 3], v[2], v[side ? 3 : 1]);
        }
        if (bevel <= 0.0f)
            continue;
        for (uint32_t i = 0; i < 4; ++i) {
            uint32_t k0 = base + 3 * ((i & 1u) << b | (i >> 1) << c), k1 = k0 + 3 * (1u << a);
            if ((i & 1u) == i >> 1)
                shape_quad(s, k0 + c, k1 + c, k1 + b, k0 + b);
            else
                shape_quad(s, k0 + b, k1 + b, k1 + c, k0 + c);
        }
    }
    for (uint32_t k = 0; k < 8 && bevel > 0.0f; ++k) {
        uint32_t v = base + 3 * k, odd = (k ^ k >> 1 ^ k >> 2) & 1u;
        shape_triangle(s, v, v + (odd ? 1 : 2), v + (odd ? 2 : 1));
    }
}

void profile_to(profile *p, float r, float y)
{
    if (p->count && fabsf(p->r[p->count - 1] - r) + fabsf(p->y[p->count - 1] - y) < 1e-5f)
        return;
    assert(p->count < PROFILE_MAX);
    p->r[p->count] = r;
    p->y[p->count++] = y;
}

void profile_arc(profile *p, float r, float y, float radius, float from, float to, uint32_t steps)
{
    for (uint32_t i = 0; i <= steps; ++i) {
        float angle = (from + (to - from) * (float)i / (float)steps) * DEGREE;
        profile_to(p, r + radius * cosf(angle), y + radius * sinf(angle));
    }
}

/* Joins rings of `segments` vertices; `first` and `next` are their first vertices. */
static void join_rings(shape *s, uint32_t first, uint32_t next, uint32_t segments)
{
    for (uint32_t j = 0; j < segments; ++j) {
        uint32_t k = (j + 1) % segments;
        shape_quad(s, first + j, first + k, next + k, next + j);
    }
}

static void close_ring(shape *s, uint32_t ring, uint32_t pole, uint32_t segments, bool at_start)
{
    for (uint32_t j = 0; j < segments; ++j) {
        uint32_t k = (j + 1) % segments;
        shape_triangle(s, pole, ring + (at_start ? k : j), ring + (at_start ? j : k));
    }
}

static uint32_t lathe_ring(shape *s, float r, float y, uint32_t segments)
{
    uint32_t ring = s->vertex_count;
    for (uint32_t j = 0; j < segments; ++j) {
        float angle = 2.0f * PI_F * (float)j / (float)segments;
        shape_vertex(s, v3(r * cosf(angle), y, -r * sinf(angle)));
    }
    return ring;
}

void shape_lathe(shape *s, const profile *p, uint32_t segments)
{
    uint32_t bottom = shape_vertex(s, v3(0.0f, p->y[0], 0.0f)), previous = bottom, last = p->count - 1;
    for (uint32_t i = 1; i < last; ++i) {
        uint32_t ring = lathe_ring(s, p->r[i], p->y[i], segments);
        if (i == 1)
            close_ring(s, ring, bottom, segments, true);
        else
            join_rings(s, previous, ring, segments);
        previous = ring;
    }
    close_ring(s, previous, shape_vertex(s, v3(0.0f, p->y[last], 0.0f)), segments, false);
}

void shape_sphere(shape *s, vec3 center, float radius, uint32_t segments)
{
    profile p = {0};
    shape ball = {0};
    uint32_t rows = segments / 2;
    profile_to(&p, 0.0f, -radius);
    profile_arc(&p, 0.0f, 0.0f, radius, -90.0f + 180.0f / (float)rows, 90.0f - 180.0f / (float)rows, rows - 2);
    profile_to(&p, 0.0f, radius);
    shape_lathe(&ball, &p, segments);
    shape_append(s, &ball, xform_place(center, 0.0f, 1.0f));
    shape_free(&ball);
}

void shape_torus(shape *s, float radius, float tube_radius, uint32_t segments, uint32_t tube_segments)
{
    uint32_t first = 0, previous = 0;
    for (uint32_t i = 0; i < tube_segments; ++i) {
        float angle = 2.0f * PI_F * (float)i / (float)tube_segments;
        uint32_t ring = lathe_ring(s, radius + tube_radius * cosf(angle), tube_radius * sinf(angle), segments);
        if (i)
            join_rings(s, previous, ring, segments);
        else
            first = ring;
        previous = ring;
    }
    join_rings(s, previous, first, segments);
}

void shape_tube(shape *s, const vec3 *path, const float *radii, uint32_t count, uint32_t segments)
{
    vec3 along = v3_normalize(v3_sub(path[1], path[0])), t, b;
    uint32_t previous = 0;
    v3_basis(along, &t, &b);
    for (uint32_t i = 0; i < count; ++i) {
        vec3 before = path[i ? i - 1 : 0], after = path[i + 1 < count ? i + 1 : i];
        along = v3_normalize(v3_sub(after, before));
        /* carry the frame along so that the pipe does not twist */
        t = v3_normalize(v3_mad(t, -v3_dot(t, along), along));
        b = v3_cross(along, t);
        uint32_t ring = s->vertex_count;
        for (uint32_t j = 0; j < segments; ++j) {
            float angle = 2.0f * PI_F * (float)j / (float)segments;
            vec3 side = v3_mad(v3_scale(t, cosf(angle)), sinf(angle), b);
            shape_vertex(s, v3_mad(path[i], radii[i], side));
        }
        if (i)
            join_rings(s, previous, ring, segments);
        else
            close_ring(s, ring, shape_vertex(s, path[0]), segments, true);
        previous = ring;
    }
    close_ring(s, previous, shape_vertex(s, path[count - 1]), segments, false);
}

/* Appends inner and outer point at one angle, in front and behind, and joins them to the four before. */
static void arch_section(shape *s, vec3 inner, vec3 outer, float depth, bool first)
{
    uint32_t v = s->vertex_count;
    for (int i = 0; i < 4; ++i) {
        vec3 p = i == 0 || i == 3 ? inner : outer;
        shape_vertex(s, v3(p.x, p.y, i < 2 ? depth : -depth));
    }
    if (first)
        shape_quad(s, v, v + 3, v + 2, v + 1);
    for (uint32_t i = 0; i < 4 && !first; ++i)
        shape_quad(s, v - 4 + i, v - 4 + (i + 1) % 4, v + (i + 1) % 4, v + i);
}

static void arch_end(shape *s)
{
    uint32_t v = s->vertex_count - 4;
    shape_quad(s, v, v + 1, v + 2, v + 3);
}

void shape_arch(shape *s, float inner, float half_width, float height, float depth, uint32_t segments)
{
    const float corner = atan2f(height, half_width), step = PI_F / (float)segments;
    const uint32_t at_corner = (uint32_t)(corner / step + 0.5f);
    for (uint32_t i = 0; i <= segments; ++i) {
        /* the outline's corners take the place of the nearest angles */
        float angle = i == at_corner ? corner : i == segments - at_corner ? PI_F - corner : step * (float)i;
        float c = i == 0 ? 1.0f : i == segments ? -1.0f : cosf(angle), n = i == 0 || i == segments ? 0.0f : sinf(angle);
        float reach = fabsf(c) * height > n * half_width ? half_width / fabsf(c) : height / n;
        vec3 outer = v3(c * reach, n * reach, 0.0f);
        if (i <= at_corner)
            outer.x = half_width;
        if (i >= segments - at_corner)
            outer.x = -half_width;
        if (i >= at_corner && i <= segments - at_corner)
            outer.y = height;
        arch_section(s, v3(c * inner, n * inner, 0.0f), outer, depth, i == 0);
    }
    arch_end(s);
}

void shape_half_ring(shape *s, float inner, float outer, float depth, uint32_t segments)
{
    for (uint32_t i = 0; i <= segments; ++i) {
        float angle = PI_F * (float)i / (float)segments;
        vec3 d = v3(cosf(angle), i == segments ? 0.0f : sinf(angle), 0.0f);
        arch_section(s, v3_scale(d, inner), v3_scale(d, outer), depth, i == 0);
    }
    arch_end(s);
}

xform xform_frame(vec3 o, vec3 x, vec3 y, vec3 z)
{
    return (xform){{x.x, y.x, z.x, o.x, x.y, y.y, z.y, o.y, x.z, y.z, z.z, o.z}};
}

xform xform_place(vec3 origin, float yaw, float scale)
{
    float c = scale * cosf(yaw), n = scale * sinf(yaw);
    return xform_frame(origin, v3(c, 0.0f, -n), v3(0.0f, scale, 0.0f), v3(n, 0.0f, c));
}

xform xform_mul(xform a, xform b)
{
    xform r;
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 4; ++j) {
            float sum = j == 3 ? a.m[4 * i + 3] : 0.0f;
            for (int k = 0; k < 3; ++k)
                sum += a.m[4 * i + k] * b.m[4 * k + j];
            r.m[4 * i + j] = sum;
        }
    return r;
}

xform xform_along(vec3 origin, vec3 up, float yaw, float scale)
{
    vec3 t, b;
    v3_basis(up, &t, &b);
    vec3 x = v3_mad(v3_scale(t, cosf(yaw)), sinf(yaw), b);
    return xform_frame(origin, v3_scale(x, scale), v3_scale(up, scale), v3_scale(v3_cross(x, up), scale));
}

void shape_append(shape *s, const shape *part, xform at)
{
    uint32_t base = s->vertex_count;
    for (uint32_t i = 0; i < part->vertex_count; ++i)
        shape_vertex(s, transform_point(at.m, vertex_at(part, i)));
    for (uint32_t i = 0; i < part->triangle_count; ++i) {
        const uint32_t *t = part->indices + 3 * (size_t)i;
        shape_triangle(s, base + t[0], base + t[1], base + t[2]);
    }
}

/* Unit face normals, and for each corner the angle the triangle has there. */
static void measure_faces(const shape *s, vec3 *face, float *angle)
{
    for (uint32_t t = 0; t < s->triangle_count; ++t) {
        vec3 p[3];
        for (uint32_t k = 0; k < 3; ++k)
            p[k] = vertex_at(s, s->indices[3 * t + k]);
        face[t] = v3_normalize(v3_cross(v3_sub(p[1], p[0]), v3_sub(p[2], p[0])));
        for (uint32_t k = 0; k < 3; ++k) {
            vec3 a = v3_normalize(v3_sub(p[(k + 1) % 3], p[k])), b = v3_normalize(v3_sub(p[(k + 2) % 3], p[k]));
            angle[3 * t + k] = acosf(fmaxf(-1.0f, fminf(1.0f, v3_dot(a, b))));
        }
    }
}

/* Splits vertices along creases: each corner's normal is the angle-weighted mean of the faces around its vertex that
 * lie within the crease angle of its own face. */
static void smooth_normals(mesh *m, shape *s, float crease)
{
    const uint32_t corners = 3 * s->triangle_count, old_count = s->vertex_count;
    const float limit = cosf(crease * DEGREE);
    vec3 *face = xmalloc(s->triangle_count * sizeof *face), *normals = xmalloc(corners * sizeof *normals);
    float *angle = xmalloc(corners * sizeof *angle);
    uint32_t *start = xcalloc((size_t)old_count + 2, sizeof *start), *around = xmalloc(corners * sizeof *around);
    uint32_t *split = xmalloc(corners * sizeof *split);
    shape out = {0};
    measure_faces(s, face, angle);
    for (uint32_t c = 0; c < corners; ++c)
        ++start[s->indices[c] + 2];
    for (uint32_t v = 1; v < old_count + 1; ++v)
        start[v + 1] += start[v];
    for (uint32_t c = 0; c < corners; ++c)
        around[start[s->indices[c] + 1]++] = c;
    for (uint32_t v = 0; v < old_count; ++v) {
        uint32_t first_out = out.vertex_count;
        for (uint32_t i = start[v]; i < start[v + 1]; ++i) {
            vec3 own = face[around[i] / 3], n = v3_scale(own, 1e-6f);
            for (uint32_t j = start[v]; j < start[v + 1]; ++j)
                if (v3_dot(own, face[around[j] / 3]) >= limit)
                    n = v3_mad(n, angle[around[j]], face[around[j] / 3]);
            n = v3_normalize(n);
            uint32_t w = first_out;
            while (w < out.vertex_count && v3_dot(normals[w], n) < 0.9999f)
                ++w;
            if (w == out.vertex_count) {
                shape_vertex(&out, vertex_at(s, v));
                normals[w] = n;
            }
            split[around[i]] = w;
        }
    }
    m->vertex_count = out.vertex_count;
    m->positions = out.positions;
    m->normals = xmalloc((size_t)out.vertex_count * 3 * sizeof(float));
    for (uint32_t v = 0; v < out.vertex_count; ++v)
        memcpy(m->normals + 3 * (size_t)v, &normals[v], 3 * sizeof(float));
    memcpy(m->indices, split, corners * sizeof *split);
    free(s->positions);
    free(face), free(normals), free(angle), free(start), free(around), free(split);
}

uint32_t shape_to_mesh(scene *s, shape *from, uint32_t surface, float crease)
{
    mesh m = {.vertex_count = from->vertex_count,
              .triangle_count = from->triangle_count,
              .positions = from->positions,
              .indices = from->indices,
              .material = surface};
    if (crease > 0.0f)
        smooth_normals(&m, from, crease);
    *from = (shape){0};
    return scene_add_mesh(s, m);
}
