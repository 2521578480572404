/* SPDX-License-Identifier: Apache-2.0 */
/* Which lights are drawn: each with the probability that its weight says, none twice, whatever the contributions. */
#include "estimate_support.h"

enum { LIGHTS_MAX = 1000 };

/* Weights as the library has them: contribution times the deviation of what is expected. */
static double weights_of(const bench *b, const vcache_prediction *p, double *weight)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < b->padded; i++)
        sum += weight[i] = (double)b->contribution[i] * (double)deviation_of(p->mean[i]);
    return sum;
}

/* Some lights known in some cells, so that equal contributions have different weights. */
static void teach(bench *b, uint64_t *seed)
{
    vcache_cells at = predict_at(b, 0.3, 0.4).cells;
    for (uint32_t i = 0; i < b->count; i++)
        if (random_bits(seed) & 1)
            learn_one(b, &at, i, (int)(random_bits(seed) & 1));
}

/* Draws into memory of exactly `capacity` picks and checks what holds for every draw. */
static uint32_t draw_shared(const bench *b, float rays, uint32_t samples, float random, uint32_t capacity,
                            vcache_pick **out)
{
    vcache_pick *picks = malloc(capacity * sizeof *picks + (capacity == 0));
    uint8_t *drawn = calloc((size_t)b->padded * samples, 1);
    assert_true(picks && drawn);
    uint32_t n = vcache_pick_lights(b->predictor, rays, samples, random, picks, capacity);
    assert_true(n <= capacity && (double)n <= 1.0 + 1.001 * (double)rays);
    for (uint32_t k = 0; k < n; k++) {
        uint32_t i = picks[k].light, s = picks[k].sample;
        if (i >= b->count || s >= samples || drawn[i * samples + s] || !(b->contribution[i] > 0.0f) ||
            !(picks[k].weight >= 1.0f && isfinite(picks[k].weight)))
            fail_msg("%g rays, random %a: pick %u of %u: light %u, sample %u, weight %g", (double)rays, (double)random,
                     k, n, i, s, (double)picks[k].weight);
        assert_true(k == 0 || picks[k - 1].light / 64 <= i / 64);
        drawn[i * samples + s] = 1;
    }
    free(drawn);
    *out = picks;
    return n;
}

static uint32_t draw(const bench *b, float rays, float random, uint32_t capacity, vcache_pick **out)
{
    return draw_shared(b, rays, 1, random, capacity, out);
}

/* A comb falls on an interval of p teeth p times on average; a grid of `offsets` offsets counts it to 1 / offsets for
 * each piece that the interval is cut into: two where samples take turns. `slack`: of probabilities, for rounding. */
static void check_shared(const bench *b, const vcache_prediction *p, float rays, uint32_t samples, uint32_t offsets,
                         double slack)
{
    double *weight = malloc(b->padded * sizeof *weight), per_sample = (double)rays / samples;
    uint32_t *count = calloc((size_t)b->padded * samples, sizeof *count);
    assert_true(weight && count);
    double sum = weights_of(b, p, weight), sure = 0.0, total = 0.0,
           grid = samples > 1 ? 2.02 / offsets : 1.01 / offsets;
    for (uint32_t i = 0; i < b->padded; i++)
        sure = sum > 0.0 ? fmax(sure, per_sample * weight[i] / sum) : 1.0;
    for (uint32_t o = 0; o < offsets; o++) {
        vcache_pick *picks;
        /* just enough, so that a cut too early is seen; more would take the address sanitizer most of its time */
        uint32_t n = draw_shared(b, rays, samples, ((float)o + 0.5f) / (float)offsets, (uint32_t)rays + 3, &picks);
        if (sure < 0.999 && !(fabs((double)n - (double)rays) <= 1.0 + slack * (double)rays))
            fail_msg("%g rays: %u picks", (double)rays, n);
        for (uint32_t k = 0; k < n; k++) {
            double probability = fmin(1.0, per_sample * weight[picks[k].light] / sum);
            if (!(fabs((double)picks[k].weight * probability - 1.0) < 1e-4))
                fail_msg("%g rays, light %u: weight %g, probability %g", (double)rays, picks[k].light,
                         (double)picks[k].weight, probability);
            count[picks[k].light * samples + picks[k].sample]++;
        }
        total += n;
        free(picks);
    }
    double expected = 0.0;
    for (uint32_t i = 0; i < b->padded * samples; i++) {
        double probability = sum > 0.0 ? fmin(1.0, per_sample * weight[i / samples] / sum) : 0.0;
        expected += probability;
        if (!(fabs((double)count[i] / offsets - probability) <= grid + slack))
            fail_msg("%g rays, %u lights, light %u, sample %u of %u: drawn %u times of %u, probability %g",
                     (double)rays, b->count, i / samples, i % samples, samples, count[i], offsets, probability);
    }
    assert_true(fabs(total / offsets - expected) <= samples * grid + slack * (double)rays);
    free(weight);
    free(count);
}

static void check_probabilities(const bench *b, const vcache_prediction *p, float rays, uint32_t offsets, double slack)
{
    check_shared(b, p, rays, 1, offsets, slack);
}

static void probabilities(void **state)
{
    (void)state;
    static const uint32_t lights[] = {1, 2, 16, 63, 65, LIGHTS_MAX};
    static const float rays[] = {0.01f, 0.5f, 1.0f, 6.0f, 37.5f, 400.0f};
    uint64_t seed = 1;
    for (int l = 0; l < 6; l++) {
        bench b = make_bench(lights[l], 1 << 10, VCACHE_ISA_ALL);
        teach(&b, &seed);
        for (int shape = 0; shape < 3; shape++) {
            for (uint32_t i = 0; i < b.count; i++) /* equal; a few orders of magnitude; many that are not asked */
                b.contribution[i] = shape == 0               ? 1.0f
                                    : shape == 1             ? (float)exp(random_between(&seed, -5.0, 5.0))
                                    : random_bits(&seed) % 8 ? 0.0f
                                                             : 1.0f;
            vcache_prediction p = predict_at(&b, 0.3, 0.4);
            for (int r = 0; r < 6; r++)
                check_probabilities(&b, &p, rays[r], 500, 1e-4);
        }
        free_bench(&b);
    }
}

/* Each of the samples that share a prediction draws each light with the same probability, as if it were alone; where
 * lights are certain as well, which costs it its turn. */
static void shared_predictions(void **state)
{
    (void)state;
    static const uint32_t samples[] = {2, 3, 16, 64};
    static const float rays[] = {0.3f, 5.0f, 64.0f, 900.0f};
    uint64_t seed = 5;
    bench b = make_bench(LIGHTS_MAX, 1 << 10, VCACHE_ISA_ALL);
    teach(&b, &seed);
    for (int shape = 0; shape < 3; shape++) {
        for (uint32_t i = 0; i < b.count; i++) /* equal; a few orders of magnitude; one in a hundred outweighs all */
            b.contribution[i] = shape == 0   ? 1.0f
                                : shape == 1 ? (float)exp(random_between(&seed, -5.0, 5.0))
                                             : (i % 100 == 37 ? 1e5f : 1.0f);
        vcache_prediction p = predict_at(&b, 0.3, 0.4);
        for (int s = 0; s < 4; s++)
            for (int r = 0; r < 4; r++)
                check_shared(&b, &p, rays[r], samples[s], 1000, 1e-3);
    }
    free_bench(&b);
}

/* Without control variate: by contribution and what is expected, or by contribution alone. */
static void other_drawings(void **state)
{
    (void)state;
    uint64_t seed = 6;
    for (vcache_drawing drawing = VCACHE_DRAW_UNCERTAIN; drawing <= VCACHE_DRAW_BRIGHT; drawing++) {
        bench b = make_bench(LIGHTS_MAX, 1 << 10, VCACHE_ISA_ALL);
        teach(&b, &seed);
        float states[STATES];
        predict_states(VCACHE_DRAW_UNCERTAIN, NULL, states);
        vcache_predictor_destroy(&b.predictor);
        assert_int_equal(vcache_predictor_create(b.set, drawing, &b.predictor, NULL), VCACHE_OK);
        for (uint32_t i = 0; i < b.count; i++)
            b.contribution[i] = (float)random_between(&seed, 0.5, 1.0);
        vcache_prediction p = predict_at(&b, 0.3, 0.4);
        check_probabilities(&b, &p, 20.0f, 500, 1e-4);
        for (uint32_t i = 0; i < b.count; i++) {
            vcache_cells at = p.cells;
            uint32_t s = 0;
            for (int k = 0; k < VCACHE_CELLS && drawing != VCACHE_DRAW_BRIGHT; k++)
                s |= (uint32_t)known_of(&b, &at, k, i) << 2 * k;
            double m = (double)states[s], d = (double)deviation_of(p.mean[i]);
            double wanted = drawing == VCACHE_DRAW_UNCERTAIN ? sqrt(m * (1.0 - m)) + 0.02
                            : drawing == VCACHE_DRAW_VISIBLE ? sqrt(m) + 0.02
                                                             : 1.0;
            assert_true(drawing == VCACHE_DRAW_UNCERTAIN ? p.mean[i] == states[s] : p.mean[i] < 1e-17f);
            assert_true(fabs(d - wanted) < 0.03);
        }
        for (int k = 0; k < VCACHE_CELLS; k++)
            assert_true((p.cells.key[k] == 0) == (drawing == VCACHE_DRAW_BRIGHT));
        free_bench(&b);
    }
    vcache_predictor *none = NULL;
    bench b = make_bench(1, 1, VCACHE_ISA_ALL);
    char message[VCACHE_MESSAGE_BYTES];
    assert_int_equal(vcache_predictor_create(b.set, (vcache_drawing)3, &none, message), VCACHE_ERROR_ARGUMENT);
    assert_non_null(strstr(message, "drawing"));
    free_bench(&b);
}

/* One light heavier than many steps of the comb, at each place in a word; the others keep their share. */
static void a_dominating_light(void **state)
{
    (void)state;
    bench b = make_bench(200, 1 << 10, VCACHE_ISA_ALL);
    for (uint32_t heavy = 0; heavy < 200; heavy += 13)
        for (float factor = 1e2f; factor <= 1e4f; factor *= 10.0f) {
            for (uint32_t i = 0; i < 200; i++)
                b.contribution[i] = i == heavy ? 200.0f * factor : 1.0f;
            vcache_prediction p = predict_at(&b, 0.3, 0.4);
            check_probabilities(&b, &p, 10.0f, 500, 1e-3);
            vcache_pick *picks;
            for (uint32_t o = 0; o < 100; o++) {
                uint32_t n = draw(&b, 50.0f, (float)o / 100.0f, 60, &picks), found = 0;
                for (uint32_t k = 0; k < n; k++)
                    found += picks[k].light == heavy && picks[k].weight == 1.0f;
                assert_int_equal(found, 1);
                free(picks);
            }
        }
    free_bench(&b);
}

/* Random numbers at their ends, at any number of rays. */
static void ends_of_random(void **state)
{
    (void)state;
    static const float ends[] = {0.0f, 0x1p-149f, 0x1p-24f, 1.0f - 0x1p-24f, 1.0f};
    static const float rays[] = {1e-30f, 0.3f, 1.0f, 2.0f, 7.0f, 50.0f};
    uint64_t seed = 2;
    bench b = make_bench(LIGHTS_MAX, 1 << 10, VCACHE_ISA_ALL);
    for (uint32_t i = 0; i < b.count; i++)
        b.contribution[i] = i < 120 ? 0.0f : (float)random_between(&seed, 0.5, 1.0);
    predict_at(&b, 0.3, 0.4);
    for (int e = 0; e < 5; e++)
        for (int r = 0; r < 6; r++) {
            vcache_pick *picks;
            uint32_t n = draw(&b, rays[r], ends[e], 60, &picks);
            double whole = floor((double)rays[r]);
            if ((double)ends[e] < 1e-3 * (double)rays[r]) /* the first tooth is on the first light of the line, which
                                                             lies in the first word that asks */
                assert_true(n >= 1 && picks[0].light < 128);
            assert_true(n >= whole && n <= whole + 1.0);
            free(picks);
        }
    free_bench(&b);
}

static void limits_of_rays(void **state)
{
    (void)state;
    uint64_t seed = 3;
    bench b = make_bench(LIGHTS_MAX, 1 << 10, VCACHE_ISA_ALL);
    vcache_pick *picks;
    vcache_prediction p = predict_at(&b, 0.3, 0.4);
    assert_true(p.expected == 0.0f && p.deviation == 0.0f);
    assert_int_equal(draw(&b, 6.0f, 0.5f, 100, &picks), 0); /* none is asked */
    free(picks);
    for (uint32_t i = 0; i < b.count; i++)
        b.contribution[i] = (float)random_between(&seed, 0.5, 1.0);
    p = predict_at(&b, 0.3, 0.4);
    static const float none[] = {0.0f, -1.0f, NAN, -INFINITY};
    for (int i = 0; i < 4; i++) {
        vcache_pick one[8];
        assert_int_equal(vcache_pick_lights(b.predictor, none[i], 1, 0.5f, one, 8), 0);
    }
    /* rays are cut to capacity - 2: probabilities are those of so many */
    for (uint32_t capacity = 0; capacity < 40; capacity++)
        for (int o = 0; o < 20; o++) {
            uint32_t n = draw(&b, 1e30f, (float)o / 20.0f, capacity, &picks);
            assert_true(capacity < 3 ? n == 0 : n + 3 >= capacity && n < capacity);
            for (uint32_t k = 0; k < n; k++) {
                double w = (double)b.contribution[picks[k].light] * (double)deviation_of(p.mean[picks[k].light]);
                double probability = (capacity - 2) * w / (double)p.deviation;
                assert_true(fabs((double)picks[k].weight * probability - 1.0) < 1e-4);
            }
            free(picks);
        }
    /* far more than lights: all of them, with weight 1 */
    for (float rays = 1e4f; rays < 1e33f; rays *= 100.0f) {
        assert_int_equal(draw(&b, rays, (float)random_unit(&seed), 200000, &picks), LIGHTS_MAX);
        for (uint32_t k = 0; k < LIGHTS_MAX; k++)
            assert_true(picks[k].weight == 1.0f);
        free(picks);
    }
    free_bench(&b);
}

/* The largest sets with as many rays: the comb keeps its step to the end. */
static void many_rays(void **state)
{
    (void)state;
    uint64_t seed = 4;
    bench b = make_bench(VCACHE_MAX_SET, 3, VCACHE_ISA_ALL);
    for (uint32_t i = 0; i < b.count; i++)
        b.contribution[i] = (float)random_between(&seed, 0.5, 1.0);
    vcache_prediction p = predict_at(&b, 0.3, 0.4);
    for (float rays = 64.0f; rays <= 16384.0f; rays *= 16.0f) {
        double mean = 0.0;
        for (int o = 0; o < 64; o++) {
            vcache_pick *picks;
            uint32_t n = draw(&b, rays, ((float)o + 0.5f) / 64.0f, 20000, &picks);
            double sum = 0.0; /* of contributions, estimated */
            for (uint32_t k = 0; k < n; k++)
                sum += (double)picks[k].weight * (double)b.contribution[picks[k].light] *
                       (double)deviation_of(p.mean[picks[k].light]);
            mean += sum / 64.0 / (double)p.deviation;
            free(picks);
        }
        if (!(fabs(mean - 1.0) < 1e-4))
            fail_msg("%g rays: sum of the weights times %g", (double)rays, mean);
    }
    free_bench(&b);
}

/* Contributions in another unit are drawn alike: by powers of two bit for bit. */
static void units(void **state)
{
    (void)state;
    uint64_t seed = 5;
    bench b = make_bench(300, 1 << 10, VCACHE_ISA_ALL);
    float value[300];
    for (uint32_t i = 0; i < 300; i++)
        value[i] = (float)exp(random_between(&seed, -3.0, 3.0));
    for (int o = 0; o < 50; o++) {
        vcache_pick *first = NULL;
        uint32_t first_count = 0;
        float random = (float)(random_bits(&seed) >> 40) * 0x1p-24f;
        for (int power = -100; power <= 100; power += 20) {
            for (uint32_t i = 0; i < 300; i++)
                b.contribution[i] = ldexpf(value[i], power == -100 ? 0 : power);
            predict_at(&b, 0.3, 0.4);
            vcache_pick *picks;
            uint32_t n = draw(&b, 8.0f, random, 20, &picks);
            if (!first) {
                first = picks, first_count = n;
                continue;
            }
            assert_int_equal(n, first_count);
            assert_memory_equal(picks, first, n * sizeof *picks);
            free(picks);
        }
        free(first);
    }
    for (float scale = 1e-30f; scale <= 2e30f; scale *= 1e10f) {
        for (uint32_t i = 0; i < 300; i++)
            b.contribution[i] = value[i] * scale;
        vcache_prediction p = predict_at(&b, 0.3, 0.4);
        check_probabilities(&b, &p, 8.0f, 200, 1e-4);
    }
    free_bench(&b);
}

/* Denormal numbers, and the tiniest beside the largest: it ends, and nothing is infinite. */
static void far_apart(void **state)
{
    (void)state;
    uint64_t seed = 6;
    bench b = make_bench(300, 1 << 10, VCACHE_ISA_ALL);
    static const float pairs[][2] = {{0x1p-149f, 0x1p-149f}, {1e-44f, 1e-40f}, {1e-30f, 1e30f},
                                     {0x1p-149f, 1e30f},     {1e-38f, 1e-38f}, {1e-20f, 1.0f}};
    for (int k = 0; k < 6; k++)
        for (int turn = 0; turn < 50; turn++) {
            for (uint32_t i = 0; i < 300; i++)
                b.contribution[i] = pairs[k][random_bits(&seed) % 16 == 0];
            vcache_prediction p = predict_at(&b, 0.3, 0.4);
            assert_true(isfinite(p.expected) && isfinite(p.deviation));
            for (int o = 0; o < 50; o++) {
                float rays = (float)exp(random_between(&seed, -2.0, 6.0));
                vcache_pick *picks;
                uint32_t n = draw(&b, rays, (float)(random_bits(&seed) >> 40) * 0x1p-24f, 500, &picks);
                for (uint32_t q = 0; q < n; q++)
                    assert_true(isfinite(picks[q].weight * b.contribution[picks[q].light]));
                free(picks);
            }
        }
    free_bench(&b);
}

/* Where sums of a lane with next to nothing in it grow by rounding alone, a tooth between them finds a light whose
 * probability is too small for its inverse. */
static void between_sums(void **state)
{
    (void)state;
    uint64_t seed = 7;
    int cases = 0;
    bench b = make_bench(64, 4, VCACHE_ISA_ALL);
    for (int turn = 0; turn < 1000; turn++) {
        float sums[LANES] = {0};
        for (uint32_t i = 0; i < 64; i++)
            b.contribution[i] = i % LANES == LANES - 1 ? 1e-30f : 1e20f * (float)random_between(&seed, 0.1, 1.0);
        vcache_prediction p = predict_at(&b, 0.3, 0.4);
        for (uint32_t i = 0; i < 64; i++)
            sums[i % LANES] += b.contribution[i] * deviation_of(p.mean[i]);
        lanes_scan(sums);
        if (!(sums[LANES - 1] > sums[LANES - 2]))
            continue;
        cases++;
        vcache_pick *picks;
        draw(&b, 1.0f, sums[LANES - 2] / sums[LANES - 1], 4, &picks);
        free(picks);
    }
    assert_true(cases > 50);
    free_bench(&b);
}

/* Predictions and picks are the same with every compiler, machine and instruction set. */
static void picks_are_the_same_everywhere(void **state)
{
    (void)state;
    static const uint32_t isas[] = {VCACHE_ISA_SCALAR, VCACHE_ISA_AVX2, VCACHE_ISA_ALL};
    for (int run = 0; run < 3; run++) {
        uint64_t seed = 8, sum = 0xcbf29ce484222325u;
        bench b = make_bench(LIGHTS_MAX, 1 << 10, isas[run]);
        for (int turn = 0; turn < 200; turn++) {
            for (uint32_t i = 0; i < b.count; i++)
                b.contribution[i] = (float)random_between(&seed, 0.0, 1.0);
            double x = random_unit(&seed), y = random_unit(&seed);
            vcache_prediction p = predict_at(&b, x, y);
            vcache_pick *picks;
            vcache_answer answers[60];
            uint32_t n = draw(&b, 20.0f, (float)random_unit(&seed), 60, &picks);
            for (uint32_t k = 0; k < n; k++)
                answers[k] = random_bits(&seed) & 1;
            vcache_learn(b.set, &p.cells, picks, answers, n);
            sum = checksum(sum, &p.cells, sizeof p.cells);
            sum = checksum(sum, &p.expected, sizeof p.expected);
            sum = checksum(sum, &p.deviation, sizeof p.deviation);
            sum = checksum(sum, picks, n * sizeof *picks);
            free(picks);
        }
        print_message("checksum of picks: 0x%016llx\n", (unsigned long long)sum);
        assert_true(sum == 0x96f64ed5c1e82f74u);
        free_bench(&b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(probabilities),
        cmocka_unit_test(shared_predictions),
        cmocka_unit_test(other_drawings),
        cmocka_unit_test(a_dominating_light),
        cmocka_unit_test(ends_of_random),
        cmocka_unit_test(limits_of_rays),
        cmocka_unit_test(many_rays),
        cmocka_unit_test(units),
        cmocka_unit_test(far_apart),
        cmocka_unit_test(between_sums),
        cmocka_unit_test(picks_are_the_same_everywhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
