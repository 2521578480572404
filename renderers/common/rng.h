/* SPDX-License-Identifier: Apache-2.0 */
/* Counter-based random numbers: the stream of a sample depends on its own index alone, so that exact and cached
 * renderings, and any number of threads, draw the same numbers. PCG32 (O'Neill 2014) seeded by a mixed index. */
#ifndef COMMON_RNG_H
#define COMMON_RNG_H

#include <stdint.h>

typedef struct rng {
    uint64_t state, stream;
} rng;

/* Finalizer of SplitMix64 (Steele et al. 2014). */
static inline uint64_t rng_mix(uint64_t x)
{
    x ^= x >> 30;
    x *= 0xbf58476d1ce4e5b9u;
    x ^= x >> 27;
    x *= 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

static inline rng rng_make(uint64_t seed, uint64_t index)
{
    uint64_t s = rng_mix(seed + 0x9e3779b97f4a7c15u);
    return (rng){rng_mix(s ^ rng_mix(index + 0x632be59bd9b4e019u)), (rng_mix(index ^ s) << 1) | 1u};
}

static inline uint32_t rng_u32(rng *r)
{
    uint64_t old = r->state;
    r->state = old * 6364136223846793005u + r->stream;
    uint32_t x = (uint32_t)(((old >> 18) ^ old) >> 27), rot = (uint32_t)(old >> 59);
    return (x >> rot) | (x << ((32u - rot) & 31u));
}

/* Uniform in [0, 1). */
static inline float rng_float(rng *r)
{
    return (float)(rng_u32(r) >> 8) * 0x1p-24f;
}

static inline double rng_double(rng *r)
{
    uint64_t high = rng_u32(r);
    return (double)(high << 21 | rng_u32(r) >> 11) * 0x1p-53;
}

#endif
