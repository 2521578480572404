/* SPDX-License-Identifier: Apache-2.0 */
#include "pilot.h"
#include "prepared.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Of one kind. */
typedef struct ends {
    char *memory;
    size_t stride;
    bool ready[BATCH * (EDGES_MAX + 1)];
} ends;

struct prepared {
    const view *v;
    const vcache *cache;
    ends eye_vertices, light_vertices; /* Eq. 6 */
    ends eyes[2], lights;              /* Eq. 7, 9; of other lights and of the sky; lights: one a path */
};

static void ends_new(ends *e, size_t count, size_t stride)
{
    e->stride = stride;
    e->memory = xcalloc(count, stride);
}

prepared *prepared_new(const view *v, const vcache *cache)
{
    prepared *o = xcalloc(1, sizeof *o);
    o->v = v;
    o->cache = cache;
    ends_new(&o->eye_vertices, BATCH * EDGES_MAX, vcache_vertex_size());
    ends_new(&o->light_vertices, BATCH * (EDGES_MAX + 1), vcache_vertex_size());
    for (int sky = 0; sky < 2; sky++)
        ends_new(&o->eyes[sky], BATCH * EDGES_MAX, vcache_eye_size(cache, v->settings.ce));
    ends_new(&o->lights, BATCH, vcache_light_size());
    return o;
}

void prepared_free(prepared *o)
{
    if (!o)
        return;
    ends *all[] = {&o->eye_vertices, &o->light_vertices, &o->eyes[0], &o->eyes[1], &o->lights};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        free(all[i]->memory);
    free(o);
}

void prepared_forget(prepared *o)
{
    ends *all[] = {&o->eye_vertices, &o->light_vertices, &o->eyes[0], &o->eyes[1], &o->lights};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        memset(all[i]->ready, 0, sizeof all[i]->ready);
}

static void store(float out[3], vec3 p)
{
    out[0] = p.x, out[1] = p.y, out[2] = p.z;
}

static vcache_surface surface_end(vec3 position, vec3 normal, const density_map *density)
{
    vcache_surface s = {.density = density_at(density, position)};
    store(s.position, position);
    store(s.normal, normal);
    return s;
}

static float paths(const settings *f)
{
    return (float)f->width * (float)f->height * (float)f->epoch * (float)f->partners;
}

/* What stands for Eq. 6 where the light's end is a direction (Eq. 9) or a single light (Eq. 7): sqrt(N_P) / C_E cells
 * on either side give the C_E^2 connections per pair of cells. */
static float sides(const settings *f)
{
    return float_max(1.0f, sqrtf(paths(f)) / f->ce);
}

static void *slot(ends *e, uint32_t index, bool *fresh)
{
    *fresh = !e->ready[index];
    e->ready[index] = true;
    return e->memory + index * e->stride;
}

/* y_0 behind all others. */
static uint32_t light_index(const connection *c)
{
    return c->light >= 0 ? (uint32_t)c->light : BATCH * EDGES_MAX + c->path;
}

void prepared_prefetch_vertices(const prepared *o, const batch *b, const connection *c)
{
    const pilot *p = o->v->pilot;
    if (!o->eye_vertices.ready[c->eye])
        density_prefetch(p->eye_density, b->eye.vertices[c->eye].origin);
    if (!o->light_vertices.ready[light_index(c)])
        density_prefetch(p->light_density,
                         c->light >= 0 ? b->light.vertices[c->light].origin : b->start[c->path].origin);
}

const vcache_vertex *prepared_eye_vertex(prepared *o, const batch *b, const connection *c)
{
    bool fresh;
    void *at = slot(&o->eye_vertices, (uint32_t)c->eye, &fresh);
    if (fresh) {
        const vertex *z = &b->eye.vertices[c->eye];
        vcache_surface s = surface_end(z->origin, z->surface.geometric_normal, o->v->pilot->eye_density);
        vcache_prepare_eye_vertex(o->cache, &s, o->v->settings.ce, paths(&o->v->settings), 0, at);
    }
    return at;
}

const vcache_vertex *prepared_light_vertex(prepared *o, const batch *b, const connection *c)
{
    bool fresh;
    void *at = slot(&o->light_vertices, light_index(c), &fresh);
    if (fresh) {
        const light_emission *y0 = &b->start[c->path];
        const vertex *y = c->light >= 0 ? &b->light.vertices[c->light] : NULL;
        const density_map *density = o->v->pilot->light_density;
        vcache_surface s = y ? surface_end(y->origin, y->surface.geometric_normal, density)
                             : surface_end(y0->origin, y0->normal, density);
        vcache_prepare_light_vertex(o->cache, &s, at);
    }
    return at;
}

bool prepared_sky(const batch *b, const connection *c)
{
    return b->start[c->path].kind == SOURCE_ENVIRONMENT;
}

const vcache_eye *prepared_eye_end(prepared *o, const batch *b, const connection *c)
{
    bool fresh;
    bool sky = prepared_sky(b, c);
    void *at = slot(&o->eyes[sky], (uint32_t)c->eye, &fresh);
    if (fresh) {
        const settings *f = &o->v->settings;
        const vertex *z = &b->eye.vertices[c->eye];
        float count = paths(f);
        if (sky)
            count /= sides(f);
        vcache_surface s = surface_end(z->origin, z->surface.geometric_normal, o->v->pilot->eye_density);
        s.density *= count;
        vcache_prepare_eye(o->cache, &s, f->ce, 0, at);
    }
    return at;
}

const vcache_light *prepared_light_end(prepared *o, const batch *b, const connection *c)
{
    bool fresh;
    void *at = slot(&o->lights, c->path, &fresh);
    if (fresh) {
        const light_emission *y0 = &b->start[c->path];
        float to[3];
        store(to, y0->kind == SOURCE_POINT ? y0->position : v3_neg(y0->direction));
        if (y0->kind == SOURCE_POINT)
            vcache_prepare_point(o->cache, to, 0, at);
        else if (y0->kind == SOURCE_DIRECTIONAL)
            vcache_prepare_direction(o->cache, to, 0, at);
        else
            vcache_prepare_solid_angle(o->cache, to, y0->pdf_direct * sides(&o->v->settings), 0, at);
    }
    return at;
}

const vcache_eye *prepared_eye(const prepared *o, bool sky, uint32_t eye)
{
    return (const vcache_eye *)(const void *)(o->eyes[sky].memory + eye * o->eyes[sky].stride);
}

const vcache_light *prepared_lights(const prepared *o)
{
    return (const vcache_light *)(const void *)o->lights.memory;
}
