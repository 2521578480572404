/* SPDX-License-Identifier: Apache-2.0 */
/* Every light is expected from what its cells saw; the error of that is estimated from K rays. Unbiased whatever the
 * cells hold, as long as they stay as they are while one eye sample is estimated. */
#include "replay.h"

#include "halton/halton.h"

#include <string.h>

enum { BLOCK = 16 }; /* lights whose deviations are summed before the sample's points are looked for */

typedef float lanes __attribute__((vector_size(4 * BLOCK)));

/* A ray whose answer is not yet learned. */
typedef struct lesson {
    uint32_t cell[MAX_CELLS];
    uint32_t light;
    uint8_t state, visible;
} lesson;

typedef struct replay {
    const record *r;
    const estimator_policy *p;
    vcache *cache;
    cells cells;
    uint32_t levels; /* cells of an eye sample */
    rgb *difference;
    uint32_t *visits;     /* eye samples of a pixel so far */
    uint64_t spread[256]; /* bit i of a byte to byte i */
    float mean[MAX_STATES], deviation[MAX_STATES];
    double traced[MAX_STATES], seen[MAX_STATES]; /* what the table is learned from */
    lesson *lessons;
    uint32_t lesson_count, lesson_capacity;
    double adapt_sum, adapt_count;
    state_tally *tallies;
    uint32_t (*picks)[2];
    /* of the eye sample at hand */
    record_row row;
    uint8_t *state, *visible; /* bytes of each light */
    float *weight, *block;    /* contribution times deviation; its sums over blocks */
    float *error;             /* expected less true visibility */
    uint32_t cell[MAX_CELLS];
    replay_result result;
} replay;

/* Mean visibility of traced pairs by state, smallest cell in the lowest two bits (1: seen visible, 2: seen blocked), as
 * --states prints it: kitchen, conference and living-room together, so that other scenes are foreign to it. States of
 * few traced pairs lean on all pairs that were in them. */
/* clang-format off */
static const float fixed_mean[STATES] = {
    0.6821f, 0.9797f, 0.0472f, 0.5854f, 0.9583f, 0.9848f, 0.4114f, 0.7938f,
    0.0982f, 0.7302f, 0.0314f, 0.4005f, 0.5718f, 0.8901f, 0.1668f, 0.5557f,
    0.9530f, 0.9908f, 0.3045f, 0.7471f, 0.9929f, 0.9989f, 0.5585f, 0.9193f,
    0.4835f, 0.8223f, 0.2158f, 0.4609f, 0.8694f, 0.9842f, 0.4402f, 0.8978f,
    0.0959f, 0.8037f, 0.0193f, 0.3945f, 0.6097f, 0.8345f, 0.2165f, 0.4313f,
    0.0145f, 0.4499f, 0.0008f, 0.0960f, 0.1781f, 0.5848f, 0.0228f, 0.1246f,
    0.6450f, 0.9423f, 0.1075f, 0.5495f, 0.9523f, 0.9941f, 0.4469f, 0.8960f,
    0.1089f, 0.6188f, 0.0122f, 0.1351f, 0.5722f, 0.9430f, 0.0882f, 0.5408f,
};
/* clang-format on */

static void set_entry(replay *s, uint32_t state)
{
    float m = s->p->alone                  ? 0.0f
              : s->p->table == TABLE_FIXED ? fixed_mean[state % STATES]
                                           : (float)(s->seen[state] / s->traced[state]);
    s->mean[state] = m;
    s->deviation[state] = s->p->alone ? 1.0f : sqrtf(m * (1.0f - m)) + 0.02f;
}

/* Two pairs' worth of what the smallest cell that knows something says. */
static void begin_table(replay *s)
{
    static const double means[4] = {0.5, 0.95, 0.05, 0.5};
    for (uint32_t i = 0; i < 1u << 2 * s->levels; i++) {
        double m = 0.5;
        for (uint32_t c = s->levels; c-- > 0;)
            m = i >> 2 * c & 3u ? means[i >> 2 * c & 3u] : m;
        s->traced[i] = 2.0;
        s->seen[i] = 2.0 * m;
        set_entry(s, i);
    }
}

static void learn(replay *s)
{
    for (uint32_t i = 0; i < s->lesson_count; i++) {
        const lesson *l = &s->lessons[i];
        for (uint32_t c = 0; c < s->levels; c++) {
            uint64_t *row = cells_row(&s->cells, l->cell[c]) + (l->visible ? 0 : s->r->words);
            row[l->light / 64] |= (uint64_t)1 << l->light % 64;
        }
        s->traced[l->state] += 1.0;
        s->seen[l->state] += l->visible;
        set_entry(s, l->state);
    }
    s->lesson_count = 0;
}

/* State of each light: two bits a cell, those of the smallest cell lowest. */
static void look(replay *s, uint32_t eye)
{
    const record *r = s->r;
    float ce = s->p->ce > 0.0f ? s->p->ce : 8.0f, ratio = s->p->ratio > 0.0f ? s->p->ratio : 4.0f;
    for (uint32_t c = 0; c < s->levels; c++, ce *= ratio) {
        _Alignas(8) char memory[VCACHE_EYE_BYTES];
        vcache_eye *end = (vcache_eye *)(void *)memory;
        vcache_surface at = replay_jitter(r, eye, ce, s->p->jitter);
        vcache_prepare_eye(s->cache, &at, ce, 0, end);
        s->cell[c] = cells_add(&s->cells, end->levels ? end->level[0].center : 1);
    }
    memset(s->state, 0, r->padded);
    for (uint32_t c = 0; c < s->levels; c++) {
        const unsigned char *seen = (const unsigned char *)cells_row(&s->cells, s->cell[c]);
        const unsigned char *blocked = seen + r->padded / 8;
        for (uint32_t i = 0; i < r->padded / 8; i++) {
            uint64_t eight;
            memcpy(&eight, s->state + 8 * i, sizeof eight);
            eight |= (s->spread[seen[i]] | s->spread[blocked[i]] << 1) << 2 * c;
            memcpy(s->state + 8 * i, &eight, sizeof eight);
        }
    }
}

/* Weights of the sample, and what is expected of each light less what is true. */
CLONES static void weigh(const float *restrict luminance, const uint8_t *restrict state,
                         const uint8_t *restrict visible, const float *restrict deviation, const float *restrict mean,
                         uint32_t count, float *restrict weight, float *restrict error)
{
    for (uint32_t i = 0; i < count; i++)
        weight[i] = luminance[i] * deviation[state[i]];
    for (uint32_t i = 0; i < count; i++)
        error[i] = mean[state[i]] - (float)visible[i];
}

CLONES static float dot(const float *a, const float *b, uint32_t count)
{
    lanes sum = {0};
    for (uint32_t i = 0; i < count; i += BLOCK) {
        lanes x, y;
        memcpy(&x, a + i, sizeof x);
        memcpy(&y, b + i, sizeof y);
        sum += x * y;
    }
    float all = 0.0f;
    for (uint32_t k = 0; k < BLOCK; k++)
        all += sum[k];
    return all;
}

CLONES static float sum_blocks(const float *weight, uint32_t blocks, float *block)
{
    float all = 0.0f;
    for (uint32_t b = 0; b < blocks; b++) {
        float x[4] = {0};
        for (uint32_t i = 0; i < BLOCK; i += 4)
            for (uint32_t k = 0; k < 4; k++)
                x[k] += weight[b * BLOCK + i + k];
        block[b] = (x[0] + x[1]) + (x[2] + x[3]);
        all += block[b];
    }
    return all;
}

/* Where the systematic sample of this eye sample begins, in steps. */
static float offset(replay *s, uint32_t eye)
{
    uint32_t pixel = s->r->pixel[eye];
    if (s->p->offsets == OFFSET_INDEPENDENT) {
        rng own = rng_make(1, eye);
        return rng_float(&own);
    }
    rng shift = rng_make(2, pixel);
    float x = rng_float(&shift) + (float)halton_radical_inverse2(s->visits[pixel]++);
    return x - floorf(x);
}

static float ray_count(replay *s, float deviations)
{
    if (!(s->p->adapt > 0.0f))
        return s->p->rays;
    double x = pow((double)deviations, (double)s->p->adapt);
    s->adapt_sum += x;
    s->adapt_count += 1.0;
    double k = x * s->adapt_count / s->adapt_sum;
    return s->p->rays * (float)(k < 0.1 ? 0.1 : k > 4.0 ? 4.0 : k);
}

/* One light traced; returns what it adds to the expected sum. */
static rgb trace(replay *s, uint32_t eye, uint32_t i, float probability)
{
    bool visible = s->visible[i] != 0;
    uint8_t state = s->state[i];
    if (s->picks)
        s->picks[s->result.rays][0] = eye, s->picks[s->result.rays][1] = i;
    s->result.rays++;
    if (s->tallies) {
        s->tallies[state].picked++;
        s->tallies[state].picked_visible += visible;
    }
    if (!s->p->alone) {
        if (s->lesson_count == s->lesson_capacity) {
            s->lesson_capacity = 2 * s->lesson_capacity + 1024;
            s->lessons = xrealloc(s->lessons, s->lesson_capacity * sizeof *s->lessons);
        }
        lesson *l = &s->lessons[s->lesson_count++];
        memcpy(l->cell, s->cell, sizeof l->cell);
        l->light = i, l->state = state, l->visible = visible;
    }
    float w = ((visible ? 1.0f : 0.0f) - s->mean[state]) / probability;
    return v3(w * s->row.r[i], w * s->row.g[i], w * s->row.b[i]);
}

/* Systematic sample over the running sum of the weights. */
static rgb sample(replay *s, uint32_t eye, float deviations)
{
    rgb sum = {0, 0, 0};
    float step = deviations / ray_count(s, deviations), next = offset(s, eye) * step, before = 0.0f;
    for (uint32_t b = 0; b < s->r->padded / BLOCK; before += s->block[b++]) {
        if (before + s->block[b] <= next)
            continue;
        float run = before;
        for (uint32_t i = b * BLOCK; i < (b + 1) * BLOCK; i++) {
            run += s->weight[i];
            if (!(run > next) || !(s->weight[i] > 0.0f))
                continue;
            sum = v3_add(sum, trace(s, eye, i, s->weight[i] < step ? s->weight[i] / step : 1.0f));
            next += step * (floorf((run - next) / step) + 1.0f);
        }
    }
    return sum;
}

static void tally(replay *s, uint32_t eye)
{
    for (uint32_t i = 0; i < s->r->lights.count; i++)
        if (s->r->asked[(size_t)eye * s->r->words + i / 64] >> i % 64 & 1u) {
            s->tallies[s->state[i]].asked++;
            s->tallies[s->state[i]].visible += s->visible[i];
        }
}

static void one_eye(replay *s, uint32_t eye)
{
    const record *r = s->r;
    record_contributions(r, eye, &s->row);
    const unsigned char *bits = (const unsigned char *)(r->visible + (size_t)eye * r->words);
    for (uint32_t i = 0; i < r->padded / 8; i++)
        memcpy(s->visible + 8 * i, &s->spread[bits[i]], 8);
    if (!s->p->alone)
        look(s, eye);
    if (s->tallies)
        tally(s, eye);
    weigh(s->row.luminance, s->state, s->visible, s->deviation, s->mean, r->padded, s->weight, s->error);
    float deviations = sum_blocks(s->weight, r->padded / BLOCK, s->block);
    if (!(deviations > 0.0f))
        return;
    rgb error = {dot(s->error, s->row.r, r->padded), dot(s->error, s->row.g, r->padded),
                 dot(s->error, s->row.b, r->padded)};
    rgb *d = &s->difference[r->pixel[eye]];
    *d = v3_add(*d, v3_add(error, sample(s, eye, deviations)));
}

replay_result replay_estimator(const record *r, const estimator_policy *p, state_tally *tallies, uint32_t (*picks)[2])
{
    replay *s = xcalloc(1, sizeof *s);
    size_t pixels = (size_t)r->view.settings.width * r->view.settings.height;
    vcache_config config = vcache_default_config();
    config.levels = 1;
    config.layers = p->layers ? p->layers : config.layers;
    s->r = r;
    s->p = p;
    s->cache = record_cache(r, config);
    s->levels = p->alone ? 0 : p->cells ? (uint32_t)p->cells : 3;
    s->tallies = tallies;
    s->picks = picks;
    s->difference = xcalloc(pixels, sizeof *s->difference);
    s->visits = xcalloc(pixels, sizeof *s->visits);
    s->state = xcalloc(r->padded, 1);
    s->visible = xcalloc(r->padded, 1);
    s->weight = xcalloc(r->padded, sizeof *s->weight);
    s->block = xcalloc(r->padded / BLOCK, sizeof *s->block);
    s->error = xcalloc(r->padded, sizeof *s->error);
    s->row = record_row_new(r);
    cells_new(&s->cells, r->words);
    for (uint32_t byte = 0; byte < 256; byte++) {
        unsigned char eight[8];
        for (int i = 0; i < 8; i++)
            eight[i] = byte >> i & 1u;
        memcpy(&s->spread[byte], eight, sizeof eight);
    }
    begin_table(s);

    uint32_t *order = xmalloc(r->count * sizeof *order), delay = p->delay > 1 ? (uint32_t)p->delay : 1;
    record_sort(r, p->order, (p->ce > 0.0f ? (double)p->ce : 8.0) / sqrt(r->view.settings.spp), order);
    for (uint32_t i = 0; i < r->count; i++) {
        one_eye(s, order[i]);
        if ((i + 1) % delay == 0)
            learn(s);
    }
    replay_result result = s->result;
    result.l_inf = replay_l_inf(r, s->difference);
    result.cells = s->cells.count;

    free(order);
    cells_free(&s->cells);
    record_row_free(&s->row);
    free(s->block);
    free(s->weight);
    free(s->error);
    free(s->visible);
    free(s->state);
    free(s->visits);
    free(s->difference);
    free(s->lessons);
    vcache_destroy(&s->cache);
    free(s);
    return result;
}
