/* SPDX-License-Identifier: Apache-2.0 */
/* Hit rates of adaptive shadow testing: merged and running free, the prior, several points at a time, pilots. */
#include "adaptive_support.h"

static void rates(void **state)
{
    (void)state;
    /* t S = 0.5 x 8 > 1: the first two are tested, whatever the other two; v/w = 1 or 1/2 */
    static const float contribution[4] = {8.0f, 8.0f, 1.0f, 0.5f}, other[4] = {0.5f, 1.0f, 8.0f, 8.0f};
    for (int free_running = 0; free_running < 2; free_running++) {
        vcache_adaptive_config config = vcache_adaptive_default_config();
        config.sources = 4;
        config.tolerance = 0.5f;
        config.certainty = 0.0f;
        config.prior_hits = 3.0f;
        config.prior_tests = 4.0f;
        config.free_running = free_running;
        vcache_adaptive *a = NULL;
        assert_int_equal(vcache_adaptive_create(&config, &a, NULL), VCACHE_OK);
        vcache_adaptive_worker *w[2] = {make_tester(a), make_tester(a)};
        float weight[4];
        uint32_t order[4];
        assert_true(vcache_adaptive_source_rate(a, 2).rate == 0.75f);
        /* source 0 seen, 1 blocked; each worker once. 2 and 3 were never tested: the prior's 3/4, times v/w = 1/2 */
        for (int k = 0; k < 2; k++) {
            assert_int_equal(light_up(w[k], contribution, (bool[4]){true, false}, 1.0f, 16, weight, order), 2);
            assert_true(weight[0] == 1.0f && weight[1] == 0.0f && weight[2] == 0.375f && weight[3] == 0.375f);
        }
        /* merged: own counts do not show before the merge */
        float before[2] = {free_running ? 5.0f / 6.0f : 0.75f, free_running ? 0.5f : 0.75f};
        assert_true(vcache_adaptive_source_rate(a, 0).rate == before[0]);
        assert_int_equal(light_up(w[0], other, (bool[4]){[2] = true, [3] = true}, 1.0f, 16, weight, order), 2);
        assert_true(weight[2] == 1.0f && weight[3] == 1.0f && weight[0] == before[0] && weight[1] == before[1]);
        vcache_adaptive_merge(a, w, 2);
        vcache_adaptive_merge(a, w, 2); /* nothing is counted twice */
        static const struct {
            uint64_t tests, hits;
            float rate;
        } expected[4] = {{2, 2, 5.0f / 6.0f}, {2, 0, 0.5f}, {1, 1, 0.8f}, {1, 1, 0.8f}};
        for (uint32_t i = 0; i < 4; i++) {
            vcache_adaptive_source s = vcache_adaptive_source_rate(a, i);
            assert_int_equal(s.tests, expected[i].tests);
            assert_int_equal(s.hits, expected[i].hits);
            assert_true(s.rate == expected[i].rate);
        }
        assert_int_equal(light_up(w[1], other, (bool[4]){[2] = true}, 1.0f, 16, weight, order), 2);
        assert_true(weight[0] == 0.5f * (5.0f / 6.0f) && weight[1] == 0.25f);
        vcache_adaptive_statistics s = counts_of(w[0]);
        assert_int_equal(s.points, 2);
        assert_int_equal(s.candidates, 8);
        assert_int_equal(s.tested, 4);
        assert_int_equal(s.visible, 3);
        assert_true(s.compared > 0);
        s = (vcache_adaptive_statistics){.size = offsetof(vcache_adaptive_statistics, tested), .tested = 77};
        vcache_adaptive_worker_statistics(w[0], &s);
        assert_int_equal(s.size, offsetof(vcache_adaptive_statistics, tested));
        assert_int_equal(s.candidates, 8);
        assert_int_equal(s.tested, 77);
        vcache_adaptive_worker_reset_statistics(w[0]);
        assert_int_equal(counts_of(w[0]).points, 0);
        assert_int_equal(vcache_adaptive_source_rate(a, 0).tests, 2);
        vcache_adaptive_worker_destroy(&w[0]);
        vcache_adaptive_worker_destroy(&w[1]);
        vcache_adaptive_destroy(&a);
    }
}

/* Two points at a time whose answers count together; a relaxation of 0 tests and counts all that contributes. */
static void pilot(void **state)
{
    (void)state;
    enum { N = 500 };
    static float contribution[2][N], weight[2][N];
    static uint32_t order[2][N];
    vcache_adaptive *a = make(N, 0.5f, 0.0f, false);
    vcache_adaptive_worker *w[2] = {make_tester(a), NULL};
    char message[VCACHE_MESSAGE_BYTES];
    assert_int_equal(vcache_adaptive_worker_create_beside(NULL, &w[1], message), VCACHE_ERROR_ARGUMENT);
    assert_string_equal(message, "first is NULL");
    assert_int_equal(vcache_adaptive_worker_create_beside(w[0], NULL, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_adaptive_worker_create_beside(w[0], &w[1], message), VCACHE_OK);
    uint64_t seed = 9;
    uint32_t candidates[2] = {0}, given[2] = {0}, n[2];
    vcache_answer answers[64];
    for (int k = 0; k < 2; k++) {
        for (uint32_t i = 0; i < N; i++) {
            contribution[k][i] = i % 3 ? 1e-30f + random_contribution(&seed, 1) : 0.0f;
            candidates[k] += i % 3 != 0;
        }
        contribution[k][1] = 1e30f; /* beside this no other counts */
        vcache_adaptive_begin(w[k], contribution[k], weight[k], 0.0f);
    }
    do /* by turns */
        for (int k = 0; k < 2; k++) {
            n[k] = vcache_adaptive_next(w[k], order[k] + given[k], 64);
            for (uint32_t i = 0; i < n[k]; i++)
                answers[i] = order[k][given[k] + i] % 2 ? VCACHE_VISIBLE : VCACHE_BLOCKED;
            vcache_adaptive_tell(w[k], answers);
            given[k] += n[k];
        }
    while (n[0] + n[1] > 0);
    for (int k = 0; k < 2; k++) {
        assert_int_equal(vcache_adaptive_finish(w[k]), candidates[k]);
        assert_int_equal(counts_of(w[k]).tested, candidates[k]);
        for (uint32_t i = 1; i < candidates[k]; i++)
            assert_true(contribution[k][order[k][i - 1]] >= contribution[k][order[k][i]]);
        for (uint32_t i = 0; i < N; i++)
            assert_true(weight[k][i] == (i % 3 && i % 2 ? 1.0f : 0.0f));
    }
    vcache_adaptive_merge(a, w, 1); /* the first: both */
    for (uint32_t i = 0; i < N; i++) {
        vcache_adaptive_source s = vcache_adaptive_source_rate(a, i);
        assert_int_equal(s.tests, i % 3 ? 2 : 0);
        assert_int_equal(s.hits, i % 3 && i % 2 ? 2 : 0);
    }
    vcache_adaptive_worker_destroy(&w[1]);
    vcache_adaptive_worker_destroy(&w[0]);
    vcache_adaptive_destroy(&a);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rates), cmocka_unit_test(pilot)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
