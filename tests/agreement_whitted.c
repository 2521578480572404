/* SPDX-License-Identifier: Apache-2.0 */
#include "agreement.h"

#include "../renderers/whitted/whitted.h"

double whitted_direct(const scene *s, const tracer *t, const emitters *e, const camera *c, uint32_t width,
                      uint32_t height, uint64_t seed)
{
    view v = {.scene = s, .tracer = t, .emitters = e, .camera = *c};
    v.settings = (settings){.width = width,
                            .height = height,
                            .spp = 4,
                            .env_samples = 4,
                            .light_samples = 4,
                            .seed = seed,
                            .threads = 1,
                            .visibility = VISIBILITY_EXACT,
                            .cache = vcache_default_config()};
    frame f;
    double sum = 0.0;
    if (!frame_render(&v, "test", true, NULL, NULL, &f, NULL))
        return -1.0;
    for (size_t i = 0; i < (size_t)width * height; i++)
        sum += (double)luminance(f.lit.pixels[i]);
    frame_free(&f);
    return sum / ((double)width * height);
}
