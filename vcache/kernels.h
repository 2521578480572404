/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The loops over the lights of a set. A scalar reference is always built; faster ones replace it where the machine has
 * the instructions and the config allows them. All give the same bits: sums go in 16 fixed lanes.
 */
#ifndef VCACHE_KERNELS_H
#define VCACHE_KERNELS_H

/* NaN and infinity mean something here, and keys, bits and sums are the same on every machine. */
#if defined(__FAST_MATH__) || defined(__ASSOCIATIVE_MATH__) || defined(__RECIPROCAL_MATH__) ||                         \
    (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__)
#error "vcache needs IEEE arithmetic: compile without -ffast-math, -Ofast and their parts"
#endif

#include "names.h"
#include "vcache.h"

#include <string.h>

enum { LANES = 16, STATES = 64 };

/* Where the lights of a set are, one array a component, padded to whole words of 64. */
typedef struct light_places {
    const float *x, *y, *z, *side_squared;
} light_places;

/* What the three cells of an eye end say of each light: known and visible bits of the finest, middle, coarsest row. The
 * state of a cell is known | visible << 1; the state of a light is that of all three, finest lowest, 6 bits. */
typedef struct predict_input {
    uint32_t words;
    const uint64_t *known[VCACHE_CELLS], *visible[VCACHE_CELLS];
    const float *table; /* [STATES]: expected visibility; its lower half is the upper half of its deviation */
    const float *contribution;
} predict_input;

/* The weight of a light is its contribution times the deviation. `sums[16 w + k]`: of the weights of lights 64 w + j,
 * + 16, + 32, + 48 for j = 0 ... k. */
typedef struct predict_output {
    float *mean, *sums;
} predict_output;

typedef struct kernels {
    const char *name;
    /* Lights of `words` words nearer to the eye end than a cell, or that cannot be quantized (NaN). */
    void (*near)(const light_places *p, const float eye[3], float eye_side_squared, uint32_t words, uint64_t *bits);
    /* Algorithm 2 on rows of bits, `rest` being asked for: answered, to be traced, and who goes to the next level.
     * known[k], seen[k]: the cell (0) and its 4 neighbours; `cells` of them. */
    void (*decide)(uint32_t words, uint32_t cells, const uint64_t *const known[5], const uint64_t *const seen[5],
                   const uint64_t *rest, uint64_t *found, uint64_t *missing, uint64_t *differs);
    /* How many lights a cell has asked for, and twice how many of them it saw: those seen both ways count half. */
    void (*tally)(const uint64_t *known, const uint64_t *visible, uint32_t words, uint32_t *asked, uint32_t *seen);
    /* Returns the sum of contribution times mean. */
    float (*predict)(const predict_input *in, const predict_output *out);
} kernels;

/* The fastest that the machine has among those of `isa` (VCACHE_ISA_...). */
const kernels *kernels_choose(uint32_t isa);

extern const kernels kernels_scalar;
#if defined(__x86_64__) && defined(__GNUC__)
#define KERNELS_X86
extern const kernels kernels_avx2, kernels_avx512;
#endif

/* kernels.tally, for each instruction set that counts bits its own way. */
static inline __attribute__((always_inline)) void tally_bits(const uint64_t *known, const uint64_t *visible,
                                                             uint32_t words, uint32_t *asked, uint32_t *seen)
{
    *asked = *seen = 0;
    for (uint32_t w = 0; w < words; w++) {
        *asked += (uint32_t)__builtin_popcountll(known[w] | visible[w]);
        *seen += (uint32_t)(__builtin_popcountll(visible[w]) + __builtin_popcountll(known[w] & visible[w]));
    }
}

/* The deviation that stands in the lower half of a mean. */
static inline float deviation_of(float mean)
{
    uint32_t bits;
    memcpy(&bits, &mean, sizeof bits);
    bits <<= 16;
    memcpy(&mean, &bits, sizeof bits);
    return mean;
}

/* Sums of the first 1, 2 ... 16 lanes (Hillis and Steele 1986), in an order that serves every vector width. */
static inline void lanes_scan(float v[LANES])
{
    for (int shift = 1; shift < LANES; shift *= 2)
        for (int i = LANES - 1; i >= shift; i--)
            v[i] += v[i - shift];
}

/* Sum of 16 lanes: halves are added until one is left, so that every vector width gives the same bits. */
static inline float lanes_sum(const float v[LANES])
{
    float a[8], b[4];
    for (int i = 0; i < 8; i++)
        a[i] = v[i] + v[i + 8];
    for (int i = 0; i < 4; i++)
        b[i] = a[i] + a[i + 4];
    return (b[0] + b[2]) + (b[1] + b[3]);
}

#endif
