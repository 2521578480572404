/* SPDX-License-Identifier: Apache-2.0 */
/* The rows of a light set as a control variate: what is expected of each light, which lights to trace, what to learn.
 */
#include "light_set.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* What a predictor expects at first: visible rays per thousand by the states of the coarse, middle and fine cell (known
 * | visible << 1: unknown, blocked, both, visible), counted over four interiors; `bench/policies --states` counts
 * again, with other samples, and comes within a few per cent where a state is not rare. Wrong numbers cost rays, never
 * bias, and vcache_adapt mends them. */
static const uint16_t visible_share[STATES] = {
    658, 40,  408, 971, /* coarse and middle unknown */
    82,  27,  268, 670, /* middle blocked */
    571, 128, 560, 866, /* middle both */
    955, 341, 648, 978, /* middle visible */
    81,  13,  258, 822, /* coarse blocked, middle unknown */
    11,  1,   86,  451, /* middle blocked */
    174, 21,  117, 512, /* middle both */
    598, 230, 551, 853, /* middle visible */
    638, 109, 578, 930, /* coarse both, middle unknown */
    102, 11,  134, 569, /* middle blocked */
    581, 105, 534, 930, /* middle both */
    950, 498, 881, 993, /* middle visible */
    955, 292, 644, 988, /* coarse visible, middle unknown */
    484, 217, 407, 776, /* middle blocked */
    864, 501, 893, 981, /* middle both */
    992, 632, 888, 999, /* middle visible */
};

/* Added to each deviation: no light is left out, however sure the cells are. Larger: more rays where nothing changes;
 * smaller: rare surprises weigh more. */
static const float least_deviation = 0.02f;

/* Answers that the first table stands for, a state; answers until the table is made again: at first, and at most; of a
 * state, before old ones fade. */
enum { ADAPT_PRIOR = 50, ADAPT_FIRST = 1024, ADAPT_STEP = 1 << 16, ADAPT_MOST = 1 << 20 };

static uint32_t float_bits(float f)
{
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

/* The deviation goes into the lower half of the mean, which changes it by less than 2^-7 of itself: any mean will do,
 * if prediction and correction use the same. Where none is wanted it is next to 0, but no denormal: those are slow. */
void predict_states(vcache_drawing drawing, const float share[STATES], float states[STATES])
{
    for (int i = 0; i < STATES; i++) {
        float mean = share ? share[i] : (float)visible_share[i] / 1000.0f,
              deviation = sqrtf(mean * (1.0f - mean)) + least_deviation;
        if (drawing != VCACHE_DRAW_UNCERTAIN) {
            deviation = drawing == VCACHE_DRAW_VISIBLE ? sqrtf(mean) + least_deviation : 1.0f;
            mean = 0x1p-60f;
        }
        uint32_t bits = (float_bits(mean) & 0xffff0000u) | float_bits(deviation) >> 16;
        memcpy(&states[i], &bits, sizeof bits);
    }
}

/* Where little was visible so far, little more will be: each of so many classes of cells, by the share seen visible of
 * what the finest cell has asked for, has expectations of its own. */
enum { CLASSES = 8 };

struct vcache_predictor {
    float states[CLASSES][STATES]; /* predict_input.table */
    uint32_t class;                /* of the last prediction */
    vcache_drawing drawing;
    uint64_t adapted, adapt_at;       /* answers so far, and with how many the table is made again */
    float counts[CLASSES][STATES][2]; /* of blocked and of visible answers */
    vcache_light_set *set;
    size_t bytes;
    uint64_t *rows; /* known and visible words of the three cells */
    float *mean, *sums;
    const float *contribution; /* the host's */
    float deviation;
};

vcache_status vcache_predictor_create(vcache_light_set *set, vcache_drawing drawing, vcache_predictor **out,
                                      char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!set)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "set is NULL");
    if ((unsigned)drawing > VCACHE_DRAW_BRIGHT)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "drawing is none of VCACHE_DRAW_...");
    size_t words = set->words, header = (sizeof(vcache_predictor) + 63) / 64 * 64, padded = words * 64;
    size_t rows = (2 * VCACHE_CELLS * words * sizeof(uint64_t) + 63) / 64 * 64;
    size_t bytes = header + rows + (padded + LANES * words) * sizeof(float);
    const vcache_allocator *a = &set->cache->config.allocator;
    char *block = a->allocate(a->context, bytes);
    if (!block)
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for a predictor");
    vcache_predictor *p = (vcache_predictor *)(void *)block;
    for (int i = 0; i < CLASSES; i++)
        predict_states(drawing, NULL, p->states[i]);
    p->drawing = drawing;
    p->adapt_at = ADAPT_FIRST;
    p->set = set;
    p->bytes = bytes;
    p->rows = (uint64_t *)(void *)(block + header);
    p->mean = (float *)(void *)(block + header + rows);
    p->sums = p->mean + padded;
    *out = p;
    return VCACHE_OK;
}

void vcache_predictor_destroy(vcache_predictor **predictor)
{
    if (!predictor || !*predictor)
        return;
    vcache_allocator a = (*predictor)->set->cache->config.allocator;
    a.release(a.context, *predictor, (*predictor)->bytes);
    *predictor = NULL;
}

uint32_t vcache_light_set_padded(const vcache_light_set *set)
{
    return 64 * set->words;
}

vcache_prediction vcache_predict(vcache_predictor *p, const vcache_surface *eye, float ce, uint64_t salt,
                                 const float *contribution)
{
    const vcache_light_set *set = p->set;
    vcache_prediction out = {.mean = p->mean};
    predict_input in = {.words = set->words, .contribution = contribution};
    uint64_t epoch_key = atomic_load_explicit(&set->cache->epoch_key, memory_order_acquire);
    if (p->drawing != VCACHE_DRAW_BRIGHT && eye_cells(set->cache, eye, ce, salt, out.cells.key))
        for (int i = 0; i < VCACHE_CELLS; i++) {
            out.cells.key[i] = row_key(epoch_key, out.cells.key[i]);
            row_prefetch(set, out.cells.key[i], 0, set->words);
        }
    for (size_t i = 0; i < VCACHE_CELLS; i++) {
        uint64_t *row = p->rows + 2 * i * set->words;
        in.known[i] = row;
        in.visible[i] = row + set->words;
        if (out.cells.key[i])
            row_read(set, out.cells.key[i], 0, set->words, row, row + set->words);
        else
            memset(row, 0, 2 * set->words * sizeof *row);
    }
    uint32_t asked, seen; /* a cell that knows nothing is in the middle class */
    set->cache->kernels->tally(in.known[0], in.visible[0], set->words, &asked, &seen);
    p->class = (seen + 4) * CLASSES / (2 * asked + 8 + 1);
    in.table = p->states[p->class];
    const predict_output to = {p->mean, p->sums};
    out.expected = set->cache->kernels->predict(&in, &to);
    p->contribution = contribution;
    p->deviation = 0.0f;
    for (uint32_t w = 0; w < set->words; w++)
        p->deviation += p->sums[LANES * w + LANES - 1];
    out.deviation = p->deviation;
    return out;
}

/* The light of a word whose weight lies around `at` on a line along which all weights of the word lie side by side,
 * lane by lane; *end becomes where its weight ends, *weight what it is. No branch on where that is: it is random. */
static uint32_t find_light(const vcache_predictor *p, uint32_t word, float at, float *end, float *weight)
{
    enum { PARTS = 64 / LANES };
    const float *sums = p->sums + LANES * word;
    uint32_t lane = 0, part = 0;
    for (uint32_t k = 0; k < LANES - 1; k++)
        lane += sums[k] <= at;
    uint32_t first = 64 * word + lane, last = 0;
    float w[PARTS], ends[PARTS], sum = lane > 0 ? sums[lane - 1] : 0.0f;
    for (uint32_t i = 0; i < PARTS; i++) {
        float product = p->contribution[first + LANES * i] * deviation_of(p->mean[first + LANES * i]);
        w[i] = product > 0.0f ? product : 0.0f;
        ends[i] = sum += w[i];
        last = w[i] > 0.0f ? i : last;
    }
    for (uint32_t i = 0; i < PARTS - 1; i++)
        part += ends[i] <= at;
    part = part < last ? part : last; /* rounding: beyond the last weight */
    *end = ends[part];
    *weight = w[part];
    return first + LANES * part;
}

static uint32_t state_of(const vcache_predictor *p, uint32_t light)
{
    const uint64_t *known = p->rows + light / 64;
    uint32_t state = p->class * STATES;
    for (uint32_t k = 0; k < VCACHE_CELLS; k++, known += 2 * p->set->words)
        state |= (uint32_t)(known[0] >> light % 64 & 1) << 2 * k | (uint32_t)(known[p->set->words] >> light % 64 & 1)
                                                                       << (2 * k + 1);
    return state;
}

/* A comb of teeth `step` apart falls on the line of all weights; its teeth belong to the samples by turns, from one
 * drawn at random on. So each sample has a comb of its own, with teeth samples * step apart and a uniform offset: one
 * of them is on light i with probability weight / (samples * step). */
uint32_t vcache_pick_lights(const vcache_predictor *p, float rays, uint32_t samples, double random, vcache_pick *picks,
                            uint32_t capacity)
{
    if (!(p->deviation > 0.0f) || !(rays > 0.0f) || capacity < 3 || samples < 1)
        return 0;
    if (rays > (float)(capacity - 2))
        rays = (float)(capacity - 2);
    random = random < 1.0 ? random : 1.0 - 0x1p-53; /* floats round up to it */
    random = random > 0.0 ? random : 0.0;
    /* in double: so many teeth one behind the other would drift */
    double step = (double)p->deviation / (double)rays, turn = random * (double)samples, own = step * samples;
    double tooth = 0.0, at = 0.0, offset = turn - floor(turn), next = offset * step;
    uint32_t count = 0, sample = (uint32_t)turn, last = UINT32_MAX, hits = 0; /* of the last light */
    for (uint32_t w = 0; w < p->set->words; w++) {
        double word = (double)p->sums[LANES * w + LANES - 1];
        while (at + word > next && count < capacity) {
            float end, weight;
            uint32_t light = find_light(p, w, (float)(next - at), &end, &weight);
            double times = (double)weight < own ? own / (double)weight : 1.0;
            hits = light == last ? hits + 1 : 1;
            last = light;
            /* rounding may find a light once too often, or one of hardly any weight */
            if (times <= (double)FLT_MAX && hits <= samples)
                picks[count++] = (vcache_pick){light, sample, state_of(p, light), (float)times};
            tooth += 1.0;
            sample = sample + 1 < samples ? sample + 1 : 0;
            if (hits >= samples && at + (double)end > next + step) { /* of all samples for sure, and of each once */
                uint64_t skip = (uint64_t)((at + (double)end - next) / step);
                tooth += (double)skip;
                sample = (uint32_t)((sample + skip) % samples);
            }
            next = (tooth + offset) * step;
        }
        at += word;
    }
    return count;
}

/* Share of visible among the answers, `first` standing for ADAPT_PRIOR of them. */
static float share_of(float first, const float answers[2])
{
    return (first * ADAPT_PRIOR + answers[1]) / (ADAPT_PRIOR + answers[0] + answers[1]);
}

/* What all classes have found of a state is what each of them begins with. */
static void make_again(vcache_predictor *p)
{
    float share[CLASSES][STATES];
    for (int i = 0; i < STATES; i++) {
        float all[2] = {0.0f, 0.0f};
        for (int c = 0; c < CLASSES; c++)
            for (int k = 0; k < 2; k++)
                all[k] += p->counts[c][i][k];
        float first = share_of((float)visible_share[i] / 1000.0f, all);
        for (int c = 0; c < CLASSES; c++) {
            float *n = p->counts[c][i];
            share[c][i] = share_of(first, n);
            if (n[0] + n[1] > ADAPT_MOST) /* floats would stop counting; and scenes change */
                n[0] *= 0.5f, n[1] *= 0.5f;
        }
    }
    for (int c = 0; c < CLASSES; c++)
        predict_states(p->drawing, share[c], p->states[c]);
}

/* Lights are drawn in proportion to contribution x deviation: shares of answers, not of lights, make the variance
 * least. The table is made again rarely, for that takes longer than counting. */
void vcache_adapt(vcache_predictor *p, const vcache_pick *picks, const vcache_answer *answers, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        if (!(answers[i] & VCACHE_ONCE)) {
            p->counts[picks[i].state / STATES % CLASSES][picks[i].state % STATES][answers[i] & VCACHE_VISIBLE] += 1.0f;
            p->adapted++;
        }
    if (p->adapted < p->adapt_at)
        return;
    make_again(p);
    p->adapt_at = p->adapted + (p->adapted < ADAPT_STEP ? p->adapted : ADAPT_STEP);
}

/* What 64 lights of a row become where some are found visible and some blocked. */
static light_states learnt(light_states old, uint64_t visible, uint64_t blocked)
{
    uint64_t asked = visible | blocked, before = ~old.known & old.visible;
    uint64_t both = (before & asked) | (visible & blocked) | (old.known & old.visible & blocked) |
                    (old.known & ~old.visible & visible);
    return (light_states){(old.known & ~asked) | (asked & ~both), (old.visible & ~asked) | (visible & ~both) | both};
}

/* What was found of the lights of one word. */
typedef struct finding {
    uint32_t word;
    uint64_t visible, blocked;
} finding;

static void learn_findings(vcache_light_set *set, uint64_t key, const finding *found, uint32_t count)
{
    /* most of what is traced confirms what is known: then nothing is written */
    const _Atomic uint64_t *read = row_of(set, key);
    bool mine = atomic_load_explicit(&read[ROW_KEY], memory_order_relaxed) == key, news = false, replaced;
    for (uint32_t i = 0; i < count && !news; i++) {
        light_states old = mine ? row_states(set, read, found[i].word) : (light_states){0, 0};
        light_states now = learnt(old, found[i].visible, found[i].blocked);
        news = now.known != old.known || now.visible != old.visible;
    }
    _Atomic uint64_t *row = news ? row_open(set, key, &replaced) : NULL;
    if (!row)
        return; /* nothing new, or another thread's turn */
    for (uint32_t i = 0; i < count; i++) {
        light_states old = row_states(set, row, found[i].word);
        row_store(set, row, found[i].word, learnt(old, found[i].visible, found[i].blocked));
    }
    row_close(row);
}

void vcache_learn(vcache_light_set *set, const vcache_cells *cells, const vcache_pick *picks,
                  const vcache_answer *answers, uint32_t count)
{
    enum { FINDINGS = 64 };
    finding found[FINDINGS];
    for (uint32_t i = 0; i < count;) {
        uint32_t n = 0;
        for (; i < count; i++) {
            if (answers[i] & VCACHE_ONCE)
                continue;
            uint32_t word = picks[i].light / 64;
            if (n == 0 || found[n - 1].word != word) {
                if (n == FINDINGS)
                    break;
                found[n++] = (finding){.word = word};
            }
            uint64_t bit = (uint64_t)1 << picks[i].light % 64, visible = answers[i] & VCACHE_VISIBLE ? bit : 0;
            found[n - 1].visible |= visible;
            found[n - 1].blocked |= bit ^ visible;
        }
        for (int k = 0; k < VCACHE_CELLS; k++)
            if (cells->key[k] && (k == 0 || cells->key[k] != cells->key[k - 1]))
                learn_findings(set, cells->key[k], found, n);
    }
}

float vcache_budget_rays(vcache_budget *b, float error, float value, uint32_t samples)
{
    float rays = b->rays * (float)samples;
    if (!isfinite(error) || !isfinite(value) || !(rays > 0.0f))
        return rays;
    b->count += samples;
    b->values += (double)value * samples;
    double base = (double)value + 0.4 * b->values / b->count, x = base > 0.0 ? (double)error / base : 0.0;
    b->sum += x * samples;
    if (!(b->scale > 0.0))
        b->scale = 1.0;
    float share = b->sum > 0.0 ? (float)(b->scale * b->count / b->sum * x) : 1.0f; /* of `rays` */
    share = share > 4.0f ? 4.0f : share < 0.1f ? 0.1f : share;
    /* What the limits take or give is made up for over all eye samples so far (Robbins and Monro 1951): faster, and
     * each part of the image would get the same mean. */
    b->scale *= 1.0 + (1.0 - (double)share) * samples / (b->count + 1000.0);
    b->scale = b->scale > 16.0 ? 16.0 : b->scale < 1.0 / 16.0 ? 1.0 / 16.0 : b->scale;
    return share * rays;
}
