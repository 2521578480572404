/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Tracing, and where answers surprise, flooding among neighbouring lights (Sect. 4.2, 6.1, Flood-Uncertainty of Sect.
 * 6.2). The paper floods light by light; here each round takes all rays of a part that can be known to be needed, so
 * that they go out together. Both end with the same set of traced lights: a light is traced if and only if it is in
 * doubt or a neighbour's ray surprised, whatever the order. (Restricted flooding compares with predictions, which do
 * not change either.)
 */
#include "grid_internal.h"

#include <string.h>

void vcache_grid_begin(vcache_grid *g, uint32_t width, uint32_t height)
{
    g->width = width;
    g->height = height;
    memset(g->seen, 0, (size_t)width * height);
    memset(g->bits, 0, 2 * (size_t)width * height * g->words * sizeof *g->bits);
    grid_walk_begin(&g->next, g->config.order, g->config.spacing, width, height);
    g->active_count = g->emitted = g->ray_count = 0;
}

uint64_t *vcache_grid_pixel(vcache_grid *g, uint32_t x, uint32_t y, uint64_t object, const float position[3])
{
    size_t pixel = (size_t)y * g->width + x;
    uint64_t *asked = grid_asked(g, pixel);
    g->seen[pixel] = 1;
    g->object[pixel] = object;
    if (g->config.warping && position)
        memcpy(g->position + 3 * pixel, position, 3 * sizeof *position);
    return memset(asked, 0, g->words * sizeof *asked);
}

const uint64_t *vcache_grid_visible(const vcache_grid *g, uint32_t x, uint32_t y)
{
    return grid_visible(g, (size_t)y * g->width + x);
}

/* Predicts the next part that there is; false at the end. */
static bool begin_part(vcache_grid *g)
{
    uint32_t words = g->words, n = grid_walk_part(&g->next, &g->walk, g->part), kept = 0;
    for (uint32_t i = 0; i < n; i++)
        if (g->seen[g->part[i]])
            g->part[kept++] = g->part[i];
    g->flooding = !grid_within(&g->walk, g->config.flood) && g->config.order != VCACHE_GRID_TRUE &&
                  g->config.order != VCACHE_GRID_EYE;
    g->round = 0;
    g->active_count = g->emitted = 0;
    for (uint32_t at = 0; at < kept; at++) {
        grid_predict(g, at);
        uint32_t asked = grid_count(grid_asked(g, g->part[at]), words);
        g->statistics.pixels += asked > 0;
        g->statistics.asked += asked;
        if (grid_any(grid_row(g->todo, words, at), words))
            g->active[g->active_count++] = at;
    }
    return n > 0;
}

/* What is to be traced next at a pixel, from what its rays found; returns how many. */
static uint32_t flood(vcache_grid *g, uint32_t at)
{
    uint32_t words = g->words, count = 0;
    const uint64_t *asked = grid_asked(g, g->part[at]);
    uint64_t *visible = grid_visible(g, g->part[at]), *todo = grid_row(g->todo, words, at);
    uint64_t *traced = grid_row(g->traced, words, at), *predicted = grid_row(g->predicted, words, at);
    uint64_t *doubtful = grid_row(g->doubtful, words, at);
    uint64_t *seen = g->scratch, *hidden = grid_row(g->scratch, words, 1);
    uint64_t *beside_seen = grid_row(g->scratch, words, 2), *beside_hidden = grid_row(g->scratch, words, 3);
    uint64_t untraced = 0;
    bool at_once = grid_at_once(&g->config); /* grid_predict has flooded from what is unclear */
    for (uint32_t w = 0; w < words; w++) {
        uint64_t refuted = todo[w] & (visible[w] ^ predicted[w]) & ~doubtful[w];
        g->statistics.surprises += count_ones(refuted);
        refuted |= at_once ? 0 : todo[w] & doubtful[w];
        seen[w] = refuted & visible[w];
        hidden[w] = refuted & ~visible[w];
        untraced |= asked[w] & ~traced[w];
    }
    if (!untraced)
        return 0;
    grid_neighbours_of(g->lights, seen, beside_seen);
    grid_neighbours_of(g->lights, hidden, beside_hidden);
    for (uint32_t w = 0; w < words; w++) {
        uint64_t next = g->config.restricted ? (beside_seen[w] & ~visible[w]) | (beside_hidden[w] & visible[w])
                                             : beside_seen[w] | beside_hidden[w];
        next &= asked[w] & ~traced[w];
        todo[w] = next;
        traced[w] |= next;
        predicted[w] = visible[w] & next;
        doubtful[w] = 0;
        visible[w] &= ~next;
        count += count_ones(next);
    }
    return count;
}

/* The next round of this part; false where there is none. */
static bool begin_round(vcache_grid *g)
{
    if (!g->flooding || g->active_count == 0 || (g->config.rounds > 0 && g->round == g->config.rounds))
        return false;
    uint32_t n = 0;
    for (uint32_t i = 0; i < g->active_count; i++) {
        uint32_t flooded = flood(g, g->active[i]);
        g->statistics.flooded += flooded;
        if (flooded > 0)
            g->active[n++] = g->active[i];
    }
    g->active_count = n;
    g->emitted = 0;
    g->round++;
    return n > 0;
}

/* Rays of as many pixels as fit, sorted by light. */
static void emit(vcache_grid *g)
{
    uint32_t words = g->words, total = 0, from = g->emitted;
    memset(g->counts, 0, g->lights->count * sizeof *g->counts);
    for (; g->emitted < g->active_count; g->emitted++) {
        const uint64_t *todo = grid_row(g->todo, words, g->active[g->emitted]);
        uint32_t n = grid_count(todo, words);
        if (total + n > g->config.rays)
            break;
        total += n;
        for (uint32_t w = 0; w < words; w++)
            for (uint64_t bits = todo[w]; bits; bits &= bits - 1)
                g->counts[64 * w + (uint32_t)count_trailing_zeros(bits)]++;
    }
    for (uint32_t i = 0, sum = 0; i < g->lights->count; i++) {
        uint32_t n = g->counts[i];
        g->counts[i] = sum;
        sum += n;
    }
    for (uint32_t k = from; k < g->emitted; k++) {
        const uint64_t *todo = grid_row(g->todo, words, g->active[k]);
        uint32_t pixel = g->part[g->active[k]];
        for (uint32_t w = 0; w < words; w++)
            for (uint64_t bits = todo[w]; bits; bits &= bits - 1) {
                uint32_t light = 64 * w + (uint32_t)count_trailing_zeros(bits);
                g->rays[g->counts[light]++] = (vcache_grid_ray){pixel, light};
            }
    }
    g->ray_count = total;
    g->statistics.traced += total;
    g->statistics.batches++;
}

const vcache_grid_ray *vcache_grid_next(vcache_grid *g, uint32_t *count)
{
    g->ray_count = 0;
    while (g->emitted == g->active_count)
        if (!begin_round(g) && !begin_part(g)) {
            g->active_count = g->emitted = 0;
            *count = 0;
            return g->rays;
        }
    emit(g);
    *count = g->ray_count;
    return g->rays;
}

static void keep_blocker(vcache_grid *g, const vcache_grid_ray *r, float distance)
{
    const float *from = g->position + 3 * (size_t)r->pixel, *d = g->lights->direction + 3 * (size_t)r->light;
    float *out = g->blocker + 3 * ((size_t)r->pixel * g->lights->count + r->light);
    float t = distance > 0.0f && distance < 1e18f ? distance : 1e18f;
    for (int k = 0; k < 3; k++)
        out[k] = from[k] + t * d[k];
}

void vcache_grid_tell(vcache_grid *g, const vcache_answer *answers, const float *distance)
{
    for (uint32_t i = 0; i < g->ray_count; i++) {
        const vcache_grid_ray *r = &g->rays[i];
        uint64_t seen = answers[i] & VCACHE_VISIBLE;
        grid_visible(g, r->pixel)[r->light / 64] |= seen << r->light % 64;
        if (g->config.warping && !seen)
            keep_blocker(g, r, distance ? distance[i] : 0.0f);
    }
    g->ray_count = 0;
}

void vcache_grid_statistics_of(const vcache_grid *g, vcache_grid_statistics *out)
{
    size_t size = out->size < sizeof *out ? out->size : sizeof *out;
    vcache_grid_statistics s = g->statistics;
    s.size = size;
    memcpy(out, &s, size);
}

void vcache_grid_reset_statistics(vcache_grid *g)
{
    memset(&g->statistics, 0, sizeof g->statistics);
}
