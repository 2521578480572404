/* SPDX-License-Identifier: Apache-2.0 */
/*
 * vcache/adaptive.h - adaptive shadow testing: which of many light sources deserve a shadow ray at a point.
 *
 * The sources are tested in descending order of what they would contribute if nothing were in the way. Testing stops
 * where what is left no longer matters beside what was seen; the rest is added in proportion to how visible it probably
 * is. No random numbers, so no noise; it needs no cache, and any answer will do, a ray's or vcache_visible's.
 *
 * Based on: G. J. Ward, "Adaptive Shadow Testing for Ray Tracing", 2nd Eurographics Workshop on Rendering, 1991.
 * "Step" below is one of that paper's Sect. 3. With N sources, tolerance t and certainty c, at each point:
 *
 *   1. sort the potential contributions a_1 >= a_2 >= ... > 0;
 *   2. S = v = w = 0; for i = 1, 2, ...: stop if S t > r(i); else test source i: w += 1, and where it is visible
 *      v += 1 and S += a_i. r(i) is the sum of the next N c contributions that are untested, a_i the first of them;
 *   3. each untested source i is added with the weight v/w v(i)/w(i): the share of tests at this point that found
 *      their source visible, times the share of all tests of source i, wherever, that did.
 *
 * N c is rounded to the nearest whole number, and at least 1: c = 0 looks at the next contribution alone, c = 1 at the
 * sum of all that remain. (The paper calls the terms of r(i) "smaller than i"; it is the reading with a_i among them
 * that gives what it promises of c = 0 and c = 1.) Where nothing is visible, S = 0, all sources are tested.
 *
 * Error: at c = 1 and relaxation 1 the result is within t x exact of the exact one at each point, in the unit of the
 * contributions. Let R be what was not tested: the exact sum is S plus something in [0, R]; the result is too, as
 * weights are in [0, 1]; and R < t S <= t x exact (to rounding: 1e-12 of it). With relaxation x it is x t; with c < 1
 * nothing is promised but that each untested source is below t S.
 *
 * In four steps:
 *   1. vcache_adaptive_default_config, set `sources`, vcache_adaptive_create; one vcache_adaptive_worker per thread.
 *   2. At each point: vcache_adaptive_begin; while vcache_adaptive_next gives sources, trace them any way you like and
 *      vcache_adaptive_tell the answers; vcache_adaptive_finish.
 *   3. Sum colour[i] * weight[i] in the order of the sources.
 *   4. vcache_adaptive_merge at fixed points of the work (below).
 *
 * The hit rates v(i)/w(i) are learnt as the render goes on, so the picture depends on who has learnt what when:
 * - Merged (default): weights come from the rates of the last merge alone, a worker's own counts are kept apart until
 *   then. Cut the work into rounds whose tiles do not depend on the number of threads: within a round any thread takes
 *   any tile; at its end wait for all threads, merge all workers in one call, go on. The picture is then the same bit
 *   for bit for any number of threads. Each round costs a barrier, and N additions per worker; rounds that double in
 *   size (1, 1, 2, 4, 8 ... tiles) learn soon and need few. In the first round nothing is known but the prior.
 *   Or learn before all else, at some points with a relaxation of 0, where all sources are tested; merge; never again.
 *   That needs no rounds, and its rates are better: those of step 2 alone are too low, as more is tested in the shadow
 *   than in the light (docs/adaptive.md).
 * - Free-running: every answer is counted at once for all threads. No barriers, no merging; each test costs one or two
 *   atomic additions on memory that all threads write to, and a render is not the same picture twice unless one thread
 *   makes it.
 *
 * Threads, errors: as in vcache.h. The library starts no thread and takes no lock; creation returns a status and a
 * message; hot calls cannot fail and do not allocate.
 */
#ifndef VCACHE_ADAPTIVE_H
#define VCACHE_ADAPTIVE_H

#include "vcache.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The most light sources. */
#define VCACHE_ADAPTIVE_MAX_SOURCES 16777216

/* What it is made from; start from vcache_adaptive_default_config. */
typedef struct vcache_adaptive_config {
    size_t size;       /* sizeof(vcache_adaptive_config) of the host's header, set with the defaults */
    uint32_t sources;  /* N, 1 ... VCACHE_ADAPTIVE_MAX_SOURCES; no default */
    float tolerance;   /* t, finite, >= 0, default 0.1; a share of what is visible. 0: every source is tested */
    float certainty;   /* c, 0 ... 1, default 0.5 */
    float prior_hits;  /* v(i)/w(i) is (hits + prior_hits) / (tests + prior_tests), the mean of a Beta distribution: */
    float prior_tests; /* 0 <= prior_hits <= prior_tests, > 0, finite; default 1 of 2. What a source that was never
                          tested is taken for, and how many tests it takes to outweigh that. 0.001 of 0.002, say, comes
                          next to the bare ratio of the paper, which is 0 / 0 at first */
    bool free_running; /* default false: merged */
    vcache_allocator allocator; /* default: the C library's */
} vcache_adaptive_config;

/* Hit rates of the sources, for one render of one scene. Any number of threads may read it through their workers. */
typedef struct vcache_adaptive vcache_adaptive;

/* All fields set to their defaults, as vcache_fill_config: `sources` remains to be set. */
VCACHE_API void vcache_adaptive_fill_config(vcache_adaptive_config *out, size_t size);
/* The same by value, compiled into the host. */
static inline vcache_adaptive_config vcache_adaptive_default_config(void)
{
    vcache_adaptive_config config;
    vcache_adaptive_fill_config(&config, sizeof config);
    return config;
}
/* On failure *out is NULL and `message` (VCACHE_MESSAGE_BYTES bytes, or NULL) says which value is wrong. */
VCACHE_API vcache_status vcache_adaptive_create(const vcache_adaptive_config *config, vcache_adaptive **out,
                                                char *message);
/* After its workers. Sets *adaptive to NULL; NULL and a pointer to NULL are fine. */
VCACHE_API void vcache_adaptive_destroy(vcache_adaptive **adaptive);

/* One point at a time: scratch, counts and statistics of one thread (about 33 bytes a source, 17 beside another). */
typedef struct vcache_adaptive_worker vcache_adaptive_worker;
VCACHE_API vcache_status vcache_adaptive_worker_create(vcache_adaptive *adaptive, vcache_adaptive_worker **out,
                                                       char *message);
/* Another one for the same thread, that counts into `first`'s counts: for several points at a time, so that their tests
 * can share packets of rays. Merging `first` merges both; destroy it after this one. */
VCACHE_API vcache_status vcache_adaptive_worker_create_beside(vcache_adaptive_worker *first,
                                                              vcache_adaptive_worker **out, char *message);
/* Counts that were not merged are lost. */
VCACHE_API void vcache_adaptive_worker_destroy(vcache_adaptive_worker **worker);

/* ------------------------------------------------------------------------------------------------ a shading point */

/* Begins a point, whatever became of the last. `contribution`: [sources] what each would bring unoccluded, in any unit
 * that is the same for all (luminance, say), in any order. 0, negative, NaN and infinite: never tested, weight 0.
 * `weight`: [sources] written by the calls below. Both must stay where they are until the point is finished, and must
 * not overlap. `relaxation` >= 1 multiplies the tolerance: 1 / (the ray's weight in the pixel), say, for rays at the
 * end of specular chains (Sect. 5). 0: all with a contribution are tested and counted, brightest first, to learn hit
 * rates from. Else below 1, and NaN, count as 1. A tolerance of 0 stays 0. */
VCACHE_API void vcache_adaptive_begin(vcache_adaptive_worker *worker, const float *contribution, float *weight,
                                      float relaxation);

/* The next sources to test, at most `capacity`, brightest first (at t = 0 in their own order). Only those that step 2
 * tests whatever the answers to them are: no ray is wasted, and the tested set does not depend on `capacity`. As the
 * answers decide how it goes on, call again after telling them. 0: nothing more is to be tested. */
VCACHE_API uint32_t vcache_adaptive_next(vcache_adaptive_worker *worker, uint32_t *sources, uint32_t capacity);

/* Answers to all sources given out since the last tell, in their order: VCACHE_VISIBLE or VCACHE_BLOCKED; VCACHE_ONCE
 * makes no difference. */
VCACHE_API void vcache_adaptive_tell(vcache_adaptive_worker *worker, const vcache_answer *answers);

/* Writes the weights of what was not tested. Now weight[i] is 1 where source i was found visible, 0 where blocked or
 * without contribution, and between 0 and 1, both included, where it was not tested: colour[i] * weight[i] summed over
 * all i is the light at the point, and at t = 0 the exact sum bit for bit. To be called when vcache_adaptive_next gave
 * 0; sources not told of by then count as untested at t > 0 (where none was, v/w is taken for 1), as blocked at t = 0.
 * Returns how many were tested. */
VCACHE_API uint32_t vcache_adaptive_finish(vcache_adaptive_worker *worker);

/* ------------------------------------------------------------------------------------------------------ hit rates */

/* Moves the counts of these workers, all of them of `adaptive`, into the hit rates. Nobody else may use the workers or
 * `adaptive` meanwhile. Counts are whole numbers: the order of workers makes no difference. Free-running: no effect. */
VCACHE_API void vcache_adaptive_merge(vcache_adaptive *adaptive, vcache_adaptive_worker *const *workers,
                                      uint32_t count);

/* What is known of a source. */
typedef struct vcache_adaptive_source {
    uint64_t tests, hits; /* w(i), v(i): merged so far, or by now where free-running. Not counted at t = 0, where
                             nothing reads them */
    float rate;           /* what weights are made from: v(i)/w(i) with the prior */
} vcache_adaptive_source;

/* `source` < sources. */
VCACHE_API vcache_adaptive_source vcache_adaptive_source_rate(const vcache_adaptive *adaptive, uint32_t source);

/* Counts of a worker. */
typedef struct vcache_adaptive_statistics {
    size_t size;         /* in: sizeof(vcache_adaptive_statistics); out: bytes that this version filled */
    uint64_t points;     /* finished */
    uint64_t candidates; /* of them: sources with a contribution */
    uint64_t tested;     /* of these: tested */
    uint64_t visible;    /* of these: found visible */
    uint64_t compared; /* comparisons of contributions: of the order of n + k log k for k tested of n candidates, where
                          full sorting takes n log n; none at t = 0 */
} vcache_adaptive_statistics;

/* Counts of this worker since it was created or reset; a reset leaves the hit rates alone. */
VCACHE_API void vcache_adaptive_worker_statistics(const vcache_adaptive_worker *worker,
                                                  vcache_adaptive_statistics *out);
VCACHE_API void vcache_adaptive_worker_reset_statistics(vcache_adaptive_worker *worker);

#ifdef __cplusplus
}
#endif

#endif
