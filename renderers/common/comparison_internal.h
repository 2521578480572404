/* SPDX-License-Identifier: Apache-2.0 */
/* Shared by the comparison_*.c files. */
#ifndef COMMON_COMPARISON_INTERNAL_H
#define COMMON_COMPARISON_INTERNAL_H

#include "comparison.h"
#include "metrics.h"

typedef struct times {
    double frame_s, shade_s;
} times;

typedef struct comparison {
    const renderer *renderer;
    const program_arguments *arguments;
    int runs; /* complete pairs of frames, each with its times; 0: there is nothing to compare */
    times exact[RUNS_MAX], mode[RUNS_MAX];
    frame exact_frame, mode_frame; /* the last complete pair; without one what was begun, else empty */
    image_error lit, whole;        /* over shadow-tested radiance, and with what is seen directly */
    double flip;                   /* of whole images as a picture shows them */
    float *flip_map;               /* NULL: nothing is compared */
    double mispredicted;           /* share of the asked; < 0: unknown */
    image_error exact_reference,
        mode_reference; /* of whole images against --reference, where their frame is complete */
    double exact_reference_flip, mode_reference_flip;
} comparison;

bool frame_begun(const frame *f);
/* The frame that is to be kept: the chosen visibility's, if it was begun. */
const frame *comparison_frame(const comparison *c);
/* What errors and exposure are counted over. */
const image *frame_lit(const frame *f);
/* Emitters and sky may blow out; what is lit must be seen. */
float frame_exposure(const frame *f);

/* Medians over the pairs; the ratio exact / mode is the median of the ratios of the pairs, with the smallest and the
 * largest. Without pairs the times of the frame. */
times comparison_exact(const comparison *c);
times comparison_mode(const comparison *c);
double comparison_ratio(const comparison *c, bool shade, double *low, double *high);
double comparison_ray_ratio(const comparison *c);

void comparison_print(const comparison *c, FILE *out);
/* Image with all layers (.exr) or alone (.png). */
bool comparison_save(const comparison *c, const char *path, message *err);
/* Exact, mode and their difference (times 8) in one picture. */
bool comparison_picture(const comparison *c, const char *path, message *err);
bool comparison_json(const comparison *c, const char *path, message *err);

#endif
