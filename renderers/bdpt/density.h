/* SPDX-License-Identifier: Apache-2.0 */
/*
 * How many vertices a sub-path leaves per unit area, by place: P of Eq. 6.
 *
 * The densities that a path was drawn with will not do: that of all of its vertices has a unit that depends on their
 * number, and that of the last given the one before differs from path to path at one place, so that ends there would be
 * quantized by different grids and share nothing. So it is counted: some pilot paths leave their vertices in an octree
 * that is divided where there are more than a few. It knows no unit but the scene's, and cannot become 0 or infinite.
 */
#ifndef BDPT_DENSITY_H
#define BDPT_DENSITY_H

#include "../common/vec.h"

#include <stdint.h>

/* Of the vertices of one side. Read-only once built: shared by threads. */
typedef struct density_map density_map;

/* From the vertices of `paths` sub-paths; all lie in the cube around `center` of half edge `radius` > 0. */
density_map *density_map_new(const vec3 *vertices, uint32_t count, uint32_t paths, vec3 center, float radius);
void density_map_free(density_map *m);
/* Per unit area and path. */
float density_at(const density_map *m, vec3 position);
/* It is wanted soon: maps are larger than the caches next to the processor. */
void density_prefetch(const density_map *m, vec3 position);

#endif
