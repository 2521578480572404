/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Virtual point lights (Keller 1997), resampled by what they bring to the camera (Segovia et al. 2006).
 *
 * Light paths leave vertices ("candidates") on diffuse surfaces. A candidate j is kept with probability
 * pi_j = min(1, lambda w_j), where w_j is its contribution to a few eye samples, visibility included, plus a small
 * share so that none is ruled out; lambda makes the sum of pi the number wanted. Kept ones weigh 1 / pi_j, so the sum
 * over the kept has the expected value of the sum over all.
 */
#include "whitted.h"

#include "../common/camera.h"
#include "../common/light_sources.h"
#include "../common/parallel.h"

#include <float.h>
#include <math.h>
#include <string.h>

enum {
    PILOTS = 32,      /* eye samples that candidates are weighed at */
    QUICK_PILOTS = 4, /* a candidate that none of these sees gets the smallest weight: most lie behind walls */
    BLOCK = 64,       /* light paths a task */
    DEPTH_MAX = 12,
    NEIGHBOURS = 8 /* for the density */
};

/* Squared distances are clamped to (0.05 B_R)^2 in the geometric term: without it a virtual point light next to an eye
 * sample leaves a bright spot. What it takes away is light exchanged between surfaces closer than that. */
static const float clamp_radius = 0.05f;
static const float floor_share = 0.05f; /* of the weight, spread evenly over all candidates */

typedef struct candidate {
    vec3 position, normal, geometric;
    rgb power; /* W / sr along the normal */
    float weight;
    uint64_t code; /* Morton code of the position */
} candidate;

typedef struct candidates {
    candidate *items;
    size_t count, capacity;
} candidates;

typedef struct job {
    const view *v;
    eye_sample pilots[PILOTS];
    int pilot_count;
    float clamp;
    uint64_t first_path;
    candidates *blocks;
    light_sources *sources; /* NULL: nothing emits */
} job;

static void push(candidates *c, candidate item)
{
    if (c->count == c->capacity) {
        c->capacity = c->capacity ? 2 * c->capacity : 64;
        c->items = xrealloc(c->items, c->capacity * sizeof *c->items);
    }
    c->items[c->count++] = item;
}

static uint64_t seed_of(const view *v)
{
    return v->settings.seed + (uint64_t)v->settings.vpl_draw * 0x9e3779b97f4a7c15u;
}

/* ------------------------------------------------------------------------------------------------- eye samples */

/* One eye path through a random point of the image; specular surfaces choose one branch by its weight. */
static bool pilot(const view *v, uint64_t index, eye_sample *out)
{
    rng r = rng_make(seed_of(v) ^ 0x70696c6f74u, index);
    camera_frame f = camera_frame_of(&v->camera, v->settings.width, v->settings.height);
    float across = (rng_float(&r) - 0.5f) * f.plane_width, along = (rng_float(&r) - 0.5f) * f.plane_height, distance;
    vec3 o = f.eye, d = camera_plane_direction(&f, across, along, &distance);
    rgb weight = {1, 1, 1};
    for (int depth = 0; depth < DEPTH_MAX; depth++) {
        surface s;
        if (!tracer_closest(v->tracer, o, d, &s))
            return false;
        if (!material_is_specular(s.material)) {
            *out = (eye_sample){.surface = s, .origin = surface_offset(&s, s.geometric_normal), .weight = weight};
            return material_reflectance(&s) > 0.0f;
        }
        specular_branch b;
        if (!material_specular_sample(&s, &r, &weight, &b))
            return false;
        o = surface_offset(&s, b.wi);
        d = b.wi;
    }
    return false;
}

/* Contribution to pilot i, with visibility. */
static float contribution(const job *j, const candidate *c, int i)
{
    const eye_sample *e = &j->pilots[i];
    vec3 d = v3_sub(c->position, e->origin);
    float r2 = v3_dot(d, d), eye = v3_dot(e->surface.normal, d), away = -v3_dot(c->normal, d);
    if (!(eye > 0.0f) || !(away > 0.0f) || !(v3_dot(e->surface.geometric_normal, d) > 0.0f))
        return 0.0f;
    rgb f = v3_mul(material_eval(&e->surface, v3_normalize(d)), v3_mul(e->weight, c->power));
    float value = luminance(f) * eye * away / (r2 * fmaxf(r2, j->clamp));
    if (!(value > 0.0f) || tracer_occluded(j->v->tracer, e->origin, d, 1.0f))
        return 0.0f;
    return value;
}

static float weigh(const job *j, const candidate *c)
{
    float sum = 0.0f;
    for (int i = 0; i < j->pilot_count; i++) {
        if (i == QUICK_PILOTS && !(sum > 0.0f))
            return 0.0f;
        sum += contribution(j, c, i);
    }
    return sum;
}

/* ------------------------------------------------------------------------------------------------- light paths */

static void light_path(const job *j, uint64_t index, candidates *out)
{
    rng r = rng_make(seed_of(j->v) ^ 0x76706cu, index);
    float u[6];
    for (int i = 0; i < 6; i++)
        u[i] = rng_float(&r);
    light_emission y;
    if (!light_sources_emit(j->sources, u, &y))
        return;
    vec3 o = y.origin, d = y.direction;
    rgb flux = y.flux;
    for (int depth = 0; depth < DEPTH_MAX && v3_max_component(flux) > 0.0f; depth++) {
        surface s;
        if (!tracer_closest(j->v->tracer, o, d, &s))
            return;
        rgb albedo = material_diffuse_albedo(&s);
        if (v3_max_component(albedo) > 0.0f) {
            candidate c = {.position = surface_offset(&s, s.geometric_normal),
                           .normal = s.normal,
                           .geometric = s.geometric_normal,
                           .power = v3_scale(v3_mul(flux, albedo), 1.0f / PI_F)};
            c.weight = weigh(j, &c);
            push(out, c);
        }
        float survive = fminf(0.95f, material_reflectance(&s));
        if (!(rng_float(&r) < survive))
            return;
        flux = v3_scale(flux, 1.0f / survive);
        if (material_is_specular(s.material)) {
            specular_branch b;
            if (!material_specular_sample(&s, &r, &flux, &b))
                return;
            d = b.wi;
            flux = v3_scale(flux, 1.0f / (b.eta * b.eta)); /* as radiance of eye paths is that over eta^2 */
        } else {
            float pdf, u1 = rng_float(&r), u2 = rng_float(&r), u3 = rng_float(&r);
            rgb weight = material_sample(&s, u1, u2, u3, &d, &pdf);
            if (!(pdf > 0.0f))
                return;
            flux = v3_mul(flux, weight);
        }
        o = surface_offset(&s, d);
    }
}

static void trace_block(void *context, int thread, size_t index)
{
    (void)thread;
    job *j = context;
    tracer_thread_init();
    for (uint64_t i = 0; i < BLOCK; i++)
        light_path(j, j->first_path + index * BLOCK + i, &j->blocks[index]);
}

/* Paths in rounds until enough candidates are seen by the camera; their number does not depend on threads. */
static candidates trace_candidates(job *j, uint32_t wanted, uint64_t *paths)
{
    candidates all = {0};
    size_t blocks = (wanted + BLOCK - 1) / BLOCK + 4, seen = 0;
    uint64_t limit = (uint64_t)256 * wanted + 65536;
    *paths = 0;
    while (j->sources && seen < 6 * (size_t)wanted && *paths < limit) {
        j->blocks = xcalloc(blocks, sizeof *j->blocks);
        j->first_path = *paths;
        parallel_for(j->v->settings.threads, blocks, trace_block, j);
        for (size_t b = 0; b < blocks; b++) {
            for (size_t i = 0; i < j->blocks[b].count; i++) {
                push(&all, j->blocks[b].items[i]);
                seen += j->blocks[b].items[i].weight > 0.0f;
            }
            free(j->blocks[b].items);
        }
        free(j->blocks);
        *paths += blocks * BLOCK;
        blocks *= 2;
    }
    return all;
}

/* -------------------------------------------------------------------------------------------------- resampling */

/* lambda with sum min(1, lambda w) = wanted: those that reach 1 drop out until nothing changes. */
static double find_lambda(const candidates *c, double wanted)
{
    double lambda = 0.0;
    for (int round = 0; round < 64; round++) {
        double sum = 0.0, capped = 0.0;
        for (size_t i = 0; i < c->count; i++) {
            if (lambda * c->items[i].weight >= 1.0)
                capped += 1.0;
            else
                sum += c->items[i].weight;
        }
        double next = sum > 0.0 ? (wanted - capped) / sum : lambda;
        if (!(next > lambda))
            break;
        lambda = next;
    }
    return lambda;
}

/* Systematic sampling: one random offset, steps of one. Moves the kept to the front. */
static void resample(candidates *c, uint32_t wanted, uint64_t seed)
{
    double sum = 0.0;
    for (size_t i = 0; i < c->count; i++)
        sum += c->items[i].weight;
    if (c->count <= wanted)
        return;
    float share = sum > 0.0 ? (float)(floor_share * sum / (double)c->count) : 1.0f;
    for (size_t i = 0; i < c->count; i++)
        c->items[i].weight += share;
    double lambda = find_lambda(c, wanted);
    rng r = rng_make(seed ^ 0x726573616d706c65u, 0);
    double at = 0.0, next = rng_float(&r);
    size_t kept = 0;
    for (size_t i = 0; i < c->count && kept < wanted; i++) {
        double pi = fmin(1.0, lambda * c->items[i].weight);
        at += pi;
        if (at > next) {
            c->items[kept] = c->items[i];
            c->items[kept].power = v3_scale(c->items[i].power, (float)(1.0 / pi));
            kept++;
            next += 1.0;
        }
    }
    c->count = kept;
}

/* Density of the *resampled* lights per unit area: by the distance to the k-th nearest of like orientation,
 * (k - 1) / (pi r^2), which is unbiased where they are spread evenly. Their own sampling density is not known in closed
 * form: it has been through bounces and the choice by contribution. */
typedef struct density_job {
    vpl_set *lights;
} density_job;

static void estimate_density(void *context, int thread, size_t index)
{
    (void)thread;
    vpl_set *l = ((density_job *)context)->lights;
    float nearest[NEIGHBOURS];
    for (int k = 0; k < NEIGHBOURS; k++)
        nearest[k] = INFINITY;
    for (uint32_t i = 0; i < l->count; i++) {
        float x = l->x[i] - l->x[index], y = l->y[i] - l->y[index], z = l->z[i] - l->z[index];
        float r2 = x * x + y * y + z * z;
        if (i == index || !(r2 < nearest[NEIGHBOURS - 1]))
            continue;
        if (l->nx[i] * l->nx[index] + l->ny[i] * l->ny[index] + l->nz[i] * l->nz[index] < 0.7f)
            continue;
        int k = NEIGHBOURS - 1;
        for (; k > 0 && nearest[k - 1] > r2; k--)
            nearest[k] = nearest[k - 1];
        nearest[k] = r2;
    }
    int k = NEIGHBOURS;
    while (k > 0 && !isfinite(nearest[k - 1]))
        k--;
    /* fewer than two of its kind: it shares its cell with none */
    l->density[index] = k > 1 && nearest[k - 1] > 0.0f ? (float)(k - 1) / (PI_F * nearest[k - 1]) : INFINITY;
}

/* Lights in a row are neighbours: what is drawn or traced in their order is spread over the scene, or coherent. */
static int by_code(const void *a, const void *b)
{
    const candidate *x = a, *y = b;
    return (x->code > y->code) - (x->code < y->code);
}

static uint64_t spread3(uint64_t x) /* 21 bits, two zeros between each */
{
    x = (x | x << 32) & 0x1f00000000ffffu;
    x = (x | x << 16) & 0x1f0000ff0000ffu;
    x = (x | x << 8) & 0x100f00f00f00f00fu;
    x = (x | x << 4) & 0x10c30c30c30c30c3u;
    return (x | x << 2) & 0x1249249249249249u;
}

static void sort_by_place(candidates *c, vec3 low, vec3 size)
{
    float scale = 0x1p20f / fmaxf(v3_max_component(size), FLT_MIN);
    for (size_t i = 0; i < c->count; i++) {
        vec3 p = v3_scale(v3_sub(c->items[i].position, low), scale);
        uint64_t cell[3] = {(uint64_t)fmaxf(p.x, 0.0f), (uint64_t)fmaxf(p.y, 0.0f), (uint64_t)fmaxf(p.z, 0.0f)};
        c->items[i].code =
            spread3(cell[0] & 0x1fffff) | spread3(cell[1] & 0x1fffff) << 1 | spread3(cell[2] & 0x1fffff) << 2;
    }
    if (c->count > 1)
        qsort(c->items, c->count, sizeof *c->items, by_code);
}

static vpl_set pack(const candidates *c, uint64_t paths, float clamp)
{
    vpl_set l = {.count = (uint32_t)c->count, .clamp = clamp};
    l.padded = (l.count + 63) / 64 * 64;
    float **arrays[] = {&l.x,  &l.y,  &l.z, &l.nx, &l.ny, &l.nz,        &l.gx,
                        &l.gy, &l.gz, &l.r, &l.g,  &l.b,  &l.luminance, &l.density};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = floats_new(l.padded);
    for (uint32_t i = 0; i < l.count; i++) {
        const candidate *k = &c->items[i];
        l.x[i] = k->position.x, l.y[i] = k->position.y, l.z[i] = k->position.z;
        l.nx[i] = k->normal.x, l.ny[i] = k->normal.y, l.nz[i] = k->normal.z;
        l.gx[i] = k->geometric.x, l.gy[i] = k->geometric.y, l.gz[i] = k->geometric.z;
        rgb power = v3_scale(k->power, 1.0f / (float)paths);
        l.r[i] = power.x, l.g[i] = power.y, l.b[i] = power.z;
        l.luminance[i] = luminance(power);
    }
    return l;
}

vpl_set vpls_new(const view *v)
{
    job j = {.v = v};
    vec3 size = v3_sub(v->scene->bounds_max, v->scene->bounds_min);
    float radius = 0.5f * v3_length(size);
    j.clamp = clamp_radius * clamp_radius * radius * radius;
    candidates all = {0};
    uint64_t paths = 1;
    uint32_t wanted = (uint32_t)v->settings.vpls;
    if (wanted > 0) {
        tracer_thread_init();
        for (uint64_t i = 0; i < 16 * PILOTS && j.pilot_count < PILOTS; i++)
            j.pilot_count += pilot(v, i, &j.pilots[j.pilot_count]);
        /* where the environment is directional lights, these emit in its place */
        j.sources = light_sources_new(v->scene, v->emitters, !v->settings.env_lights);
        if (j.pilot_count > 0)
            all = trace_candidates(&j, wanted, &paths);
        light_sources_free(j.sources);
        resample(&all, wanted, seed_of(v));
        sort_by_place(&all, v->scene->bounds_min, size);
    }
    vpl_set l = pack(&all, paths > 0 ? paths : 1, j.clamp);
    free(all.items);
    density_job d = {&l};
    parallel_for(v->settings.threads, l.count, estimate_density, &d);
    return l;
}

const vpl_set vpls_none = {0};

void vpls_free(vpl_set *l)
{
    float *arrays[] = {l->x,  l->y,  l->z, l->nx, l->ny, l->nz,        l->gx,
                       l->gy, l->gz, l->r, l->g,  l->b,  l->luminance, l->density};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        free(arrays[i]);
    memset(l, 0, sizeof *l);
}
