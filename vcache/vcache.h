/* SPDX-License-Identifier: Apache-2.0 */
/*
 * vcache - a global visibility cache for ray tracers.
 *
 * "Do these two points see each other?" - answered mostly without tracing a ray. Both ends of a path connection are
 * quantized into cells of oriented virtual grids; the pair of cells is hashed, and one bit of visibility per pair is
 * kept in a lock-free table of 32-bit words. One ray is traced per pair of cells that is asked for. The user sets one
 * number, C_E: the error of a cell stays inside about C_E x C_E eye samples of the image.
 *
 * Based on: S. Popov, I. Georgiev, P. Slusallek, C. Dachsbacher, "Adaptive Quantization Visibility Caching",
 * Computer Graphics Forum 32(2), 2013. "Eq." and "Sect." below are that paper's.
 *
 * In five steps:
 *   1. vcache_default_config, set the scene's bounds, vcache_create; one vcache_worker per thread.
 *   2. Prepare each end once: vcache_prepare_eye for what the camera sees, one of vcache_prepare_point, _direction,
 *      _patch, _solid_angle for each light sample.
 *   3. vcache_add pairs. Known answers are written at once.
 *   4. vcache_misses: trace these rays any way you like; vcache_commit the answers; repeat until there is none.
 *   5. Read the bits. (vcache_query does 3 to 5 with a callback, vcache_visible does it for one pair.)
 *
 * Units: positions in any unit of length, densities per that unit squared (or per steradian), directions unit length.
 * Threads: a vcache may be shared by any number of threads without locks; a vcache_worker belongs to one thread at a
 * time; prepared ends are read-only. The library starts no thread, does no I/O, holds no lock.
 * Errors: creation returns a status and a message; hot calls cannot fail. An end that cannot be quantized (NaN,
 * infinity, zero normal or density, farther than 32 diameters from the scene's centre) is answered exactly: every pair
 * with it becomes a miss and is not stored.
 */
#ifndef VCACHE_H
#define VCACHE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Compatibility: what was compiled with a header runs with every library of the same soname (libvcache.so.0.1 for all
 * 0.1.x). Within one soname functions and struct fields are neither removed nor changed, nor do keys and files change;
 * structs that carry their size may grow at their end, and the library takes the sizes of all versions of its soname.
 * Until 1.0 each minor version has a soname of its own, from then on each major one. docs/abi.md. */
#define VCACHE_VERSION_MAJOR 0
#define VCACHE_VERSION_MINOR 1
#define VCACHE_VERSION_PATCH 0

#ifndef VCACHE_API
#if defined(__GNUC__)
#define VCACHE_API __attribute__((visibility("default")))
#else
#define VCACHE_API
#endif
#endif

/* The most levels of adaptive refinement (Alg. 2), the unrefined one included. */
#define VCACHE_MAX_LEVELS 16

/* What became of a call that can fail. */
typedef enum vcache_status {
    VCACHE_OK = 0,
    VCACHE_ERROR_ARGUMENT, /* a value is out of its range; the message names it */
    VCACHE_ERROR_MEMORY,   /* the allocator returned NULL */
    VCACHE_ERROR_FILE      /* save.h: what was saved is damaged, of another scene or config, or cannot be read; or
                              nothing can be written */
} vcache_status;

/* Enough for every message, the final 0 included. */
#define VCACHE_MESSAGE_BYTES 160

/* ------------------------------------------------------------------------------------------------------ the cache */

/* How keys are hashed. */
typedef enum vcache_hash {
    VCACHE_HASH_SPLIT,       /* default: each end hashed to 64 bits once, a pair costs one 64 x 64 bit multiplication */
    VCACHE_HASH_LCG_PAIR,    /* Eq. 10: two linear congruential generators over the words of the key. For comparison
                                alone: on lattices of ends many different keys come out equal */
    VCACHE_HASH_LCG_XORSHIFT /* Sect. 4.1: one 64-bit LCG followed by xorshift over the words of the key */
} vcache_hash;

/* Where memory comes from. Both functions or neither; called by create and destroy alone. */
typedef struct vcache_allocator {
    void *(*allocate)(void *context, size_t bytes);             /* zeroed, aligned to 64 bytes; or NULL */
    void (*release)(void *context, void *memory, size_t bytes); /* what `allocate` gave, with the same size */
    void *context;                                              /* handed to both */
} vcache_allocator;

/* Instruction sets, for vcache_config.isa. */
#define VCACHE_ISA_SCALAR 0u
#define VCACHE_ISA_AVX2 1u
#define VCACHE_ISA_AVX512 2u
#define VCACHE_ISA_ALL 0xffffffffu

/* What a cache is made from; start from vcache_default_config. */
typedef struct vcache_config {
    size_t size;                        /* sizeof(vcache_config) of the host's header, set with the defaults */
    float bounds_min[3], bounds_max[3]; /* of everything that ends lie on; finite, min <= max. Default: a unit cube */
    int32_t normal_bins;        /* C_N, 1 ... 64, default 8: bins of the normal per axis (1: one orientation); an
                                    odd number serves: 8 stands for 9, in whose middle the axes lie */
    int32_t layers;             /* C_Z, 1 ... 64, default 8: layers per cell side along the normal */
    float resolution_step;      /* C_R, 1.05 ... 16, default 1.2: ratio of successive grid resolutions (Eq. 8) */
    int32_t levels;             /* C_MSR, 0 ... VCACHE_MAX_LEVELS, default 0: log2 C_E. 1: no refinement */
    uint64_t table_bytes;       /* 4 ... 16 GiB, default 4 MiB: rounded down to whole 32-bit words */
    vcache_hash hash;           /* default VCACHE_HASH_SPLIT */
    uint32_t isa;               /* VCACHE_ISA_..., default all: what loops over lights may use, where the machine has
                                   it. The answers are the same bit for bit */
    vcache_allocator allocator; /* default: the C library's */
} vcache_config;

/* The table of answers and how ends are quantized. Any number of threads may use it. */
typedef struct vcache vcache;

/* All fields set to their defaults: the scene's bounds remain to be set. `size` is sizeof *out where the host was
 * compiled, which is how structs can grow; hosts in C and C++ have it from the function below. */
VCACHE_API void vcache_fill_config(vcache_config *out, size_t size);
/* The same by value, compiled into the host. */
static inline vcache_config vcache_default_config(void)
{
    vcache_config config;
    vcache_fill_config(&config, sizeof config);
    return config;
}

/* On failure *out is NULL and `message` (VCACHE_MESSAGE_BYTES bytes, or NULL) says which value is wrong. */
VCACHE_API vcache_status vcache_create(const vcache_config *config, vcache **out, char *message);

/* Releases the memory and sets *cache to NULL; NULL and a pointer to NULL are fine. No other thread may use it. */
VCACHE_API void vcache_destroy(vcache **cache);

/* Forgets everything in constant time (a new frame, something moved). Queries that run meanwhile in other threads may
 * still be answered from before; those that begin after it returned are not. Ends prepared before stay valid. A word
 * left from before is taken for a new one with probability 2^-31 per probe, as any foreign word. */
VCACHE_API void vcache_clear(vcache *cache);

/* Which loops are used: "scalar", "avx2" or "avx512". */
VCACHE_API const char *vcache_isa(const vcache *cache);

/* Words in the table. */
VCACHE_API uint64_t vcache_table_words(const vcache *cache);
/* Share of words ever written, from a sample of at most `samples` words spread over the table. */
VCACHE_API double vcache_table_filled(const vcache *cache, uint64_t samples);

/* ------------------------------------------------------------------------------------------------------- the ends */

/* A surface point. `normal` is the geometric one, on the side that the path arrives at (two sides of a thin wall are
 * two orientations and never share a cell, but with C_N = 1); its length does not matter. `user` is the host's own
 * (primitive, instance, index ...) and is handed back with each miss. */
typedef struct vcache_surface {
    float position[3]; /* in the bounds; far outside of them the end is answered exactly */
    float normal[3];   /* of any length */
    float density; /* expected number of path vertices per unit area around here, > 0; infinity: the smallest cells */
    uint64_t user; /* comes back with each miss */
} vcache_surface;

/* Where density comes from, for hosts that do not know it:
 * - eye samples of a ray cone: `width` is the cone's diameter at the hit (a pixel's width there), `cosine` the angle of
 *   incidence. The footprint is width^2 / cosine; cosine is capped below at 1/4 so that at grazing angles a cell of
 *   side C_E / sqrt(density) is at most twice C_E samples along the footprint's short axis. */
VCACHE_API float vcache_density_cone(float width, float cosine, float samples_per_pixel);
/* - samples drawn with density `pdf` per unit area (or per steradian), `samples` of them. */
VCACHE_API float vcache_density_pdf(float pdf, float samples);
/* - unknown: `samples` spread evenly over a sphere around the scene's bounds. */
VCACHE_API float vcache_density_unknown(const vcache *cache, float samples);

/* Prepared ends are opaque; the host provides their memory, aligned to 8 bytes, and may copy it. Sizes are constant
 * for a cache. `vcache_eye` depends on C_E; vcache_eye_size(cache, ce) grows with the number of levels, at most
 * VCACHE_EYE_BYTES. Arrays of eyes have that stride; arrays of lights have stride vcache_light_size(). */
typedef struct vcache_eye vcache_eye;
typedef struct vcache_light vcache_light;
#define VCACHE_EYE_BYTES 1024
#define VCACHE_LIGHT_BYTES 96
VCACHE_API size_t vcache_eye_size(const vcache *cache, float ce);
VCACHE_API size_t vcache_light_size(void);
/* Element `index` of an array of light ends. */
VCACHE_API vcache_light *vcache_light_at(vcache_light *lights, size_t index);

/* Eye end of Eq. 7: cells of side C_E / sqrt(density), halved per level. `ce` > 0 is C_E of the light ends it will meet
 * (it may differ by kind of light: prepare one eye end for each). `salt` keeps apart what must not share answers: ray
 * time, light linking, ray mask; ends with different salts never share a bit. */
VCACHE_API void vcache_prepare_eye(const vcache *cache, const vcache_surface *surface, float ce, uint64_t salt,
                                   vcache_eye *out);

/* Light ends (Sect. 3.5). Two bits of the kind stand in front of each key. */
VCACHE_API void vcache_prepare_point(const vcache *cache, const float position[3], uint64_t user, vcache_light *out);
/* `direction` points towards the light. Points and directions are told apart bit by bit. */
VCACHE_API void vcache_prepare_direction(const vcache *cache, const float direction[3], uint64_t user,
                                         vcache_light *out);
/* Eq. 7: cells of side 1 / sqrt(density): area light samples and virtual point lights. */
VCACHE_API void vcache_prepare_patch(const vcache *cache, const vcache_surface *surface, vcache_light *out);
/* Eq. 9 (corrected): octahedral cells, sqrt(4 pi density) a side; `density` samples per steradian around `direction`.
 */
VCACHE_API void vcache_prepare_solid_angle(const vcache *cache, const float direction[3], float density, uint64_t user,
                                           vcache_light *out);

/* Lights that are known in advance and asked together (virtual point lights, point lights, fixed environment samples):
 * from now on the words of one eye cell against 16 lights in a row of this array share a cache line of the table, so
 * that vcache_add over the array reads far less memory. Lights of one light cell then have a word each instead of
 * sharing one. Call once, after all of them are prepared; prepare an end again to undo it. No effect on the paper's
 * hash families, and in tables of fewer than 16 words. */
VCACHE_API void vcache_bundle_lights(const vcache *cache, vcache_light *lights, size_t count);

/* A set of lights that the host knows in advance: virtual point lights, point lights, fixed environment samples. What
 * an eye cell sees of the whole set is one row of bits (known, visible), found by one look-up per cell and level, and
 * 64 lights are decided at a time by AND and XOR. Rows live in memory of their own, are replaced on collision, and hold
 * the cell's whole 64-bit hash (of the config's family: of the paper's, different cells can have the same). Each light
 * is its own light end: lights of one light cell do not share. Any number of threads may use a set; vcache_clear of its
 * cache clears it. */
typedef struct vcache_light_set vcache_light_set;
#define VCACHE_MAX_SET 65536
/* Copies the prepared ends. `bytes`: of rows; a row takes count / 4 + 16 bytes, rounded up to whole 64. */
VCACHE_API vcache_status vcache_light_set_create(vcache *cache, const vcache_light *lights, uint32_t count,
                                                 uint64_t bytes, vcache_light_set **out, char *message);
/* As vcache_destroy; before its cache. */
VCACHE_API void vcache_light_set_destroy(vcache_light_set **set);
VCACHE_API uint64_t vcache_light_set_rows(const vcache_light_set *set);

/* Ends of bidirectional path tracing (Eq. 6): on both sides cells of side (C_E^2 / (P_e P_l N_P))^(1/4), where P are
 * the densities of last vertices. */
typedef struct vcache_vertex vcache_vertex;
#define VCACHE_VERTEX_BYTES 96
VCACHE_API size_t vcache_vertex_size(void);
/* `paths` is N_P > 0; P_e N_P / C_E^2 is the eye side's share of Eq. 6, P_l the light side's. */
VCACHE_API void vcache_prepare_eye_vertex(const vcache *cache, const vcache_surface *surface, float ce, float paths,
                                          uint64_t salt, vcache_vertex *out);
VCACHE_API void vcache_prepare_light_vertex(const vcache *cache, const vcache_surface *surface, vcache_vertex *out);

/* The cell of a prepared eye end at `level` (0: unrefined; beyond the last: the last), for false-colour pictures.
 * 0 where the end is answered exactly. */
VCACHE_API uint64_t vcache_eye_cell(const vcache_eye *eye, int level);

/* ------------------------------------------------------------------------------------------------------- querying */

/* A ray to trace: from eye_position to light_position, or towards it without end where `infinite`. The points are those
 * that the host gave; offsetting them off their surfaces is the host's task (that is what the two `user` are for). */
typedef struct vcache_miss {
    uint64_t eye_user, light_user;            /* what the two ends were prepared with */
    float eye_position[3], light_position[3]; /* its ends; infinite: light_position is a direction, as it was given */
    bool infinite;                            /* without end */
} vcache_miss;

/* What a ray found. ONCE: the answer holds for this pair alone (transparent shadow, alpha cut-out) and is not stored.
 */
typedef uint8_t vcache_answer;
#define VCACHE_BLOCKED 0
#define VCACHE_VISIBLE 1
#define VCACHE_ONCE 2 /* or-ed to one of the two */

/* What the cache got wrong, found by a worker that verifies. */
typedef struct vcache_misprediction {
    vcache_miss ray; /* the pair; by its `user` values the host knows how much light it stands for */
    bool visible;    /* what the ray found: the cache had said the opposite */
    int32_t level;   /* of the cell that answered */
    uint64_t cell;   /* that cell, as vcache_eye_cell names it; 0 for pairs of vertices */
} vcache_misprediction;

/* Called inside vcache_commit and vcache_visible; must not use the same worker. */
typedef void (*vcache_report)(void *context, const vcache_misprediction *wrong);

/* What a worker is made from; start from vcache_default_worker_config. */
typedef struct vcache_worker_config {
    size_t size;       /* sizeof(vcache_worker_config) of the host's header, set with the defaults */
    uint32_t capacity; /* 1 ... 2^24, default 4096: pairs that can wait for rays at a time; their
                          scratch (about 200 bytes a pair) should fit the second-level cache */
    bool exact;        /* every pair is a miss, nothing is looked up or stored: for comparison */
    /* For debugging: pairs that the cache answers become misses as well, so that all is traced, and where the ray
     * differs `report` is called (NULL: counted alone) and statistics count it. Answers, what is stored and the other
     * statistics stay what they are without: the picture is the cache's, with its errors. With `exact`: no effect. */
    bool verify;
    vcache_report report; /* or NULL */
    void *report_context; /* handed to it */
} vcache_worker_config;

/* Pending batch, scratch and statistics of one thread. */
typedef struct vcache_worker vcache_worker;

/* All fields set to their defaults, as vcache_fill_config. */
VCACHE_API void vcache_fill_worker_config(vcache_worker_config *out, size_t size);
/* The same by value, compiled into the host. */
static inline vcache_worker_config vcache_default_worker_config(void)
{
    vcache_worker_config config;
    vcache_fill_worker_config(&config, sizeof config);
    return config;
}
/* `config` may be NULL for the defaults. The cache must outlive the worker. */
VCACHE_API vcache_status vcache_worker_create(vcache *cache, const vcache_worker_config *config, vcache_worker **out,
                                              char *message);
VCACHE_API void vcache_worker_destroy(vcache_worker **worker);

/* Adds the pairs of `eye` with lights[i] for each i in [first, count) whose bit in `asked` is set (bit i % 64 of word
 * i / 64; NULL: all). Bit i of `visible` is set or cleared at once where the answer is known, else by a later
 * vcache_commit; other bits stay. Ends, lights and `visible` must stay where they are until then. Returns `count`, or
 * the index of the first light not taken because the batch is full: resolve it and go on from there. */
VCACHE_API uint32_t vcache_add(vcache_worker *worker, const vcache_eye *eye, const vcache_light *lights, uint32_t first,
                               uint32_t count, const uint64_t *asked, uint64_t *visible);

/* The same for lights [first, count) of a set, all of them or those asked for. */
VCACHE_API uint32_t vcache_add_set(vcache_worker *worker, const vcache_eye *eye, vcache_light_set *set, uint32_t first,
                                   const uint64_t *asked, uint64_t *visible);

/* The same, refining only lights whose bit is set in `refine`: for the others a known cell answers even if a neighbour
 * differs. Most lights bring little each: where those left out hold a share X of an eye end's unoccluded light, no more
 * than X of it can be lost by leaving them out. */
VCACHE_API uint32_t vcache_add_set_refining(vcache_worker *worker, const vcache_eye *eye, vcache_light_set *set,
                                            uint32_t first, const uint64_t *asked, const uint64_t *refine,
                                            uint64_t *visible);

/* The same for pairs [first, count) of vertices (Eq. 6, no refinement): bit i is of pairs[i]. The array itself is not
 * needed any longer afterwards. */
typedef struct vcache_vertex_pair {
    const vcache_vertex *eye, *light; /* its ends */
} vcache_vertex_pair;
VCACHE_API uint32_t vcache_add_vertices(vcache_worker *worker, const vcache_vertex_pair *pairs, uint32_t first,
                                        uint32_t count, uint64_t *visible);

/* A hint: the pair will be added some ten pairs later; its word comes from memory meanwhile. (vcache_add does that for
 * the lights of one call, vcache_add_vertices for its pairs.) */
VCACHE_API void vcache_prefetch(vcache_worker *worker, const vcache_eye *eye, const vcache_light *light);

/* The rays to trace now, each pair of cells once; valid until the next call with this worker, which must be
 * vcache_commit or vcache_cancel: adding pairs in between would change the list that the answers belong to. 0: all is
 * answered. */
VCACHE_API size_t vcache_misses(vcache_worker *worker, const vcache_miss **misses);

/* Answers for all of these rays, in their order. Pairs that waited for the same cells are looked up again and may give
 * new misses (a finer level). */
VCACHE_API void vcache_commit(vcache_worker *worker, const vcache_answer *answers);

/* Drops all pending pairs; their bits stay as they are. */
VCACHE_API void vcache_cancel(vcache_worker *worker);

/* Traces `count` rays into answers[0 ... count - 1]; false cancels. No lock is held; any other worker may be used
 * inside. */
typedef bool (*vcache_trace)(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers);

/* Resolves the pending batch by the callback. False where it was cancelled; pending pairs are dropped then. */
VCACHE_API bool vcache_resolve(vcache_worker *worker, vcache_trace trace, void *context);

/* vcache_add and vcache_resolve for one eye end against `count` light ends (and whatever was pending). */
VCACHE_API bool vcache_query(vcache_worker *worker, const vcache_eye *eye, const vcache_light *lights, uint32_t count,
                             const uint64_t *asked, uint64_t *visible, vcache_trace trace, void *context);

/* One pair, for recursive renderers: no allocation, and a pending batch of the worker stays untouched. A cancelled
 * trace counts as blocked and is not stored. */
VCACHE_API bool vcache_visible(vcache_worker *worker, const vcache_eye *eye, const vcache_light *light,
                               vcache_trace trace, void *context);

/* ------------------------------------------------------------------------------------------------- what has moved */

/* From frame to frame a cache may keep what it knows, as long as nothing moves but the camera. Else vcache_clear
 * forgets all of it; or only what may have changed is asked anew. What is stored cannot be listed (it is hashes), but
 * it can be asked for under another salt: with one box around all places where moving objects have been since the last
 * clear,
 * - prepare each eye end twice, with salt 0 and with one that is new in each frame that moves something;
 * - ask for the lights that cross the box with the second end, for all others with the first, which is what they were
 *   asked with before. No answer from before the move is given then, but for the 2^-31 of foreign words.
 * Pays where most segments miss the box.
 *
 * Bit i of `crossing` (bit i % 64 of word i / 64) tells whether any segment between the cells of `eye` and of lights[i]
 * may meet the box: of all points that may answer for these two. Set as well where an end cannot be quantized, for
 * cells of directions (they are cones), and where the box holds NaN. Some 20 ns a light. Eq. 6 has no such call. */
VCACHE_API void vcache_crossing(const vcache *cache, const vcache_eye *eye, const vcache_light *lights, uint32_t count,
                                const float box_min[3], const float box_max[3], uint64_t *crossing);

/* Light `index` < count of the set becomes another end: what was known of it is forgotten, in all rows, once per row;
 * all else stays. No other thread may use the set meanwhile. (In the table of vcache_add a light that is prepared
 * elsewhere has another key, and nothing need be done.) */
VCACHE_API void vcache_light_set_replace(vcache_light_set *set, uint32_t index, const vcache_light *light);

/* ----------------------------------------------------------------------------------------------------- estimating */

/* The cache as a control variate: the sum of many lights without bias, from a few rays. With f_i the unoccluded
 * contribution of light i of a set, V_i its visibility and m_i what the cache expects of it,
 *
 *     sum f_i V_i  =  sum f_i m_i  +  sum f_i (V_i - m_i)
 *
 * where the second sum is estimated by few lights, light i being drawn with probability p_i ~ f_i times the deviation
 * of V_i from m_i. vcache_predict says what is expected, vcache_pick_lights draws, the host traces and adds f (V - m) /
 * p for each, and vcache_learn writes down what was found. m and p are fixed before the rays are drawn, so the expected
 * value is exact whatever the cache holds, also while other threads write to it; the cache only makes the error small.
 *
 * What an eye end knows of a light are the states of three cells around it (sides C_E, 4 C_E and 16 C_E eye samples),
 * each one of: unknown, seen visible, seen blocked, both. m is the share of visible rays that was measured for each of
 * the 64 combinations, in other scenes at first, then in this one (vcache_adapt), apart for cells that found little and
 * cells that found much of what they asked for visible. The rows are those of the light set;
 * a light that was seen both ways counts as unknown in vcache_add_set, whose answer replaces it. Nothing is answered by
 * the cache alone, so nearness needs no exception. For each eye sample:
 *   1. contribution[i] = f_i, 0 beyond the last light;
 *   2. p = vcache_predict(predictor, &surface, 12.0f, 0, contribution);
 *   3. sum = sum of colour_i * p.mean[i];
 *   4. rays = vcache_budget_rays(&budget, p.deviation, p.expected, 1);
 *      n = vcache_pick_lights(predictor, rays, 1, random, picks, capacity);
 *   5. trace them; sum += colour * (V - mean) * picks[k].weight for each; vcache_learn(set, &p.cells, picks, V, n).
 *
 * Eye samples close to each other, such as those of a pixel on one surface, can share one prediction: with g_i the
 * contribution in the middle of them, sum f_i V_i = sum g_i m_i + sum (f_i V_i - g_i m_i) for each, and only the f_i of
 * lights that are drawn are wanted. Predict in the middle, add sum g_i m_i to each of them, and for each pick (f_i V_i
 * - g_i m_i) * weight to the sample that it names; learn once. contribution[i] decides p_i alone: lift it above 0, by a
 * thousandth of the mean, say, for all lights that one of them may see (f_i > 0), even where g_i = 0: else there is
 * bias. The g_i of both sums stay as they are. */
#define VCACHE_CELLS 3
typedef struct vcache_cells {
    uint64_t key[VCACHE_CELLS]; /* finest first; 0: the end cannot be quantized, nothing is known or learnt */
} vcache_cells;

/* What vcache_predict found out. */
typedef struct vcache_prediction {
    const float *mean;  /* [lights] m_i, in (0, 1); valid until the next prediction of this predictor */
    float expected;     /* sum f_i m_i */
    float deviation;    /* sum f_i d_i, d_i the deviation of V_i: n rays leave an error of about deviation / sqrt(n) */
    vcache_cells cells; /* where vcache_learn puts what is found */
} vcache_prediction;

/* A light that was drawn. */
typedef struct vcache_pick {
    uint32_t light;  /* of the set */
    uint32_t sample; /* of those that share the prediction */
    uint32_t state;  /* of the light and its cells: for vcache_adapt */
    float weight;    /* 1 / p, at least 1 */
} vcache_pick;

/* How lights are drawn. All three are without bias; the first leaves the smallest error. */
typedef enum vcache_drawing {
    VCACHE_DRAW_UNCERTAIN, /* the control variate above */
    VCACHE_DRAW_VISIBLE, /* no control variate: m_i is next to 0, and light i is drawn with probability ~ f_i sqrt(what
                            the cache expects of V_i), plus a little so that none is missed */
    VCACHE_DRAW_BRIGHT   /* for comparison: as if there were no cache. m_i is next to 0, p_i ~ f_i, cells have no keys
                            and nothing is learnt */
} vcache_drawing;

/* Scratch of one thread for one set (about 6 bytes a light). */
typedef struct vcache_predictor vcache_predictor;
VCACHE_API vcache_status vcache_predictor_create(vcache_light_set *set, vcache_drawing drawing, vcache_predictor **out,
                                                 char *message);
/* Before its set. */
VCACHE_API void vcache_predictor_destroy(vcache_predictor **predictor);

/* Floats in an array of contributions: the lights of the set, rounded up to whole 64. */
VCACHE_API uint32_t vcache_light_set_padded(const vcache_light_set *set);

/* `contribution` has vcache_light_set_padded floats, each finite and >= 0 (0: not asked, never drawn; so the padding),
 * in any unit that is the same for all lights (luminance, say), and must stay as it is until the lights are picked.
 * `ce` is C_E of the finest cell, `salt` as in vcache_prepare_eye. */
VCACHE_API vcache_prediction vcache_predict(vcache_predictor *predictor, const vcache_surface *eye, float ce,
                                            uint64_t salt, const float *contribution);

/* Draws lights for the last prediction by one systematic sample, for each of the `samples` >= 1 eye samples that share
 * it: for each of them light i with probability p_i = min(1, rays / samples * f_i d_i / deviation), never twice. That
 * is `rays` picks for all of them on average, at most rays + 1, fewer where some p are capped at 1; in the order of the
 * lights, and spread evenly over the samples. `rays` is cut to capacity - 2 (4 times the budget's mean, times samples,
 * + 2 never cuts). `random` in [0, 1) must be uniform, and independent of all that was learnt before the prediction:
 * numbers that hang together lower the error of a sum, but all of their predictions must be made before any of their
 * answers is learnt. log2(samples) of its bits decide who begins. Returns the number of picks: 0, and bias if anything
 * was asked, where rays is not above 0 or capacity is below 3. Probabilities are exact to rounding: lights 2^-20 times
 * lighter than others of the same 64 have them coarsely. */
VCACHE_API uint32_t vcache_pick_lights(const vcache_predictor *predictor, float rays, uint32_t samples, double random,
                                       vcache_pick *picks, uint32_t capacity);

/* What the rays of an eye end found: lights picks[i].light, which must be below the set's count. Any thread, any time
 * later; answers with VCACHE_ONCE are not learnt. What other threads hold at the moment is dropped. */
VCACHE_API void vcache_learn(vcache_light_set *set, const vcache_cells *cells, const vcache_pick *picks,
                             const vcache_answer *answers, uint32_t count);

/* Counts what the rays of the last predictions found, by the states of their lights, and from time to time makes the
 * predictor expect that: scenes differ in how often a light that nobody has asked for is seen. Optional; after
 * vcache_learn, say. */
VCACHE_API void vcache_adapt(vcache_predictor *predictor, const vcache_pick *picks, const vcache_answer *answers,
                             uint32_t count);

/* How many rays an eye sample deserves. The sum of the squares of relative errors over an image is least, at a given
 * mean number of rays, where n grows with error / value; of the squares of errors, where n grows with the error. In
 * between: error / (value + 0.4 its mean). Zero-initialised but for `rays`, one for each thread. */
typedef struct vcache_budget {
    float rays;                       /* mean number of rays per eye sample, > 0 */
    double sum, values, count, scale; /* its own */
} vcache_budget;
/* Rays for `samples` eye samples together, of each of which `error` = deviation x weight and `value` = expected x
 * weight. Each gets between rays / 10 and 4 rays, and `rays` on average. (A light that outweighs all others together
 * should not be among them: it would be drawn always, and its weight says nothing of the error. Where most light is
 * blocked, doubts about lights that are never seen outweigh what is expected, and take rays from where there is light:
 * `value` = (expected + a tenth of the sum of contributions) x weight avoids that.) */
VCACHE_API float vcache_budget_rays(vcache_budget *budget, float error, float value, uint32_t samples);

/* The same for pairs that nobody knows in advance: next-event estimation of a path tracer, connections of bidirectional
 * paths. With f the pair's unoccluded contribution, m the visibility that the cache expects and p the probability of
 * tracing it,
 *
 *     f (m + (V - m) / p)  where it is traced,     f m  where it is not
 *
 * has the expected value f V: Russian roulette (Arvo and Kirk 1990) around a control variate. m and p are fixed before
 * the random number is drawn, so there is no bias whatever the cache holds, also while other threads write to it. p is
 * in proportion to contribution x deviation of V from m, the least variance for a number of rays. For each pair:
 *   1. e = vcache_estimate_pair(worker, eye, light, contribution);
 *   2. random < e.probability: trace; sum += f * (e.mean + (V - e.mean) / e.probability);
 *      vcache_learn_pair(worker, &e, V);
 *   3. else sum += f * e.mean.
 * `random`: uniform in [0, 1), independent of all that was learnt before the estimate, and of what drew the pair.
 *
 * What is known of a pair of cells is how many of its rays were visible and how many blocked, in a word of the table of
 * vcache_add; both kinds of words share the table and never answer for each other, and vcache_clear clears both. Cells
 * are the unrefined ones of the eye end, or those of Eq. 6, and may be much larger than where the cache answers alone:
 * C_E of 32 to 64 left the least variance. (A cache for nothing else can have config.levels = 1: ends are prepared
 * faster.) Nothing is answered by the cache alone, so nearness needs no exception. */
typedef struct vcache_estimate {
    float mean;        /* m, in [0, 1] */
    float probability; /* p, in [0, 1]: a multiple of 2^-24, so that random numbers of 24 bits are exact enough */
    uint64_t key;      /* where the answer is learnt; 0: nowhere */
} vcache_estimate;

/* `contribution`: |f| (its luminance, say) over a threshold that the host chooses; p = contribution x deviation of V,
 * or 1. The deviation of an unknown pair is 1/2 (as its m), that of the surest 0.09; |f (V - m) / p| is never above the
 * larger of |f| and 12 thresholds. A contribution not above 0: p = m = 0, nothing is to be added. NaN or infinite, an
 * end that cannot be quantized, a worker of exact mode: p = 1. Cannot fail. Threads: as all calls of a worker. */
VCACHE_API vcache_estimate vcache_estimate_pair(vcache_worker *worker, const vcache_eye *eye, const vcache_light *light,
                                                float contribution);
VCACHE_API vcache_estimate vcache_estimate_vertices(vcache_worker *worker, const vcache_vertex *eye,
                                                    const vcache_vertex *light, float contribution);

/* What the ray of an estimate found, with any worker of the cache, any time later; to be called for each ray, once.
 * Answers with VCACHE_ONCE are not learnt. */
VCACHE_API void vcache_learn_pair(vcache_worker *worker, const vcache_estimate *estimate, vcache_answer answer);

/* ----------------------------------------------------------------------------------------------------- statistics */

/* Counts of a worker. */
typedef struct vcache_statistics {
    size_t size;                      /* in: sizeof(vcache_statistics); out: bytes that this version filled */
    uint64_t asked;                   /* pairs added or estimated */
    uint64_t traced;                  /* rays given out as misses, bypassed ones included; of estimates: rays learnt */
    uint64_t bypassed;                /* of these: pairs answered exactly (ends nearer than a cell, ends that cannot
                                         be quantized, exact mode) */
    uint64_t once;                    /* of these: answers that were not to be stored */
    uint64_t stored;                  /* words written */
    uint64_t overwritten;             /* of these: words that held something else, or something older than a clear; of
                                         light sets: rows replaced (`stored` counts their bits) */
    uint64_t hits[VCACHE_MAX_LEVELS]; /* pairs answered by the table, by level; estimates that knew something: 0 */
    uint32_t hit_levels;              /* mask of the levels that have hits */
    /* Of workers that verify, beside the counts above: */
    uint64_t verified;     /* rays for pairs that the cache had answered */
    uint64_t mispredicted; /* of these: the cache was wrong */
    uint64_t leaked;       /* of these: blocked, and the cache had said visible */
} vcache_statistics;

/* Counts of this worker since it was created or reset. */
VCACHE_API void vcache_worker_statistics(const vcache_worker *worker, vcache_statistics *out);
VCACHE_API void vcache_worker_reset_statistics(vcache_worker *worker);

/* English text of a status, never NULL. */
VCACHE_API const char *vcache_status_text(vcache_status status);
/* major * 10000 + minor * 100 + patch of the library that is linked. */
VCACHE_API uint32_t vcache_version(void);

#ifdef __cplusplus
}
#endif

#endif
