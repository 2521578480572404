/* SPDX-License-Identifier: Apache-2.0 */
/* A host in C: one pair of points asked for twice, one ray. Prints the library's version. */
#include <halton/halton.h>
#include <stdio.h>
#include <vcache/adaptive.h>
#include <vcache/save.h>
#include <vcache/vcache.h>

static bool trace(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    (void)misses;
    *(size_t *)context += count;
    for (size_t i = 0; i < count; i++)
        answers[i] = VCACHE_VISIBLE;
    return true;
}

int main(void)
{
    vcache_config config = vcache_default_config();
    char message[VCACHE_MESSAGE_BYTES];
    vcache *cache;
    vcache_worker *worker;
    if (vcache_create(&config, &cache, message) != VCACHE_OK ||
        vcache_worker_create(cache, NULL, &worker, message) != VCACHE_OK) {
        fprintf(stderr, "%s\n", message);
        return 1;
    }
    uint64_t eye[VCACHE_EYE_BYTES / 8], light[VCACHE_LIGHT_BYTES / 8];
    vcache_surface floor = {.normal = {0.0f, 0.0f, 1.0f}, .density = 1e4f};
    const float lamp[3] = {0.5f, 0.5f, 1.0f};
    vcache_prepare_eye(cache, &floor, 4.0f, 0, (vcache_eye *)eye);
    vcache_prepare_point(cache, lamp, 0, (vcache_light *)light);
    size_t rays = 0;
    for (int i = 0; i < 2; i++)
        if (!vcache_visible(worker, (vcache_eye *)eye, (vcache_light *)light, trace, &rays))
            return 2;
    vcache_worker_destroy(&worker);
    vcache_destroy(&cache);
    vcache_adaptive_config adaptive = vcache_adaptive_default_config();
    uint32_t version = VCACHE_VERSION_MAJOR * 10000 + VCACHE_VERSION_MINOR * 100 + VCACHE_VERSION_PATCH;
    if (rays != 1 || halton_morton(3, 0) != 5 || adaptive.size != sizeof adaptive || vcache_version() != version)
        return 3;
    printf("%u.%u.%u\n", (unsigned)(version / 10000), (unsigned)(version / 100 % 100), (unsigned)(version % 100));
    return 0;
}
