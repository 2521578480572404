/* SPDX-License-Identifier: Apache-2.0 */
/* Owen-scrambled Sobol points in the unit square: any 2^k in a row from a multiple of 2^k are spread evenly in every
 * way that 2^k boxes can be cut (Kollig and Keller 2002; scrambling by hashes after Burley 2020). */
#ifndef COMMON_SOBOL_H
#define COMMON_SOBOL_H

#include <stdint.h>

static inline uint32_t sobol_reverse(uint32_t x)
{
    x = (x >> 1 & 0x55555555u) | (x & 0x55555555u) << 1;
    x = (x >> 2 & 0x33333333u) | (x & 0x33333333u) << 2;
    x = (x >> 4 & 0x0f0f0f0fu) | (x & 0x0f0f0f0fu) << 4;
    x = (x >> 8 & 0x00ff00ffu) | (x & 0x00ff00ffu) << 8;
    return x >> 16 | x << 16;
}

/* Each bit is flipped or not by those above it: x reversed, what a bit does goes to higher ones alone. */
static inline uint32_t sobol_scramble(uint32_t x, uint32_t seed)
{
    x = sobol_reverse(x) + seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return sobol_reverse(x);
}

/* Second dimension of point n; the first is sobol_reverse(n). In units of 2^-32. */
static inline uint32_t sobol_second(uint32_t n)
{
    uint32_t x = 0;
    for (uint32_t v = 1u << 31; n; n >>= 1, v ^= v >> 1)
        x ^= n & 1u ? v : 0u;
    return x;
}

/* In [0, 1). */
static inline float sobol_float(uint32_t x)
{
    return (float)(x >> 8) * 0x1p-24f;
}

#endif
