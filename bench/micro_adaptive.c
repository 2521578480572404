/* SPDX-License-Identifier: Apache-2.0 */
/* A point of adaptive shadow testing: what choosing costs beside the rays, with incremental sorting and with qsort. */
#include "micro.h"

#include <vcache/adaptive.h>

#include <stdlib.h>

enum { POINTS = 16, MOST = 10000, PACKET = 16 };

const uint32_t micro_adaptive_lights[MICRO_ADAPTIVE_SIZES] = {24, 192, 1000, 10000};

/* Lamps at random distances; three of four are seen. */
typedef struct lamps {
    uint32_t count;
    float *contribution, *weight; /* [POINTS][count] */
    vcache_adaptive *rates;
    vcache_adaptive_worker *worker;
} lamps;

static bool seen(uint32_t source, uint64_t point)
{
    return (source * 2654435761u + (uint32_t)point * 40503u) >> 30 != 0;
}

static lamps *lamps_of(int size)
{
    static lamps all[MICRO_ADAPTIVE_SIZES];
    lamps *l = &all[size];
    if (l->count)
        return l;
    uint64_t seed = 5;
    l->count = micro_adaptive_lights[size];
    l->contribution = need(calloc((size_t)POINTS * l->count, sizeof(float)));
    l->weight = need(calloc(l->count, sizeof(float)));
    for (size_t i = 0; i < (size_t)POINTS * l->count; i++) {
        float d = 1.0f + 8.0f * random_unit(&seed);
        l->contribution[i] = 1.0f / (d * d * d * d);
    }
    vcache_adaptive_config config = vcache_adaptive_default_config();
    config.sources = l->count;
    config.tolerance = 0.2f;
    if (vcache_adaptive_create(&config, &l->rates, NULL) != VCACHE_OK ||
        vcache_adaptive_worker_create(l->rates, &l->worker, NULL) != VCACHE_OK)
        die("no memory for %u lights", l->count);
    return l;
}

static uint32_t incremental(lamps *l, uint64_t point)
{
    uint32_t sources[PACKET], n;
    vcache_answer answers[PACKET];
    vcache_adaptive_begin(l->worker, l->contribution + point * l->count, l->weight, 1.0f);
    while ((n = vcache_adaptive_next(l->worker, sources, PACKET)) > 0) {
        for (uint32_t i = 0; i < n; i++)
            answers[i] = seen(sources[i], point) ? VCACHE_VISIBLE : VCACHE_BLOCKED;
        vcache_adaptive_tell(l->worker, answers);
    }
    return vcache_adaptive_finish(l->worker);
}

typedef struct candidate {
    float value;
    uint32_t source;
} candidate;

static int brighter(const void *a, const void *b)
{
    float x = ((const candidate *)a)->value, y = ((const candidate *)b)->value;
    return (x < y) - (x > y);
}

/* The paper's steps as they are printed. */
static uint32_t sorted(lamps *l, uint64_t point)
{
    static candidate order[MOST];
    static double rest[MOST + 1];
    uint32_t count = l->count, terms = (count + 1) / 2, tests = 0, hits = 0;
    const float *contribution = l->contribution + point * count;
    for (uint32_t i = 0; i < count; i++)
        order[i] = (candidate){contribution[i], i};
    qsort(order, count, sizeof *order, brighter);
    rest[count] = 0.0;
    for (uint32_t i = count; i-- > 0;)
        rest[i] = rest[i + 1] + (double)order[i].value;
    double sum = 0.0, t = 0.2f;
    for (; tests < count; tests++) {
        uint32_t end = tests + terms < count ? tests + terms : count;
        if (sum * t > rest[tests] - rest[end])
            break;
        bool hit = seen(order[tests].source, point);
        hits += hit;
        sum += hit ? (double)order[tests].value : 0.0;
        l->weight[order[tests].source] = hit;
    }
    float fraction = (float)hits / (float)tests;
    for (uint32_t i = tests; i < count; i++)
        l->weight[order[i].source] = fraction * vcache_adaptive_source_rate(l->rates, order[i].source).rate;
    return tests;
}

uint64_t micro_adaptive(const micro_case *m, world *w, uint64_t steps)
{
    (void)w;
    lamps *l = lamps_of(m->variant / 2);
    bool full = m->variant % 2;
    if (incremental(l, 1) != sorted(l, 1)) /* they must agree on what is to be tested */
        die("incremental and full sorting test different lights");
    for (uint64_t i = 0; i < steps; i++)
        micro_sink += full ? sorted(l, i % POINTS) : incremental(l, i % POINTS);
    return steps;
}
