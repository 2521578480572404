/* SPDX-License-Identifier: Apache-2.0 */
/*
 * No bias, whatever the cache holds: sums of lights in worlds in which what cells know is wrong, by one to four threads
 * that write to one set.
 *
 * The hypothesis: estimates less exact sums, E eye ends at a time, have mean 0. Each E is one draw; draws are
 * uncorrelated, for offsets are independent of all that came before. It is rejected where the mean lies more than 3
 * standard errors off in two runs of other seeds (1 in 100,000 by chance: what threads write depends on scheduling).
 * Estimators that are wrong on purpose must be rejected.
 */
#include "estimate_support.h"
#include "samples.h"

#include <pthread.h>

enum { ENDS = 24, COUNT = 150, DRAWS = 2400, THREADS_MAX = 4, SHARING = 4 };

typedef enum flaw {
    RIGHT,
    WEIGHT_TOO_SMALL, /* 1 / p times 0.9 */
    STALE_MEAN,       /* corrected by means of after the rays */
    IMPOSSIBLE_LIGHTS /* contribution 0 where the middle sees nothing, but an end that shares the prediction does */
} flaw;

typedef struct world_kind {
    const char *name;
    bool thin;    /* an occluder thinner than a cell hides odd lights */
    bool foliage; /* a coin for each ray */
    bool meddled; /* others learn the opposite between prediction and learning */
    bool poked;   /* any bits in any row */
    uint64_t rows;
} world_kind;

static const world_kind kinds[] = {
    {.name = "thin occluder", .thin = true, .rows = 1 << 10},
    {.name = "foliage", .foliage = true, .rows = 1 << 10},
    {.name = "meddled with", .thin = true, .meddled = true, .rows = 1 << 10},
    {.name = "one row", .thin = true, .rows = 1},
    {.name = "poked", .thin = true, .poked = true, .rows = 16},
};
enum { KINDS = sizeof kinds / sizeof *kinds };

typedef struct hall {
    world_kind kind;
    flaw flaw;
    vcache_drawing drawing;
    uint32_t samples; /* ends that share a prediction, SHARING at most */
    bench b;
    float value[COUNT], rays;
} hall;

typedef struct visitor {
    hall *h;
    pthread_t id;
    uint64_t seed;
    int draws;
    double sum, squares; /* out */
} visitor;

/* Ends lie in four fine cells; a strip of a third of each hides odd lights. */
static void place_end(uint64_t *seed, double *x, double *y, bool *behind)
{
    uint64_t r = random_bits(seed);
    double at = random_unit(seed);
    *x = 0.2 + 0.04 * (double)(r % 4) + 0.02 * at, *y = 0.4;
    *behind = at > 0.33 && at < 0.67;
}

static void poke(hall *h, uint64_t *seed)
{
    uint64_t row = random_bits(seed) % h->b.set->rows, word = random_bits(seed) % (2 * h->b.set->words);
    atomic_fetch_xor(&h->b.set->memory[row * h->b.set->stride + ROW_BITS + word], random_bits(seed));
}

static void meddle(hall *h, const vcache_cells *cells, uint64_t *seed)
{
    vcache_pick picks[COUNT];
    vcache_answer answers[COUNT];
    for (uint32_t i = 0; i < COUNT; i++)
        picks[i].light = i, answers[i] = (vcache_answer)(random_bits(seed) & 1);
    vcache_learn(h->b.set, cells, picks, answers, COUNT);
    if (random_bits(seed) % 8 == 0)
        vcache_clear(h->b.cache);
}

/* Contribution of light i to one of the ends that share a prediction, and in the middle of them, where every seventh is
 * behind the horizon. */
static double contribution_at(const hall *h, uint32_t i, uint32_t sample)
{
    return h->samples > 1 ? (double)h->value[i] * (0.9 + 0.3 * ((i + sample) % 4)) : (double)h->value[i];
}

static double contribution_in_the_middle(const hall *h, uint32_t i)
{
    return h->samples > 1 && i % 7 == 0 ? 0.0 : (double)h->value[i];
}

static bool light_seen(const hall *h, uint32_t i, bool behind, uint64_t *seed)
{
    return h->kind.foliage ? random_bits(seed) % 5 == 0 : !h->kind.thin ? i % 3 != 0 : i % (behind ? 2 : 5) == 0;
}

/* Ends in one place: estimate less exact sum, mean of them. */
static double visit(hall *h, vcache_predictor *predictor, float *contribution, float offset, double x,
                    const bool *behind, uint64_t *seed)
{
    vcache_surface s = floor_end(x, 0.4);
    double exact = 0.0, estimate = 0.0;
    bool seen[SHARING][COUNT];
    for (uint32_t i = 0; i < COUNT; i++) {
        contribution[i] = (float)contribution_in_the_middle(h, i);
        if (!(contribution[i] > 0.0f) && h->flaw != IMPOSSIBLE_LIGHTS)
            contribution[i] = 0.1f * h->value[i];
        for (uint32_t k = 0; k < h->samples; k++) {
            seen[k][i] = light_seen(h, i, behind[k], seed);
            exact += seen[k][i] ? contribution_at(h, i, k) : 0.0;
        }
    }
    if (h->kind.poked)
        poke(h, seed);
    vcache_prediction p = vcache_predict(predictor, &s, fine_ce, 0, contribution);
    for (uint32_t i = 0; i < COUNT; i++)
        estimate += contribution_in_the_middle(h, i) * (double)p.mean[i] * h->samples;
    if (h->kind.meddled)
        meddle(h, &p.cells, seed);
    vcache_pick picks[16 * SHARING];
    vcache_answer answers[16 * SHARING];
    uint32_t n = vcache_pick_lights(predictor, h->rays * (float)h->samples, h->samples, offset, picks, 16 * SHARING);
    for (uint32_t k = 0; k < n; k++)
        answers[k] = seen[picks[k].sample][picks[k].light];
    if (h->flaw == STALE_MEAN) {
        vcache_learn(h->b.set, &p.cells, picks, answers, n);
        p = vcache_predict(predictor, &s, fine_ce, 0, contribution);
    }
    for (uint32_t k = 0; k < n; k++) {
        uint32_t i = picks[k].light;
        double weight = (double)picks[k].weight * (h->flaw == WEIGHT_TOO_SMALL ? 0.9 : 1.0);
        double there = contribution_in_the_middle(h, i) * (double)p.mean[i];
        estimate += weight * ((answers[k] ? contribution_at(h, i, picks[k].sample) : 0.0) - there);
    }
    vcache_learn(h->b.set, &p.cells, picks, answers, n);
    if (h->flaw == RIGHT) /* where what is expected is right on average, flaws would hide */
        vcache_adapt(predictor, picks, answers, n);
    return (estimate - exact) / h->samples;
}

static void *walk(void *context)
{
    visitor *v = context;
    hall *h = v->h;
    vcache_predictor *predictor = NULL;
    float contribution[(COUNT + 63) / 64 * 64] = {0};
    if (vcache_predictor_create(h->b.set, h->drawing, &predictor, NULL) != VCACHE_OK)
        return NULL;
    for (int d = 0; d < v->draws; d++) {
        double sum = 0.0, x = 0.0, y;
        bool behind[SHARING] = {false};
        if (random_bits(&v->seed) % 4 == 0)
            vcache_clear(h->b.cache);
        for (int e = 0; e < ENDS; e++) {
            for (uint32_t k = 0; k < h->samples; k++)
                place_end(&v->seed, &x, &y, &behind[k]);
            float offset = (float)(random_bits(&v->seed) >> 40) * 0x1p-24f;
            sum += visit(h, predictor, contribution, offset, x, behind, &v->seed);
        }
        v->sum += sum, v->squares += sum * sum;
    }
    vcache_predictor_destroy(&predictor);
    return NULL;
}

/* How many standard errors the mean is off. */
static double off(hall *h, int threads, uint64_t seed, double *bias)
{
    visitor v[THREADS_MAX];
    for (int i = 0; i < threads; i++) {
        v[i] = (visitor){.h = h, .seed = seed + 1000000u * (uint64_t)i, .draws = DRAWS / threads};
        assert_int_equal(pthread_create(&v[i].id, NULL, walk, &v[i]), 0);
    }
    double sum = 0.0, squares = 0.0, whole = 0.0;
    for (int i = 0; i < threads; i++) {
        assert_int_equal(pthread_join(v[i].id, NULL), 0);
        sum += v[i].sum, squares += v[i].squares;
    }
    for (int i = 0; i < COUNT; i++)
        whole += (double)h->value[i];
    double mean = sum / DRAWS, variance = (squares - DRAWS * mean * mean) / (DRAWS - 1.0);
    assert_true(variance > 0.0);
    *bias = mean / whole / ENDS;
    return mean / sqrt(variance / DRAWS);
}

static bool rejected(const world_kind *kind, vcache_drawing drawing, uint32_t samples, flaw how, int threads)
{
    hall h = {.kind = *kind,
              .flaw = how,
              .drawing = drawing,
              .samples = samples,
              .rays = 5.0f,
              .b = make_bench(COUNT, kind->rows, VCACHE_ISA_ALL)};
    uint64_t seed = 1;
    for (int i = 0; i < COUNT; i++)
        h.value[i] = (float)exp(random_between(&seed, -3.0, 0.0));
    bool twice = true;
    for (uint64_t run = 0; run < 2 && twice; run++) {
        double bias, sigmas = off(&h, threads, 100 + 10 * run, &bias);
        print_message("%s, drawing %d, %u ends, flaw %d, %d threads: %+.2f standard errors, %+.4f %% of the sum\n",
                      kind->name, (int)drawing, samples, (int)how, threads, sigmas, 100.0 * bias);
        twice = fabs(sigmas) > 3.0;
    }
    free_bench(&h.b);
    return twice;
}

static void no_bias(void **state)
{
    (void)state;
    for (int k = 0; k < KINDS; k++)
        for (uint32_t samples = 1; samples <= SHARING; samples += SHARING - 1)
            for (int threads = 1; threads <= THREADS_MAX; threads += 2 * case_step() - 1) /* or one, and all */
                for (vcache_drawing drawing = VCACHE_DRAW_UNCERTAIN; drawing <= VCACHE_DRAW_VISIBLE; drawing++)
                    if ((drawing == VCACHE_DRAW_UNCERTAIN || threads == THREADS_MAX) &&
                        rejected(&kinds[k], drawing, samples, RIGHT, threads))
                        fail_msg("%s, drawing %d, %u ends, %d threads: biased", kinds[k].name, (int)drawing, samples,
                                 threads);
    assert_false(rejected(&kinds[0], VCACHE_DRAW_BRIGHT, SHARING, RIGHT, 1));
}

/* Where contributions of ends and of their middle differ, errors of other signs may hide each other. */
static void bias_is_seen(void **state)
{
    (void)state;
    for (int k = 0; k < KINDS; k++)
        for (int threads = 1; threads <= THREADS_MAX; threads += THREADS_MAX - 1) {
            assert_true(rejected(&kinds[k], VCACHE_DRAW_UNCERTAIN, 1, WEIGHT_TOO_SMALL, threads));
            assert_true(rejected(&kinds[k], VCACHE_DRAW_VISIBLE, SHARING, WEIGHT_TOO_SMALL, threads));
        }
    assert_true(rejected(&kinds[0], VCACHE_DRAW_UNCERTAIN, SHARING, WEIGHT_TOO_SMALL, 1));
    assert_true(rejected(&kinds[0], VCACHE_DRAW_UNCERTAIN, SHARING, IMPOSSIBLE_LIGHTS, 1));
    assert_true(rejected(&kinds[1], VCACHE_DRAW_UNCERTAIN, 1, STALE_MEAN, 1));
}

/* Offsets must be independent of what was learnt, not of visibility alone: of two offsets half a step apart, each
 * uniform, the second is biased where the rays of the first teach it. By quadrature. */
static void offsets_are_independent(void **state)
{
    (void)state;
    enum { GRID = 256 };
    hall h = {.samples = 1, .rays = 1.0f, .b = make_bench(COUNT, 1 << 10, VCACHE_ISA_ALL)};
    const bool behind[SHARING] = {false};
    double whole = 0.0, shifted = 0.0, independent = 0.0;
    uint64_t seed = 1;
    for (int i = 0; i < COUNT; i++)
        whole += (double)(h.value[i] = i < 5 ? 1.0f : 0.0f);
    for (int u = 0; u < GRID; u++)
        for (int v = 0; v < GRID; v++) {
            vcache_clear(h.b.cache);
            visit(&h, h.b.predictor, h.b.contribution, ((float)u + 0.5f) / GRID, 0.3, behind, &seed);
            double error = visit(&h, h.b.predictor, h.b.contribution, ((float)v + 0.5f) / GRID, 0.3, behind, &seed);
            independent += error / (GRID * GRID);
            shifted += (u + GRID / 2) % GRID == v ? error / GRID : 0.0;
        }
    print_message("bias of independent offsets %+.4f %%, of shifted ones %+.4f %%\n", 100.0 * independent / whole,
                  100.0 * shifted / whole);
    assert_true(fabs(independent) < 0.002 * whole && fabs(shifted) > 0.01 * whole);
    free_bench(&h.b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_bias),
        cmocka_unit_test(bias_is_seen),
        cmocka_unit_test(offsets_are_independent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
