/* SPDX-License-Identifier: Apache-2.0 */
/*
 * vcache/grid.h - shadows of hundreds of directional lights, as environment maps are sampled into, from few rays.
 *
 * Pixels are evaluated from coarse to fine. Where the four pixels around one agree on a light, it is taken to see or
 * not to see it as they do; where they do not, a shadow ray is traced, and where rays surprise, lights that lie beside
 * theirs on the sphere are traced as well. Visibility of all lights at a pixel is a set of bits, and agreement,
 * uncertainty and flooding are AND, OR and XOR of 64 lights at a time.
 *
 * Based on: A. Ben-Artzi, R. Ramamoorthi, M. Agrawala, "Efficient Shadows for Sampled Environment Maps", Journal of
 * Graphics Tools 11(1), 2006, and the technical report of the same name. "Sect.", "Fig." and "Table" below are the
 * journal's; docs/grid.md says where the two differ and what was chosen.
 *
 * In four steps:
 *   1. vcache_grid_create_lights for the directions of the lights, once for a map; any number of threads share it.
 *   2. vcache_grid_default_config, perhaps vcache_grid_parse_mode, vcache_grid_create: one for each thread.
 *   3. For each image, or each block of one: vcache_grid_begin; for each pixel that sees a surface vcache_grid_pixel,
 *      and the bits of the lights above its horizon. Then while vcache_grid_next gives rays, trace them any way you
 *      like and vcache_grid_tell the answers. They are in order of lights: packets of one light and neighbouring
 * pixels.
 *   4. Read vcache_grid_visible of each pixel.
 *
 * Blocks know nothing of each other (Sect. 6.3.2): they can go to any thread in any order and the picture is the same,
 * and 64 x 64 pixels with 200 lights need 1 MiB. A smaller block traces a little more: its last row and column belong
 * to its coarsest lattice, and pixels on its border have three informing pixels instead of four.
 *
 * Pixels are those of the finest lattice that is sampled (Sect. 6.1): with 4 x 4 samples a pixel, 4 x 4 of them.
 *
 * Threads, errors: as in vcache.h. The library starts no thread and takes no lock; creation returns a status and a
 * message; hot calls cannot fail and do not allocate.
 */
#ifndef VCACHE_GRID_H
#define VCACHE_GRID_H

#include "vcache.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Masks of neighbours take N^2 / 8 bytes: 32 MiB. */
#define VCACHE_GRID_MAX_LIGHTS 16384

/* ----------------------------------------------------------------------------------------- lights and their cells */

/* Directional lights and the Voronoi diagram of their directions on the sphere (Sect. 3, Fig. 2). Read-only. */
typedef struct vcache_grid_lights vcache_grid_lights;

/* `directions`: [count][3] towards the lights; their length does not matter. `energy`: [count] any measure of how much
 * each brings, or NULL: all the same. Both are copied. count: 1 ... VCACHE_GRID_MAX_LIGHTS. `allocator`: NULL for the C
 * library's. On failure *out is NULL and `message` (VCACHE_MESSAGE_BYTES bytes, or NULL) says why. */
VCACHE_API vcache_status vcache_grid_create_lights(const float *directions, const float *energy, uint32_t count,
                                                   const vcache_allocator *allocator, vcache_grid_lights **out,
                                                   char *message);
/* After all that use it. Sets *lights to NULL; NULL and a pointer to NULL are fine. */
VCACHE_API void vcache_grid_destroy_lights(vcache_grid_lights **lights);

/* Lights whose cells touch that of `light`: bit i % 64 of word i / 64, vcache_grid_words() words. Symmetric, a light is
 * not its own neighbour; about 6 on average. Lights that coincide are neighbours and share their other ones. */
VCACHE_API const uint64_t *vcache_grid_neighbours(const vcache_grid_lights *lights, uint32_t light);
/* (count + 63) / 64 */
VCACHE_API uint32_t vcache_grid_words(const vcache_grid_lights *lights);
/* The light nearest to a direction, whose length does not matter. */
VCACHE_API uint32_t vcache_grid_nearest(const vcache_grid_lights *lights, const float direction[3]);

/* -------------------------------------------------------------------------------------------------------- a method */

/* In which order pixels are evaluated. */
typedef enum vcache_grid_order {
    VCACHE_GRID_TRUE,     /* every light above the horizon is traced at every pixel */
    VCACHE_GRID_EYE,      /* none is: no shadows, what the rest of a frame costs */
    VCACHE_GRID_SCANLINE, /* Sect. 4.1.1: informed by the pixels to the left, above, and left above */
    VCACHE_GRID_GRID      /* Sect. 4.1.2, Fig. 3: informed by the four around it of the coarser lattice */
} vcache_grid_order;

/* What it is made from; start from vcache_grid_default_config. */
typedef struct vcache_grid_config {
    size_t size;             /* sizeof(vcache_grid_config) of the host's header, set with the defaults */
    uint32_t pixels;         /* of the largest block, width x height; 1 ... 2^24, default 65 x 65 */
    vcache_grid_order order; /* default VCACHE_GRID_GRID */
    bool warping;            /* Sect. 4.1.3: blockers are points, seen anew from each pixel; default false */
    bool boundary;           /* Sect. 4.2.1: lights at a border of visible and blocked ones are traced; default false:
                                Sect. 4.2.2, those that informing pixels disagree on */
    bool restricted;         /* Sect. 6.1: flooding goes on to lights alone that disagree with the ray; default true */
    uint32_t flood;   /* flooding only where informing pixels are farther away than that, 0 ... 64 pixels; 1: not in
                         the last step, that of half of all pixels (Sect. 6.1); default 2 */
    uint32_t near;    /* where informing pixels are no farther away than that, 0 ... 64 pixels, three of them on the
                         pixel's object are enough, and for methods that neither warp nor flood boundaries a light that
                         two call blocked and the others have below their horizon is blocked; 0: as the texts have it,
                         traced; default 2 */
    uint32_t rounds;  /* of flooding at most, each one light further; default 0: as many as it takes */
    uint32_t bright;  /* boundary flooding for that many of the most energetic lights (Sect. 7); default 0 */
    uint32_t spacing; /* of the coarsest lattice, pixels; a power of two, 2 ... 64, default 16 */
    float threshold;  /* boundary: a cell with more blockers than that is taken for blocked, 0 ... 3.99, default
                         0.99; without warping also one that all informing pixels call blocked */
    uint32_t rays;    /* in one batch, at least the number of lights; default 16384 */
    vcache_allocator allocator; /* default: the C library's */
} vcache_grid_config;

/* NEAR, as vcache_fill_config. */
VCACHE_API void vcache_grid_fill_config(vcache_grid_config *out, size_t size);
/* The same by value, compiled into the host. */
static inline vcache_grid_config vcache_grid_default_config(void)
{
    vcache_grid_config config;
    vcache_grid_fill_config(&config, sizeof config);
    return config;
}

/* Sets what a name of Sect. 5 and 6 stands for, and leaves the rest of *config alone:
 *   TRUE, EYE; SNB, SNU, SWB, SWU, GNB, GNU, GWB, GWU (scanline or grid, no warping or warping, boundary or uncertainty
 *   flooding); RES and FLO: GNU with restricted flooding, GNU with none in the finest step; OPT: GNU with both; NEAR:
 *   OPT with flood and near 2, which the texts do not have.
 * Behind the name, each after a comma: spacing=N, rounds=N, bright=N, flood=N, near=N, threshold=X. False, with a
 * message, for anything else. */
VCACHE_API bool vcache_grid_parse_mode(const char *text, vcache_grid_config *config, char *message);
/* All names, NULL-terminated. */
VCACHE_API const char *const *vcache_grid_mode_names(void);

/* One thread's means of deciding a block of pixels. */
typedef struct vcache_grid vcache_grid;
/* `lights` must outlive it. */
VCACHE_API vcache_status vcache_grid_create(const vcache_grid_config *config, const vcache_grid_lights *lights,
                                            vcache_grid **out, char *message);
VCACHE_API void vcache_grid_destroy(vcache_grid **grid);
/* Memory that it takes, scratch included. */
VCACHE_API size_t vcache_grid_bytes(const vcache_grid *grid);

/* --------------------------------------------------------------------------------------------------------- a block */

/* Begins a block of width x height pixels, 1 ... config.pixels of them, whatever became of the last. All pixels are
 * empty: they see no surface, are not decided and inform nobody. */
VCACHE_API void vcache_grid_begin(vcache_grid *grid, uint32_t width, uint32_t height);

/* What pixel (x, y) sees. `object`: any number; visibility is passed on between pixels of one object alone (Sect. 6.2,
 * line 7). `position`: of the surface; read by methods that warp, else it may be NULL. Returns the pixel's row of
 * lights that are asked for, [words] zeroed: set the bits of lights above its horizon before the first
 * vcache_grid_next. */
VCACHE_API uint64_t *vcache_grid_pixel(vcache_grid *grid, uint32_t x, uint32_t y, uint64_t object,
                                       const float position[3]);

/* A shadow ray that is to be traced. */
typedef struct vcache_grid_ray {
    uint32_t pixel; /* y * width + x */
    uint32_t light; /* of the lights */
} vcache_grid_ray;

/* The next rays to trace, *count of them, in order of lights and for one light in the order of neighbouring pixels; no
 * pair comes twice. *count = 0: all pixels are decided. They stay valid until the next call. */
VCACHE_API const vcache_grid_ray *vcache_grid_next(vcache_grid *grid, uint32_t *count);

/* Answers to all of them, in their order: VCACHE_VISIBLE or VCACHE_BLOCKED; VCACHE_ONCE makes no difference.
 * `distance`: of the nearest blocker, in the unit of positions, where blocked; read by methods that warp, else it may
 * be NULL. A distance that is not finite counts as far away: it stays where it is when warped. */
VCACHE_API void vcache_grid_tell(vcache_grid *grid, const vcache_answer *answers, const float *distance);

/* Bits of the lights that a pixel sees, of those asked for; [words]. */
VCACHE_API const uint64_t *vcache_grid_visible(const vcache_grid *grid, uint32_t x, uint32_t y);

/* ----------------------------------------------------------------------------------------------------- statistics */

/* What was asked and traced. */
typedef struct vcache_grid_statistics {
    size_t size;         /* in: sizeof(vcache_grid_statistics); out: bytes that this version filled */
    uint64_t pixels;     /* that see a surface and ask for a light */
    uint64_t asked;      /* pairs of pixel and light above its horizon */
    uint64_t traced;     /* of these: traced, the sum of the following */
    uint64_t coarse;     /* at pixels that begin: the coarsest lattice; first row and column of scanline order */
    uint64_t silhouette; /* at pixels of whose informing pixels too many see another object or none */
    uint64_t uncertain;  /* where predictions were in doubt: disagreement, boundaries, horizons */
    uint64_t flooded;    /* for the sake of a neighbour that surprised */
    uint64_t surprises;  /* predictions that a ray refuted */
    uint64_t batches;    /* calls of vcache_grid_next that gave rays */
} vcache_grid_statistics;

/* Counts since it was created or reset. */
VCACHE_API void vcache_grid_statistics_of(const vcache_grid *grid, vcache_grid_statistics *out);
VCACHE_API void vcache_grid_reset_statistics(vcache_grid *grid);

#ifdef __cplusplus
}
#endif

#endif
