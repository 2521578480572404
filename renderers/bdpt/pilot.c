/* SPDX-License-Identifier: Apache-2.0 */
#include "pilot.h"

#include "../common/parallel.h"

#include <stdlib.h>
#include <string.h>

enum {
    LIGHT_BATCHES = 64,    /* enough for the light of a region */
    LIGHT_FEWEST = 8,      /* too few to tell anything */
    LIGHT_PIXELS = 256,    /* a batch each: small images must not wait for their pilot paths */
    DENSITY_BATCHES = 256, /* enough for the octrees */
    REGIONS = PILOT_REGIONS * PILOT_REGIONS
};

/* The roulette of what is below this share of a region's light costs less in noise than it saves (docs/bdpt.md). */
static const float share_kept = 0.1f;

/* What one batch has found. Batches are merged in their order, whichever thread took them. */
typedef struct trip {
    vec3 *eyes, *lights; /* vertices, where densities are wanted */
    uint32_t eye_count, light_count;
    struct sample *samples; /* connections, where light is measured */
    size_t sample_count;
    float light[REGIONS], paths[REGIONS];
} trip;

/* ------------------------------------------------------------------------------------------------------ densities */

/* y_0 on an emitter is a vertex as well. */
static void collect(trip *t, const batch *b)
{
    t->eyes = xmalloc((b->eye.total + 1) * sizeof(vec3));
    t->lights = xmalloc((b->light.total + b->count) * sizeof(vec3));
    for (uint32_t i = 0; i < b->eye.total; i++)
        t->eyes[t->eye_count++] = b->eye.vertices[i].origin;
    for (uint32_t i = 0; i < b->light.total; i++)
        t->lights[t->light_count++] = b->light.vertices[i].origin;
    for (uint32_t i = 0; i < b->count; i++)
        if (b->lit[i] && b->start[i].kind == SOURCE_EMITTER)
            t->lights[t->light_count++] = b->start[i].origin;
}

/* --------------------------------------------------------------------------------------------------- light by region
 */

typedef struct sample {
    float value; /* of a connection; where nothing is in between */
    uint16_t region;
    bool visible;
} sample;

/* What one thread needs. */
typedef struct station {
    batch *batch;
    connections connections;
    connection_visibility *visibility;
} station;

/* What is seen directly is left out: connections add nothing there. */
static void measure(const view *v, station *s, trip *t)
{
    const settings *f = &v->settings;
    const batch *b = s->batch;
    connections *c = &s->connections;
    connect_batch(v, b, true, c);
    t->samples = xmalloc((c->count + 1) * sizeof *t->samples);
    for (size_t i = 0; i < c->count; i++)
        t->samples[i].value = luminance(c->items[i].value);
    connection_visibility_prepare(s->visibility, b, c);
    connection_visibility_finish(s->visibility, b, c);
    for (uint32_t i = 0; i < b->count; i++) {
        uint32_t r = pilot_region(f, b->y[i] * f->width + b->x[i]);
        t->paths[r] += 1.0f;
        t->light[r] += luminance(b->found[i]);
    }
    for (size_t i = 0; i < c->count; i++) {
        const connection *x = &c->items[i];
        float seen = luminance(x->value);
        sample found = {t->samples[i].value, (uint16_t)pilot_region(f, x->pixel), seen > 0.0f};
        t->light[found.region] += seen;
        if (x->kind != CONNECT_CAMERA)
            t->samples[t->sample_count++] = found;
    }
}

static void conclude(pilot *p, const trip *trips, uint32_t count)
{
    double visible = 0.0, surviving = 0.0;
    for (int r = 0; r < REGIONS; r++) {
        float all = 0.0f, paths = 0.0f;
        for (uint32_t k = 0; k < count; k++)
            all += trips[k].light[r], paths += trips[k].paths[r];
        float least = share_kept * all / paths;
        p->least[r] = least < INFINITY ? least : 0.0f; /* nor NaN */
    }
    for (uint32_t k = 0; k < count; k++)
        for (size_t i = 0; i < trips[k].sample_count; i++) {
            const sample *s = &trips[k].samples[i];
            float least = p->least[s->region];
            visible += s->visible;
            surviving += s->value < least ? (double)(s->value / least) : 1.0;
        }
    p->visibility_first = visible < surviving;
}

/* ------------------------------------------------------------------------------------------------------------------ */

typedef struct flight {
    const view *v;
    uint32_t count, measured; /* batches; of them: whose light is measured */
    bool densities;
    station *stations;
    trip *trips;
    pilot *out;
} flight;

static void draw(const view *v, uint32_t index, batch *b)
{
    const settings *f = &v->settings;
    rng r = rng_make(f->seed ^ 0x70696c6f74u, index);
    b->pass = index;
    b->count = BATCH;
    for (uint32_t i = 0; i < BATCH; i++) {
        b->x[i] = (uint32_t)((uint64_t)rng_u32(&r) * f->width >> 32);
        b->y[i] = (uint32_t)((uint64_t)rng_u32(&r) * f->height >> 32);
        b->random[i] = UINT64_MAX - (uint64_t)index * BATCH - i;
    }
    subpaths(v, b);
}

static void fly(void *context, int thread, size_t index)
{
    flight *f = context;
    station *s = &f->stations[thread];
    trip *t = &f->trips[index];
    tracer_thread_init();
    if (!s->batch) {
        s->batch = batch_new();
        s->visibility = connection_visibility_new(f->v, NULL);
    }
    draw(f->v, (uint32_t)index, s->batch);
    if (index < f->measured)
        measure(f->v, s, t);
    if (f->densities)
        collect(t, s->batch);
}

/* Of eye paths (0) or of light paths (1). */
static void map_densities(void *context, int thread, size_t which)
{
    flight *f = context;
    (void)thread;
    size_t total = 0;
    for (uint32_t k = 0; k < f->count; k++)
        total += which ? f->trips[k].light_count : f->trips[k].eye_count;
    vec3 *all = xmalloc((total + 1) * sizeof *all);
    total = 0;
    for (uint32_t k = 0; k < f->count; k++) {
        const trip *t = &f->trips[k];
        uint32_t n = which ? t->light_count : t->eye_count;
        if (n > 0)
            memcpy(all + total, which ? t->lights : t->eyes, n * sizeof *all);
        total += n;
    }
    const scene *s = f->v->scene;
    vec3 size = v3_sub(s->bounds_max, s->bounds_min);
    density_map *m = density_map_new(all, (uint32_t)total, f->count * BATCH, v3_mad(s->bounds_min, 0.5f, size),
                                     0.5f * v3_max_component(size));
    *(which ? &f->out->light_density : &f->out->eye_density) = m;
    free(all);
}

pilot *pilot_new(const view *given, bool densities)
{
    view plain = *given;
    plain.pilot = NULL;
    plain.settings.visibility = VISIBILITY_EXACT;
    int threads = parallel_thread_count(given->settings.threads);
    uint64_t wanted = (uint64_t)given->settings.width * given->settings.height / LIGHT_PIXELS;
    wanted = wanted < LIGHT_FEWEST ? 0 : wanted < LIGHT_BATCHES ? wanted : LIGHT_BATCHES;
    pilot *p = xcalloc(1, sizeof *p);
    flight f = {.v = &plain,
                .count = densities ? DENSITY_BATCHES : (uint32_t)wanted,
                .measured = (uint32_t)wanted,
                .densities = densities,
                .stations = xcalloc((size_t)threads, sizeof *f.stations),
                .out = p};
    f.trips = xcalloc(f.count + 1, sizeof *f.trips);
    parallel_for(threads, f.count, fly, &f);
    conclude(p, f.trips, f.measured);
    if (densities)
        parallel_for(threads, 2, map_densities, &f);
    for (uint32_t k = 0; k < f.count; k++) {
        free(f.trips[k].eyes);
        free(f.trips[k].lights);
        free(f.trips[k].samples);
    }
    for (int i = 0; i < threads; i++)
        if (f.stations[i].batch) {
            batch_free(f.stations[i].batch);
            free(f.stations[i].connections.items);
            connection_visibility_free(f.stations[i].visibility);
        }
    free(f.trips);
    free(f.stations);
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
