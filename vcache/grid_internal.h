/* SPDX-License-Identifier: Apache-2.0 */
/* What grid*.c share. */
#ifndef VCACHE_GRID_INTERNAL_H
#define VCACHE_GRID_INTERNAL_H

#include "bits.h"
#include "grid.h"
#include "internal.h"

struct vcache_grid_lights {
    vcache_allocator allocator;
    size_t bytes;
    uint32_t count, words;
    uint32_t side;        /* of the map, texels; a power of two */
    float *direction;     /* [count][3], unit */
    uint16_t *map;        /* [side][side] octahedral: the light nearest to the middle of each texel */
    uint64_t *neighbours; /* [count][words] */
    uint16_t *ranked;     /* [count] by energy, the brightest first */
};

/* Informing pixels of a pixel. */
enum { INFORMERS = 4 };

/* Where evaluation stands: steps in order, parts of a step in order. Pixels of a part do not inform each other. */
typedef struct grid_walk {
    uint32_t width, height;
    uint32_t spacing;
    vcache_grid_order order;
    uint32_t h;    /* half the distance of the lattice that informs; `spacing`: the coarsest lattice itself */
    bool straight; /* second half of a level, Fig. 3 right: informers lie left, right, above, below */
    uint32_t tile_x, tile_y;
    uint32_t diagonal; /* scanline: x + y */
    uint32_t taken;    /* of its pixels */
    bool done;
} grid_walk;

/* A part is a tile of so many lattice steps a side, at most half as many more, and at most so many pixels. */
enum { TILE_STEPS = 64, COARSE_STEPS = 32, PART_PIXELS = 5000 };

void grid_walk_begin(grid_walk *w, vcache_grid_order order, uint32_t spacing, uint32_t width, uint32_t height);
/* The pixels (y * width + x) of the next part, neighbours close together, and in *part where they stand, for the calls
 * below; returns their number, 0 at the end. */
uint32_t grid_walk_part(grid_walk *w, grid_walk *part, uint32_t *pixels);
/* Pixels that inform one of the part; 0: it begins, and is traced in full. */
uint32_t grid_informers(const grid_walk *w, uint32_t pixel, uint32_t informers[INFORMERS]);
/* Whether the part's pixels are informed by others of a grid at most so many pixels away. */
bool grid_within(const grid_walk *w, uint32_t pixels);

struct vcache_grid {
    vcache_grid_config config;
    const vcache_grid_lights *lights;
    size_t bytes;
    uint32_t words;
    vcache_grid_statistics statistics;
    uint64_t *bright;  /* [words] the most energetic lights */
    uint64_t *valid;   /* [words] all lights */
    uint64_t *scratch; /* [SCRATCH_ROWS][words] */

    /* the block */
    uint32_t width, height;
    uint64_t *bits;   /* [pixels][2][words]: lights asked for, and seen; with up to 256 lights a cache line */
    uint64_t *object; /* [pixels] */
    uint8_t *seen;    /* [pixels] 0: sees nothing */
    float *position;  /* [pixels][3]; warping alone */
    float *blocker;   /* [pixels][count][3] points, where blocked; warping alone */

    /* the part */
    grid_walk next, walk; /* where the next part stands; this one */
    uint32_t *part;       /* its pixels */
    uint32_t *active;     /* places in `part` of those with something to trace in this round */
    uint32_t active_count, emitted;
    uint32_t round;
    bool flooding;
    /* [pixels of the part][words] */
    uint64_t *todo;      /* to be traced in this round */
    uint64_t *traced;    /* in this round and before */
    uint64_t *predicted; /* visible, of those to be traced */
    uint64_t *doubtful;  /* of those to be traced: no answer agrees with a prediction */

    /* the batch */
    vcache_grid_ray *rays;
    uint32_t ray_count;
    uint32_t *counts; /* [count] rays of each light */
    uint8_t *hits;    /* [count] warping: blockers in each cell */
    float *closeness; /* [count] warping: cosine between the light and the nearest of them */
};

enum { SCRATCH_ROWS = 9 };

/* The next array of a block of memory, on a cache line; NULL: only counts. */
static inline void *grid_carve(char *block, size_t *at, size_t count, size_t size)
{
    void *p = block ? block + *at : NULL;
    *at += (count * size + 63) / 64 * 64;
    return p;
}

static inline uint64_t *grid_row(uint64_t *rows, uint32_t words, size_t index)
{
    return rows + index * words;
}

static inline uint64_t *grid_asked(const vcache_grid *g, size_t pixel)
{
    return grid_row(g->bits, g->words, 2 * pixel);
}

static inline uint64_t *grid_visible(const vcache_grid *g, size_t pixel)
{
    return grid_row(g->bits, g->words, 2 * pixel + 1);
}

static inline uint32_t grid_count(const uint64_t *row, uint32_t words)
{
    uint32_t n = 0;
    for (uint32_t w = 0; w < words; w++)
        n += count_ones(row[w]);
    return n;
}

static inline bool grid_any(const uint64_t *row, uint32_t words)
{
    uint64_t all = 0;
    for (uint32_t w = 0; w < words; w++)
        all |= row[w];
    return all != 0;
}

/* Whether neighbours of what is doubtful go out with it: any answer floods to them. Not where rounds are counted. */
static inline bool grid_at_once(const vcache_grid_config *f)
{
    return !f->boundary && !f->restricted && f->rounds == 0;
}

/* grid_predict.c: visibility of pixel `at` of the part as far as others know it, and what is to be traced there. */
void grid_predict(vcache_grid *g, uint32_t at);
/* Neighbours of all lights of `of` into `out`. */
void grid_neighbours_of(const vcache_grid_lights *l, const uint64_t *of, uint64_t *out);
/* grid_warp.c: from blockers of the informing pixels. `unclear`: some, but fewer than there are informing pixels;
 * `blocked`: more than the threshold (boundary) or at least as many as there are. */
void grid_warp(vcache_grid *g, uint32_t pixel, const uint32_t *informers, uint32_t count, uint64_t *blocked,
               uint64_t *unclear);

#endif
