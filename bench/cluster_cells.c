/* SPDX-License-Identifier: Apache-2.0 */
/* Clusters by cell: average visibility (Eq. 12), and what hashing makes of their keys (Sect. 4.1). */
#include "clusters.h"

#include <stdio.h>
#include <string.h>

enum { BINS = 10 };

vcache_config clusters_config(const grid_policy *p)
{
    vcache_config config = vcache_default_config();
    config.levels = 1;
    config.normal_bins = p->normal_bins ? p->normal_bins : config.normal_bins;
    config.layers = p->layers ? p->layers : config.layers;
    config.resolution_step = p->step > 0.0f ? p->step : config.resolution_step;
    return config;
}

uint32_t clusters_of_eyes(const record *r, const grid_policy *p, uint32_t **out_start, uint32_t **out_eyes)
{
    vcache *cache = record_cache(r, clusters_config(p));
    cells known;
    cells_new(&known, 1);
    uint32_t *of = xmalloc((r->count + 1) * sizeof *of), *order = xmalloc((r->count + 1) * sizeof *order);
    for (uint32_t i = 0; i < r->count; i++) {
        _Alignas(8) char memory[VCACHE_EYE_BYTES];
        vcache_eye *end = (vcache_eye *)(void *)memory;
        vcache_surface at = record_surface(r, i);
        vcache_prepare_eye(cache, &at, p->ce, 0, end);
        of[i] = end->levels ? cells_add(&known, end->level[0].center) : NO_CELL;
    }
    record_sort(r, p->order, (double)p->ce / sqrt(r->view.settings.spp), order);
    uint32_t *start = xcalloc(known.count + 2, sizeof *start), *eyes = xmalloc((r->count + 1) * sizeof *eyes);
    for (uint32_t i = 0; i < r->count; i++)
        if (of[i] != NO_CELL)
            start[of[i] + 2]++;
    for (uint32_t c = 1; c < known.count + 2; c++)
        start[c] += start[c - 1];
    for (uint32_t i = 0; i < r->count; i++)
        if (of[order[i]] != NO_CELL)
            eyes[start[of[order[i]] + 1]++] = order[i];
    uint32_t count = known.count;
    free(of);
    free(order);
    cells_free(&known);
    vcache_destroy(&cache);
    *out_start = start;
    *out_eyes = eyes;
    return count;
}

/* Of one light in the cell at hand. */
typedef struct tally {
    uint32_t pairs, visible, wrong;
    bool first; /* what the first pair saw */
} tally;

typedef struct bin {
    double pairs, clusters, visible, answered_visible, wrong, wrong_refined, expected;
} bin;

static void add_cell(bin bins[BINS], const tally *t, uint32_t lights)
{
    for (uint32_t i = 0; i < lights; i++) {
        if (t[i].pairs == 0)
            continue;
        double n = t[i].pairs, v = t[i].visible / n;
        bin *b = &bins[v < 1.0 ? (int)(v * BINS) : BINS - 1];
        b->pairs += n;
        b->clusters += 1.0;
        b->visible += t[i].visible;
        b->answered_visible += t[i].first ? n : 0.0;
        b->wrong += t[i].first ? n - t[i].visible : t[i].visible;
        b->wrong_refined += t[i].wrong;
        b->expected += n * 2.0 * v * (1.0 - v);
    }
}

void print_visibility(const record *r, const grid_policy *p, const replay_bits *bits)
{
    bin bins[BINS] = {{0}};
    double pure = 0.0, all = 0.0;
    uint32_t *start, *eyes, count = clusters_of_eyes(r, p, &start, &eyes);
    tally *t = xcalloc(r->padded, sizeof *t);
    for (uint32_t c = 0; c < count; c++) {
        memset(t, 0, r->padded * sizeof *t);
        for (uint32_t k = start[c]; k < start[c + 1]; k++) {
            uint32_t e = eyes[k];
            for (uint32_t w = 0; w < r->words; w++)
                for (uint64_t met = bits->clustered[(size_t)e * r->words + w]; met; met &= met - 1) {
                    uint32_t i = 64 * w + (uint32_t)__builtin_ctzll(met);
                    bool visible = clusters_bit(r->visible, r, e, i);
                    t[i].first = t[i].pairs ? t[i].first : visible;
                    t[i].pairs++;
                    t[i].visible += visible;
                    t[i].wrong += clusters_bit(bits->wrong, r, e, i);
                }
        }
        for (uint32_t i = 0; i < r->padded; i++) {
            all += t[i].pairs;
            pure += t[i].visible == 0 || t[i].visible == t[i].pairs ? t[i].pairs : 0;
        }
        add_cell(bins, t, r->padded);
    }
    printf("\"pure\": %.6g, \"visibility\": [", all > 0.0 ? pure / all : 0.0);
    for (int i = 0, n = 0; i < BINS; i++) {
        const bin *b = &bins[i];
        if (b->pairs > 0.0)
            printf("%s{\"v\": %.6g, \"pairs\": %.0f, \"clusters\": %.0f, \"visible\": %.6g, \"expected\": %.6g, "
                   "\"unrefined\": %.6g, \"refined\": %.6g}",
                   n++ ? ", " : "", b->visible / b->pairs, b->pairs, b->clusters, b->answered_visible / b->pairs,
                   b->expected / b->pairs, b->wrong / b->pairs, b->wrong_refined / b->pairs);
    }
    printf("]");
    free(t);
    free(start);
    free(eyes);
}

/* ---------------------------------------------------------------------------------------------------------- hashing */

typedef struct hashed {
    uint64_t place, truth; /* slot and digest; the pair itself */
} hashed;

static int by_place(const void *a, const void *b)
{
    const hashed *x = a, *y = b;
    return x->place != y->place ? (x->place > y->place) - (x->place < y->place)
                                : (x->truth > y->truth) - (x->truth < y->truth);
}

typedef struct light_ends {
    vcache_light *split, *other;
} light_ends;

static light_ends ends_of_lights(const record *r, const vcache *split, const vcache *other)
{
    const vpl_set *l = &r->lights;
    light_ends e = {xcalloc(r->padded, sizeof *e.split), xcalloc(r->padded, sizeof *e.other)};
    for (uint32_t i = 0; i < l->count; i++) {
        vcache_surface at = {.position = {l->x[i], l->y[i], l->z[i]},
                             .normal = {l->gx[i], l->gy[i], l->gz[i]},
                             .density = l->density[i]};
        vcache_prepare_patch(split, &at, &e.split[i]);
        vcache_prepare_patch(other, &at, &e.other[i]);
    }
    return e;
}

/* All pairs of a cell that its eye samples ask for. */
static size_t hash_cell(const record *r, const vcache *other, const light_ends *e, uint64_t half, uint64_t half_split,
                        const uint64_t *asked, uint64_t words, hashed *out)
{
    vcache_hash family = other->config.hash;
    table t = {NULL, words};
    size_t n = 0;
    for (uint32_t i = 0; i < r->lights.count; i++) {
        if (!(asked[i / 64] >> i % 64 & 1u) || e->split[i].bad)
            continue;
        uint64_t key = pair_key(family, 0, half, &e->other[i]);
        uint64_t slot = family == VCACHE_HASH_SPLIT ? table_slot(&t, key) : table_slot_modulo(&t, key);
        out[n++] = (hashed){slot << 32 | table_word(key), hash_fold(half_split, e->split[i].key.hash)};
    }
    return n;
}

static void print_sorted(hashed *all, size_t n, uint64_t words)
{
    size_t distinct = 0, slots = 0, merged = 0;
    qsort(all, n, sizeof *all, by_place);
    for (size_t i = 0; i < n; i++) {
        bool place = i == 0 || all[i].place != all[i - 1].place;
        if (!place && all[i].truth == all[i - 1].truth)
            continue; /* lights of one cell */
        distinct++;
        merged += !place;
        slots += i == 0 || all[i].place >> 32 != all[i - 1].place >> 32;
    }
    double random = (double)words * -expm1(-(double)distinct / (double)words);
    printf(", \"hash\": {\"words\": %llu, \"distinct\": %zu, \"merged\": %zu, \"merged_share\": %.6g, \"slots\": %zu, "
           "\"expected\": %.0f, \"slots_share\": %.6g}",
           (unsigned long long)words, distinct, merged, distinct ? (double)merged / (double)distinct : 0.0, slots,
           random, random > 0.0 ? (double)slots / random : 0.0);
}

void print_hash(const record *r, const grid_policy *p, const replay_bits *bits, vcache_hash family, uint64_t words)
{
    vcache_config config = clusters_config(p);
    vcache *split = record_cache(r, config);
    config.hash = family;
    vcache *other = record_cache(r, config);
    light_ends e = ends_of_lights(r, split, other);
    uint32_t *start, *eyes, count = clusters_of_eyes(r, p, &start, &eyes);
    uint64_t *asked = xcalloc(r->words, sizeof *asked);
    hashed *all = NULL;
    size_t n = 0, capacity = 0;
    for (uint32_t c = 0; c < count; c++) {
        memset(asked, 0, r->words * sizeof *asked);
        for (uint32_t k = start[c]; k < start[c + 1]; k++)
            for (uint32_t w = 0; w < r->words; w++)
                asked[w] |= bits->clustered[(size_t)eyes[k] * r->words + w];
        if (n + r->padded > capacity)
            all = xrealloc(all, (capacity = 2 * (n + r->padded)) * sizeof *all);
        _Alignas(8) char memory[2][VCACHE_EYE_BYTES];
        vcache_surface at = record_surface(r, eyes[start[c]]);
        vcache_eye *own = (vcache_eye *)(void *)memory[0], *pure = (vcache_eye *)(void *)memory[1];
        vcache_prepare_eye(other, &at, p->ce, 0, own);
        vcache_prepare_eye(split, &at, p->ce, 0, pure);
        n += hash_cell(r, other, &e, own->level[0].center, pure->level[0].center, asked, words, all + n);
    }
    print_sorted(all, n, words);
    free(all);
    free(asked);
    free(start);
    free(eyes);
    free(e.split);
    free(e.other);
    vcache_destroy(&split);
    vcache_destroy(&other);
}
