/* SPDX-License-Identifier: Apache-2.0 */
/* What some paths all over the image tell before its first pass. Their walks have random numbers of their own, so that
 * nothing that follows from them is biased, and exact ones for every mode, so that all modes draw the same paths. */
#ifndef BDPT_PILOT_H
#define BDPT_PILOT_H

#include "bdpt.h"

enum { PILOT_REGIONS = 8 }; /* of the image, along each axis */

struct pilot {
    /* Luminance of a connection below which roulette draws it: a share of the region's mean. By pilot_region. */
    float least[PILOT_REGIONS * PILOT_REGIONS];
    /* More connections fall to occlusion than to the roulette: ask for visibility first, weigh what is visible. */
    bool visibility_first;
    density_map *eye_density, *light_density; /* of vertices; NULL: not wanted */
};

static inline uint32_t pilot_region(const settings *f, uint32_t pixel)
{
    uint64_t x = pixel % f->width, y = pixel / f->width;
    return (uint32_t)(y * PILOT_REGIONS / f->height * PILOT_REGIONS + x * PILOT_REGIONS / f->width);
}

pilot *pilot_new(const view *v, bool densities);
void pilot_free(pilot *p);

#endif
