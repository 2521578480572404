/* SPDX-License-Identifier: Apache-2.0 */
/* Many threads predict, learn, query and clear on few rows of one set. Each eye end sees its own lights, so a bit of
 * one cell under the key of another's shows in what is expected. To be run under the thread sanitizer too. */
#include "estimate_support.h"

#include <pthread.h>

enum { MOST_THREADS = 10, ENDS = 4, MOST_LIGHTS = 4096, SPAN = 300, TRUTHS = 1 << VCACHE_CELLS };

typedef struct ring {
    bench b;
    vcache_eye *eye[ENDS];
    uint64_t turns;
    bool clearing, reading;   /* `reading`: every second thread only predicts */
    float allowed[2][TRUTHS]; /* means of a light that is blocked, visible: each cell knows nothing or the truth */
} ring;

typedef struct runner {
    ring *r;
    pthread_t id;
    int number;
    uint64_t seed, predicted, known, asked, traced, wrong; /* out: no assertions outside of the main thread */
} runner;

/* So far apart that they share none of their three cells. */
static vcache_surface end_of(uint64_t e)
{
    vcache_surface s = floor_end((double)e * 2.0 + 0.3, 0.4);
    s.user = e;
    return s;
}

/* The last lights count: a row is replaced from its front to its end. */
static uint32_t some_light(const bench *b, uint64_t *seed)
{
    return b->count - 1 - (uint32_t)(random_bits(seed) % (b->count < SPAN ? b->count : SPAN));
}

static void predict(runner *t, vcache_predictor *p, const float *contribution, uint64_t e, vcache_cells *cells)
{
    const bench *b = &t->r->b;
    vcache_surface s = end_of(e);
    vcache_prediction out = vcache_predict(p, &s, fine_ce, 0, contribution);
    *cells = out.cells;
    for (uint32_t i = 0; i < b->count; i++) {
        bool found = false;
        for (int k = 0; k < TRUTHS; k++)
            found |= out.mean[i] == t->r->allowed[lit(e, i)][k];
        t->wrong += !found;
        t->known += out.mean[i] != b->states[0];
    }
    t->predicted += b->count;
}

static void learn(runner *t, uint64_t e, const vcache_cells *cells)
{
    vcache_pick picks[20];
    vcache_answer answers[20];
    uint32_t n = 1 + (uint32_t)(random_bits(&t->seed) % 20);
    for (uint32_t k = 0; k < n; k++) {
        picks[k] = (vcache_pick){.light = some_light(&t->r->b, &t->seed), .weight = 1.0f};
        answers[k] = lit(e, picks[k].light);
        if (random_bits(&t->seed) % 8 == 0) /* of which nothing may stay */
            answers[k] = (vcache_answer)(VCACHE_ONCE | (random_bits(&t->seed) & 1));
    }
    vcache_learn(t->r->b.set, cells, picks, answers, n);
}

static void query(runner *t, vcache_worker *worker, uint64_t e)
{
    const bench *b = &t->r->b;
    uint64_t visible[MOST_LIGHTS / 64], asked[MOST_LIGHTS / 64] = {0};
    tracer rays = {0};
    for (int k = 0; k < 10; k++) {
        uint32_t i = some_light(b, &t->seed);
        asked[i / 64] |= (uint64_t)1 << i % 64;
    }
    query_set(worker, t->r->eye[e], b->set, asked, visible, light_up, &rays);
    for (uint32_t i = 0; i < b->count; i++)
        if (bit_of(asked, i))
            t->asked++, t->wrong += bit_of(visible, i) != lit(e, i);
    t->traced += rays.rays;
}

static void *run_around(void *context)
{
    runner *t = context;
    ring *r = t->r;
    vcache_predictor *p = NULL;
    vcache_worker *worker = NULL;
    float *contribution = calloc(r->b.padded, sizeof *contribution);
    if (vcache_predictor_create(r->b.set, VCACHE_DRAW_UNCERTAIN, &p, NULL) != VCACHE_OK ||
        vcache_worker_create(r->b.cache, NULL, &worker, NULL) != VCACHE_OK || !contribution) {
        t->wrong = 1;
        return NULL;
    }
    uint64_t e = 0;
    for (uint64_t turn = 0; turn < r->turns; turn++) {
        if (random_bits(&t->seed) % 4 == 0) /* some turns with an end, so that what is learnt is found */
            e = random_bits(&t->seed) % ENDS;
        vcache_cells cells;
        predict(t, p, contribution, e, &cells);
        if (r->reading && t->number % 2)
            continue;
        learn(t, e, &cells);
        if (random_bits(&t->seed) % 2)
            query(t, worker, e);
        if (r->clearing && random_bits(&t->seed) % 64 == 0)
            vcache_clear(r->b.cache);
    }
    vcache_worker_destroy(&worker);
    vcache_predictor_destroy(&p);
    free(contribution);
    return NULL;
}

static void race(int threads, uint32_t lights, uint64_t rows, ring r)
{
    vcache_config config = vcache_default_config();
    config.levels = 1;
    config.bounds_max[0] = 2.0f * ENDS;
    r.b = make_bench_of(&config, lights, rows);
    for (uint64_t e = 0; e < ENDS; e++) {
        vcache_surface s = end_of(e);
        r.eye[e] = make_eye(r.b.cache, &s, fine_ce, 0);
        vcache_cells one = vcache_predict(r.b.predictor, &s, fine_ce, 0, r.b.contribution).cells;
        s = end_of((e + 1) % ENDS);
        vcache_cells other = vcache_predict(r.b.predictor, &s, fine_ce, 0, r.b.contribution).cells;
        for (int k = 0; k < VCACHE_CELLS; k++)
            assert_true(one.key[k] != other.key[k]);
    }
    for (int truth = 0; truth < 2; truth++)
        for (int k = 0; k < TRUTHS; k++) {
            int s = 0;
            for (int c = 0; c < VCACHE_CELLS; c++)
                s |= (k >> c & 1 ? truth ? SEEN_VISIBLE : SEEN_BLOCKED : UNKNOWN) << 2 * c;
            r.allowed[truth][k] = r.b.states[s];
        }
    runner t[MOST_THREADS];
    for (int i = 0; i < threads; i++) {
        t[i] = (runner){.r = &r, .number = i, .seed = (uint64_t)i + 1};
        assert_int_equal(pthread_create(&t[i].id, NULL, run_around, &t[i]), 0);
    }
    uint64_t predicted = 0, known = 0, asked = 0, traced = 0, wrong = 0;
    for (int i = 0; i < threads; i++) {
        assert_int_equal(pthread_join(t[i].id, NULL), 0);
        predicted += t[i].predicted, known += t[i].known, wrong += t[i].wrong;
        asked += t[i].asked, traced += t[i].traced;
    }
    print_message(
        "%d threads, %u lights, %llu rows%s: %.2f %% of %llu means known, %.1f %% of %llu answers found, %llu "
        "wrong\n",
        threads, lights, (unsigned long long)rows, r.clearing ? ", clearing" : "",
        100.0 * (double)known / (double)predicted, (unsigned long long)predicted,
        100.0 * (1.0 - (double)traced / (double)(asked + !asked)), (unsigned long long)asked,
        (unsigned long long)wrong);
    assert_int_equal(wrong, 0);
    assert_true(known > 0);
    for (int e = 0; e < ENDS; e++)
        free(r.eye[e]);
    free_bench(&r.b);
}

static void one_row(void **state)
{
    (void)state;
    for (int threads = 2; threads <= MOST_THREADS; threads *= 2) {
        ring r = {.turns = 2000 / (uint64_t)threads + 200};
        race(threads, 500, 1, r);
        r.clearing = true;
        race(threads, 500, 1, r);
    }
    /* a long row, that takes long to copy and to replace */
    race(8, MOST_LIGHTS, 1, (ring){.turns = 600, .reading = true});
    race(MOST_THREADS, MOST_LIGHTS, 1, (ring){.turns = 400});
}

static void few_rows(void **state)
{
    (void)state;
    for (uint64_t rows = 2; rows <= 16; rows *= 2) {
        race(8, 500, rows, (ring){.turns = 300});
        race(MOST_THREADS, 130, rows, (ring){.turns = 500, .clearing = true});
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_row),
        cmocka_unit_test(few_rows),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
