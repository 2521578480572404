/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Bidirectional path tracing (Veach 1997, Chap. 10) with exact or cached visibility of the connections (Popov et al.
 * 2013, Sect. 3.4). Each pass over the image draws one eye and one light sub-path per pixel:
 *   subpaths.c    walks both, and adds emitters and sky that the eye path meets,
 *   pilot.c       looks around before the first pass: densities of vertices, light by region,
 *   connect.c     pairs their vertices: what each connection brings, weighted against all other ways to find it,
 *   visibility.c  decides which of them see each other, by packets of rays or by the cache,
 *   prepared.c    with the ends that the cache wants.
 * pass.c runs a pass on all cores and sums it into the film (turns.c: in the order of one core), render.c runs passes,
 * in epochs that share a cache.
 *
 * A path of s light and t eye vertices has s + t - 1 edges. t = 1 connects to the camera ("light tracing"), s = 0 has
 * met an emitter. Emitters seen directly (s = 0, t = 2) are left to the eye path alone.
 */
#ifndef BDPT_H
#define BDPT_H

#include "vcache/vcache.h"

#include "density.h"
#include "mis.h"

#include "../common/camera.h"
#include "../common/emitters.h"
#include "../common/image.h"
#include "../common/light_sources.h"
#include "../common/tracer.h"

enum {
    EDGES_MAX = 32, /* longer paths are cut off; roulette leaves next to none of them */
    BATCH = 64,     /* paths whose connections are decided together */
    TILE = 16
};

/* Connections end a little before the vertex; both stand off their surfaces already. */
#define RAY_END (1.0f - 0x1p-16f)

typedef enum visibility_mode {
    VISIBILITY_EXACT,
    VISIBILITY_CACHE,    /* each connection answered; bias */
    VISIBILITY_ESTIMATE, /* the cache as control variate, rays where it is uncertain; no bias */
    VISIBILITY_MODES
} visibility_mode;

typedef struct settings {
    uint32_t width, height;
    int spp;
    int epoch;      /* passes that share what the cache has learnt; N_P = epoch x pixels x partners */
    double seconds; /* no pass begins after so many; infinity: no limit */
    uint64_t seed;
    int threads;        /* 0: one per CPU */
    bool deterministic; /* batches ask the cache in the order that one thread takes them in */
    visibility_mode visibility;
    heuristic heuristic;
    int partners; /* light sub-paths that each eye sub-path is connected to, 1 ... BATCH */
    float ce;
    float rays;          /* of estimates: share of the connections that is traced */
    vcache_config cache; /* C_N, C_Z, C_R, bytes; bounds are the scene's */
    /* For looking into the method: paths of so many edges alone (0: all); of those the strategy with so many light
     * vertices alone, unweighted (-1: all, weighted). */
    int edges, light_vertices;
} settings;

typedef struct pilot pilot; /* pilot.h */

/* Everything that does not change between passes of one view. */
typedef struct view {
    const scene *scene;
    const tracer *tracer;
    const light_sources *lights; /* NULL: none */
    camera_frame camera;
    const pilot *pilot; /* NULL: no roulette of connections; densities where a cache is asked */
    settings settings;
} view;

/* --------------------------------------------------------------------------------------------- sub-paths (subpaths.c)
 */

/* Non-specular surface point of a sub-path. */
typedef struct vertex {
    surface surface;
    vec3 origin;    /* of connections: off the surface */
    rgb throughput; /* eye: weight of radiance towards wo; light: flux that arrives */
    mis mis;
    int edges; /* from the start of the sub-path, specular ones included */
} vertex;

/* Vertices of one side of a batch, in the order they were found. */
typedef struct side {
    vertex *vertices; /* room for BATCH * EDGES_MAX */
    uint32_t total;
    uint16_t of[BATCH][EDGES_MAX]; /* of a path: where its vertices stand */
    int count[BATCH];
} side;

/* The sub-paths of a batch. */
typedef struct batch {
    uint32_t count;
    uint32_t x[BATCH], y[BATCH]; /* pixel */
    uint64_t random[BATCH];      /* index of its random numbers */
    uint32_t pass;
    uint32_t partners;  /* settings' or as many as there are */
    rgb found[BATCH];   /* emitters and sky that the eye path met, weighted */
    rgb seen[BATCH];    /* those that it saw directly or by mirrors and glass */
    float depth[BATCH]; /* of its first hit, 0: none */
    vec3 normal[BATCH];
    side eye, light; /* z_1 ..., y_1 ... */
    bool lit[BATCH]; /* there is a y_0 */
    light_emission start[BATCH];
    uint64_t dark; /* light paths so far, of all batches, that do not start: power is beyond what floats hold */
} batch;

batch *batch_new(void);
void batch_free(batch *b);
/* From the pixels and random numbers. */
void subpaths(const view *v, batch *b);
/* Density of the way back: of arriving as if from wi, and leaving to where the sub-path came from. */
float reverse_pdf(const surface *s, vec3 wi);
/* Shading normals scatter light, which goes the other way, by this factor more (Veach 1997, Sect. 5.3). */
float adjoint_correction(const surface *s, vec3 wi);
bool strategy_wanted(const settings *f, int edges, int light_vertices);

/* ------------------------------------------------------------------------------------------- connections (connect.c)
 */

typedef enum connection_kind {
    CONNECT_SURFACES, /* eye vertex to light vertex; y_0 on an emitter is one (Eq. 6) */
    CONNECT_LIGHT,    /* eye vertex to a point, directional or environment light (Eq. 7, 9) */
    CONNECT_CAMERA    /* light vertex to the camera: always traced */
} connection_kind;

typedef struct connection {
    connection_kind kind;
    uint32_t path;      /* in the batch: the light's */
    int32_t eye, light; /* vertices of the batch; light -1: y_0; CAMERA: light alone */
    rgb value;          /* where nothing is in between */
    uint32_t pixel;     /* in the image, y * width + x */
} connection;

typedef struct connections {
    connection *items;
    size_t count, capacity;
    rng roulette;        /* of the batch */
    uint64_t not_finite; /* contributions of all batches so far that floats cannot hold */
} connections;

/* All pairs of a batch that face each other. `valued`: only those that bring something, after the roulette. Else what
 * surfaces bring is left for later, and taken to be 1; connections to the camera have their value. */
void connect_batch(const view *v, const batch *b, bool valued, connections *out);
/* That, of those that are left. */
void connect_visible(const view *v, const batch *b, connections *c);

/* ----------------------------------------------------------------------------------------- visibility (visibility.c)
 */

typedef struct counts {
    uint64_t asked, traced; /* connections of eye with light vertices; the rays of these */
    uint64_t camera;        /* connections to the camera, all traced */
    uint64_t not_finite;    /* contributions and light paths left out */
} counts;

/* One thread's means of deciding visibility. */
typedef struct connection_visibility connection_visibility;
/* `cache`: NULL for exact visibility. Exits on lack of memory. */
connection_visibility *connection_visibility_new(const view *v, vcache *cache);
void connection_visibility_free(connection_visibility *o);
/* A batch, in this order: what needs nothing of what others know; */
void connection_visibility_prepare(connection_visibility *o, const batch *b, const connections *c);
/* what asks the cache and teaches it (exact: nothing). `threshold`, of estimates: a contribution that is traced half of
 * the time where nothing is known; 0 at first, and changed for the next batch; */
void connection_visibility_ask(connection_visibility *o, const batch *b, const connections *c, float *threshold);
/* then all other rays. Scales each value by what is seen: 0 or 1; of estimates by what is expected and found. */
void connection_visibility_finish(connection_visibility *o, const batch *b, connections *c);
counts connection_visibility_counts(const connection_visibility *o);

#endif
