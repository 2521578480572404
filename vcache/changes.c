/* SPDX-License-Identifier: Apache-2.0 */
/* What is left to know after something moved. */
#include "light_set.h"

#include <math.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* Two points of one cell lie at most this many sides apart: one along each axis of the plane, and in height a layer and
 * how far both tangent planes may fall to the middle of the column. A normal is at most sqrt(3) / 2 bins of 1 / s from
 * the centre of its own. */
static double cell_reach(const vcache *c)
{
    int s = c->config.normal_bins / 2;
    double sine = s > 0 ? 0.8660254037844387 / s : 1.0, fall = 4.0; /* slopes end at 2, one for each axis */
    if (sine < 0.9)
        fall = 1.4142135623730951 * sine / sqrt(1.0 - sine * sine);
    double height = 1.0 / c->config.layers + fall;
    return sqrt(2.0 + height * height);
}

/* Whether the segment from a to a + d (or the ray) meets the box grown by `margin`. NaN: it may. */
static bool meets(const float a[3], const double d[3], bool infinite, const float low[3], const float high[3],
                  double margin)
{
    double first = 0.0, last = infinite ? INFINITY : 1.0;
    for (int i = 0; i < 3; i++) {
        double to_low = low[i] - margin - a[i], to_high = high[i] + margin - a[i];
        if (d[i] == 0.0) {
            if (to_low > 0.0 || to_high < 0.0)
                return false;
            continue;
        }
        double t0 = to_low / d[i], t1 = to_high / d[i];
        double near = t0 < t1 ? t0 : t1, far = t0 < t1 ? t1 : t0;
        first = near > first ? near : first;
        last = far < last ? far : last;
    }
    return !(first > last);
}

void vcache_crossing(const vcache *c, const vcache_eye *eye, const vcache_light *lights, uint32_t count,
                     const float box_min[3], const float box_max[3], uint64_t *crossing)
{
    double reach = cell_reach(c), rounding = 0x1p-20 * c->diameter, eye_square = (double)eye->side_squared;
    for (uint32_t i = 0; i < count; i++) {
        const vcache_light *l = &lights[i];
        bool infinite = l->side_squared < 0.0f, may = eye->levels == 0 || l->bad || l->kind == END_SOLID_ANGLE;
        if (!may) {
            double square = (double)l->side_squared > eye_square ? (double)l->side_squared : eye_square, d[3];
            for (int k = 0; k < 3; k++)
                d[k] = infinite ? (double)l->position[k] : (double)l->position[k] - eye->position[k];
            may = meets(eye->position, d, infinite, box_min, box_max, reach * sqrt(square) + rounding);
        }
        uint64_t bit = (uint64_t)1 << i % 64;
        crossing[i / 64] = may ? crossing[i / 64] | bit : crossing[i / 64] & ~bit;
    }
}

void vcache_light_set_replace(vcache_light_set *s, uint32_t index, const vcache_light *light)
{
    s->lights[index] = *light;
    light_set_place(s, index);
    uint64_t mask = ~((uint64_t)1 << index % 64);
    for (uint64_t r = 0; r < s->rows; r++) {
        _Atomic uint64_t *known = s->memory + r * s->stride + ROW_BITS + index / 64, *visible = known + s->words;
        atomic_store_explicit(known, atomic_load_explicit(known, memory_order_relaxed) & mask, memory_order_relaxed);
        atomic_store_explicit(visible, atomic_load_explicit(visible, memory_order_relaxed) & mask,
                              memory_order_relaxed);
    }
}
