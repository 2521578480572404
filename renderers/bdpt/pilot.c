/* SPDX-License-Identifier: Apache-2.0 */
#include "pilot.h"

#include "../common/interrupt.h"

#include <stdlib.h>

enum {
    LIGHT_BATCHES = 64,    /* enough for the light of a region */
    LIGHT_FEWEST = 8,      /* too few to tell anything */
    LIGHT_PIXELS = 256,    /* a batch each: small images must not wait for their pilot paths */
    DENSITY_BATCHES = 256, /* enough for the octrees */
    REGIONS = PILOT_REGIONS * PILOT_REGIONS
};

/* The roulette of what is below this share of a region's light costs less in noise than it saves (docs/bdpt.md). */
static const float share_kept = 0.1f;

/* ------------------------------------------------------------------------------------------------------ densities */

typedef struct points {
    vec3 *items;
    uint32_t count;
} points;

/* y_0 on an emitter is a vertex as well. */
static void collect(points *eyes, points *lights, const batch *b)
{
    for (uint32_t i = 0; i < b->eye.total; i++)
        eyes->items[eyes->count++] = b->eye.vertices[i].origin;
    for (uint32_t i = 0; i < b->light.total; i++)
        lights->items[lights->count++] = b->light.vertices[i].origin;
    for (uint32_t i = 0; i < b->count; i++)
        if (b->lit[i] && b->start[i].kind == SOURCE_EMITTER)
            lights->items[lights->count++] = b->start[i].origin;
}

static density_map *map_of(const scene *s, const points *of, uint32_t paths)
{
    vec3 size = v3_sub(s->bounds_max, s->bounds_min);
    vec3 center = v3_mad(s->bounds_min, 0.5f, size);
    return density_map_new(of->items, of->count, paths, center, 0.5f * v3_max_component(size));
}

/* --------------------------------------------------------------------------------------------------- light by region
 */

typedef struct sample {
    float value; /* of a connection; where nothing is in between */
    uint16_t region;
    bool visible;
} sample;

typedef struct light_count {
    connections connections;
    connection_visibility *visibility;
    sample *samples;
    size_t count, capacity;
    float light[REGIONS], paths[REGIONS];
} light_count;

/* What is seen directly is left out: connections add nothing there. */
static void measure(const view *v, const batch *b, light_count *m)
{
    const settings *f = &v->settings;
    connections *c = &m->connections;
    connect_batch(v, b, true, c);
    if (m->count + c->count > m->capacity) {
        m->capacity = 2 * (m->count + c->count);
        m->samples = xrealloc(m->samples, m->capacity * sizeof *m->samples);
    }
    for (size_t i = 0; i < c->count; i++)
        m->samples[m->count + i].value = luminance(c->items[i].value);
    connection_visibility_resolve(m->visibility, b, c);
    for (uint32_t i = 0; i < b->count; i++) {
        uint32_t r = pilot_region(f, b->y[i] * f->width + b->x[i]);
        m->paths[r] += 1.0f;
        m->light[r] += luminance(b->found[i]);
    }
    for (size_t i = 0; i < c->count; i++) {
        sample *s = &m->samples[m->count];
        const connection *x = &c->items[i];
        float seen = luminance(x->value);
        s->region = (uint16_t)pilot_region(f, x->pixel);
        s->visible = seen > 0.0f;
        m->light[s->region] += seen;
        m->count += x->kind != CONNECT_CAMERA;
    }
}

static void conclude(pilot *p, const light_count *m)
{
    double visible = 0.0, surviving = 0.0;
    for (int r = 0; r < REGIONS; r++)
        p->least[r] = m->paths[r] > 0.0f ? share_kept * m->light[r] / m->paths[r] : 0.0f;
    for (size_t i = 0; i < m->count; i++) {
        const sample *s = &m->samples[i];
        float least = p->least[s->region];
        visible += s->visible;
        surviving += s->value < least ? (double)(s->value / least) : 1.0;
    }
    p->visibility_first = visible < surviving;
}

/* ------------------------------------------------------------------------------------------------------------------ */

static void draw(const view *v, rng *r, uint32_t index, batch *b)
{
    const settings *f = &v->settings;
    b->pass = index;
    b->count = BATCH;
    for (uint32_t i = 0; i < BATCH; i++) {
        b->x[i] = (uint32_t)((uint64_t)rng_u32(r) * f->width >> 32);
        b->y[i] = (uint32_t)((uint64_t)rng_u32(r) * f->height >> 32);
        b->random[i] = UINT64_MAX - (uint64_t)index * BATCH - i;
    }
    subpaths(v, b);
}

pilot *pilot_new(const view *given, bool densities)
{
    view plain = *given;
    plain.pilot = NULL;
    plain.settings.visibility = VISIBILITY_EXACT;
    pilot *p = xcalloc(1, sizeof *p);
    batch *b = batch_new();
    uint64_t wanted = (uint64_t)given->settings.width * given->settings.height / LIGHT_PIXELS;
    wanted = wanted < LIGHT_FEWEST ? 0 : wanted < LIGHT_BATCHES ? wanted : LIGHT_BATCHES;
    uint32_t count = densities ? DENSITY_BATCHES : (uint32_t)wanted;
    size_t room = (size_t)count * BATCH * (EDGES_MAX + 1);
    points eyes = {.items = densities ? xmalloc(room * sizeof(vec3)) : NULL};
    points lights = {.items = densities ? xmalloc(room * sizeof(vec3)) : NULL};
    light_count m = {.visibility = connection_visibility_new(&plain, NULL)};
    rng r = rng_make(given->settings.seed, 0x70696c6f74u);
    tracer_thread_init();
    for (uint32_t k = 0; k < count && !interrupted(); k++) {
        draw(&plain, &r, k, b);
        if (k < wanted)
            measure(&plain, b, &m);
        if (densities)
            collect(&eyes, &lights, b);
    }
    conclude(p, &m);
    if (densities) {
        p->eye_density = map_of(given->scene, &eyes, count * BATCH);
        p->light_density = map_of(given->scene, &lights, count * BATCH);
    }
    free(eyes.items);
    free(lights.items);
    free(m.samples);
    free(m.connections.items);
    connection_visibility_free(m.visibility);
    batch_free(b);
    return p;
}

void pilot_free(pilot *p)
{
    if (!p)
        return;
    density_map_free(p->eye_density);
    density_map_free(p->light_density);
    free(p);
}
