/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Adaptive shadow testing (adaptive.h).
 *
 * Few sources are tested, so few are sorted (ranking.h). What remains is known from its cuts at no cost, and r(i) is
 * bounded by the cuts around its end; there is sorted further only while the bounds do not decide.
 */
#include "adaptive.h"

#include "internal.h"
#include "ranking.h"
#include "sized.h"

#include <float.h>
#include <stdatomic.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

struct vcache_adaptive {
    vcache_adaptive_config config;
    size_t bytes;
    uint32_t terms; /* of r(i) */
    /* [sources]; written by merges, or by all workers where free-running */
    _Atomic uint64_t *tests, *hits;
    _Atomic float *rate;
};

struct vcache_adaptive_worker {
    vcache_adaptive *adaptive;
    size_t bytes;
    vcache_adaptive_statistics statistics;
    uint64_t *tests, *hits; /* [sources] since the last merge */

    /* the point */
    const float *contribution;
    float *weight;
    double tolerance;     /* relaxed; 0: exact */
    double seen, at_most; /* S, and S if all that wait for answers are visible */
    ranking ranking;      /* of the candidates; exact: keys alone, in their own order */
    uint32_t scanned;     /* exact: sources looked at */
    uint32_t given, told; /* ranks below `given` were given out, below `told` answered */
    uint32_t hit;         /* of these: visible */
};

/* ------------------------------------------------------------------------------------------------------- creation */

void vcache_adaptive_fill_config(vcache_adaptive_config *out, size_t size)
{
    const vcache_adaptive_config f = {
        .size = sizeof(vcache_adaptive_config),
        .tolerance = 0.1f,
        .certainty = 0.5f,
        .prior_hits = 1.0f,
        .prior_tests = 2.0f,
        .allocator = vcache_default_config().allocator,
    };
    sized_fill(out, size, &f, sizeof f);
}

static vcache_status check(const vcache_adaptive_config *f, char *message)
{
    const vcache_status bad = VCACHE_ERROR_ARGUMENT;
    if (f->sources < 1 || f->sources > VCACHE_ADAPTIVE_MAX_SOURCES)
        return vcache_complain(message, bad, "sources is %u: it must be 1 ... %d", f->sources,
                               VCACHE_ADAPTIVE_MAX_SOURCES);
    if (!(f->tolerance >= 0.0f && f->tolerance <= FLT_MAX))
        return vcache_complain(message, bad, "tolerance is %g: it must be finite, >= 0", (double)f->tolerance);
    if (!(f->certainty >= 0.0f && f->certainty <= 1.0f))
        return vcache_complain(message, bad, "certainty is %g: it must be 0 ... 1", (double)f->certainty);
    if (!(f->prior_tests > 0.0f && f->prior_tests <= FLT_MAX))
        return vcache_complain(message, bad, "prior_tests is %g: it must be finite, > 0", (double)f->prior_tests);
    if (!(f->prior_hits >= 0.0f && f->prior_hits <= f->prior_tests))
        return vcache_complain(message, bad, "prior_hits is %g: it must be 0 ... prior_tests, %g",
                               (double)f->prior_hits, (double)f->prior_tests);
    if (!f->allocator.allocate || !f->allocator.release)
        return vcache_complain(message, bad, "allocator: both functions must be set");
    return VCACHE_OK;
}

/* Above 1 only where free-running threads were caught between a test and its hit. */
static void set_rate(vcache_adaptive *a, uint32_t source, uint64_t tests, uint64_t hits)
{
    double rate = ((double)hits + (double)a->config.prior_hits) / ((double)tests + (double)a->config.prior_tests);
    atomic_store_explicit(&a->rate[source], (float)(rate < 1.0 ? rate : 1.0), memory_order_relaxed);
}

vcache_status vcache_adaptive_create(const vcache_adaptive_config *given, vcache_adaptive **out, char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    vcache_adaptive_config config = vcache_adaptive_default_config();
    const char *wrong = given
                            ? sized_take(&config, sizeof config, SIZED_FIRST(vcache_adaptive_config, allocator), given)
                            : "config is NULL";
    if (wrong)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "%s: start from vcache_adaptive_default_config()",
                               wrong);
    vcache_status status = check(&config, message);
    if (status != VCACHE_OK)
        return status;
    size_t n = config.sources, header = (sizeof(vcache_adaptive) + 63) / 64 * 64;
    size_t bytes = header + n * (2 * sizeof(uint64_t) + sizeof(float));
    char *block = config.allocator.allocate(config.allocator.context, bytes);
    if (!block)
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for the hit rates of %u sources",
                               config.sources);
    vcache_adaptive *a = (vcache_adaptive *)(void *)block;
    a->config = config;
    a->bytes = bytes;
    a->terms = (uint32_t)((double)n * (double)config.certainty + 0.5);
    if (a->terms < 1)
        a->terms = 1;
    a->tests = (_Atomic uint64_t *)(void *)(block + header);
    a->hits = a->tests + n;
    a->rate = (_Atomic float *)(void *)(a->hits + n);
    for (uint32_t i = 0; i < n; i++)
        set_rate(a, i, 0, 0);
    *out = a;
    return VCACHE_OK;
}

void vcache_adaptive_destroy(vcache_adaptive **adaptive)
{
    if (!adaptive || !*adaptive)
        return;
    vcache_allocator a = (*adaptive)->config.allocator;
    a.release(a.context, *adaptive, (*adaptive)->bytes);
    *adaptive = NULL;
}

static vcache_status worker_new(vcache_adaptive *adaptive, vcache_adaptive_worker *first, vcache_adaptive_worker **out,
                                char *message)
{
    size_t n = adaptive->config.sources, counts = first ? 0 : 2 * n;
    size_t header = (sizeof(vcache_adaptive_worker) + 63) / 64 * 64;
    size_t bytes = header + (counts + n + n / 64 + 1 + n / 4096 + 1) * sizeof(uint64_t) + (n + 1) * sizeof(double);
    const vcache_allocator *a = &adaptive->config.allocator;
    char *block = a->allocate(a->context, bytes);
    if (!block)
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for a worker of %zu sources", n);
    vcache_adaptive_worker *w = (vcache_adaptive_worker *)(void *)block;
    w->adaptive = adaptive;
    w->bytes = bytes;
    uint64_t *own = (uint64_t *)(void *)(block + header);
    w->tests = first ? first->tests : own;
    w->hits = first ? first->hits : own + n;
    w->ranking.keys = own + counts;
    w->ranking.cuts = w->ranking.keys + n;
    w->ranking.words = w->ranking.cuts + n / 64 + 1;
    w->ranking.rest = (double *)(void *)(w->ranking.words + n / 4096 + 1);
    w->scanned = adaptive->config.sources;
    *out = w;
    return VCACHE_OK;
}

vcache_status vcache_adaptive_worker_create(vcache_adaptive *adaptive, vcache_adaptive_worker **out, char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!adaptive)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "adaptive is NULL");
    return worker_new(adaptive, NULL, out, message);
}

vcache_status vcache_adaptive_worker_create_beside(vcache_adaptive_worker *first, vcache_adaptive_worker **out,
                                                   char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!first)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "first is NULL");
    return worker_new(first->adaptive, first, out, message);
}

void vcache_adaptive_worker_destroy(vcache_adaptive_worker **worker)
{
    if (!worker || !*worker)
        return;
    vcache_allocator a = (*worker)->adaptive->config.allocator;
    a.release(a.context, *worker, (*worker)->bytes);
    *worker = NULL;
}

/* ------------------------------------------------------------------------------------------------ a shading point */

/* The bits of a contribution that counts: positive and finite. */
static inline bool contributes(float contribution, uint32_t *bits)
{
    memcpy(bits, &contribution, sizeof *bits);
    return *bits - 1 < 0x7f7fffffu;
}

/* Share of what remains that rounding does not reach. */
#define CLEARLY 1e-9

/* Step 2: S t > r(i), where `threshold` is S t and i the next to be given out. *below: how far S t at least is below
 * r(i), if that is known. */
static bool enough(vcache_adaptive_worker *w, double threshold, double *below)
{
    *below = 0.0;
    if (!(threshold > 0.0))
        return false;
    ranking *r = &w->ranking;
    uint32_t first = w->given, terms = w->adaptive->terms;
    double remain = r->rest[first];
    if (terms >= r->count - first || threshold > remain) {
        *below = remain - threshold;
        return threshold > remain;
    }
    if (terms == 1) {
        ranking_sort(r, first);
        return threshold > ranking_value(r->keys[first]);
    }
    uint32_t end = first + terms;
    for (;;) {
        uint32_t low = ranking_cut_before(r, end);
        if (low == end)
            return threshold > remain - r->rest[end];
        uint32_t high = ranking_cut_after(r, end);
        /* the brightest `inside` of these: at least their average, at most all, or what is brighter already */
        double all = r->rest[low] - r->rest[high], inside = end - low, before = remain - r->rest[low];
        double least = before + all * inside / (high - low), most = before + all;
        if (low > first && before + inside * ranking_value(r->keys[low - 1]) < most)
            most = before + inside * ranking_value(r->keys[low - 1]);
        if (threshold <= least) {
            *below = least - threshold;
            return false;
        }
        if (threshold > most)
            return true;
        ranking_part(r, low, high);
    }
}

void vcache_adaptive_begin(vcache_adaptive_worker *w, const float *contribution, float *weight, float relaxation)
{
    const vcache_adaptive_config *config = &w->adaptive->config;
    memset(weight, 0, config->sources * sizeof *weight);
    w->contribution = contribution;
    w->weight = weight;
    w->seen = w->at_most = 0.0;
    w->ranking.count = w->scanned = w->given = w->told = w->hit = 0;
    w->tolerance = (double)config->tolerance;
    if (w->tolerance == 0.0)
        return;
    if (relaxation > 1.0f)
        w->tolerance *= (double)relaxation;
    else if (relaxation == 0.0f)
        w->tolerance = DBL_MIN;
    w->scanned = config->sources;
    ranking *r = &w->ranking;
    double sum = 0.0;
    for (uint32_t i = 0; i < config->sources; i++) {
        uint32_t bits;
        bool counts = contributes(contribution[i], &bits);
        r->keys[r->count] = ranking_key(bits, i);
        r->count += counts;
        sum += counts ? (double)contribution[i] : 0.0;
    }
    ranking_begin(r, sum);
}

/* t = 0: those with a contribution, in their own order. */
static uint32_t next_exact(vcache_adaptive_worker *w, uint32_t *sources, uint32_t capacity)
{
    const float *contribution = w->contribution;
    uint64_t *keys = w->ranking.keys + w->given;
    uint32_t i = w->scanned, end = w->adaptive->config.sources, count = 0, bits;
    for (; count < capacity && i < end; i++)
        if (contributes(contribution[i], &bits)) {
            keys[count] = ranking_key(bits, i);
            sources[count++] = i;
        }
    w->scanned = i;
    w->ranking.count = w->given += count;
    return count;
}

uint32_t vcache_adaptive_next(vcache_adaptive_worker *w, uint32_t *sources, uint32_t capacity)
{
    if (w->tolerance == 0.0)
        return next_exact(w, sources, capacity);
    ranking *r = &w->ranking;
    uint32_t count = 0;
    double below =
        0.0; /* of S t below r(i); each source given out takes at most its value from r, and its t from S t */
    while (count < capacity && w->given < r->count) {
        if (below <= CLEARLY * r->rest[w->given] && enough(w, w->at_most * w->tolerance, &below))
            break;
        ranking_sort(r, w->given);
        uint64_t key = r->keys[w->given++];
        double value = ranking_value(key);
        w->at_most += value;
        below -= value * (1.0 + w->tolerance);
        sources[count++] = ranking_source(key);
    }
    return count;
}

/* One more test of a source, for the hit rates. Free-running: of two threads at once the older rate may stay, until
 * the next test of the source. */
static void count_test(vcache_adaptive_worker *w, uint32_t source, uint64_t hit)
{
    vcache_adaptive *a = w->adaptive;
    if (!a->config.free_running) {
        w->tests[source]++;
        w->hits[source] += hit;
        return;
    }
    uint64_t tests = atomic_fetch_add_explicit(&a->tests[source], 1, memory_order_relaxed) + 1;
    uint64_t hits = hit ? atomic_fetch_add_explicit(&a->hits[source], 1, memory_order_relaxed) + 1
                        : atomic_load_explicit(&a->hits[source], memory_order_relaxed);
    set_rate(a, source, tests, hits);
}

void vcache_adaptive_tell(vcache_adaptive_worker *w, const vcache_answer *answers)
{
    const uint64_t *keys = w->ranking.keys + w->told;
    float *weight = w->weight;
    uint32_t count = w->given - w->told, hits = 0;
    bool exact = w->tolerance == 0.0;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t source = ranking_source(keys[i]), hit = answers[i] & VCACHE_VISIBLE;
        hits += hit;
        weight[source] = (float)hit;
        if (exact)
            continue; /* nobody reads what follows */
        w->seen += hit ? ranking_value(keys[i]) : 0.0;
        count_test(w, source, hit);
    }
    w->hit += hits;
    w->told = w->given;
    w->at_most = w->seen;
}

uint32_t vcache_adaptive_finish(vcache_adaptive_worker *w)
{
    uint32_t tested = w->told;
    if (w->tolerance != 0.0 && tested < w->ranking.count) { /* step 3 */
        const vcache_adaptive *a = w->adaptive;
        float fraction = tested ? (float)((double)w->hit / (double)tested) : 1.0f;
        for (uint32_t i = tested; i < w->ranking.count; i++) {
            uint32_t source = ranking_source(w->ranking.keys[i]);
            w->weight[source] = fraction * atomic_load_explicit(&a->rate[source], memory_order_relaxed);
        }
    }
    w->statistics.points++;
    w->statistics.candidates += w->ranking.count;
    w->statistics.tested += tested;
    w->statistics.visible += w->hit;
    w->statistics.compared += w->ranking.compared;
    /* until the next point there is nothing to give out */
    w->ranking.compared = 0;
    w->ranking.count = w->given = w->told = w->hit = 0;
    w->scanned = w->adaptive->config.sources;
    return tested;
}

/* ------------------------------------------------------------------------------------------------------ hit rates */

void vcache_adaptive_merge(vcache_adaptive *a, vcache_adaptive_worker *const *workers, uint32_t count)
{
    if (a->config.free_running)
        return;
    for (uint32_t i = 0; i < a->config.sources; i++) {
        uint64_t tests = atomic_load_explicit(&a->tests[i], memory_order_relaxed);
        uint64_t hits = atomic_load_explicit(&a->hits[i], memory_order_relaxed);
        for (uint32_t k = 0; k < count; k++) {
            tests += workers[k]->tests[i];
            hits += workers[k]->hits[i];
            workers[k]->tests[i] = workers[k]->hits[i] = 0;
        }
        atomic_store_explicit(&a->tests[i], tests, memory_order_relaxed);
        atomic_store_explicit(&a->hits[i], hits, memory_order_relaxed);
        set_rate(a, i, tests, hits);
    }
}

vcache_adaptive_source vcache_adaptive_source_rate(const vcache_adaptive *a, uint32_t source)
{
    return (vcache_adaptive_source){.tests = atomic_load_explicit(&a->tests[source], memory_order_relaxed),
                                    .hits = atomic_load_explicit(&a->hits[source], memory_order_relaxed),
                                    .rate = atomic_load_explicit(&a->rate[source], memory_order_relaxed)};
}

void vcache_adaptive_worker_statistics(const vcache_adaptive_worker *w, vcache_adaptive_statistics *out)
{
    /* an older host may know a shorter struct */
    size_t bytes = out->size < sizeof *out ? out->size : sizeof *out;
    if (bytes < sizeof out->size)
        return;
    vcache_adaptive_statistics all = w->statistics;
    all.size = bytes;
    memcpy(out, &all, bytes);
}

void vcache_adaptive_worker_reset_statistics(vcache_adaptive_worker *w)
{
    memset(&w->statistics, 0, sizeof w->statistics);
}
