/* SPDX-License-Identifier: Apache-2.0 */
/* Many threads on few rows of a light set, and on the lines of bundled lights: what is found is what was put in for the
 * same cell and light, while others write, replace and clear. To be run under the thread sanitizer too. */
#include "patchwork.h"
#include "samples.h"

#include <pthread.h>

enum { MOST_THREADS = 8 };

typedef struct arena {
    patchwork p;
    vcache_light_set *set; /* NULL: the lights, bundled, in the table */
    uint64_t eyes;         /* so many are asked */
    uint32_t span;         /* so many of the last lights, at most */
    uint64_t turns;
    _Atomic bool done;
} arena;

typedef struct worker_thread {
    arena *a;
    pthread_t id;
    uint64_t seed;
    uint64_t asked, traced, wrong; /* out: no assertions outside of the main thread */
} worker_thread;

static void *ask_around(void *context)
{
    worker_thread *t = context;
    const patchwork *p = &t->a->p;
    vcache_light_set *set = t->a->set;
    vcache_worker *worker = NULL;
    vcache_worker_config config = vcache_default_worker_config();
    if (vcache_worker_create(p->cache, &config, &worker, NULL) != VCACHE_OK)
        return NULL;
    tracer rays = {0};
    uint64_t visible[VCACHE_MAX_SET / 64];
    size_t e = 0;
    for (uint64_t r = 0; r < t->a->turns; r++) {
        /* Stay with an eye for some turns, so that what is stored is found. The last lights are asked for, as a row is
         * replaced from its front to its end: the longer that takes, the more often it is read meanwhile. */
        if (random_bits(&t->seed) % 4 == 0)
            e = random_bits(&t->seed) % t->a->eyes;
        uint32_t last = p->count, first = last - 1 - (uint32_t)(random_bits(&t->seed) % t->a->span);
        for (uint32_t l = first; l < last;) {
            l = set ? vcache_add_set(worker, patch_at(p, e), set, l, NULL, visible)
                    : vcache_add(worker, patch_at(p, e), p->lights, l, last, NULL, visible);
            vcache_resolve(worker, light_up, &rays);
        }
        t->asked += last - first;
        for (uint32_t l = first; l < last; l++)
            t->wrong += bit_of(visible, l) != lit(e, l);
    }
    vcache_statistics s = statistics_of(worker);
    t->traced = s.traced;
    t->wrong += s.asked != t->asked || s.traced != rays.rays || s.asked != s.traced + hits_of(&s);
    vcache_worker_destroy(&worker);
    return NULL;
}

static void *clear_again_and_again(void *context)
{
    arena *a = context;
    while (!atomic_load_explicit(&a->done, memory_order_relaxed)) {
        vcache_clear(a->p.cache);
        for (int i = 0; i < 100000 && !atomic_load_explicit(&a->done, memory_order_relaxed); i++)
            ;
    }
    return NULL;
}

/* `rows` of a set, or 0: bundles in a table of `words`. */
static void fight(int threads, int levels, arena a, uint32_t lights, uint64_t rows, uint64_t words, bool clearing)
{
    make_patchwork(&a.p, levels, lights, words);
    if (rows)
        a.set = make_set(a.p.cache, a.p.lights, lights, rows);
    else
        vcache_bundle_lights(a.p.cache, a.p.lights, lights);
    worker_thread t[MOST_THREADS];
    pthread_t clearer;
    if (clearing)
        assert_int_equal(pthread_create(&clearer, NULL, clear_again_and_again, &a), 0);
    for (int i = 0; i < threads; i++) {
        t[i] = (worker_thread){.a = &a, .seed = (uint64_t)i + 1};
        assert_int_equal(pthread_create(&t[i].id, NULL, ask_around, &t[i]), 0);
    }
    uint64_t asked = 0, traced = 0, wrong = 0;
    for (int i = 0; i < threads; i++) {
        assert_int_equal(pthread_join(t[i].id, NULL), 0);
        assert_true(t[i].asked > 0);
        asked += t[i].asked, traced += t[i].traced, wrong += t[i].wrong;
    }
    atomic_store_explicit(&a.done, true, memory_order_relaxed);
    if (clearing)
        assert_int_equal(pthread_join(clearer, NULL), 0);
    print_message("%d threads, %d levels, %llu %s%s: %llu asked, %.1f %% of them found, %llu wrong\n", threads, levels,
                  (unsigned long long)(rows ? rows : words), rows ? "rows" : "words", clearing ? ", clearing" : "",
                  (unsigned long long)asked, 100.0 * (double)(asked - traced) / (double)asked,
                  (unsigned long long)wrong);
    assert_int_equal(wrong, 0);
    assert_true(asked > traced); /* something was found */
    assert_true(!a.set || rows_are_closed(a.set));
    vcache_light_set_destroy(&a.set);
    free_patchwork(&a.p);
}

static void threads_on_few_rows(void **state)
{
    (void)state;
    for (int threads = case_step(); threads <= MOST_THREADS; threads *= 2 * case_step())
        for (uint64_t rows = 1; rows <= 4; rows += rows) {
            arena a = {.eyes = 2 * rows, .span = 1000, .turns = 1000 / (uint64_t)threads + 100};
            fight(threads, 1, a, 1000, rows, 1, rows == 2);
            fight(threads, 2, a, 1000, rows, 1, rows == 4);
        }
    fight(4, 3, (arena){.eyes = PATCHES, .span = 1000, .turns = 1000}, 1000, 1 << 10, 1, true);
}

/* Two cells, one long row: most of the time goes into reading and replacing it. Few lights at a time for many turns,
 * and many for a long look. */
static void threads_on_one_row(void **state)
{
    (void)state;
    for (int threads = 2; threads <= MOST_THREADS; threads *= 2 * case_step())
        for (int levels = 1; levels <= 2; levels++) {
            arena shorter = {.eyes = 2, .span = 100, .turns = 200000 / (uint64_t)threads};
            arena longer = {.eyes = 2, .span = 1000, .turns = 40000 / (uint64_t)threads};
            fight(threads, levels, shorter, 4096, 1, 1, false);
            fight(threads, levels, longer, 4096, 1, 1, false);
        }
}

static void threads_on_bundles(void **state)
{
    (void)state;
    for (int threads = case_step(); threads <= MOST_THREADS; threads *= 2 * case_step())
        for (uint64_t words = 16; words <= 1 << 16; words <<= 6) {
            arena a = {.eyes = 4, .span = 60, .turns = 1000 / (uint64_t)threads + 100};
            fight(threads, 1, a, 1000, 0, words, false);
            fight(threads, 2, a, 1000, 0, words, true);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(threads_on_few_rows),
        cmocka_unit_test(threads_on_one_row),
        cmocka_unit_test(threads_on_bundles),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
