/* SPDX-License-Identifier: Apache-2.0 */
/* Exact and chosen visibility side by side: times, rays, errors, as text and JSON. */
#ifndef WHITTED_COMPARE_H
#define WHITTED_COMPARE_H

#include "whitted.h"

#include "../common/metrics.h"

#include <stdio.h>

enum { RUNS_MAX = 99 };

typedef struct times {
    double frame_s, shade_s;
} times;

typedef struct comparison {
    const view *view;
    int runs; /* complete pairs of frames, each with its times; 0: there is nothing to compare */
    times exact[RUNS_MAX], mode[RUNS_MAX];
    frame exact_frame, mode_frame;               /* the last complete pair; without one what was begun, else empty */
    image_error lit, whole;                      /* over shadow-tested radiance, and with what is seen directly */
    double mispredicted;                         /* share of the asked; < 0: unknown */
    const char *reference;                       /* file; NULL: none */
    image_error exact_reference, mode_reference; /* of whole images against it, where their frame is complete */
} comparison;

/* Names of the values of options, NULL-terminated. */
extern const char *const visibility_names[], *const store_names[], *const hash_names[];
/* Of visibility_mode. */
extern const char *const mode_names[VISIBILITY_MODES];

/* Renders `runs` pairs exact, mode, exact, mode ... with the same samples, after a pair to warm up (a small one where
 * runs is 1).
 * Stops early, with the pairs that it has, when interrupted; the pair that warms up counts if there is no other. */
bool comparison_run(const view *v, int runs, bool quiet, comparison *out, message *err);
/* The chosen visibility alone. */
bool comparison_single(const view *v, bool quiet, comparison *out, message *err);
/* Errors of the frames that are complete against `reference`, read from `file`. */
void comparison_reference(comparison *c, const char *file, const image *reference);
void comparison_free(comparison *c);
bool frame_begun(const frame *f);
/* The frame that is to be kept: the chosen visibility's, if it was begun. */
const frame *comparison_frame(const comparison *c);
/* Half of the machine's memory: what images and records may plan to take. */
uint64_t memory_budget(void);
/* Bytes that the images of a run take. */
uint64_t comparison_bytes(const settings *f, bool compare, int runs);

/* Medians; the ratio exact / mode is the median of the ratios of the pairs, with the smallest and the largest. */
times comparison_median(const times *t, int count);
double comparison_ratio(const comparison *c, bool shade, double *low, double *high);

void comparison_print(const comparison *c, FILE *out);
bool comparison_json(const comparison *c, const char *path, message *err);
/* Exact, mode and their difference (times 8) in one picture. */
bool comparison_picture(const comparison *c, const char *path, message *err);
bool has_extension(const char *path, const char *extension); /* in capitals or not */
/* Image with all layers (.exr) or alone (.png). */
bool comparison_save(const comparison *c, const char *path, exr_options options, message *err);

#endif
