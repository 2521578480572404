/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Queries (Alg. 1 and 2) as a resumable batch: a pair walks down the levels until it is answered or meets a cell that
 * nobody has asked for. The first such pair of a cell becomes a miss; the others wait for its answer and walk on from
 * there. So each cell costs one ray, whatever the order of tracing.
 */
#include "internal.h"

#include <string.h>

enum { NO_LEVEL = 0xff };

#if defined(__GNUC__)
static inline int count_trailing_zeros(uint64_t x) /* x != 0 */
{
    return __builtin_ctzll(x);
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
#endif

/* A pair on its way. */
typedef struct pair {
    union {
        const vcache_eye *eye;
        vcache_vertex *vertex;
    } from;
    union {
        const vcache_light *light;
        vcache_vertex *vertex;
    } to;
    uint64_t *visible;
    uint32_t bit;
    uint8_t level; /* of the cell that it waits for; NO_LEVEL: a bypass, not to be stored */
    bool vertices;
    bool alone; /* the cell's answers cannot be shared: trace without waiting for another pair's */
} pair;

typedef struct claim {
    uint64_t key;
    uint32_t round; /* the claim counts in this round alone, so that clearing costs nothing */
    bool once;      /* its answer was not to be stored */
} claim;

struct vcache_worker {
    vcache *cache;
    vcache_worker_config config;
    size_t bytes;
    size_t claim_mask;
    uint32_t round;
    uint32_t miss_count, waiting_count;
    /* `capacity` of each */
    vcache_miss *misses;
    pair *asking;   /* one per miss */
    uint64_t *keys; /* one per miss */
    vcache_answer *answers;
    pair *waiting;
    uint64_t *waiting_keys;
    claim *claims; /* claim_mask + 1, open addressing, at most half full */
    vcache_statistics statistics;
};

vcache_worker_config vcache_default_worker_config(void)
{
    return (vcache_worker_config){.size = sizeof(vcache_worker_config), .capacity = 65536, .exact = false};
}

/* All of a worker in one block. */
static size_t place(size_t *offset, size_t count, size_t bytes)
{
    size_t at = (*offset + 63) & ~(size_t)63;
    *offset = at + count * bytes;
    return at;
}

vcache_status vcache_worker_create(vcache *cache, const vcache_worker_config *config, vcache_worker **out,
                                   char *message)
{
    vcache_worker_config chosen = config ? *config : vcache_default_worker_config();
    const char *wrong = NULL;
    if (!out)
        wrong = "out is NULL";
    else if (!cache)
        wrong = "cache is NULL";
    else if (chosen.size != sizeof chosen)
        wrong = "worker config.size is wrong: start from vcache_default_worker_config()";
    else if (chosen.capacity < 1 || chosen.capacity > 1u << 24)
        wrong = "worker capacity must be 1 ... 2^24";
    if (out)
        *out = NULL;
    if (message)
        message[0] = 0;
    if (wrong) {
        if (message)
            strncat(message, wrong, VCACHE_MESSAGE_BYTES - 1);
        return VCACHE_ERROR_ARGUMENT;
    }
    size_t claims = 2;
    while (claims < 2 * (size_t)chosen.capacity)
        claims *= 2;
    size_t bytes = sizeof(vcache_worker), n = chosen.capacity;
    size_t misses = place(&bytes, n, sizeof(vcache_miss)), asking = place(&bytes, n, sizeof(pair));
    size_t keys = place(&bytes, n, sizeof(uint64_t)), answers = place(&bytes, n, sizeof(vcache_answer));
    size_t waiting = place(&bytes, n, sizeof(pair)), waiting_keys = place(&bytes, n, sizeof(uint64_t));
    size_t claim_at = place(&bytes, claims, sizeof(claim));
    const vcache_allocator *a = &cache->config.allocator;
    char *block = a->allocate(a->context, bytes);
    if (!block) {
        if (message)
            strncat(message, "no memory for a worker", VCACHE_MESSAGE_BYTES - 1);
        return VCACHE_ERROR_MEMORY;
    }
    vcache_worker *w = (vcache_worker *)(void *)block;
    w->cache = cache;
    w->config = chosen;
    w->bytes = bytes;
    w->claim_mask = claims - 1;
    w->round = 1;
    w->misses = (void *)(block + misses);
    w->asking = (void *)(block + asking);
    w->keys = (void *)(block + keys);
    w->answers = (void *)(block + answers);
    w->waiting = (void *)(block + waiting);
    w->waiting_keys = (void *)(block + waiting_keys);
    w->claims = (void *)(block + claim_at);
    *out = w;
    return VCACHE_OK;
}

void vcache_worker_destroy(vcache_worker **worker)
{
    if (!worker || !*worker)
        return;
    vcache_allocator a = (*worker)->cache->config.allocator;
    a.release(a.context, *worker, (*worker)->bytes);
    *worker = NULL;
}

/* --------------------------------------------------------------------------------------------------- one pair */

static float distance_squared(const float a[3], const float b[3])
{
    float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

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

/* Where a walk ended. */
typedef struct step {
    uint64_t key; /* of the unknown cell */
    uint32_t level;
    bool known, visible;
} step;

static inline bool look_up(const vcache *c, vcache_hash family, uint64_t key, bool *visible)
{
    uint32_t word = table_load_relaxed(&c->table, pair_slot(c, family, key));
    *visible = word & 1u;
    return (word & ~1u) == table_word(key);
}

/* Algorithm 2 from `level` on: down while one of the known neighbours differs. */
static inline step walk(const vcache *c, vcache_hash family, uint64_t epoch_key, const vcache_eye *eye,
                        const vcache_light *light, uint32_t level)
{
    step s = {.level = level};
    for (;; s.level++) {
        const eye_level *l = &eye->level[s.level];
        s.key = pair_key(family, epoch_key, l->center, light);
        s.known = look_up(c, family, s.key, &s.visible);
        if (!s.known || s.level + 1 == eye->levels)
            return s;
        bool differs = false;
        for (int i = 0; i < 4 && !differs; i++) {
            bool other;
            if (look_up(c, family, pair_key(family, epoch_key, l->neighbour[i], light), &other))
                differs = other != s.visible;
        }
        if (!differs)
            return s;
    }
}

static void count_hit(vcache_worker *w, uint32_t level)
{
    w->statistics.hits[level]++;
    w->statistics.hit_levels |= 1u << level;
}

static void store(vcache_worker *w, uint64_t key, bool visible)
{
    vcache *c = w->cache;
    uint64_t slot = pair_slot(c, c->config.hash, key);
    uint32_t word = table_word(key), old = table_load_relaxed(&c->table, slot);
    w->statistics.stored++;
    w->statistics.overwritten += old != 0 && (old & ~1u) != word;
    table_store_relaxed(&c->table, slot, word | (uint32_t)visible);
}

static void describe(vcache_miss *m, uint64_t eye_user, const float eye[3], uint64_t light_user, const float light[3],
                     bool infinite)
{
    m->eye_user = eye_user;
    m->light_user = light_user;
    memcpy(m->eye_position, eye, sizeof m->eye_position);
    memcpy(m->light_position, light, sizeof m->light_position);
    m->infinite = infinite;
}

static inline void answer(uint64_t *visible, uint32_t bit, bool value)
{
    uint64_t mask = (uint64_t)1 << (bit % 64);
    visible[bit / 64] = value ? visible[bit / 64] | mask : visible[bit / 64] & ~mask;
}

/* ----------------------------------------------------------------------------------------------------- the batch */

/* The claim on `key` in this round, or the free place for it. */
static claim *find_claim(vcache_worker *w, uint64_t key)
{
    size_t i = (size_t)key & w->claim_mask;
    while (w->claims[i].round == w->round && w->claims[i].key != key)
        i = (i + 1) & w->claim_mask;
    return &w->claims[i];
}

static void next_round(vcache_worker *w)
{
    if (++w->round == 0) { /* after 2^32 rounds old claims would look new */
        memset(w->claims, 0, (w->claim_mask + 1) * sizeof *w->claims);
        w->round = 1;
    }
}

static bool is_full(const vcache_worker *w)
{
    return w->miss_count + w->waiting_count >= w->config.capacity;
}

static void add_miss(vcache_worker *w, const pair *p, uint64_t key)
{
    uint32_t i = w->miss_count++;
    w->asking[i] = *p;
    w->keys[i] = key;
    if (p->vertices)
        describe(&w->misses[i], p->from.vertex->user, p->from.vertex->position, p->to.vertex->user,
                 p->to.vertex->position, false);
    else
        describe(&w->misses[i], p->from.eye->user, p->from.eye->position, p->to.light->user, p->to.light->position,
                 p->to.light->side_squared < 0.0f);
    w->statistics.traced++;
    w->statistics.bypassed += p->level == NO_LEVEL;
}

/* Unknown: the first to ask traces, the rest wait. */
static void ask(vcache_worker *w, const pair *p, uint64_t key)
{
    claim *c = find_claim(w, key);
    if (c->round != w->round || p->alone) {
        *c = (claim){key, w->round, false};
        add_miss(w, p, key);
    } else {
        w->waiting[w->waiting_count] = *p;
        w->waiting_keys[w->waiting_count++] = key;
    }
}

static inline void enter(vcache_worker *w, vcache_hash family, pair *p, uint64_t epoch_key)
{
    step s = walk(w->cache, family, epoch_key, p->from.eye, p->to.light, p->level);
    if (s.known) {
        count_hit(w, s.level);
        answer(p->visible, p->bit, s.visible);
        return;
    }
    p->level = (uint8_t)s.level;
    ask(w, p, s.key);
}

static inline void prefetch(const vcache *c, vcache_hash family, uint64_t key)
{
#if defined(__GNUC__)
    __builtin_prefetch((const void *)&c->table.words[pair_slot(c, family, key)]);
#else
    (void)c, (void)family, (void)key;
#endif
}

/* Up to 64 lights: the walk of Algorithm 2 over all of them at a time, so that their words come from memory side by side
 * and not one after the other. Nearly all pairs end in the first level; the others go on one by one. */
static inline void add_block(vcache_worker *w, vcache_hash family, uint64_t epoch_key, const vcache_eye *eye,
                             const vcache_light *lights, uint32_t base, uint64_t asked, uint64_t *visible)
{
    const vcache *c = w->cache;
    pair p = {.from.eye = eye, .visible = visible};
    uint64_t keys[64], around[64][4], yes = 0, no = 0;
    uint8_t index[64];
    uint32_t count = 0;
    for (; asked; asked &= asked - 1) {
        uint32_t i = (uint32_t)count_trailing_zeros(asked);
        p.to.light = &lights[base + i];
        p.bit = base + i;
        if (w->config.exact || bypasses(eye, p.to.light)) {
            p.level = NO_LEVEL;
            add_miss(w, &p, 0);
            continue;
        }
        index[count] = (uint8_t)i;
        keys[count] = pair_key(family, epoch_key, eye->level[0].center, p.to.light);
        prefetch(c, family, keys[count++]);
    }
    bool deep = eye->levels > 1;
    for (uint32_t k = 0; k < count && deep; k++)
        for (int i = 0; i < 4; i++) {
            around[k][i] = pair_key(family, epoch_key, eye->level[0].neighbour[i], &lights[base + index[k]]);
            prefetch(c, family, around[k][i]);
        }
    for (uint32_t k = 0; k < count; k++) {
        bool value, other, differs = false;
        p.to.light = &lights[base + index[k]];
        p.bit = base + index[k];
        p.level = 0;
        if (!look_up(c, family, keys[k], &value)) {
            ask(w, &p, keys[k]);
            continue;
        }
        for (int i = 0; i < 4 && deep; i++)
            differs |= look_up(c, family, around[k][i], &other) & (other != value);
        if (differs) {
            p.level = 1;
            enter(w, family, &p, epoch_key);
            continue;
        }
        *(value ? &yes : &no) |= (uint64_t)1 << index[k];
    }
    w->statistics.hits[0] += count_ones(yes | no);
    w->statistics.hit_levels |= (yes | no) != 0;
    visible[base / 64] = (visible[base / 64] | yes) & ~no;
}

static inline uint32_t add_family(vcache_worker *w, vcache_hash family, const vcache_eye *eye,
                                  const vcache_light *lights, uint32_t first, uint32_t count, const uint64_t *asked,
                                  uint64_t *visible)
{
    uint64_t epoch_key = atomic_load_explicit(&w->cache->epoch_key, memory_order_acquire);
    while (first < count) {
        uint32_t base = first & ~63u, end = count - base < 64 ? count - base : 64;
        uint64_t word = asked ? asked[base / 64] : ~(uint64_t)0;
        word &= ~(uint64_t)0 << (first - base);
        word &= ~(uint64_t)0 >> (64 - end);
        first = base + end;
        uint32_t room = w->config.capacity - w->miss_count - w->waiting_count, wanted = count_ones(word);
        if (wanted > room) {
            uint64_t rest = word;
            for (; room; room--)
                rest &= rest - 1;
            first = base + (uint32_t)count_trailing_zeros(rest);
            word &= ~rest;
            count = first;
            wanted = count_ones(word);
        }
        w->statistics.asked += wanted;
        if (word)
            add_block(w, family, epoch_key, eye, lights, base, word, visible);
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

/* Key of a pair of vertices; false where it must be answered exactly. Vertices hash by the split family always: their
 * cells depend on both ends, so there is no prefix for the serial families to start from. */
static bool vertices_key(const vcache *c, uint64_t epoch_key, vcache_vertex *eye, vcache_vertex *light, uint64_t *key)
{
    int at = vertex_step(c, eye, light);
    if (at < 0)
        return false;
    float side = quantize_size(c, at).side;
    if (!(distance_squared(eye->position, light->position) >= side * side))
        return false;
    *key = hash_fold(vertex_hash(c, eye, at) ^ epoch_key, vertex_hash(c, light, at));
    return true;
}

static void enter_vertices(vcache_worker *w, pair *p)
{
    uint64_t key = 0, epoch_key = atomic_load_explicit(&w->cache->epoch_key, memory_order_acquire);
    bool value;
    if (w->config.exact || !vertices_key(w->cache, epoch_key, p->from.vertex, p->to.vertex, &key)) {
        p->level = NO_LEVEL;
        add_miss(w, p, 0);
    } else if (look_up(w->cache, w->cache->config.hash, key, &value)) {
        count_hit(w, 0);
        answer(p->visible, p->bit, value);
    } else {
        ask(w, p, key);
    }
}

bool vcache_add_vertices(vcache_worker *w, vcache_vertex *eye, vcache_vertex *light, uint64_t *visible, uint32_t bit)
{
    if (is_full(w))
        return false;
    w->statistics.asked++;
    pair p = {.from.vertex = eye, .to.vertex = light, .visible = visible, .bit = bit, .vertices = true};
    enter_vertices(w, &p);
    return true;
}

size_t vcache_misses(vcache_worker *w, const vcache_miss **misses)
{
    if (misses)
        *misses = w->misses;
    return w->miss_count;
}

static void enter_again(vcache_worker *w, pair *p, uint64_t epoch_key)
{
    if (p->vertices)
        enter_vertices(w, p);
    else
        enter(w, w->cache->config.hash, p, epoch_key);
}

void vcache_commit(vcache_worker *w, const vcache_answer *answers)
{
    bool once = false;
    for (uint32_t i = 0; i < w->miss_count; i++) {
        const pair *p = &w->asking[i];
        answer(p->visible, p->bit, answers[i] & VCACHE_VISIBLE);
        if (answers[i] & VCACHE_ONCE) {
            w->statistics.once++;
            if (p->level != NO_LEVEL)
                find_claim(w, w->keys[i])->once = once = true;
        } else if (p->level != NO_LEVEL)
            store(w, w->keys[i], answers[i] & VCACHE_VISIBLE);
    }
    if (once)
        for (uint32_t i = 0; i < w->waiting_count; i++)
            w->waiting[i].alone = find_claim(w, w->waiting_keys[i])->once;
    w->miss_count = 0;
    next_round(w);
    /* Waiting pairs walk on; those that wait again move to the front, behind the one that is read. */
    uint32_t count = w->waiting_count;
    uint64_t epoch_key = atomic_load_explicit(&w->cache->epoch_key, memory_order_acquire);
    w->waiting_count = 0;
    for (uint32_t i = 0; i < count; i++) {
        pair p = w->waiting[i];
        enter_again(w, &p, epoch_key);
    }
}

void vcache_cancel(vcache_worker *w)
{
    w->miss_count = w->waiting_count = 0;
    next_round(w);
}

bool vcache_resolve(vcache_worker *w, vcache_trace trace, void *context)
{
    while (w->miss_count) {
        if (!trace(context, w->misses, w->miss_count, w->answers)) {
            vcache_cancel(w);
            return false;
        }
        vcache_commit(w, w->answers);
    }
    return true;
}

bool vcache_query(vcache_worker *w, const vcache_eye *eye, const vcache_light *lights, uint32_t count,
                  const uint64_t *asked, uint64_t *visible, vcache_trace trace, void *context)
{
    for (uint32_t i = 0; i < count;) {
        i = vcache_add(w, eye, lights, i, count, asked, visible);
        if (i < count && !vcache_resolve(w, trace, context))
            return false;
    }
    return vcache_resolve(w, trace, context);
}

bool vcache_visible(vcache_worker *w, const vcache_eye *eye, const vcache_light *light, vcache_trace trace,
                    void *context)
{
    uint64_t epoch_key = atomic_load_explicit(&w->cache->epoch_key, memory_order_acquire);
    bool bypass = w->config.exact || bypasses(eye, light);
    step s = {0};
    w->statistics.asked++;
    if (!bypass) {
        s = walk(w->cache, w->cache->config.hash, epoch_key, eye, light, 0);
        if (s.known) {
            count_hit(w, s.level);
            return s.visible;
        }
    }
    vcache_miss miss;
    vcache_answer result = VCACHE_BLOCKED;
    describe(&miss, eye->user, eye->position, light->user, light->position, light->side_squared < 0.0f);
    w->statistics.traced++;
    w->statistics.bypassed += bypass;
    if (!trace(context, &miss, 1, &result))
        return false;
    if (result & VCACHE_ONCE)
        w->statistics.once++;
    else if (!bypass)
        store(w, s.key, result & VCACHE_VISIBLE);
    return result & VCACHE_VISIBLE;
}

/* ----------------------------------------------------------------------------------------------------- statistics */

void vcache_worker_statistics(const vcache_worker *w, vcache_statistics *out)
{
    /* an older host may know a shorter struct */
    size_t bytes = out->size < sizeof *out ? out->size : sizeof *out;
    if (bytes < sizeof out->size)
        return;
    vcache_statistics all = w->statistics;
    all.size = bytes;
    memcpy(out, &all, bytes);
}

void vcache_worker_reset_statistics(vcache_worker *w)
{
    memset(&w->statistics, 0, sizeof w->statistics);
}
