/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Contributions in descending order, sorted no further than somebody looks.
 *
 * As in quicksort they are parted by pivots, but only where it is asked for (R. Paredes and G. Navarro, "Optimal
 * Incremental Sorting", 2006): the first k of n take about n + k log k comparisons. Where they were parted is a cut:
 * all before it are brighter than all behind it, and the sum of all behind it is kept: made from positive terms alone,
 * so it is good to rounding however small it is beside the sum of all.
 */
#ifndef VCACHE_RANKING_H
#define VCACHE_RANKING_H

#include "bits.h"

#include <stdbool.h>
#include <stdint.h>
#include <string.h>

/* Fewer than this between two cuts are sorted by insertion. */
enum { RANKING_SMALL = 12 };

typedef struct ranking {
    uint32_t count;
    uint64_t *keys;  /* [count] */
    double *rest;    /* [count + 1] at a cut c: the sum of keys[c ... count - 1] */
    uint64_t *cuts;  /* [count / 64 + 1] bit c: keys[0 ... c - 1] > keys[c ... count - 1] */
    uint64_t *words; /* [count / 4096 + 1] bit w: there is one in cuts[w] */
    uint64_t compared;
} ranking;

/* Of a contribution > 0 and finite, by its bits, which are in the order of its values. Greater is brighter, of equals
 * the first source; no two keys are equal. */
static inline uint64_t ranking_key(uint32_t bits, uint32_t source)
{
    return (uint64_t)bits << 32 | (uint32_t)~source;
}

static inline uint32_t ranking_source(uint64_t key)
{
    return ~(uint32_t)key;
}

static inline double ranking_value(uint64_t key)
{
    uint32_t bits = (uint32_t)(key >> 32);
    float value;
    memcpy(&value, &bits, sizeof value);
    return (double)value;
}

static inline void ranking_cut(ranking *r, uint32_t at, double rest)
{
    r->cuts[at / 64] |= (uint64_t)1 << (at % 64);
    r->words[at / 4096] |= (uint64_t)1 << (at / 64 % 64);
    r->rest[at] = rest;
}

/* To begin with, all `count` keys are there and sum up to `sum`. */
static inline void ranking_begin(ranking *r, double sum)
{
    memset(r->cuts, 0, (r->count / 64 + 1) * sizeof *r->cuts);
    memset(r->words, 0, (r->count / 4096 + 1) * sizeof *r->words);
    ranking_cut(r, r->count, 0.0);
    ranking_cut(r, 0, sum);
}

/* The last bit of `bits` at `at` or before it, the first at `at` or behind it; there must be one. */
static inline uint32_t ranking_bit_before(const uint64_t *bits, uint32_t at)
{
    uint32_t word = at / 64;
    uint64_t found = bits[word] & ~(uint64_t)0 >> (63 - at % 64);
    while (!found)
        found = bits[--word];
    return 64 * word + (uint32_t)highest_bit(found);
}

static inline uint32_t ranking_bit_after(const uint64_t *bits, uint32_t at)
{
    uint32_t word = at / 64;
    uint64_t found = bits[word] & ~(uint64_t)0 << (at % 64);
    while (!found)
        found = bits[++word];
    return 64 * word + (uint32_t)count_trailing_zeros(found);
}

/* At `at` or before it; behind it. There is a cut at 0 and one at `count`. */
static inline uint32_t ranking_cut_before(const ranking *r, uint32_t at)
{
    uint32_t word = at / 64;
    uint64_t bits = r->cuts[word] & ~(uint64_t)0 >> (63 - at % 64);
    if (!bits) {
        word = ranking_bit_before(r->words, word - 1);
        bits = r->cuts[word];
    }
    return 64 * word + (uint32_t)highest_bit(bits);
}

static inline uint32_t ranking_cut_after(const ranking *r, uint32_t at)
{
    uint32_t word = ++at / 64;
    uint64_t bits = r->cuts[word] & ~(uint64_t)0 << (at % 64);
    if (!bits) {
        word = ranking_bit_after(r->words, word + 1);
        bits = r->cuts[word];
    }
    return 64 * word + (uint32_t)count_trailing_zeros(bits);
}

/* Cuts somewhere between two neighbouring cuts, in two or everywhere. */
static inline void ranking_part(ranking *r, uint32_t first, uint32_t end)
{
    uint64_t *keys = r->keys, compared = 0;
    double rest = r->rest[end];
    if (end - first <= RANKING_SMALL) {
        for (uint32_t i = first + 1; i < end; i++) {
            uint64_t key = keys[i];
            uint32_t j = i;
            for (; j > first && (compared++, keys[j - 1] < key); j--)
                keys[j] = keys[j - 1];
            keys[j] = key;
        }
        for (uint32_t i = end; --i > first;)
            ranking_cut(r, i, rest += ranking_value(keys[i]));
    } else {
        /* the median of three, to the front */
        uint32_t step = (end - first) / 4, i[3] = {first + step, first + 2 * step, first + 3 * step};
        bool above = keys[i[0]] > keys[i[1]], over = keys[i[1]] > keys[i[2]], outer = keys[i[0]] > keys[i[2]];
        uint32_t middle = above == over ? i[1] : above == outer ? i[2] : i[0], at = first + 1;
        uint64_t pivot = keys[middle];
        keys[middle] = keys[first];
        compared = 3 + (end - first - 1);
        for (uint32_t k = at; k < end; k++) { /* no branch: it would be a coin's toss */
            uint64_t key = keys[k];
            keys[k] = keys[at];
            keys[at] = key;
            at += key > pivot;
        }
        keys[first] = keys[at - 1];
        keys[at - 1] = pivot;
        for (uint32_t k = end; k-- > at;)
            rest += ranking_value(keys[k]);
        ranking_cut(r, at, rest);
        if (at - 1 > first)
            ranking_cut(r, at - 1, rest + ranking_value(pivot));
    }
    r->compared += compared;
}

/* Brings the one of rank `at` to its place, where those of lower ranks are in theirs. */
static inline void ranking_sort(ranking *r, uint32_t at)
{
    for (uint32_t end; (end = ranking_cut_after(r, at)) != at + 1;)
        ranking_part(r, at, end);
}

#endif
