/* SPDX-License-Identifier: Apache-2.0 */
#include "distances.h"

#include "../renderers/common/scene.h"

#include <math.h>
#include <stdlib.h>

/* Within each column, to the nearest that is set. */
static void down_columns(const uint8_t *mask, uint32_t width, uint32_t height, float *out)
{
    for (uint32_t x = 0; x < width; x++) {
        float far = INFINITY;
        for (uint32_t y = 0; y < height; y++)
            out[y * width + x] = far = mask[y * width + x] ? 0.0f : far + 1.0f;
        far = INFINITY;
        for (uint32_t y = height; y-- > 0;) {
            far = mask[y * width + x] ? 0.0f : far + 1.0f;
            out[y * width + x] = fminf(out[y * width + x], far);
        }
    }
}

void mask_distances(const uint8_t *mask, uint32_t width, uint32_t height, float *out)
{
    float *column = xmalloc((width + 1) * sizeof *column);
    down_columns(mask, width, height, out);
    for (uint32_t y = 0; y < height; y++) {
        float *row = out + (size_t)y * width;
        for (uint32_t x = 0; x < width; x++)
            column[x] = row[x];
        for (uint32_t x = 0; x < width; x++) {
            float best = column[x] * column[x];
            for (uint32_t d = 1; (d <= x || x + d < width) && (float)d * (float)d < best; d++) {
                float left = d <= x ? column[x - d] : INFINITY, right = x + d < width ? column[x + d] : INFINITY;
                float nearest = fminf(left, right);
                best = fminf(best, (float)d * (float)d + nearest * nearest);
            }
            row[x] = sqrtf(best);
        }
    }
    free(column);
}
