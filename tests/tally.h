/* SPDX-License-Identifier: Apache-2.0 */
/* Mean and standard error of estimates. After cmocka.h. */
#ifndef TESTS_TALLY_H
#define TESTS_TALLY_H

#include "samples.h"

typedef struct tally {
    double count, sum, squares;
} tally;

static inline void tally_add(tally *t, double x)
{
    t->count += 1.0, t->sum += x, t->squares += x * x;
}

static inline double tally_mean(const tally *t)
{
    return t->sum / t->count;
}

/* Standard error of the mean. */
static inline double tally_error(const tally *t)
{
    double mean = tally_mean(t), variance = (t->squares - t->count * mean * mean) / (t->count - 1.0);
    return sqrt(fmax(variance, 0.0) / t->count);
}

/* `bias`: what is known about the estimate's own error. */
static inline void assert_mean(const tally *t, double expected, double bias, const char *what)
{
    double mean = tally_mean(t), error = tally_error(t);
    if (!(fabs(mean - expected) <= 4.0 * error + bias))
        fail_msg("%s: mean %.6f, expected %.6f, standard error %.6f, bias allowed %.6f", what, mean, expected, error,
                 bias);
}

#endif
