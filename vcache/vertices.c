/* SPDX-License-Identifier: Apache-2.0 */
/* Ends of bidirectional path tracing (Eq. 6): the cells of a pair depend on both ends. */
#include "cells.h"
#include "worker.h"

#include <math.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

static const uint64_t seed_vertex = 0x4b33a62ed433d4a3u; /* keeps them apart from other ends */

size_t vcache_vertex_size(void)
{
    return sizeof(vcache_vertex);
}

/* R^4 = (D^2 P_e N_P / C_E^2) (D^2 P_l): each side brings its factor, as a whole number of steps of C_R^(1/4). */
static int32_t quarter_steps(const vcache *c, double factor)
{
    if (!(factor > 0.0))
        return INT32_MIN;
    factor = factor < 0x1p900 ? factor : 0x1p900; /* infinity: the smallest cells */
    bool below = factor < 1.0;
    double f = below ? 1.0 / factor : factor;
    int steps = 0, top = c->steps - 1; /* power[top] < 2^32 */
    for (; f >= 0x1p31 && f >= c->power[top]; steps += top)
        f /= c->power[top];
    if (f > 1.0)
        steps += quantize_power(c, f * f, top);
    return below ? -steps : steps;
}

static void prepare(const vcache *c, const vcache_surface *surface, double share, uint64_t seed, vcache_vertex *out)
{
    memcpy(out->position, surface->position, sizeof out->position);
    out->user = surface->user;
    out->seed = seed;
    out->quarter_steps = INT32_MIN;
    if (quantize_point(c, surface->position, surface->normal, &out->point))
        out->quarter_steps = quarter_steps(c, c->diameter * c->diameter * (double)surface->density * share);
}

void vcache_prepare_eye_vertex(const vcache *c, const vcache_surface *surface, float ce, float paths, uint64_t salt,
                               vcache_vertex *out)
{
    bool good = ce > 0.0f && isfinite(ce) && paths > 0.0f && isfinite(paths);
    uint64_t seed = salt ? hash_words(salt, 0, seed_vertex) : 0;
    prepare(c, surface, good ? (double)paths / ((double)ce * ce) : 0.0, seed_vertex ^ seed, out);
}

void vcache_prepare_light_vertex(const vcache *c, const vcache_surface *surface, vcache_vertex *out)
{
    prepare(c, surface, 1.0, seed_vertex ^ 1u, out);
}

/* ---------------------------------------------------------------------------------------------------------- pairs */

int vertex_step(const vcache *c, const vcache_vertex *eye, const vcache_vertex *light)
{
    if (eye->quarter_steps == INT32_MIN || light->quarter_steps == INT32_MIN)
        return -1;
    int quarters = eye->quarter_steps + light->quarter_steps;
    int k = quarters < 0 ? 0 : (quarters + 2) / 4;
    return c->canonical[k < c->step_limit ? k : c->step_limit];
}

static inline uint64_t half_key(const vcache *c, const vcache_vertex *v, int k)
{
    double height;
    return cell_hash(cell_at(c, &v->point, c->resolution[k], &height), v->point.orientation, k, v->seed);
}

/* By the split family always: cells depend on both ends, so there is no prefix for the serial families to start from.
 */
static inline uint64_t key_of(const vcache *c, uint64_t epoch_key, const vcache_vertex *eye, const vcache_vertex *light,
                              int k)
{
    return hash_fold(half_key(c, eye, k) ^ epoch_key, half_key(c, light, k));
}

uint64_t vertex_key(const vcache *c, uint64_t epoch_key, const vcache_vertex *eye, const vcache_vertex *light, int k)
{
    return key_of(c, epoch_key, eye, light, k);
}

/* False where the pair must be answered exactly: ends nearer to each other than a cell, or that cannot be quantized. */
static inline bool find(const vcache *c, uint64_t epoch_key, const vcache_vertex *eye, const vcache_vertex *light,
                        place *out)
{
    int k = vertex_step(c, eye, light);
    if (k < 0 || !(distance_squared(eye->position, light->position) >= c->side_squared[k]))
        return false;
    out->key = key_of(c, epoch_key, eye, light, k);
    out->slot = pair_slot(c, VCACHE_HASH_SPLIT, out->key);
    return true;
}

static void enter(vcache_worker *w, pair *p, bool quantized, place at)
{
    if (!quantized) {
        p->level = NO_LEVEL;
        worker_add_miss(w, p, (place){0});
        return;
    }
    uint32_t state = table_look_up(&w->cache->table, at.slot, table_word(at.key));
    if (state <= 1) {
        worker_count_hit(w, 0);
        worker_answer(p->visible, p->bit, state & 1u);
        if (w->config.verify)
            worker_verify(w, p, 0, state & 1u);
    } else {
        worker_ask(w, p, at);
    }
}

void vertices_enter(vcache_worker *w, pair *p, uint64_t epoch_key)
{
    place at = {0};
    bool quantized = !w->config.exact && find(w->cache, epoch_key, p->from.vertex, p->to.vertex, &at);
    enter(w, p, quantized, at);
}

/* Words of the table come from memory: so many pairs before they are looked at. */
enum { AHEAD = 16 };

uint32_t vcache_add_vertices(vcache_worker *w, const vcache_vertex_pair *pairs, uint32_t first, uint32_t count,
                             uint64_t *visible)
{
    const vcache *c = w->cache;
    uint64_t epoch_key = worker_epoch(w);
    place at[AHEAD];
    bool quantized[AHEAD];
    uint32_t ahead = first, i = first;
    for (; i < count && worker_room(w) > 0; i++) {
        for (; ahead < count && ahead < i + AHEAD; ahead++) {
            place *to = &at[ahead % AHEAD];
            *to = (place){0};
            quantized[ahead % AHEAD] = !w->config.exact && find(c, epoch_key, pairs[ahead].eye, pairs[ahead].light, to);
            table_prefetch(&c->table, to->slot);
        }
        pair p = {
            .from.vertex = pairs[i].eye, .to.vertex = pairs[i].light, .visible = visible, .bit = i, .vertices = true};
        enter(w, &p, quantized[i % AHEAD], at[i % AHEAD]);
    }
    w->statistics.asked += i - first;
    return i;
}
