/* SPDX-License-Identifier: Apache-2.0 */
/* Many threads on one table: an answer that comes out of it is the answer that was put in for the same pair of cells,
 * in tables so small that every word is fought for, and while others clear. To be run under the thread sanitizer. */
#include "support.h"

#include <pthread.h>

enum { EYES = 64, LIGHTS = 64, MOST_THREADS = 8 };

typedef struct scene {
    vcache *cache;
    size_t stride;
    char *eyes;
    vcache_light light[LIGHTS];
    _Atomic bool done;
} scene;

/* A function of the pair of cells: every eye has a cell, and every light a key, of its own. */
static bool sees(uint64_t eye, uint64_t light)
{
    uint64_t state = eye * LIGHTS + light;
    return random_bits(&state) & 1;
}

static bool trace(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    *(uint64_t *)context += count;
    for (size_t i = 0; i < count; i++)
        answers[i] = sees(misses[i].eye_user, misses[i].light_user);
    return true;
}

static void make_scene(scene *s, uint64_t words, vcache_hash family)
{
    vcache_config config = vcache_default_config();
    config.levels = 1;
    config.hash = family;
    config.table_bytes = words * 4;
    s->cache = make_cache(&config);
    s->stride = vcache_eye_size(s->cache, 4.0f);
    s->eyes = malloc(s->stride * EYES);
    assert_non_null(s->eyes);
    atomic_init(&s->done, false);
    for (int i = 0; i < EYES; i++) {
        vcache_surface p = {.position = {(float)(i % 8) / 8.0f, (float)(i / 8) / 8.0f, 0.0f},
                            .user = (uint64_t)i,
                            .normal = {0.0f, 0.0f, 1.0f},
                            .density = 16.0f * 1024.0f};
        vcache_prepare_eye(s->cache, &p, 4.0f, 0, (vcache_eye *)(void *)(s->eyes + (size_t)i * s->stride));
    }
    uint64_t seed = 5;
    for (int i = 0; i < LIGHTS; i++) {
        float d[3];
        random_direction(&seed, d);
        vcache_prepare_direction(s->cache, d, (uint64_t)i, &s->light[i]);
    }
}

typedef struct worker_thread {
    scene *s;
    pthread_t id;
    uint64_t seed, rounds;
    uint64_t asked, traced, wrong; /* out: no assertions outside of the main thread */
} worker_thread;

static void *ask_around(void *context)
{
    worker_thread *t = context;
    scene *s = t->s;
    vcache_worker *worker = NULL;
    vcache_worker_config config = vcache_default_worker_config();
    config.capacity = 48; /* less than the lights of an eye: batches run full */
    if (vcache_worker_create(s->cache, &config, &worker, NULL) != VCACHE_OK)
        return NULL;
    /* threads stay together in small groups of pairs, so that words of a tiny table live long enough to be found */
    for (uint64_t r = 0; r < t->rounds; r++) {
        uint64_t e = r / 16 % EYES, asked = (uint64_t)0x5 << r / 16 % 60, visible = 0;
        const vcache_eye *eye = (const vcache_eye *)(const void *)(s->eyes + e * s->stride);
        if (random_bits(&t->seed) % 8 == 0)
            asked = ~(uint64_t)0;
        if (random_bits(&t->seed) % 2)
            vcache_query(worker, eye, s->light, LIGHTS, &asked, &visible, trace, &t->traced);
        else
            for (uint64_t l = 0; l < LIGHTS; l++)
                if (asked >> l & 1)
                    visible |= (uint64_t)vcache_visible(worker, eye, &s->light[l], trace, &t->traced) << l;
        for (uint64_t l = 0; l < LIGHTS; l++)
            if (asked >> l & 1) {
                t->asked++;
                t->wrong += (visible >> l & 1) != sees(e, l);
            }
    }
    vcache_statistics stat = statistics_of(worker);
    t->wrong += stat.asked != t->asked || stat.traced != t->traced || stat.asked != stat.traced + hits_of(&stat);
    vcache_worker_destroy(&worker);
    return NULL;
}

static void *clear_again_and_again(void *context)
{
    scene *s = context;
    while (!atomic_load_explicit(&s->done, memory_order_relaxed)) {
        vcache_clear(s->cache);
        vcache_table_filled(s->cache, 100);
        for (int i = 0; i < 2000 && !atomic_load_explicit(&s->done, memory_order_relaxed); i++)
            ;
    }
    return NULL;
}

static void run(int threads, uint64_t words, vcache_hash family, int clearing)
{
    scene s;
    make_scene(&s, words, family);
    worker_thread t[MOST_THREADS];
    pthread_t clearers[2];
    for (int i = 0; i < clearing; i++)
        assert_int_equal(pthread_create(&clearers[i], NULL, clear_again_and_again, &s), 0);
    for (int i = 0; i < threads; i++) {
        t[i] = (worker_thread){.s = &s, .seed = (uint64_t)i + 1, .rounds = 32000 / (uint64_t)threads + 500};
        assert_int_equal(pthread_create(&t[i].id, NULL, ask_around, &t[i]), 0);
    }
    uint64_t asked = 0, traced = 0, wrong = 0;
    for (int i = 0; i < threads; i++) {
        assert_int_equal(pthread_join(t[i].id, NULL), 0);
        assert_true(t[i].asked > 0);
        asked += t[i].asked, traced += t[i].traced, wrong += t[i].wrong;
    }
    atomic_store_explicit(&s.done, true, memory_order_relaxed);
    for (int i = 0; i < clearing; i++)
        assert_int_equal(pthread_join(clearers[i], NULL), 0);
    print_message(
        "%d threads, %llu words, family %d, %d clearing: %llu asked, %.1f %% of them from the table, %llu wrong\n",
        threads, (unsigned long long)words, (int)family, clearing, (unsigned long long)asked,
        100.0 * (double)(asked - traced) / (double)asked, (unsigned long long)wrong);
    assert_int_equal(wrong, 0);
    assert_true(asked > traced); /* something did come from the table */
    if (!clearing && words > 1000)
        assert_true(traced < asked / 2);
    free(s.eyes);
    vcache_destroy(&s.cache);
}

static void large_table(void **state)
{
    (void)state;
    for (int threads = 1; threads <= MOST_THREADS; threads *= 2) {
        run(threads, 1 << 16, VCACHE_HASH_SPLIT, 0);
        run(threads, 1 << 16, VCACHE_HASH_SPLIT, 2);
    }
    run(4, (1 << 16) - 15, VCACHE_HASH_LCG_XORSHIFT, 1);
    run(4, (1 << 16) - 15, VCACHE_HASH_LCG_PAIR, 1);
}

static void tiny_tables(void **state)
{
    (void)state;
    static const uint64_t sizes[] = {1, 7};
    for (int i = 0; i < 2; i++)
        for (int threads = 1; threads <= MOST_THREADS; threads *= 2) {
            run(threads, sizes[i], VCACHE_HASH_SPLIT, 0);
            run(threads, sizes[i], VCACHE_HASH_SPLIT, 1);
        }
}

/* Many threads clear at once: no two frames share a key. */
static void *clear_often(void *context)
{
    for (int i = 0; i < 1000; i++)
        vcache_clear(context);
    return NULL;
}

static void clears_do_not_meet(void **state)
{
    (void)state;
    scene s;
    make_scene(&s, 1 << 10, VCACHE_HASH_SPLIT);
    vcache_worker *worker = make_worker(s.cache, 4, false);
    uint64_t traced = 0;
    for (int round = 0; round < 20; round++) {
        pthread_t threads[4];
        vcache_visible(worker, (const vcache_eye *)(const void *)s.eyes, &s.light[0], trace, &traced);
        assert_int_equal(traced, round + 1);
        for (int i = 0; i < 4; i++)
            assert_int_equal(pthread_create(&threads[i], NULL, clear_often, s.cache), 0);
        for (int i = 0; i < 4; i++)
            assert_int_equal(pthread_join(threads[i], NULL), 0);
        assert_int_equal(atomic_load(&s.cache->epoch), 4000 * (round + 1));
    }
    vcache_worker_destroy(&worker);
    free(s.eyes);
    vcache_destroy(&s.cache);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(large_table),
        cmocka_unit_test(tiny_tables),
        cmocka_unit_test(clears_do_not_meet),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
