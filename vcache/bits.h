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
    return (uint32_t)__builtin_popcountll(x);
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
