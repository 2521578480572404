/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of adaptive shadow testing share: whole points, and contributions whose sums are exact. */
#ifndef TESTS_ADAPTIVE_SUPPORT_H
#define TESTS_ADAPTIVE_SUPPORT_H

#include "../vcache/adaptive.h"
#include "support.h"

enum { MOST = 10000 };

static inline vcache_adaptive *make(uint32_t sources, float tolerance, float certainty, bool free_running)
{
    vcache_adaptive_config config = vcache_adaptive_default_config();
    config.sources = sources;
    config.tolerance = tolerance;
    config.certainty = certainty;
    config.free_running = free_running;
    char message[VCACHE_MESSAGE_BYTES];
    vcache_adaptive *a = NULL;
    if (vcache_adaptive_create(&config, &a, message) != VCACHE_OK)
        fail_msg("vcache_adaptive_create: %s", message);
    return a;
}

static inline vcache_adaptive_worker *make_tester(vcache_adaptive *a)
{
    vcache_adaptive_worker *w = NULL;
    assert_int_equal(vcache_adaptive_worker_create(a, &w, NULL), VCACHE_OK);
    return w;
}

static inline vcache_adaptive_statistics counts_of(const vcache_adaptive_worker *w)
{
    vcache_adaptive_statistics s = {.size = sizeof s};
    vcache_adaptive_worker_statistics(w, &s);
    return s;
}

/* One point; `order` gets the sources in the order of their tests. No assertions: threads use it. */
static inline uint32_t light_up(vcache_adaptive_worker *w, const float *contribution, const bool *visible,
                                float relaxation, uint32_t capacity, float *weight, uint32_t *order)
{
    uint32_t count = 0, n;
    vcache_answer answers[MOST];
    vcache_adaptive_begin(w, contribution, weight, relaxation);
    while ((n = vcache_adaptive_next(w, order + count, capacity)) != 0) {
        for (uint32_t i = 0; i < n; i++)
            answers[i] = (vcache_answer)((visible[order[count + i]] ? VCACHE_VISIBLE : VCACHE_BLOCKED) |
                                         (i % 2 ? VCACHE_ONCE : 0));
        vcache_adaptive_tell(w, answers);
        count += n;
    }
    return vcache_adaptive_finish(w) == count ? count : UINT32_MAX;
}

/* Whole multiples of 2^-10 below 2^10: sums of them, and products with a tolerance, are exact, whatever their order. */
static inline float random_contribution(uint64_t *seed, int kind)
{
    double x = random_unit(seed);
    switch (kind) {
    case 0: /* alike */
        break;
    case 1: /* over six decades, many of them 0 */
        x = pow(10.0, 3.0 - 9.0 * x) / 1000.0;
        break;
    case 2: /* few values, many times */
        x = floor(8.0 * x) / 8.0;
        break;
    default: /* lamps on a ceiling: inverse fourth power of the distance */
        x = pow(1.0 + 8.0 * x, -4.0);
    }
    return (float)(floor(x * 0x1p20) * 0x1p-10);
}

#endif
