/* SPDX-License-Identifier: Apache-2.0 */
/* What the library's own files share; hosts never see it. */
#ifndef VCACHE_INTERNAL_H
#define VCACHE_INTERNAL_H

#include "hash.h"
#include "kernels.h"
#include "names.h"
#include "table.h"
#include "vcache.h"

/* Steps of the resolution curve: C_R^k up to 2^32, k < 456 for C_R = 1.05. */
#define VCACHE_MAX_STEPS 512

struct vcache {
    vcache_config config;
    table table;
    const kernels *kernels;
    _Atomic uint64_t epoch_key; /* mixed into every pair: vcache_clear changes it */
    _Atomic uint64_t epoch;
    double center[3];
    double diameter; /* 2 B_R */
    double inverse_diameter;
    int step_limit;                        /* finest step of positions: cells stay larger than their rounding */
    int direction_limit;                   /* the same for directions */
    int steps;                             /* filled entries below */
    uint32_t resolution[VCACHE_MAX_STEPS]; /* R of step k: floor(C_R^k), Eq. 8 */
    uint16_t canonical[VCACHE_MAX_STEPS];  /* first step with the same R */
    float side_squared[VCACHE_MAX_STEPS];  /* of a cell, scene units */
    double power[2 * VCACHE_MAX_STEPS];    /* C_R^i */
    uint16_t first_step[66];               /* first step whose upper bound exceeds 2^i */
};

/* A cell size: resolution step and side. */
typedef struct cell_size {
    int step;
    double resolution; /* R */
    float side;        /* 2 B_R / R, scene units */
} cell_size;

/* Oriented grid through the scene's centre (Sect. 3.3) with a point in it, in units of the scene's diameter. */
typedef struct grid_point {
    uint32_t orientation;    /* 3 x 7 bits */
    double u, v, w;          /* along the grid's axes */
    double slope_u, slope_v; /* how the tangent plane falls along u and v */
} grid_point;

typedef struct cell {
    int32_t i, j, layer;
} cell;

/* cache.c: writes the message, returns the status. */
#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
vcache_status
vcache_complain(char *message, vcache_status status, const char *format, ...);

/* quantize.c */
/* The k <= limit with C_R^(2k - 1) <= squared < C_R^(2k + 1), in [1, 2^64). */
int quantize_power(const vcache *c, double squared, int limit);
/* The step k with C_R^(k - 1/2) <= R < C_R^(k + 1/2) (Eq. 8), 0 ... limit. */
int quantize_step(const vcache *c, double squared_resolution, int limit);
cell_size quantize_size(const vcache *c, int step);
bool quantize_point(const vcache *c, const float position[3], const float normal[3], grid_point *out);
/* The cell that holds the point; neighbours (NULL: not wanted) get the 4 around it in its tangent plane. */
cell quantize_cell(const vcache *c, const grid_point *p, cell_size size, cell neighbours[4]);
void quantize_octahedral(const float direction[3], double *s, double *t); /* [0, 1]^2 */
bool finite3(const float p[3]);

/* ends.c */
enum end_kind { END_POINT = 0, END_DIRECTION = 1, END_PATCH = 2, END_SOLID_ANGLE = 3 };

enum { LANE_NONE = 0xff };

/* Two thirds of a cache line: the hot loop reads all but `user`. */
struct vcache_light {
    union {
        struct {
            uint64_t hash; /* of the split family */
            uint64_t line; /* of the lights whose words share a line of the table */
        };
        uint32_t words[4]; /* the key, for the families that run over its words; the kind goes first */
    } key;
    float position[3];
    float side_squared; /* of the cell, 0 without one; < 0: a direction */
    uint64_t user;
    uint8_t kind, bad, word_count;
    uint8_t lane; /* in the line; LANE_NONE: the word lies anywhere */
};

typedef struct eye_level {
    uint64_t center, neighbour[4]; /* half keys of the cell and the 4 around it */
} eye_level;

struct vcache_eye {
    float position[3];
    float side_squared; /* of the unrefined cell */
    uint64_t user;
    uint32_t levels; /* 0: cannot be quantized */
    uint32_t unused;
    eye_level level[]; /* vcache_levels(cache, ce) of them */
};

struct vcache_vertex {
    float position[3];
    int32_t quarter_steps; /* this end's share of 4 log_CR R; INT32_MIN: cannot be quantized */
    uint64_t user, seed;   /* seed: of its hashes */
    grid_point point;
};

_Static_assert(sizeof(struct vcache_eye) + VCACHE_MAX_LEVELS * sizeof(eye_level) <= VCACHE_EYE_BYTES, "eye end");
_Static_assert(sizeof(struct vcache_light) <= VCACHE_LIGHT_BYTES, "light end");
_Static_assert(sizeof(struct vcache_vertex) <= VCACHE_VERTEX_BYTES, "vertex");

int vcache_levels(const vcache *c, float ce);
/* Hashes of the cells around an eye end at C_E, 4 C_E and 16 C_E; false where it cannot be quantized. */
bool eye_cells(const vcache *c, const vcache_surface *surface, float ce, uint64_t salt, uint64_t cells[VCACHE_CELLS]);
/* vertices.c */
/* Step at which a pair of vertices meets (Eq. 6); -1: one of them cannot be quantized. */
int vertex_step(const vcache *c, const vcache_vertex *eye, const vcache_vertex *light);
/* Key of the pair at that step. */
uint64_t vertex_key(const vcache *c, uint64_t epoch_key, const vcache_vertex *eye, const vcache_vertex *light,
                    int step);

/* Key of a pair from an eye half and a light end. */
static inline uint64_t pair_key(vcache_hash family, uint64_t epoch_key, uint64_t half, const vcache_light *light)
{
    if (family == VCACHE_HASH_SPLIT)
        return hash_fold(half ^ epoch_key, light->key.hash);
    uint32_t kind = light->kind;
    uint64_t state = hash_recurrence(family, half ^ epoch_key, &kind, 1);
    return hash_finish(family, hash_recurrence(family, state, light->key.words, light->word_count));
}

/* Where the word of a key lies. */
static inline uint64_t pair_slot(const vcache *c, vcache_hash family, uint64_t key)
{
    return family == VCACHE_HASH_SPLIT ? table_slot(&c->table, key) : table_slot_modulo(&c->table, key);
}

/* First slot of the line that an eye half shares with the lights of `line`. */
static inline uint64_t pair_line(const vcache *c, uint64_t epoch_key, uint64_t half, uint64_t line)
{
    return table_line(&c->table, hash_fold(half ^ epoch_key, line));
}

#endif
