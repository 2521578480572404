/* SPDX-License-Identifier: Apache-2.0 */
/* What tracer.c builds and tracer_query.c asks. */
#ifndef COMMON_TRACER_INTERNAL_H
#define COMMON_TRACER_INTERNAL_H

#include "embree_compat.h"
#include "tracer.h"

/* Ray masks: shadow rays pass through dielectrics. */
#define MASK_OPAQUE 1u
#define MASK_DIELECTRIC 2u
#define MASK_ALL (MASK_OPAQUE | MASK_DIELECTRIC)

typedef struct placement {
    bool mirrored;
    /* Position error of Embree instances: ERROR_SCALE * (condition * world coordinates + stretch * object coordinates).
     * For flattened ones condition = 1, stretch = 0. */
    float condition, stretch, translation;
} placement;

struct tracer {
    const scene *scene;
    RTCDevice device;
    RTCScene top;
    RTCScene emitters;     /* NULL: none */
    RTCScene *prototypes;  /* per mesh; NULL: flattened */
    placement *placements; /* per instance */
    int width;             /* widest native packet: 16, 8, 4 or 1 */
    bool instanced;        /* some mesh is an Embree instance */
    char error[256];       /* first thing Embree complained about */
};

#endif
