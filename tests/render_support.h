/* SPDX-License-Identifier: Apache-2.0 */
/* Small scenes with a known answer, and one call to render them, for the tests of renderers. */
#ifndef TESTS_RENDER_SUPPORT_H
#define TESTS_RENDER_SUPPORT_H

#include "../renderers/whitted/whitted.h"
#include "scene_support.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

/* --------------------------------------------------------------------------------------------------------- shapes */

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

/* -------------------------------------------------------------------------------------------------------- renders */

typedef struct stage {
    scene *s;
    tracer *t;
    emitters *e;
    view v;
} stage;

/* Takes the scene and finishes it. No virtual point lights; 16 samples of each kind; one thread; exact. */
static inline stage stage_new(scene *s, camera c, uint32_t width, uint32_t height, int spp)
{
    message err = {{0}};
    stage g = {.s = s};
    notice_enable(false);
    if (!scene_finish(s, &err) || !tracer_create(s, 1, &g.t, &err))
        fail_msg("%s", err.text);
    g.e = emitters_new(s);
    g.v = (view){.scene = s, .tracer = g.t, .emitters = g.e, .camera = c};
    settings *f = &g.v.settings;
    *f = (settings){.width = width,
                    .height = height,
                    .spp = spp,
                    .env_samples = 16,
                    .light_samples = 16,
                    .seed = 1,
                    .threads = 1,
                    .cache = vcache_default_config()};
    const float low[3] = {s->bounds_min.x, s->bounds_min.y, s->bounds_min.z};
    const float high[3] = {s->bounds_max.x, s->bounds_max.y, s->bounds_max.z};
    memcpy(f->cache.bounds_min, low, sizeof low);
    memcpy(f->cache.bounds_max, high, sizeof high);
    return g;
}

static inline void stage_free(stage *g)
{
    emitters_free(g->e);
    tracer_free(g->t);
    scene_free(g->s);
}

/* C_E of all kinds of light; 0: exact. */
static inline void stage_mode(stage *g, float ce)
{
    settings *f = &g->v.settings;
    f->visibility = ce > 0.0f ? VISIBILITY_CACHE : VISIBILITY_EXACT;
    f->ce = f->ce_delta = f->ce_samples = ce;
}

static inline void assert_sane(const frame *f)
{
    for (size_t i = 0; i < (size_t)f->image.width * f->image.height; i++) {
        rgb p = f->image.pixels[i];
        assert_true(isfinite(p.x) && isfinite(p.y) && isfinite(p.z) && p.x >= 0.0f && p.y >= 0.0f && p.z >= 0.0f);
        assert_true(f->traced_share[i] >= 0.0f && isfinite(f->depth[i]));
    }
    assert_true(f->complete);
}

static inline frame stage_render(stage *g, float ce)
{
    frame f;
    message err = {{0}};
    stage_mode(g, ce);
    if (!frame_render(&g->v, "test", true, NULL, NULL, &f, &err))
        fail_msg("%s", err.text);
    assert_sane(&f);
    return f;
}

static inline bool same_images(const image *a, const image *b)
{
    return a->width == b->width && a->height == b->height &&
           memcmp(a->pixels, b->pixels, (size_t)a->width * a->height * sizeof(rgb)) == 0;
}

/* Where the ray through (x, y), in pixels from the upper left corner, meets the plane y = 0. */
static inline vec3 floor_point(const view *v, double x, double y)
{
    const camera *c = &v->camera;
    double pixel = 2.0 * tan(0.5 * (double)c->yfov) / v->settings.height;
    vec3 right = v3_cross(c->forward, c->up);
    vec3 d = v3_mad(c->forward, (float)((x - 0.5 * v->settings.width) * pixel), right);
    d = v3_mad(d, (float)((0.5 * v->settings.height - y) * pixel), c->up);
    return v3_mad(c->eye, -c->eye.y / d.y, d);
}

/* Boxes on a floor with all kinds of light; some glass and gloss. */
static inline stage mixed_stage(uint32_t width, uint32_t height, int spp)
{
    scene *s = scene_new("mixed");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), gloss = add_material(s, MATERIAL_GLOSSY, 0.4f);
    uint32_t glass = add_material(s, MATERIAL_DIELECTRIC, 0.9f), lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[lamp].emission = v3(3, 3, 2);
    add_box(s, v3(-2, -0.1f, -2), v3(2, 0, 2), 63, grey);
    add_box(s, v3(-0.8f, 0, -0.8f), v3(-0.2f, 0.7f, -0.3f), 63, gloss);
    add_box(s, v3(0.1f, 0, 0.1f), v3(0.5f, 0.5f, 0.6f), 63, glass);
    add_box(s, v3(0.3f, 0, -0.9f), v3(0.8f, 0.4f, -0.4f), 63, grey);
    add_quad(s, v3(-0.3f, 1.5f, -0.3f), v3(0.6f, 0, 0), v3(0, 0, 0.6f), lamp);
    add_point_light(s, v3(0.7f, 1.2f, 0.9f), 1.0f);
    s->environment = environment_uniform(v3(0.1f, 0.2f, 0.3f));
    stage g = stage_new(s, camera_look(v3(1.5f, 1.3f, 2), v3(0, 0.2f, 0), v3(0, 1, 0), 0.8f), width, height, spp);
    g.v.settings.vpls = 100;
    return g;
}

/* ----------------------------------------------------------------------------------------------------- statistics */

typedef struct tally {
    double count, sum, squares;
} tally;

static inline void tally_add(tally *t, double x)
{
    t->count += 1.0, t->sum += x, t->squares += x * x;
}

static inline double tally_mean(const tally *t)
{
    return t->sum / t->count;
}

/* Standard error of the mean. */
static inline double tally_error(const tally *t)
{
    double mean = tally_mean(t), variance = (t->squares - t->count * mean * mean) / (t->count - 1.0);
    return sqrt(fmax(variance, 0.0) / t->count);
}

/* `bias`: what is known about the estimate's own error. */
static inline void assert_mean(const tally *t, double expected, double bias, const char *what)
{
    double mean = tally_mean(t), error = tally_error(t);
    if (!(fabs(mean - expected) <= 4.0 * error + bias))
        fail_msg("%s: mean %.6f, expected %.6f, standard error %.6f, bias allowed %.6f", what, mean, expected, error,
                 bias);
}

/* Irradiance at p with normal n from a polygon of radiance 1 above its horizon (Lambert 1760). */
static inline double polygon_irradiance(vec3 p, vec3 n, const vec3 *corners, int count)
{
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        vec3 a = v3_normalize(v3_sub(corners[i], p)), b = v3_normalize(v3_sub(corners[(i + 1) % count], p));
        vec3 c = v3_cross(a, b);
        sum += atan2((double)v3_length(c), (double)v3_dot(a, b)) * (double)v3_dot(v3_normalize(c), n);
    }
    return 0.5 * fabs(sum);
}

#endif
