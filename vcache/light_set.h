/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Rows of light bits: what one eye cell sees of a set of lights lies side by side.
 *
 *     version | key | known, 1 bit a light | visible, 1 bit a light      (64-bit words)
 *
 * known, visible: 0 0 unknown, 1 0 seen blocked, 1 1 seen visible, 0 1 seen both ways (vcache_learn alone; unknown to
 * everyone else).
 *
 * What races: a row may be read while another thread writes or replaces it. The version is odd while it is written;
 * a reader copies the row and takes it only where the version was even before and the same after (a sequence lock), so
 * it never sees bits of one cell under the key of another. A writer that finds the row taken gives up: the bit is
 * lost and will be traced again. Nobody waits. Words are written with release and read with acquire so that whoever
 * sees a new word sees the odd version as well.
 */
#ifndef VCACHE_LIGHT_SET_H
#define VCACHE_LIGHT_SET_H

#include "internal.h"

enum { ROW_VERSION, ROW_KEY, ROW_BITS };

struct vcache_light_set {
    vcache *cache;
    size_t bytes;
    uint32_t count, words; /* lights; 64-bit words of a row of bits */
    uint64_t rows;
    size_t stride; /* words from row to row, whole cache lines */
    _Atomic uint64_t *memory;
    vcache_light *lights;
    float *x, *y, *z, *side_squared; /* of the lights, for bypasses; padded to whole words */
};

/* light_set.c: copies where light i is to the arrays that the kernels read. */
void light_set_place(vcache_light_set *s, uint32_t i);

/* estimate.c */
/* `share`: visible rays by state; NULL: what is expected at first. */
void predict_states(vcache_drawing drawing, const float share[STATES], float states[STATES]);

static inline uint64_t row_key(uint64_t epoch_key, uint64_t half)
{
    uint64_t key = hash_fold(half ^ epoch_key, 0x9fb21c651e98df25u);
    return key ? key : 1; /* 0: empty */
}

static inline _Atomic uint64_t *row_of(const vcache_light_set *s, uint64_t key)
{
    return s->memory + ((key >> 32) * s->rows >> 32) * s->stride;
}

/* The row's head, and `count` words of known and visible bits from word `first` on. */
static inline void row_prefetch(const vcache_light_set *s, uint64_t key, uint32_t first, uint32_t count)
{
#if defined(__GNUC__)
    const _Atomic uint64_t *row = row_of(s, key), *bits = row + ROW_BITS + first;
    __builtin_prefetch((const void *)row);
    for (size_t i = 0; i < count + 7; i += 8) {
        size_t at = i < count ? i : count - 1;
        __builtin_prefetch((const void *)(bits + at));
        __builtin_prefetch((const void *)(bits + s->words + at));
    }
#else
    (void)s, (void)key, (void)first, (void)count;
#endif
}

/* Copies `count` words of known and visible bits from word `first` on; false, and nothing known, where the row is
 * another's or being written. */
static inline bool row_read(const vcache_light_set *s, uint64_t key, uint32_t first, uint32_t count, uint64_t *known,
                            uint64_t *visible)
{
    _Atomic uint64_t *row = row_of(s, key);
    uint64_t version = atomic_load_explicit(&row[ROW_VERSION], memory_order_acquire);
    bool whole = !(version & 1) && atomic_load_explicit(&row[ROW_KEY], memory_order_acquire) == key;
    if (whole) {
        for (uint32_t w = 0; w < count; w++) {
            known[w] = atomic_load_explicit(&row[ROW_BITS + first + w], memory_order_acquire);
            visible[w] = atomic_load_explicit(&row[ROW_BITS + s->words + first + w], memory_order_acquire);
        }
        whole = atomic_load_explicit(&row[ROW_VERSION], memory_order_relaxed) == version;
    }
    if (!whole)
        for (uint32_t w = 0; w < count; w++)
            known[w] = visible[w] = 0;
    return whole;
}

/* Opens the row for writing, replacing another cell's; NULL where another thread has it. */
static inline _Atomic uint64_t *row_open(const vcache_light_set *s, uint64_t key, bool *replaced)
{
    _Atomic uint64_t *row = row_of(s, key);
    uint64_t version = atomic_load_explicit(&row[ROW_VERSION], memory_order_relaxed);
    if (version & 1 || !atomic_compare_exchange_strong_explicit(&row[ROW_VERSION], &version, version + 1,
                                                                memory_order_acquire, memory_order_relaxed))
        return NULL;
    uint64_t old = atomic_load_explicit(&row[ROW_KEY], memory_order_relaxed);
    *replaced = old != key && old != 0;
    if (old != key) {
        atomic_store_explicit(&row[ROW_KEY], key, memory_order_release);
        for (uint32_t w = 0; w < 2 * s->words; w++)
            atomic_store_explicit(&row[ROW_BITS + w], 0, memory_order_release);
    }
    return row;
}

static inline void row_set(const vcache_light_set *s, _Atomic uint64_t *row, uint32_t light, bool visible)
{
    _Atomic uint64_t *known = &row[ROW_BITS + light / 64], *seen = known + s->words;
    uint64_t bit = (uint64_t)1 << (light % 64), old = atomic_load_explicit(seen, memory_order_relaxed);
    atomic_store_explicit(seen, visible ? old | bit : old & ~bit, memory_order_release);
    old = atomic_load_explicit(known, memory_order_relaxed);
    atomic_store_explicit(known, old | bit, memory_order_release);
}

/* Of 64 lights. */
typedef struct light_states {
    uint64_t known, visible;
} light_states;

static inline light_states row_states(const vcache_light_set *s, const _Atomic uint64_t *row, uint32_t word)
{
    const _Atomic uint64_t *known = &row[ROW_BITS + word];
    return (light_states){atomic_load_explicit(known, memory_order_relaxed),
                          atomic_load_explicit(known + s->words, memory_order_relaxed)};
}

static inline void row_store(const vcache_light_set *s, _Atomic uint64_t *row, uint32_t word, light_states to)
{
    _Atomic uint64_t *known = &row[ROW_BITS + word];
    atomic_store_explicit(known + s->words, to.visible, memory_order_release);
    atomic_store_explicit(known, to.known, memory_order_release);
}

static inline void row_close(_Atomic uint64_t *row)
{
    uint64_t version = atomic_load_explicit(&row[ROW_VERSION], memory_order_relaxed);
    atomic_store_explicit(&row[ROW_VERSION], version + 1, memory_order_release);
}

#endif
