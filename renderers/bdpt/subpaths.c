/* SPDX-License-Identifier: Apache-2.0 */
/* Random walks from the camera and from the lights. All of a batch go on at the same time, in packets of rays. */
#include "bdpt.h"

#include "../common/sobol.h"

#include <stdlib.h>

/* A sub-path on its way. */
typedef struct walk {
    vec3 origin, direction;
    rgb throughput;
    mis mis;
    bool from_infinity; /* it has just begun there */
    int edges;
    uint32_t path;
    rng random;
} walk;

batch *batch_new(void)
{
    batch *b = xcalloc(1, sizeof *b);
    b->eye.vertices = xcalloc(BATCH * EDGES_MAX, sizeof *b->eye.vertices);
    b->light.vertices = xcalloc(BATCH * EDGES_MAX, sizeof *b->light.vertices);
    return b;
}

void batch_free(batch *b)
{
    if (b) {
        free(b->eye.vertices);
        free(b->light.vertices);
    }
    free(b);
}

/* Russian roulette by what the surface reflects, from the second on: at the first it costs more in noise than it saves.
 */
static bool survives(walk *w, const surface *s)
{
    if (w->edges == 1)
        return true;
    float chance = float_min(0.95f, material_reflectance(s));
    if (!(rng_float(&w->random) < chance))
        return false;
    w->throughput = v3_scale(w->throughput, 1.0f / chance);
    return true;
}

float reverse_pdf(const surface *s, vec3 wi)
{
    surface turned = *s;
    turned.wo = wi;
    return material_pdf(&turned, s->wo);
}

/* Light that travels away from the camera's end scatters by the adjoint: shading normals bend it by this factor (Veach
 * 1997, Sect. 5.3). `wi`: where it goes. */
float adjoint_correction(const surface *s, vec3 wi)
{
    float above = fabsf(v3_dot(s->wo, s->normal) * v3_dot(wi, s->geometric_normal));
    float below = fabsf(v3_dot(s->wo, s->geometric_normal) * v3_dot(wi, s->normal));
    return below > 0.0f ? above / below : 0.0f;
}

/* Draws where the walk goes on; false where it ends. */
static bool scatter(const view *v, walk *w, const surface *s, bool from_light)
{
    heuristic h = v->settings.heuristic;
    if (w->edges >= EDGES_MAX || !survives(w, s))
        return false;
    if (material_is_specular(s->material)) {
        specular_branch b;
        if (!material_specular_sample(s, &w->random, &w->throughput, &b))
            return false;
        w->direction = b.wi;
        if (from_light) /* radiance of eye paths is that over eta^2, which glass does not change; flux pays for it */
            w->throughput = v3_scale(w->throughput, adjoint_correction(s, b.wi) / (b.eta * b.eta));
        w->mis = mis_scatter_specular(h, w->mis, fabsf(v3_dot(b.wi, s->geometric_normal)));
    } else {
        float pdf, u1 = rng_float(&w->random), u2 = rng_float(&w->random), u3 = rng_float(&w->random);
        rgb weight = material_sample(s, u1, u2, u3, &w->direction, &pdf);
        if (!(pdf > 0.0f))
            return false;
        if (from_light)
            weight = v3_scale(weight, adjoint_correction(s, w->direction));
        w->throughput = v3_mul(w->throughput, weight);
        w->mis = mis_scatter(h, w->mis, pdf, reverse_pdf(s, w->direction), v3_dot(w->direction, s->geometric_normal));
    }
    w->origin = surface_offset(s, w->direction);
    return v3_max_component(w->throughput) > 0.0f;
}

bool strategy_wanted(const settings *f, int edges, int light_vertices)
{
    return (f->edges == 0 || f->edges == edges) && (f->light_vertices < 0 || f->light_vertices == light_vertices);
}

/* s = 0: the eye path has met light of density `direct` and `ray`, had it begun there. */
static void meet(const view *v, batch *b, const walk *w, rgb radiance, float direct, float ray)
{
    const settings *f = &v->settings;
    if (!strategy_wanted(f, w->edges, 0) || !(v3_max_component(radiance) > 0.0f))
        return;
    double weight = 1.0;
    if (w->edges > 1 && f->light_vertices < 0 && direct > 0.0f)
        weight = 1.0 / (1.0 + f->partners * mis_side(f->heuristic, w->mis, direct, ray / direct));
    rgb *to = b->eye.count[w->path] > 0 ? &b->found[w->path] : &b->seen[w->path];
    *to = v3_mad(*to, (float)weight, v3_mul(w->throughput, radiance));
}

static void push(side *to, const walk *w, const surface *s)
{
    to->of[w->path][to->count[w->path]++] = (uint16_t)to->total;
    to->vertices[to->total++] = (vertex){.surface = *s,
                                         .origin = surface_offset(s, s->geometric_normal),
                                         .throughput = w->throughput,
                                         .mis = w->mis,
                                         .edges = w->edges};
}

/* The ray of a walk has met a surface; false where the walk ends there. */
static bool arrive(const view *v, batch *b, walk *w, const surface *s, bool from_light)
{
    float cosine = fabsf(v3_dot(s->wo, s->geometric_normal));
    if (!(cosine > 0.0f))
        return false;
    w->edges++;
    w->mis = mis_arrive(v->settings.heuristic, w->mis, w->from_infinity ? 1.0 : s->distance, cosine);
    if (!from_light && w->edges == 1) {
        b->depth[w->path] = s->distance;
        b->normal[w->path] = s->normal;
    }
    if (!from_light) {
        float direct = 0.0f, ray = 0.0f;
        rgb emission = surface_emission(s);
        if (v3_max_component(emission) > 0.0f && v->lights)
            light_sources_emitter_pdf(v->lights, s, &direct, &ray);
        meet(v, b, w, emission, direct, ray);
    }
    w->from_infinity = false;
    if (!material_is_specular(s->material))
        push(from_light ? &b->light : &b->eye, w, s);
    return scatter(v, w, s, from_light);
}

static void leave(const view *v, batch *b, walk *w)
{
    const environment *sky = v->scene->environment;
    float direct = 0.0f, ray = 0.0f;
    if (!sky)
        return;
    if (v->lights)
        light_sources_environment_pdf(v->lights, w->direction, &direct, &ray);
    w->edges++;
    meet(v, b, w, environment_radiance(sky, w->direction), direct, ray);
}

/* Walks on until all have ended. */
static void run(const view *v, batch *b, walk *walks, uint32_t count, bool from_light)
{
    ray_packet p;
    surface hits[TRACER_PACKET];
    packet_init(&p);
    for (int i = 0; i < TRACER_PACKET; i++)
        p.tfar[i] = INFINITY;
    for (bool primary = !from_light; count > 0; primary = false) { /* rays of the camera are coherent */
        uint32_t left = 0;
        for (uint32_t first = 0; first < count; first += TRACER_PACKET) {
            uint32_t n = count - first < TRACER_PACKET ? count - first : TRACER_PACKET;
            for (uint32_t i = 0; i < n; i++) {
                const walk *w = &walks[first + i];
                p.org_x[i] = w->origin.x, p.org_y[i] = w->origin.y, p.org_z[i] = w->origin.z;
                p.dir_x[i] = w->direction.x, p.dir_y[i] = w->direction.y, p.dir_z[i] = w->direction.z;
            }
            uint32_t hit = tracer_closest16(v->tracer, &p, (1u << n) - 1u, primary, hits);
            for (uint32_t i = 0; i < n; i++) {
                walk *w = &walks[first + i];
                if (!(hit >> i & 1u)) {
                    if (!from_light)
                        leave(v, b, w);
                } else if (arrive(v, b, w, &hits[i], from_light)) {
                    walks[left++] = *w;
                }
            }
        }
        count = left;
    }
}

/* Paths of a pixel are spread over it (sobol.h). */
static void begin_eye(const view *v, const batch *b, uint32_t i, walk *w)
{
    const settings *f = &v->settings;
    double pixels = (double)f->width * f->height;
    rng seeds = rng_make(f->seed, (uint64_t)b->y[i] * f->width + b->x[i]);
    uint32_t seed_x = rng_u32(&seeds), seed_y = rng_u32(&seeds);
    float dx = sobol_float(sobol_scramble(sobol_reverse(b->pass), seed_x));
    float dy = sobol_float(sobol_scramble(sobol_second(b->pass), seed_y));
    float cosine;
    *w = (walk){.path = i, .origin = v->camera.eye, .throughput = {1, 1, 1}};
    w->direction = camera_direction(&v->camera, (float)b->x[i] + dx, (float)b->y[i] + dy, &cosine);
    w->random = rng_make(f->seed ^ 0x657965u, b->random[i]);
    float pdf = camera_pixel_pdf(&v->camera, cosine);
    w->mis = mis_camera(f->heuristic, pixels, pdf, f->partners);
}

static bool begin_light(const view *v, batch *b, uint32_t i, walk *w)
{
    rng r = rng_make(v->settings.seed ^ 0x6c69676874u, b->random[i]);
    float u[6];
    for (int k = 0; k < 6; k++)
        u[k] = rng_float(&r);
    light_emission *e = &b->start[i];
    b->lit[i] = v->lights && light_sources_emit(v->lights, u, e);
    if (!b->lit[i]) {
        b->dark += v->lights && !light_sources_finite(v->lights);
        return false;
    }
    bool met = e->kind == SOURCE_EMITTER || e->kind == SOURCE_ENVIRONMENT;
    *w = (walk){.path = i, .origin = e->origin, .direction = e->direction, .throughput = e->flux, .random = r};
    w->mis = mis_light(v->settings.heuristic, e->pdf_direct, e->pdf_ray, met ? e->cosine : 0.0f, v->settings.partners);
    w->from_infinity = e->kind == SOURCE_DIRECTIONAL || e->kind == SOURCE_ENVIRONMENT;
    return true;
}

void subpaths(const view *v, batch *b)
{
    walk walks[BATCH];
    uint32_t wanted = (uint32_t)v->settings.partners;
    b->partners = wanted < b->count ? wanted : b->count;
    b->eye.total = b->light.total = 0;
    for (uint32_t i = 0; i < b->count; i++) {
        b->eye.count[i] = b->light.count[i] = 0;
        b->found[i] = b->seen[i] = b->normal[i] = v3(0, 0, 0);
        b->depth[i] = 0.0f;
        begin_eye(v, b, i, &walks[i]);
    }
    run(v, b, walks, b->count, false);
    uint32_t count = 0;
    for (uint32_t i = 0; i < b->count; i++)
        count += begin_light(v, b, i, &walks[count]);
    run(v, b, walks, count, true);
}
