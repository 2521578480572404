/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Whitted-style eye paths + Monte Carlo direct light + instant radiosity (Popov et al. 2013, Sect. 4.2), with exact or
 * cached visibility. The image is rendered tile by tile; in each tile
 *   eye_paths.c   traces eye paths into a deep buffer of samples that want light,
 *   shade.c       pairs each of them with virtual point lights, punctual lights and light samples (direct.c),
 *   visibility.c  decides which pairs see each other, by packets of rays or by the cache,
 *   adaptive.c    or which of them are worth deciding,
 * and the visible contributions are summed. frame.c runs the tiles on all cores, renderers/common/comparison.c sets two
 * frames side by side.
 */
#ifndef WHITTED_H
#define WHITTED_H

#include "vcache/adaptive.h"
#include "vcache/grid.h"
#include "vcache/vcache.h"

#include "../common/emitters.h"
#include "../common/frame.h"
#include "../common/tracer.h"

#include <stdlib.h>

enum {
    TILE = 32,
    GROUP = TRACER_PACKET,
    CHUNK = 64,
    PASS = 64 /* eye paths per pixel that a tile keeps at a time: bounds the memory of a thread */
};

/* Shadow rays to a point end a little before it; both ends stand off their surfaces already. */
#define RAY_END (1.0f - 0x1p-16f)

typedef enum visibility_mode {
    VISIBILITY_EXACT,
    VISIBILITY_CACHE,
    VISIBILITY_ESTIMATE,       /* virtual and punctual lights by few rays, without bias: the cache as control variate,
                                  rays where that is uncertain */
    VISIBILITY_ADAPTIVE,       /* what would bring much is traced, the rest added by its hit rate */
    VISIBILITY_ADAPTIVE_CACHE, /* what would bring much goes through the cache */
    VISIBILITY_GRID,           /* directional lights by the coherence of neighbouring pixels (vcache/grid.h) */
    /* --select, few rays without bias as well: */
    VISIBILITY_SELECT,          /* no cache; lights drawn by what they would bring unoccluded */
    VISIBILITY_SELECT_BY_CACHE, /* by that and by what the cache expects to be seen */
    VISIBILITY_MODES
} visibility_mode;

typedef struct settings {
    uint32_t width, height;
    int spp;
    int vpls;
    int env_samples, light_samples; /* per eye sample; with one more drawn by the material */
    int env_lights;                 /* the environment is also this many of the scene's directional lights */
    uint64_t seed;
    int vpl_draw;   /* of the virtual point lights that the seed makes: eye paths stay as they are */
    uint32_t frame; /* of a sequence: lights are drawn anew in each, eye paths stay */
    int threads;    /* 0: one per CPU */
    visibility_mode visibility;
    bool lattice;            /* eye paths at the middles of k x k squares of their pixel, spp = k^2, at most PASS */
    vcache_grid_config grid; /* but for `pixels` and `rays` */
    uint32_t grid_block;     /* lattice pixels a side; 0: the whole image */
    float rays;              /* mean per eye sample, where few are traced */
    float ce;                /* C_E of virtual point lights; of the finest cells where few rays are traced */
    float refine_above;  /* virtual point lights below this times the eye sample's mean contribution are not refined */
    float ce_delta;      /* of point, spot and directional lights; 0: these are traced */
    float ce_samples;    /* of area and environment samples; 0: these are traced */
    vcache_config cache; /* C_N, C_Z, C_R, levels, bytes, hash; bounds are the scene's */
    bool words;          /* all answers in the table of 32-bit words instead of rows of light bits */
    bool shared; /* one cache for all threads instead of one for each region of the image; hit rates learnt on the way,
                    by all */
    float tolerance, certainty; /* t and c of adaptive shadow testing; t = 0: all are tested, as without it */
} settings;

/* ------------------------------------------------------------------------------------------------ lights (vpl.c) */

/* Virtual point lights: one array a component, padded to a multiple of 64 with lights of no power. */
typedef struct vpl_set {
    uint32_t count, padded;
    float *x, *y, *z;    /* position, off its surface */
    float *nx, *ny, *nz; /* unit shading normal: what it emits around */
    float *gx, *gy, *gz; /* unit geometric normal: what it is quantized by */
    float *r, *g, *b;    /* exitant radiance times area: W / sr along the normal */
    float *luminance;    /* of r, g, b */
    float *density;      /* of virtual point lights per unit area around it */
    float clamp;         /* squared distances below this count as this in the geometric term */
} vpl_set;

/* Everything that does not change between frames of one view. */
typedef struct view {
    const scene *scene;
    const tracer *tracer;
    const emitters *emitters; /* NULL: none */
    const vpl_set *vpls;      /* NULL: each frame makes its own */
    camera camera;
    settings settings;
} view;

/* Traces light paths and resamples their vertices to settings.vpls by what they bring to the camera. */
vpl_set vpls_new(const view *v);
void vpls_free(vpl_set *l);
/* None at all. */
extern const vpl_set vpls_none;

/* ------------------------------------------------------------------------------------------ eye paths (eye_paths.c) */

#define PLACE_NONE UINT32_MAX

/* Last vertex of an eye path: a non-specular surface point that is to be lit. */
typedef struct eye_sample {
    surface surface;
    vec3 origin;     /* of shadow rays: off the surface */
    rgb weight;      /* of radiance towards wo in the pixel */
    float density;   /* eye samples per unit area */
    uint32_t pixel;  /* in the tile */
    uint32_t place;  /* number of the path in its pixel; PLACE_NONE: behind specular surfaces */
    uint64_t random; /* index of its random numbers */
} eye_sample;

typedef struct tile {
    uint32_t x, y, width, height;
    uint32_t index;
} tile;

/* Per pixel of a tile. */
typedef struct tile_pixels {
    rgb seen[TILE * TILE]; /* emitters and sky, seen directly or by mirrors and glass */
    rgb lit[TILE * TILE];  /* shadow-tested radiance */
    float depth[TILE * TILE];
    vec3 normal[TILE * TILE];
    uint64_t cell[TILE * TILE];
    uint32_t asked[TILE * TILE], traced[TILE * TILE];
} tile_pixels;

typedef struct eye_samples {
    eye_sample *items;
    size_t count, capacity;
} eye_samples;

/* Fills `out` with the eye paths first ... first + count - 1 of each pixel, in Morton order of the pixels (specular
 * bounces behind all others): 16 in a row are coherent. Adds to `pixels`. Interrupted, it leaves out the pixels to
 * come. */
void eye_paths(const view *v, tile t, int first, int count, eye_samples *out, tile_pixels *pixels);

/* --------------------------------------------------------------------------------------------- light pairs (shade.c)
 */

/* A light sample of one eye sample (direct.c). */
typedef struct light_sample {
    vec3 target; /* position, or direction where infinite */
    bool infinite;
    rgb value; /* unoccluded contribution to the pixel */
} light_sample;

/* Punctual lights as seen by whoever is lit (punctual.c): one array a component, padded with lights of no power. */
typedef struct punctual_set {
    uint32_t count, padded;
    float *x, *y, *z;      /* position; of directional lights the direction to them */
    float *dx, *dy, *dz;   /* the way a spot light shines */
    float *finite;         /* 0: directional, else 1 */
    uint64_t *directional; /* [padded / 64] a bit for each of these */
    bool all_directional;
    float *slope, *rise; /* fall-off: cosine * slope + rise, in 0 ... 1, to the power of `power` */
    uint32_t *power;
    float *r, *g, *b; /* intensity, or irradiance */
} punctual_set;

/* The first `count` lights of a scene. */
punctual_set punctuals_new(const scene *s, uint32_t count);
void punctuals_free(punctual_set *l);
/* cos fall-off / r^2 of each light at an eye sample, padded; 0 where nothing arrives or nothing of it is reflected. */
void punctuals_geometry(const punctual_set *l, const eye_sample *e, float *out);
/* Cosines of the directional lights with the normal, padded; 0 for others, and below its horizon or that of the
 * geometric normal. */
void punctuals_cosines(const punctual_set *l, const surface *s, float *out);
/* Position, or direction to it. */
vec3 punctuals_target(const punctual_set *l, uint32_t i, bool *infinite);
/* BRDF of the eye sample times intensity of light i. */
rgb punctuals_response(const punctual_set *l, const eye_sample *e, uint32_t i);

/* Pairs of the eye samples of a chunk with one kind of light: bit i of a row is light i. */
typedef struct pair_bits {
    uint32_t lights, words; /* 64-bit words a row */
    uint64_t *asked, *visible;
    uint64_t *refine; /* worth a finer cell; NULL: all */
} pair_bits;

enum light_group { LIGHTS_VIRTUAL, LIGHTS_PUNCTUAL, LIGHTS_SAMPLED, LIGHT_GROUPS };

typedef struct chunk {
    const eye_sample *eyes[CHUNK];
    uint32_t count;
    pair_bits bits[LIGHT_GROUPS];
    float *geometry;              /* [CHUNK][vpls.padded]: cos cos / r^2 of each virtual point light */
    float *contribution, *weight; /* scratch of one eye sample */
    punctual_set punctual;
    float *punctual_geometry; /* [CHUNK][punctual.padded]: the same of each punctual light */
    light_sample *sampled;    /* [CHUNK][samples] */
    float *sampled_density;   /* of the samples, per unit area or steradian */
    vec3 *sampled_normal;
    bool reflects[CHUNK]; /* false: black, asks for nothing */
    rgb material[CHUNK];  /* what the material's own sample found: a traced path, no shadow ray */
} chunk;

static inline void vec3_store(float out[3], vec3 v)
{
    out[0] = v.x, out[1] = v.y, out[2] = v.z;
}

/* Zeroed floats that begin a cache line, for free(). */
float *floats_new(size_t count);
/* `punctual`: lights that are not left to someone else. */
void chunk_new(chunk *c, const view *v, const vpl_set *vpls, uint32_t punctual);
void chunk_free(chunk *c);

/* Unoccluded contributions of all lights; sets the asked bits and clears the visible ones. */
void shade_unoccluded(const view *v, const vpl_set *vpls, chunk *c);
/* Adds what is visible to the pixels. Sums in the order of lights, whatever the order of tracing was. */
void shade_sum(const vpl_set *vpls, const chunk *c, tile_pixels *pixels);
/* What one eye sample adds to its pixel where each light is seen as far as its weight says (0 ... 1); rows padded to
 * 64, with anything finite behind the last light. */
rgb shade_weighted(const vpl_set *vpls, const chunk *c, uint32_t e, const float *const weight[LIGHT_GROUPS]);

/* For one eye sample: the geometry of each virtual point light, and times `power` (its luminance, say), into `out`; all
 * padded. Returns how many are above 0. */
uint32_t shade_contributions(const vpl_set *vpls, const eye_sample *e, const float *power, float *geometry, float *out);
/* The geometry of one of them. */
float shade_geometry(const vpl_set *vpls, const eye_sample *e, uint32_t i);
/* Radiance of all virtual point lights off a diffuse surface, each seen as far as `seen` says (0 ... 1). */
rgb shade_expected_diffuse(const vpl_set *vpls, const eye_sample *e, const float *geometry, const float *seen);
/* Sum of 16 n values. */
float shade_total(const float *values, uint32_t count);
/* Lifts values below `least` to it. */
void shade_lift(float *values, uint32_t count, float least);
/* Bit i of `bits` says whether values[i] > bound; 64 * words values. */
void shade_bits_above(const float *values, float bound, uint32_t words, uint64_t *bits);
/* BRDF of the eye sample times power of light i. */
rgb shade_response(const vpl_set *vpls, const eye_sample *e, uint32_t i);

/* direct.c */
uint32_t direct_sample_count(const view *v);
light_sample direct_punctual(const eye_sample *e, const light *l);
/* The same of all punctual lights; `asked` (NULL: not wanted) gets a bit for each above 0. */
void direct_punctuals(const view *v, const eye_sample *e, light_sample *out, uint64_t *asked);
/* For the eye samples of a chunk that reflect: samples of emitters (density per area, normal) and of the environment
 * (density per steradian), with their asked bits, and one direction each drawn by the material and traced; all weighted
 * by the balance heuristic. */
void direct_samples(const view *v, chunk *c);
/* Random order of the `count` samples of an eye sample. */
void direct_order(const view *v, const eye_sample *e, uint32_t count, uint16_t *order);

/* -------------------------------------------------------------------------------------- visibility (visibility.c) */

/* One thread's means of deciding visibility. */
typedef struct visibility visibility;

/* The caches of one region of the image, or of all. */
typedef struct caches {
    vcache *table; /* light samples; with settings.words all lights */
    vcache_light *virtual_ends, *punctual_ends;
    vcache_light_set *virtual_set, *punctual_set; /* NULL where the table serves */
    vcache_light_set *all_set; /* for the estimator: virtual point lights, padded, then punctual ones; NULL: none */
    uint64_t bytes;
} caches;

bool caches_new(const view *v, const vpl_set *vpls, caches *out, message *err);
void caches_free(caches *c);

/* `used` is NULL for exact visibility. */
visibility *visibility_new(const view *v, const vpl_set *vpls, const caches *used);
void visibility_free(visibility *o);
/* The same in parts: counts and prepares, then decides as often as the asked bits are set anew, the visible ones
 * cleared. */
void visibility_begin(visibility *o, chunk *c, tile_pixels *pixels);
void visibility_test(visibility *o, chunk *c, tile_pixels *pixels);
/* Before each pass over a tile. True where it is to be exact: of what was asked of the cache last, so much had to be
 * traced that packets of all of it are faster. Decided from counts alone. */
bool visibility_steps_aside(visibility *o);
/* Sets the visible bits of the chunk. */
void visibility_resolve(visibility *o, chunk *c, tile_pixels *pixels);
ray_counts visibility_counts(const visibility *o);
/* packed.c: traces what is asked for, where that is little; returns the number of rays, and counts those of each pixel.
 */
uint64_t packed_trace(const tracer *t, const vpl_set *vpls, chunk *c, tile_pixels *pixels);

/* -------------------------------------------------------------------------------------------- adaptive (adaptive.c) */

/* Whether a mode tests lights in the order of what they bring. */
bool adapts(visibility_mode mode);
/* Hit rates of a frame's lights, for all threads; *out is NULL without lights. */
bool adaptive_rates_new(const view *v, const vpl_set *vpls, vcache_adaptive **out, message *err);
/* One thread's means of choosing what is tested; NULL where there are no rates. */
typedef struct adaptive adaptive;
adaptive *adaptive_new(const view *v, const vpl_set *vpls, vcache_adaptive *rates);
void adaptive_free(adaptive *o);
/* Learns hit rates at some points all over the image, while no other thread uses them. `c` is scratch. */
void adaptive_learn(adaptive *o, visibility *by, chunk *c);
/* The light of a chunk, of which shade_unoccluded knows what it would be at most: tests what matters by `by` and adds
 * all to the pixels. */
void adaptive_light(adaptive *o, visibility *by, chunk *c, tile_pixels *pixels);

/* ------------------------------------------------------------------------------------------- estimate (estimator.c) */

/* One thread's means of estimating the light of all virtual and punctual lights without bias. */
typedef struct estimator estimator;
/* Whether a mode needs one. */
bool estimates(visibility_mode mode);
/* Punctual lights that it takes care of: all or none. A few bring so much each that they are better traced always. */
uint32_t estimator_punctual(const view *v);
/* Whether few rays can stand for so many lights; else they are better traced. */
bool estimator_pays(const view *v, const vpl_set *vpls);
estimator *estimator_new(const view *v, const vpl_set *vpls, vcache_light_set *set);
void estimator_free(estimator *o);
/* Adds their light to the pixels of at most CHUNK eye samples. */
void estimator_light(estimator *o, const eye_sample *const *eyes, uint32_t count, tile_pixels *pixels);
ray_counts estimator_counts(const estimator *o);

/* --------------------------------------------------------------------------------------------- grid coherence (grid.c)
 */

/* Reads what follows --visibility grid= (NULL: nothing): a mode of vcache_grid_parse_mode, and block=N. */
bool grid_parse(const char *text, settings *f, message *err);
/* Whether so many eye paths per pixel make a lattice. */
bool grid_samples_fit(int spp);

/* The scene's directional lights, their cells, and how the image is cut into blocks of tiles. */
typedef struct grid_scene grid_scene;
/* *out is to be freed in any case. Nothing but grid_light_count may be asked of one without lights. */
bool grid_scene_new(const view *v, grid_scene **out, message *err);
void grid_scene_free(grid_scene *g);
uint32_t grid_light_count(const grid_scene *g);
uint32_t grid_blocks(const grid_scene *g);

typedef struct grid_tile {
    tile tile; /* its index: by row and column */
    eye_samples samples;
    tile_pixels *pixels;
} grid_tile;

/* What one thread needs. */
typedef struct grid_station grid_station;
/* *out is to be freed in any case. */
bool grid_station_new(const grid_scene *g, grid_station **out, message *err);
void grid_station_free(grid_station *o);
/* Traces the eye paths of a block and decides its directional lights. Returns the number of its tiles, and adds the
 * time that the lights took. */
uint32_t grid_block(grid_station *o, uint32_t index, grid_tile **tiles, double *seconds);
/* Sets the visible bits of a chunk of a tile of that block; lights that are not decided go to `others`. */
void grid_resolve(grid_station *o, visibility *others, const tile *t, chunk *c, tile_pixels *pixels);

/* Of a frame: seconds of all threads in tracing decided lights; their rays as of vcache_grid_statistics. */
typedef struct grid_figures {
    double rays_s;
    uint64_t coarse, silhouette, uncertain, flooded, surprises, batches, bytes;
} grid_figures;
ray_counts grid_counts(const grid_station *o, grid_figures *add);

/* ------------------------------------------------------------------------------------------------- frame (frame.c) */

/* Exact visibility of every pair of a frame, to count mispredictions with. */
typedef struct truth {
    uint64_t **passes; /* of a tile one behind the other; NULL: not recorded */
    size_t pass_count;
} truth;

/* `extra` of a frame. */
typedef struct frame_lights {
    uint32_t vpls, punctual, samples;
    visibility_mode served; /* exact where the chosen mode stepped aside for the whole frame */
    double visibility_s;    /* of shade_s: deciding visibility, rays included; where that is apart from
                               shading: not of estimates and adaptive testing */
    grid_figures grid;
} frame_lights;

static inline const frame_lights *lights_of(const frame *f)
{
    return f->extra;
}

/* Whether a mode asks the cache; a frame has cells then. */
bool uses_cache(visibility_mode mode);
/* `record` (NULL: none) takes down exact visibility; `check` counts the differences to it. */
bool frame_render(const view *v, const char *title, bool quiet, truth *record, const truth *check, frame *out,
                  message *err);
/* Memory that the images of one frame take at most. */
uint64_t frame_bytes(const settings *f);
void truth_free(truth *t);

#endif
