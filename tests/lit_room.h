/* SPDX-License-Identifier: Apache-2.0 */
/* A scene with one light of each kind, for the tests of where light paths begin. After cmocka.h. */
#ifndef TESTS_LIT_ROOM_H
#define TESTS_LIT_ROOM_H

#include "light_sources.h"
#include "scene_support.h"

static const double pi = 3.14159265358979323846;

/* Where a ray may come from. */
typedef enum place { LAMP, PANEL_FRONT, PANEL_BACK, BULB, SPOT, SUN, SKY, PLACES } place;

typedef struct quad {
    vec3 a, ab, ac;
} quad;

static const quad lamp = {{-2, 3, -1}, {1, 0, 0.2f}, {0, 0.3f, 1.5f}};   /* emits from one side */
static const quad panel = {{2, 2, 0}, {0.2f, 1, 0}, {0.3f, 0.1f, 1.2f}}; /* from both */
static const rgb lamp_radiance = {3, 2, 1}, panel_radiance = {0.2f, 1, 4};

typedef struct room {
    scene *s;
    emitters *e;
    light_sources *l;
} room;

static inline environment *noisy_sky(void)
{
    image map = image_new(16, 8);
    rng r = rng_make(5, 5);
    message err = {{0}};
    environment *e = NULL;
    for (size_t i = 0; i < 16 * 8; i++) {
        float x = rng_float(&r), y = rng_float(&r);
        map.pixels[i] = v3(0.2f * x, 0.1f, i == 37 ? 3.0f : 0.3f * y);
    }
    if (!environment_from_image(&map, &e, &err))
        fail_msg("%s", err.text);
    image_free(&map);
    return e;
}

static inline uint32_t glow(scene *s, rgb radiance, bool two_sided)
{
    uint32_t m = add_material(s, MATERIAL_DIFFUSE, 0.5f);
    s->materials[m].emission = radiance;
    s->materials[m].two_sided = two_sided;
    return m;
}

/* Of each kind one, over a floor that is off the centre of the world. */
static inline scene *furnished(void)
{
    scene *s = scene_new("room");
    add_quad(s, v3(-2, 0, -1), v3(0, 0, 4), v3(5, 0, 0), add_material(s, MATERIAL_DIFFUSE, 0.5f));
    add_quad(s, lamp.a, lamp.ab, lamp.ac, glow(s, lamp_radiance, false));
    add_quad(s, panel.a, panel.ab, panel.ac, glow(s, panel_radiance, true));
    scene_add_light(s, (light){.kind = LIGHT_POINT, .position = v3(0, 1, 0), .intensity = v3(2, 3, 1)});
    scene_add_light(s, (light){.kind = LIGHT_SPOT,
                               .position = v3(1, 2, 3),
                               .direction = v3_normalize(v3(0.3f, -0.9f, 0.2f)),
                               .intensity = v3(6, 4, 2),
                               .cos_inner = 0.9f,
                               .cos_outer = 0.6f});
    scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL,
                               .direction = v3_normalize(v3(0.5f, -0.8f, 0.1f)),
                               .intensity = v3(0.5f, 0.3f, 0.4f)});
    s->environment = noisy_sky();
    return s;
}

static inline room room_of(scene *s, bool with_environment)
{
    message err = {{0}};
    room r = {.s = s};
    notice_enable(false);
    if (!scene_finish(s, &err))
        fail_msg("%s", err.text);
    r.e = emitters_new(s);
    r.l = light_sources_new(s, r.e, with_environment);
    return r;
}

static inline void room_free(room *r)
{
    light_sources_free(r->l);
    emitters_free(r->e);
    scene_free(r->s);
}

static inline bool emit(const room *r, rng *random, light_emission *out)
{
    float u[6];
    for (int i = 0; i < 6; i++)
        u[i] = rng_float(random);
    return light_sources_emit(r->l, u, out);
}

static inline vec3 quad_normal(const quad *q)
{
    return v3_normalize(v3_cross(q->ab, q->ac));
}

static inline place place_of(const light_emission *y)
{
    if (y->kind == SOURCE_EMITTER && y->radiance.x == lamp_radiance.x)
        return LAMP;
    if (y->kind == SOURCE_EMITTER)
        return v3_dot(y->normal, quad_normal(&panel)) > 0.0f ? PANEL_FRONT : PANEL_BACK;
    return y->kind == SOURCE_ENVIRONMENT ? SKY : (place)(BULB + y->light);
}

static inline bool close_to(double a, double b, double tolerance)
{
    return fabs(a - b) <= tolerance * fabs(b);
}

static inline bool same_rgb(rgb a, rgb b, double tolerance)
{
    return close_to(a.x, b.x, tolerance) && close_to(a.y, b.y, tolerance) && close_to(a.z, b.z, tolerance);
}

static inline vec3 center_of(const scene *s)
{
    return v3_scale(v3_add(s->bounds_min, s->bounds_max), 0.5f);
}

static inline float radius_of(const scene *s)
{
    return v3_length(v3_sub(s->bounds_max, center_of(s)));
}

/* Unit, by its angles with and around an axis. */
static inline vec3 around(vec3 axis, double cosine, double turn)
{
    vec3 t, b;
    double sine = sqrt(fmax(0.0, 1.0 - cosine * cosine));
    v3_basis(axis, &t, &b);
    vec3 d = v3_mad(v3_scale(axis, (float)cosine), (float)(sine * cos(2.0 * pi * turn)), t);
    return v3_mad(d, (float)(sine * sin(2.0 * pi * turn)), b);
}

#endif
