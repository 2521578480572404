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

#include "tally.h"

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
