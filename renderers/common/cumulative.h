/* SPDX-License-Identifier: Apache-2.0 */
/* Tables for drawing by inversion that are too large for the caches: which of many intervals holds a number in [0, 1).
 */
#ifndef COMMON_CUMULATIVE_H
#define COMMON_CUMULATIVE_H

#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#if defined(__linux__)
#include <sys/mman.h>
#endif

enum {
    CUMULATIVE_LINE = 16, /* floats in a cache line */
    CUMULATIVE_LEVELS = 8 /* enough for any count of 32 bits */
};

/* Where each of `count` intervals ends, and above it where each line of them ends, up to one line. Upper levels stay in
 * the caches; each level costs one line, in which the place is counted. Several such tables, of one count, lie side by
 * side. */
typedef struct cumulative {
    float *level[CUMULATIVE_LEVELS];   /* 0: the ends of the intervals */
    uint32_t lines[CUMULATIVE_LEVELS]; /* a table, filled up with ones */
    uint32_t levels, count;
} cumulative;

/* Zeroed; NULL where memory is short. Large tables are read all over: in huge pages, where the system has some to give,
 * addresses are found faster. */
static inline void *table_new(size_t count, size_t bytes)
{
#if defined(MADV_HUGEPAGE)
    const size_t page = (size_t)1 << 21;
    void *p;
    if (count * bytes > 2 * page) {
        if (posix_memalign(&p, page, count * bytes))
            return NULL;
        madvise(p, count * bytes, MADV_HUGEPAGE);
        return memset(p, 0, count * bytes);
    }
#endif
    return calloc(count, bytes);
}

static inline bool cumulative_new(cumulative *c, uint32_t count, uint32_t tables)
{
    bool good = true;
    c->count = count;
    c->levels = 0;
    for (uint32_t n = count; c->levels == 0 || n > 1; c->levels++) {
        n = (n - 1) / CUMULATIVE_LINE + 1;
        c->lines[c->levels] = n;
        c->level[c->levels] = table_new((size_t)n * tables * CUMULATIVE_LINE, sizeof(float));
        good &= c->level[c->levels] != NULL;
    }
    return good;
}

static inline void cumulative_free(cumulative *c)
{
    for (uint32_t l = 0; l < c->levels; l++)
        free(c->level[l]);
}

static inline float *cumulative_at(const cumulative *c, uint32_t level, uint32_t table, uint32_t line)
{
    return c->level[level] + ((size_t)table * c->lines[level] + line) * CUMULATIVE_LINE;
}

/* After the ends of a table's intervals stand in level 0; the last one is set to 1. */
static inline void cumulative_finish(const cumulative *c, uint32_t table)
{
    uint32_t filled = c->count - 1;
    for (uint32_t l = 0; l < c->levels; l++) {
        float *ends = cumulative_at(c, l, table, 0);
        for (uint32_t i = filled; i < c->lines[l] * CUMULATIVE_LINE; i++)
            ends[i] = 1.0f;
        filled = c->lines[l];
        for (uint32_t i = 0; l + 1 < c->levels && i < filled; i++)
            cumulative_at(c, l + 1, table, 0)[i] = ends[i * CUMULATIVE_LINE + CUMULATIVE_LINE - 1];
    }
}

/* From the line of a level that holds u < 1 to the entry that does: the line of the level below, or the interval. */
static inline uint32_t cumulative_step(const cumulative *c, uint32_t level, uint32_t table, uint32_t line, float u)
{
    const float *ends = cumulative_at(c, level, table, line);
    uint32_t k = 0;
    for (uint32_t i = 0; i < CUMULATIVE_LINE; i++)
        k += ends[i] <= u;
    return line * CUMULATIVE_LINE + k;
}

/* The place of u in an interval that holds it, which is never empty. */
static inline float cumulative_inside(const cumulative *c, uint32_t table, uint32_t interval, float u)
{
    const float *ends = cumulative_at(c, 0, table, 0);
    float start = interval > 0 ? ends[interval - 1] : 0.0f;
    return (u - start) / (ends[interval] - start);
}

#endif
