/* SPDX-License-Identifier: Apache-2.0 */
/* Estimates: arguments, what cells learn and forget, what is expected of each light, how many rays a sample gets. */
#include "estimate_support.h"
#include "ledger.h"

/* ------------------------------------------------------------------------------------------------------ arguments */

static void arguments(void **state)
{
    (void)state;
    ledger money = {0};
    vcache_config config = vcache_default_config();
    config.allocator = (vcache_allocator){ledger_allocate, ledger_release, &money};
    vcache *c = make_cache(&config);
    vcache_light light[65];
    for (int i = 0; i < 65; i++)
        vcache_prepare_direction(c, (float[3]){1.0f, (float)i, 1.0f}, 0, &light[i]);
    vcache_light_set *set = make_set(c, light, 65, 1);
    assert_int_equal(vcache_light_set_padded(set), 128);
    const ledger before = money;

    char message[VCACHE_MESSAGE_BYTES] = "old";
    vcache_predictor *p = (vcache_predictor *)(void *)light;
    assert_int_equal(vcache_predictor_create(NULL, VCACHE_DRAW_UNCERTAIN, &p, message), VCACHE_ERROR_ARGUMENT);
    assert_null(p);
    assert_non_null(strstr(message, "set is NULL"));
    assert_int_equal(vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, NULL, message), VCACHE_ERROR_ARGUMENT);
    assert_non_null(strstr(message, "out is NULL"));
    assert_int_equal(vcache_predictor_create(NULL, VCACHE_DRAW_UNCERTAIN, &p, NULL), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, NULL, NULL), VCACHE_ERROR_ARGUMENT);
    money.fails = true;
    p = (vcache_predictor *)(void *)light;
    assert_int_equal(vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, &p, message), VCACHE_ERROR_MEMORY);
    assert_null(p);
    assert_non_null(strstr(message, "memory"));
    assert_int_equal(vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, &p, NULL), VCACHE_ERROR_MEMORY);
    money.fails = false;
    assert_true(money.blocks == before.blocks && money.bytes == before.bytes);

    assert_int_equal(vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, &p, message), VCACHE_OK);
    assert_string_equal(message, "");
    assert_int_equal(money.blocks, before.blocks + 1);
    vcache_pick picks[8];
    assert_int_equal(vcache_pick_lights(p, 4.0f, 1, 0.5f, picks, 8), 0); /* nothing was predicted yet */
    vcache_predictor_destroy(&p);
    assert_null(p);
    assert_true(money.blocks == before.blocks && money.bytes == before.bytes);
    vcache_predictor_destroy(&p);
    vcache_predictor_destroy(NULL);
    vcache_light_set_destroy(&set);
    vcache_destroy(&c);
    assert_true(money.blocks == 0 && money.bytes == 0);
}

/* ------------------------------------------------------------------------------------------------- what is learnt */

/* Every sequence of five answers, ONCE among them: what a cell knows is the set of outcomes that were not ONCE. */
static void sequences(void **state)
{
    (void)state;
    static const int answers[4] = {VCACHE_BLOCKED, VCACHE_VISIBLE, VCACHE_BLOCKED | VCACHE_ONCE,
                                   VCACHE_VISIBLE | VCACHE_ONCE};
    bench b = make_bench(130, 1 << 12, VCACHE_ISA_ALL);
    for (int code = 0; code < 1024; code++) {
        vcache_prediction p;
        do { /* three rows of their own */
            vcache_clear(b.cache);
            p = predict_at(&b, 0.3, 0.4);
        } while (row_of(b.set, p.cells.key[0]) == row_of(b.set, p.cells.key[1]) ||
                 row_of(b.set, p.cells.key[0]) == row_of(b.set, p.cells.key[2]) ||
                 row_of(b.set, p.cells.key[1]) == row_of(b.set, p.cells.key[2]));
        uint32_t light = (uint32_t)code % 130;
        bool blocked = false, visible = false;
        for (int i = 0; i < 5; i++) {
            int a = code >> 2 * i & 3;
            learn_one(&b, &p.cells, light, answers[a]);
            blocked |= a == 0, visible |= a == 1;
            int expected = blocked && visible ? SEEN_BOTH : blocked ? SEEN_BLOCKED : visible ? SEEN_VISIBLE : UNKNOWN;
            for (int k = 0; k < VCACHE_CELLS; k++)
                if (known_of(&b, &p.cells, k, light) != expected)
                    fail_msg("sequence %d, step %d, cell %d: %d, not %d", code, i, k, known_of(&b, &p.cells, k, light),
                             expected);
        }
        for (uint32_t other = 0; other < 130; other++)
            assert_true(other == light || known_of(&b, &p.cells, 0, other) == UNKNOWN);
    }
    free_bench(&b);
}

/* Many at a time do what one after the other does. */
static void together(void **state)
{
    (void)state;
    uint64_t seed = 1;
    bench a = make_bench(300, 1 << 12, VCACHE_ISA_ALL), b = make_bench(300, 1 << 12, VCACHE_ISA_ALL);
    for (int turn = 0; turn < 100; turn++) {
        double x = random_unit(&seed), y = random_unit(&seed);
        vcache_cells ca = predict_at(&a, x, y).cells, cb = predict_at(&b, x, y).cells;
        vcache_pick picks[50];
        vcache_answer answers[50];
        for (int i = 0; i < 50; i++) {
            picks[i] = (vcache_pick){.light = (uint32_t)(random_bits(&seed) % 300), .weight = 1.0f};
            answers[i] = random_bits(&seed) % 5 ? random_bits(&seed) & 1 : VCACHE_ONCE;
            learn_one(&a, &ca, picks[i].light, answers[i]);
        }
        vcache_learn(b.set, &cb, picks, answers, 50);
        for (uint32_t i = 0; i < 300; i++)
            for (int k = 0; k < VCACHE_CELLS; k++)
                assert_int_equal(known_of(&a, &ca, k, i), known_of(&b, &cb, k, i));
    }
    free_bench(&a);
    free_bench(&b);
}

/* The finest cell is the eye end's own: what was learnt of one outcome answers vcache_add_set, both outcomes do not. */
static void answers_of_add_set(void **state)
{
    (void)state;
    bench b = make_bench(64, 1 << 10, VCACHE_ISA_ALL);
    vcache_surface s = floor_end(0.3, 0.4);
    s.user = 5;
    vcache_eye *eye = make_eye(b.cache, &s, fine_ce, 0);
    vcache_worker *worker = make_worker(b.cache, 64, false);
    vcache_cells cells = vcache_predict(b.predictor, &s, fine_ce, 0, b.contribution).cells;
    for (uint32_t i = 0; i < 64; i++) /* in turn: blocked, visible, both, unknown */
        for (int answer = 0; answer < 2; answer++)
            if (i % 4 == (uint32_t)answer || i % 4 == 2)
                learn_one(&b, &cells, i, answer);
    uint64_t visible = 0;
    tracer rays = {0};
    query_set(worker, eye, b.set, NULL, &visible, light_up, &rays);
    assert_int_equal(rays.rays, 32);
    for (uint32_t i = 0; i < 64; i++) {
        bool expected = i % 4 < 2 ? i % 4 == 1 : lit(5, i);
        assert_int_equal(visible >> i & 1, expected);
        assert_int_equal(known_of(&b, &cells, 0, i),
                         expected ? SEEN_VISIBLE : SEEN_BLOCKED); /* `both` was overwritten */
    }
    query_set(worker, eye, b.set, NULL, &visible, light_up, &rays);
    assert_int_equal(rays.rays, 32);
    learn_one(&b, &cells, 2, !lit(5, 2));
    assert_int_equal(known_of(&b, &cells, 0, 2), SEEN_BOTH);
    vcache_worker_destroy(&worker);
    free(eye);
    free_bench(&b);
}

static uint64_t *copy_rows(const bench *b)
{
    size_t words = (size_t)b->set->rows * b->set->stride;
    uint64_t *copy = malloc(words * sizeof *copy);
    assert_non_null(copy);
    for (size_t i = 0; i < words; i++)
        copy[i] = atomic_load(&b->set->memory[i]);
    return copy;
}

static void assert_untouched(const bench *b, uint64_t *before)
{
    uint64_t *after = copy_rows(b);
    assert_memory_equal(before, after, (size_t)b->set->rows * b->set->stride * sizeof *after);
    free(before);
    free(after);
}

/* Ends that cannot be quantized know nothing and teach nothing; nor do no answers, ONCE, or what is known already. */
static void what_writes_nothing(void **state)
{
    (void)state;
    bench b = make_bench(70, 1, VCACHE_ISA_ALL); /* one row: whatever is written shows */
    vcache_prediction p = predict_at(&b, 0.5, 0.5);
    vcache_cells good = {{0, 0, p.cells.key[2]}}, other = predict_at(&b, 0.1, 0.1).cells;
    for (uint32_t i = 0; i < 70; i++)
        learn_one(&b, &good, i, (int)(i % 2));
    learn_one(&b, &good, 69, VCACHE_BLOCKED); /* both */
    uint64_t *rows = copy_rows(&b);
    const struct {
        float x, nz, density, ce;
    } bad[] = {{NAN, 1, 1, 1},    {INFINITY, 1, 1, 1}, {0.5f, 0, 1, 1},        {0.5f, NAN, 1, 1},
               {0.5f, 1, 0, 1},   {0.5f, 1, NAN, 1},   {0.5f, 1, -1, 1},       {0.5f, 1, 1, 0},
               {0.5f, 1, 1, NAN}, {0.5f, 1, 1, -1},    {0.5f, 1, 1, INFINITY}, {1e9f, 1, 1, 1}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        vcache_surface s = {.position = {bad[i].x, 0.5f, 0.5f}, .normal = {0, 0, bad[i].nz}, .density = bad[i].density};
        assert_true(predict_at(&b, 0.5, 0.5).mean[1] > b.states[0]); /* leaves its rows in the scratch */
        p = vcache_predict(b.predictor, &s, bad[i].ce, 0, b.contribution);
        for (int k = 0; k < VCACHE_CELLS; k++)
            assert_true(p.cells.key[k] == 0);
        for (uint32_t l = 0; l < 70; l++) {
            assert_true(p.mean[l] == b.states[0]);
            learn_one(&b, &p.cells, l, 1);
        }
    }
    vcache_learn(b.set, &other, NULL, NULL, 0);
    for (uint32_t i = 0; i < 70; i++) {
        learn_one(&b, &other, i, VCACHE_ONCE | (int)(i % 2));
        learn_one(&b, &good, i, (int)(i % 2)); /* versions stay as they are */
    }
    assert_untouched(&b, rows);
    free_bench(&b);
}

static void clears_and_salts(void **state)
{
    (void)state;
    bench b = make_bench(70, 1 << 14, VCACHE_ISA_ALL);
    vcache_surface s = floor_end(0.3, 0.4);
    enum { SALTS = 5 };
    static const uint64_t salts[SALTS] = {0, 1, 2, 3, UINT64_MAX};
    vcache_cells cells[SALTS];
    for (int i = 0; i < SALTS; i++) {
        cells[i] = vcache_predict(b.predictor, &s, fine_ce, salts[i], b.contribution).cells;
        for (uint32_t l = 0; l < 70; l++)
            learn_one(&b, &cells[i], l, (int)((l + (uint32_t)i) % 2));
    }
    for (int i = 0; i < SALTS; i++) {
        vcache_prediction p = vcache_predict(b.predictor, &s, fine_ce, salts[i], b.contribution);
        assert_memory_equal(&p.cells, &cells[i], sizeof p.cells);
        for (uint32_t l = 0; l < 70; l++)
            assert_true((p.mean[l] > 0.5f) == ((l + (uint32_t)i) % 2 == 1));
    }
    vcache_clear(b.cache);
    vcache_cells old = cells[0];
    for (int turn = 0; turn < 2; turn++) {
        vcache_prediction p = predict_at(&b, 0.3, 0.4);
        for (uint32_t l = 0; l < 70; l++)
            assert_true(p.mean[l] == b.states[0]);
        for (int k = 0; k < VCACHE_CELLS; k++)
            assert_true(p.cells.key[k] != old.key[k]);
        learn_one(&b, &old, 3, VCACHE_VISIBLE); /* a ray that was under way: is seen by nobody any more */
    }
    free_bench(&b);
}

/* ----------------------------------------------------------------------------------------------- what is expected */

static void predictions(void **state)
{
    (void)state;
    static const uint32_t isas[] = {VCACHE_ISA_SCALAR, VCACHE_ISA_AVX2, VCACHE_ISA_ALL};
    uint64_t seed = 2;
    for (int run = 0; run < 3; run++)
        for (uint32_t lights = 1; lights <= 700; lights = lights * 3 + 1) {
            bench b = make_bench(lights, 1 << 10, isas[run]);
            vcache_cells at = predict_at(&b, 0.3, 0.4).cells;
            for (uint32_t i = 0; i < lights; i++) {
                b.contribution[i] = random_bits(&seed) % 4 ? (float)exp(random_between(&seed, -9.0, 9.0)) : 0.0f;
                for (int k = 0; k < VCACHE_CELLS; k++) { /* any state in any cell */
                    vcache_cells one = {{0}};
                    one.key[k] = at.key[k];
                    uint64_t r = random_bits(&seed) % 4;
                    for (int a = 0; a < 2; a++)
                        if (r >> a & 1)
                            learn_one(&b, &one, i, a);
                }
            }
            vcache_prediction p = predict_at(&b, 0.3, 0.4);
            double expected = 0.0, deviation = 0.0;
            for (uint32_t i = 0; i < b.padded; i++) {
                double m = (double)p.mean[i], d = (double)deviation_of(p.mean[i]);
                uint32_t s = 0;
                for (int k = 0; k < VCACHE_CELLS; k++)
                    s |= (uint32_t)known_of(&b, &at, k, i) << 2 * k;
                assert_true(m > 0.0 && m < 1.0 && p.mean[i] == b.states[s]);
                assert_true(fabs(d - sqrt(m * (1.0 - m)) - 0.02) < 0.03); /* the mean was changed by 2^-7 of itself */
                expected += (double)b.contribution[i] * m, deviation += (double)b.contribution[i] * d;
            }
            assert_true(fabs((double)p.expected - expected) <= 1e-5 * expected);
            assert_true(fabs((double)p.deviation - deviation) <= 1e-5 * deviation);
            free_bench(&b);
        }
}

static void what_cells_agree_on(void **state)
{
    (void)state;
    bench b = make_bench(64, 1 << 10, VCACHE_ISA_ALL);
    vcache_cells at = predict_at(&b, 0.3, 0.4).cells;
    learn_one(&b, &at, 10, VCACHE_VISIBLE);
    learn_one(&b, &at, 11, VCACHE_BLOCKED);
    vcache_prediction p = predict_at(&b, 0.3, 0.4);
    assert_true(p.mean[10] > 0.95f && p.mean[11] < 0.05f && p.mean[12] > 0.3f && p.mean[12] < 0.9f);
    assert_true(deviation_of(p.mean[12]) > 3.0f * deviation_of(p.mean[10]));
    assert_true(deviation_of(p.mean[12]) > 3.0f * deviation_of(p.mean[11]));
    /* an end in the same middle cell, not in the same fine one, is less sure */
    float sure = deviation_of(p.mean[10]);
    double x = 0.3;
    while (x < 0.6 && (p = predict_at(&b, x, 0.4)).cells.key[0] == at.key[0])
        x += 0.001;
    assert_true(p.cells.key[1] == at.key[1]);
    assert_true(p.mean[10] > 0.9f && p.mean[11] < 0.1f && deviation_of(p.mean[10]) > sure);
    free_bench(&b);
}

/* --------------------------------------------------------------------------------------------------------- budget */

static double normal(uint64_t *seed)
{
    return sqrt(-2.0 * log(1.0 - random_unit(seed))) * cos(6.283185307179586 * random_unit(seed));
}

/* Rays grow with the error, and shrink with the light there is where that is not dark: for value / (value + 0.4 mean)
 * the derivative of its logarithm is 1 - 1 / 1.4. */
static void budgets(void **state)
{
    (void)state;
    uint64_t seed = 3;
    static const float means[] = {0.5f, 6.0f, 100.0f};
    static const uint32_t together[] = {1, 16};
    for (int m = 0; m < 3; m++)
        for (int scale = -15; scale <= 15; scale += 5) {
            vcache_budget b = {.rays = means[m]};
            double sum = 0.0, low = INFINITY, high = 0.0, of_error = 0.0, of_value = 0.0, unit = pow(10.0, scale);
            enum { COUNT = 20000 };
            uint32_t samples = together[m % 2];
            for (int i = 0; i < COUNT; i++) {
                double z = 0.2 * normal(&seed), y = 0.1 * normal(&seed); /* nothing is clamped */
                double rays = (double)vcache_budget_rays(&b, (float)(exp(z) * unit), (float)(exp(y) * unit), samples);
                rays /= samples * (double)means[m];
                sum += rays, low = fmin(low, rays), high = fmax(high, rays);
                of_error += z * log(rays), of_value += y * log(rays);
            }
            if (!(fabs(sum / COUNT - 1.0) < 0.02))
                fail_msg("%g rays, errors around 1e%d: mean %g of it", (double)means[m], scale, sum / COUNT);
            assert_true(fabs(of_error / COUNT / 0.04 - 1.0) < 0.04);
            assert_true(fabs(of_value / COUNT / 0.01 + 1.0 / 1.4) < 0.08);
            assert_true(low > 0.1 && high < 4.0);
            assert_true(b.rays == means[m]);
        }
}

static void budget_limits(void **state)
{
    (void)state;
    vcache_budget b = {.rays = 6.0f};
    assert_true(vcache_budget_rays(&b, 0.0f, 0.0f, 1) == 6.0f); /* nothing to compare with */
    b = (vcache_budget){.rays = 6.0f};
    assert_true(vcache_budget_rays(&b, NAN, 1.0f, 1) == 6.0f && vcache_budget_rays(&b, INFINITY, 1.0f, 2) == 12.0f);
    assert_true(vcache_budget_rays(&b, 1.0f, NAN, 1) == 6.0f && b.count == 0.0);
    assert_true(vcache_budget_rays(&b, 1.0f, 1.0f, 1) == 6.0f);
    for (int i = 0; i < 1000; i++)
        vcache_budget_rays(&b, 1.0f, 1.0f, 1);
    const vcache_budget typical = b;
    const struct {
        float error, rays;
    } limits[] = {{0.0f, 0.6f}, {1e-20f, 0.6f}, {0x1p-149f, 0.6f}, {1e4f, 24.0f}, {3e38f, 24.0f}};
    for (size_t i = 0; i < sizeof limits / sizeof *limits; i++)
        for (uint32_t samples = 1; samples <= 3; samples++) {
            b = typical;
            float rays = vcache_budget_rays(&b, limits[i].error, 1.0f, samples) / (float)samples;
            if (!(fabsf(rays - limits[i].rays) < 1e-6f * limits[i].rays))
                fail_msg("error %g: %g rays", (double)limits[i].error, (double)rays);
        }
    b = typical;
    assert_true(vcache_budget_rays(&b, NAN, 1.0f, 1) == 6.0f && vcache_budget_rays(&b, -INFINITY, 1.0f, 1) == 6.0f);
    assert_memory_equal(&b, &typical, sizeof b); /* one odd pixel does not spoil the rest */
}

/* What is found of lights of one state is expected of that state soon, and of no other. */
static void predictors_adapt(void **state)
{
    (void)state;
    enum { COUNT = 200 };
    for (vcache_drawing drawing = VCACHE_DRAW_UNCERTAIN; drawing <= VCACHE_DRAW_BRIGHT; drawing++) {
        bench b = make_bench(COUNT, 1 << 10, VCACHE_ISA_ALL);
        vcache_predictor_destroy(&b.predictor);
        assert_int_equal(vcache_predictor_create(b.set, drawing, &b.predictor, NULL), VCACHE_OK);
        for (uint32_t i = 0; i < COUNT; i++)
            b.contribution[i] = 1.0f;
        vcache_prediction p = predict_at(&b, 0.3, 0.4);
        learn_one(&b, &p.cells, 1, VCACHE_VISIBLE);
        p = predict_at(&b, 0.3, 0.4);
        const float unknown = p.mean[0], seen = p.mean[1];
        vcache_pick picks[64];
        vcache_answer answers[64];
        for (int round = 0; round < 200; round++) {
            uint32_t n = vcache_pick_lights(b.predictor, 40.0f, 1, (round + 0.5) / 200.0, picks, 64);
            for (uint32_t k = 0; k < n; k++) {
                bool known = picks[k].light == 1 && drawing != VCACHE_DRAW_BRIGHT;
                assert_int_equal(picks[k].state % STATES, known ? 0x3f : 0);
                answers[k] = VCACHE_BLOCKED;
                if (known) /* as if it had not been asked */
                    answers[k] = VCACHE_BLOCKED | VCACHE_ONCE;
            }
            vcache_adapt(b.predictor, picks, answers, n);
            assert_true(p.mean[0] == unknown); /* until the next prediction */
        }
        p = predict_at(&b, 0.3, 0.4);
        float d = deviation_of(p.mean[0]);
        assert_true(p.mean[1] == seen);
        if (drawing == VCACHE_DRAW_UNCERTAIN)
            assert_true(p.mean[0] < 0.01f && p.mean[0] > 0.0f && d < 0.15f && d > 0.02f);
        else if (drawing == VCACHE_DRAW_VISIBLE)
            assert_true(p.mean[0] < 1e-17f && d < 0.15f && d > 0.02f);
        else
            assert_true(p.mean[0] == unknown);
        free_bench(&b);
    }
}

/* What nobody has asked for is expected after what was found in the same cell: where half is seen, apart from where
 * nothing is. */
static void dark_cells_adapt_apart(void **state)
{
    (void)state;
    enum { COUNT = 200, KNOWN = 100 };
    const double places[2] = {0.2, 0.7};
    bench b = make_bench(COUNT, 1 << 10, VCACHE_ISA_ALL);
    for (uint32_t i = 0; i < COUNT; i++)
        b.contribution[i] = 1.0f;
    for (int bright = 0; bright < 2; bright++) {
        vcache_prediction p = predict_at(&b, places[bright], places[bright]);
        for (uint32_t i = 0; i < KNOWN; i++)
            learn_one(&b, &p.cells, i, bright ? VCACHE_VISIBLE : VCACHE_BLOCKED);
    }
    for (int round = 0; round < 400; round++) {
        vcache_pick picks[64];
        vcache_answer answers[64];
        predict_at(&b, places[round % 2], places[round % 2]);
        uint32_t n = vcache_pick_lights(b.predictor, 40.0f, 1, (round + 0.5) / 400.0, picks, 64);
        for (uint32_t k = 0; k < n; k++)
            answers[k] = picks[k].light < KNOWN ? VCACHE_ONCE : round % 2 ? VCACHE_VISIBLE : VCACHE_BLOCKED;
        vcache_adapt(b.predictor, picks, answers, n);
    }
    float dark = predict_at(&b, places[0], places[0]).mean[COUNT - 1];
    float bright = predict_at(&b, places[1], places[1]).mean[COUNT - 1];
    float elsewhere = predict_at(&b, 0.45, 0.9).mean[COUNT - 1];
    assert_true(dark < 0.05f && bright > 0.95f && elsewhere > 0.2f && elsewhere < 0.8f);
    free_bench(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(arguments),
        cmocka_unit_test(sequences),
        cmocka_unit_test(together),
        cmocka_unit_test(answers_of_add_set),
        cmocka_unit_test(what_writes_nothing),
        cmocka_unit_test(clears_and_salts),
        cmocka_unit_test(predictions),
        cmocka_unit_test(what_cells_agree_on),
        cmocka_unit_test(budgets),
        cmocka_unit_test(budget_limits),
        cmocka_unit_test(predictors_adapt),
        cmocka_unit_test(dark_cells_adapt_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
