/* SPDX-License-Identifier: Apache-2.0 */
/* An environment as directional lights: structured importance sampling (Agarwal, Ramamoorthi, Belongie and Jensen
 * 2003). */
#ifndef COMMON_ENVIRONMENT_LIGHTS_H
#define COMMON_ENVIRONMENT_LIGHTS_H

#include "scene.h"

typedef struct environment_light {
    vec3 direction; /* unit, towards the light */
    rgb irradiance; /* on a facing surface, W / m^2: the integral of the radiance nearest to this light */
} environment_light;

/* Fills out[0 ... count - 1], brightest regions first, no direction twice; together they bring what the environment
 * does, 4 pi environment_mean. Returns how many there are: fewer than `count` where less of the map is not black than
 * that many directions, none where all is. The map is sampled as it lies, and the lights are rotated with it. Takes
 * memory for some 2^19 directions (2^22 where nearly all of the map is black), whatever the map's size. One thread; the
 * result depends on the arguments alone. */
uint32_t environment_lights(const environment *e, uint32_t count, environment_light *out);

/* The scene's environment as `count` more of its lights; with a notice where there are less. */
void scene_add_environment_lights(scene *s, int count);

#endif
