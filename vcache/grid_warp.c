/* SPDX-License-Identifier: Apache-2.0 */
/* Warping (Sect. 4.1.3, Fig. 4): blockers that the informing pixels know, seen from this one. */
#include "grid_internal.h"

#include <math.h>
#include <string.h>

/* A blocker of some pixel: into the cell of this pixel in which it lies now. Of those in one cell the nearest to the
 * light is kept (report, Sect. 3.1). */
static void drop(vcache_grid *g, uint32_t pixel, const float *blocker)
{
    const float *p = g->position + 3 * (size_t)pixel;
    float d[3] = {blocker[0] - p[0], blocker[1] - p[1], blocker[2] - p[2]};
    float length = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    if (!(length > 0.0f && length < INFINITY))
        return;
    uint32_t light = vcache_grid_nearest(g->lights, d);
    const float *l = g->lights->direction + 3 * (size_t)light;
    float cosine = (d[0] * l[0] + d[1] * l[1] + d[2] * l[2]) / length;
    if (g->hits[light] == 0 || cosine > g->closeness[light]) {
        g->closeness[light] = cosine;
        memcpy(g->blocker + 3 * ((size_t)pixel * g->lights->count + light), blocker, 3 * sizeof *blocker);
    }
    g->hits[light] = (uint8_t)(g->hits[light] < 255 ? g->hits[light] + 1 : 255);
}

void grid_warp(vcache_grid *g, uint32_t pixel, const uint32_t *informers, uint32_t count, uint64_t *blocked,
               uint64_t *unclear)
{
    uint32_t words = g->words, lights = g->lights->count;
    const uint64_t *asked = grid_asked(g, pixel);
    memset(g->hits, 0, lights);
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t w = 0; w < words; w++) {
            uint64_t bits = grid_asked(g, informers[i])[w] & ~grid_visible(g, informers[i])[w];
            for (; bits; bits &= bits - 1) {
                size_t light = 64 * w + (uint32_t)count_trailing_zeros(bits);
                drop(g, pixel, g->blocker + 3 * ((size_t)informers[i] * lights + light));
            }
        }
    for (uint32_t w = 0; w < words; w++) {
        uint64_t known = ~(uint64_t)0;
        for (uint32_t i = 0; i < count; i++)
            known &= grid_asked(g, informers[i])[w];
        blocked[w] = unclear[w] = 0;
        for (uint64_t bits = asked[w]; bits; bits &= bits - 1) {
            uint64_t bit = bits & -bits;
            uint32_t hits = g->hits[64 * w + (uint32_t)count_trailing_zeros(bits)];
            if (g->config.boundary) {
                blocked[w] |= (float)hits > g->config.threshold ? bit : 0;
            } else {
                blocked[w] |= hits >= count ? bit : 0;
                unclear[w] |= hits > 0 && hits < count ? bit : 0;
            }
        }
        unclear[w] |= asked[w] & ~known;
        if (!g->config.boundary)
            blocked[w] &= ~unclear[w];
    }
}
