/* SPDX-License-Identifier: Apache-2.0 */
/* Hashing and the table's words: avalanche, collisions, digests, even filling. Deviations are given in standard
 * deviations (sigma) of the ideal hash; seeds are fixed, so a run repeats exactly. */
#include "support.h"

static const vcache_hash families[] = {VCACHE_HASH_SPLIT, VCACHE_HASH_LCG_PAIR, VCACHE_HASH_LCG_XORSHIFT};
static const char *const names[] = {"split", "lcg pair", "lcg xorshift"};

/* ----------------------------------------------------------------------------------------------------- avalanche */

typedef uint64_t (*hash_of_four)(const uint64_t x[4]);

static uint64_t one_half(const uint64_t x[4])
{
    return hash_words(x[0], x[1], x[2]);
}

static uint64_t pairing(const uint64_t x[4])
{
    return hash_fold(x[0], x[1]);
}

static uint64_t whole_key(const uint64_t x[4])
{
    return hash_fold(hash_words(x[0], x[1], 0x8bb84b93962eacc9u), hash_words(x[2], x[3], 0xc2b2ae3d27d4eb4fu));
}

/* Largest distance from 1/2 of the share of flips, over all pairs of input and output bit. */
static double worst_avalanche(hash_of_four hash, int inputs, const char *name)
{
    enum { ROUNDS = 8192 };
    static uint32_t flips[256][64];
    memset(flips, 0, sizeof flips);
    uint64_t seed = 1;
    for (int r = 0; r < ROUNDS; r++) {
        uint64_t x[4] = {random_bits(&seed), random_bits(&seed), random_bits(&seed), random_bits(&seed)};
        uint64_t base = hash(x);
        for (int i = 0; i < inputs; i++) {
            x[i / 64] ^= (uint64_t)1 << i % 64;
            uint64_t changed = base ^ hash(x);
            x[i / 64] ^= (uint64_t)1 << i % 64;
            for (int o = 0; o < 64; o++)
                flips[i][o] += changed >> o & 1;
        }
    }
    double worst = 0.0;
    int input = 0, output = 0;
    for (int i = 0; i < inputs; i++)
        for (int o = 0; o < 64; o++) {
            double distance = fabs((double)flips[i][o] / ROUNDS - 0.5);
            if (distance > worst)
                worst = distance, input = i, output = o;
        }
    print_message("%s: worst flip share 0.5 +- %.4f (input bit %d, output bit %d)\n", name, worst, input, output);
    return worst;
}

static void avalanche(void **state)
{
    (void)state;
    /* sigma of a share over 8192 rounds is 0.0055; the largest of 16384 ideal shares lies near 4.1 sigma = 0.023 */
    assert_true(worst_avalanche(one_half, 128, "hash_words") < 0.03);
    assert_true(worst_avalanche(whole_key, 256, "hash_words, hash_fold") < 0.03);
    /* one multiplication alone: the uppermost bits of a half reach the uppermost of the key a little less evenly */
    assert_true(worst_avalanche(pairing, 128, "hash_fold") < 0.09);
}

/* The portable product must be the 128-bit one. */
static void fold_known_values(void **state)
{
    (void)state;
    assert_true(hash_fold(0, 0xffffffffffffffffu) == 0);
    assert_true(hash_fold(1, 0x0123456789abcdefu) == 0x0123456789abcdefu);
    /* (2^64 - 1)^2 = 2^128 - 2^65 + 1: low 1, high 2^64 - 2 */
    assert_true(hash_fold(0xffffffffffffffffu, 0xffffffffffffffffu) == 0xffffffffffffffffu);
    /* 2^63 * 6 = 3 * 2^64 */
    assert_true(hash_fold(0x8000000000000000u, 6) == 3);
    /* 0x1_0000_0001^2 = 2^64 + 2^33 + 1 */
    assert_true(hash_fold(0x100000001u, 0x100000001u) == (0x200000001u ^ 1u));
}

/* --------------------------------------------------------------------------------------------- streams of keys */

enum { SIDE = 1024, KEYS = SIDE * SIDE };

/* `SIDE` eye halves and as many lights; every pair is a key. */
typedef struct stream {
    vcache *cache;
    uint64_t half[SIDE];
    vcache_light light[SIDE];
} stream;

static vcache *cache_of(vcache_hash family, uint64_t words)
{
    vcache_config config = vcache_default_config();
    config.bounds_min[0] = config.bounds_min[1] = config.bounds_min[2] = -8.0f;
    config.bounds_max[0] = config.bounds_max[1] = config.bounds_max[2] = 8.0f;
    config.hash = family;
    config.levels = 1;
    config.table_bytes = words * 4;
    return make_cache(&config);
}

static uint64_t eye_half(const vcache *c, const float position[3], const float normal[3], float side)
{
    vcache_surface s = {.density = 1.0f / (side * side)};
    memcpy(s.position, position, sizeof s.position);
    memcpy(s.normal, normal, sizeof s.normal);
    vcache_eye *eye = make_eye(c, &s, 1.0f, 0);
    uint64_t half = vcache_eye_cell(eye, 0);
    free(eye);
    return half;
}

/* 32 x 32 neighbouring cells of a floor and 32 x 32 point lights on a grid of round coordinates. */
static void lattice(stream *s)
{
    float side = 16.0f * 1.7320508f / 128.0f;
    for (int i = 0; i < SIDE; i++) {
        float x = (float)(i % 32), y = (float)(i / 32);
        s->half[i] = eye_half(s->cache, (float[3]){(x - 16.0f) * side, (y - 16.0f) * side, -8.0f},
                              (float[3]){0.0f, 0.0f, 1.0f}, side * 0.9f);
        vcache_prepare_point(s->cache, (float[3]){x * 0.25f - 4.0f, y * 0.25f - 4.0f, 7.5f}, 0, &s->light[i]);
    }
}

/* Eye cells of a floor and three walls as a camera sees them, and patches like virtual point lights. */
static void room(stream *s)
{
    uint64_t seed = 2;
    for (int i = 0; i < SIDE; i++) {
        int axis = i % 4 == 3 ? 0 : i % 4;
        float p[3], n[3] = {0.0f, 0.0f, 0.0f};
        for (int a = 0; a < 3; a++)
            p[a] = (float)random_between(&seed, -8.0, 8.0);
        p[axis] = i % 4 == 3 ? 8.0f : -8.0f;
        n[axis] = i % 4 == 3 ? -1.0f : 1.0f;
        s->half[i] = eye_half(s->cache, p, n, (float)random_between(&seed, 0.02, 0.1));
        vcache_surface patch = {.density = (float)random_between(&seed, 1.0, 10.0)};
        for (int a = 0; a < 3; a++)
            patch.position[a] = (float)random_between(&seed, -8.0, 8.0);
        int wall = (int)(random_bits(&seed) % 3);
        patch.position[wall] = 8.0f;
        patch.normal[wall] = -1.0f;
        vcache_prepare_patch(s->cache, &patch, &s->light[i]);
    }
}

static void noise(stream *s)
{
    uint64_t seed = 3;
    for (int i = 0; i < SIDE; i++) {
        s->half[i] = random_bits(&seed);
        s->light[i] = (vcache_light){.word_count = 4};
        for (int w = 0; w < 4; w++)
            s->light[i].key.words[w] = (uint32_t)random_bits(&seed);
    }
}

static uint64_t key_at(const stream *s, size_t i)
{
    return pair_key(s->cache->config.hash, 0, s->half[i / SIDE], &s->light[i % SIDE]);
}

/* Distinct ends: equal ones would share their keys by right. */
static size_t distinct_pairs(const stream *s)
{
    static uint64_t a[SIDE], b[SIDE];
    for (size_t i = 0; i < SIDE; i++) {
        a[i] = s->half[i];
        b[i] = 0;
        for (uint32_t w = 0; w < 4; w++)
            b[i] = (b[i] ^ s->light[i].key.words[w]) * 0x9e3779b97f4a7c15u ^ b[i] >> 29;
    }
    return count_distinct(a, SIDE) * count_distinct(b, SIDE);
}

/* Deviation of the number of filled slots from n (1 - (1 - 1/n)^k), relative to it. */
static double filling(void (*make)(stream *), vcache_hash family, uint64_t words, const char *name)
{
    stream *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->cache = cache_of(family, words);
    make(s);
    uint8_t *filled = calloc(words, 1);
    assert_non_null(filled);
    uint64_t count = 0;
    for (size_t i = 0; i < KEYS; i++) {
        uint8_t *slot = &filled[pair_slot(s->cache, family, key_at(s, i))];
        count += !*slot;
        *slot = 1;
    }
    double n = (double)words, k = (double)distinct_pairs(s), theory = n * -expm1(k * log1p(-1.0 / n));
    print_message("%-8s %-13s %7llu words, %7.0f keys: %6llu slots, in theory %6.0f\n", name, names[family],
                  (unsigned long long)words, k, (unsigned long long)count, theory);
    free(filled);
    vcache_destroy(&s->cache);
    free(s);
    return (double)count / theory - 1.0;
}

static void collisions(void **state)
{
    (void)state;
    const uint64_t two = (uint64_t)1 << 20, odd = two - 3;
    for (int f = 0; f < 3; f++) {
        /* sigma is 0.05 % of the filled slots at as many keys as words */
        assert_true(fabs(filling(noise, families[f], two, "random")) < 0.002);
        assert_true(fabs(filling(noise, families[f], odd, "random")) < 0.002);
    }
    assert_true(fabs(filling(lattice, VCACHE_HASH_SPLIT, two, "lattice")) < 0.005);
    assert_true(fabs(filling(lattice, VCACHE_HASH_SPLIT, odd, "lattice")) < 0.005);
    assert_true(fabs(filling(room, VCACHE_HASH_SPLIT, two, "room")) < 0.005);
    assert_true(fabs(filling(room, VCACHE_HASH_SPLIT, odd, "room")) < 0.005);
    assert_true(fabs(filling(room, VCACHE_HASH_LCG_PAIR, two, "room")) < 0.005);
    assert_true(fabs(filling(room, VCACHE_HASH_LCG_PAIR, odd, "room")) < 0.005);
    assert_true(fabs(filling(lattice, VCACHE_HASH_LCG_XORSHIFT, two, "lattice")) < 0.005);
    assert_true(fabs(filling(lattice, VCACHE_HASH_LCG_XORSHIFT, odd, "lattice")) < 0.005);
    assert_true(fabs(filling(room, VCACHE_HASH_LCG_XORSHIFT, two, "room")) < 0.005);
    assert_true(fabs(filling(room, VCACHE_HASH_LCG_XORSHIFT, odd, "room")) < 0.005);
    /* The reason for a default of our own: the low bits of an LCG never see the high bits of its input, which are all
     * that a float at a round place has. An odd table helps by half. */
    assert_true(filling(lattice, VCACHE_HASH_LCG_PAIR, two, "lattice") < -0.9);
    double half = filling(lattice, VCACHE_HASH_LCG_PAIR, odd, "lattice");
    assert_true(half > -0.5 && half < -0.2);
}

/* Keys that would be taken for another one: same slot, same digest. */
static size_t mistaken(void (*make)(stream *), vcache_hash family, uint64_t words, const char *name)
{
    stream *s = calloc(1, sizeof *s);
    uint64_t *seen = malloc(sizeof *seen * KEYS);
    assert_true(s && seen);
    s->cache = cache_of(family, words);
    make(s);
    for (size_t i = 0; i < KEYS; i++) {
        uint64_t key = key_at(s, i);
        seen[i] = pair_slot(s->cache, family, key) << 32 | table_word(key);
    }
    size_t lost = distinct_pairs(s) - count_distinct(seen, KEYS);
    print_message("%-8s %-13s %7llu words: %zu keys taken for another\n", name, names[family],
                  (unsigned long long)words, lost);
    free(seen);
    vcache_destroy(&s->cache);
    free(s);
    return lost;
}

static void foreign_keys(void **state)
{
    (void)state;
    const uint64_t two = (uint64_t)1 << 20, odd = two - 3;
    /* k^2 / 2 pairs of keys, 51 bits: 0.0002 expected */
    for (int f = 0; f < 3; f++) {
        assert_int_equal(mistaken(noise, families[f], two, "random"), 0);
        assert_int_equal(mistaken(room, families[f], two, "room"), 0);
    }
    assert_int_equal(mistaken(lattice, VCACHE_HASH_SPLIT, two, "lattice"), 0);
    assert_int_equal(mistaken(lattice, VCACHE_HASH_LCG_XORSHIFT, two, "lattice"), 0);
    /* The LCG pair maps lattice keys to equal 64 bits: no size of the table and no digest helps, answers are wrong. */
    assert_true(mistaken(lattice, VCACHE_HASH_LCG_PAIR, two, "lattice") > KEYS / 4);
    assert_true(mistaken(lattice, VCACHE_HASH_LCG_PAIR, odd, "lattice") > KEYS / 4);
}

/* ------------------------------------------------------------------------------------------------ digests, slots */

static void digests(void **state)
{
    (void)state;
    enum { BINS = 4096 };
    static uint32_t low[BINS], high[BINS];
    stream *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->cache = cache_of(VCACHE_HASH_SPLIT, 1);
    void (*const makes[])(stream *) = {lattice, room};
    for (int m = 0; m < 2; m++) {
        makes[m](s);
        memset(low, 0, sizeof low);
        memset(high, 0, sizeof high);
        size_t foreign = 0;
        for (size_t i = 0; i < KEYS; i++) {
            uint32_t digest = table_word(key_at(s, i)) >> 1;
            low[digest % BINS]++;
            high[digest >> 19]++;
            /* with 12 bits of digest, a word of the table holds for another key once in 4096 times */
            if (i >= SIDE)
                foreign += ((table_word(key_at(s, i - SIDE + 1)) >> 1 ^ digest) & (BINS - 1)) == 0;
        }
        double a = chi_square_sigmas(low, BINS, KEYS), b = chi_square_sigmas(high, BINS, KEYS);
        double expected = (double)(KEYS - SIDE) / BINS, c = (foreign - expected) / sqrt(expected);
        print_message("digests: low bits %+.1f sigma, high bits %+.1f sigma, foreign hits %+.1f sigma\n", a, b, c);
        /* 3 % of the room's keys come twice or more often, which adds to chi-square */
        assert_true(fabs(a) < 6.0);
        assert_true(fabs(b) < 6.0);
        assert_true(fabs(c) < 4.0);
    }
    vcache_destroy(&s->cache);
    free(s);
}

static void every_slot_alike(void **state)
{
    (void)state;
    static const uint64_t counts[] = {1, 2, 3, 7, 641, 1000, 4095, 4096, 6144, 65537};
    stream *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->cache = cache_of(VCACHE_HASH_SPLIT, 1);
    lattice(s); /* all keys are distinct */
    size_t keys = KEYS;
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        table t = {.count = counts[i]};
        uint32_t *filled = calloc(counts[i], sizeof *filled);
        assert_non_null(filled);
        for (size_t k = 0; k < keys; k++) {
            uint64_t slot = table_slot(&t, key_at(s, k));
            assert_true(slot < counts[i]);
            filled[slot]++;
        }
        if (counts[i] > 1)
            assert_true(fabs(chi_square_sigmas(filled, counts[i], keys)) < 4.5);
        free(filled);
    }
    /* first and last slot of the largest table */
    table largest = {.count = (uint64_t)1 << 32};
    assert_true(table_slot(&largest, 0xffffffff12345678u) == 0xffffffffu);
    assert_true(table_slot(&largest, 0x0000000012345678u) == 0);
    vcache_destroy(&s->cache);
    free(s);
}

/* ---------------------------------------------------------------------------------------------- digest 0 is no hole */

static bool count_and_see(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    (void)misses;
    *(size_t *)context += count;
    memset(answers, VCACHE_VISIBLE, count);
    return true;
}

static void digest_zero(void **state)
{
    (void)state;
    uint64_t seed = 4;
    for (int i = 0; i < 100000; i++) {
        uint64_t key = random_bits(&seed) & ~(i % 2 ? 0xffffffffu : 0xfffffffeu);
        assert_int_equal(table_word(key), 2);
        key = random_bits(&seed);
        assert_true(table_word(key) != 0 && (table_word(key) & 1) == 0);
    }
    /* a light whose every key is 0: the digest 0 is not found in an empty table, and found once it is there */
    for (uint64_t words = 1; words < 100; words += 9) {
        vcache *c = cache_of(VCACHE_HASH_SPLIT, words);
        vcache_worker *w = make_worker(c, 16, false);
        vcache_surface s = {.normal = {0.0f, 0.0f, 1.0f}, .density = 100.0f};
        vcache_eye *eye = make_eye(c, &s, 4.0f, 0);
        vcache_light light;
        size_t traced = 0;
        vcache_prepare_point(c, (float[3]){0.0f, 0.0f, 5.0f}, 0, &light);
        light.key.hash = 0;
        assert_true(vcache_visible(w, eye, &light, count_and_see, &traced));
        assert_int_equal(traced, 1);
        assert_true(vcache_visible(w, eye, &light, count_and_see, &traced));
        assert_int_equal(traced, 1);
        free(eye);
        vcache_worker_destroy(&w);
        vcache_destroy(&c);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(avalanche),    cmocka_unit_test(fold_known_values), cmocka_unit_test(collisions),
        cmocka_unit_test(foreign_keys), cmocka_unit_test(digests),           cmocka_unit_test(every_slot_alike),
        cmocka_unit_test(digest_zero),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
