/* SPDX-License-Identifier: Apache-2.0 */
/* Which cell of an oriented grid holds a point (Sect. 3.3), in line: pairs of vertices ask for two each. */
#ifndef VCACHE_CELLS_H
#define VCACHE_CELLS_H

#include "internal.h"

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* Grids are shifted by parts of a cell that no round number meets: walls lie at round coordinates and on the bounds,
 * and noise in their last bits must not throw them from one cell or layer into the next. */
#define SHIFT_CELL 0.4142135623730951
#define SHIFT_LAYER 0.3819660112501051

/* floor; how far points may lie and the finest resolution keep x far inside 32 bits. */
static inline int32_t floor_int(double x)
{
    int32_t i = (int32_t)x;
    return i - (x < i);
}

/* The layer is where the point's tangent plane meets the middle of its column of cells, not the point's own height:
 * so a flat wall is one layer in each column however it is tilted within its orientation's bin. `height`: of that, in
 * cells. */
static inline cell cell_at(const vcache *c, const grid_point *p, double resolution, double *height)
{
    double u = p->u * resolution + SHIFT_CELL, v = p->v * resolution + SHIFT_CELL;
    cell q = {floor_int(u), floor_int(v), 0};
    double du = u - q.i - 0.5, dv = v - q.j - 0.5;
    *height = p->w * resolution + p->slope_u * du + p->slope_v * dv;
    q.layer = floor_int(*height * c->config.layers + SHIFT_LAYER);
    return q;
}

/* Hash of a cell: the 7 words of Sect. 3.3 in four, orientation and resolution step share one. */
static inline uint64_t cell_hash(cell q, uint32_t orientation, int step, uint64_t seed)
{
    uint32_t last = orientation | (uint32_t)step << 21;
    return hash_words((uint64_t)(uint32_t)q.j << 32 | (uint32_t)q.i, (uint64_t)last << 32 | (uint32_t)q.layer, seed);
}

#endif
