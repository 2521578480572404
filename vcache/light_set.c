/* SPDX-License-Identifier: Apache-2.0 */
/* Light sets: creation, and Algorithm 2 on rows of bits (light_set.h). */
#include "light_set.h"
#include "worker.h"

#include <math.h>
#include <string.h>

void light_set_place(vcache_light_set *s, uint32_t i)
{
    const vcache_light *l = &s->lights[i];
    /* NaN is never far enough */
    s->x[i] = l->bad ? NAN : l->position[0];
    s->y[i] = l->position[1];
    s->z[i] = l->position[2];
    /* a bypass is !(distance^2 >= side^2): never for directions, always for ends that cannot be quantized */
    s->side_squared[i] = l->bad ? INFINITY : l->side_squared;
}

vcache_status vcache_light_set_create(vcache *cache, const vcache_light *lights, uint32_t count, uint64_t bytes,
                                      vcache_light_set **out, char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!cache || !lights)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "cache or lights are NULL");
    if (count < 1 || count > VCACHE_MAX_SET)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "a light set of %u lights: it must be 1 ... %d", count,
                               VCACHE_MAX_SET);
    uint32_t words = (count + 63) / 64;
    size_t stride = (ROW_BITS + 2 * (size_t)words + 7) / 8 * 8;
    uint64_t rows = bytes / (stride * sizeof(uint64_t));
    if (rows < 1 || rows > UINT32_MAX || bytes > SIZE_MAX / 2)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "bytes is %llu: %u lights take %zu ... 2^32 times that",
                               (unsigned long long)bytes, count, stride * sizeof(uint64_t));
    size_t padded = (size_t)words * 64;
    size_t header = (sizeof(vcache_light_set) + 63) / 64 * 64, ends = (count * sizeof(vcache_light) + 63) / 64 * 64;
    size_t memory = (size_t)rows * stride * sizeof(uint64_t);
    size_t all = memory + header + ends + 4 * padded * sizeof(float);
    const vcache_allocator *a = &cache->config.allocator;
    char *block = a->allocate(a->context, all);
    if (!block)
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for a light set of %llu bytes",
                               (unsigned long long)bytes);
    /* rows first: they want the allocation's alignment */
    vcache_light_set *s = (vcache_light_set *)(void *)(block + memory);
    s->cache = cache;
    s->bytes = all;
    s->count = count;
    s->words = words;
    s->rows = rows;
    s->stride = stride;
    s->memory = (_Atomic uint64_t *)(void *)block;
    s->lights = (vcache_light *)(void *)(block + memory + header);
    s->x = (float *)(void *)(block + memory + header + ends);
    s->y = s->x + padded;
    s->z = s->y + padded;
    s->side_squared = s->z + padded;
    memcpy(s->lights, lights, count * sizeof *lights);
    for (uint32_t i = 0; i < count; i++)
        light_set_place(s, i);
    *out = s;
    return VCACHE_OK;
}

void vcache_light_set_destroy(vcache_light_set **set)
{
    if (!set || !*set)
        return;
    vcache_light_set *s = *set;
    vcache_allocator a = s->cache->config.allocator;
    a.release(a.context, (void *)s->memory, s->bytes);
    *set = NULL;
}

uint64_t vcache_light_set_rows(const vcache_light_set *s)
{
    return s->rows;
}

/* -------------------------------------------------------------------------------------------------------- queries */

step set_walk(const vcache_light_set *set, uint64_t epoch_key, const vcache_eye *eye, uint32_t light, uint32_t level,
              bool coarse)
{
    step s = {.level = level};
    uint64_t bit = (uint64_t)1 << (light % 64), known, visible;
    for (;; s.level++) {
        const eye_level *l = &eye->level[s.level];
        uint64_t row = row_key(epoch_key, l->center);
        s.at = (place){hash_fold(row, hash_words(light, (uintptr_t)set, row)), row};
        s.known = row_read(set, row, light / 64, 1, &known, &visible) && known & bit;
        s.visible = visible & bit;
        if (!s.known || coarse || s.level + 1 == eye->levels)
            return s;
        bool differs = false;
        for (int i = 0; i < 4 && !differs; i++) {
            uint64_t k, v;
            row_read(set, row_key(epoch_key, l->neighbour[i]), light / 64, 1, &k, &v);
            differs = k & (v ^ visible) & bit;
        }
        if (!differs)
            return s;
    }
}

/* Misses in a row of the batch mostly belong to one row of the set, which is opened once for all of them. */
void set_write(vcache_worker *w, uint32_t first, uint32_t end, const vcache_answer *answers)
{
    vcache_light_set *set = w->asking[first].set;
    bool replaced = false, any = false;
    for (uint32_t i = first; i < end; i++)
        any |= !(answers[i] & VCACHE_ONCE);
    if (!any)
        return; /* nothing that would be worth another cell's row */
    _Atomic uint64_t *row = row_open(set, w->places[first].slot, &replaced);
    if (!row)
        return;
    w->statistics.overwritten += replaced;
    for (uint32_t i = first; i < end; i++)
        if (!(answers[i] & VCACHE_ONCE)) {
            row_set(set, row, w->asking[i].bit, answers[i] & VCACHE_VISIBLE);
            w->statistics.stored++;
        }
    row_close(row);
}

static void ask_set(vcache_worker *w, vcache_light_set *set, const vcache_eye *eye, uint32_t base, uint64_t bits,
                    uint32_t level, uint64_t row, const uint64_t *refine, uint64_t *visible)
{
    pair p = {.from.eye = eye, .set = set, .visible = visible, .level = (uint8_t)level};
    for (; bits; bits &= bits - 1) {
        p.bit = base + (uint32_t)count_trailing_zeros(bits);
        p.to.light = &set->lights[p.bit];
        p.coarse = refine && !(refine[p.bit / 64] >> p.bit % 64 & 1u);
        if (level == NO_LEVEL)
            worker_add_miss(w, &p, (place){0});
        else
            worker_ask(w, &p, (place){hash_fold(row, hash_words(p.bit, (uintptr_t)set, row)), row});
    }
}

static void verify_set(vcache_worker *w, vcache_light_set *set, const vcache_eye *eye, uint32_t base, uint64_t bits,
                       uint32_t level, uint64_t said, uint64_t *visible)
{
    pair p = {.from.eye = eye, .set = set, .visible = visible};
    for (; bits; bits &= bits - 1) {
        uint32_t i = (uint32_t)count_trailing_zeros(bits);
        p.bit = base + i;
        p.to.light = &set->lights[p.bit];
        worker_verify(w, &p, level, said >> i & 1u);
    }
}

/* Words of one pass: rows are copied to the stack in pieces of this size. */
enum { PIECE = 16 };

/* Algorithm 2 for up to PIECE words of lights at a time. `rest`: who is still on the way. */
static void add_rows(vcache_worker *w, vcache_light_set *set, const vcache_eye *eye, uint64_t epoch_key, uint32_t first,
                     uint32_t count, uint64_t rest[PIECE], const uint64_t *refine, uint64_t *visible)
{
    for (uint32_t d = 0; d < eye->levels; d++) {
        const eye_level *l = &eye->level[d];
        const uint64_t half[5] = {l->center, l->neighbour[0], l->neighbour[1], l->neighbour[2], l->neighbour[3]};
        uint64_t known[5][PIECE], seen[5][PIECE], any = 0, keys[5];
        int cells = d + 1 < eye->levels ? 5 : 1;
        for (int k = 0; k < cells; k++) {
            keys[k] = row_key(epoch_key, half[k]);
            row_prefetch(set, keys[k], first, count);
        }
        for (int k = 0; k < cells; k++)
            row_read(set, keys[k], first, count, known[k], seen[k]);
        uint64_t found[PIECE], missing[PIECE], hits = 0;
        const uint64_t *const have[5] = {known[0], known[1], known[2], known[3], known[4]};
        const uint64_t *const look[5] = {seen[0], seen[1], seen[2], seen[3], seen[4]};
        w->cache->kernels->decide(count, (uint32_t)cells, have, look, rest, found, missing, rest);
        for (uint32_t i = 0; i < count; i++) {
            if (refine) { /* good enough as they are */
                found[i] |= rest[i] & ~refine[first + i];
                rest[i] &= refine[first + i];
            }
            hits += count_ones(found[i]);
            visible[first + i] = (visible[first + i] & ~found[i]) | (found[i] & seen[0][i]);
            any |= rest[i];
            if (w->config.verify)
                verify_set(w, set, eye, 64 * (first + i), found[i], d, seen[0][i], visible);
            if (missing[i])
                ask_set(w, set, eye, 64 * (first + i), missing[i], d, keys[0], refine, visible);
        }
        w->statistics.hits[d] += hits;
        w->statistics.hit_levels |= (uint32_t)(hits != 0) << d;
        if (!any)
            return;
    }
}

uint32_t vcache_add_set(vcache_worker *w, const vcache_eye *eye, vcache_light_set *set, uint32_t first,
                        const uint64_t *asked, uint64_t *visible)
{
    return vcache_add_set_refining(w, eye, set, first, asked, NULL, visible);
}

uint32_t vcache_add_set_refining(vcache_worker *w, const vcache_eye *eye, vcache_light_set *set, uint32_t first,
                                 const uint64_t *asked, const uint64_t *refine, uint64_t *visible)
{
    uint64_t epoch_key = worker_epoch(w);
    while (first < set->count) {
        uint32_t start = first / 64, words = 0, room = worker_room(w);
        uint64_t rest[PIECE];
        bool full = false;
        for (; words < PIECE && start + words < set->words && !full; words++) {
            uint32_t base = 64 * (start + words), end = set->count - base < 64 ? set->count - base : 64;
            uint64_t word = asked ? asked[start + words] : ~(uint64_t)0;
            word &= ~(uint64_t)0 >> (64 - end);
            if (first > base)
                word &= ~(uint64_t)0 << (first - base);
            rest[words] = worker_take(word, &room, base, end, &first);
            full = first < base + end;
            w->statistics.asked += count_ones(rest[words]);
        }
        /* Lights nearer to the eye end than a cell, or that cannot be quantized. */
        uint64_t near[PIECE];
        bool all = w->config.exact || eye->levels == 0;
        const light_places places = {set->x + 64 * start, set->y + 64 * start, set->z + 64 * start,
                                     set->side_squared + 64 * start};
        if (!all)
            w->cache->kernels->near(&places, eye->position, eye->side_squared, words, near);
        for (uint32_t i = 0; i < words; i++) {
            uint64_t exact = all ? rest[i] : rest[i] & near[i];
            if (exact)
                ask_set(w, set, eye, 64 * (start + i), exact, NO_LEVEL, 0, NULL, visible);
            rest[i] &= ~exact;
        }
        add_rows(w, set, eye, epoch_key, start, words, rest, refine, visible);
        if (full)
            break;
    }
    return first;
}
