/* SPDX-License-Identifier: Apache-2.0 */
/* Error of an image against a reference of the same size. */
#ifndef COMMON_METRICS_H
#define COMMON_METRICS_H

#include "image.h"

typedef struct image_error {
    double l_inf;   /* change of energy (Popov et al. 2013, Sect. 5): sum |a - b| / sum b over all channels */
    double rel_mse; /* mean over pixels and channels of (a - b)^2 / (b^2 + 0.01), top 0.1 % of pixels trimmed */
    double p999;    /* 99.9th percentile of |luminance difference| / mean luminance of the reference */
    double max;     /* the largest of the same */
    /* |luminance difference| / luminance of the reference, mean and largest over the pixels where that is not black */
    double mean_relative, max_relative;
} image_error;

/* Non-finite pixels count as a difference of the reference's maximum, so they never go unseen. A black reference gives
 * 0 where the image is black as well and infinity elsewhere. */
image_error image_compare(const image *test, const image *reference);

/* How many of its pixels are infinite or no number. */
size_t image_not_finite(const image *i);

/* |test - reference| * scale as a grey-to-red false-colour picture. */
image image_difference(const image *test, const image *reference, float scale);
/* Pictures of one height side by side with a gap of 4 pixels. */
image image_side_by_side(const image *const *images, size_t count);
/* Exposure that maps the 99th percentile of luminance to 0.9, for PNG. */
float image_exposure(const image *i);
/* Of an image that was read from `path`: what the renderer that wrote it says it showed it with, as light that is not
 * shadow-tested does not count there; a file that does not say: of the image. */
float image_file_exposure(const char *path, const image *i);

#endif
