/* SPDX-License-Identifier: Apache-2.0 */
/* The loops over the lights of a set: the scalar ones against what they are to compute, those for every instruction set
 * that the machine has against the scalar ones, bit for bit, on arrays of any length at any address. */
#include "kernel_support.h"

static const struct {
    uint32_t isa;
    const char *name;
} sets[] = {{VCACHE_ISA_SCALAR, "scalar"}, {VCACHE_ISA_AVX2, "avx2"}, {VCACHE_ISA_AVX512, "avx512"}};
enum { SETS = sizeof sets / sizeof *sets, WORDS_MAX = 40, ROUNDS = 12 };

/* NULL where the machine lacks it: what the processor says, not kernels_choose. */
static const kernels *of_set(int i)
{
#if defined(KERNELS_X86)
    __builtin_cpu_init();
    if (i == 1)
        return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt") ? &kernels_avx2 : NULL;
    if (i == 2)
        return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
                       __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") &&
                       __builtin_cpu_supports("popcnt")
                   ? &kernels_avx512
                   : NULL;
#endif
    return i == 0 ? &kernels_scalar : NULL;
}

/* --------------------------------------------------------------------------------------------------------- choice */

/* By strength: a mask gives the last that it names and the machine has. */
static void choice_by_mask(void **state)
{
    (void)state;
    for (uint32_t mask = 0; mask < 4; mask++) {
        const kernels *best = &kernels_scalar;
        for (int i = 1; i < SETS; i++)
            if (mask & sets[i].isa && of_set(i))
                best = of_set(i);
        assert_ptr_equal(kernels_choose(mask), best);
        assert_ptr_equal(kernels_choose(mask | 0xfffffffcu), best); /* names that this version does not know */
        vcache_config config = vcache_default_config();
        config.isa = mask;
        vcache *c = make_cache(&config);
        assert_string_equal(vcache_isa(c), best->name);
        vcache_destroy(&c);
    }
    assert_ptr_equal(kernels_choose(VCACHE_ISA_SCALAR), &kernels_scalar);
    assert_int_equal(vcache_default_config().isa, VCACHE_ISA_ALL);
    for (int i = 0; i < SETS; i++) {
        print_message("%s: %s\n", sets[i].name, of_set(i) ? "here" : "not on this machine");
        assert_true(!of_set(i) || strcmp(of_set(i)->name, sets[i].name) == 0);
    }
}

/* ----------------------------------------------------------------------------------------------------------- near */

typedef struct near_case {
    uint32_t words;
    float *of[4], eye[3], side; /* x, y, z, side_squared */
} near_case;

static near_case near_make(uint64_t *seed, uint32_t words, int how, bool odd)
{
    near_case c = {.words = words};
    for (int a = 0; a < 4; a++) {
        c.of[a] = arena_floats(64 * words, how);
        for (uint32_t i = 0; i < 64 * words; i++)
            c.of[a][i] = odd ? odd_float(seed) : (float)random_between(seed, a < 3 ? -1.0 : -0.2, 1.0);
    }
    for (int a = 0; a < 3; a++)
        c.eye[a] = odd ? odd_float(seed) : (float)random_between(seed, -1.0, 1.0);
    c.side = odd ? odd_float(seed) : (float)random_between(seed, 0.0, 1.0);
    /* some lights at the eye end, and at exactly the distance that counts */
    for (uint32_t i = 0; i < 64 * words; i += 1 + (uint32_t)(random_bits(seed) % 40)) {
        for (int a = 0; a < 3; a++)
            c.of[a][i] = c.eye[a];
        c.of[0][i] += random_bits(seed) & 1 ? 0.5f : 0.0f;
        c.of[3][i] = random_bits(seed) & 1 ? 0.25f : c.side;
    }
    return c;
}

static light_places places_of(const near_case *c)
{
    return (light_places){c->of[0], c->of[1], c->of[2], c->of[3]};
}

static void near_is_nearness(void **state)
{
    (void)state;
    uint64_t seed = 1, near = 0, bits[8];
    for (int round = 0; round < 50; round++) {
        near_case c = near_make(&seed, 8, round % 2, false);
        light_places p = places_of(&c);
        kernels_scalar.near(&p, c.eye, c.side, c.words, bits);
        for (uint32_t i = 0; i < 64 * c.words; i++) {
            double d = 0.0, side = (double)c.of[3][i];
            for (int a = 0; a < 3; a++)
                d += pow((double)(c.of[a][i] - c.eye[a]), 2.0);
            double least = side < 0.0 ? side : fmax(side, (double)c.side);
            bool exact = d == least || fabs(d - least) > 1e-6; /* not decided by rounding */
            bool bit = bits[i / 64] >> i % 64 & 1;
            if (exact && bit != (side >= 0.0 && d < least))
                fail_msg("near: round %d, light %u", round, i);
            near += bit;
        }
        arena_empty();
    }
    assert_true(near > 1000 && near < 50 * 512 - 1000);
    /* what cannot be quantized is near, a direction never is */
    float zero[64] = {0}, side[64], bad[64];
    for (int i = 0; i < 64; i++)
        side[i] = i % 2 ? INFINITY : -1.0f, bad[i] = i % 2 ? NAN : 0.0f;
    kernels_scalar.near(&(light_places){bad, zero, zero, side}, zero, 1.0f, 1, bits);
    assert_true(bits[0] == 0xaaaaaaaaaaaaaaaau);
}

static void near_by_every_set(void **state)
{
    (void)state;
    uint64_t seed = 2;
    for (uint32_t words = 1; words <= WORDS_MAX; words++)
        for (int round = 0; round < ROUNDS; round++) {
            near_case c = near_make(&seed, words, round % 2, round > 1);
            light_places p = places_of(&c);
            uint64_t *expected = arena_words(words, round % 2), *got = arena_words(words, round % 2);
            kernels_scalar.near(&p, c.eye, c.side, words, expected);
            for (int s = 1; s < SETS; s++) {
                if (!of_set(s))
                    continue;
                memset(got, 0x5a, words * sizeof *got);
                of_set(s)->near(&p, c.eye, c.side, words, got);
                same_words("near", sets[s].name, words, expected, got);
            }
            arena_empty();
        }
}

/* --------------------------------------------------------------------------------------------------------- decide */

typedef struct decide_case {
    uint64_t *known[5], *seen[5], *rest, *out[3]; /* found, missing, differs */
} decide_case;

static decide_case decide_make(uint64_t *seed, uint32_t words, uint32_t cells, int how)
{
    decide_case c = {.rest = random_words(seed, words, how)};
    for (uint32_t k = 0; k < cells; k++)
        c.known[k] = random_words(seed, words, how), c.seen[k] = random_words(seed, words, how);
    for (int i = 0; i < 3; i++)
        c.out[i] = arena_words(words, how);
    return c;
}

static void decide(const kernels *k, const decide_case *c, uint32_t words, uint32_t cells, const uint64_t *rest,
                   uint64_t *const out[3])
{
    const uint64_t *const known[5] = {c->known[0], c->known[1], c->known[2], c->known[3], c->known[4]};
    const uint64_t *const seen[5] = {c->seen[0], c->seen[1], c->seen[2], c->seen[3], c->seen[4]};
    k->decide(words, cells, known, seen, rest, out[0], out[1], out[2]);
}

static void decide_is_algorithm_2(void **state)
{
    (void)state;
    uint64_t seed = 3;
    for (uint32_t cells = 1; cells <= 5; cells++)
        for (int round = 0; round < 20; round++) {
            decide_case c = decide_make(&seed, 7, cells, round % 2);
            decide(&kernels_scalar, &c, 7, cells, c.rest, c.out);
            for (uint32_t i = 0; i < 7 * 64; i++) {
                uint32_t w = i / 64, b = i % 64;
                bool asked = c.rest[w] >> b & 1, known = c.known[0][w] >> b & 1, differs = false;
                for (uint32_t k = 1; k < cells; k++)
                    differs |= (c.known[k][w] >> b & 1) && ((c.seen[k][w] ^ c.seen[0][w]) >> b & 1);
                bool found = asked && known && !differs, missing = asked && !known;
                if ((c.out[0][w] >> b & 1) != found || (c.out[1][w] >> b & 1) != missing ||
                    (c.out[2][w] >> b & 1) != (asked && known && differs))
                    fail_msg("decide: %u cells, light %u", cells, i);
            }
            arena_empty();
        }
}

/* With outputs of their own, and with `differs` in the place of `rest`, as the library calls it. */
static void decide_by_every_set(void **state)
{
    (void)state;
    uint64_t seed = 4;
    for (uint32_t words = 1; words <= WORDS_MAX; words++)
        for (uint32_t cells = 1; cells <= 5; cells++)
            for (int how = 0; how < 2; how++) {
                decide_case c = decide_make(&seed, words, cells, how);
                decide(&kernels_scalar, &c, words, cells, c.rest, c.out);
                uint64_t *got[3] = {arena_words(words, how), arena_words(words, how), arena_words(words, how)};
                for (int s = 0; s < SETS; s++)
                    for (int in_place = 0; in_place < 2 && of_set(s); in_place++) {
                        memset(got[0], 0x5a, words * sizeof *got[0]);
                        memset(got[1], 0xa5, words * sizeof *got[1]);
                        memcpy(got[2], c.rest, words * sizeof *got[2]);
                        decide(of_set(s), &c, words, cells, in_place ? got[2] : c.rest, got);
                        for (int i = 0; i < 3; i++)
                            same_words(i == 0   ? "found"
                                       : i == 1 ? "missing"
                                                : "differs",
                                       sets[s].name, words, c.out[i], got[i]);
                    }
                arena_empty();
            }
}

/* --------------------------------------------------------------------------------------------------------- tally */

/* Unknown: nothing; blocked: asked; both: asked, seen once; visible: asked, seen twice. */
static void tally_counts_states(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (uint32_t words = 0; words <= WORDS_MAX; words++)
        for (int s = 0; s < SETS; s++) {
            if (!of_set(s))
                continue;
            const uint64_t *known = random_words(&seed, words, 0), *visible = random_words(&seed, words, 0);
            uint32_t expected[2] = {0, 0}, asked = 7, seen = 7;
            for (uint32_t i = 0; i < 64 * words; i++) {
                static const uint32_t adds[4][2] = {{0, 0}, {1, 0}, {1, 1}, {1, 2}};
                uint32_t of = (uint32_t)(known[i / 64] >> i % 64 & 1) | (uint32_t)(visible[i / 64] >> i % 64 & 1) << 1;
                expected[0] += adds[of][0], expected[1] += adds[of][1];
            }
            of_set(s)->tally(known, visible, words, &asked, &seen);
            assert_true(asked == expected[0] && seen == expected[1]);
            arena_empty();
        }
}

/* -------------------------------------------------------------------------------------------------------- predict */

typedef struct predict_case {
    predict_input in;
    float *mean, *sums;
} predict_case;

/* Light i of word w is in state (i + 7 w) % 64 in every second case: all states in all lanes. */
static predict_case predict_make(uint64_t *seed, uint32_t words, int how, bool odd)
{
    predict_case c = {
        .in.words = words, .mean = arena_floats(64 * words, how), .sums = arena_floats(LANES * words, how)};
    float *states = arena_floats(STATES, how), *contribution = arena_floats(64 * words, how);
    bool all = random_bits(seed) & 1;
    for (uint32_t k = 0; k < VCACHE_CELLS; k++) {
        uint64_t *known = random_words(seed, words, how), *visible = random_words(seed, words, how);
        for (uint32_t w = 0; w < words && all; w++) {
            known[w] = visible[w] = 0;
            for (uint32_t i = 0; i < 64; i++) {
                uint32_t s = (i + 7 * w) % 64 >> 2 * k;
                known[w] |= (uint64_t)(s & 1) << i, visible[w] |= (uint64_t)(s >> 1 & 1) << i;
            }
        }
        c.in.known[k] = known, c.in.visible[k] = visible;
    }
    predict_states(VCACHE_DRAW_UNCERTAIN, NULL, states);
    if (odd)
        for (uint32_t i = 0; i < STATES; i++)
            states[i] = odd_float(seed);
    for (uint32_t i = 0; i < 64 * words; i++)
        contribution[i] =
            odd ? odd_float(seed) : (float)(random_unit(seed) * pow(10.0, random_between(seed, -6.0, 6.0)));
    c.in.table = states, c.in.contribution = contribution;
    return c;
}

static uint32_t state_of(const predict_input *in, uint32_t i)
{
    uint32_t s = 0;
    for (uint32_t k = 0; k < VCACHE_CELLS; k++)
        s |= (uint32_t)(in->known[k][i / 64] >> i % 64 & 1) << 2 * k | (uint32_t)(in->visible[k][i / 64] >> i % 64 & 1)
                                                                           << (2 * k + 1);
    return s;
}

static void predict_is_a_sum(void **state)
{
    (void)state;
    uint64_t seed = 5;
    for (int round = 0; round < 50; round++) {
        predict_case c = predict_make(&seed, 9, round % 2, false);
        float expected = kernels_scalar.predict(&c.in, &(predict_output){c.mean, c.sums});
        double sum = 0.0;
        for (uint32_t w = 0; w < 9; w++) {
            double lanes[LANES] = {0}, running = 0.0;
            for (uint32_t i = 64 * w; i < 64 * (w + 1); i++) {
                float mean = c.in.table[state_of(&c.in, i)];
                assert_int_equal(float_bits(c.mean[i]), float_bits(mean));
                sum += (double)c.in.contribution[i] * (double)mean;
                lanes[i % LANES] += (double)c.in.contribution[i] * (double)deviation_of(mean);
            }
            for (int k = 0; k < LANES; k++) {
                running += lanes[k];
                if (!(fabs((double)c.sums[LANES * w + (uint32_t)k] - running) <= 1e-6 * running))
                    fail_msg("sums: word %u, lane %d: %g, not %g", w, k, (double)c.sums[LANES * w + (uint32_t)k],
                             running);
            }
        }
        assert_true(fabs((double)expected - sum) <= 1e-5 * sum);
        arena_empty();
    }
}

static void predict_by_every_set(void **state)
{
    (void)state;
    uint64_t seed = 6;
    for (uint32_t words = 1; words <= WORDS_MAX; words++)
        for (int round = 0; round < ROUNDS; round++) {
            int how = round % 2;
            predict_case c = predict_make(&seed, words, how, round > 5);
            float *mean = arena_floats(64 * words, how), *sums = arena_floats(LANES * words, how);
            float expected = kernels_scalar.predict(&c.in, &(predict_output){c.mean, c.sums});
            for (int s = 1; s < SETS; s++) {
                if (!of_set(s))
                    continue;
                memset(mean, 0x5a, 64 * words * sizeof *mean);
                memset(sums, 0x5a, LANES * words * sizeof *sums);
                float got = of_set(s)->predict(&c.in, &(predict_output){mean, sums});
                same_floats("mean", sets[s].name, words, 64 * words, c.mean, mean);
                same_floats("sums", sets[s].name, words, LANES * words, c.sums, sums);
                same_floats("expected", sets[s].name, words, 1, &expected, &got);
            }
            arena_empty();
        }
}

/* ------------------------------------------------------------------------------------------------------- checksum */

/* The same with every compiler, machine and instruction set. A change of it means that all estimates change. */
static void results_are_the_same_everywhere(void **state)
{
    (void)state;
    for (int s = 0; s < SETS; s++) {
        if (!of_set(s))
            continue;
        uint64_t seed = 7, sum = 0xcbf29ce484222325u;
        for (uint32_t words = 1; words <= WORDS_MAX; words++) {
            near_case n = near_make(&seed, words, 0, false);
            light_places p = places_of(&n);
            uint64_t *bits = arena_words(words, 0);
            of_set(s)->near(&p, n.eye, n.side, words, bits);
            sum = checksum(sum, bits, words * sizeof *bits);
            decide_case d = decide_make(&seed, words, 5, 0);
            decide(of_set(s), &d, words, 5, d.rest, d.out);
            for (int i = 0; i < 3; i++)
                sum = checksum(sum, d.out[i], words * sizeof *d.out[i]);
            predict_case c = predict_make(&seed, words, 0, false);
            for (uint32_t i = 0; i < 64 * words; i++) /* without libm */
                ((float *)(uintptr_t)c.in.contribution)[i] = (float)random_unit(&seed);
            float expected = of_set(s)->predict(&c.in, &(predict_output){c.mean, c.sums});
            sum = checksum(sum, &expected, sizeof expected);
            sum = checksum(sum, c.mean, 64 * words * sizeof *c.mean);
            sum = checksum(sum, c.sums, LANES * words * sizeof *c.sums);
            arena_empty();
        }
        print_message("checksum of %s kernels: 0x%016llx\n", sets[s].name, (unsigned long long)sum);
        assert_true(sum == 0x63f3555dc0ad487au);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(choice_by_mask),       cmocka_unit_test(near_is_nearness),
        cmocka_unit_test(near_by_every_set),    cmocka_unit_test(decide_is_algorithm_2),
        cmocka_unit_test(decide_by_every_set),  cmocka_unit_test(predict_is_a_sum),
        cmocka_unit_test(predict_by_every_set), cmocka_unit_test(results_are_the_same_everywhere),
        cmocka_unit_test(tally_counts_states),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
