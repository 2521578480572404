/* SPDX-License-Identifier: Apache-2.0 */
/* All eye samples of a view at once, and the orders in which they may be lit. */
#ifndef BENCH_EYES_H
#define BENCH_EYES_H

#include "renderers/whitted/whitted.h"

typedef struct eye_list {
    eye_sample *items; /* in the order of eye_paths.c, tile by tile along a Morton curve, as a frame has them */
    uint32_t *pixel;   /* of the image */
    uint32_t count;
    size_t *starts, passes; /* where each pass over a tile begins, and the end: [passes + 1] */
} eye_list;

eye_list eye_list_new(const view *v);
void eye_list_free(eye_list *l);

/* HALTON is the order of renderers/whitted/frame.c: tiles along a Morton curve, in each the Halton order of the pixels,
 * which depends on the cell's side in pixels. SCANLINE and RANDOM: of the whole image. */
typedef enum eye_order { ORDER_HALTON, ORDER_SCANLINE, ORDER_MORTON, ORDER_RANDOM } eye_order;
/* Sorts `count` eye samples of these pixels of an image: out[count] are their indices. */
void eyes_sort(const uint32_t *pixel, uint32_t count, uint32_t width, eye_order order, double cell_pixels,
               uint32_t *out);

#endif
