/* SPDX-License-Identifier: Apache-2.0 */
/* Hit rates of adaptive shadow testing under threads: merged, the same weights for any number of them; free-running,
 * nothing lost. To be run under the thread sanitizer too. */
#include "adaptive_support.h"

#include <pthread.h>

enum { TILES = 128, TILE_POINTS = 20, LIGHTS = 60 };

typedef struct picture {
    vcache_adaptive *adaptive;
    uint32_t end; /* of this round's tiles */
    _Atomic uint32_t next;
    uint64_t sum[TILES]; /* of the weights */
} picture;

typedef struct painter {
    picture *p;
    vcache_adaptive_worker *worker;
    pthread_t id;
    uint64_t wrong, tested; /* out: no assertions outside of the main thread */
} painter;

static void *paint(void *context)
{
    painter *me = context;
    picture *p = me->p;
    uint32_t tile;
    while ((tile = atomic_fetch_add_explicit(&p->next, 1, memory_order_relaxed)) < p->end) {
        uint64_t seed = tile;
        p->sum[tile] = 0;
        for (int point = 0; point < TILE_POINTS; point++) {
            float contribution[LIGHTS], weight[LIGHTS];
            bool visible[LIGHTS];
            uint32_t order[LIGHTS];
            for (uint32_t i = 0; i < LIGHTS; i++) {
                contribution[i] = random_contribution(&seed, 3);
                visible[i] = random_bits(&seed) % LIGHTS >= i; /* some are hardly ever seen */
            }
            uint32_t tested = light_up(me->worker, contribution, visible, 1.0f, 16, weight, order);
            me->tested += tested;
            for (int i = 0; i < LIGHTS; i++)
                me->wrong += !(weight[i] >= 0.0f && weight[i] <= 1.0f);
            p->sum[tile] = checksum(p->sum[tile], weight, sizeof weight);
        }
    }
    return NULL;
}

/* Rounds of 1, 1, 2, 4 ... tiles, of which any thread takes any. */
static void render(picture *p, int threads, bool free_running, bool merging)
{
    painter t[8];
    vcache_adaptive_worker *workers[8];
    *p = (picture){.adaptive = make(LIGHTS, 0.3f, 0.25f, free_running)};
    for (int i = 0; i < threads; i++) {
        workers[i] = make_tester(p->adaptive);
        t[i] = (painter){.p = p, .worker = workers[i]};
    }
    for (uint32_t begin = 0, round = 1; begin < TILES; begin = p->end, round = begin) {
        p->end = begin + round;
        atomic_store_explicit(&p->next, begin, memory_order_relaxed);
        for (int i = 0; i < threads; i++)
            assert_int_equal(pthread_create(&t[i].id, NULL, paint, &t[i]), 0);
        for (int i = 0; i < threads; i++)
            assert_int_equal(pthread_join(t[i].id, NULL), 0);
        if (merging)
            vcache_adaptive_merge(p->adaptive, workers, (uint32_t)threads);
    }
    uint64_t tested = 0, counted = 0;
    for (int i = 0; i < threads; i++) {
        assert_int_equal(t[i].wrong, 0);
        tested += t[i].tested;
        vcache_adaptive_worker_destroy(&workers[i]);
    }
    for (uint32_t i = 0; i < LIGHTS; i++) {
        vcache_adaptive_source s = vcache_adaptive_source_rate(p->adaptive, i);
        assert_true(s.hits <= s.tests && s.rate >= 0.0f && s.rate <= 1.0f);
        counted += s.tests;
    }
    assert_int_equal(counted, merging || free_running ? tested : 0);
    assert_true(tested < (uint64_t)TILES * TILE_POINTS * LIGHTS);
    vcache_adaptive_destroy(&p->adaptive);
}

static void merged_threads(void **state)
{
    (void)state;
    static const int threads[] = {1, 2, 3, 7, 7};
    static picture first, again;
    render(&again, 1, false, false);
    render(&first, 1, false, true);
    assert_memory_equal(first.sum, again.sum, sizeof *first.sum); /* the first round knows the prior alone */
    assert_memory_not_equal(first.sum, again.sum, sizeof first.sum);
    for (size_t k = 1; k < sizeof threads / sizeof *threads; k++) {
        render(&again, threads[k], false, true);
        assert_memory_equal(first.sum, again.sum, sizeof first.sum);
    }
}

static void free_threads(void **state)
{
    (void)state;
    static picture first, again;
    render(&first, 1, true, false);
    render(&again, 1, true, true); /* merging has no effect */
    assert_memory_equal(first.sum, again.sum, sizeof first.sum);
    for (int threads = 2; threads <= 8; threads *= 2)
        render(&again, threads, true, false);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(merged_threads),
        cmocka_unit_test(free_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
