/* SPDX-License-Identifier: Apache-2.0 */
/* Does an error pop? Of a sequence of frames, each rendered exactly and by a mode, how much their difference changes
 * from one frame to the next. A difference that stands still is a stain, one that changes is seen at once. */
#ifndef BENCH_TEMPORAL_H
#define BENCH_TEMPORAL_H

#include "../renderers/common/metrics.h"

/* Zero-initialised. Sums over frames and the largest of them. */
typedef struct temporal {
    int frames;
    double error, error_max, change, change_p999, change_max, light;
    image exact, mode; /* of the last frame */
} temporal;

/* Images of one size, which stay the caller's. */
void temporal_add(temporal *t, const image *exact, const image *mode);
/* Members of a JSON object, of at least two frames: `error`, `error_max`: of the frames themselves, mean of l_inf
 * (share of all light) and the largest difference of a pixel over the mean pixel; `change`, `change_p999`,
 * `change_max`: the same of the change of the signed difference, with its 99.9th percentile, mean and largest over the
 * frames; `light`: l_inf of the exact frames' own change. */
void temporal_print(const temporal *t);
void temporal_free(temporal *t);

#endif
