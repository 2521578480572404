/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Orders of evaluation (Sect. 4.1.1, 4.1.2, Fig. 3).
 *
 * Grid: along each axis the coarsest lattice has the multiples of `spacing` and the last pixel, so that every pixel
 * lies between two of the lattice whatever the size. A level at h = spacing / 2, spacing / 4 ... 1 adds the odd
 * multiples of h (but for the last pixel, which is there): first pixels that are odd along both axes, informed by their
 * four diagonal neighbours, then those that are odd along one, informed by the four beside them. Informers beyond the
 * last pixel are moved to it.
 *
 * Scanline: pixels with the same x + y inform none of each other, so a diagonal is a step.
 */
#include "grid_internal.h"

void grid_walk_begin(grid_walk *w, vcache_grid_order order, uint32_t spacing, uint32_t width, uint32_t height)
{
    *w = (grid_walk){.width = width, .height = height, .spacing = spacing, .order = order, .h = spacing};
    if (order == VCACHE_GRID_TRUE || order == VCACHE_GRID_EYE)
        w->h = w->spacing = 1;
}

static uint32_t tile_side(const grid_walk *w)
{
    return (w->h == w->spacing ? COARSE_STEPS : TILE_STEPS) * w->h;
}

/* The last tile takes what is less than half of one. */
static uint32_t tile_count(uint32_t length, uint32_t tile)
{
    uint32_t n = (length + tile / 2) / tile;
    return n > 0 ? n : 1;
}

/* Positions of one axis in a tile, in ascending order. */
typedef struct axis {
    uint32_t at[2 * TILE_STEPS]; /* at most 3/2 TILE_STEPS + 2 */
    bool odd[2 * TILE_STEPS];
    uint32_t count;
} axis;

/* Those of the lattice at `distance`, and those between them at h. */
static axis axis_of(const grid_walk *w, uint32_t length, uint32_t index, bool with_even, bool with_odd)
{
    axis a = {.count = 0};
    uint32_t tile = tile_side(w), end = index + 1 == tile_count(length, tile) ? length : (index + 1) * tile;
    uint32_t distance = w->h == w->spacing ? w->h : 2 * w->h;
    for (uint32_t x = index * tile; x < end; x += w->h) {
        bool odd = x % distance != 0 && x + 1 != length;
        if (odd ? with_odd : with_even) {
            a.at[a.count] = x;
            a.odd[a.count++] = odd;
        }
    }
    if (with_even && end == length && (length - 1) % w->h != 0) {
        a.at[a.count] = length - 1;
        a.odd[a.count++] = false;
    }
    return a;
}

/* Squares of 4 x 4 positions: rays of one light from neighbouring pixels go in packets. */
static uint32_t take_tile(const grid_walk *w, uint32_t *out)
{
    bool coarsest = w->h == w->spacing;
    axis rows = axis_of(w, w->height, w->tile_y, coarsest || w->straight, !coarsest);
    axis columns[2] = {axis_of(w, w->width, w->tile_x, true, false), axis_of(w, w->width, w->tile_x, false, true)};
    uint32_t n = 0, across = columns[0].count > columns[1].count ? columns[0].count : columns[1].count;
    for (uint32_t r0 = 0; r0 < rows.count; r0 += 4)
        for (uint32_t c0 = 0; c0 < across; c0 += 4)
            for (uint32_t r = r0; r < r0 + 4 && r < rows.count; r++) {
                const axis *a = &columns[coarsest ? 0 : w->straight ? !rows.odd[r] : 1];
                for (uint32_t c = c0; c < c0 + 4 && c < a->count; c++)
                    out[n++] = rows.at[r] * w->width + a->at[c];
            }
    return n;
}

/* To the next tile, half level, level. */
static void advance(grid_walk *w)
{
    uint32_t tile = tile_side(w);
    if (++w->tile_x < tile_count(w->width, tile))
        return;
    w->tile_x = 0;
    if (++w->tile_y < tile_count(w->height, tile))
        return;
    w->tile_y = 0;
    if (w->h < w->spacing && !w->straight) {
        w->straight = true;
        return;
    }
    w->straight = false;
    w->done = w->h == 1;
    w->h /= 2;
}

static uint32_t take_diagonal(grid_walk *w, uint32_t *out)
{
    uint32_t d = w->diagonal, lowest = d < w->width ? 0 : d - w->width + 1;
    uint32_t highest = d < w->height ? d : w->height - 1, n = 0;
    for (uint32_t y = lowest + w->taken; y <= highest && n < PART_PIXELS; y++)
        out[n++] = y * w->width + d - y;
    w->taken += n;
    if (lowest + w->taken > highest) {
        w->taken = 0;
        w->diagonal++;
        w->done = w->diagonal > w->width + w->height - 2;
    }
    return n;
}

uint32_t grid_walk_part(grid_walk *w, grid_walk *part, uint32_t *pixels)
{
    uint32_t n = 0;
    while (n == 0 && !w->done) {
        *part = *w;
        if (w->order == VCACHE_GRID_SCANLINE) {
            n = take_diagonal(w, pixels);
        } else {
            n = take_tile(w, pixels);
            advance(w);
        }
    }
    return n;
}

/* The positions beside x of the pixels that are odd at h: those of the half level before. Returns how many. */
static uint32_t beside(uint32_t x, uint32_t h, uint32_t length, uint32_t out[2])
{
    uint32_t n = 0;
    if (x + 1 == length) { /* the last: of the odd ones the greatest below it */
        if (x > h)
            out[n++] = (x - 1 - h) / (2 * h) * (2 * h) + h;
        return n;
    }
    if (x >= h)
        out[n++] = x - h;
    if (x + h + 1 < length)
        out[n++] = x + h;
    return n;
}

uint32_t grid_informers(const grid_walk *w, uint32_t pixel, uint32_t informers[INFORMERS])
{
    uint32_t x = pixel % w->width, y = pixel / w->width, h = w->h, n = 0;
    if (w->order == VCACHE_GRID_SCANLINE) {
        if (x == 0 || y == 0)
            return 0;
        informers[0] = pixel - 1;
        informers[1] = pixel - w->width;
        informers[2] = pixel - w->width - 1;
        return 3;
    }
    if (h == w->spacing)
        return 0;
    uint32_t right = x + h < w->width ? x + h : w->width - 1, below = y + h < w->height ? y + h : w->height - 1;
    if (!w->straight) {
        informers[0] = (y - h) * w->width + x - h;
        informers[1] = (y - h) * w->width + right;
        informers[2] = below * w->width + x - h;
        informers[3] = below * w->width + right;
        return 4;
    }
    uint32_t pair[2], count;
    if (x % (2 * h) != 0 && x + 1 != w->width) { /* odd along x */
        informers[n++] = y * w->width + x - h;
        informers[n++] = y * w->width + right;
        count = beside(y, h, w->height, pair);
        for (uint32_t i = 0; i < count; i++)
            informers[n++] = pair[i] * w->width + x;
    } else {
        informers[n++] = (y - h) * w->width + x;
        informers[n++] = below * w->width + x;
        count = beside(x, h, w->width, pair);
        for (uint32_t i = 0; i < count; i++)
            informers[n++] = y * w->width + pair[i];
    }
    return n;
}

bool grid_within(const grid_walk *w, uint32_t pixels)
{
    return w->order == VCACHE_GRID_GRID && (w->straight ? 1 : 2) * w->h * w->h <= pixels * pixels;
}
