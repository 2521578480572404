/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Queries (Alg. 1 and 2) as a resumable batch: a pair walks down the levels until it is answered or meets a cell that
 * nobody has asked for. The first such pair of a cell becomes a miss; the others wait for its answer and walk on from
 * there. So each cell costs one ray, whatever the order of tracing.
 */
#include "internal.h"
#include "light_set.h"

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
    vcache_light_set *set; /* NULL: the answer lives in the table */
    uint64_t *visible;
    uint32_t bit;
    uint8_t level; /* of the cell that it waits for; NO_LEVEL: a bypass, not to be stored */
    bool vertices;
    bool alone; /* the cell's answers cannot be shared: trace without waiting for another pair's */
} pair;

/* A pair of cells: its key, and where its word lies. */
typedef struct place {
    uint64_t key;
    uint64_t slot;
} place;

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
    place *places; /* one per miss */
    vcache_answer *answers;
    pair *waiting;
    uint64_t *waiting_keys;
    claim *claims; /* claim_mask + 1, open addressing, at most half full */
    vcache_statistics statistics;
};

vcache_worker_config vcache_default_worker_config(void)
{
    return (vcache_worker_config){.size = sizeof(vcache_worker_config), .capacity = 4096, .exact = false};
}

/* All of a worker in one block. */
static size_t reserve(size_t *offset, size_t count, size_t bytes)
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
    size_t misses = reserve(&bytes, n, sizeof(vcache_miss)), asking = reserve(&bytes, n, sizeof(pair));
    size_t places = reserve(&bytes, n, sizeof(place)), answers = reserve(&bytes, n, sizeof(vcache_answer));
    size_t waiting = reserve(&bytes, n, sizeof(pair)), waiting_keys = reserve(&bytes, n, sizeof(uint64_t));
    size_t claim_at = reserve(&bytes, claims, sizeof(claim));
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
    w->places = (void *)(block + places);
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
    place at; /* of the unknown cell */
    uint32_t level;
    bool known, visible;
} step;

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

static inline bool look_up(const vcache *c, place at, bool *visible)
{
    uint32_t word = table_load_relaxed(&c->table, at.slot);
    *visible = word & 1u;
    return (word & ~1u) == table_word(at.key);
}

/* Algorithm 2 from `level` on: down while one of the known neighbours differs. */
static inline step walk(const vcache *c, vcache_hash family, uint64_t epoch_key, const vcache_eye *eye,
                        const vcache_light *light, uint32_t level)
{
    step s = {.level = level};
    for (;; s.level++) {
        const eye_level *l = &eye->level[s.level];
        s.at = find_place(c, family, epoch_key, l->center, light);
        s.known = look_up(c, s.at, &s.visible);
        if (!s.known || s.level + 1 == eye->levels)
            return s;
        bool differs = false;
        for (int i = 0; i < 4 && !differs; i++) {
            bool other;
            if (look_up(c, find_place(c, family, epoch_key, l->neighbour[i], light), &other))
                differs = other != s.visible;
        }
        if (!differs)
            return s;
    }
}

/* The same in the rows of a set. */
static step walk_set(const vcache_light_set *set, uint64_t epoch_key, const vcache_eye *eye, uint32_t light,
                     uint32_t level)
{
    step s = {.level = level};
    uint64_t bit = (uint64_t)1 << (light % 64), known, visible;
    for (;; s.level++) {
        const eye_level *l = &eye->level[s.level];
        uint64_t row = row_key(epoch_key, l->center);
        s.at = (place){hash_fold(row, hash_words(light, 0, row)), row};
        s.known = row_read(set, row, light / 64, 1, &known, &visible) && known & bit;
        s.visible = visible & bit;
        if (!s.known || s.level + 1 == eye->levels)
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

static void count_hit(vcache_worker *w, uint32_t level)
{
    w->statistics.hits[level]++;
    w->statistics.hit_levels |= 1u << level;
}

static void store(vcache_worker *w, place at, bool visible)
{
    vcache *c = w->cache;
    uint32_t word = table_word(at.key), old = table_load_relaxed(&c->table, at.slot);
    w->statistics.stored++;
    w->statistics.overwritten += old != 0 && (old & ~1u) != word;
    table_store_relaxed(&c->table, at.slot, word | (uint32_t)visible);
}

/* Misses in a row of the batch mostly belong to one row of the set, which is opened once for all of them. */
static void store_run(vcache_worker *w, uint32_t first, uint32_t end, const vcache_answer *answers)
{
    vcache_light_set *set = w->asking[first].set;
    bool replaced = false;
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

static uint32_t run_end(const vcache_worker *w, uint32_t first)
{
    uint32_t i = first + 1;
    while (i < w->miss_count && w->asking[i].set == w->asking[first].set && w->asking[i].level != NO_LEVEL &&
           w->places[i].slot == w->places[first].slot)
        i++;
    return i;
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

static void add_miss(vcache_worker *w, const pair *p, place at)
{
    uint32_t i = w->miss_count++;
    w->asking[i] = *p;
    w->places[i] = at;
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
static void ask(vcache_worker *w, const pair *p, place at)
{
    claim *c = find_claim(w, at.key);
    if (c->round != w->round || p->alone) {
        *c = (claim){at.key, w->round, false};
        add_miss(w, p, at);
    } else {
        w->waiting[w->waiting_count] = *p;
        w->waiting_keys[w->waiting_count++] = at.key;
    }
}

static inline void enter(vcache_worker *w, vcache_hash family, pair *p, uint64_t epoch_key)
{
    step s = p->set ? walk_set(p->set, epoch_key, p->from.eye, p->bit, p->level)
                    : walk(w->cache, family, epoch_key, p->from.eye, p->to.light, p->level);
    if (s.known) {
        count_hit(w, s.level);
        answer(p->visible, p->bit, s.visible);
        return;
    }
    p->level = (uint8_t)s.level;
    ask(w, p, s.at);
}

static inline void prefetch(const vcache *c, uint64_t slot)
{
#if defined(__GNUC__)
    __builtin_prefetch((const void *)&c->table.words[slot]);
#else
    (void)c, (void)slot;
#endif
}

/* Up to 64 lights: the walk of Algorithm 2 over all of them at a time, so that their words come from memory side by side
 * and not one after the other. Nearly all pairs end in the first level; the others go on one by one. */
static inline void add_block(vcache_worker *w, vcache_hash family, uint64_t epoch_key, const vcache_eye *eye,
                             const vcache_light *lights, uint32_t base, uint64_t asked, uint64_t *visible)
{
    const vcache *c = w->cache;
    const eye_level *l = &eye->level[0];
    const uint64_t half[5] = {l->center, l->neighbour[0], l->neighbour[1], l->neighbour[2], l->neighbour[3]};
    const int cells = eye->levels > 1 ? 5 : 1; /* without refinement the neighbours do not matter */
    pair p = {.from.eye = eye, .visible = visible};
    place at[64][5];
    uint64_t yes = 0, no = 0, line = 0, start[5] = {0};
    uint8_t index[64], last_lane = LANE_NONE;
    uint32_t count = 0;
    for (; asked; asked &= asked - 1) {
        uint32_t i = (uint32_t)count_trailing_zeros(asked);
        p.to.light = &lights[base + i];
        p.bit = base + i;
        if (w->config.exact || bypasses(eye, p.to.light)) {
            p.level = NO_LEVEL;
            add_miss(w, &p, (place){0});
            continue;
        }
        uint8_t lane = p.to.light->lane;
        if (lane == LANE_NONE) {
            for (int k = 0; k < cells; k++) {
                at[count][k] = find_place(c, family, epoch_key, half[k], p.to.light);
                prefetch(c, at[count][k].slot);
            }
        } else {
            if (last_lane == LANE_NONE || line != p.to.light->key.line) {
                line = p.to.light->key.line;
                for (int k = 0; k < cells; k++) {
                    start[k] = pair_line(c, epoch_key, half[k], line);
                    prefetch(c, start[k]);
                }
            }
            for (int k = 0; k < cells; k++)
                at[count][k] = (place){pair_key(family, epoch_key, half[k], p.to.light), start[k] + lane};
        }
        last_lane = lane;
        index[count++] = (uint8_t)i;
    }
    for (uint32_t n = 0; n < count; n++) {
        bool value, other, differs = false;
        if (!look_up(c, at[n][0], &value)) {
            p.to.light = &lights[base + index[n]];
            p.bit = base + index[n];
            p.level = 0;
            ask(w, &p, at[n][0]);
            continue;
        }
        for (int k = 1; k < cells; k++) {
            bool found = look_up(c, at[n][k], &other); /* before `other` is read */
            differs |= found & (other != value);
        }
        if (differs) {
            p.to.light = &lights[base + index[n]];
            p.bit = base + index[n];
            p.level = 1;
            enter(w, family, &p, epoch_key);
            continue;
        }
        *(value ? &yes : &no) |= (uint64_t)1 << index[n];
    }
    w->statistics.hits[0] += count_ones(yes | no);
    w->statistics.hit_levels |= (yes | no) != 0;
    visible[base / 64] = (visible[base / 64] | yes) & ~no;
}

/* The lights of a word that the batch has room for, in order. `*next` becomes the first light not taken. */
static uint64_t take(uint64_t word, uint32_t *room, uint32_t base, uint32_t end, uint32_t *next)
{
    uint32_t wanted = count_ones(word);
    *next = base + end;
    if (wanted <= *room) {
        *room -= wanted;
        return word;
    }
    uint64_t rest = word;
    for (; *room; --*room)
        rest &= rest - 1;
    *next = base + (uint32_t)count_trailing_zeros(rest);
    return word & ~rest;
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
        uint32_t room = w->config.capacity - w->miss_count - w->waiting_count;
        word = take(word, &room, base, end, &first);
        w->statistics.asked += count_ones(word);
        if (word)
            add_block(w, family, epoch_key, eye, lights, base, word, visible);
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

/* Lights of one word of the set that are nearer to the eye end than a cell, or cannot be quantized. */
static uint64_t near_lights(const vcache_eye *eye, const vcache_light_set *set, uint32_t word)
{
    const float *x = set->x + 64 * word, *y = set->y + 64 * word, *z = set->z + 64 * word;
    const float *side = set->side_squared + 64 * word, ex = eye->position[0], ey = eye->position[1];
    const float ez = eye->position[2], es = eye->side_squared;
    uint8_t near[64];
    for (int i = 0; i < 64; i++) {
        float dx = x[i] - ex, dy = y[i] - ey, dz = z[i] - ez, distance = dx * dx + dy * dy + dz * dz;
        float least = side[i] > es || side[i] < 0.0f ? side[i] : es;
        near[i] = !(distance >= least);
    }
    uint64_t bits = 0;
    for (int i = 0; i < 64; i += 8) {
        /* eight 0/1 bytes to eight bits */
        uint64_t eight = 0;
        memcpy(&eight, near + i, 8);
        bits |= (eight * 0x0102040810204080u >> 56) << i;
    }
    return bits;
}

static void ask_set(vcache_worker *w, vcache_light_set *set, const vcache_eye *eye, uint32_t base, uint64_t bits,
                    uint32_t level, uint64_t row, uint64_t *visible)
{
    pair p = {.from.eye = eye, .set = set, .visible = visible, .level = (uint8_t)level};
    for (; bits; bits &= bits - 1) {
        p.bit = base + (uint32_t)count_trailing_zeros(bits);
        p.to.light = &set->lights[p.bit];
        if (level == NO_LEVEL)
            add_miss(w, &p, (place){0});
        else
            ask(w, &p, (place){hash_fold(row, hash_words(p.bit, 0, row)), row});
    }
}

/* Words of one pass: rows are copied to the stack in pieces of this size. */
enum { PIECE = 16 };

/* Algorithm 2 for up to PIECE words of lights at a time. `rest`: who is still on the way. */
static void add_rows(vcache_worker *w, vcache_light_set *set, const vcache_eye *eye, uint64_t epoch_key, uint32_t first,
                     uint32_t count, uint64_t rest[PIECE], uint64_t *visible)
{
    for (uint32_t d = 0; d < eye->levels; d++) {
        const eye_level *l = &eye->level[d];
        const uint64_t half[5] = {l->center, l->neighbour[0], l->neighbour[1], l->neighbour[2], l->neighbour[3]};
        uint64_t known[5][PIECE], seen[5][PIECE], any = 0, keys[5];
        int cells = d + 1 < eye->levels ? 5 : 1;
        for (int k = 0; k < cells; k++) {
            keys[k] = row_key(epoch_key, half[k]);
            row_prefetch(set, keys[k]);
        }
        for (int k = 0; k < cells; k++)
            row_read(set, keys[k], first, count, known[k], seen[k]);
        uint64_t hits = 0;
        for (uint32_t i = 0; i < count; i++) {
            uint64_t missing = rest[i] & ~known[0][i], differs = 0;
            for (int k = 1; k < cells; k++)
                differs |= known[k][i] & (seen[k][i] ^ seen[0][i]);
            uint64_t found = rest[i] & known[0][i] & ~differs;
            hits += count_ones(found);
            visible[first + i] = (visible[first + i] & ~found) | (found & seen[0][i]);
            rest[i] &= known[0][i] & differs;
            any |= rest[i];
            if (missing)
                ask_set(w, set, eye, 64 * (first + i), missing, d, keys[0], visible);
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
    uint64_t epoch_key = atomic_load_explicit(&w->cache->epoch_key, memory_order_acquire);
    while (first < set->count) {
        uint32_t start = first / 64, words = 0, room = w->config.capacity - w->miss_count - w->waiting_count;
        uint64_t rest[PIECE];
        bool full = false;
        for (; words < PIECE && start + words < set->words && !full; words++) {
            uint32_t base = 64 * (start + words), end = set->count - base < 64 ? set->count - base : 64;
            uint64_t word = asked ? asked[start + words] : ~(uint64_t)0;
            word &= ~(uint64_t)0 >> (64 - end);
            if (first > base)
                word &= ~(uint64_t)0 << (first - base);
            rest[words] = take(word, &room, base, end, &first);
            full = first < base + end;
            w->statistics.asked += count_ones(rest[words]);
        }
        for (uint32_t i = 0; i < words; i++) {
            if (!rest[i])
                continue;
            uint64_t exact = w->config.exact || eye->levels == 0 ? rest[i] : rest[i] & near_lights(eye, set, start + i);
            if (exact)
                ask_set(w, set, eye, 64 * (start + i), exact, NO_LEVEL, 0, visible);
            rest[i] &= ~exact;
        }
        add_rows(w, set, eye, epoch_key, start, words, rest, visible);
        if (full)
            break;
    }
    return first;
}

/* Place of a pair of vertices; false where it must be answered exactly. Vertices hash by the split family always: their
 * cells depend on both ends, so there is no prefix for the serial families to start from. */
static bool vertices_place(const vcache *c, uint64_t epoch_key, vcache_vertex *eye, vcache_vertex *light, place *out)
{
    int at = vertex_step(c, eye, light);
    if (at < 0)
        return false;
    float side = quantize_size(c, at).side;
    if (!(distance_squared(eye->position, light->position) >= side * side))
        return false;
    out->key = hash_fold(vertex_hash(c, eye, at) ^ epoch_key, vertex_hash(c, light, at));
    out->slot = pair_slot(c, VCACHE_HASH_SPLIT, out->key);
    return true;
}

static void enter_vertices(vcache_worker *w, pair *p)
{
    place at = {0};
    uint64_t epoch_key = atomic_load_explicit(&w->cache->epoch_key, memory_order_acquire);
    bool value;
    if (w->config.exact || !vertices_place(w->cache, epoch_key, p->from.vertex, p->to.vertex, &at)) {
        p->level = NO_LEVEL;
        add_miss(w, p, (place){0});
    } else if (look_up(w->cache, at, &value)) {
        count_hit(w, 0);
        answer(p->visible, p->bit, value);
    } else {
        ask(w, p, at);
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
                find_claim(w, w->places[i].key)->once = once = true;
        } else if (p->level != NO_LEVEL && !p->set)
            store(w, w->places[i], answers[i] & VCACHE_VISIBLE);
    }
    for (uint32_t i = 0; i < w->miss_count;) {
        if (!w->asking[i].set || w->asking[i].level == NO_LEVEL) {
            i++;
            continue;
        }
        uint32_t end = run_end(w, i);
        store_run(w, i, end, answers);
        i = end;
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
        store(w, s.at, result & VCACHE_VISIBLE);
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
