/* SPDX-License-Identifier: Apache-2.0 */
/* Policies that decide visibility with fewer rays, replayed against a record. Cells are unlimited in number, so that
 * storage plays no part. A member that is 0 means: as the library has it. */
#ifndef BENCH_REPLAY_H
#define BENCH_REPLAY_H

#include "record.h"

/* Which clusters of other cells must agree before one answers (Sect. 3.6). */
typedef enum around_cells {
    AROUND_4,  /* around X in its tangent plane, as the library has it */
    AROUND_8,  /* those at the corners too */
    AROUND_64, /* these times 8 around Y, and no pair of Y's own cell */
    AROUND_72  /* these times 9: Y's own cell too */
} around_cells;

/* How much each pair may decide by itself: the start level of Algorithm 2 and how deep it may go. */
typedef struct grid_policy {
    float ce;
    int levels; /* 1: no refinement */
    int normal_bins, layers;
    float step; /* C_R */
    around_cells around;
    eye_order order;
    /* contributions are unoccluded ones, relative to the mean over the lights that face the eye sample */
    float refine_above; /* pairs of less are not refined */
    float finer_above;  /* pairs of more start one level finer */
    float power;        /* > 0: the start cell's side is C_E contribution^-power, at most 4 C_E */
    int deeper;         /* with power: refined at most so many levels below the start cell */
    float distance;     /* > 0: the start cell's side is at most this times the distance to the light */
    int agree;          /* > 0: starts at the finest level; where so many levels above it agree, takes their answer */
    int flood; /* > 0: a ray that refutes a coarser cell has so many of its light's nearest lights traced, and so on */
    float middle;      /* > 0: only points in this middle part of a side may define a cell */
    bool share_lights; /* lights of one light cell share a bit */
    bool eye_contacts; /* only pairs nearer than an eye cell are traced as contacts, whatever the light's cell is */
    float jitter;      /* the cell is looked up within +- half of this times its side */
} grid_policy;

typedef enum offset_rule { OFFSET_STRATIFIED, OFFSET_INDEPENDENT } offset_rule;
typedef enum state_table { TABLE_LEARNED, TABLE_FIXED } state_table;

enum { MAX_CELLS = 4, MAX_STATES = 1 << 2 * MAX_CELLS };

/* The sum over all lights as expectation plus a random sample of its error. */
typedef struct estimator_policy {
    float rays;  /* K */
    bool alone;  /* no cache: lights drawn by contribution */
    int cells;   /* per eye sample; 0: 3 */
    float ce;    /* of the smallest; 0: 8 */
    float ratio; /* of their sides; 0: 4 */
    float adapt; /* > 0: K of an eye sample ~ (its sum of deviations)^adapt */
    offset_rule offsets;
    int delay; /* eye samples after which answers are learned; 0: at once */
    state_table table;
    int layers;
    float jitter;
    eye_order order;
} estimator_policy;

/* What was seen of one combination of states. */
typedef struct state_tally {
    uint64_t picked, picked_visible; /* pairs traced */
    uint64_t asked, visible;         /* all pairs */
} state_tally;

typedef struct replay_result {
    uint64_t rays, wrong; /* wrong: pairs that were answered and not traced */
    uint32_t cells;
    double l_inf;
} replay_result;

/* By eye sample and light, [count][words] as `asked` of the record: what became of each pair. */
typedef struct replay_bits {
    uint64_t *clustered; /* not so near that it was traced for that alone */
    uint64_t *wrong;
} replay_bits;

/* `bits`: NULL, or members that are cleared. */
replay_result replay_grid(const record *r, const grid_policy *p, const replay_bits *bits);
/* `tallies`: MAX_STATES of them, or NULL. `picks`: NULL, or room for count * ceil(4 K) pairs {eye, light}; takes down
 * what was traced, in order, as many as result.rays. */
replay_result replay_estimator(const record *r, const estimator_policy *p, state_tally *tallies, uint32_t (*picks)[2]);

/* Shared by both: the policy's image less the exact one, and l_inf from it. */
static inline double replay_l_inf(const record *r, const rgb *difference)
{
    double sum = 0.0;
    size_t pixels = (size_t)r->view.settings.width * r->view.settings.height;
    for (size_t i = 0; i < pixels; i++)
        sum += fabs((double)difference[i].x) + fabs((double)difference[i].y) + fabs((double)difference[i].z);
    return sum / r->energy;
}

/* The eye sample's surface, moved in its tangent plane. */
vcache_surface replay_jitter(const record *r, uint32_t eye, float ce, float jitter);

#endif
