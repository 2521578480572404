/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Estimates of single pairs have no bias, whatever the table holds: in worlds in which what cells know is wrong, of
 * eye and light ends and of vertices, by one to four threads that share a table.
 *
 * The hypothesis and its test are those of test_unbiased.c: the error of a sum of pairs has mean 0, rejected where the
 * mean of all draws lies more than 3 standard errors off in two runs of other seeds. Estimators that are wrong on
 * purpose must be rejected.
 */
#include "pair_support.h"

#include <pthread.h>

enum { ENDS = 6, DRAWS = 1200, THREADS_MAX = 4 };

typedef enum flaw {
    RIGHT,
    WEIGHT_TOO_SMALL, /* 1 / p times 0.9 */
    STALE_MEAN,       /* corrected by the mean of after the ray */
    NEVER_IF_SURE     /* no ray where p is small, as if the mean were the answer */
} flaw;

typedef struct world_kind {
    const char *name;
    bool foliage;  /* a coin for each ray, else an occluder thinner than a cell hides odd lights */
    bool meddled;  /* others learn the opposite, or clear, between estimate and ray */
    bool poked;    /* any bits in any word */
    bool answered; /* answers of the plain cache in the same table */
    uint64_t words;
} world_kind;

static const world_kind kinds[] = {
    {.name = "thin occluder", .words = 1 << 12},
    {.name = "foliage", .foliage = true, .words = 1 << 12},
    {.name = "meddled with", .meddled = true, .words = 1 << 12},
    {.name = "one word", .words = 1},
    {.name = "poked", .poked = true, .words = 64},
    {.name = "among answers", .answered = true, .words = 64},
};
enum { KINDS = sizeof kinds / sizeof *kinds };

typedef struct hall {
    world_kind kind;
    flaw flaw;
    bool vertices;
    vcache *cache;
    float value[PAIR_LIGHTS];
} hall;

typedef struct visitor {
    hall *h;
    pthread_t id;
    uint64_t seed;
    int draws;
    double sum, squares; /* out */
    vcache_worker *worker;
    pair_ends ends;
} visitor;

static bool any_answer(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    (void)misses;
    for (size_t i = 0; i < count; i++)
        answers[i] = (vcache_answer)(random_bits(context) & 1);
    return true;
}

/* What happens between the estimate and its ray. */
static void disturb(visitor *v, const vcache_estimate *e, uint32_t light, bool visible)
{
    const world_kind *k = &v->h->kind;
    table *t = &v->h->cache->table;
    if (k->meddled)
        for (int i = 0; i < 3; i++)
            vcache_learn_pair(v->worker, e, !visible);
    if (k->meddled && random_bits(&v->seed) % 64 == 0)
        vcache_clear(v->h->cache);
    if (k->poked)
        atomic_fetch_xor(&t->words[random_bits(&v->seed) % t->count], (uint32_t)(random_bits(&v->seed) & 0xfff));
    if (k->answered)
        vcache_visible(v->worker, eye_of(&v->ends), &v->ends.light[light], any_answer, &v->seed);
}

/* The estimate of a pair less its exact light. */
static double error_of(visitor *v, uint32_t light, bool visible)
{
    const hall *h = v->h;
    double f = (double)h->value[light], truth = visible ? 1.0 : 0.0, weight = h->flaw == WEIGHT_TOO_SMALL ? 0.9 : 1.0;
    vcache_estimate e = estimate_of(v->worker, &v->ends, h->vertices, light, h->value[light]);
    double error = f * ((double)e.mean - truth), mean = (double)e.mean;
    disturb(v, &e, light, visible);
    float random = (float)(random_bits(&v->seed) >> 40) * 0x1p-24f;
    if (random >= e.probability || (h->flaw == NEVER_IF_SURE && e.probability < 0.2f))
        return error;
    vcache_learn_pair(v->worker, &e, visible);
    if (h->flaw == STALE_MEAN)
        mean = (double)estimate_of(v->worker, &v->ends, h->vertices, light, h->value[light]).mean;
    return error + weight * f * (truth - mean) / (double)e.probability;
}

/* Ends lie in a few cells; a strip of a third of each hides odd lights. */
static double visit(visitor *v)
{
    double at = random_unit(&v->seed), sum = 0.0;
    move_eye(v->h->cache, &v->ends, 0.1 + 0.25 * (double)(random_bits(&v->seed) % 3) + 0.1 * at, 0.3);
    for (uint32_t i = 0; i < PAIR_LIGHTS; i++) {
        bool visible = v->h->kind.foliage ? random_bits(&v->seed) % 5 == 0 : i % (at > 0.33 && at < 0.67 ? 2 : 5) == 0;
        sum += error_of(v, i, visible);
    }
    return sum;
}

static void *walk(void *context)
{
    visitor *v = context;
    for (int d = 0; d < v->draws; d++) {
        double sum = 0.0;
        if (random_bits(&v->seed) % 4 == 0)
            vcache_clear(v->h->cache);
        for (int e = 0; e < ENDS; e++)
            sum += visit(v);
        v->sum += sum, v->squares += sum * sum;
    }
    return NULL;
}

/* How many standard errors the mean is off. */
static double off(hall *h, int threads, uint64_t seed)
{
    static visitor v[THREADS_MAX];
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < threads; i++) {
        v[i] = (visitor){.h = h, .seed = seed + 1000000u * (uint64_t)i, .draws = DRAWS / threads};
        v[i].worker = make_worker(h->cache, 1, false);
        make_ends(h->cache, &v[i].ends);
        assert_int_equal(pthread_create(&v[i].id, NULL, walk, &v[i]), 0);
    }
    for (int i = 0; i < threads; i++) {
        assert_int_equal(pthread_join(v[i].id, NULL), 0);
        vcache_worker_destroy(&v[i].worker);
        sum += v[i].sum, squares += v[i].squares;
    }
    double mean = sum / DRAWS, variance = (squares - DRAWS * mean * mean) / (DRAWS - 1.0);
    assert_true(variance > 0.0);
    return mean / sqrt(variance / DRAWS);
}

static bool rejected(const world_kind *kind, bool vertices, flaw how, int threads)
{
    hall h = {.kind = *kind, .flaw = how, .vertices = vertices, .cache = make_table(kind->words)};
    uint64_t seed = 1;
    for (int i = 0; i < PAIR_LIGHTS; i++)
        h.value[i] = (float)exp(random_between(&seed, -3.0, 0.5));
    bool twice = true;
    for (uint64_t run = 0; run < 2 && twice; run++) {
        double sigmas = off(&h, threads, 100 + 10 * run);
        print_message("%s of %s, flaw %d, %d threads: %+.2f standard errors\n", kind->name,
                      vertices ? "vertices" : "ends", (int)how, threads, sigmas);
        twice = fabs(sigmas) > 3.0;
    }
    vcache_destroy(&h.cache);
    return twice;
}

static void no_bias(void **state)
{
    (void)state;
    for (int k = 0; k < KINDS; k++)
        for (int vertices = 0; vertices < 2; vertices++)
            for (int threads = 1; threads <= THREADS_MAX; threads++)
                if (rejected(&kinds[k], vertices, RIGHT, threads))
                    fail_msg("%s, %d threads: biased", kinds[k].name, threads);
}

static void bias_is_seen(void **state)
{
    (void)state;
    for (int vertices = 0; vertices < 2; vertices++) {
        for (int k = 0; k < KINDS; k++)
            for (int threads = 1; threads <= THREADS_MAX; threads *= 4)
                assert_true(rejected(&kinds[k], vertices, WEIGHT_TOO_SMALL, threads));
        assert_true(rejected(&kinds[0], vertices, STALE_MEAN, 1));
        assert_true(rejected(&kinds[1], vertices, STALE_MEAN, 1));
        assert_true(rejected(&kinds[0], vertices, NEVER_IF_SURE, 1));
        assert_true(rejected(&kinds[3], vertices, NEVER_IF_SURE, 4));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_bias),
        cmocka_unit_test(bias_is_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
