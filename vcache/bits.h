/* SPDX-License-Identifier: Apache-2.0 */
/* Bits of 64-bit words. */
#ifndef VCACHE_BITS_H
#define VCACHE_BITS_H

#include <stdint.h>

#if defined(__GNUC__)
static inline int count_trailing_zeros(uint64_t x) /* x != 0 */
{
    return __builtin_ctzll(x);
}

static inline int highest_bit(uint64_t x) /* x != 0 */
{
    return 63 - __builtin_clzll(x);
}

static inline uint32_t count_ones(uint64_t x)
{
#if defined(__POPCNT__) || !defined(__x86_64__)
    return (uint32_t)__builtin_popcountll(x);
#else /* where the compiler would call a function */
    x -= x >> 1 & 0x5555555555555555u;
    x = (x & 0x3333333333333333u) + (x >> 2 & 0x3333333333333333u);
    x = (x + (x >> 4)) & 0x0f0f0f0f0f0f0f0fu;
    return (uint32_t)(x * 0x0101010101010101u >> 56);
#endif
}
#else
static inline uint32_t count_ones(uint64_t x)
{
    uint32_t n = 0;
    for (; x; x &= x - 1)
        n++;
    return n;
}

static inline int count_trailing_zeros(uint64_t x)
{
    return (int)count_ones((x & -x) - 1);
}

static inline int highest_bit(uint64_t x)
{
    int bit = 0;
    while (x >>= 1)
        bit++;
    return bit;
}
#endif

#endif
