/* SPDX-License-Identifier: Apache-2.0 */
/* The table of words as a control variate of one pair: what is expected, how probably to trace, what to learn. */
#include "worker.h"

#include <math.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* Keeps keys of estimates from those of answers. */
static const uint64_t salt = 0x6f5d0b8c2c9e4a71u;

/* Jeffreys' prior of a share, Beta(1/2, 1/2): half a visible and half a blocked ray. With counts of at most 63 the mean
 * stays off 0 and 1, so that no pair is left out, however sure its cells are. On recorded light samples of five scenes,
 * priors of half and twice the weight were better in some and worse in others, and so was a second, finer cell whose
 * prior is the first (variance at equal rays 21 % higher to 17 % lower): not worth its memory access. Counts of at most
 * 15 would leave 7 to 28 % more. */
static const float prior = 0.5f;

static vcache_estimate estimate(vcache_worker *w, uint64_t key, float contribution)
{
    w->statistics.asked++;
    if (contribution <= 0.0f)
        return (vcache_estimate){0};
    vcache_estimate out = {.mean = prior, .probability = 1.0f, .key = key};
    if (!key)
        return out;
    const table *t = &w->cache->table;
    uint32_t word = table_load_relaxed(t, table_slot(t, key)) ^ tally_word(key);
    float deviation = prior;
    if (word != 0 && tally_word(word) == 0) {
        float visible = (float)tally_visible(word) + prior, blocked = (float)tally_blocked(word) + prior;
        out.mean = visible / (visible + blocked);
        deviation = sqrtf(out.mean * (1.0f - out.mean));
        worker_count_hit(w, 0);
    }
    float steps = contribution * deviation * 0x1p24f;
    if (steps < 0x1p24f) /* else certain, or NaN */
        out.probability = (float)((uint32_t)steps + 1) * 0x1p-24f;
    return out;
}

static inline uint64_t salted_epoch(const vcache_worker *w)
{
    return worker_epoch(w) ^ salt;
}

/* Ends nearer than a cell are learnt like all others: at equal rays that left 11 % less variance than a neutral mean
 * for them in a kitchen, and 19 % less than tracing them all. */
vcache_estimate vcache_estimate_pair(vcache_worker *w, const vcache_eye *eye, const vcache_light *light,
                                     float contribution)
{
    uint64_t key = 0;
    if (eye->levels > 0 && !light->bad && !w->config.exact)
        key = pair_key(w->cache->config.hash, salted_epoch(w), eye->level[0].center, light);
    return estimate(w, key, contribution);
}

vcache_estimate vcache_estimate_vertices(vcache_worker *w, const vcache_vertex *eye, const vcache_vertex *light,
                                         float contribution)
{
    uint64_t key = 0;
    int at = vertex_step(w->cache, eye, light);
    if (at >= 0 && !w->config.exact)
        key = vertex_key(w->cache, salted_epoch(w), eye, light, at);
    return estimate(w, key, contribution);
}

void vcache_learn_pair(vcache_worker *w, const vcache_estimate *e, vcache_answer answer)
{
    vcache_statistics *s = &w->statistics;
    s->traced++;
    s->bypassed += !e->key;
    s->once += (answer & VCACHE_ONCE) != 0;
    if (!e->key || answer & VCACHE_ONCE)
        return;
    table *t = &w->cache->table;
    uint64_t slot = table_slot(t, e->key);
    uint32_t old = table_load_relaxed(t, slot), mine = tally_word(e->key);
    bool foreign = tally_word(old) != mine;
    s->stored++;
    s->overwritten += foreign && old != 0;
    table_store_relaxed(t, slot, tally_add(foreign ? mine : old, answer & VCACHE_VISIBLE));
}
