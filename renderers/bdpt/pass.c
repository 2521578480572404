/* SPDX-License-Identifier: Apache-2.0 */
/* One pass over the image: an eye and a light sub-path per pixel, on all cores. Which thread takes which tile changes
 * nothing: what light paths bring to other tiles' pixels is kept by tile and summed in their order. */
#include "film.h"
#include "pilot.h"

#include "../common/interrupt.h"
#include "../common/parallel.h"
#include "../../halton/halton.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

/* What one thread needs. */
typedef struct station {
    batch *batch;
    connections connections;
    connection_visibility *visibility;
    double visibility_s;
} station;

typedef struct splat {
    uint32_t pixel;
    rgb value;
} splat;

typedef struct tile {
    uint32_t x, y, width, height;
    splat *splats;
    size_t count, capacity;
} tile;

struct passes {
    const view *v;
    station *stations;
    int threads;
    tile *tiles;
    size_t tile_count;
    film *film;
    image pass, seen; /* what this one adds; of it what is seen directly */
    uint32_t index;
    bool first_hits; /* nothing else */
};

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

passes *passes_new(const view *v, vcache *cache, film *out)
{
    const settings *f = &v->settings;
    passes *p = xcalloc(1, sizeof *p);
    p->v = v;
    p->film = out;
    p->threads = parallel_thread_count(f->threads);
    p->stations = xcalloc((size_t)p->threads, sizeof *p->stations);
    for (int i = 0; i < p->threads; i++) {
        p->stations[i].batch = batch_new();
        p->stations[i].visibility = connection_visibility_new(v, cache);
    }
    uint32_t across = (f->width + TILE - 1) / TILE, down = (f->height + TILE - 1) / TILE;
    p->tile_count = (size_t)across * down;
    p->tiles = xcalloc(p->tile_count, sizeof *p->tiles);
    for (size_t i = 0; i < p->tile_count; i++) {
        tile *t = &p->tiles[i];
        t->x = (uint32_t)(i % across) * TILE, t->y = (uint32_t)(i / across) * TILE;
        t->width = f->width - t->x < TILE ? f->width - t->x : TILE;
        t->height = f->height - t->y < TILE ? f->height - t->y : TILE;
    }
    p->pass = image_new(f->width, f->height);
    p->seen = image_new(f->width, f->height);
    return p;
}

void passes_free(passes *p)
{
    if (!p)
        return;
    for (int i = 0; i < p->threads; i++) {
        batch_free(p->stations[i].batch);
        free(p->stations[i].connections.items);
        connection_visibility_free(p->stations[i].visibility);
    }
    for (size_t i = 0; i < p->tile_count; i++)
        free(p->tiles[i].splats);
    free(p->tiles);
    free(p->stations);
    image_free(&p->pass);
    image_free(&p->seen);
    free(p);
}

counts passes_counts(const passes *p, double *visibility_s)
{
    counts sum = {0};
    *visibility_s = 0.0;
    for (int i = 0; i < p->threads; i++) {
        counts c = connection_visibility_counts(p->stations[i].visibility);
        sum.asked += c.asked;
        sum.traced += c.traced;
        sum.camera += c.camera;
        *visibility_s += p->stations[i].visibility_s / p->threads;
    }
    return sum;
}

static void push(tile *t, splat s)
{
    if (t->count == t->capacity) {
        t->capacity = t->capacity ? 2 * t->capacity : 256;
        t->splats = xrealloc(t->splats, t->capacity * sizeof *t->splats);
    }
    t->splats[t->count++] = s;
}

static void keep_first_hits(passes *p, const batch *b)
{
    for (uint32_t i = 0; i < b->count; i++) {
        size_t at = (size_t)b->y[i] * p->v->settings.width + b->x[i];
        p->film->depth[at] = b->depth[i];
        p->film->normal.pixels[at] = b->normal[i];
    }
}

static void render_batch(passes *p, station *s, tile *t)
{
    batch *b = s->batch;
    connections *c = &s->connections;
    subpaths(p->v, b);
    if (p->index == 0)
        keep_first_hits(p, b);
    if (p->first_hits)
        return;
    const pilot *ahead = p->v->pilot;
    bool first = ahead && ahead->visibility_first && p->v->settings.visibility != VISIBILITY_ESTIMATE;
    connect_batch(p->v, b, !first, c);
    double start = now();
    connection_visibility_resolve(s->visibility, b, c);
    s->visibility_s += now() - start;
    if (first)
        connect_visible(p->v, b, c);
    for (uint32_t i = 0; i < b->count; i++) {
        size_t at = (size_t)b->y[i] * p->v->settings.width + b->x[i];
        p->seen.pixels[at] = b->seen[i];
        p->pass.pixels[at] = v3_add(b->seen[i], b->found[i]);
    }
    for (size_t i = 0; i < c->count; i++) {
        const connection *x = &c->items[i];
        if (x->value.x == 0.0f && x->value.y == 0.0f && x->value.z == 0.0f)
            continue;
        if (x->kind == CONNECT_CAMERA)
            push(t, (splat){x->pixel, x->value});
        else
            p->pass.pixels[x->pixel] = v3_add(p->pass.pixels[x->pixel], x->value);
    }
}

static void render_tile(void *context, int thread, size_t index)
{
    passes *p = context;
    station *s = &p->stations[thread];
    tile *t = &p->tiles[index];
    batch *b = s->batch;
    tracer_thread_init();
    t->count = 0;
    b->count = 0;
    b->pass = p->index;
    for (uint64_t code = 0; code < (uint64_t)TILE * TILE && !interrupted(); code++) {
        uint32_t x, y;
        halton_morton_decode(code, &x, &y);
        if (x < t->width && y < t->height) {
            uint32_t i = b->count++;
            b->x[i] = t->x + x, b->y[i] = t->y + y;
            const settings *f = &p->v->settings;
            b->random[i] = ((uint64_t)p->index * f->height + b->y[i]) * f->width + b->x[i];
        }
        if (b->count == BATCH || (b->count > 0 && code + 1 == (uint64_t)TILE * TILE)) {
            render_batch(p, s, t);
            b->count = 0;
        }
    }
}

bool passes_render(passes *p, uint32_t index)
{
    const settings *f = &p->v->settings;
    film *out = p->film;
    p->index = index;
    parallel_for(f->threads, p->tile_count, render_tile, p);
    bool complete = !interrupted();
    if (!complete && out->passes > 0)
        return false;
    for (size_t i = 0; i < p->tile_count; i++)
        for (size_t k = 0; k < p->tiles[i].count; k++) {
            const splat *s = &p->tiles[i].splats[k];
            p->pass.pixels[s->pixel] = v3_add(p->pass.pixels[s->pixel], s->value);
        }
    film_add(out, &p->pass, &p->seen);
    if (!complete)
        out->passes = 0; /* a part of one is nothing to go on from */
    return complete;
}

bool passes_first_hits(passes *p)
{
    p->index = 0;
    p->first_hits = true;
    parallel_for(p->v->settings.threads, p->tile_count, render_tile, p);
    p->first_hits = false;
    return !interrupted();
}
