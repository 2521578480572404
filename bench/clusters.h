/* SPDX-License-Identifier: Apache-2.0 */
/* What is known of the clusters of a policy, pair by pair: figures for Sect. 5.1 and 4.1 of Popov et al. 2013, printed
 * as members of a JSON object. */
#ifndef BENCH_CLUSTERS_H
#define BENCH_CLUSTERS_H

#include "replay.h"

/* "visibility": unrefined clusters of one light by their average visibility V (Eq. 12), in bins: `v` their mean V,
 * `pairs`, `clusters`, `visible` the share of clusters whose first pair is visible (the paper: V), `expected` the share
 * of wrong pairs if that pair is any of the cluster's (2 V (1 - V)), `unrefined` the share that is wrong with the first
 * pair's answer, `refined` with the policy's. */
void print_visibility(const record *r, const grid_policy *p, const replay_bits *bits);

/* "distance": of each wrong answer, in units of C_E / sqrt(spp) pixels, from the middle of its pixel to that of the
 * nearest one that sees the light as was answered, less the half pixel to the edge between them; 0 within an edge's
 * pixel. `bins` of a quarter of a unit, shares of all wrong answers; `within` the shares in or before each; `beyond`:
 * farther than 1, `diagonal`: than sqrt(2); by quarters of the eye samples from near to far, and by slant of the
 * surface. */
void print_distances(const record *r, const grid_policy *p, const replay_bits *bits);

/* "hash": pairs of unrefined cell and light cell that are asked, keyed by `family` for a table of `words`: `distinct`
 * ones, `merged` those that have another's slot and digest and so would take its answer, `slots` that they take,
 * `expected` if keys were random. */
void print_hash(const record *r, const grid_policy *p, const replay_bits *bits, vcache_hash family, uint64_t words);

/* The unrefined cells of all eye samples: their numbers, and the eye samples in the order of the policy, cell by cell;
 * the first of each speaks for it. Returns the number of cells; `start` [cells + 1] and `eyes` [count] are the
 * caller's. Eye samples that cannot be quantized are in none. */
uint32_t clusters_of_eyes(const record *r, const grid_policy *p, uint32_t **start, uint32_t **eyes);

static inline bool clusters_bit(const uint64_t *bits, const record *r, uint32_t eye, uint32_t i)
{
    return bits[(size_t)eye * r->words + i / 64] >> i % 64 & 1u;
}

vcache_config clusters_config(const grid_policy *p);

#endif
