/* SPDX-License-Identifier: Apache-2.0 */
/* One pass over the image: an eye and a light sub-path per pixel, on all cores. Which thread takes which tile changes
 * nothing: what light paths bring to other pixels is kept by batch and summed in their order. */
#include "film.h"
#include "pilot.h"
#include "turns.h"

#include "../common/interrupt.h"
#include "../common/parallel.h"
#include "../../halton/halton.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <time.h>

/* What one thread needs. */
typedef struct station {
    batch *batch;
    connections connections;
    connection_visibility *visibility;
    float threshold;               /* of estimates */
    double visibility_s, asking_s; /* the latter is a part of it */
    bool drew;                     /* has finished a batch */
} station;

typedef struct splat {
    uint32_t pixel;
    rgb value;
} splat;

/* A part of the image: TILE x TILE pixels, or what is left of them at its borders. */
typedef struct tile {
    uint32_t x, y, width, height;
} tile;

/* The pixels of a batch: those of a tile, in Morton order. */
typedef struct piece {
    tile tile;
    uint32_t from; /* Morton code of the first one */
    splat *splats;
    size_t count, capacity;
} piece;

struct passes {
    const view *v;
    station *stations;
    int threads;
    piece *pieces; /* by tiles */
    size_t piece_count, tile_count;
    size_t *first; /* of each tile, and where the last one ends */
    film *film;
    image pass, seen; /* what this one adds; of it what is seen directly */
    uint32_t index;
    bool first_hits; /* nothing else */
    /* deterministic */
    turns *turns; /* NULL: who comes first asks first */
    atomic_size_t next;
    float threshold; /* of estimates */
};

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* The pixel with this Morton code, if the image has it. */
static bool pixel_of(const tile *t, uint32_t code, uint32_t *x, uint32_t *y)
{
    halton_morton_decode(code, x, y);
    bool inside = *x < t->width && *y < t->height;
    *x += t->x, *y += t->y;
    return inside;
}

static void cut(passes *p, const tile *t)
{
    uint32_t in_piece = 0, x, y;
    for (uint32_t code = 0; code < TILE * TILE; code++)
        if (pixel_of(t, code, &x, &y) && in_piece++ % BATCH == 0)
            p->pieces[p->piece_count++] = (piece){.tile = *t, .from = code};
}

static void cut_image(passes *p, uint32_t width, uint32_t height)
{
    size_t across = (width + TILE - 1) / TILE, down = (height + TILE - 1) / TILE;
    p->tile_count = across * down;
    p->pieces = xcalloc(p->tile_count * (TILE * TILE / BATCH), sizeof *p->pieces);
    p->first = xcalloc(p->tile_count + 1, sizeof *p->first);
    for (size_t i = 0; i < p->tile_count; i++) {
        uint32_t x = (uint32_t)(i % across) * TILE, y = (uint32_t)(i / across) * TILE;
        cut(p, &(tile){x, y, width - x < TILE ? width - x : TILE, height - y < TILE ? height - y : TILE});
        p->first[i + 1] = p->piece_count;
    }
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
    cut_image(p, f->width, f->height);
    if (cache && f->deterministic)
        p->turns = turns_new(p->threads);
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
    for (size_t i = 0; i < p->piece_count; i++)
        free(p->pieces[i].splats);
    free(p->pieces);
    free(p->first);
    turns_free(p->turns);
    free(p->stations);
    image_free(&p->pass);
    image_free(&p->seen);
    free(p);
}

counts passes_counts(const passes *p, double *visibility_s, double *asking_s)
{
    counts sum = {0};
    *visibility_s = *asking_s = 0.0;
    for (int i = 0; i < p->threads; i++) {
        counts c = connection_visibility_counts(p->stations[i].visibility);
        sum.asked += c.asked;
        sum.traced += c.traced;
        sum.camera += c.camera;
        sum.not_finite += p->stations[i].connections.not_finite + p->stations[i].batch->dark;
        *visibility_s += p->stations[i].visibility_s / p->threads;
        *asking_s += p->stations[i].asking_s;
    }
    return sum;
}

static void push(piece *q, splat s)
{
    if (q->count == q->capacity) {
        q->capacity = q->capacity ? 2 * q->capacity : 64;
        q->splats = xrealloc(q->splats, q->capacity * sizeof *q->splats);
    }
    q->splats[q->count++] = s;
}

static void keep_first_hits(passes *p, const batch *b)
{
    for (uint32_t i = 0; i < b->count; i++) {
        size_t at = (size_t)b->y[i] * p->v->settings.width + b->x[i];
        p->film->depth[at] = b->depth[i];
        p->film->normal.pixels[at] = b->normal[i];
    }
}

/* Connections are to be weighed after it is known which see each other (docs/bdpt.md). */
static bool visibility_first(const passes *p)
{
    const pilot *ahead = p->v->pilot;
    return ahead && ahead->visibility_first && p->v->settings.visibility != VISIBILITY_ESTIMATE;
}

static void draw(passes *p, batch *b, piece *q)
{
    const settings *f = &p->v->settings;
    q->count = 0;
    b->count = 0;
    b->pass = p->index;
    for (uint32_t code = q->from, x, y; code < TILE * TILE && b->count < BATCH; code++)
        if (pixel_of(&q->tile, code, &x, &y)) {
            uint32_t i = b->count++;
            b->x[i] = x, b->y[i] = y;
            b->random[i] = ((uint64_t)p->index * f->height + y) * f->width + x;
        }
    subpaths(p->v, b);
    if (p->index == 0)
        keep_first_hits(p, b);
}

static void begin(passes *p, station *s, piece *q)
{
    draw(p, s->batch, q);
    connect_batch(p->v, s->batch, !visibility_first(p), &s->connections);
    double start = now();
    connection_visibility_prepare(s->visibility, s->batch, &s->connections);
    s->visibility_s += now() - start;
}

static void ask(station *s, float *threshold)
{
    double start = now();
    connection_visibility_ask(s->visibility, s->batch, &s->connections, threshold);
    double spent = now() - start;
    s->visibility_s += spent;
    s->asking_s += spent;
}

static void finish(passes *p, station *s, piece *q)
{
    s->drew = true;
    const batch *b = s->batch;
    connections *c = &s->connections;
    double start = now();
    connection_visibility_finish(s->visibility, b, c);
    s->visibility_s += now() - start;
    if (visibility_first(p))
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
            push(q, (splat){x->pixel, x->value});
        else
            p->pass.pixels[x->pixel] = v3_add(p->pass.pixels[x->pixel], x->value);
    }
}

static void render_tile(void *context, int thread, size_t index)
{
    passes *p = context;
    station *s = &p->stations[thread];
    tracer_thread_init();
    for (size_t i = p->first[index]; i < p->first[index + 1] && !interrupted(); i++) {
        piece *q = &p->pieces[i];
        if (p->first_hits) {
            draw(p, s->batch, q);
            continue;
        }
        begin(p, s, q);
        ask(s, &s->threshold);
        finish(p, s, q);
    }
}

/* All pieces that this thread gets hold of. Each one takes its turn, also those that an interrupt leaves out: others
 * wait for it. */
static void render_in_turn(void *context, int thread, size_t index)
{
    passes *p = context;
    station *s = &p->stations[thread];
    (void)index;
    tracer_thread_init();
    for (size_t i; (i = atomic_fetch_add_explicit(&p->next, 1, memory_order_relaxed)) < p->piece_count;) {
        bool wanted = !interrupted();
        if (wanted)
            begin(p, s, &p->pieces[i]);
        turns_wait(p->turns, i);
        if (wanted)
            ask(s, &p->threshold);
        turns_pass(p->turns);
        if (wanted)
            finish(p, s, &p->pieces[i]);
    }
}

static bool drew(const passes *p)
{
    bool any = false;
    for (int i = 0; i < p->threads; i++)
        any = any || p->stations[i].drew;
    return any;
}

bool passes_render(passes *p, uint32_t index)
{
    film *out = p->film;
    p->index = index;
    if (p->turns) {
        turns_begin(p->turns);
        atomic_store_explicit(&p->next, 0, memory_order_relaxed);
        parallel_for(p->threads, (size_t)p->threads, render_in_turn, p);
    } else {
        parallel_for(p->threads, p->tile_count, render_tile, p);
    }
    bool complete = !interrupted();
    if (!complete && (out->passes > 0 || !drew(p)))
        return false;
    for (size_t i = 0; i < p->piece_count; i++)
        for (size_t k = 0; k < p->pieces[i].count; k++) {
            const splat *s = &p->pieces[i].splats[k];
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
    parallel_for(p->threads, p->tile_count, render_tile, p);
    p->first_hits = false;
    return !interrupted();
}
