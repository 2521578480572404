/* SPDX-License-Identifier: Apache-2.0 */
/* Frame after frame: while nothing moves but the camera, what was learnt stays. Between two processes it goes through a
 * file. When something moves, forget.
 *     frames [MIB] */
#include "host.h"
#include <string.h>
#include <vcache/save.h>

static bool write_file(void *file, const void *data, size_t bytes)
{
    return fwrite(data, 1, bytes, (FILE *)file) == bytes;
}

static bool read_file(void *file, void *data, size_t bytes)
{
    return fread(data, 1, bytes, (FILE *)file) == bytes;
}

/* Changes when something moves: FNV-1a over all balls. */
static uint64_t hash_of_scene(void)
{
    uint64_t hash = 0xcbf29ce484222325u;
    unsigned char bytes[sizeof balls];
    memcpy(bytes, balls, sizeof bytes);
    for (size_t i = 0; i < sizeof bytes; i++)
        hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}

static void render(vcache *cache, vcache_light *lamps, float aside, const char *what)
{
    static float image[PIXELS], exact[PIXELS];
    memset(image, 0, sizeof image);
    memset(exact, 0, sizeof exact);
    vcache_worker *worker = make_worker(cache, false);
    uint64_t eye[VCACHE_EYE_BYTES / 8];
    for (int i = 0; i < PIXELS; i++) {
        hit h;
        if (!see(i, 0, aside, &h))
            continue;
        vcache_surface surface = surface_of(&h, 1.0f);
        vcache_prepare_eye(cache, &surface, 8.0f, 0, (vcache_eye *)eye);
        for (int l = 0; l < LAMPS; l++) {
            float light = light_of(&h, l);
            if (light > 0.0f &&
                vcache_visible(worker, (vcache_eye *)eye, vcache_light_at(lamps, (size_t)l), trace, NULL))
                image[i] += light;
            if (light > 0.0f && !occluded(h.position, lamp_at(l)))
                exact[i] += light;
        }
    }
    vcache_statistics s = statistics_of(worker);
    print_figures(what, s.asked, s.traced, image_error(image, exact, PIXELS));
    vcache_worker_destroy(&worker);
}

int main(int argc, char *argv[])
{
    char message[VCACHE_MESSAGE_BYTES];
    make_scene(0.0f);
    vcache_config config = config_of_scene();
    config.table_bytes = (uint64_t)(argc > 1 ? atoi(argv[1]) : 16) << 20; /* room for several frames */
    vcache *cache = make_cache(&config), *again = NULL;
    vcache_light *lamps = make_lamps(cache); /* good for all caches of one config */
    for (int frame = 0; frame < 4; frame++)
        render(cache, lamps, 0.05f * (float)frame, "camera moves: ");

    FILE *file = tmpfile();
    if (!file)
        return 1;
    check(vcache_save(cache, hash_of_scene(), write_file, file, message), message);
    vcache_destroy(&cache);

    rewind(file);
    check(vcache_load(&config, hash_of_scene(), read_file, file, &again, message), message);
    render(again, lamps, 0.15f, "from a file:  ");

    make_scene(1.0f);
    rewind(file);
    if (vcache_load(&config, hash_of_scene(), read_file, file, &cache, message) != VCACHE_OK)
        printf("the balls roll, and the file is refused: %s\n", message);
    render(again, lamps, 0.15f, "not cleared:  "); /* a mistake: shadows stay behind */
    vcache_clear(again);
    render(again, lamps, 0.15f, "cleared:      ");
    fclose(file);
    free(lamps);
    vcache_destroy(&again);
    return 0;
}
