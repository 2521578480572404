/* SPDX-License-Identifier: Apache-2.0 */
/* Micro-benchmarks: what is measured (micro_cases.c), on which data (micro_world.c), how (micro.c). Public API alone.
 */
#ifndef BENCH_MICRO_H
#define BENCH_MICRO_H

#include <vcache/vcache.h>

enum { MICRO_LIGHTS = 1024, MICRO_WORDS = MICRO_LIGHTS / 64, MICRO_RAYS = 6 };

/* Where the words or rows lie that a case touches. */
typedef enum residence { IN_L2, IN_L3, IN_DRAM } residence;
extern const char *const residence_names[]; /* "L2", "L3", "DRAM" */

/* WORDS: a table of words with as many known pairs as it has words. ROWS: a light set with rows that are known in full.
 * TALLIES: the same table, of estimates. EMPTY: both stores, nothing known. */
typedef enum world_kind { WORLD_EMPTY, WORLD_WORDS, WORLD_TALLIES, WORLD_ROWS } world_kind;

typedef struct world_spec {
    world_kind kind;
    residence where;
    vcache_hash hash;
    bool bundled;
    uint32_t isa;
} world_spec;

/* One level of refinement, or five: eye ends of the same cells. */
enum { LEVELS_1, LEVELS_5, LEVEL_CHOICES };

/* A floor of eye cells side by side, a ceiling of lights. What is visible depends on the light alone, so that known
 * neighbours agree and no walk leaves the first level. */
typedef struct world {
    world_spec spec;
    vcache *cache;
    vcache_worker *worker;
    vcache_light *lights;
    vcache_light_set *set;
    vcache_predictor *predictor;
    float *contribution;
    uint32_t eye_count;
    vcache_surface *surfaces;
    float ce[LEVEL_CHOICES], density[LEVEL_CHOICES];
    size_t stride[LEVEL_CHOICES];
    char *eyes[LEVEL_CHOICES];
    double filled; /* share of the words of the table, or of the rows that the eyes ask for, that are known */
    /* the eyes to measure with, in random order, and which of their pairs are known: of one choice of levels */
    int chosen;
    uint32_t use_count, cursor;
    uint32_t *use;
    uint64_t (*asked)[MICRO_WORDS];
    vcache_cells *cells; /* of each of them, for rows */
} world;

/* Do not return on failure: die prints one line. */
world *world_new(const world_spec *spec);
void world_free(world *w);
/* Finds out which pairs are known from eye ends of these levels. */
void world_choose(world *w, int levels);
/* The next eye to measure with; never the same again before all others. */
uint32_t world_next(world *w);
const vcache_eye *world_eye(const world *w, int levels, uint32_t eye);
/* The cheapest of all rays. */
bool world_trace(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers);
uint64_t random_bits(uint64_t *state);
float random_unit(uint64_t *state);
void *need(void *memory);
_Noreturn void die(const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 1, 2)))
#endif
    ;

typedef struct micro_case micro_case;
struct micro_case {
    char name[64];
    const char *unit; /* what the nanoseconds are for */
    world_spec world;
    int levels; /* LEVELS_... */
    int variant;
    /* Does `steps` steps (an eye, or an end) and returns how many units that were. */
    uint64_t (*run)(const micro_case *m, world *w, uint64_t steps);
};

/* All cases for these instruction sets; those of one world side by side. */
micro_case *cases_new(uint32_t isa, size_t *count);

/* micro_adaptive.c: a point with micro_adaptive_lights[variant / 2] lights; odd: all of them sorted. */
enum { MICRO_ADAPTIVE_SIZES = 4 };
extern const uint32_t micro_adaptive_lights[MICRO_ADAPTIVE_SIZES];
uint64_t micro_adaptive(const micro_case *m, world *w, uint64_t steps);

/* What is computed must be used. */
extern volatile uint64_t micro_sink;

#endif
