/* SPDX-License-Identifier: Apache-2.0 */
/* The exact visibility of all pairs of eye samples and virtual point lights of a view. Whoever has it can replay any
 * way of saving shadow rays and tell exactly how many rays it traces and how wrong it is, without tracing one. */
#ifndef BENCH_RECORD_H
#define BENCH_RECORD_H

/* first: its names must not meet the renderer's */
#include "vcache/internal.h"

#include "eyes.h"

/* Loops over all lights of an eye sample are compiled for each vector width, as in renderers/whitted/shade.c. */
#if defined(__x86_64__) && defined(__linux__) && defined(__OPTIMIZE__) && !defined(NO_CLONES)
#define CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define CLONES
#endif

typedef struct record_options {
    const char *scene, *env; /* env: NULL for the scene's own */
    uint32_t width, height;
    int camera; /* of the scene's */
    int spp, vpls;
    int threads; /* of the exact rendering; 0: one per CPU */
} record_options;

typedef struct record {
    scene *scene;
    tracer *tracer;
    emitters *emitters;
    view view;
    vpl_set lights;
    float *power;    /* luminance of each light */
    uint32_t padded; /* lights, a multiple of 64 */
    uint32_t words;  /* of a row of bits */
    uint32_t count;  /* eye samples, in the order of eye_paths.c, tile by tile */
    eye_sample *eyes;
    uint32_t *pixel;           /* of the image */
    uint64_t *asked, *visible; /* [count][words] */
    uint64_t pairs;            /* bits set in `asked` */
    double energy;             /* sum of the exact shadow-tested radiance over pixels and channels */
} record;

bool record_make(const record_options *o, record *out, message *err);
void record_free(record *r);

/* Its eye samples in another order. */
static inline void record_sort(const record *r, eye_order order, double cell_pixels, uint32_t *out)
{
    eyes_sort(r->pixel, r->count, r->view.settings.width, order, cell_pixels, out);
}

/* Unoccluded contributions of all lights to an eye sample, in units of the pixel: one array a channel. */
typedef struct record_row {
    float *r, *g, *b, *luminance; /* [padded] */
} record_row;
record_row record_row_new(const record *r);
void record_row_free(record_row *row);
void record_contributions(const record *r, uint32_t eye, record_row *row);
/* Of one light. */
rgb record_contribution(const record *r, uint32_t eye, uint32_t light);

/* A cache with the scene's bounds; exits where `config` is wrong, for it is the program's own. */
vcache *record_cache(const record *r, vcache_config config);
vcache_surface record_surface(const record *r, uint32_t eye);

/* Rows of bits by cell, as many as are asked for. */
typedef struct cells {
    uint64_t *keys;  /* open addressing, 0: free */
    uint32_t *index; /* of the row */
    uint64_t mask;
    uint32_t count, capacity, words;
    uint64_t *bits; /* [capacity][2][words] */
} cells;

#define NO_CELL UINT32_MAX
void cells_new(cells *c, uint32_t words);
void cells_free(cells *c);
uint32_t cells_find(const cells *c, uint64_t key);
/* Finds or adds; moves the rows. */
uint32_t cells_add(cells *c, uint64_t key);

/* First half of a row: known or seen visible; second half: visible or seen blocked. */
static inline uint64_t *cells_row(const cells *c, uint32_t index)
{
    return c->bits + (size_t)index * 2 * c->words;
}

#endif
