/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of vcache share: random numbers with fixed seeds, small caches, an allocator that counts. */
#ifndef TESTS_SUPPORT_H
#define TESTS_SUPPORT_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "../vcache/internal.h"

/* ---------------------------------------------------------------------------------------------- random numbers */

/* A Weyl sequence through a mixer of its own, so that nothing here resembles the hashes under test. */
static inline uint64_t random_bits(uint64_t *state)
{
    uint64_t x = *state += 0x9e3779b97f4a7c15u;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return x ^ x >> 31;
}

static inline double random_unit(uint64_t *state)
{
    return (double)(random_bits(state) >> 11) * 0x1p-53;
}

static inline double random_between(uint64_t *state, double low, double high)
{
    return low + (high - low) * random_unit(state);
}

/* Uniform over the sphere. */
static inline void random_direction(uint64_t *state, float d[3])
{
    double z = random_between(state, -1.0, 1.0), angle = random_between(state, 0.0, 6.283185307179586);
    double r = sqrt(1.0 - z * z);
    d[0] = (float)(r * cos(angle)), d[1] = (float)(r * sin(angle)), d[2] = (float)z;
}

/* ------------------------------------------------------------------------------------------------------- caches */

static inline vcache *make_cache(const vcache_config *config)
{
    char message[VCACHE_MESSAGE_BYTES];
    vcache *cache = NULL;
    if (vcache_create(config, &cache, message) != VCACHE_OK)
        fail_msg("vcache_create: %s", message);
    return cache;
}

static inline vcache_worker *make_worker(vcache *cache, uint32_t capacity, bool exact)
{
    vcache_worker_config config = vcache_default_worker_config();
    char message[VCACHE_MESSAGE_BYTES];
    vcache_worker *worker = NULL;
    config.capacity = capacity;
    config.exact = exact;
    if (vcache_worker_create(cache, &config, &worker, message) != VCACHE_OK)
        fail_msg("vcache_worker_create: %s", message);
    return worker;
}

static inline vcache_statistics statistics_of(const vcache_worker *worker)
{
    vcache_statistics s = {.size = sizeof s};
    vcache_worker_statistics(worker, &s);
    return s;
}

static inline uint64_t hits_of(const vcache_statistics *s)
{
    uint64_t sum = 0;
    for (int i = 0; i < VCACHE_MAX_LEVELS; i++)
        sum += s->hits[i];
    return sum;
}

/* Prepared ends on the heap, at their true stride: a write past the end is seen by the address sanitizer. */
static inline vcache_eye *make_eye(const vcache *cache, const vcache_surface *surface, float ce, uint64_t salt)
{
    vcache_eye *eye = malloc(vcache_eye_size(cache, ce));
    assert_non_null(eye);
    vcache_prepare_eye(cache, surface, ce, salt, eye);
    return eye;
}

/* ---------------------------------------------------------------------------------------------------- statistics */

/* Distinct values in an array, which gets sorted. */
static inline int compare_u64(const void *a, const void *b)
{
    uint64_t x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return x < y ? -1 : x > y;
}

static inline size_t count_distinct(uint64_t *values, size_t count)
{
    qsort(values, count, sizeof *values, compare_u64);
    size_t distinct = count > 0;
    for (size_t i = 1; i < count; i++)
        distinct += values[i] != values[i - 1];
    return distinct;
}

/* How many standard deviations the chi-square statistic of `counts` lies above its mean under equal bins. */
static inline double chi_square_sigmas(const uint32_t *counts, size_t bins, size_t total)
{
    double expected = (double)total / (double)bins, chi = 0.0;
    for (size_t i = 0; i < bins; i++)
        chi += (counts[i] - expected) * (counts[i] - expected) / expected;
    double freedom = (double)bins - 1.0;
    return (chi - freedom) / sqrt(2.0 * freedom);
}

/* FNV-1a over bytes. */
static inline uint64_t checksum(uint64_t sum, const void *data, size_t bytes)
{
    for (size_t i = 0; i < bytes; i++)
        sum = (sum ^ ((const unsigned char *)data)[i]) * 0x100000001b3u;
    return sum;
}

#endif
