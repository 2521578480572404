/* SPDX-License-Identifier: Apache-2.0 */
/* FLIP: how different two pictures look when flipped between (Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astroem,
 * Fairchild: FLIP: A Difference Evaluator for Alternating Images, Proc. ACM Comput. Graph. Interact. Tech. 3(2), 2020);
 * HDR-FLIP: the worst over exposures (Andersson, Nilsson, Shirley, Akenine-Moeller: Visualizing Errors in Rendered High
 * Dynamic Range Images, Eurographics 2021, short papers). */
#ifndef COMMON_FLIP_H
#define COMMON_FLIP_H

#include "image.h"

/* Pixels per degree: a 4K monitor 0.7 m wide seen from 0.7 m, the paper's choice (3840 / 0.7 * 0.7 * pi / 180). */
#define FLIP_PIXELS_PER_DEGREE 67.020643276582255

/* Error in [0, 1] of each pixel into map[width * height], of two pictures of one size as png_save shows them: exposure
 * * linear value, clamped to [0, 1]; NaN counts as 0. Returns the mean. `map` may be NULL. Exits where there is no
 * memory. Thread-safe. */
double flip_ldr(const image *test, const image *reference, float exposure, float *map);

/* The same of radiance: the largest error over exposures from where the reference's brightest pixel is just not burnt
 * out to where its median is, by the ACES tone curve. Negative and non-finite values count as 0. */
double flip_hdr(const image *test, const image *reference, float *map);

#endif
