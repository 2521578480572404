/* SPDX-License-Identifier: Apache-2.0 */
/* Whitted-style eye paths into a deep buffer: through mirrors and glass to the surfaces that are lit. */
#include "whitted.h"

#include "../common/interrupt.h"
#include "../../halton/halton.h"

/* A branch that brings less than this to its pixel is not followed. */
static const float weight_min = 0.005f;
enum { DEPTH_MAX = 10 };

typedef struct path {
    const view *view;
    eye_samples *first, *late; /* late: behind specular surfaces */
    tile_pixels *pixels;
    uint32_t pixel;
    float stratum;
    uint64_t random;
    float spread; /* of the pixel's cone: its width per unit of distance */
    float share;  /* of a sample in the pixel */
} path;

static void push(eye_samples *s, const eye_sample *e)
{
    if (s->count == s->capacity) {
        s->capacity = s->capacity ? 2 * s->capacity : 1024;
        s->items = xrealloc(s->items, s->capacity * sizeof *s->items);
    }
    s->items[s->count++] = *e;
}

/* `width`: of the cone at `origin`. The footprint keeps growing behind flat mirrors and glass; curvature is left out. */
static void follow(path *p, vec3 origin, vec3 direction, rgb weight, float width, int depth, bool primary)
{
    const view *v = p->view;
    surface s;
    rgb *seen = &p->pixels->seen[p->pixel];
    if (!tracer_closest(v->tracer, origin, direction, &s)) {
        if (v->scene->environment)
            *seen = v3_add(*seen, v3_mul(weight, environment_radiance(v->scene->environment, direction)));
        return;
    }
    width += s.distance * p->spread;
    if (primary) {
        p->pixels->depth[p->pixel] = s.distance;
        p->pixels->normal[p->pixel] = s.normal;
    }
    *seen = v3_add(*seen, v3_mul(weight, surface_emission(&s)));

    if (material_is_specular(s.material)) {
        specular_branch branches[2];
        int count = depth < DEPTH_MAX ? material_specular(&s, branches) : 0;
        for (int i = 0; i < count; i++) {
            rgb next = v3_mul(weight, branches[i].weight);
            if (v3_max_component(next) < weight_min * p->share)
                continue;
            follow(p, surface_offset(&s, branches[i].wi), branches[i].wi, next, width, depth + 1, false);
        }
        return;
    }
    eye_sample e = {.surface = s, .weight = weight, .pixel = p->pixel, .stratum = p->stratum};
    e.origin = surface_offset(&s, s.geometric_normal);
    e.density = vcache_density_cone(width, fabsf(v3_dot(s.geometric_normal, s.wo)), (float)v->settings.spp);
    eye_samples *list = depth == 0 ? p->first : p->late;
    /* each sample of a path needs its own random numbers */
    e.random = rng_mix(p->random + ((uint64_t)list->count << 40));
    push(list, &e);
}

static float fraction(float x)
{
    return x - floorf(x);
}

void eye_paths(const view *v, tile t, int first, int count, eye_samples *out, tile_pixels *pixels)
{
    const settings *f = &v->settings;
    vec3 right = v3_cross(v->camera.forward, v->camera.up);
    float height = 2.0f * tanf(0.5f * v->camera.yfov), pixel = height / (float)f->height;
    eye_samples late = {0};
    out->count = 0;
    path p = {.view = v, .first = out, .late = &late, .pixels = pixels, .share = 1.0f / (float)f->spp};
    for (uint64_t code = 0; code < (uint64_t)TILE * TILE && !interrupted(); code++) {
        uint32_t x, y;
        halton_morton_decode(code, &x, &y);
        if (x >= t.width || y >= t.height)
            continue;
        p.pixel = y * TILE + x;
        uint64_t index = (uint64_t)(t.y + y) * f->width + t.x + x;
        rng shift = rng_make(f->seed, index);
        float shift_x = rng_float(&shift), shift_y = rng_float(&shift), shift_stratum = rng_float(&shift);
        for (int i = first; i < first + count; i++) {
            /* Halton points, shifted at random in each pixel; one sample alone stands in the middle. */
            float u = 0.5f, w = 0.5f;
            if (f->spp > 1) {
                u = fraction((float)halton_radical_inverse2((uint64_t)i) + shift_x);
                w = fraction((float)halton_radical_inverse3((uint64_t)i) + shift_y);
            }
            float dx = ((float)(t.x + x) + u - 0.5f * (float)f->width) * pixel;
            float dy = (0.5f * (float)f->height - (float)(t.y + y) - w) * pixel;
            vec3 direction = v3_mad(v3_mad(v->camera.forward, dx, right), dy, v->camera.up);
            p.stratum = fraction(shift_stratum + (float)i / (float)f->spp);
            p.random = index * (uint64_t)f->spp + (uint64_t)i;
            /* A pixel subtends pixel^2 cos^3 steradians at the angle from the axis. */
            float length = v3_length(direction);
            p.spread = pixel / (length * sqrtf(length));
            follow(&p, v->camera.eye, v3_scale(direction, 1.0f / length), v3(p.share, p.share, p.share), 0.0f, 0, i == 0);
        }
    }
    for (size_t i = 0; i < late.count; i++)
        push(out, &late.items[i]);
    free(late.items);
}
