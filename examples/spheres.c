/* SPDX-License-Identifier: Apache-2.0 */
/* before.c with the cache: one cache, one worker, each lamp and each hit prepared once, occluded() behind a callback.
 * Renders twice, exactly and cached, and compares.
 *     spheres [OUT.ppm] */
#include "scene.h"
#include <vcache/vcache.h>

static vcache_light *lamps;

/* Traces what the cache does not know; here one ray at a time. */
static bool trace(void *context, const vcache_miss *rays, size_t count, vcache_answer *answers)
{
    (void)context;
    for (size_t i = 0; i < count; i++)
        answers[i] = !occluded(at(rays[i].eye_position), at(rays[i].light_position));
    return true;
}

static float shade(vcache *cache, vcache_worker *worker, const hit *h)
{
    uint64_t eye[VCACHE_EYE_BYTES / 8];
    vcache_surface surface = {
        .position = {h->position.x, h->position.y, h->position.z},
        .normal = {h->normal.x, h->normal.y, h->normal.z},
        .density = vcache_density_cone(pixel_width * h->distance, h->cosine, SAMPLES),
    };
    vcache_prepare_eye(cache, &surface, 8.0f, 0, (vcache_eye *)eye);
    float sum = 0.0f;
    for (int i = 0; i < LAMPS; i++) {
        float light = light_of(h, i);
        if (light == 0.0f)
            continue;
        if (vcache_visible(worker, (vcache_eye *)eye, vcache_light_at(lamps, (size_t)i), trace, NULL))
            sum += light;
    }
    return sum;
}

static void render(vcache *cache, vcache_worker *worker, float *image)
{
    for (int i = 0; i < PIXELS; i++)
        for (int k = 0; k < SAMPLES; k++) {
            hit h;
            if (see(i, k, 0.0f, &h))
                image[i] += shade(cache, worker, &h) / SAMPLES;
        }
}

int main(int argc, char *argv[])
{
    static float image[PIXELS], exact[PIXELS];
    char message[VCACHE_MESSAGE_BYTES];
    make_scene(0.0f);

    vcache_config config = vcache_default_config();
    for (int i = 0; i < 3; i++)
        config.bounds_min[i] = bounds_min[i], config.bounds_max[i] = bounds_max[i];
    vcache *cache;
    if (vcache_create(&config, &cache, message) != VCACHE_OK) {
        fprintf(stderr, "spheres: %s\n", message);
        return 1;
    }
    vcache_worker_config exactly = vcache_default_worker_config();
    exactly.exact = true;
    vcache_worker *worker, *exact_worker;
    if (vcache_worker_create(cache, NULL, &worker, message) != VCACHE_OK ||
        vcache_worker_create(cache, &exactly, &exact_worker, message) != VCACHE_OK) {
        fprintf(stderr, "spheres: %s\n", message);
        return 1;
    }
    lamps = malloc(LAMPS * vcache_light_size());
    for (int i = 0; i < LAMPS && lamps; i++) {
        vec l = lamp_at(i);
        vcache_prepare_point(cache, (float[3]){l.x, l.y, l.z}, (uint64_t)i, vcache_light_at(lamps, (size_t)i));
    }

    render(cache, exact_worker, exact);
    render(cache, worker, image);

    vcache_statistics s = {.size = sizeof s};
    vcache_worker_statistics(worker, &s);
    printf("asked %llu, traced %llu (%.1f %%), error %.2f %%\n", (unsigned long long)s.asked,
           (unsigned long long)s.traced, 100.0 * (double)s.traced / (double)s.asked,
           100.0 * image_error(image, exact, PIXELS));
    vcache_worker_destroy(&worker);
    vcache_worker_destroy(&exact_worker);
    free(lamps);
    vcache_destroy(&cache);
    return argc > 1 && !write_ppm(argv[1], image) ? 1 : 0;
}
