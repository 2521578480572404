/* SPDX-License-Identifier: Apache-2.0 */
/* Pixel order of Popov et al. 2013, Sect. 4.3; see halton.h.
 *
 * The smallest grid of 2^a x 3^b cells over the image meets each cell exactly once in the first 2^a 3^b points of the
 * sequence. So a pixel's index in the sequence follows from its coordinates by the Chinese remainder theorem, and its
 * segment from that index. Pixels are visited along the Morton curve and appended to their segments: no sort, no
 * memory. */
#include "halton.h"

#include <float.h>
#include <stddef.h>

#define LEAF 8 /* side of the blocks in which reversed coordinates are shared; any power of two */

#define TRITS_OF_DOUBLE 33 /* 3^33 < 2^53: integers of that many ternary digits are exact in a double */

typedef struct grid {
    unsigned bits, trits;   /* a, b */
    uint64_t columns, rows; /* 2^a >= width, 3^b >= height; together below 6 * 2^32 */
    uint64_t rows_inverse;  /* of 3^b, modulo 2^64 */
} grid;

typedef struct filler {
    uint32_t width, height;
    grid grid;
    uint64_t first[HALTON_MAX_SEGMENTS]; /* index in the sequence where each segment starts */
    uint32_t next[HALTON_MAX_SEGMENTS];  /* where the segment's next pixel goes */
    uint32_t segments;
    uint32_t *order;
} filler;

const char *halton_status_text(halton_status status)
{
    switch (status) {
    case HALTON_OK:
        return "no error";
    case HALTON_ERROR_NULL:
        return "a pointer is NULL";
    case HALTON_ERROR_SIZE:
        return "image or tile is empty, larger than 2^32 - 1 pixels, or the tile reaches outside of the image";
    case HALTON_ERROR_CE:
        return "C_E is not a positive finite number";
    }
    return "unknown status";
}

/* Puts a zero between any two bits. */
static uint64_t spread_bits(uint64_t x)
{
    x = (x | x << 16) & 0x0000ffff0000ffffu;
    x = (x | x << 8) & 0x00ff00ff00ff00ffu;
    x = (x | x << 4) & 0x0f0f0f0f0f0f0f0fu;
    x = (x | x << 2) & 0x3333333333333333u;
    return (x | x << 1) & 0x5555555555555555u;
}

static uint32_t gather_bits(uint64_t x)
{
    x &= 0x5555555555555555u;
    x = (x | x >> 1) & 0x3333333333333333u;
    x = (x | x >> 2) & 0x0f0f0f0f0f0f0f0fu;
    x = (x | x >> 4) & 0x00ff00ff00ff00ffu;
    x = (x | x >> 8) & 0x0000ffff0000ffffu;
    return (uint32_t)(x | x >> 16);
}

uint64_t halton_morton(uint32_t x, uint32_t y)
{
    return spread_bits(x) | spread_bits(y) << 1;
}

void halton_morton_decode(uint64_t code, uint32_t *x, uint32_t *y)
{
    *x = gather_bits(code);
    *y = gather_bits(code >> 1);
}

uint64_t halton_reverse2(uint64_t i, unsigned digits)
{
    if (digits == 0)
        return 0;
    i = (i >> 1 & 0x5555555555555555u) | (i & 0x5555555555555555u) << 1;
    i = (i >> 2 & 0x3333333333333333u) | (i & 0x3333333333333333u) << 2;
    i = (i >> 4 & 0x0f0f0f0f0f0f0f0fu) | (i & 0x0f0f0f0f0f0f0f0fu) << 4;
    i = (i >> 8 & 0x00ff00ff00ff00ffu) | (i & 0x00ff00ff00ff00ffu) << 8;
    i = (i >> 16 & 0x0000ffff0000ffffu) | (i & 0x0000ffff0000ffffu) << 16;
    i = i >> 32 | i << 32;
    return digits < 64 ? i >> (64 - digits) : i;
}

uint64_t halton_reverse3(uint64_t i, unsigned digits)
{
    uint64_t r = 0;
    for (unsigned k = 0; k < digits && k < 40; k++) {
        r = 3 * r + i % 3;
        i /= 3;
    }
    return r;
}

double halton_radical_inverse2(uint64_t i)
{
    return (double)halton_reverse2(i, 53) * 0x1p-53;
}

double halton_radical_inverse3(uint64_t i)
{
    return (double)halton_reverse3(i, TRITS_OF_DOUBLE) / 5559060566555523.0; /* 3^33 */
}

halton_status halton_segments(uint32_t pixels, double ce, uint32_t *starts, uint32_t *segments)
{
    if (!starts || !segments)
        return HALTON_ERROR_NULL;
    if (pixels == 0)
        return HALTON_ERROR_SIZE;
    if (!(ce > 0.0 && ce <= DBL_MAX)) /* NaN fails both */
        return HALTON_ERROR_CE;

    uint32_t n = 0;
    double c = pixels / ce / ce; /* two divisions: ce * ce may overflow */
    starts[0] = 0;
    for (c = c > 1.0 ? c : 1.0; c < pixels; c *= HALTON_GROWTH)
        starts[++n] = (uint32_t)c;
    starts[++n] = pixels;
    *segments = n;
    return HALTON_OK;
}

static grid make_grid(uint32_t width, uint32_t height)
{
    grid g = {.columns = 1, .rows = 1};
    for (; g.columns < width; g.columns *= 2)
        g.bits++;
    for (; g.rows < height; g.rows *= 3)
        g.trits++;
    /* Newton's iteration; an odd number is its own inverse modulo 8, each step doubles the correct bits. */
    g.rows_inverse = g.rows;
    for (int i = 0; i < 5; i++)
        g.rows_inverse *= 2 - g.rows * g.rows_inverse;
    return g;
}

/* The index below 2^a 3^b that is `r2` modulo 2^a and `r3` modulo 3^b. */
static uint64_t sequence_index(const grid *g, uint64_t r2, uint64_t r3)
{
    return r3 + g->rows * ((r2 - r3) * g->rows_inverse & (g->columns - 1));
}

/* Walks the sequence and notes at which index each segment starts. Points outside of the image do not count. */
static void find_segment_indices(filler *f, const uint32_t *starts)
{
    uint64_t x = 0, y = 0;
    uint32_t visited = 0;
    f->first[0] = 0;
    for (uint64_t i = 0, segment = 1; segment < f->segments; i++) {
        if (x < f->width && y < f->height) {
            if (visited == starts[segment])
                f->first[segment++] = i;
            visited++;
        }
        /* Adding one to i carries from the most significant digit of x and y downwards. */
        uint64_t bit = f->grid.columns / 2, trit = f->grid.rows / 3;
        for (; x & bit; bit /= 2)
            x -= bit;
        x += bit;
        for (; trit && y >= 2 * trit; trit /= 3)
            y -= 2 * trit;
        y += trit;
    }
}

static void fill_leaf(filler *f, uint64_t x0, uint64_t y0)
{
    uint64_t r2[LEAF], r3[LEAF];
    for (unsigned k = 0; k < LEAF; k++) {
        r2[k] = halton_reverse2(x0 + k, f->grid.bits);
        r3[k] = halton_reverse3(y0 + k, f->grid.trits);
    }
    for (unsigned code = 0; code < LEAF * LEAF; code++) {
        uint32_t dx, dy;
        halton_morton_decode(code, &dx, &dy);
        uint64_t x = x0 + dx, y = y0 + dy;
        if (x >= f->width || y >= f->height)
            continue;
        uint64_t index = sequence_index(&f->grid, r2[dx], r3[dy]);
        uint32_t segment = f->segments - 1; /* from the end: the last segment holds most pixels */
        while (index < f->first[segment])
            segment--;
        f->order[f->next[segment]++] = (uint32_t)(y * f->width + x);
    }
}

/* Visits the square of `size` pixels a side along the Morton curve. */
static void fill_square(filler *f, uint64_t x, uint64_t y, uint64_t size)
{
    if (x >= f->width || y >= f->height)
        return;
    if (size <= LEAF) {
        fill_leaf(f, x, y);
        return;
    }
    uint64_t half = size / 2;
    fill_square(f, x, y, half);
    fill_square(f, x + half, y, half);
    fill_square(f, x, y + half, half);
    fill_square(f, x + half, y + half, half);
}

/* 0 for a size that is not allowed. */
static uint32_t count_pixels(uint32_t width, uint32_t height)
{
    uint64_t pixels = (uint64_t)width * height;
    return pixels <= UINT32_MAX ? (uint32_t)pixels : 0;
}

halton_status halton_order(uint32_t width, uint32_t height, double ce, uint32_t *order, uint32_t *starts,
                           uint32_t *segments)
{
    if (!order)
        return HALTON_ERROR_NULL;
    halton_status status = halton_segments(count_pixels(width, height), ce, starts, segments);
    if (status != HALTON_OK)
        return status;

    filler f = {.width = width, .height = height, .grid = make_grid(width, height), .order = order};
    f.segments = *segments;
    for (uint32_t s = 0; s < f.segments; s++)
        f.next[s] = starts[s];
    find_segment_indices(&f, starts);
    uint64_t size = LEAF;
    while (size < width || size < height)
        size *= 2;
    fill_square(&f, 0, 0, size);
    return HALTON_OK;
}

halton_status halton_tile_order(uint32_t image_width, uint32_t image_height, halton_tile tile, const uint32_t *local,
                                uint32_t *order)
{
    if (!local || !order)
        return HALTON_ERROR_NULL;
    if (count_pixels(image_width, image_height) == 0 || tile.width == 0 || tile.height == 0 ||
        (uint64_t)tile.x + tile.width > image_width || (uint64_t)tile.y + tile.height > image_height)
        return HALTON_ERROR_SIZE;
    uint32_t pixels = tile.width * tile.height;
    for (uint32_t i = 0; i < pixels; i++) {
        uint32_t x = local[i] % tile.width, y = local[i] / tile.width;
        order[i] = (tile.y + y) * image_width + tile.x + x;
    }
    return HALTON_OK;
}
