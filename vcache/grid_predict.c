/* SPDX-License-Identifier: Apache-2.0 */
/* What the informing pixels say of a pixel (Sect. 4.1.4), and which lights are to be traced all the same (Sect. 4.2).
 */
#include "grid_internal.h"

#include <string.h>

void grid_neighbours_of(const vcache_grid_lights *l, const uint64_t *of, uint64_t *out)
{
    uint32_t words = l->words;
    memset(out, 0, words * sizeof *out);
    for (uint32_t w = 0; w < words; w++)
        for (uint64_t bits = of[w]; bits; bits &= bits - 1) {
            const uint64_t *n = l->neighbours + (size_t)(64 * w + (uint32_t)count_trailing_zeros(bits)) * words;
            for (uint32_t k = 0; k < words; k++)
                out[k] |= n[k];
        }
}

/* Lights that at least two informers call blocked. */
static uint64_t blocked_twice(const uint64_t *const *asked, const uint64_t *const *visible, uint32_t count, uint32_t w)
{
    uint64_t once = 0, twice = 0;
    for (uint32_t i = 0; i < count; i++) {
        uint64_t b = asked[i][w] & ~visible[i][w];
        twice |= once & b;
        once |= b;
    }
    return twice;
}

/* Without warping: a light is blocked where all agree, visible where all agree, else unclear. Of what is unclear those
 * that know, being above whose horizon it is, may still agree: `guess` is what they see. If they do not it is doubtful.
 * `near`: those below whose horizon it is agree that it is blocked, if two others say so. */
static void agree(const vcache_grid *g, uint32_t pixel, const uint32_t *informers, uint32_t count, bool near,
                  uint64_t *blocked, uint64_t *unclear, uint64_t *guess, uint64_t *doubtful)
{
    uint32_t words = g->words;
    const uint64_t *asked = grid_asked(g, pixel);
    const uint64_t *a[INFORMERS], *v[INFORMERS];
    for (uint32_t i = 0; i < INFORMERS; i++) { /* fewer: one speaks twice */
        uint32_t from = informers[i < count ? i : 0];
        a[i] = grid_asked(g, from);
        v[i] = grid_visible(g, from);
    }
    for (uint32_t w = 0; w < words; w++) {
        uint64_t known = a[0][w] & a[1][w] & a[2][w] & a[3][w];
        uint64_t seen = v[0][w] | v[1][w] | v[2][w] | v[3][w];
        uint64_t hidden = (a[0][w] & ~v[0][w]) | (a[1][w] & ~v[1][w]) | (a[2][w] & ~v[2][w]) | (a[3][w] & ~v[3][w]);
        if (near)
            known |= blocked_twice(a, v, count, w) & ~seen;
        blocked[w] = asked[w] & known & ~seen;
        unclear[w] = asked[w] & (~known | (seen & hidden));
        guess[w] = unclear[w] & seen;
        doubtful[w] = unclear[w] & ~(seen ^ hidden); /* both, or nobody knows */
    }
}

/* The same for boundary flooding: blocked where more than `threshold` of them are; unclear below someone's horizon. */
static void count_blockers(const vcache_grid *g, uint32_t pixel, const uint32_t *informers, uint32_t count,
                           uint64_t *blocked, uint64_t *unclear)
{
    uint32_t words = g->words, needed = (uint32_t)g->config.threshold + 1;
    const uint64_t *asked = grid_asked(g, pixel);
    needed = needed < count ? needed : count;
    for (uint32_t w = 0; w < words; w++) {
        uint64_t at_least[INFORMERS + 1] = {~(uint64_t)0}, known = ~(uint64_t)0; /* [k]: k blockers or more */
        for (uint32_t i = 0; i < count; i++) {
            uint64_t a = grid_asked(g, informers[i])[w];
            uint64_t b = a & ~grid_visible(g, informers[i])[w];
            known &= a;
            for (uint32_t k = INFORMERS; k > 0; k--)
                at_least[k] |= at_least[k - 1] & b;
        }
        blocked[w] = at_least[needed] & asked[w];
        unclear[w] = asked[w] & ~known;
    }
}

/* Lights with a neighbour that is predicted otherwise. */
static void boundary(const vcache_grid *g, const uint64_t *visible, const uint64_t *blocked, uint64_t *out)
{
    uint32_t words = g->words;
    uint64_t *beside_visible = grid_row(g->scratch, words, 4), *beside_blocked = grid_row(g->scratch, words, 5);
    grid_neighbours_of(g->lights, visible, beside_visible);
    grid_neighbours_of(g->lights, blocked, beside_blocked);
    for (uint32_t w = 0; w < words; w++)
        out[w] = (visible[w] & beside_blocked[w]) | (blocked[w] & beside_visible[w]);
}

/* Adds lights with a neighbour below the horizon (report, Sect. 3.2): what rises over it is on no boundary yet. */
static void add_horizon(const vcache_grid *g, const uint64_t *asked, uint64_t *out)
{
    uint32_t words = g->words;
    uint64_t *below = grid_row(g->scratch, words, 4), *beside = grid_row(g->scratch, words, 5);
    for (uint32_t w = 0; w < words; w++)
        below[w] = g->valid[w] & ~asked[w];
    grid_neighbours_of(g->lights, below, beside);
    for (uint32_t w = 0; w < words; w++)
        out[w] |= asked[w] & beside[w];
}

/* Bright lights at a boundary, or beside one that is unclear. */
static void add_bright(const vcache_grid *g, const uint64_t *visible, const uint64_t *blocked, uint64_t *todo)
{
    uint32_t words = g->words;
    uint64_t *edge = grid_row(g->scratch, words, 6), *beside = grid_row(g->scratch, words, 7);
    boundary(g, visible, blocked, edge);
    grid_neighbours_of(g->lights, todo, beside);
    for (uint32_t w = 0; w < words; w++)
        todo[w] |= g->bright[w] & (edge[w] | beside[w]) & (visible[w] | blocked[w]);
}

/* Keeps informers on the pixel's object; returns how many. */
static uint32_t on_object(const vcache_grid *g, uint32_t pixel, uint32_t *informers, uint32_t count)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++)
        if (g->seen[informers[i]] && g->object[informers[i]] == g->object[pixel])
            informers[n++] = informers[i];
    return n;
}

static void trace_all(vcache_grid *g, uint32_t at, bool begins)
{
    uint32_t words = g->words, pixel = g->part[at];
    size_t bytes = words * sizeof(uint64_t);
    const uint64_t *asked = grid_asked(g, pixel);
    memset(grid_visible(g, pixel), 0, bytes);
    memcpy(grid_row(g->todo, words, at), asked, bytes);
    if (g->flooding) {
        memcpy(grid_row(g->traced, words, at), asked, bytes);
        memcpy(grid_row(g->doubtful, words, at), asked, bytes); /* nothing was predicted */
        memset(grid_row(g->predicted, words, at), 0, bytes);
    }
    *(begins ? &g->statistics.coarse : &g->statistics.silhouette) += grid_count(asked, words);
}

/* Everything visible, nothing traced. */
static void skip_all(vcache_grid *g, uint32_t at)
{
    size_t bytes = g->words * sizeof(uint64_t);
    memcpy(grid_visible(g, g->part[at]), grid_asked(g, g->part[at]), bytes);
    memset(grid_row(g->todo, g->words, at), 0, bytes);
}

/* What to trace besides what is unclear, from what is predicted. `todo`: in, the unclear. */
static void doubt(vcache_grid *g, const uint64_t *asked, const uint64_t *visible, const uint64_t *blocked,
                  uint64_t *todo)
{
    const vcache_grid_config *f = &g->config;
    uint64_t *edge = grid_row(g->scratch, g->words, 6);
    if (f->boundary) {
        boundary(g, visible, blocked, edge);
        for (uint32_t w = 0; w < g->words; w++)
            todo[w] |= edge[w];
        if (f->order == VCACHE_GRID_SCANLINE)
            add_horizon(g, asked, todo);
    } else if (f->bright) {
        add_bright(g, visible, blocked, todo);
    }
}

void grid_predict(vcache_grid *g, uint32_t at)
{
    const vcache_grid_config *f = &g->config;
    uint32_t words = g->words, pixel = g->part[at], informers[INFORMERS];
    uint64_t *asked = grid_asked(g, pixel), *visible = grid_visible(g, pixel);
    if (f->order == VCACHE_GRID_EYE) {
        skip_all(g, at);
        return;
    }
    uint32_t count = grid_informers(&g->walk, pixel, informers);
    bool near = grid_within(&g->walk, f->near);
    uint32_t alike = on_object(g, pixel, informers, count), needed = near && count > 3 ? 3 : count;
    if (count == 0 || alike < needed) {
        trace_all(g, at, count == 0);
        return;
    }
    uint64_t *blocked = g->scratch, *todo = grid_row(g->todo, words, at); /* first of all what is unclear */
    uint64_t *guess = grid_row(g->scratch, words, 3), *doubt_row = grid_row(g->scratch, words, 8);
    if (f->warping)
        grid_warp(g, pixel, informers, alike, blocked, todo);
    else if (f->boundary)
        count_blockers(g, pixel, informers, alike, blocked, todo);
    if (f->warping || f->boundary) {
        memset(guess, 0, words * sizeof *guess);
        memcpy(doubt_row, todo, words * sizeof *doubt_row);
    } else {
        agree(g, pixel, informers, alike, near, blocked, todo, guess, doubt_row);
    }
    for (uint32_t w = 0; w < words; w++)
        visible[w] = asked[w] & ~blocked[w] & ~(f->boundary ? 0 : todo[w]);
    doubt(g, asked, visible, blocked, todo);
    g->statistics.uncertain += grid_count(todo, words);
    if (g->flooding) {
        /* Of what is doubtful any answer is a surprise: its neighbours come along at once. */
        uint64_t *doubtful = grid_row(g->doubtful, words, at), *traced = grid_row(g->traced, words, at);
        uint64_t *predicted = grid_row(g->predicted, words, at), *beside = grid_row(g->scratch, words, 2);
        if (grid_at_once(f) && grid_any(doubt_row, words)) {
            grid_neighbours_of(g->lights, doubt_row, beside);
            uint32_t before = grid_count(todo, words);
            for (uint32_t w = 0; w < words; w++)
                todo[w] |= beside[w] & asked[w];
            g->statistics.flooded += grid_count(todo, words) - before;
        }
        for (uint32_t w = 0; w < words; w++) {
            doubtful[w] = f->boundary ? 0 : doubt_row[w];
            traced[w] = todo[w];
            predicted[w] = (visible[w] | guess[w]) & todo[w];
        }
    }
    for (uint32_t w = 0; w < words; w++)
        visible[w] &= ~todo[w];
}
