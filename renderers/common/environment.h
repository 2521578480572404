/* SPDX-License-Identifier: Apache-2.0 */
/* Environment light: an equirectangular map (Radiance .hdr or OpenEXR) or a uniform sky, with importance sampling.
 * World convention: y up; row 0 of the map looks at +y; direction (x, y, z) maps to
 * u = 0.5 + atan2(x, -z) / (2 pi), v = acos(y) / pi. Read-only after creation: shared by threads. */
#ifndef COMMON_ENVIRONMENT_H
#define COMMON_ENVIRONMENT_H

#include "image.h"
#include "message.h"
#include "vec.h"

#include <stdbool.h>
#include <stdint.h>

typedef struct environment environment;

environment *environment_uniform(rgb radiance);
/* Takes width x height pixels of the image (copied). Negative or non-finite pixels are set to 0 with a notice. */
bool environment_from_image(const image *map, environment **out, message *err);
bool environment_load(const char *path, environment **out, message *err);
void environment_free(environment *e);
/* Turns it about the vertical axis, counter-clockwise seen from above, by `degrees` from where the map has it. Before
 * it is shared. */
void environment_rotate(environment *e, double degrees);

/* Radiance seen along unit `direction` (away from the scene), bilinear. */
rgb environment_radiance(const environment *e, vec3 direction);
/* Draws a unit direction towards the light from (u1, u2) in [0,1)^2, with its radiance and its density per steradian
 * (> 0 wherever the radiance is > 0). */
vec3 environment_sample(const environment *e, float u1, float u2, rgb *radiance, float *pdf);
/* `count` of them, faster: for large maps memory is waited for together. The results are those of one by one. Where
 * `normals` are given, a direction that leaves below its normal is not looked up: radiance and density are 0. */
void environment_sample_batch(const environment *e, uint32_t count, const float *u1, const float *u2,
                              const vec3 *normals, vec3 *directions, rgb *radiance, float *pdf);
/* environment_radiance and environment_pdf in one. */
rgb environment_lookup(const environment *e, vec3 direction, float *pdf);
/* Density per steradian with which environment_sample draws `direction`. */
float environment_pdf(const environment *e, vec3 direction);
/* Mean radiance over the sphere. */
rgb environment_mean(const environment *e);

/* For who walks over the map itself, not rotated. Pixels along its sides; 1 x 1 where it is uniform. */
void environment_map_size(const environment *e, uint32_t *width, uint32_t *height);
/* Bilinear, at 0 <= s <= width, 0 <= t <= height; the first pixel's centre is (0.5, 0.5). */
rgb environment_map_radiance(const environment *e, float s, float t);
/* Where a direction of the map ends up by environment_rotate. */
vec3 environment_rotated(const environment *e, vec3 direction);

#endif
