/* SPDX-License-Identifier: Apache-2.0 */
/* Estimates of single pairs: words that count, what is expected and how probably it is traced, both kinds of words in
 * one table, ends and contributions of any kind. */
#include "pair_support.h"

static const uint64_t some_key = 0x123456789abcdef0u;

static uint32_t add_many(uint32_t word, bool visible, int times)
{
    while (times--)
        word = tally_add(word, visible);
    return word;
}

static void words_count(void **state)
{
    (void)state;
    uint32_t word = tally_word(some_key);
    assert_int_equal(word, 0x9abcd000u);
    for (uint32_t n = 1; n <= TALLY_MAX; n++) {
        word = tally_add(word, n % 3 == 0);
        assert_int_equal(tally_visible(word), n / 3);
        assert_int_equal(tally_blocked(word), n - n / 3);
        assert_int_equal(tally_word(word), 0x9abcd000u);
    }
    /* a digest of 0 is no empty word: something was counted */
    assert_int_equal(tally_word((uint64_t)1 << 32), 0);
    assert_int_equal(tally_add(0, true), 1);
    assert_int_equal(tally_add(0, false), 1 << TALLY_BITS);
}

static void full_counts_halve(void **state)
{
    (void)state;
    for (int visible = 0; visible < 2; visible++) {
        uint32_t (*mine)(uint32_t) = visible ? tally_visible : tally_blocked;
        uint32_t (*other)(uint32_t) = visible ? tally_blocked : tally_visible;
        uint32_t word = add_many(tally_word(some_key), visible, 1000);
        assert_true(mine(word) == TALLY_MAX && other(word) == 0); /* all agreed: nothing fades */
        word = add_many(word, !visible, 5);
        assert_true(mine(word) == TALLY_MAX && other(word) == 5);
        word = tally_add(word, visible);
        assert_true(mine(word) == 32 && other(word) == 2);
        /* what holds no more is forgotten, to the last ray */
        word = add_many(word, visible, TALLY_MAX - 32 + 1 + TALLY_MAX);
        assert_true(mine(word) == TALLY_MAX && other(word) == 0);
        assert_int_equal(tally_word(word), tally_word(some_key));
    }
}

static void learn(vcache_worker *w, pair_ends *p, bool vertices, uint32_t light, int visible, int times)
{
    for (int i = 0; i < times; i++) {
        vcache_estimate e = estimate_of(w, p, vertices, light, 1.0f);
        vcache_learn_pair(w, &e, (vcache_answer)visible);
    }
}

/* p = contribution x deviation, in steps of 2^-24, never 0. */
static void probability_follows(void **state)
{
    (void)state;
    for (int vertices = 0; vertices < 2; vertices++) {
        vcache *c = make_table(1 << 16);
        vcache_worker *w = make_worker(c, 1, false);
        static pair_ends p;
        make_ends(c, &p);
        for (int n = 0; n < 200; n++) {
            vcache_estimate e = estimate_of(w, &p, vertices, 2, 1.0f);
            float known = (float)(n < TALLY_MAX ? n : TALLY_MAX), mean = (known + 0.5f) / (known + 1.0f);
            assert_true(e.mean == mean);
            for (float contribution = 0x1p-140f; contribution < 0x1p100f; contribution *= 1.7f) {
                double exact = sqrt((double)mean * (1.0 - (double)mean)) * (double)contribution;
                e = estimate_of(w, &p, vertices, 2, contribution);
                assert_true(e.mean == mean);
                assert_true(e.probability >= 0x1p-24f && e.probability <= 1.0f);
                assert_true(e.probability * 0x1p24f == floorf(e.probability * 0x1p24f));
                assert_true(fabs((double)e.probability - fmin(exact, 1.0)) <= 0x1p-24 + 1e-6 * exact);
                /* what is added stays small */
                assert_true(contribution / e.probability <= 12.0f || e.probability == 1.0f);
            }
            vcache_learn_pair(w, &e, VCACHE_VISIBLE);
        }
        vcache_statistics s = statistics_of(w);
        assert_true(s.traced == 200 && s.stored == 200 && s.overwritten == 0 && s.bypassed == 0);
        assert_true(s.hits[0] > 0 && s.hits[0] < s.asked);
        /* another light, another eye end, another salt: unknown */
        assert_true(estimate_of(w, &p, vertices, 3, 1.0f).mean == 0.5f);
        move_eye(c, &p, 0.8, 0.8);
        assert_true(estimate_of(w, &p, vertices, 2, 1.0f).mean == 0.5f);
        vcache_worker_destroy(&w);
        vcache_destroy(&c);
    }
}

static void same_estimate(vcache_estimate a, float mean, float probability)
{
    assert_true(a.mean == mean && a.probability == probability);
}

static void any_contribution(void **state)
{
    (void)state;
    vcache *c = make_table(1 << 10);
    vcache_worker *w = make_worker(c, 1, false);
    static pair_ends p;
    make_ends(c, &p);
    for (int vertices = 0; vertices < 2; vertices++) {
        static const float nothing[] = {0.0f, -0.0f, -1.0f, -INFINITY}, certain[] = {INFINITY, 3e38f, 2.0f, NAN};
        for (int i = 0; i < 4; i++) {
            vcache_estimate e = estimate_of(w, &p, vertices, 0, nothing[i]);
            same_estimate(e, 0.0f, 0.0f);
            vcache_learn_pair(w, &e, VCACHE_VISIBLE);
            same_estimate(estimate_of(w, &p, vertices, 0, certain[i]), 0.5f, 1.0f);
        }
        /* once means once */
        vcache_estimate e = estimate_of(w, &p, vertices, 0, 1.0f);
        vcache_learn_pair(w, &e, VCACHE_ONCE | VCACHE_VISIBLE);
        vcache_learn_pair(w, &e, VCACHE_ONCE | VCACHE_BLOCKED);
    }
    assert_true(vcache_table_filled(c, UINT64_MAX) == 0.0);
    vcache_statistics s = statistics_of(w);
    assert_true(s.asked == 18 && s.traced == 12 && s.bypassed == 8 && s.once == 4 && s.stored == 0);
    vcache_worker_destroy(&w);
    vcache_destroy(&c);
}

/* Traced always and never learnt; exact mode likewise. Nearness is no exception. */
static void any_end(void **state)
{
    (void)state;
    vcache *c = make_table(1 << 10);
    vcache_worker *w = make_worker(c, 1, false), *exact = make_worker(c, 1, true);
    static pair_ends good, bad;
    make_ends(c, &good);
    make_ends(c, &bad);
    vcache_surface s = floor_end(0.3, 0.3);
    s.position[1] = NAN;
    vcache_prepare_eye(c, &s, 8.0f, 0, (vcache_eye *)(void *)bad.eye);
    vcache_prepare_eye_vertex(c, &s, 8.0f, 1.0f, 0, &bad.eye_vertex);
    s = ceiling_end(1);
    s.density = -1.0f;
    vcache_prepare_patch(c, &s, &good.light[1]);
    vcache_prepare_light_vertex(c, &s, &good.light_vertex[1]);
    for (int vertices = 0; vertices < 2; vertices++) {
        vcache_estimate e[] = {estimate_of(w, &bad, vertices, 0, 0.1f), estimate_of(w, &good, vertices, 1, 0.1f),
                               estimate_of(exact, &good, vertices, 0, 0.1f)};
        for (int i = 0; i < 3; i++) {
            same_estimate(e[i], 0.5f, 1.0f);
            vcache_learn_pair(w, &e[i], VCACHE_VISIBLE);
        }
        same_estimate(estimate_of(w, &bad, vertices, 0, 0.0f), 0.0f, 0.0f);
    }
    assert_int_equal(statistics_of(w).bypassed, 6);
    assert_true(vcache_table_filled(c, UINT64_MAX) == 0.0);
    s = floor_end(0.3, 0.3);
    s.position[2] += 1e-4f;
    vcache_prepare_patch(c, &s, &good.light[0]);
    vcache_prepare_light_vertex(c, &s, &good.light_vertex[0]);
    for (int vertices = 0; vertices < 2; vertices++) {
        learn(w, &good, vertices, 0, VCACHE_VISIBLE, 1);
        assert_true(estimate_of(w, &good, vertices, 0, 1.0f).mean == 0.75f);
    }
    vcache_worker_destroy(&exact);
    vcache_worker_destroy(&w);
    vcache_destroy(&c);
}

/* Of all hash families, lights of all kinds, in bundles or not; tables down to one word. */
static void clearing_forgets(void **state)
{
    (void)state;
    for (int family = VCACHE_HASH_SPLIT; family <= VCACHE_HASH_LCG_XORSHIFT; family++)
        for (uint64_t words = 1; words <= 1 << 16; words = 2 * words + 13) {
            vcache_config config = vcache_default_config();
            config.hash = (vcache_hash)family;
            config.table_bytes = 4 * words;
            vcache *c = make_cache(&config);
            vcache_worker *w = make_worker(c, 1, false);
            static pair_ends p;
            make_ends(c, &p);
            vcache_prepare_point(c, (float[3]){0.5f, 0.5f, 0.9f}, 0, &p.light[1]);
            vcache_prepare_direction(c, (float[3]){0.0f, 0.6f, 0.8f}, 0, &p.light[2]);
            vcache_prepare_solid_angle(c, (float[3]){0.0f, 0.6f, 0.8f}, 10.0f, 0, &p.light[3]);
            vcache_bundle_lights(c, &p.light[4], 4);
            for (uint32_t i = 0; i < 8; i++)
                for (int vertices = 0; vertices < 2; vertices++) {
                    assert_true(estimate_of(w, &p, vertices, i, 1.0f).mean == 0.5f);
                    learn(w, &p, vertices, i, VCACHE_BLOCKED, 4);
                    vcache_estimate before = estimate_of(w, &p, vertices, i, 1.0f);
                    assert_true(before.mean == 0.1f);
                    vcache_clear(c);
                    assert_true(estimate_of(w, &p, vertices, i, 1.0f).mean == 0.5f);
                    /* an answer of before the clear is none of after it */
                    vcache_learn_pair(w, &before, VCACHE_BLOCKED);
                    assert_true(estimate_of(w, &p, vertices, i, 1.0f).mean == 0.5f);
                    if (words == 1) /* the one word says nothing of others */
                        assert_true(estimate_of(w, &p, vertices, (i + 1) % 8, 1.0f).mean == 0.5f);
                }
            vcache_worker_destroy(&w);
            vcache_destroy(&c);
        }
}

/* ------------------------------------------------------------------------------------------------- both kinds of words
 */

static bool lit(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    *(uint64_t *)context += count;
    for (size_t i = 0; i < count; i++)
        answers[i] = misses[i].light_user % 3 == 0;
    return true;
}

/* Answers of a table that is full of estimates, each of which says the opposite, are those of a table without. */
static void answers_stay(void **state)
{
    (void)state;
    enum { EYES = 60 };
    for (int small = 0; small < 2; small++) {
        vcache *c = make_table(small ? 1 : 1 << 12);
        vcache_worker *w = make_worker(c, 64, false);
        static pair_ends p;
        make_ends(c, &p);
        uint64_t rays[3] = {0}, wrong = 0;
        for (int turn = 0; turn < 3; turn++) /* the first fills; of the others one is disturbed */
            for (int e = 0; e < EYES; e++) {
                move_eye(c, &p, 0.1 + 0.1 * (e % 8), 0.1 + 0.1 * (e / 8));
                for (uint32_t i = 0; i < PAIR_LIGHTS; i++) {
                    uint64_t seen[2] = {0};
                    vcache_vertex_pair pairs[4] = {[3] = {&p.eye_vertex, &p.light_vertex[i]}};
                    if (turn == 2)
                        learn(w, &p, e % 2, i, i % 3 != 0, 5);
                    wrong += vcache_visible(w, eye_of(&p), &p.light[i], lit, &rays[turn]) != (i % 3 == 0);
                    assert_int_equal(vcache_add_vertices(w, pairs, 3, 4, seen), 4);
                    assert_true(vcache_resolve(w, lit, &rays[turn]));
                    wrong += seen[0] != (i % 3 == 0 ? 8u : 0u);
                }
            }
        assert_int_equal(wrong, 0);
        print_message("rays %llu to fill, %llu among answers, %llu among estimates\n", (unsigned long long)rays[0],
                      (unsigned long long)rays[1], (unsigned long long)rays[2]);
        assert_true(rays[2] >= rays[1]); /* they push each other out, that is all */
        /* and answers teach no estimate */
        vcache_clear(c);
        for (uint32_t i = 0; i < PAIR_LIGHTS; i++) {
            vcache_visible(w, eye_of(&p), &p.light[i], lit, &rays[0]);
            for (int vertices = 0; vertices < 2; vertices++)
                assert_true(estimate_of(w, &p, vertices, i, 1.0f).mean == 0.5f);
        }
        vcache_worker_destroy(&w);
        vcache_destroy(&c);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(words_count),      cmocka_unit_test(full_counts_halve), cmocka_unit_test(probability_follows),
        cmocka_unit_test(any_contribution), cmocka_unit_test(any_end),           cmocka_unit_test(clearing_forgets),
        cmocka_unit_test(answers_stay),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
