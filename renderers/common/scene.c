/* SPDX-License-Identifier: Apache-2.0 */
/* The scene container: building it, transforms, and the check that every scene passes before it is rendered. */
#include "scene.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Edges of twice this length still have a finite squared cross product in float. */
#define MAX_COORDINATE 1e9
/* |e1 x e2| of the smallest triangle whose normal can be normalised in float. */
#define MIN_CROSS 1e-18
/* Triangles narrower than this times their longest edge have no normal at float precision. */
#define MIN_HEIGHT 1e-7
/* |det| over the product of the column lengths below which a transform flattens what it places. */
#define MIN_DETERMINANT 1e-6

const float transform_identity[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};

static void *checked(void *p)
{
    if (!p) {
        fputs("error: out of memory\n", stderr);
        exit(1);
    }
    return p;
}

void *xmalloc(size_t bytes)
{
    return checked(malloc(bytes ? bytes : 1));
}

void *xcalloc(size_t count, size_t bytes)
{
    return checked(count && bytes ? calloc(count, bytes) : calloc(1, 1));
}

void *xrealloc(void *p, size_t bytes)
{
    return checked(realloc(p, bytes ? bytes : 1));
}

/* --- Building --- */

scene *scene_new(const char *name)
{
    scene *s = xcalloc(1, sizeof *s);
    snprintf(s->name, sizeof s->name, "%s", name);
    replace_control_characters(s->name);
    return s;
}

void scene_free(scene *s)
{
    if (!s)
        return;
    for (uint32_t i = 0; i < s->mesh_count; i++) {
        free(s->meshes[i].positions);
        free(s->meshes[i].normals);
        free(s->meshes[i].uvs);
        free(s->meshes[i].indices);
    }
    for (uint32_t i = 0; i < s->texture_count; i++)
        free(s->textures[i].rgba);
    free(s->meshes);
    free(s->instances);
    free(s->materials);
    free(s->textures);
    free(s->lights);
    free(s->cameras);
    environment_free(s->environment);
    free(s->path);
    free(s);
}

/* Room for one more element; capacities are powers of two, so they need not be stored. */
static void *grow(void *array, uint32_t count, size_t size)
{
    if (count & (count - 1))
        return array;
    return xrealloc(array, (count ? 2 * (size_t)count : 1) * size);
}

uint32_t scene_add_mesh(scene *s, mesh m)
{
    s->meshes = grow(s->meshes, s->mesh_count, sizeof m);
    s->meshes[s->mesh_count] = m;
    return s->mesh_count++;
}

uint32_t scene_add_instance(scene *s, instance i)
{
    s->instances = grow(s->instances, s->instance_count, sizeof i);
    s->instances[s->instance_count] = i;
    return s->instance_count++;
}

uint32_t scene_add_material(scene *s, material m)
{
    s->materials = grow(s->materials, s->material_count, sizeof m);
    s->materials[s->material_count] = m;
    return s->material_count++;
}

uint32_t scene_add_texture(scene *s, texture t)
{
    s->textures = grow(s->textures, s->texture_count, sizeof t);
    s->textures[s->texture_count] = t;
    return s->texture_count++;
}

uint32_t scene_add_light(scene *s, light l)
{
    s->lights = grow(s->lights, s->light_count, sizeof l);
    s->lights[s->light_count] = l;
    return s->light_count++;
}

uint32_t scene_add_camera(scene *s, camera c)
{
    s->cameras = grow(s->cameras, s->camera_count, sizeof c);
    s->cameras[s->camera_count] = c;
    return s->camera_count++;
}

/* --- Transforms --- */

vec3 transform_point(const float m[12], vec3 p)
{
    return v3(m[0] * p.x + m[1] * p.y + m[2] * p.z + m[3], m[4] * p.x + m[5] * p.y + m[6] * p.z + m[7],
              m[8] * p.x + m[9] * p.y + m[10] * p.z + m[11]);
}

vec3 transform_vector(const float m[12], vec3 v)
{
    return v3(m[0] * v.x + m[1] * v.y + m[2] * v.z, m[4] * v.x + m[5] * v.y + m[6] * v.z,
              m[8] * v.x + m[9] * v.y + m[10] * v.z);
}

static double determinant(const float m[12])
{
    return m[0] * ((double)m[5] * m[10] - (double)m[6] * m[9]) - m[1] * ((double)m[4] * m[10] - (double)m[6] * m[8]) +
           m[2] * ((double)m[4] * m[9] - (double)m[5] * m[8]);
}

vec3 transform_normal(const float m[12], vec3 n)
{
    /* Rows of the cofactor matrix are cross products of the rows of m. In double: scales cubed leave float's range. */
    double c[9], inv = 1.0 / determinant(m);
    for (int r = 0; r < 3; r++) {
        const float *a = m + 4 * ((r + 1) % 3), *b = m + 4 * ((r + 2) % 3);
        c[3 * r] = (double)a[1] * b[2] - (double)a[2] * b[1];
        c[3 * r + 1] = (double)a[2] * b[0] - (double)a[0] * b[2];
        c[3 * r + 2] = (double)a[0] * b[1] - (double)a[1] * b[0];
    }
    return v3((float)(inv * (c[0] * n.x + c[1] * n.y + c[2] * n.z)),
              (float)(inv * (c[3] * n.x + c[4] * n.y + c[5] * n.z)),
              (float)(inv * (c[6] * n.x + c[7] * n.y + c[8] * n.z)));
}

camera camera_look(vec3 eye, vec3 at, vec3 up, float yfov)
{
    camera c = {.eye = eye, .yfov = yfov};
    vec3 right, spare;
    c.forward = v3_normalize(v3_sub(at, eye));
    if (v3_length(c.forward) == 0.0f)
        c.forward = v3(0, 0, -1);
    right = v3_cross(c.forward, v3_normalize(up));
    if (v3_length(right) < 1e-4f)
        v3_basis(c.forward, &right, &spare); /* looking along up */
    c.up = v3_normalize(v3_cross(v3_normalize(right), c.forward));
    return c;
}

/* --- Checks --- */

/* What messages call the scene. */
static const char *label(const scene *s)
{
    return s->path ? s->path : s->name;
}

static bool finite3(vec3 v)
{
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

static bool near_enough(vec3 v)
{
    return fabsf(v.x) <= SCENE_MAX_DISTANCE && fabsf(v.y) <= SCENE_MAX_DISTANCE && fabsf(v.z) <= SCENE_MAX_DISTANCE;
}

static bool colour_ok(rgb c)
{
    return finite3(c) && c.x >= 0.0f && c.y >= 0.0f && c.z >= 0.0f;
}

static bool unit(vec3 v)
{
    return fabsf(v3_length(v) - 1.0f) < 1e-3f;
}

static bool check_materials(const scene *s, message *err)
{
    for (uint32_t i = 0; i < s->material_count; i++) {
        const material *m = &s->materials[i];
        if (m->texture < -1 || (m->texture >= 0 && (uint32_t)m->texture >= s->texture_count))
            return fail(err, "%s: material %u: texture index %d out of range", label(s), i, m->texture);
        if (!colour_ok(m->color) || !colour_ok(m->emission))
            return fail(err, "%s: material %u: a colour is negative or not finite", label(s), i);
        if (!(m->roughness >= 0.0f && m->roughness <= 1.0f) || !(m->ior >= 1.0f && isfinite(m->ior)))
            return fail(err, "%s: material %u: roughness or index of refraction out of range", label(s), i);
    }
    return true;
}

static bool check_lights_and_cameras(const scene *s, message *err)
{
    for (uint32_t i = 0; i < s->light_count; i++) {
        const light *l = &s->lights[i];
        bool placed = l->kind == LIGHT_DIRECTIONAL || finite3(l->position);
        bool aimed = l->kind == LIGHT_POINT || unit(l->direction);
        if (!colour_ok(l->intensity) || !placed || !aimed)
            return fail(err, "%s: light %u: bad intensity, position or direction", label(s), i);
        if (l->kind != LIGHT_DIRECTIONAL && !near_enough(l->position))
            return fail(err, "%s: light %u: lies beyond %g units", label(s), i, (double)SCENE_MAX_DISTANCE);
        if (l->kind == LIGHT_SPOT && !(l->cos_outer >= -1.0f && l->cos_outer <= l->cos_inner && l->cos_inner <= 1.0f))
            return fail(err, "%s: light %u: bad cone angles", label(s), i);
        if (l->power > LIGHT_POWER_MAX)
            return fail(err, "%s: light %u: fall-off to the power of %u", label(s), i, l->power);
    }
    for (uint32_t i = 0; i < s->camera_count; i++) {
        const camera *c = &s->cameras[i];
        if (!finite3(c->eye) || !unit(c->forward) || !unit(c->up) || !(c->yfov > 0.0f && c->yfov < PI_F))
            return fail(err, "%s: camera %u: bad position, direction or field of view", label(s), i);
        if (!near_enough(c->eye))
            return fail(err, "%s: camera %u: lies beyond %g units", label(s), i, (double)SCENE_MAX_DISTANCE);
    }
    return true;
}

static bool check_mesh(const scene *s, uint32_t index, message *err)
{
    const mesh *m = &s->meshes[index];
    if (m->material >= s->material_count)
        return fail(err, "%s: mesh %u: material index %u out of range", label(s), index, m->material);
    for (size_t i = 0; i < 3 * (size_t)m->triangle_count; i++)
        if (m->indices[i] >= m->vertex_count)
            return fail(err, "%s: mesh %u: vertex index %u out of range", label(s), index, m->indices[i]);
    for (size_t i = 0; i < 3 * (size_t)m->vertex_count; i++)
        if (!isfinite(m->positions[i]))
            return fail(err, "%s: mesh %u: position of vertex %zu is not finite", label(s), index, i / 3);
    return true;
}

static bool check_transform(const scene *s, uint32_t index, message *err)
{
    const float *m = s->instances[index].to_world;
    double lengths = 1.0;
    for (int i = 0; i < 12; i++)
        if (!isfinite(m[i]))
            return fail(err, "%s: instance %u: transform is not finite", label(s), index);
    for (int i = 0; i < 3; i++)
        lengths *= sqrt((double)m[i] * m[i] + (double)m[4 + i] * m[4 + i] + (double)m[8 + i] * m[8 + i]);
    if (!(fabs(determinant(m)) > MIN_DETERMINANT * lengths))
        return fail(err, "%s: instance %u: transform is singular", label(s), index);
    return true;
}

/* --- Completion --- */

static bool has_area(const float *positions, const uint32_t *t)
{
    const float *a = positions + 3 * (size_t)t[0], *b = positions + 3 * (size_t)t[1], *c = positions + 3 * (size_t)t[2];
    double e[3], f[3], g2 = 0.0, e2 = 0.0, f2 = 0.0;
    for (int i = 0; i < 3; i++) {
        e[i] = (double)b[i] - a[i];
        f[i] = (double)c[i] - a[i];
        e2 += e[i] * e[i];
        f2 += f[i] * f[i];
        g2 += (f[i] - e[i]) * (f[i] - e[i]);
    }
    double x = e[1] * f[2] - e[2] * f[1], y = e[2] * f[0] - e[0] * f[2], z = e[0] * f[1] - e[1] * f[0];
    double cross = sqrt(x * x + y * y + z * z);
    return cross > MIN_CROSS && cross > MIN_HEIGHT * fmax(e2, fmax(f2, g2));
}

/* Returns how many were dropped. */
static uint64_t drop_flat_triangles(mesh *m)
{
    uint32_t kept = 0, before = m->triangle_count;
    for (uint32_t i = 0; i < before; i++) {
        const uint32_t *t = m->indices + 3 * (size_t)i;
        if (has_area(m->positions, t))
            memmove(m->indices + 3 * (size_t)kept++, t, 3 * sizeof *t);
    }
    m->triangle_count = kept;
    return before - kept;
}

typedef struct box {
    vec3 low, high;
} box;

/* Vertices that no triangle uses do not count. */
static box mesh_box(const mesh *m)
{
    box b = {v3(INFINITY, INFINITY, INFINITY), v3(-INFINITY, -INFINITY, -INFINITY)};
    for (size_t i = 0; i < 3 * (size_t)m->triangle_count; i++) {
        const float *p = m->positions + 3 * (size_t)m->indices[i];
        b.low = v3_min(b.low, v3(p[0], p[1], p[2]));
        b.high = v3_max(b.high, v3(p[0], p[1], p[2]));
    }
    return b;
}

static bool inside_bounds(const scene *s, vec3 p)
{
    return p.x >= s->bounds_min.x && p.y >= s->bounds_min.y && p.z >= s->bounds_min.z && p.x <= s->bounds_max.x &&
           p.y <= s->bounds_max.y && p.z <= s->bounds_max.z;
}

static bool add_to_bounds(scene *s, uint32_t index, const box *b, message *err)
{
    const float *to_world = s->instances[index].to_world;
    const mesh *m = &s->meshes[s->instances[index].mesh];
    int corners = 0;
    for (int i = 0; i < 8; i++)
        corners +=
            inside_bounds(s, transform_point(to_world, v3(i & 1 ? b->low.x : b->high.x, i & 2 ? b->low.y : b->high.y,
                                                          i & 4 ? b->low.z : b->high.z)));
    if (corners == 8)
        return true; /* spares most of the work where one mesh stands many times */
    for (size_t i = 0; i < 3 * (size_t)m->triangle_count; i++) {
        const float *p = m->positions + 3 * (size_t)m->indices[i];
        vec3 w = transform_point(to_world, v3(p[0], p[1], p[2]));
        if (!(fabsf(w.x) <= MAX_COORDINATE && fabsf(w.y) <= MAX_COORDINATE && fabsf(w.z) <= MAX_COORDINATE))
            return fail(err, "%s: instance %u: a vertex lies beyond %g units", label(s), index, MAX_COORDINATE);
        s->bounds_min = v3_min(s->bounds_min, w);
        s->bounds_max = v3_max(s->bounds_max, w);
    }
    return true;
}

/* Instances of meshes left empty go, so that nobody else meets them. */
static bool count_instances(scene *s, message *err)
{
    box *boxes = xmalloc(s->mesh_count * sizeof *boxes);
    for (uint32_t i = 0; i < s->mesh_count; i++)
        boxes[i] = mesh_box(&s->meshes[i]);
    uint32_t kept = 0;
    bool ok = true;
    s->bounds_min = v3(INFINITY, INFINITY, INFINITY);
    s->bounds_max = v3(-INFINITY, -INFINITY, -INFINITY);
    s->triangle_count = 0;
    for (uint32_t i = 0; ok && i < s->instance_count; i++) {
        uint32_t which = s->instances[i].mesh;
        if (s->meshes[which].triangle_count == 0)
            continue;
        ok = add_to_bounds(s, i, &boxes[which], err);
        s->triangle_count += s->meshes[which].triangle_count;
        s->instances[kept++] = s->instances[i];
    }
    free(boxes);
    if (ok)
        s->instance_count = kept;
    return ok;
}

static bool shines(const scene *s)
{
    if (s->environment)
        return true;
    for (uint32_t i = 0; i < s->light_count; i++)
        if (v3_max_component(s->lights[i].intensity) > 0.0f)
            return true;
    for (uint32_t i = 0; i < s->instance_count; i++)
        if (v3_max_component(s->materials[s->meshes[s->instances[i].mesh].material].emission) > 0.0f)
            return true;
    return false;
}

static camera framing_camera(const scene *s)
{
    const float yfov = 40.0f * PI_F / 180.0f;
    vec3 center = v3_scale(v3_add(s->bounds_min, s->bounds_max), 0.5f);
    float radius = 0.5f * v3_length(v3_sub(s->bounds_max, s->bounds_min));
    vec3 away = v3_normalize(v3(0.5f, 0.4f, 1.0f));
    camera c = camera_look(v3_mad(center, radius / sinf(0.5f * yfov), away), center, v3(0, 1, 0), yfov);
    snprintf(c.name, sizeof c.name, "overview");
    return c;
}

bool scene_finish(scene *s, message *err)
{
    if (!check_materials(s, err) || !check_lights_and_cameras(s, err))
        return false;
    for (uint32_t i = 0; i < s->mesh_count; i++)
        if (!check_mesh(s, i, err))
            return false;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        if (s->instances[i].mesh >= s->mesh_count)
            return fail(err, "%s: instance %u: mesh index %u out of range", label(s), i, s->instances[i].mesh);
        if (!check_transform(s, i, err))
            return false;
    }

    uint64_t dropped = 0;
    for (uint32_t i = 0; i < s->mesh_count; i++)
        dropped += drop_flat_triangles(&s->meshes[i]);
    if (!count_instances(s, err))
        return false;
    if (s->triangle_count == 0)
        return fail(err, "%s: the scene has no triangle with area", label(s));
    if (dropped)
        notice("%s: dropped %llu triangle%s without area", label(s), (unsigned long long)dropped,
               dropped > 1 ? "s" : "");

    if (s->camera_count == 0) {
        scene_add_camera(s, framing_camera(s));
        notice("%s: no camera; added one that frames the scene", label(s));
    }
    if (!shines(s) && s->light_count > 0) { /* as somebody wanted it */
        notice("%s: all lights have intensity 0", label(s));
    } else if (!shines(s)) {
        s->environment = environment_uniform(v3(1, 1, 1));
        notice("%s: no light; added a uniform white sky", label(s));
    }
    return true;
}
