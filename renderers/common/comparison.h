/* SPDX-License-Identifier: Apache-2.0 */
/* Exact and chosen visibility of a renderer side by side: times, rays, errors, as table, images and JSON. */
#ifndef COMMON_COMPARISON_H
#define COMMON_COMPARISON_H

#include "frame.h"
#include "program.h"

#include <cjson/cJSON.h>
#include <stdio.h>

/* What a renderer is to make. */
typedef struct frame_request {
    uint32_t width, height; /* of --size, but for a small one that warms up */
    bool exact;             /* visibility; false: the chosen one */
    bool count;             /* mispredictions: the exact frame keeps its answers for the chosen one, which is next */
    const char *title;      /* of the progress line */
    bool quiet;
} frame_request;

/* Texts that go with an image into .exr and .png. */
enum { TEXTS_MAX = 48 };
typedef struct image_texts {
    exr_attribute items[TEXTS_MAX];
    char values[TEXTS_MAX][128];
    int count;
} image_texts;

#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
void image_text(image_texts *t, const char *name, const char *format, ...);

/* A program's way to render, and what it says of frame f besides what is said of every renderer's. All functions get
 * `context`; all but render may be NULL. */
typedef struct renderer {
    void *context;
    const scene *scene;
    const char *mode;    /* the chosen visibility, as files name it; the other one is "exact" */
    bool mispredictions; /* can be counted */
    /* Fills *out, which is empty; interrupted, with what there is (before the first pixel: nothing). Both visibilities
     * take the same random numbers. */
    bool (*render)(void *context, const frame_request *wanted, frame *out, message *err);
    /* The row of a frame of the chosen visibility in the table, at most 19 characters; without it the mode. */
    void (*name)(const void *context, const frame *f, char *out, size_t size);
    /* End of the table's first line: ", 1 light". */
    void (*heading)(const void *context, const frame *f, FILE *out);
    /* Settings and counts. */
    void (*json)(const void *context, const frame *f, cJSON *out);
    /* What this one frame took. */
    void (*json_run)(const void *context, const frame *f, cJSON *out);
    /* Of the frame that is written; `exact`: its visibility is, and was not chosen. */
    void (*texts)(const void *context, const frame *f, bool exact, image_texts *out);
} renderer;

/* Renders as the arguments say: one frame, or with --compare pairs exact, chosen, exact, chosen ... after a pair to
 * warm up (a small one where there is one pair alone). Prints the table, with errors against `reference` where the
 * arguments name one, and writes all files. Interrupted, it stops early with what there is; where that is nothing, no
 * file is touched. */
bool renderer_run(const renderer *r, const program_arguments *a, const image *reference, message *err);

/* ", 1,234 lights"; `what` in the singular. */
void print_count(FILE *out, uint64_t n, const char *what);
/* JSON has no infinity: null. */
void json_add_number(cJSON *object, const char *name, double value);
/* The shortest decimal number: 0.1f as it was given. */
void json_add_float(cJSON *object, const char *name, float value);

#endif
