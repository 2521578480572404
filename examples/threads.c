/* SPDX-License-Identifier: Apache-2.0 */
/* A host with threads of its own: one cache for all of them, one worker each, no locks. Which thread asks first decides
 * which point speaks for a cell: pictures differ from run to run in single pixels. */
#include "host.h"
#include <pthread.h>
#include <stdatomic.h>

enum { THREADS = 4 };

typedef struct job {
    vcache *cache;
    vcache_light *lamps;
    float *image;
    bool exact;
    _Atomic int next_row;
    vcache_statistics sum[THREADS];
} job;

typedef struct my_thread {
    job *job;
    int number;
} my_thread;

static void *run(void *argument)
{
    const my_thread *me = argument;
    job *j = me->job;
    vcache_worker *worker = make_worker(j->cache, j->exact);
    uint64_t eye[VCACHE_EYE_BYTES / 8];
    for (int y; (y = atomic_fetch_add(&j->next_row, 1)) < HEIGHT;)
        for (int i = y * WIDTH * SAMPLES; i < (y + 1) * WIDTH * SAMPLES; i++) {
            hit h;
            if (!see(i / SAMPLES, i % SAMPLES, 0.0f, &h))
                continue;
            vcache_surface surface = surface_of(&h, SAMPLES);
            vcache_prepare_eye(j->cache, &surface, 8.0f, 0, (vcache_eye *)eye);
            for (int l = 0; l < LAMPS; l++) {
                float light = light_of(&h, l);
                if (light > 0.0f &&
                    vcache_visible(worker, (vcache_eye *)eye, vcache_light_at(j->lamps, (size_t)l), trace, NULL))
                    j->image[i / SAMPLES] += light / SAMPLES;
            }
        }
    j->sum[me->number] = statistics_of(worker);
    vcache_worker_destroy(&worker);
    return NULL;
}

static vcache_statistics render(vcache *cache, vcache_light *lamps, bool exact, float *image)
{
    job j = {.cache = cache, .lamps = lamps, .image = image, .exact = exact};
    pthread_t thread[THREADS];
    my_thread mine[THREADS];
    for (int i = 0; i < THREADS; i++) {
        mine[i] = (my_thread){&j, i};
        if (pthread_create(&thread[i], NULL, run, &mine[i]) != 0)
            exit(1);
    }
    vcache_statistics all = {0};
    for (int i = 0; i < THREADS; i++) {
        pthread_join(thread[i], NULL);
        all.asked += j.sum[i].asked, all.traced += j.sum[i].traced;
    }
    return all;
}

int main(void)
{
    static float image[PIXELS], exact[PIXELS];
    make_scene(0.0f);
    vcache_config config = config_of_scene();
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    (void)render(cache, lamps, true, exact);
    vcache_statistics s = render(cache, lamps, false, image);
    print_figures("", s.asked, s.traced, image_error(image, exact, PIXELS));
    free(lamps);
    vcache_destroy(&cache);
    return 0;
}
