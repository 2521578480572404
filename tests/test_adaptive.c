/* SPDX-License-Identifier: Apache-2.0 */
/* Adaptive shadow testing: points worked by hand, a sorted reference, the bound at certainty 1, comparisons. */
#include "adaptive_support.h"
#include "ledger.h"

/* ------------------------------------------------------------------------------------------------------- creation */

static vcache_adaptive_config changed(size_t offset, const void *value, size_t bytes)
{
    vcache_adaptive_config config = vcache_adaptive_default_config();
    config.sources = 8;
    memcpy((char *)&config + offset, value, bytes);
    return config;
}

#define WITH(field, type, ...) changed(offsetof(vcache_adaptive_config, field), &(type){__VA_ARGS__}, sizeof(type))

static void creation(void **state)
{
    (void)state;
    const struct {
        vcache_adaptive_config config;
        const char *says; /* NULL: fine */
    } cases[] = {
        {WITH(size, size_t, 0), "config.size"},
        {WITH(sources, uint32_t, 0), "sources is 0"},
        {WITH(sources, uint32_t, VCACHE_ADAPTIVE_MAX_SOURCES + 1), "sources is 16777217"},
        {WITH(tolerance, float, -0.1f), "tolerance is -0.1"},
        {WITH(tolerance, float, NAN), "tolerance"},
        {WITH(tolerance, float, INFINITY), "tolerance"},
        {WITH(certainty, float, -0.1f), "certainty is -0.1"},
        {WITH(certainty, float, 1.1f), "certainty is 1.1"},
        {WITH(certainty, float, NAN), "certainty"},
        {WITH(prior_hits, float, -1.0f), "prior_hits is -1"},
        {WITH(prior_hits, float, 2.5f), "prior_hits is 2.5"},
        {WITH(prior_hits, float, NAN), "prior_hits"},
        {WITH(prior_tests, float, 0.0f), "prior_tests is 0"},
        {WITH(prior_tests, float, NAN), "prior_tests"},
        {WITH(prior_tests, float, INFINITY), "prior_tests"},
        {WITH(allocator, vcache_allocator, NULL, NULL, NULL), "allocator"},
        {WITH(tolerance, float, 5.0f), NULL},
        {WITH(prior_hits, float, 0.0f), NULL},
        {WITH(prior_hits, float, 2.0f), NULL},
        {WITH(sources, uint32_t, 1), NULL},
        {WITH(sources, uint32_t, 64), NULL},
    };
    char message[VCACHE_MESSAGE_BYTES];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        vcache_adaptive *a = (vcache_adaptive *)(void *)message;
        strcpy(message, "old");
        vcache_status status = vcache_adaptive_create(&cases[i].config, &a, message);
        if (!cases[i].says) {
            assert_int_equal(status, VCACHE_OK);
            assert_string_equal(message, "");
            vcache_adaptive_destroy(&a);
        } else {
            assert_int_equal(status, VCACHE_ERROR_ARGUMENT);
            assert_non_null(strstr(message, cases[i].says));
            assert_null(a);
            assert_int_equal(vcache_adaptive_create(&cases[i].config, &a, NULL), VCACHE_ERROR_ARGUMENT);
        }
    }
    ledger book = {0};
    vcache_adaptive_config config = vcache_adaptive_default_config();
    config.sources = 1000;
    config.allocator = (vcache_allocator){ledger_allocate, ledger_release, &book};
    vcache_adaptive *a = NULL;
    vcache_adaptive_worker *w = NULL;
    assert_int_equal(vcache_adaptive_create(&config, NULL, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_adaptive_create(NULL, &a, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_adaptive_worker_create(NULL, &w, message), VCACHE_ERROR_ARGUMENT);
    assert_non_null(strstr(message, "adaptive is NULL"));
    book.fails = true;
    assert_int_equal(vcache_adaptive_create(&config, &a, message), VCACHE_ERROR_MEMORY);
    assert_non_null(strstr(message, "memory"));
    book.fails = false;
    assert_int_equal(vcache_adaptive_create(&config, &a, message), VCACHE_OK);
    assert_int_equal(vcache_adaptive_worker_create(a, NULL, message), VCACHE_ERROR_ARGUMENT);
    book.fails = true;
    assert_int_equal(vcache_adaptive_worker_create(a, &w, message), VCACHE_ERROR_MEMORY);
    assert_null(w);
    book.fails = false;
    assert_int_equal(vcache_adaptive_worker_create(a, &w, message), VCACHE_OK);
    /* nothing is allocated on the way */
    size_t blocks = book.blocks;
    static float contribution[1000], weight[1000];
    static bool visible[1000];
    uint32_t order[1000];
    for (int i = 0; i < 1000; i++)
        contribution[i] = (float)(i % 37), visible[i] = i % 3;
    assert_true(light_up(w, contribution, visible, 1.0f, 16, weight, order) < 1000);
    vcache_adaptive_merge(a, &w, 1);
    assert_int_equal(book.blocks, blocks);
    vcache_adaptive_worker_destroy(&w);
    vcache_adaptive_destroy(&a);
    assert_null(a);
    assert_null(w);
    vcache_adaptive_worker_destroy(&w);
    vcache_adaptive_worker_destroy(NULL);
    vcache_adaptive_destroy(&a);
    vcache_adaptive_destroy(NULL);
    assert_int_equal(book.blocks + book.bytes, 0);
}

/* --------------------------------------------------------------------------------------------------- worked points */

typedef struct worked {
    const char *name;
    float tolerance, certainty, relaxation;
    float contribution[8];
    const char *visible; /* a digit per source */
    uint32_t tested, order[8];
    float weight[8]; /* with rates of 1/2: never tested, default prior */
} worked;

/* 8 sources, of 10, 1, 8, 2, 4, 0.5, 6, 0: sorted 0 2 6 4 3 1 5 (10 8 6 4 2 1 0.5). */
#define LAMPS                                                                                                          \
    {                                                                                                                  \
        10.0f, 1.0f, 8.0f, 2.0f, 4.0f, 0.5f, 6.0f, 0.0f                                                                \
    }

static const worked points[] = {
    /* S = 10, 18: 0.25 x 18 = 4.5 > 6 no; 24: 6 > 4 */
    {"next alone", 0.25f, 0.0f, 1.0f, LAMPS, "11111111", 3, {0, 2, 6}, {1, 0.5f, 1, 0.5f, 0.5f, 0.5f, 1, 0}},
    /* 16 x 0.5 = 8 is not > 8; S = 24: 12 > 4 */
    {"equal goes on", 0.5f, 0.0f, 1.0f, {16.0f, 8.0f, 4.0f}, "11111111", 2, {0, 1}, {1, 1, 0.5f}},
    /* rest 21.5, 13.5, 7.5 (S = 24: 6), 3.5 (S = 28: 7) */
    {"all that remain", 0.25f, 1.0f, 1.0f, LAMPS, "11111111", 4, {0, 2, 6, 4}, {1, 0.5f, 1, 0.5f, 1, 0.5f, 1, 0}},
    /* pairs: 8 + 6, 6 + 4 (S = 18: 4.5), 4 + 2 (S = 24: 6 is not more), 2 + 1 */
    {"two terms", 0.25f, 0.25f, 1.0f, LAMPS, "11111111", 4, {0, 2, 6, 4}, {1, 0.5f, 1, 0.5f, 1, 0.5f, 1, 0}},
    /* 0.3 x 8 = 2.4: two terms. S = 8: 2 > 6 + 4, 4 + 2, 2 + 1 no; S = 10: 2.5 > 1 + 0.5; v/w = 2/5 */
    {"blocked", 0.25f, 0.3f, 1.0f, LAMPS, "00110100", 5, {0, 2, 6, 4, 3}, {0, 0.2f, 1, 1, 0, 0.2f, 0, 0}},
    /* t = 0.5: S = 10: 5 > 8 no; S = 18: 9 > 6 */
    {"relaxed", 0.25f, 0.0f, 2.0f, LAMPS, "11111111", 2, {0, 2}, {1, 0.5f, 1, 0.5f, 0.5f, 0.5f, 0.5f, 0}},
    {"never tightened", 0.25f, 0.0f, 0.5f, LAMPS, "11111111", 3, {0, 2, 6}, {1, 0.5f, 1, 0.5f, 0.5f, 0.5f, 1, 0}},
    {"NaN relaxes nothing", 0.25f, 0.0f, NAN, LAMPS, "11111111", 3, {0, 2, 6}, {1, 0.5f, 1, 0.5f, 0.5f, 0.5f, 1, 0}},
    {"relaxed without end",
     0.25f,
     1.0f,
     INFINITY,
     LAMPS,
     "01111111",
     2,
     {0, 2},
     {0, 0.25f, 1, 0.25f, 0.25f, 0.25f, 0.25f, 0}},
    {"nothing visible", 0.5f, 0.0f, 9.0f, LAMPS, "00000000", 7, {0, 2, 6, 4, 3, 1, 5}, {0}},
    {"in its own order", 0.0f, 1.0f, INFINITY, LAMPS, "10101010", 7, {0, 1, 2, 3, 4, 5, 6}, {1, 0, 1, 0, 1, 0, 1, 0}},
    {"nothing to see", 0.1f, 0.5f, 1.0f, {0.0f}, "11111111", 0, {0}, {0}},
    {"no number",
     0.1f,
     0.0f,
     1.0f,
     {NAN, -1.0f, INFINITY, -INFINITY, -0.0f, 3.0f, -NAN, 1e-44f},
     "11111111",
     1,
     {5},
     {0, 0, 0, 0, 0, 1, 0, 0.5f}},
    {"no number, exact",
     0.0f,
     0.0f,
     1.0f,
     {NAN, -1.0f, INFINITY, -INFINITY, -0.0f, 3.0f, -NAN, 1e-44f},
     "11111111",
     2,
     {5, 7},
     {0, 0, 0, 0, 0, 1, 0, 1}},
    {"largest and smallest",
     1e-7f,
     1.0f,
     1.0f,
     {1e-45f, 3.4e38f, 0, 0, 0, 0, 0, 1e-45f},
     "11111111",
     1,
     {1},
     {0.5f, 1, 0, 0, 0, 0, 0, 0.5f}},
    {"equals in their order",
     0.5f,
     0.0f,
     1.0f,
     {1, 1, 1, 1, 1, 1, 1, 1},
     "11111111",
     3,
     {0, 1, 2},
     {1, 1, 1, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f}},
};

static void by_hand(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof points / sizeof *points; k++)
        for (uint32_t capacity = 1; capacity <= 8; capacity++) {
            const worked *p = &points[k];
            vcache_adaptive *a = make(8, p->tolerance, p->certainty, false);
            vcache_adaptive_worker *w = make_tester(a);
            bool visible[8];
            float weight[8];
            uint32_t order[8];
            for (int i = 0; i < 8; i++)
                visible[i] = p->visible[i] == '1', weight[i] = NAN;
            uint32_t tested = light_up(w, p->contribution, visible, p->relaxation, capacity, weight, order);
            if (tested != p->tested || memcmp(order, p->order, tested * sizeof *order) != 0 ||
                memcmp(weight, p->weight, sizeof weight) != 0)
                fail_msg("%s, %u at a time: %u tested, of them 0: %u; weights %g %g %g %g %g %g %g %g", p->name,
                         capacity, tested, order[0], (double)weight[0], (double)weight[1], (double)weight[2],
                         (double)weight[3], (double)weight[4], (double)weight[5], (double)weight[6], (double)weight[7]);
            vcache_adaptive_worker_destroy(&w);
            vcache_adaptive_destroy(&a);
        }
}

/* What is given out at once is what would be tested even if all of it were visible; told nothing, nothing more comes.
 */
static void at_once(void **state)
{
    (void)state;
    static const float contribution[8] = LAMPS;
    vcache_adaptive *a = make(8, 0.25f, 0.0f, false);
    vcache_adaptive_worker *w = make_tester(a);
    float weight[8];
    uint32_t sources[8];
    assert_int_equal(vcache_adaptive_next(w, sources, 8), 0); /* no point was begun */
    vcache_adaptive_begin(w, contribution, weight, 1.0f);
    assert_int_equal(vcache_adaptive_next(w, sources, 8), 3);
    assert_int_equal(vcache_adaptive_next(w, sources + 3, 5), 0);
    vcache_adaptive_tell(w, (vcache_answer[]){VCACHE_BLOCKED, VCACHE_BLOCKED, VCACHE_VISIBLE});
    /* S = 6: 1.5, below 4 and 2; were 4 visible: 2.5 > 2 */
    assert_int_equal(vcache_adaptive_next(w, sources, 8), 1);
    assert_int_equal(sources[0], 4);
    vcache_adaptive_tell(w, (vcache_answer[]){VCACHE_BLOCKED});
    /* 2 is tested; were it visible, S = 8: 2 > 1 */
    assert_int_equal(vcache_adaptive_next(w, sources, 8), 1);
    assert_int_equal(sources[0], 3);
    vcache_adaptive_tell(w, (vcache_answer[]){VCACHE_BLOCKED});
    /* S = 6: 1.5 > 1 */
    assert_int_equal(vcache_adaptive_next(w, sources, 8), 0);
    assert_int_equal(vcache_adaptive_finish(w), 5);
    assert_int_equal(vcache_adaptive_next(w, sources, 8), 0); /* nor is there one now */

    /* answers can come for several packets together */
    vcache_adaptive_begin(w, contribution, weight, 1.0f);
    assert_int_equal(vcache_adaptive_next(w, sources, 2), 2);
    assert_int_equal(vcache_adaptive_next(w, sources + 2, 2), 1);
    vcache_adaptive_tell(w, (vcache_answer[]){VCACHE_VISIBLE, VCACHE_BLOCKED, VCACHE_VISIBLE});
    assert_true(weight[0] == 1.0f && weight[2] == 0.0f && weight[6] == 1.0f);
    /* a point may be dropped */
    vcache_adaptive_begin(w, contribution, weight, 1.0f);
    assert_int_equal(vcache_adaptive_next(w, sources, 1), 1);
    assert_int_equal(vcache_adaptive_finish(w), 0);
    for (int i = 0; i < 8; i++)
        assert_true(weight[i] == (contribution[i] > 0.0f ? 0.5f : 0.0f)); /* the rates alone */
    assert_int_equal(vcache_adaptive_next(w, sources, 8), 0);             /* and is finished then */
    vcache_adaptive_worker_destroy(&w);
    vcache_adaptive_destroy(&a);
}

/* ------------------------------------------------------------------------------------------------- random points */

/* The paper's steps, sorted to the end. */
typedef struct entry {
    float value;
    uint32_t source;
} entry;

static int brighter(const void *a, const void *b)
{
    const entry *x = a, *y = b;
    return x->value != y->value ? (x->value < y->value ? 1 : -1) : x->source < y->source ? -1 : 1;
}

static uint32_t paper(uint32_t n, double t, double c, const float *contribution, const bool *visible,
                      const vcache_adaptive *rates, float *weight, uint32_t *order)
{
    static entry list[MOST];
    static double before[MOST + 1]; /* sums */
    uint32_t m = 0, terms = (uint32_t)floor(n * c + 0.5), v = 0, w = 0;
    for (uint32_t i = 0; i < n; i++) {
        weight[i] = 0.0f;
        if (contribution[i] > 0.0f && isfinite(contribution[i]))
            list[m++] = (entry){contribution[i], i};
    }
    qsort(list, m, sizeof *list, brighter);
    for (uint32_t i = 0; i < m; i++)
        before[i + 1] = before[i] + (double)list[i].value;
    terms = terms < 1 ? 1 : terms;
    double s = 0.0;
    for (; w < m; w++) {
        uint32_t end = terms < m - w ? w + terms : m;
        if (s * t > before[end] - before[w])
            break;
        order[w] = list[w].source;
        if (visible[list[w].source]) {
            v++;
            s += (double)list[w].value;
            weight[list[w].source] = 1.0f;
        }
    }
    for (uint32_t i = w; i < m; i++)
        weight[list[i].source] = (float)((double)v / w) * vcache_adaptive_source_rate(rates, list[i].source).rate;
    return w;
}

static void as_sorted(void **state)
{
    (void)state;
    static float contribution[MOST], weight[MOST], expected[MOST];
    static bool visible[MOST];
    static uint32_t order[MOST], expected_order[MOST];
    static const float certainties[] = {0.0f, 0.02f, 0.1f, 0.25f, 0.5f, 0.75f, 0.97f, 1.0f};
    uint64_t seed = 4, stopped = 0, rounds = 4000;
    for (uint64_t r = 0; r < rounds; r++) {
        uint32_t n = 1 + (uint32_t)(random_bits(&seed) % (r % 20 ? 150 : 3000));
        float t = (float)pow(10.0, random_between(&seed, -4.0, 1.0)), relaxation = 1.0f + (float)(r % 3);
        float c = certainties[r % 8];
        vcache_adaptive *a = make(n, t, c, false);
        vcache_adaptive_worker *w = make_tester(a);
        for (int point = 0; point < 4; point++) {
            int kind = (int)(random_bits(&seed) % 4);
            double share = point ? random_unit(&seed) : 1.0;
            for (uint32_t i = 0; i < n; i++) {
                contribution[i] = random_contribution(&seed, kind);
                visible[i] = random_unit(&seed) < share;
            }
            uint32_t capacity = 1 + (uint32_t)(random_bits(&seed) % 20);
            uint32_t tested = light_up(w, contribution, visible, relaxation, capacity, weight, order);
            uint32_t wanted =
                paper(n, (double)t * (double)relaxation, (double)c, contribution, visible, a, expected, expected_order);
            if (tested != wanted || memcmp(order, expected_order, tested * sizeof *order) != 0)
                fail_msg("%u sources, t %g x %g, c %g, kind %d: %u tested, not %u", n, (double)t, (double)relaxation,
                         (double)c, kind, tested, wanted);
            assert_memory_equal(weight, expected, n * sizeof *weight);
            stopped += tested < n;
            if (random_bits(&seed) % 2)
                vcache_adaptive_merge(a, &w, 1);
        }
        vcache_adaptive_worker_destroy(&w);
        vcache_adaptive_destroy(&a);
    }
    assert_true(stopped > rounds * 2);
}

/* t = 0: the sum in the order of the sources is the exact one, bit for bit, and nothing is sorted or counted. */
static void exact(void **state)
{
    (void)state;
    enum { N = 300 };
    float contribution[N], colour[N], weight[N];
    bool visible[N];
    uint32_t order[N];
    uint64_t seed = 7, candidates = 0;
    for (int free_running = 0; free_running < 2; free_running++) {
        vcache_adaptive *a = make(N, 0.0f, 0.5f, free_running);
        vcache_adaptive_worker *w = make_tester(a);
        candidates = 0;
        for (int point = 0; point < 500; point++) {
            float sum = 0.0f, same = 0.0f;
            uint32_t asked = 0;
            for (int i = 0; i < N; i++) {
                colour[i] = random_bits(&seed) % 3 ? (float)pow(10.0, random_between(&seed, -12.0, 12.0)) : 0.0f;
                contribution[i] = 0.7f * colour[i];
                visible[i] = random_bits(&seed) % 2;
                if (contribution[i] > 0.0f && visible[i])
                    sum += colour[i];
                asked += contribution[i] > 0.0f;
            }
            uint32_t tested = light_up(w, contribution, visible, 1e9f, 1 + (uint32_t)point % 17, weight, order);
            assert_int_equal(tested, asked);
            for (int i = 0; i < N; i++)
                same += colour[i] * weight[i];
            assert_memory_equal(&sum, &same, sizeof sum);
            for (uint32_t i = 1; i < tested; i++)
                assert_true(order[i] > order[i - 1]);
            candidates += asked;
        }
        vcache_adaptive_statistics s = counts_of(w);
        assert_int_equal(s.compared, 0);
        assert_int_equal(s.candidates, candidates);
        assert_int_equal(s.tested, candidates);
        vcache_adaptive_merge(a, &w, 1);
        assert_int_equal(vcache_adaptive_source_rate(a, 3).tests, 0);
        vcache_adaptive_worker_destroy(&w);
        vcache_adaptive_destroy(&a);
    }
}

/* c = 1: |result - exact| <= t exact at every point, whatever the hit rates; t S bounds each untested one at c = 0. */
static void bound(void **state)
{
    (void)state;
    enum { N = 200, POINTS = 5000 };
    float contribution[N], weight[N];
    bool visible[N];
    uint32_t order[N];
    static const float tolerances[] = {1e-3f, 0.01f, 0.05f, 0.1f, 0.2f, 0.5f, 1.0f, 3.0f};
    uint64_t seed = 9;
    double untested = 0.0, largest = 0.0;
    for (size_t k = 0; k < sizeof tolerances / sizeof *tolerances; k++)
        for (int c = 0; c < 2; c++) {
            double t = (double)tolerances[k];
            vcache_adaptive *a = make(N, tolerances[k], (float)c, false);
            vcache_adaptive_worker *w = make_tester(a);
            double share = 1.0;
            for (int point = 0; point < POINTS; point++) {
                if (point % 50 == 0) {
                    vcache_adaptive_merge(a, &w, 1);
                    share = random_unit(&seed); /* rates learnt elsewhere are wrong here */
                }
                double correct = 0.0, result = 0.0, seen = 0.0;
                for (int i = 0; i < N; i++) {
                    contribution[i] = random_contribution(&seed, point % 4);
                    visible[i] = random_unit(&seed) < share;
                    correct += visible[i] ? (double)contribution[i] : 0.0;
                }
                uint32_t tested = light_up(w, contribution, visible, 1.0f, 16, weight, order);
                assert_true(tested <= N);
                for (uint32_t i = 0; i < tested; i++)
                    seen += visible[order[i]] ? (double)contribution[order[i]] : 0.0;
                for (int i = 0; i < N; i++) {
                    assert_true(weight[i] >= 0.0f && weight[i] <= 1.0f);
                    result += (double)contribution[i] * (double)weight[i];
                }
                if (c == 1) {
                    if (!(fabs(result - correct) <= t * correct))
                        fail_msg("t %g: %.9g instead of %.9g", t, result, correct);
                    if (correct > 0.0 && fabs(result - correct) / correct / t > largest)
                        largest = fabs(result - correct) / correct / t;
                    untested += N - tested;
                } else {
                    for (uint32_t i = 0; i < tested; i++)
                        contribution[order[i]] = 0.0f;
                    for (int i = 0; i < N; i++)
                        assert_true(contribution[i] == 0.0f || (double)contribution[i] < t * seen);
                }
            }
            vcache_adaptive_worker_destroy(&w);
            vcache_adaptive_destroy(&a);
        }
    print_message("largest error: %.2f of the tolerance; %.1f %% not tested\n", largest,
                  100.0 * untested / (N * 8.0 * POINTS));
    assert_true(untested > 0.0 && largest > 0.3); /* it was put to the test */
}

/* Contributions over the whole range of floats, the brightest blocked: what remains must not drown in rounding. */
static void range(void **state)
{
    (void)state;
    enum { N = 500 };
    float contribution[N], weight[N];
    bool visible[N];
    uint32_t order[N];
    uint64_t seed = 12;
    vcache_adaptive *a = make(N, 0.01f, 1.0f, false);
    vcache_adaptive_worker *w = make_tester(a);
    for (int point = 0; point < 500; point++) {
        double correct = 0.0, result = 0.0;
        float dim = (float)pow(10.0, random_between(&seed, -30.0, 10.0));
        for (int i = 0; i < N; i++) {
            contribution[i] = (float)pow(10.0, random_between(&seed, -40.0, 30.0));
            visible[i] = contribution[i] < dim;
            correct += visible[i] ? (double)contribution[i] : 0.0;
        }
        light_up(w, contribution, visible, 1.0f, 16, weight, order);
        for (int i = 0; i < N; i++)
            result += (double)contribution[i] * (double)weight[i];
        assert_true(fabs(result - correct) <= (double)0.01f * correct * (1.0 + 1e-12));
    }
    vcache_adaptive_worker_destroy(&w);
    vcache_adaptive_destroy(&a);
}

/* 10,000 sources: n + k log k comparisons, not n log n. */
static void comparisons(void **state)
{
    (void)state;
    static float contribution[MOST], weight[MOST];
    static bool visible[MOST];
    static uint32_t order[MOST];
    static const float certainties[] = {0.0f, 0.01f, 0.25f, 0.5f, 1.0f};
    uint64_t seed = 10;
    for (size_t c = 0; c < sizeof certainties / sizeof *certainties; c++)
        for (int kind = 0; kind < 5; kind++)
            for (float t = 1e-5f; t < 2.0f; t *= 8.0f) {
                vcache_adaptive *a = make(MOST, t, certainties[c], false);
                vcache_adaptive_worker *w = make_tester(a);
                enum { POINTS = 5 };
                double tested = 0.0;
                for (int point = 0; point < POINTS; point++) {
                    for (uint32_t i = 0; i < MOST; i++) {
                        /* the last: sorted already, upwards or downwards */
                        contribution[i] = kind < 4    ? random_contribution(&seed, kind) + 0x1p-10f
                                          : point % 2 ? (float)(i + 1)
                                                      : (float)(MOST - i);
                        visible[i] = random_bits(&seed) % 8;
                    }
                    tested += light_up(w, contribution, visible, 1.0f, 16, weight, order);
                }
                double n = MOST, k = tested / POINTS, found = (double)counts_of(w).compared / POINTS;
                double most = 4.0 * n + 2.0 * k * log2(k + 1.0);
                if (found > most)
                    fail_msg("certainty %g, tolerance %g, kind %d, %g tested: %.0f comparisons, over %.0f",
                             (double)certainties[c], (double)t, kind, k, found, most);
                if (kind == 3)
                    print_message("certainty %4g, tolerance %6.0e: %5.0f tested, %6.0f comparisons, n log2 n is %.0f\n",
                                  (double)certainties[c], (double)t, k, found, n * log2(n));
                vcache_adaptive_worker_destroy(&w);
                vcache_adaptive_destroy(&a);
            }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(creation), cmocka_unit_test(by_hand), cmocka_unit_test(at_once), cmocka_unit_test(as_sorted),
        cmocka_unit_test(exact),    cmocka_unit_test(bound),   cmocka_unit_test(range),   cmocka_unit_test(comparisons),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
