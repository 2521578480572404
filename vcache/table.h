/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The lock-free table. A word of an answer is
 *
 *     31                               1   0
 *    +----------------------------------+---+
 *    | digest, 1 ... 2^31 - 1           | V |      0: empty
 *    +----------------------------------+---+
 *
 * and a word of an estimate, which counts the rays of a pair of cells,
 *
 *     31                    12 11       6 5        0
 *    +------------------------+----------+----------+
 *    | digest, 0 ... 2^20 - 1 | blocked  | visible  |      0: empty; one of the two counts is above 0
 *    +------------------------+----------+----------+
 *
 * Both kinds lie in one table. Their keys differ by a salt (estimate_pair.c), so that to one kind the other is foreign.
 *
 * What races: two threads may write one word at a time, and a reader sees one or the other. Each word is written and
 * read whole (relaxed atomics), and holds digest and answer together, so that a reader gets a right answer for its
 * own digest or none; of two rays that are counted at a time one may get lost. A foreign key has the same digest with
 * probability 2^-31. To an estimate it looks the same with probability 2^-20, which costs rays and never bias.
 */
#ifndef VCACHE_TABLE_H
#define VCACHE_TABLE_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct table {
    _Atomic uint32_t *words;
    uint64_t count; /* 1 ... 2^32 */
} table;

_Static_assert(sizeof(_Atomic uint32_t) == 4, "a word of the table is 32 bits");

static inline uint32_t table_load_relaxed(const table *t, uint64_t slot)
{
    return atomic_load_explicit(&t->words[slot], memory_order_relaxed);
}

static inline void table_store_relaxed(table *t, uint64_t slot, uint32_t word)
{
    atomic_store_explicit(&t->words[slot], word, memory_order_relaxed);
}

/* Multiply-shift by the upper half of the key: any count works, not powers of two alone. */
static inline uint64_t table_slot(const table *t, uint64_t key)
{
    return (key >> 32) * t->count >> 32;
}

/* 0: known and blocked, 1: known and visible, more: unknown. So an answer that contradicts `state` is state ^ 1, and no
 * branch on what the table holds is needed to find one: half full tables would mispredict it. */
static inline uint32_t table_look_up(const table *t, uint64_t slot, uint32_t word)
{
    return table_load_relaxed(t, slot) ^ word;
}

static inline void table_prefetch(const table *t, uint64_t slot)
{
#if defined(__GNUC__)
    __builtin_prefetch((const void *)&t->words[slot]);
#else
    (void)t, (void)slot;
#endif
}

/* One cache line of words: 16 lights that are known in advance lie side by side for each eye cell. */
enum { TABLE_LINE = 16 };

static inline uint64_t table_line(const table *t, uint64_t key)
{
    return ((key >> 32) * (t->count / TABLE_LINE) >> 32) * TABLE_LINE;
}

/* The division method of the paper, for its own hashes. */
static inline uint64_t table_slot_modulo(const table *t, uint64_t key)
{
    return (key >> 32) % t->count;
}

/* Word that says "blocked" for this key; or 1 to it for "visible". */
static inline uint32_t table_word(uint64_t key)
{
    uint32_t word = (uint32_t)key & ~1u;
    return word ? word : 2u; /* digest 0 shares with digest 1: 0 means empty */
}

enum { TALLY_BITS = 6, TALLY_MAX = (1 << TALLY_BITS) - 1 };

/* Nothing counted yet for this key. */
static inline uint32_t tally_word(uint64_t key)
{
    return (uint32_t)key >> 2 * TALLY_BITS << 2 * TALLY_BITS;
}

static inline uint32_t tally_visible(uint32_t word)
{
    return word & TALLY_MAX;
}

static inline uint32_t tally_blocked(uint32_t word)
{
    return word >> TALLY_BITS & TALLY_MAX;
}

/* One more ray. A full count halves both, so that old answers fade; where all rays agreed there is nothing to fade. */
static inline uint32_t tally_add(uint32_t word, bool visible)
{
    uint32_t count[2] = {tally_visible(word), tally_blocked(word)}, *mine = &count[!visible], *other = &count[visible];
    if (*mine < TALLY_MAX)
        ++*mine;
    else if (*other > 0)
        *mine = (TALLY_MAX + 1) / 2, *other /= 2;
    return tally_word(word) | count[1] << TALLY_BITS | count[0];
}

#endif
