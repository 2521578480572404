/* SPDX-License-Identifier: Apache-2.0 */
/* A worker's batch, as the table's queries (query.c) and the rows' (light_set.c) see it. */
#ifndef VCACHE_WORKER_H
#define VCACHE_WORKER_H

#include "bits.h"
#include "internal.h"

enum { NO_LEVEL = 0xff };

/* A pair on its way. */
typedef struct pair {
    union {
        const vcache_eye *eye;
        const vcache_vertex *vertex;
    } from;
    union {
        const vcache_light *light;
        const vcache_vertex *vertex;
    } to;
    vcache_light_set *set; /* NULL: the answer lives in the table */
    uint64_t *visible;
    uint32_t bit;
    uint8_t level; /* of the cell that it waits for; NO_LEVEL: a bypass, not to be stored */
    bool vertices;
    bool coarse; /* not to be refined */
    bool alone;  /* the cell's answers cannot be shared: trace without waiting for another pair's */
    bool verify; /* answered already, with `said`, by a cell of `level`: the ray is to check that */
    bool said;
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
    pair *asking;  /* one per miss */
    place *places; /* one per miss */
    vcache_answer *answers;
    pair *waiting;
    uint64_t *waiting_keys;
    claim *claims; /* claim_mask + 1, open addressing, at most half full */
    vcache_statistics statistics;
};

/* Where a walk ended. */
typedef struct step {
    place at; /* of the unknown cell */
    uint32_t level;
    bool known, visible;
} step;

/* Keys of before a vcache_clear must not meet those of after it in one walk: loaded once per call. */
static inline uint64_t worker_epoch(const vcache_worker *w)
{
    return atomic_load_explicit(&w->cache->epoch_key, memory_order_acquire);
}

static inline float distance_squared(const float a[3], const float b[3])
{
    float x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
    return x * x + y * y + z * z;
}

static inline uint32_t worker_room(const vcache_worker *w)
{
    return w->config.capacity - w->miss_count - w->waiting_count;
}

static inline void worker_count_hit(vcache_worker *w, uint32_t level)
{
    w->statistics.hits[level]++;
    w->statistics.hit_levels |= 1u << level;
}

static inline void worker_answer(uint64_t *visible, uint32_t bit, bool value)
{
    uint64_t mask = (uint64_t)1 << (bit % 64);
    visible[bit / 64] = value ? visible[bit / 64] | mask : visible[bit / 64] & ~mask;
}

/* worker.c */
/* Unknown: the first to ask for a place in this round traces, the rest wait. */
void worker_ask(vcache_worker *w, const pair *p, place at);
/* A ray of its own, whatever others ask. */
void worker_add_miss(vcache_worker *w, const pair *p, place at);
/* The cache answered; a worker that verifies wants a ray all the same. */
void worker_verify(vcache_worker *w, pair *p, uint32_t level, bool said);
/* What that ray found. */
void worker_compare(vcache_worker *w, const pair *p, const vcache_miss *ray, vcache_answer answer);
/* The end of a walk: an answer, or a ray. */
void worker_finish(vcache_worker *w, pair *p, step s);
/* The lights of a word that the batch has room for, in order. `*next` becomes the first light not taken. */
uint64_t worker_take(uint64_t word, uint32_t *room, uint32_t base, uint32_t end, uint32_t *next);

/* A ray at once for a single query; `at`: where its answer goes, NULL for a bypass. */
bool worker_trace_one(vcache_worker *w, const vcache_eye *eye, const vcache_light *light, const place *at,
                      vcache_trace trace, void *context);
/* The ray that checks a single query's answer. */
void worker_verify_one(vcache_worker *w, const vcache_eye *eye, const vcache_light *light, uint32_t level, bool said,
                       vcache_trace trace, void *context);

/* query.c: Algorithm 2 from `level` on, over words of the table. */
step table_walk(const vcache *c, uint64_t epoch_key, const vcache_eye *eye, const vcache_light *light, uint32_t level);
/* Writes a word; counts it. */
void table_write(vcache_worker *w, place at, bool visible);

/* vertices.c */
void vertices_enter(vcache_worker *w, pair *p, uint64_t epoch_key);

/* light_set.c: the same over the rows of a set. */
step set_walk(const vcache_light_set *set, uint64_t epoch_key, const vcache_eye *eye, uint32_t light, uint32_t level,
              bool coarse);
/* Writes the answers of misses [first, end), all of one row. */
void set_write(vcache_worker *w, uint32_t first, uint32_t end, const vcache_answer *answers);

#endif
