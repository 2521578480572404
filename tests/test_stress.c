/* SPDX-License-Identifier: Apache-2.0 */
/* 64 threads on one word, one row, one small table, while another clears; two caches in one process; a process that
 * forks. Whoever asks gets the answer of its own pair or traces. To be run under the thread sanitizer too. */
#include "patchwork.h"

#include <pthread.h>
#include <sys/wait.h>
#include <unistd.h>

enum { THREADS = 64, TURNS = 300 };

/* Which of a worker's ways of asking are used. */
enum { ADD_WORDS = 1, ADD_ROWS = 2, ESTIMATE = 4, PREDICT = 8, CLEAR = 16 };

typedef struct arena {
    patchwork p;
    vcache_light_set *set;
    int ways;
} arena;

typedef struct contestant {
    arena *a;
    pthread_t id;
    uint64_t seed, asked, found, wrong;
} contestant;

static bool light_at_random(const arena *a, uint64_t *seed, size_t *eye, uint32_t *light)
{
    *eye = random_bits(seed) % 3;
    *light = (uint32_t)(random_bits(seed) % a->p.count);
    return lit(*eye, *light);
}

static void ask_words(contestant *t, vcache_worker *w)
{
    size_t eye;
    uint32_t light;
    bool right = light_at_random(t->a, &t->seed, &eye, &light);
    tracer rays = {0};
    bool got = vcache_visible(w, patch_at(&t->a->p, eye), vcache_light_at(t->a->p.lights, light), light_up, &rays);
    t->asked++, t->found += rays.rays == 0, t->wrong += got != right;
}

static void ask_rows(contestant *t, vcache_worker *w)
{
    uint64_t visible[VCACHE_MAX_SET / 64];
    size_t eye = random_bits(&t->seed) % 3;
    tracer rays = {0};
    for (uint32_t l = 0; l < t->a->p.count;) {
        l = vcache_add_set(w, patch_at(&t->a->p, eye), t->a->set, l, NULL, visible);
        vcache_resolve(w, light_up, &rays);
    }
    t->asked += t->a->p.count, t->found += t->a->p.count - rays.rays;
    for (uint32_t l = 0; l < t->a->p.count; l++)
        t->wrong += bit_of(visible, l) != lit(eye, l);
}

/* What an estimate holds may be anything a race leaves, but a mean and a probability. */
static void ask_estimates(contestant *t, vcache_worker *w)
{
    size_t eye;
    uint32_t light;
    bool right = light_at_random(t->a, &t->seed, &eye, &light);
    vcache_estimate e = vcache_estimate_pair(w, patch_at(&t->a->p, eye), vcache_light_at(t->a->p.lights, light), 1.0f);
    t->wrong += !(e.mean >= 0.0f && e.mean <= 1.0f && e.probability >= 0.0f && e.probability <= 1.0f);
    vcache_learn_pair(w, &e, right ? VCACHE_VISIBLE : VCACHE_BLOCKED);
}

static void *contest(void *context)
{
    contestant *t = context;
    vcache_worker *w = NULL;
    vcache_worker_config config = vcache_default_worker_config();
    config.capacity = 64;
    if (vcache_worker_create(t->a->p.cache, &config, &w, NULL) != VCACHE_OK) {
        t->wrong = 1;
        return NULL;
    }
    for (int i = 0; i < TURNS; i++) {
        if (t->a->ways & ADD_WORDS)
            ask_words(t, w);
        if (t->a->ways & ADD_ROWS && i % 8 == 0)
            ask_rows(t, w);
        if (t->a->ways & ESTIMATE)
            ask_estimates(t, w);
        if (t->a->ways & CLEAR && i % 32 == 0)
            vcache_clear(t->a->p.cache);
    }
    vcache_worker_destroy(&w);
    return NULL;
}

static void crowd(const char *what, int ways, uint64_t words, uint64_t rows)
{
    arena a = {.ways = ways};
    make_patchwork(&a.p, 2, 100, words);
    a.set = make_set(a.p.cache, a.p.lights, 100, rows);
    contestant *t = calloc(THREADS, sizeof *t);
    assert_non_null(t);
    uint64_t asked = 0, found = 0, wrong = 0;
    for (int i = 0; i < THREADS; i++) {
        t[i].a = &a, t[i].seed = (uint64_t)i + 1;
        assert_int_equal(pthread_create(&t[i].id, NULL, contest, &t[i]), 0);
    }
    for (int i = 0; i < THREADS; i++) {
        assert_int_equal(pthread_join(t[i].id, NULL), 0);
        asked += t[i].asked, found += t[i].found, wrong += t[i].wrong;
    }
    print_message("%s: %llu asked, %.1f %% of them found, %llu wrong\n", what, (unsigned long long)asked,
                  100.0 * (double)found / (double)asked, (unsigned long long)wrong);
    assert_int_equal(wrong, 0);
    assert_true(asked > 0 && (found > 0 || words == 1) && rows_are_closed(a.set));
    free(t);
    vcache_light_set_destroy(&a.set);
    free_patchwork(&a.p);
}

static void one_word(void **state)
{
    (void)state;
    crowd("one word", ADD_WORDS, 1, 1);
    crowd("one word, clearing", ADD_WORDS | CLEAR, 1, 1);
    crowd("one word, estimates", ADD_WORDS | ESTIMATE | CLEAR, 1, 1);
}

static void one_row(void **state)
{
    (void)state;
    crowd("one row", ADD_ROWS, 1, 1);
    crowd("one row, clearing", ADD_ROWS | CLEAR, 1, 1);
}

static void one_table(void **state)
{
    (void)state;
    crowd("a table", ADD_WORDS | ADD_ROWS | ESTIMATE, 1 << 12, 8);
    crowd("a table, clearing", ADD_WORDS | ADD_ROWS | ESTIMATE | CLEAR, 1 << 12, 8);
}

/* ------------------------------------------------------------------------------------------------- clear, for sure */

typedef struct clearing {
    patchwork p;
    _Atomic int clears;   /* begun */
    _Atomic int returned; /* of these */
    _Atomic bool done;
    _Atomic uint64_t stale, answers; /* of the reader */
} clearing;

/* What a ray finds changes with every clear: it is the number of clears that had begun, modulo 2. */
static bool number_of_clears(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    clearing *c = context;
    (void)misses;
    for (size_t i = 0; i < count; i++)
        answers[i] = (vcache_answer)(atomic_load(&c->clears) & 1);
    return true;
}

static void *read_on(void *context)
{
    clearing *c = context;
    vcache_worker *w = make_worker(c->p.cache, 16, false);
    while (!atomic_load(&c->done)) {
        /* between two clears nothing but that moment's answer may come */
        int returned = atomic_load(&c->returned);
        bool got = vcache_visible(w, patch_at(&c->p, 0), vcache_light_at(c->p.lights, 0), number_of_clears, c);
        if (atomic_load(&c->clears) == returned) {
            atomic_fetch_add(&c->answers, 1);
            atomic_fetch_add(&c->stale, got != (returned & 1));
        }
    }
    vcache_worker_destroy(&w);
    return NULL;
}

/* A query that begins after vcache_clear returned is not answered from before, also while other threads ask: what they
 * store of rays that they traced before goes under the old epoch. */
static void clear_while_asking(void **state)
{
    (void)state;
    clearing c = {0};
    make_patchwork(&c.p, 1, 1, 64);
    pthread_t reader;
    assert_int_equal(pthread_create(&reader, NULL, read_on, &c), 0);
    vcache_worker *w = make_worker(c.p.cache, 16, false);
    uint64_t stale = 0, answers = 0;
    for (int i = 1; i <= 3000 || (atomic_load(&c.answers) < 1000 && i < 10000000); i++) {
        atomic_store(&c.clears, i);
        vcache_clear(c.p.cache);
        atomic_store(&c.returned, i);
        for (int k = 0; k < 20; k++) {
            stale +=
                vcache_visible(w, patch_at(&c.p, 0), vcache_light_at(c.p.lights, 0), number_of_clears, &c) != (i & 1);
            answers++;
        }
    }
    atomic_store(&c.done, true);
    assert_int_equal(pthread_join(reader, NULL), 0);
    print_message("%llu answers after a clear, %llu stale; of another thread %llu, %llu\n", (unsigned long long)answers,
                  (unsigned long long)stale, (unsigned long long)atomic_load(&c.answers),
                  (unsigned long long)atomic_load(&c.stale));
    assert_int_equal(stale, 0);
    assert_true(atomic_load(&c.stale) == 0 && atomic_load(&c.answers) > 0);
    vcache_worker_destroy(&w);
    free_patchwork(&c.p);
}

/* --------------------------------------------------------------------------------------------- caches, processes */

/* Two caches know nothing of each other. */
static void two_caches(void **state)
{
    (void)state;
    patchwork p[2];
    vcache_worker *w[2];
    for (int i = 0; i < 2; i++) {
        make_patchwork(&p[i], 2, 100, 1 << 14);
        w[i] = make_worker(p[i].cache, 64, false);
    }
    uint64_t visible[2];
    tracer rays = {0};
    for (int i = 0; i < 2; i++) {
        uint64_t before = rays.rays;
        assert_true(vcache_query(w[i], patch_at(&p[i], 0), p[i].lights, 100, NULL, visible, light_up, &rays));
        assert_int_equal(rays.rays - before, 100);
    }
    vcache_clear(p[0].cache);
    uint64_t before = rays.rays;
    assert_true(vcache_query(w[1], patch_at(&p[1], 0), p[1].lights, 100, NULL, visible, light_up, &rays));
    assert_int_equal(rays.rays, before);
    vcache_worker_destroy(&w[0]);
    free_patchwork(&p[0]);
    assert_true(vcache_query(w[1], patch_at(&p[1], 0), p[1].lights, 100, NULL, visible, light_up, &rays));
    assert_int_equal(rays.rays, before);
    for (uint32_t l = 0; l < 100; l++)
        assert_true(bit_of(visible, l) == lit(0, l));
    vcache_worker_destroy(&w[1]);
    free_patchwork(&p[1]);
}

/* A child has a cache of its own with what its parent knew; what it does there the parent does not see. */
static void forks(void **state)
{
    (void)state;
    patchwork p;
    make_patchwork(&p, 2, 100, 1 << 14);
    vcache_worker *w = make_worker(p.cache, 64, false);
    uint64_t visible[2];
    tracer rays = {0};
    assert_true(vcache_query(w, patch_at(&p, 0), p.lights, 100, NULL, visible, light_up, &rays));
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        tracer own = {0};
        static const struct {
            bool clear;
            int patch, rays;
        } steps[] = {{false, 0, 0}, {false, 1, 100}, {true, 0, 200}, {false, 1, 300}};
        bool good = true;
        for (size_t i = 0; i < 4; i++) {
            if (steps[i].clear)
                vcache_clear(p.cache);
            const vcache_eye *eye = patch_at(&p, (size_t)steps[i].patch);
            good = good && vcache_query(w, eye, p.lights, 100, NULL, visible, light_up, &own) &&
                   own.rays == (uint64_t)steps[i].rays;
        }
        vcache_worker_destroy(&w);
        vcache_destroy(&p.cache);
        _exit(good ? 0 : 1);
    }
    int status;
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    uint64_t before = rays.rays;
    assert_true(vcache_query(w, patch_at(&p, 0), p.lights, 100, NULL, visible, light_up, &rays));
    assert_int_equal(rays.rays, before);
    assert_true(vcache_query(w, patch_at(&p, 1), p.lights, 100, NULL, visible, light_up, &rays));
    assert_int_equal(rays.rays, before + 100);
    vcache_worker_destroy(&w);
    free_patchwork(&p);
}

int main(int argc, char *argv[])
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_word),           cmocka_unit_test(one_row),    cmocka_unit_test(one_table),
        cmocka_unit_test(clear_while_asking), cmocka_unit_test(two_caches), cmocka_unit_test(forks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
