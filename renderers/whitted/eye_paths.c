/* SPDX-License-Identifier: Apache-2.0 */
/* Whitted-style eye paths into a deep buffer: through mirrors and glass to the surfaces that are lit. */
#include "whitted.h"

#include "../common/camera.h"
#include "../common/interrupt.h"
#include "../common/sobol.h"
#include "../../halton/halton.h"

/* A branch that brings less than this to its pixel is not followed. */
static const float weight_min = 0.005f;
enum { DEPTH_MAX = 10 };

/* A primary ray on its way, and what follow() needs to know of it. */
typedef struct primary {
    uint32_t pixel;
    uint32_t place;
    uint64_t random;
    float spread;
    bool first; /* of its pixel */
} primary;

typedef struct path {
    const view *view;
    eye_samples *first, *late; /* late: behind specular surfaces */
    tile_pixels *pixels;
    uint32_t pixel, place;
    uint64_t random;
    float spread; /* of the pixel's cone: its width per unit of distance */
    float share;  /* of a sample in the pixel */
    ray_packet packet;
    primary waiting[GROUP];
    uint32_t count; /* of them */
} path;

static void push(eye_samples *s, const eye_sample *e)
{
    if (s->count == s->capacity) {
        s->capacity = s->capacity ? 2 * s->capacity : 1024;
        s->items = xrealloc(s->items, s->capacity * sizeof *s->items);
    }
    s->items[s->count++] = *e;
}

static void follow(path *p, vec3 origin, vec3 direction, rgb weight, float width, int depth);

/* `width`: of the cone where the ray started. The footprint keeps growing behind flat mirrors and glass; curvature is
 * left out. */
static void arrive(path *p, const surface *s, rgb weight, float width, int depth)
{
    const view *v = p->view;
    rgb *seen = &p->pixels->seen[p->pixel];
    width += s->distance * p->spread;
    *seen = v3_add(*seen, v3_mul(weight, surface_emission(s)));

    if (material_is_specular(s->material)) {
        specular_branch branches[2];
        int count = depth < DEPTH_MAX ? material_specular(s, branches) : 0;
        for (int i = 0; i < count; i++) {
            rgb next = v3_mul(weight, branches[i].weight);
            if (v3_max_component(next) < weight_min * p->share)
                continue;
            follow(p, surface_offset(s, branches[i].wi), branches[i].wi, next, width, depth + 1);
        }
        return;
    }
    eye_sample e = {.surface = *s, .weight = weight, .pixel = p->pixel};
    e.place = depth == 0 ? p->place : PLACE_NONE;
    e.origin = surface_offset(s, s->geometric_normal);
    e.density = vcache_density_cone(width, fabsf(v3_dot(s->geometric_normal, s->wo)), (float)v->settings.spp);
    eye_samples *list = depth == 0 ? p->first : p->late;
    /* each sample of a path needs its own random numbers */
    e.random = rng_mix(p->random + ((uint64_t)list->count << 40));
    push(list, &e);
}

static void see_sky(path *p, vec3 direction, rgb weight)
{
    const environment *sky = p->view->scene->environment;
    rgb *seen = &p->pixels->seen[p->pixel];
    if (sky)
        *seen = v3_add(*seen, v3_mul(weight, environment_radiance(sky, direction)));
}

static void follow(path *p, vec3 origin, vec3 direction, rgb weight, float width, int depth)
{
    surface s;
    if (tracer_closest(p->view->tracer, origin, direction, &s))
        arrive(p, &s, weight, width, depth);
    else
        see_sky(p, direction, weight);
}

/* Primary rays run close together: they are traced in packets, and followed one by one, in their order. */
static void trace_waiting(path *p)
{
    surface hits[GROUP];
    const ray_packet *r = &p->packet;
    rgb weight = v3(p->share, p->share, p->share);
    uint32_t found = tracer_closest16(p->view->tracer, r, (1u << p->count) - 1u, true, hits);
    for (uint32_t k = 0; k < p->count; k++) {
        const primary *w = &p->waiting[k];
        p->pixel = w->pixel;
        p->place = w->place;
        p->random = w->random;
        p->spread = w->spread;
        if (!(found >> k & 1u)) {
            see_sky(p, v3(r->dir_x[k], r->dir_y[k], r->dir_z[k]), weight);
            continue;
        }
        if (w->first) {
            p->pixels->depth[p->pixel] = hits[k].distance;
            p->pixels->normal[p->pixel] = hits[k].normal;
        }
        arrive(p, &hits[k], weight, 0.0f, 0);
    }
    p->count = 0;
}

static void send(path *p, vec3 direction, primary w)
{
    ray_packet *r = &p->packet;
    uint32_t k = p->count++;
    r->dir_x[k] = direction.x, r->dir_y[k] = direction.y, r->dir_z[k] = direction.z;
    p->waiting[k] = w;
    if (p->count == GROUP)
        trace_waiting(p);
}

void eye_paths(const view *v, tile t, int first, int count, eye_samples *out, tile_pixels *pixels)
{
    const settings *f = &v->settings;
    const camera_frame c = camera_frame_of(&v->camera, f->width, f->height);
    eye_samples late = {0};
    out->count = 0;
    path p = {.view = v, .first = out, .late = &late, .pixels = pixels, .share = 1.0f / (float)f->spp};
    uint32_t across[PASS], along[PASS];
    const int side = (int)(sqrtf((float)f->spp) + 0.5f); /* of a lattice */
    packet_init(&p.packet);
    for (int k = 0; k < GROUP; k++) {
        p.packet.org_x[k] = c.eye.x, p.packet.org_y[k] = c.eye.y, p.packet.org_z[k] = c.eye.z;
        p.packet.tfar[k] = INFINITY;
    }
    for (int i = 0; i < count; i++) {
        across[i] = sobol_reverse((uint32_t)(first + i));
        along[i] = sobol_second((uint32_t)(first + i));
    }
    for (uint64_t code = 0; code < (uint64_t)TILE * TILE && !interrupted(); code++) {
        uint32_t x, y;
        halton_morton_decode(code, &x, &y);
        if (x >= t.width || y >= t.height)
            continue;
        uint64_t index = (uint64_t)(t.y + y) * f->width + t.x + x;
        rng seeds = rng_make(f->seed, index);
        uint32_t seed_x = rng_u32(&seeds), seed_y = rng_u32(&seeds);
        for (int i = 0; i < count; i++) {
            /* One sample alone stands in the middle. */
            float u = 0.5f, w = 0.5f;
            if (f->lattice) {
                u = ((float)(i % side) + 0.5f) / (float)side;
                w = ((float)(i / side) + 0.5f) / (float)side;
            } else if (f->spp > 1) {
                u = sobol_float(sobol_scramble(across[i], seed_x));
                w = sobol_float(sobol_scramble(along[i], seed_y));
            }
            float dx = ((float)(t.x + x) + u - 0.5f * (float)f->width) * c.pixel;
            float dy = (0.5f * (float)f->height - (float)(t.y + y) - w) * c.pixel, distance;
            vec3 direction = camera_plane_direction(&c, dx, dy, &distance);
            send(&p, direction,
                 (primary){.pixel = y * TILE + x,
                           .place = (uint32_t)(first + i),
                           .random = index * (uint64_t)f->spp + (uint64_t)(first + i),
                           .spread = camera_spread(&c, distance),
                           .first = first + i == 0});
        }
    }
    if (p.count > 0)
        trace_waiting(&p);
    for (size_t i = 0; i < late.count; i++)
        push(out, &late.items[i]);
    free(late.items);
}
