/* SPDX-License-Identifier: Apache-2.0 */
/* Pixel order for progressive, coherent rendering: Popov et al., "Adaptive Quantization Visibility Caching", Computer
 * Graphics Forum 32(2), 2013, Sect. 4.3.
 *
 * All pixels are listed in the order in which the two-dimensional Halton sequence (bases 2 and 3) visits them. The list
 * is cut into segments that grow by a factor of 3.7, and each segment is sorted by Morton code: every segment covers
 * the image evenly and about 3.7 times as densely as all before it, while neighbours in the list are mostly neighbours
 * in the image.
 *
 *     uint32_t *order = malloc(sizeof *order * width * height);
 *     uint32_t starts[HALTON_MAX_SEGMENTS + 1], segments;
 *     halton_order(width, height, 8.0, order, starts, &segments);
 *     for (uint32_t s = 0; s < segments; s++)
 *         for (uint32_t i = starts[s]; i < starts[s + 1]; i++)
 *             render_pixel(order[i] % width, order[i] / width);
 *
 * Depends on libc alone, allocates nothing, keeps no state: every function may run from any number of threads on
 * different output. Results do not depend on compiler or machine. Pixels are numbered y * width + x, row 0 first. */
#ifndef HALTON_HALTON_H
#define HALTON_HALTON_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#ifndef HALTON_API
#if defined(__GNUC__)
#define HALTON_API __attribute__((visibility("default")))
#else
#define HALTON_API
#endif
#endif

/* Largest number of segments of any order: 2^32 pixels from a first segment of one pixel. */
#define HALTON_MAX_SEGMENTS 18

/* Growth of the segments, C_PG in the paper. Smaller: more segments, each less dense and so less coherent. */
#define HALTON_GROWTH 3.7

/* What became of a call. */
typedef enum halton_status {
    HALTON_OK = 0,
    HALTON_ERROR_NULL, /* an output or input pointer is NULL */
    HALTON_ERROR_SIZE, /* a side is 0, the image has more than 2^32 - 1 pixels, or a tile reaches outside of it */
    HALTON_ERROR_CE    /* C_E is not a positive finite number */
} halton_status;

/* English text of a status, without a newline; never NULL. */
HALTON_API const char *halton_status_text(halton_status status);

/* Cuts a list of `pixels` entries into segments. With T = pixels, segment s is [starts[s], starts[s + 1]); starts[0] =
 * 0, then floor(c), floor(3.7 c), floor(3.7^2 c) ... with c = max(1, T / ce^2) while below T, then starts[*segments] =
 * T. pixels    1 ... 2^32 - 1 ce        C_E, the cell size in pixels a side; > 0 and finite. At 1 and below, all pixels
 * form one segment. starts    HALTON_MAX_SEGMENTS + 1 entries segments  1 ... HALTON_MAX_SEGMENTS On an error nothing
 * is written. */
HALTON_API halton_status halton_segments(uint32_t pixels, double ce, uint32_t *starts, uint32_t *segments);

/* Lists all pixels of an image, each exactly once, segment by segment, sorted by Morton code inside each. O(pixels).
 *   width, height  at least 1, at most 2^32 - 1 pixels together
 *   ce             as above
 *   order          width * height entries
 *   starts, segments  as above
 * On an error nothing is written. */
HALTON_API halton_status halton_order(uint32_t width, uint32_t height, double ce, uint32_t *order, uint32_t *starts,
                                      uint32_t *segments);

/* A part of an image. */
typedef struct halton_tile {
    uint32_t x, y;          /* first pixel, in the image */
    uint32_t width, height; /* in pixels, at least 1 */
} halton_tile;

/* Moves a tile's own order to its place in the image. The order of one tile size is computed once, by
 * halton_order(tile.width, tile.height, ...), and serves every tile of that size with the same segments; an image has
 * at most four sizes.
 *   image_width, image_height  the image that holds the tile entirely
 *   local  tile.width * tile.height entries from halton_order
 *   order  as many entries: pixels of the image. May be `local` itself, but not overlap it otherwise
 * On an error nothing is written. */
HALTON_API halton_status halton_tile_order(uint32_t image_width, uint32_t image_height, halton_tile tile,
                                           const uint32_t *local, uint32_t *order);

/* Morton code: bit k of x goes to bit 2k, bit k of y to bit 2k + 1. */
HALTON_API uint64_t halton_morton(uint32_t x, uint32_t y);
/* The inverse. x and y must not be NULL. */
HALTON_API void halton_morton_decode(uint64_t code, uint32_t *x, uint32_t *y);

/* The lowest `digits` digits of i in reverse: floor(radical inverse * base^digits), exactly, where i < base^digits.
 * More than 64 binary or 40 ternary digits (what 64 bits hold) are taken as 64 or 40. */
HALTON_API uint64_t halton_reverse2(uint64_t i, unsigned digits);
HALTON_API uint64_t halton_reverse3(uint64_t i, unsigned digits);

/* Radical inverse of i in [0, 1): exact for i < 2^53 in base 2, correctly rounded for i < 3^33 in base 3; higher digits
 * of i are below the last bit of the result and left out. */
HALTON_API double halton_radical_inverse2(uint64_t i);
HALTON_API double halton_radical_inverse3(uint64_t i);

#ifdef __cplusplus
}
#endif

#endif
