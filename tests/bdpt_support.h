/* SPDX-License-Identifier: Apache-2.0 */
/* One call to render passes of a scene by bidirectional path tracing, for tests. */
#ifndef TESTS_BDPT_SUPPORT_H
#define TESTS_BDPT_SUPPORT_H

#include "../renderers/bdpt/pilot.h"
#include "../renderers/bdpt/render.h"
#include "scene_support.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

#include "tally.h"

typedef struct stage {
    scene *s;
    tracer *t;
    emitters *e;
    light_sources *l;
    view v;
} stage;

/* Takes the scene and finishes it. One thread; exact; power heuristic. */
static inline stage stage_new(scene *s, camera c, uint32_t width, uint32_t height)
{
    message err = {{0}};
    stage g = {.s = s};
    notice_enable(false);
    if (!scene_finish(s, &err) || !tracer_create(s, 1, &g.t, &err))
        fail_msg("%s", err.text);
    g.e = emitters_new(s);
    g.l = light_sources_new(s, g.e, true);
    g.v.settings = (settings){.width = width,
                              .height = height,
                              .epoch = 16,
                              .seed = 1,
                              .threads = 1,
                              .heuristic = HEURISTIC_POWER,
                              .ce = 12.0f,
                              .partners = 1,
                              .light_vertices = -1,
                              .cache = vcache_default_config()};
    view_set(&g.v, s, g.t, g.l, &c);
    return g;
}

/* The same, for frames of `spp`: 16 MiB of cache, a quarter of the connections traced by estimates. */
static inline stage cached_stage(scene *s, camera c, uint32_t width, uint32_t height, int spp)
{
    stage g = stage_new(s, c, width, height);
    settings *f = &g.v.settings;
    f->spp = spp;
    f->seconds = INFINITY;
    f->rays = 0.25f;
    f->cache.table_bytes = 1 << 24;
    return g;
}

static inline void stage_free(stage *g)
{
    light_sources_free(g->l);
    emitters_free(g->e);
    tracer_free(g->t);
    scene_free(g->s);
}

static inline bool sane(const image *i)
{
    for (size_t k = 0; k < (size_t)i->width * i->height; k++) {
        rgb p = i->pixels[k];
        if (!isfinite(p.x) || !isfinite(p.y) || !isfinite(p.z) || p.x < 0.0f || p.y < 0.0f || p.z < 0.0f)
            return false;
    }
    return true;
}

static inline double l_inf(const image *a, const image *b)
{
    double difference = 0.0, sum = 0.0;
    for (size_t i = 0; i < (size_t)a->width * a->height; i++) {
        difference += fabs((double)luminance(a->pixels[i]) - (double)luminance(b->pixels[i]));
        sum += (double)luminance(b->pixels[i]);
    }
    return difference / sum;
}

static inline double image_mean(const image *i)
{
    double sum = 0.0;
    for (size_t k = 0; k < (size_t)i->width * i->height; k++)
        sum += (double)luminance(i->pixels[k]);
    return sum / ((double)i->width * i->height);
}

enum { RENDERINGS = 200 }; /* rare paths carry much of the light */

/* Mean luminance of the image over independent renderings of one pass each, seeds first, first + 1 ... (paths of one
 * seed are spread over the pixel, and so are not independent); sample_count(renderings, RENDERINGS) of them. */
static inline tally stage_tally(stage *g, vcache *cache, int renderings, uint64_t first)
{
    tally t = {0};
    for (int i = 0, count = sample_count(renderings, RENDERINGS); i < count; i++) {
        g->v.settings.seed = first + (uint64_t)i;
        film f = film_new(g->v.settings.width, g->v.settings.height);
        passes *p = passes_new(&g->v, cache, &f);
        assert_true(passes_render(p, 0));
        assert_true(sane(&f.mean));
        tally_add(&t, image_mean(&f.mean));
        passes_free(p);
        film_free(&f);
    }
    return t;
}

/* A whole rendering; `start`: NULL, or to go on from. frame_free it. */
static inline frame stage_frame(stage *g, visibility_mode mode, const film *start)
{
    frame f;
    message err = {{0}};
    g->v.settings.visibility = mode;
    if (!bdpt_render(&g->v, start, "test", true, &f, &err))
        fail_msg("%s", err.text);
    return f;
}

static inline void assert_within(const tally *t, double expected, double bias, const char *what)
{
    print_message("%s: %f +- %f, expected %f\n", what, tally_mean(t), tally_error(t), expected);
    if (!(fabs(tally_mean(t) - expected) <= 3.0 * tally_error(t) + bias))
        fail_msg("%s: %f +- %f, expected %f", what, tally_mean(t), tally_error(t), expected);
}

/* A closed box of half edge 2 around the origin, seen from inside; walls reflect half of what they get and emit the
 * other half, so that everything has radiance 1. */
static inline scene *furnace(void)
{
    scene *s = scene_new("furnace");
    uint32_t wall = add_material(s, MATERIAL_DIFFUSE, 0.5f);
    s->materials[wall].emission = v3(0.5f, 0.5f, 0.5f);
    s->materials[wall].two_sided = true;
    add_box(s, v3(-2, -2, -2), v3(2, 2, 2), 63, wall);
    return s;
}

static inline camera inside(void)
{
    return (camera){.eye = {0.3f, 0.2f, 1.8f}, .forward = {0, 0, -1}, .up = {0, 1, 0}, .yfov = 1.4f};
}

/* Of an estimate a pixel may be below 0: what is expected but not found counts more than once. */
static inline bool finite_image(const image *a)
{
    for (size_t i = 0; i < (size_t)a->width * a->height; i++)
        if (!isfinite(a->pixels[i].x) || !isfinite(a->pixels[i].y) || !isfinite(a->pixels[i].z))
            return false;
    return true;
}

/* In this mode; the picture must be one. */
static inline frame picture(stage *g, visibility_mode mode)
{
    frame f = stage_frame(g, mode, NULL);
    if (!(mode == VISIBILITY_ESTIMATE ? finite_image(&f.image) : sane(&f.image)))
        fail_msg("mode %d: a pixel is NaN, infinite or negative", (int)mode);
    return f;
}

static inline double share(const frame *f)
{
    return (double)f->rays.traced / (double)f->rays.asked;
}

/* Estimates against exact connections of the same paths: mean of the difference, in units of the exact mean. */
static inline void assert_no_bias(stage *g, int seeds, const char *what)
{
    tally t = {0};
    for (int i = 0, count = sample_count(seeds, 16); i < count; i++) {
        g->v.settings.seed = 100 + (uint64_t)i;
        frame exact = picture(g, VISIBILITY_EXACT), other = picture(g, VISIBILITY_ESTIMATE);
        tally_add(&t, (image_mean(&other.image) - image_mean(&exact.image)) / image_mean(&exact.image));
        frame_free(&exact);
        frame_free(&other);
    }
    print_message("%s: estimates differ by %.5f +- %.5f\n", what, tally_mean(&t), tally_error(&t));
    if (!(fabs(tally_mean(&t)) <= 3.0 * tally_error(&t)))
        fail_msg("%s: estimates differ by %f +- %f", what, tally_mean(&t), tally_error(&t));
}

/* A room with a smooth ball, boxes of gloss and metal, and light from one kind of source. */
enum { ROOM_LAMP, ROOM_POINT, ROOM_SPOT, ROOM_SUN, ROOM_SKY, ROOMS };
static inline scene *room_scene(int kind)
{
    scene *s = scene_new("room");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), gloss = add_material(s, MATERIAL_GLOSSY, 0.4f);
    uint32_t lamp = add_material(s, MATERIAL_DIFFUSE, 0.3f), metal = add_material(s, MATERIAL_CONDUCTOR, 0.8f);
    add_box(s, v3(-2, -1.0f, -2), v3(2, 2, 2), kind >= ROOM_SUN ? 31u & ~8u : 31u, grey);
    add_box(s, v3(-1.5f, -1, -1.5f), v3(-0.7f, 0.4f, -0.8f), 63, gloss);
    add_box(s, v3(1.0f, -1, -1.5f), v3(1.5f, 0.1f, -0.9f), 63, metal);
    const float scale[12] = {0.6f, 0, 0, 0.4f, 0, 0.6f, 0, -0.4f, 0, 0, 0.6f, 0.3f};
    add_sphere(s, 12, true, grey);
    memcpy(s->instances[s->instance_count - 1].to_world, scale, sizeof scale);
    if (kind == ROOM_LAMP) {
        s->materials[lamp].emission = v3(5, 5, 5);
        add_quad(s, v3(-0.5f, 1.9f, -0.5f), v3(1, 0, 0), v3(0, 0, 1), lamp);
    } else if (kind == ROOM_POINT) {
        add_point_light(s, v3(-0.3f, 1.2f, 0.4f), 2.0f);
    } else if (kind == ROOM_SPOT) {
        scene_add_light(s, (light){.kind = LIGHT_SPOT,
                                   .position = v3(1.2f, 1.6f, 1.2f),
                                   .direction = v3_normalize(v3(-1, -1.2f, -1)),
                                   .intensity = v3(8, 8, 8),
                                   .cos_inner = 0.95f,
                                   .cos_outer = 0.8f});
    } else if (kind == ROOM_SUN) {
        scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL,
                                   .direction = v3_normalize(v3(0.3f, -1, -0.4f)),
                                   .intensity = v3(2, 2, 2)});
    } else {
        s->environment = environment_uniform(v3(1, 1, 1));
    }
    return s;
}

static inline camera room_camera(void)
{
    return camera_look(v3(0.4f, 0.5f, 3.5f), v3(0, -0.2f, 0), v3(0, 1, 0), 0.9f);
}

static inline void assert_same_mean(const tally *a, const tally *b, const char *what)
{
    double difference = tally_mean(a) - tally_mean(b), error = hypot(tally_error(a), tally_error(b));
    print_message("%s: %f, %f, standard error %f (%.2f)\n", what, tally_mean(a), tally_mean(b), error,
                  difference / error);
    if (!(fabs(difference) <= 3.0 * error))
        fail_msg("%s: %f and %f, standard error %f", what, tally_mean(a), tally_mean(b), error);
}

#endif
