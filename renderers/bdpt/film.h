/* SPDX-License-Identifier: Apache-2.0 */
/* What passes are summed into. */
#ifndef BDPT_FILM_H
#define BDPT_FILM_H

#include "bdpt.h"

/* The mean of all passes so far. It is all there is to go on from, so that a file with it continues a rendering
 * exactly.
 */
typedef struct film {
    image mean;
    image seen; /* of it: emitters and sky, directly or by mirrors and glass; empty where a file was gone on from */
    image normal;
    float *depth;
    uint32_t passes;
    bool begun; /* something is in the mean */
} film;

film film_new(uint32_t width, uint32_t height);
void film_free(film *f);
/* A pass, `seen` included, and that alone. */
void film_add(film *f, const image *pass, const image *seen);

/* Means of rendering passes of one view. `cache`: NULL for exact visibility; shared by all threads. */
typedef struct passes passes;
passes *passes_new(const view *v, vcache *cache, film *out);
void passes_free(passes *p);
/* Adds pass `index`, whose random numbers are its own. False where it was interrupted: it is left out then, but for the
 * first, of which the film has the part that is done, if any, and counts none. */
bool passes_render(passes *p, uint32_t index);
/* Depth and normal alone, of the first pass, where one goes on from later ones. False where it was interrupted. */
bool passes_first_hits(passes *p);
/* So far; seconds that threads spent on visibility, their mean, and on asking the cache for it, their sum. */
counts passes_counts(const passes *p, double *visibility_s, double *asking_s);

#endif
