/* SPDX-License-Identifier: Apache-2.0 */
/* Hashing of keys. The paper's families (Sect. 4.1) run over all words of a key one after the other; ours hashes each
 * half to 64 bits once and combines two halves by one multiplication. All are exact integer arithmetic. */
#ifndef VCACHE_HASH_H
#define VCACHE_HASH_H

#include "vcache.h"

/* High and low half of the 128-bit product folded: every output bit depends on every input bit. */
static inline uint64_t hash_fold(uint64_t a, uint64_t b)
{
#if defined(__SIZEOF_INT128__)
    __extension__ typedef unsigned __int128 u128;
    u128 p = (u128)a * b;
    return (uint64_t)p ^ (uint64_t)(p >> 64);
#else
    uint64_t al = (uint32_t)a, ah = a >> 32, bl = (uint32_t)b, bh = b >> 32;
    uint64_t ll = al * bl, lh = al * bh, hl = ah * bl, hh = ah * bh;
    uint64_t mid = (ll >> 32) + (uint32_t)lh + (uint32_t)hl;
    uint64_t low = (mid << 32) | (uint32_t)ll;
    return low ^ (hh + (lh >> 32) + (hl >> 32) + (mid >> 32));
#endif
}

/* 128 bits of key and 64 of seed to 64 well-mixed bits. */
static inline uint64_t hash_words(uint64_t a, uint64_t b, uint64_t seed)
{
    uint64_t x = hash_fold(a ^ 0x9e3779b97f4a7c15u ^ seed, b ^ 0xd6e8feb86659fd93u);
    return hash_fold(x ^ 0xa0761d6478bd642fu, seed ^ 0xe7037ed1a0b428dbu ^ (b << 32 | b >> 32));
}

/* Eq. 10: kappa in the upper 32 bits, c in the lower. C1 and C2 are the generators of Numerical Recipes, Sect. 7.1. */
static inline uint64_t hash_lcg_pair(uint64_t state, uint32_t word)
{
    uint32_t kappa = (uint32_t)(state >> 32), c = (uint32_t)state;
    kappa = (kappa * 1664525u + 1013904223u) ^ word;
    c = (c * 22695477u + 1u) + word;
    return (uint64_t)kappa << 32 | c;
}

/* Sect. 4.1, second approach: d <- A(C(d)) xor word. */
static inline uint64_t hash_lcg_xorshift(uint64_t state, uint32_t word)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    state ^= state >> 21;
    state ^= state << 35;
    state ^= state >> 4;
    return state ^ word;
}

static inline uint64_t hash_recurrence(vcache_hash family, uint64_t state, const uint32_t *words, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        state = family == VCACHE_HASH_LCG_PAIR ? hash_lcg_pair(state, words[i]) : hash_lcg_xorshift(state, words[i]);
    return state;
}

/* The last step without a word: C1(kappa) and C2(c), or A(C(d)). */
static inline uint64_t hash_finish(vcache_hash family, uint64_t state)
{
    return family == VCACHE_HASH_LCG_PAIR ? hash_lcg_pair(state, 0) : hash_lcg_xorshift(state, 0);
}

#endif
