/* SPDX-License-Identifier: Apache-2.0 */
/* Queries of the table of words: Algorithm 2 for one pair and for many lights at a time. */
#include "worker.h"

/* True where the cells say too little about this pair: ends nearer to each other than a cell (contacts and corners
 * would leak), ends that cannot be quantized. */
static inline bool bypasses(const vcache_eye *eye, const vcache_light *light)
{
    if (eye->levels == 0 || light->bad)
        return true;
    if (light->side_squared < 0.0f)
        return false;
    float side = eye->side_squared > light->side_squared ? eye->side_squared : light->side_squared;
    return !(distance_squared(eye->position, light->position) >= side);
}

static inline place find_place(const vcache *c, vcache_hash family, uint64_t epoch_key, uint64_t half,
                               const vcache_light *light)
{
    place p = {.key = pair_key(family, epoch_key, half, light)};
    if (light->lane == LANE_NONE)
        p.slot = pair_slot(c, family, p.key);
    else
        p.slot = pair_line(c, epoch_key, half, light->key.line) + light->lane;
    return p;
}

/* Algorithm 2 from `level` on: down while one of the known neighbours differs. */
static inline step walk(const vcache *c, vcache_hash family, uint64_t epoch_key, const vcache_eye *eye,
                        const vcache_light *light, uint32_t level)
{
    step s = {.level = level};
    for (;; s.level++) {
        const eye_level *l = &eye->level[s.level];
        s.at = find_place(c, family, epoch_key, l->center, light);
        uint32_t state = table_look_up(&c->table, s.at.slot, table_word(s.at.key)), differs = 0;
        s.known = state <= 1;
        s.visible = state & 1u;
        if (!s.known || s.level + 1 == eye->levels)
            return s;
        for (int i = 0; i < 4; i++) {
            place at = find_place(c, family, epoch_key, l->neighbour[i], light);
            differs |= table_look_up(&c->table, at.slot, table_word(at.key)) == (state ^ 1u);
        }
        if (!differs)
            return s;
    }
}

step table_walk(const vcache *c, uint64_t epoch_key, const vcache_eye *eye, const vcache_light *light, uint32_t level)
{
    return walk(c, c->config.hash, epoch_key, eye, light, level);
}

void table_write(vcache_worker *w, place at, bool visible)
{
    vcache *c = w->cache;
    uint32_t word = table_word(at.key), old = table_load_relaxed(&c->table, at.slot);
    w->statistics.stored++;
    w->statistics.overwritten += old != 0 && (old & ~1u) != word;
    table_store_relaxed(&c->table, at.slot, word | (uint32_t)visible);
}

/* What pass one of a block finds out about a pair of cells. Slots fit 32 bits: there are at most 2^32. */
typedef struct spot {
    uint32_t slot, word;
} spot;

static inline spot spot_of(const vcache *c, vcache_hash family, uint64_t key)
{
    return (spot){(uint32_t)pair_slot(c, family, key), table_word(key)};
}

/* Up to 64 lights: the walk of Algorithm 2 over all of them at a time, so that their words come from memory side by
 * side and not one after the other, and without a branch on what they hold. Nearly all pairs end in the first level;
 * the others go on one by one. `cells`: 5, or 1 where neighbours do not matter; constant in each copy of this loop. */
static inline void add_block(vcache_worker *w, vcache_hash family, int cells, uint64_t epoch_key, const vcache_eye *eye,
                             const vcache_light *lights, uint32_t base, uint64_t asked, uint64_t *visible)
{
    const vcache *c = w->cache;
    const table *t = &c->table;
    const eye_level *l = &eye->level[0];
    const uint64_t half[5] = {l->center, l->neighbour[0], l->neighbour[1], l->neighbour[2], l->neighbour[3]};
    spot at[5][64];
    uint64_t exact = w->config.exact ? asked : 0, line = 0, start[5] = {0};
    uint8_t last_lane = LANE_NONE;
    for (uint64_t bits = asked & ~exact; bits; bits &= bits - 1) {
        uint32_t i = (uint32_t)count_trailing_zeros(bits);
        const vcache_light *light = &lights[base + i];
        if (bypasses(eye, light)) {
            exact |= (uint64_t)1 << i;
            continue;
        }
        uint8_t lane = light->lane;
        if (lane == LANE_NONE) {
            for (int k = 0; k < cells; k++) {
                at[k][i] = spot_of(c, family, pair_key(family, epoch_key, half[k], light));
                table_prefetch(t, at[k][i].slot);
            }
        } else {
            if (last_lane == LANE_NONE || line != light->key.line) {
                line = light->key.line;
                for (int k = 0; k < cells; k++) {
                    start[k] = pair_line(c, epoch_key, half[k], line);
                    table_prefetch(t, start[k]);
                }
            }
            for (int k = 0; k < cells; k++)
                at[k][i] = (spot){(uint32_t)start[k] + lane, table_word(pair_key(family, epoch_key, half[k], light))};
        }
        last_lane = lane;
    }
    pair p = {.from.eye = eye, .visible = visible};
    for (uint64_t bits = exact; bits; bits &= bits - 1) {
        p.bit = base + (uint32_t)count_trailing_zeros(bits);
        p.to.light = &lights[p.bit];
        p.level = NO_LEVEL;
        worker_add_miss(w, &p, (place){0});
    }
    uint64_t yes = 0, missing = 0, differs = 0, rest = asked & ~exact;
    for (uint64_t bits = rest; bits; bits &= bits - 1) {
        uint32_t i = (uint32_t)count_trailing_zeros(bits);
        uint32_t state = table_look_up(t, at[0][i].slot, at[0][i].word), other = 0;
        for (int k = 1; k < cells; k++)
            other |= table_look_up(t, at[k][i].slot, at[k][i].word) == (state ^ 1u);
        yes |= (uint64_t)(state & 1u) << i;
        missing |= (uint64_t)(state > 1u) << i;
        differs |= (uint64_t)other << i;
    }
    for (uint64_t bits = missing | differs; bits; bits &= bits - 1) {
        uint32_t i = (uint32_t)count_trailing_zeros(bits);
        p.bit = base + i;
        p.to.light = &lights[p.bit];
        p.level = 0;
        if (missing >> i & 1u)
            worker_ask(w, &p, find_place(c, family, epoch_key, l->center, p.to.light));
        else
            worker_finish(w, &p, walk(c, family, epoch_key, eye, p.to.light, 1));
    }
    uint64_t found = rest & ~(missing | differs);
    w->statistics.hits[0] += count_ones(found);
    w->statistics.hit_levels |= found != 0;
    visible[base / 64] = (visible[base / 64] & ~found) | (yes & found);
    for (uint64_t bits = w->config.verify ? found : 0; bits; bits &= bits - 1) {
        uint32_t i = (uint32_t)count_trailing_zeros(bits);
        p.bit = base + i;
        p.to.light = &lights[p.bit];
        worker_verify(w, &p, 0, yes >> i & 1u);
    }
}

static inline uint32_t add_family(vcache_worker *w, vcache_hash family, const vcache_eye *eye,
                                  const vcache_light *lights, uint32_t first, uint32_t count, const uint64_t *asked,
                                  uint64_t *visible)
{
    uint64_t epoch_key = worker_epoch(w);
    while (first < count) {
        uint32_t base = first & ~63u, end = count - base < 64 ? count - base : 64;
        uint64_t word = asked ? asked[base / 64] : ~(uint64_t)0;
        word &= ~(uint64_t)0 << (first - base);
        word &= ~(uint64_t)0 >> (64 - end);
        uint32_t room = worker_room(w);
        word = worker_take(word, &room, base, end, &first);
        w->statistics.asked += count_ones(word);
        if (word && eye->levels > 1)
            add_block(w, family, 5, epoch_key, eye, lights, base, word, visible);
        else if (word)
            add_block(w, family, 1, epoch_key, eye, lights, base, word, visible);
        if (first < base + end)
            break;
    }
    return first;
}

uint32_t vcache_add(vcache_worker *w, const vcache_eye *eye, const vcache_light *lights, uint32_t first, uint32_t count,
                    const uint64_t *asked, uint64_t *visible)
{
    /* one copy of the loop per family: the choice must not stand inside it */
    switch (w->cache->config.hash) {
    case VCACHE_HASH_SPLIT:
        return add_family(w, VCACHE_HASH_SPLIT, eye, lights, first, count, asked, visible);
    case VCACHE_HASH_LCG_PAIR:
        return add_family(w, VCACHE_HASH_LCG_PAIR, eye, lights, first, count, asked, visible);
    case VCACHE_HASH_LCG_XORSHIFT:
        break;
    }
    return add_family(w, VCACHE_HASH_LCG_XORSHIFT, eye, lights, first, count, asked, visible);
}

/* Its own copy per family, in line: a pair costs little more than the calls it would take. */
static inline bool visible_family(vcache_worker *w, vcache_hash family, const vcache_eye *eye,
                                  const vcache_light *light, vcache_trace trace, void *context)
{
    w->statistics.asked++;
    if (w->config.exact || bypasses(eye, light))
        return worker_trace_one(w, eye, light, NULL, trace, context);
    step s = walk(w->cache, family, worker_epoch(w), eye, light, 0);
    if (s.known) {
        worker_count_hit(w, s.level);
        if (w->config.verify)
            worker_verify_one(w, eye, light, s.level, s.visible, trace, context);
        return s.visible;
    }
    place at = s.at; /* so that the step itself can stay in registers */
    return worker_trace_one(w, eye, light, &at, trace, context);
}

bool vcache_visible(vcache_worker *w, const vcache_eye *eye, const vcache_light *light, vcache_trace trace,
                    void *context)
{
    switch (w->cache->config.hash) {
    case VCACHE_HASH_SPLIT:
        return visible_family(w, VCACHE_HASH_SPLIT, eye, light, trace, context);
    case VCACHE_HASH_LCG_PAIR:
        return visible_family(w, VCACHE_HASH_LCG_PAIR, eye, light, trace, context);
    case VCACHE_HASH_LCG_XORSHIFT:
        break;
    }
    return visible_family(w, VCACHE_HASH_LCG_XORSHIFT, eye, light, trace, context);
}

void vcache_prefetch(vcache_worker *w, const vcache_eye *eye, const vcache_light *light)
{
    const vcache *c = w->cache;
    if (!w->config.exact && !bypasses(eye, light))
        table_prefetch(&c->table, find_place(c, c->config.hash, worker_epoch(w), eye->level[0].center, light).slot);
}
