/* SPDX-License-Identifier: Apache-2.0 */
/* A host for tests/abi.sh, which compiles it with this version's headers and with those of a later one, where structs
 * have a field `later` more (LATER: what is set there). Exits with 0 where all calls went well, and prints the message
 * of the first that did not. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <vcache/adaptive.h>
#include <vcache/grid.h>

static bool trace(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    (void)context, (void)misses;
    memset(answers, VCACHE_VISIBLE, count);
    return true;
}

static void must(vcache_status status, const char *message)
{
    if (status != VCACHE_OK) {
        printf("%s\n", message);
        exit(1);
    }
}

#ifdef LATER
#define SET(config) (config).later = LATER
#else
#define SET(config) (void)(config)
#endif

int main(void)
{
    char message[VCACHE_MESSAGE_BYTES];
    /* what a library writes beyond a struct that it takes for a longer one would change these */
    struct {
        vcache_config cache;
        uint64_t a;
        vcache_worker_config worker;
        uint64_t b;
        vcache_adaptive_config adaptive;
        uint64_t c;
        vcache_grid_config grid;
        uint64_t d;
        vcache_statistics statistics;
        uint64_t e;
    } s;
    memset(&s, 0xee, sizeof s);
    const uint64_t guard = s.a;
    vcache_fill_config(&s.cache, sizeof s.cache);
    vcache_fill_worker_config(&s.worker, sizeof s.worker);
    vcache_adaptive_fill_config(&s.adaptive, sizeof s.adaptive);
    vcache_grid_fill_config(&s.grid, sizeof s.grid);
    s.adaptive.sources = 7;
    SET(s.cache), SET(s.worker), SET(s.adaptive), SET(s.grid);

    vcache *cache;
    vcache_worker *worker;
    vcache_adaptive *adaptive;
    vcache_grid_lights *lights;
    vcache_grid *grid;
    const float up[3] = {0.0f, 0.0f, 1.0f};
    must(vcache_create(&s.cache, &cache, message), message);
    must(vcache_worker_create(cache, &s.worker, &worker, message), message);
    must(vcache_adaptive_create(&s.adaptive, &adaptive, message), message);
    must(vcache_grid_create_lights(up, NULL, 1, NULL, &lights, message), message);
    if (!vcache_grid_parse_mode("RES", &s.grid, message))
        must(VCACHE_ERROR_ARGUMENT, message);
    must(vcache_grid_create(&s.grid, lights, &grid, message), message);

    uint64_t eye[VCACHE_EYE_BYTES / 8], light[VCACHE_LIGHT_BYTES / 8];
    const vcache_surface surface = {.normal = {0.0f, 0.0f, 1.0f}, .density = 1e4f};
    vcache_prepare_eye(cache, &surface, 4.0f, 0, (vcache_eye *)eye);
    vcache_prepare_direction(cache, up, 0, (vcache_light *)light);
    bool fine = vcache_visible(worker, (vcache_eye *)eye, (vcache_light *)light, trace, NULL);
    s.statistics.size = sizeof s.statistics;
    vcache_worker_statistics(worker, &s.statistics);
    fine = fine && s.statistics.asked == 1 && s.statistics.leaked == 0 && s.statistics.size <= sizeof s.statistics;
    fine = fine && s.a == guard && s.b == guard && s.c == guard && s.d == guard && s.e == guard;
    vcache_grid_destroy(&grid);
    vcache_grid_destroy_lights(&lights);
    vcache_adaptive_destroy(&adaptive);
    vcache_worker_destroy(&worker);
    vcache_destroy(&cache);
    return fine ? 0 : 2;
}
