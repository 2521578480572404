/* SPDX-License-Identifier: Apache-2.0 */
/* How many samples statistical tests take. */
#ifndef TESTS_SAMPLES_H
#define TESTS_SAMPLES_H

#include <math.h>
#include <stdlib.h>

/* How many of `all` samples to take: VCACHE_TEST_PART=8 in the environment asks for an eighth, but for 16 at least. For
 * suites that run once more, by another compiler or under a sanitizer, what all of the samples were taken of. */
static inline int sample_count(int all)
{
    const char *text = getenv("VCACHE_TEST_PART");
    int part = text ? atoi(text) : 1, least = all < 16 ? all : 16;
    return part > 1 && all / part > least ? all / part : part > 1 ? least : all;
}

/* By how much standard errors are larger than of all samples: the root of the ratio. */
static inline double error_growth(int all)
{
    return sqrt((double)all / (double)sample_count(all));
}

#endif
