/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The resumable batch of queries: a pair walks down the levels (Alg. 2) until it is answered or meets a cell that
 * nobody has asked for. The first such pair of a cell becomes a miss; the others wait for its answer and walk on from
 * there. So each cell costs one ray, whatever the order of tracing.
 */
#include "sized.h"
#include "worker.h"

#include <string.h>

void vcache_fill_worker_config(vcache_worker_config *out, size_t size)
{
    const vcache_worker_config f = {.size = sizeof f, .capacity = 4096, .exact = false};
    sized_fill(out, size, &f, sizeof f);
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
    const vcache_status bad = VCACHE_ERROR_ARGUMENT;
    vcache_worker_config chosen = vcache_default_worker_config();
    const char *wrong = NULL;
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, bad, "out is NULL");
    *out = NULL;
    if (!cache)
        return vcache_complain(message, bad, "cache is NULL");
    if (config)
        wrong = sized_take(&chosen, sizeof chosen, SIZED_FIRST(vcache_worker_config, report_context), config);
    if (wrong)
        return vcache_complain(message, bad, "worker %s: start from vcache_default_worker_config()", wrong);
    if (chosen.capacity < 1 || chosen.capacity > 1u << 24)
        return vcache_complain(message, bad, "worker capacity must be 1 ... 2^24");
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
    if (!block)
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for a worker");
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

/* ----------------------------------------------------------------------------------------------------- the batch */

/* What a claim is made on: bundled lights of one cell share a key, but have a word each. */
static uint64_t claim_id(place at)
{
    return at.key ^ at.slot * 0x9e3779b97f4a7c15u;
}

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

static void describe(vcache_miss *m, uint64_t eye_user, const float eye[3], uint64_t light_user, const float light[3],
                     bool infinite)
{
    m->eye_user = eye_user;
    m->light_user = light_user;
    memcpy(m->eye_position, eye, sizeof m->eye_position);
    memcpy(m->light_position, light, sizeof m->light_position);
    m->infinite = infinite;
}

void worker_add_miss(vcache_worker *w, const pair *p, place at)
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
    if (p->verify)
        return;
    w->statistics.traced++;
    w->statistics.bypassed += p->level == NO_LEVEL;
}

void worker_verify(vcache_worker *w, pair *p, uint32_t level, bool said)
{
    p->level = (uint8_t)level;
    p->verify = true;
    p->said = said;
    worker_add_miss(w, p, (place){0});
    p->verify = false;
}

void worker_compare(vcache_worker *w, const pair *p, const vcache_miss *ray, vcache_answer answer)
{
    bool visible = answer & VCACHE_VISIBLE;
    w->statistics.verified++;
    if (visible == p->said)
        return;
    w->statistics.mispredicted++;
    w->statistics.leaked += !visible;
    if (w->config.report) {
        vcache_misprediction wrong = {.ray = *ray, .visible = visible, .level = p->level};
        wrong.cell = p->vertices ? 0 : vcache_eye_cell(p->from.eye, p->level);
        w->config.report(w->config.report_context, &wrong);
    }
}

void worker_ask(vcache_worker *w, const pair *p, place at)
{
    uint64_t id = claim_id(at);
    claim *c = find_claim(w, id);
    if (c->round != w->round || p->alone) {
        *c = (claim){id, w->round, false};
        worker_add_miss(w, p, at);
    } else {
        w->waiting[w->waiting_count] = *p;
        w->waiting_keys[w->waiting_count++] = id;
    }
}

void worker_finish(vcache_worker *w, pair *p, step s)
{
    if (s.known) {
        worker_count_hit(w, s.level);
        worker_answer(p->visible, p->bit, s.visible);
        if (w->config.verify)
            worker_verify(w, p, s.level, s.visible);
        return;
    }
    p->level = (uint8_t)s.level;
    worker_ask(w, p, s.at);
}

uint64_t worker_take(uint64_t word, uint32_t *room, uint32_t base, uint32_t end, uint32_t *next)
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

size_t vcache_misses(vcache_worker *w, const vcache_miss **misses)
{
    if (misses)
        *misses = w->misses;
    return w->miss_count;
}

static void enter_again(vcache_worker *w, pair *p, uint64_t epoch_key)
{
    if (p->vertices)
        vertices_enter(w, p, epoch_key);
    else if (p->set)
        worker_finish(w, p, set_walk(p->set, epoch_key, p->from.eye, p->bit, p->level, p->coarse));
    else
        worker_finish(w, p, table_walk(w->cache, epoch_key, p->from.eye, p->to.light, p->level));
}

/* Its answer goes into a row of a set. */
static bool stores_row(const pair *p)
{
    return p->set && p->level != NO_LEVEL && !p->verify;
}

static uint32_t run_end(const vcache_worker *w, uint32_t first)
{
    uint32_t i = first + 1;
    while (i < w->miss_count && w->asking[i].set == w->asking[first].set && stores_row(&w->asking[i]) &&
           w->places[i].slot == w->places[first].slot)
        i++;
    return i;
}

void vcache_commit(vcache_worker *w, const vcache_answer *answers)
{
    bool once = false;
    for (uint32_t i = 0; i < w->miss_count; i++) {
        const pair *p = &w->asking[i];
        if (p->verify) {
            worker_compare(w, p, &w->misses[i], answers[i]);
            continue;
        }
        worker_answer(p->visible, p->bit, answers[i] & VCACHE_VISIBLE);
        if (answers[i] & VCACHE_ONCE) {
            w->statistics.once++;
            if (p->level != NO_LEVEL)
                find_claim(w, claim_id(w->places[i]))->once = once = true;
        } else if (p->level != NO_LEVEL && !p->set)
            table_write(w, w->places[i], answers[i] & VCACHE_VISIBLE);
    }
    for (uint32_t i = 0; i < w->miss_count;) {
        if (!stores_row(&w->asking[i])) {
            i++;
            continue;
        }
        uint32_t end = run_end(w, i);
        set_write(w, i, end, answers);
        i = end;
    }
    if (once)
        for (uint32_t i = 0; i < w->waiting_count; i++)
            w->waiting[i].alone = find_claim(w, w->waiting_keys[i])->once;
    w->miss_count = 0;
    next_round(w);
    /* Waiting pairs walk on; those that wait again move to the front, behind the one that is read. */
    uint32_t count = w->waiting_count;
    uint64_t epoch_key = worker_epoch(w);
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

bool worker_trace_one(vcache_worker *w, const vcache_eye *eye, const vcache_light *light, const place *at,
                      vcache_trace trace, void *context)
{
    vcache_miss miss;
    vcache_answer result = VCACHE_BLOCKED;
    describe(&miss, eye->user, eye->position, light->user, light->position, light->side_squared < 0.0f);
    w->statistics.traced++;
    w->statistics.bypassed += !at;
    if (!trace(context, &miss, 1, &result))
        return false;
    if (result & VCACHE_ONCE)
        w->statistics.once++;
    else if (at)
        table_write(w, *at, result & VCACHE_VISIBLE);
    return result & VCACHE_VISIBLE;
}

void worker_verify_one(vcache_worker *w, const vcache_eye *eye, const vcache_light *light, uint32_t level, bool said,
                       vcache_trace trace, void *context)
{
    const pair p = {.from.eye = eye, .level = (uint8_t)level, .said = said};
    vcache_miss ray;
    vcache_answer answer = VCACHE_BLOCKED;
    describe(&ray, eye->user, eye->position, light->user, light->position, light->side_squared < 0.0f);
    if (trace(context, &ray, 1, &answer))
        worker_compare(w, &p, &ray, answer);
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
