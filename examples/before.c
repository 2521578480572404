/* SPDX-License-Identifier: Apache-2.0 */
/* A ray tracer before it met the cache: one shadow ray for each hit and lamp. spheres.c is the same with it.
 *     before [OUT.ppm] */
#include "scene.h"

static float shade(const hit *h, uint64_t *rays)
{
    float sum = 0.0f;
    for (int i = 0; i < LAMPS; i++) {
        float light = light_of(h, i);
        if (light == 0.0f)
            continue;
        ++*rays;
        if (!occluded(h->position, lamp_at(i)))
            sum += light;
    }
    return sum;
}

int main(int argc, char *argv[])
{
    static float image[PIXELS];
    uint64_t rays = 0;
    make_scene(0.0f);
    for (int i = 0; i < PIXELS; i++)
        for (int k = 0; k < SAMPLES; k++) {
            hit h;
            if (see(i, k, 0.0f, &h))
                image[i] += shade(&h, &rays) / SAMPLES;
        }
    printf("%llu shadow rays\n", (unsigned long long)rays);
    return argc > 1 && !write_ppm(argv[1], image) ? 1 : 0;
}
