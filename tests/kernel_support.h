/* SPDX-License-Identifier: Apache-2.0 */
/* What the tests of kernels need: arrays that end where something notices, odd numbers, comparison bit for bit. */
#ifndef TESTS_KERNEL_SUPPORT_H
#define TESTS_KERNEL_SUPPORT_H

#define _DEFAULT_SOURCE /* MAP_ANONYMOUS */

#include "../vcache/light_set.h"
#include "support.h"

#include <sys/mman.h>
#include <unistd.h>

/* ----------------------------------------------------------------------------------------------------- exact arrays */

/* All that was handed out since arena_empty. */
static struct {
    struct {
        void *memory;
        size_t mapped; /* 0: malloc */
    } block[64];
    int count;
} arena;

/* `how` 0: on the heap, four or eight bytes off alignment, the end known to the address sanitizer. 1: the end is that
 * of a page behind which there is none, for what sanitizers do not see. */
static inline void *arena_bytes(size_t bytes, size_t element, int how)
{
    assert_true(arena.count < 64);
    if (how == 0) {
        char *p = malloc(bytes + element);
        assert_non_null(p);
        arena.block[arena.count].memory = p, arena.block[arena.count++].mapped = 0;
        return p + element;
    }
    size_t page = (size_t)sysconf(_SC_PAGESIZE), whole = (bytes + page - 1) / page * page;
    char *p = mmap(NULL, whole + page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    assert_true(p != MAP_FAILED && mprotect(p + whole, page, PROT_NONE) == 0);
    arena.block[arena.count].memory = p, arena.block[arena.count++].mapped = whole + page;
    return p + whole - bytes;
}

static inline float *arena_floats(size_t count, int how)
{
    return arena_bytes(count * sizeof(float), sizeof(float), how);
}

static inline uint64_t *arena_words(size_t count, int how)
{
    return arena_bytes(count * sizeof(uint64_t), sizeof(uint64_t), how);
}

static inline void arena_empty(void)
{
    for (; arena.count > 0; arena.count--) {
        void *p = arena.block[arena.count - 1].memory;
        if (arena.block[arena.count - 1].mapped)
            munmap(p, arena.block[arena.count - 1].mapped);
        else
            free(p);
    }
}

/* ------------------------------------------------------------------------------------------------------ random input
 */

static inline uint32_t float_bits(float f)
{
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

/* Every kind of number, in half of the cases any bit pattern at all. */
static inline float odd_float(uint64_t *seed)
{
    static const float odd[] = {
        0.0f,      -0.0f,  1.0f,  -1.0f,         0.25f,          0x1p-149f, -0x1p-149f, 0x1.fffffcp-127f,
        0x1p-126f, 1e-30f, 1e30f, 3.4028235e38f, -3.4028235e38f, INFINITY,  -INFINITY,  NAN};
    uint64_t r = random_bits(seed);
    if (r & 1)
        return odd[r >> 8 & 15];
    uint32_t bits = (uint32_t)(r >> 32);
    float f;
    memcpy(&f, &bits, sizeof f);
    return r & 2 ? f : (float)random_between(seed, -2.0, 2.0);
}

/* Bits set with a share of 1/8, 1/2 or 7/8. */
static inline uint64_t *random_words(uint64_t *seed, uint32_t count, int how)
{
    uint64_t *w = arena_words(count, how), share = random_bits(seed) % 3;
    for (uint32_t i = 0; i < count; i++) {
        uint64_t a = random_bits(seed), b = random_bits(seed), c = random_bits(seed);
        w[i] = share == 0 ? a & b & c : share == 1 ? a : a | b | c;
    }
    return w;
}

/* ------------------------------------------------------------------------------------------------------- comparison */

static inline void same_words(const char *what, const char *isa, uint32_t words, const uint64_t *expected,
                              const uint64_t *got)
{
    for (uint32_t i = 0; i < 64 * words; i++)
        if ((expected[i / 64] ^ got[i / 64]) >> i % 64 & 1)
            fail_msg("%s, %s: word %u of %u, light %u: %d, scalar %d", what, isa, i / 64, words, i,
                     (int)(got[i / 64] >> i % 64 & 1), (int)(expected[i / 64] >> i % 64 & 1));
}

/* One NaN is as good as another: which of two comes out is the processor's choice. */
static inline void same_floats(const char *what, const char *isa, uint32_t words, size_t count, const float *expected,
                               const float *got)
{
    for (size_t i = 0; i < count; i++)
        if (float_bits(expected[i]) != float_bits(got[i]) && !(isnan(expected[i]) && isnan(got[i])))
            fail_msg("%s, %s: %u words, element %zu: %a, scalar %a", what, isa, words, i, (double)got[i],
                     (double)expected[i]);
}

#endif
