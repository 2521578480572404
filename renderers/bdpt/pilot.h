/* SPDX-License-Identifier: Apache-2.0 */
/* What some paths all over the image tell before its first pass. Their walks have random numbers of their own, so that
 * nothing that follows from them is biased, and exact ones for every mode, so that all modes draw the same paths. */
#ifndef BDPT_PILOT_H
#define BDPT_PILOT_H

#include "bdpt.h"

enum { PILOT_REGIONS = 8 }; /* of the image, along each axis */

struct pilot {
    /* Luminance of a connection below which roulette draws it: a share of the region's mean, by y and x. */
    float least[PILOT_REGIONS][PILOT_REGIONS];
    /* More connections fall to occlusion than to the roulette: ask for visibility first, weigh what is visible. */
    bool visibility_first;
    density_map *eye_density, *light_density; /* of vertices; NULL: not wanted */
};

pilot *pilot_new(const view *v, bool densities);
void pilot_free(pilot *p);

#endif
