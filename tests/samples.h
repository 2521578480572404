/* SPDX-License-Identifier: Apache-2.0 */
/* How many samples statistical tests take. */
#ifndef TESTS_SAMPLES_H
#define TESTS_SAMPLES_H

#include <math.h>
#include <stdlib.h>

/* VCACHE_TEST_PART=8 in the environment asks for an eighth of the samples: for suites that run once more, by another
 * compiler or under a sanitizer, what has been run with all of them. 1: all. */
static inline int sample_part(void)
{
    const char *text = getenv("VCACHE_TEST_PART");
    return text && atoi(text) > 1 ? atoi(text) : 1;
}

/* How many of `all` samples to take, but `least` at least (or all): what has rare large values needs many. */
static inline int sample_count(int all, int least)
{
    int part = all / sample_part();
    return part >= least ? part : all < least ? all : least;
}

/* By how much standard errors are larger than of all samples: the root of the ratio. */
static inline double error_growth(int all, int least)
{
    return sqrt((double)all / (double)sample_count(all, least));
}

/* Of similar cases in a row all, or every second one. */
static inline int case_step(void)
{
    return sample_part() > 1 ? 2 : 1;
}

#endif
