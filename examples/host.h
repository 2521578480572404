/* SPDX-License-Identifier: Apache-2.0 */
/* What the examples after spheres.c, which shows all of it, have in common: a cache for the scene, or the end. */
#ifndef EXAMPLES_HOST_H
#define EXAMPLES_HOST_H

#include "scene.h"
#include <vcache/vcache.h>

static inline void check(vcache_status status, const char *message)
{
    if (status != VCACHE_OK) {
        fprintf(stderr, "%s: %s\n", vcache_status_text(status), message);
        exit(1);
    }
}

static inline vcache_config config_of_scene(void)
{
    vcache_config config = vcache_default_config();
    for (int i = 0; i < 3; i++)
        config.bounds_min[i] = bounds_min[i], config.bounds_max[i] = bounds_max[i];
    return config;
}

static inline vcache *make_cache(const vcache_config *config)
{
    char message[VCACHE_MESSAGE_BYTES];
    vcache *cache;
    check(vcache_create(config, &cache, message), message);
    return cache;
}

static inline vcache_worker *make_worker(vcache *cache, bool exact)
{
    char message[VCACHE_MESSAGE_BYTES];
    vcache_worker_config config = vcache_default_worker_config();
    config.exact = exact;
    vcache_worker *worker;
    check(vcache_worker_create(cache, &config, &worker, message), message);
    return worker;
}

/* `samples`: per pixel, all passes together. */
static inline vcache_surface surface_of(const hit *h, float samples)
{
    vcache_surface s = {{h->position.x, h->position.y, h->position.z},
                        {h->normal.x, h->normal.y, h->normal.z},
                        vcache_density_cone(pixel_width * h->distance, h->cosine, samples),
                        0};
    return s;
}

static inline vcache_light *make_lamps(const vcache *cache)
{
    vcache_light *lamps = (vcache_light *)malloc(LAMPS * vcache_light_size());
    for (int i = 0; lamps && i < LAMPS; i++) {
        const vec l = lamp_at(i);
        const float position[3] = {l.x, l.y, l.z};
        vcache_prepare_point(cache, position, (uint64_t)i, vcache_light_at(lamps, (size_t)i));
    }
    check(lamps ? VCACHE_OK : VCACHE_ERROR_MEMORY, "lamps");
    return lamps;
}

static inline bool trace(void *context, const vcache_miss *rays, size_t count, vcache_answer *answers)
{
    (void)context;
    for (size_t i = 0; i < count; i++)
        answers[i] = occluded(at(rays[i].eye_position), at(rays[i].light_position)) ? VCACHE_BLOCKED : VCACHE_VISIBLE;
    return true;
}

static inline vcache_statistics statistics_of(const vcache_worker *worker)
{
    vcache_statistics s;
    s.size = sizeof s;
    vcache_worker_statistics(worker, &s);
    return s;
}

static inline void print_figures(const char *what, uint64_t asked, uint64_t traced, double error)
{
    printf("%sasked %llu, traced %llu (%.1f %%), error %.2f %%\n", what, (unsigned long long)asked,
           (unsigned long long)traced, 100.0 * (double)traced / (double)asked, 100.0 * error);
}

#endif
