/* SPDX-License-Identifier: Apache-2.0 */
/* A rendered frame: its images and what it took. */
#ifndef COMMON_FRAME_H
#define COMMON_FRAME_H

#include "image.h"

/* Shadow rays: how many were wanted, how many traced. */
typedef struct ray_counts {
    uint64_t asked, traced;
} ray_counts;

/* Images of one size and floats per pixel. All but the whole may be missing; files are without them then. */
typedef struct frame {
    image image; /* the whole */
    image lit;   /* shadow-tested radiance, over which errors are counted; empty: the whole is */
    image seen;  /* emitters and sky, seen directly or by mirrors and glass */
    image normal, cells;
    float *depth, *traced_share;
    double frame_s;  /* all of it: lights, caches, paths, shading */
    double shade_s;  /* part of frame_s spent on shading, mean of the threads */
    double lights_s; /* part of frame_s that made the lights */
    ray_counts rays;
    uint64_t cache_bytes, mispredicted, eye_samples;
    bool complete; /* false where it was interrupted; all is empty where that was before the first pixel */
    void *extra;   /* what the renderer counts besides, from malloc; NULL: nothing */
} frame;

void frame_free(frame *f);

#endif
