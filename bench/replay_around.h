/* SPDX-License-Identifier: Apache-2.0 */
/* Refinement that looks farther than at the 4 cells around an eye cell: Sect. 3.6 of Popov et al. 2013 names 64, 8
 * around X times 8 around Y, and takes the 4 around X, which are not among these: their light's cell is that of Y. */
#ifndef BENCH_REPLAY_AROUND_H
#define BENCH_REPLAY_AROUND_H

#include "replay.h"

enum { AROUND_MAX = 8 };

/* Lights in the 8 cells around each light's cell, and with `with_own` in that cell, itself included:
 * others[first[i]] ... others[first[i + 1] - 1]. */
typedef struct light_neighbours {
    uint32_t *first, *others;
} light_neighbours;

light_neighbours light_neighbours_new(const record *r, const vcache *cache, bool with_own);
void light_neighbours_free(light_neighbours *n);

/* The levels of an eye end as vcache_prepare_eye makes them, with the 8 cells around each. Keys are of their own hash:
 * for cells that were all named by it. */
void around_prepare(const vcache *cache, const vcache_surface *at, float ce, vcache_eye *end,
                    uint64_t around[VCACHE_MAX_LEVELS][AROUND_MAX]);

/* Of `hit`, whose answers are `visible`, the lights of word w to which a light beside them differs in one of the rows.
 */
uint64_t around_differing(const light_neighbours *n, const uint64_t *const *rows, uint32_t count, uint32_t words,
                          uint32_t w, uint64_t hit, uint64_t visible);

#endif
