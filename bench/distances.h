/* SPDX-License-Identifier: Apache-2.0 */
#ifndef BENCH_DISTANCES_H
#define BENCH_DISTANCES_H

#include <stdint.h>

/* Of each pixel, from its middle to that of the nearest pixel whose `mask` is not 0, in pixels; INFINITY where there is
 * none. Row by row, width * height of each; 65536 a side at most. Exits where there is no memory. */
void mask_distances(const uint8_t *mask, uint32_t width, uint32_t height, float *out);

#endif
