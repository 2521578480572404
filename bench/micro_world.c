/* SPDX-License-Identifier: Apache-2.0 */
#include "micro.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *const residence_names[] = {"L2", "L3", "DRAM"};

static const uint64_t table_bytes[] = {256u << 10, 16u << 20, 1u << 30};
/* Rows that are touched, in bytes; the set is four times that, so that few rows push each other out. */
static const uint64_t row_bytes[] = {256u << 10, 16u << 20, 256u << 20};

/* Enough eyes of 64 cache lines or more to go far beyond any cache before one comes again. */
enum { MEASURED_EYES = 1 << 16 };

uint64_t random_bits(uint64_t *state) /* splitmix64 */
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

float random_unit(uint64_t *state)
{
    return (float)(random_bits(state) >> 40) * 0x1p-24f;
}

void *need(void *memory)
{
    if (!memory)
        die("out of memory");
    return memory;
}

bool world_trace(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    (void)context;
    for (size_t i = 0; i < count; i++)
        answers[i] = misses[i].light_user * 0x9e3779b97f4a7c15u >> 63;
    return true;
}

const vcache_eye *world_eye(const world *w, int levels, uint32_t eye)
{
    return (const vcache_eye *)(const void *)(w->eyes[levels] + eye * w->stride[levels]);
}

uint32_t world_next(world *w)
{
    w->cursor = w->cursor + 1 < w->use_count ? w->cursor + 1 : 0;
    return w->cursor;
}

/* The first resolution of Eq. 8 from `least` on: cells of just this size come out, and cell centres are known. */
static double curve_resolution(const vcache_config *config, double least)
{
    double power = 1.0;
    while (floor(power) < least)
        power *= (double)config->resolution_step;
    return floor(power);
}

static const double diameter = 1.7320508075688772; /* of the unit cube */

/* Place of cell `i` of a row around the middle of the cube: its centre, for grids are shifted by 0.414 of a cell. */
static float cell_centre(double i, double resolution)
{
    return (float)(0.5 + (i + 0.0857864) * diameter / resolution);
}

static void make_lights(world *w, const vcache_config *config)
{
    enum { SIDE = 32 };
    double resolution = curve_resolution(config, 1.8 * SIDE);
    char *lights = need(malloc(vcache_light_size() * MICRO_LIGHTS));
    w->lights = (vcache_light *)(void *)lights;
    for (uint32_t i = 0; i < MICRO_LIGHTS; i++) {
        vcache_surface s = {.normal = {0, 0, -1}, .user = i, .density = (float)(resolution * resolution / 3.0)};
        s.position[0] = cell_centre((double)(i % SIDE) - SIDE / 2, resolution);
        s.position[1] = cell_centre((double)(i / SIDE) - SIDE / 2, resolution);
        s.position[2] = 0.98f;
        vcache_prepare_patch(w->cache, &s, vcache_light_at(w->lights, i));
    }
    if (w->spec.bundled)
        vcache_bundle_lights(w->cache, w->lights, MICRO_LIGHTS);
}

static void make_eyes(world *w, const vcache_config *config)
{
    uint32_t side = (uint32_t)sqrt((double)w->eye_count);
    w->eye_count = side * side;
    double resolution = curve_resolution(config, 1.8 * (side > 512 ? side : 512));
    w->surfaces = need(malloc(w->eye_count * sizeof *w->surfaces));
    for (int k = 0; k < LEVEL_CHOICES; k++) {
        w->ce[k] = k == LEVELS_1 ? 2.0f : 32.0f;
        w->density[k] = (float)(resolution * resolution / 3.0) * w->ce[k] * w->ce[k];
        w->stride[k] = vcache_eye_size(w->cache, w->ce[k]);
        w->eyes[k] = need(malloc(w->stride[k] * w->eye_count));
    }
    for (uint32_t i = 0; i < w->eye_count; i++) {
        vcache_surface *s = &w->surfaces[i];
        *s = (vcache_surface){.normal = {0, 0, 1}, .user = i};
        s->position[0] = cell_centre((double)(i % side) - side / 2, resolution);
        s->position[1] = cell_centre((double)(i / side) - side / 2, resolution);
        for (int k = 0; k < LEVEL_CHOICES; k++) {
            s->density = w->density[k];
            vcache_prepare_eye(w->cache, s, w->ce[k], 0, (vcache_eye *)(void *)(w->eyes[k] + i * w->stride[k]));
        }
    }
}

/* Cells 4 and 16 times as large, for predictions. */
static void learn_coarse(world *w)
{
    uint32_t side = (uint32_t)sqrt((double)w->eye_count);
    vcache_pick picks[MICRO_LIGHTS];
    vcache_miss misses[MICRO_LIGHTS] = {{0}};
    vcache_answer answers[MICRO_LIGHTS];
    for (uint32_t i = 0; i < MICRO_LIGHTS; i++) {
        picks[i] = (vcache_pick){.light = i, .weight = 1.0f};
        misses[i].light_user = i;
    }
    world_trace(NULL, misses, MICRO_LIGHTS, answers);
    for (uint32_t y = 0; y < side; y += 4)
        for (uint32_t x = 0; x < side; x += 4) {
            vcache_prediction p =
                vcache_predict(w->predictor, &w->surfaces[y * side + x], w->ce[LEVELS_5], 0, w->contribution);
            p.cells.key[0] = 0; /* known already */
            if (x % 16 || y % 16)
                p.cells.key[2] = 0;
            vcache_learn(w->set, &p.cells, picks, answers, MICRO_LIGHTS);
        }
}

/* Rows that were never written have no memory behind them yet. */
static void touch_rows(world *w)
{
    uint64_t seed = 17;
    const vcache_pick pick = {0};
    const vcache_answer answer = VCACHE_VISIBLE;
    for (uint64_t i = 0; i < 2 * vcache_light_set_rows(w->set); i++) {
        vcache_cells cells;
        for (int k = 0; k < VCACHE_CELLS; k++)
            cells.key[k] = random_bits(&seed) | 1;
        vcache_learn(w->set, &cells, &pick, &answer, 1);
    }
}

/* One ray for each pair of an eye. */
static void learn_pairs(world *w, const vcache_eye *eye)
{
    for (uint32_t l = 0; l < MICRO_LIGHTS; l++) {
        const vcache_miss ray = {.light_user = l};
        vcache_answer answer;
        world_trace(NULL, &ray, 1, &answer);
        vcache_estimate e = vcache_estimate_pair(w->worker, eye, vcache_light_at(w->lights, l), 1.0f);
        vcache_learn_pair(w->worker, &e, answer);
    }
}

static void fill(world *w)
{
    uint64_t visible[MICRO_WORDS] = {0};
    for (uint32_t i = 0; i < w->eye_count; i++) {
        const vcache_eye *eye = world_eye(w, LEVELS_1, i);
        if (w->spec.kind == WORLD_WORDS)
            vcache_query(w->worker, eye, w->lights, MICRO_LIGHTS, NULL, visible, world_trace, NULL);
        else if (w->spec.kind == WORLD_TALLIES)
            learn_pairs(w, eye);
        else
            for (uint32_t l = 0; l < MICRO_LIGHTS; vcache_resolve(w->worker, world_trace, NULL))
                l = vcache_add_set(w->worker, eye, w->set, l, NULL, visible);
    }
    if (w->spec.kind == WORLD_ROWS)
        learn_coarse(w);
    else
        w->filled = vcache_table_filled(w->cache, 1u << 20);
}

world *world_new(const world_spec *spec)
{
    char message[VCACHE_MESSAGE_BYTES];
    world *w = need(calloc(1, sizeof *w));
    w->spec = *spec;
    w->chosen = -1;
    bool rows = spec->kind == WORLD_ROWS;
    uint64_t row = MICRO_LIGHTS / 4 + 64,
             set_bytes = row_bytes[spec->kind == WORLD_WORDS || spec->kind == WORLD_TALLIES ? IN_L2 : spec->where];
    vcache_config config = vcache_default_config();
    config.hash = spec->hash;
    config.isa = spec->isa;
    config.table_bytes = rows ? 4096 : table_bytes[spec->where];
    if (vcache_create(&config, &w->cache, message) != VCACHE_OK ||
        vcache_worker_create(w->cache, NULL, &w->worker, message) != VCACHE_OK)
        die("%s", message);
    make_lights(w, &config);
    if (vcache_light_set_create(w->cache, w->lights, MICRO_LIGHTS, rows ? 4 * set_bytes : set_bytes, &w->set,
                                message) != VCACHE_OK ||
        vcache_predictor_create(w->set, VCACHE_DRAW_UNCERTAIN, &w->predictor, message) != VCACHE_OK)
        die("%s", message);
    uint64_t seed = 7;
    w->contribution = need(calloc(vcache_light_set_padded(w->set), sizeof(float)));
    for (uint32_t i = 0; i < MICRO_LIGHTS; i++)
        w->contribution[i] = 0.1f + random_unit(&seed);
    w->eye_count = (uint32_t)(rows ? row_bytes[spec->where] / row : table_bytes[spec->where] / 4 / MICRO_LIGHTS);
    make_eyes(w, &config);
    if (spec->kind == WORLD_EMPTY)
        touch_rows(w);
    else
        fill(w);
    w->use = need(malloc(w->eye_count * sizeof *w->use));
    return w;
}

void world_free(world *w)
{
    if (!w)
        return;
    vcache_predictor_destroy(&w->predictor);
    vcache_light_set_destroy(&w->set);
    vcache_worker_destroy(&w->worker);
    vcache_destroy(&w->cache);
    for (int k = 0; k < LEVEL_CHOICES; k++)
        free(w->eyes[k]);
    free(w->surfaces);
    free(w->contribution);
    free(w->lights);
    free(w->use);
    free(w->cells);
    free(w->asked);
    free(w);
}

static void add(world *w, const vcache_eye *eye, uint64_t *visible)
{
    if (w->spec.kind == WORLD_WORDS)
        vcache_add(w->worker, eye, w->lights, 0, MICRO_LIGHTS, NULL, visible);
    else
        vcache_add_set(w->worker, eye, w->set, 0, NULL, visible);
    vcache_cancel(w->worker);
}

/* Bits of pairs that are not known stay as they are: so they differ where they differed before. */
static bool find_known(world *w, const vcache_eye *eye, uint64_t known[MICRO_WORDS])
{
    uint64_t zeros[MICRO_WORDS], ones[MICRO_WORDS], all = ~(uint64_t)0;
    memset(zeros, 0, sizeof zeros);
    memset(ones, 0xff, sizeof ones);
    add(w, eye, zeros);
    add(w, eye, ones);
    for (int i = 0; i < MICRO_WORDS; i++)
        all &= known[i] = ~(zeros[i] ^ ones[i]);
    return all == ~(uint64_t)0;
}

void world_choose(world *w, int levels)
{
    if (w->chosen == levels)
        return;
    uint64_t seed = 13;
    w->chosen = levels;
    w->cursor = 0;
    w->use_count = w->eye_count;
    for (uint32_t i = 0; i < w->eye_count; i++)
        w->use[i] = i;
    for (uint32_t i = w->eye_count - 1; i > 0; i--) {
        uint32_t k = (uint32_t)(random_bits(&seed) % (i + 1)), old = w->use[i];
        w->use[i] = w->use[k];
        w->use[k] = old;
    }
    if (w->spec.kind == WORLD_ROWS) {
        uint64_t known[MICRO_WORDS];
        w->use_count = 0;
        for (uint32_t i = 0; i < w->eye_count; i++)
            if (find_known(w, world_eye(w, levels, w->use[i]), known))
                w->use[w->use_count++] = w->use[i];
        free(w->cells);
        w->cells = need(malloc((w->use_count + 1) * sizeof *w->cells));
        for (uint32_t i = 0; i < w->use_count; i++)
            w->cells[i] =
                vcache_predict(w->predictor, &w->surfaces[w->use[i]], w->ce[LEVELS_5], 0, w->contribution).cells;
        w->filled = (double)w->use_count / w->eye_count;
    } else if (w->spec.kind == WORLD_WORDS) {
        if (w->use_count > MEASURED_EYES)
            w->use_count = MEASURED_EYES;
        free(w->asked);
        w->asked = need(malloc(w->use_count * sizeof *w->asked));
        for (uint32_t i = 0; i < w->use_count; i++)
            find_known(w, world_eye(w, levels, w->use[i]), w->asked[i]);
    }
    if (w->use_count == 0)
        die("nothing is known that could be measured");
    vcache_worker_reset_statistics(w->worker);
}
