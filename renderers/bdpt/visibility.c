/* SPDX-License-Identifier: Apache-2.0 */
/* Which connections of a batch see each other: by packets of rays, or by the cache and packets of what it misses. */
#include "bdpt.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Ends of one kind, prepared when they are first wanted: once per vertex, however many connections it has. */
typedef struct ends {
    char *memory;
    size_t stride;
    bool ready[BATCH * (EDGES_MAX + 1)];
} ends;

struct connection_visibility {
    const view *v;
    vcache *cache;                     /* NULL: exact */
    vcache_worker *worker;             /* of the cache */
    ends eye_vertices, light_vertices; /* Eq. 6 */
    ends eyes, lights;                 /* Eq. 7, 9; lights: one a path */
    float threshold;   /* of estimates: a contribution that is traced half of the time where nothing is known */
    rng random;        /* of a batch: which connections are traced */
    uint64_t *visible; /* a word for each connection, bit 0 */
    vcache_estimate *estimates;
    float *weights;   /* of estimates */
    uint32_t *traced; /* connections */
    size_t capacity;  /* of these four */
    counts counts;
    ray_packet packet;
    uint32_t lanes;
    uint64_t *lane_answer[TRACER_PACKET];
};

static void ends_new(ends *e, size_t count, size_t stride)
{
    e->stride = stride;
    e->memory = xcalloc(count, stride);
}

connection_visibility *connection_visibility_new(const view *v, vcache *cache)
{
    connection_visibility *o = aligned_alloc(_Alignof(connection_visibility), sizeof *o); /* its packet */
    if (!o) {
        fprintf(stderr, "bdpt: out of memory\n");
        exit(1);
    }
    memset(o, 0, sizeof *o);
    o->v = v;
    o->cache = cache;
    packet_init_solid(&o->packet);
    if (!cache)
        return o;
    char text[VCACHE_MESSAGE_BYTES];
    if (vcache_worker_create(cache, NULL, &o->worker, text) != VCACHE_OK) {
        fprintf(stderr, "bdpt: %s\n", text);
        exit(1);
    }
    ends_new(&o->eye_vertices, BATCH * EDGES_MAX, vcache_vertex_size());
    ends_new(&o->light_vertices, BATCH * (EDGES_MAX + 1), vcache_vertex_size());
    ends_new(&o->eyes, BATCH * EDGES_MAX, vcache_eye_size(cache, v->settings.ce));
    ends_new(&o->lights, BATCH, vcache_light_size());
    return o;
}

void connection_visibility_free(connection_visibility *o)
{
    if (!o)
        return;
    vcache_worker_destroy(&o->worker);
    ends *all[] = {&o->eye_vertices, &o->light_vertices, &o->eyes, &o->lights};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        free(all[i]->memory);
    free(o->visible);
    free(o->estimates);
    free(o->weights);
    free(o->traced);
    free(o);
}

counts connection_visibility_counts(const connection_visibility *o)
{
    return o->counts;
}

/* ------------------------------------------------------------------------------------------------------- rays */

static void flush_rays(connection_visibility *o)
{
    uint32_t all = (1u << o->lanes) - 1u;
    uint32_t blocked = o->lanes ? tracer_occluded16(o->v->tracer, &o->packet, all, false) : 0;
    for (uint32_t i = 0; i < o->lanes; i++)
        *o->lane_answer[i] = !(blocked >> i & 1u);
    o->lanes = 0;
}

/* `to`: a point, or a direction where `infinite`. The answer comes at the latest with flush_rays. */
static void push_ray(connection_visibility *o, vec3 from, vec3 to, bool infinite, uint64_t *answer)
{
    ray_packet *p = &o->packet;
    uint32_t i = o->lanes++;
    vec3 d = infinite ? to : v3_sub(to, from);
    p->org_x[i] = from.x, p->org_y[i] = from.y, p->org_z[i] = from.z;
    p->dir_x[i] = d.x, p->dir_y[i] = d.y, p->dir_z[i] = d.z;
    p->tfar[i] = infinite ? INFINITY : RAY_END;
    o->lane_answer[i] = answer;
    if (o->lanes == TRACER_PACKET)
        flush_rays(o);
}

static void push_connection(connection_visibility *o, const batch *b, const connection *c, uint64_t *answer)
{
    const light_emission *y0 = &b->start[c->path];
    vec3 y = c->light >= 0 ? b->light.vertices[c->light].origin : y0->origin;
    if (c->kind == CONNECT_CAMERA)
        push_ray(o, y, o->v->camera.eye, false, answer);
    else if (c->kind == CONNECT_LIGHT && y0->kind != SOURCE_POINT)
        push_ray(o, b->eye.vertices[c->eye].origin, v3_neg(y0->direction), true, answer);
    else
        push_ray(o, b->eye.vertices[c->eye].origin, y, false, answer);
}

/* ------------------------------------------------------------------------------------------------------- ends */

static void store(float out[3], vec3 p)
{
    out[0] = p.x, out[1] = p.y, out[2] = p.z;
}

static vcache_surface surface_end(vec3 position, vec3 normal, const density_map *density)
{
    vcache_surface s = {.density = density_at(density, position)};
    store(s.position, position);
    store(s.normal, normal);
    return s;
}

static float paths(const settings *f)
{
    return (float)f->width * (float)f->height * (float)f->epoch;
}

/* What stands for Eq. 6 where the light's end is a direction (Eq. 9) or a single light (Eq. 7): sqrt(N_P) / C_E cells
 * on either side give the C_E^2 connections per pair of cells. */
static float sides(const settings *f)
{
    return float_max(1.0f, sqrtf(paths(f)) / f->ce);
}

static void *slot(ends *e, uint32_t index, bool *fresh)
{
    *fresh = !e->ready[index];
    e->ready[index] = true;
    return e->memory + index * e->stride;
}

static vcache_vertex *eye_vertex(connection_visibility *o, const batch *b, const connection *c)
{
    bool fresh;
    void *at = slot(&o->eye_vertices, (uint32_t)c->eye, &fresh);
    if (fresh) {
        const vertex *z = &b->eye.vertices[c->eye];
        vcache_surface s = surface_end(z->origin, z->surface.geometric_normal, o->v->eye_density);
        vcache_prepare_eye_vertex(o->cache, &s, o->v->settings.ce, paths(&o->v->settings), 0, at);
    }
    return at;
}

static vcache_vertex *light_vertex(connection_visibility *o, const batch *b, const connection *c)
{
    bool fresh;
    uint32_t index = c->light >= 0 ? (uint32_t)c->light : BATCH * EDGES_MAX + c->path; /* y_0 behind all others */
    void *at = slot(&o->light_vertices, index, &fresh);
    if (fresh) {
        const light_emission *y0 = &b->start[c->path];
        const vertex *y = &b->light.vertices[c->light];
        const density_map *density = o->v->light_density;
        vcache_surface s = c->light >= 0 ? surface_end(y->origin, y->surface.geometric_normal, density)
                                         : surface_end(y0->origin, y0->normal, density);
        vcache_prepare_light_vertex(o->cache, &s, at);
    }
    return at;
}

static vcache_eye *eye_end(connection_visibility *o, const batch *b, const connection *c)
{
    bool fresh;
    void *at = slot(&o->eyes, (uint32_t)c->eye, &fresh);
    if (fresh) {
        const settings *f = &o->v->settings;
        const vertex *z = &b->eye.vertices[c->eye];
        float count = paths(f);
        if (b->start[c->path].kind == SOURCE_ENVIRONMENT)
            count /= sides(f);
        vcache_surface s = surface_end(z->origin, z->surface.geometric_normal, o->v->eye_density);
        s.density *= count;
        vcache_prepare_eye(o->cache, &s, f->ce, 0, at);
    }
    return at;
}

static vcache_light *light_end(connection_visibility *o, const batch *b, const connection *c)
{
    bool fresh;
    void *at = slot(&o->lights, c->path, &fresh);
    if (fresh) {
        const light_emission *y0 = &b->start[c->path];
        float to[3];
        store(to, y0->kind == SOURCE_POINT ? y0->position : v3_neg(y0->direction));
        if (y0->kind == SOURCE_POINT)
            vcache_prepare_point(o->cache, to, 0, at);
        else if (y0->kind == SOURCE_DIRECTIONAL)
            vcache_prepare_direction(o->cache, to, 0, at);
        else
            vcache_prepare_solid_angle(o->cache, to, y0->pdf_direct * sides(&o->v->settings), 0, at);
    }
    return at;
}

/* -------------------------------------------------------------------------------------------------- decisions */

static void reserve(connection_visibility *o, size_t count)
{
    if (count <= o->capacity)
        return;
    o->capacity = 2 * count;
    o->visible = xrealloc(o->visible, o->capacity * sizeof *o->visible);
    o->estimates = xrealloc(o->estimates, o->capacity * sizeof *o->estimates);
    o->weights = xrealloc(o->weights, o->capacity * sizeof *o->weights);
    o->traced = xrealloc(o->traced, o->capacity * sizeof *o->traced);
}

static vec3 load(const float p[3])
{
    return v3(p[0], p[1], p[2]);
}

static bool trace_misses(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    connection_visibility *o = context;
    uint64_t found[4096];
    o->counts.traced += count;
    for (size_t first = 0; first < count; first += 4096) {
        size_t n = count - first < 4096 ? count - first : 4096;
        for (size_t i = 0; i < n; i++) {
            const vcache_miss *m = &misses[first + i];
            push_ray(o, load(m->eye_position), load(m->light_position), m->infinite, &found[i]);
        }
        flush_rays(o);
        for (size_t i = 0; i < n; i++)
            answers[first + i] = found[i] ? VCACHE_VISIBLE : VCACHE_BLOCKED;
    }
    return true;
}

/* Words of the table come from memory: so many connections before they are looked at. */
enum { AHEAD = 16 };

static void prefetch(connection_visibility *o, const batch *b, const connection *c)
{
    if (c->kind == CONNECT_SURFACES)
        vcache_prefetch_vertices(o->worker, eye_vertex(o, b, c), light_vertex(o, b, c));
    else if (c->kind == CONNECT_LIGHT)
        vcache_prefetch(o->worker, eye_end(o, b, c), light_end(o, b, c));
}

static bool add(connection_visibility *o, const batch *b, const connection *c, uint64_t *visible)
{
    if (c->kind == CONNECT_SURFACES)
        return vcache_add_vertices(o->worker, eye_vertex(o, b, c), light_vertex(o, b, c), visible, 0);
    return c->kind == CONNECT_CAMERA ||
           vcache_add(o->worker, eye_end(o, b, c), light_end(o, b, c), 0, 1, NULL, visible) == 1;
}

static void ask_cache(connection_visibility *o, const batch *b, const connections *c)
{
    memset(o->visible, 0, c->count * sizeof *o->visible);
    for (size_t i = 0; i < c->count + AHEAD; i++) {
        if (i < c->count)
            prefetch(o, b, &c->items[i]);
        if (i >= AHEAD)
            while (!add(o, b, &c->items[i - AHEAD], &o->visible[i - AHEAD]))
                vcache_resolve(o->worker, trace_misses, o);
    }
    vcache_resolve(o->worker, trace_misses, o);
}

/* The threshold for the next batches follows from what the last ones took: no random number of theirs depends on it. */
static void follow_share(connection_visibility *o, const connections *c, uint32_t count)
{
    float sum = 0.0f, n = 0.0f;
    for (size_t i = 0; i < c->count; i++)
        if (c->items[i].kind != CONNECT_CAMERA)
            sum += luminance(c->items[i].value), n += 1.0f;
    if (!(sum > 0.0f))
        return;
    if (!(o->threshold > 0.0f)) {
        o->threshold = sum / n;
        return;
    }
    float share = (float)count / n, wanted = o->v->settings.rays;
    o->threshold *= expf(0.1f * (share - wanted) / (share + wanted));
}

/* Connections are traced with the probability that their estimate asks for, the rest are what is expected. */
static void estimate(connection_visibility *o, const batch *b, connections *c)
{
    uint32_t count = 0;
    o->random = rng_make(o->v->settings.seed ^ 0x657374696d617465u, b->random[0]);
    for (size_t i = 0; i < c->count; i++) {
        const connection *x = &c->items[i];
        vcache_estimate *e = &o->estimates[i];
        if (x->kind == CONNECT_CAMERA)
            continue;
        float worth = o->threshold > 0.0f ? luminance(x->value) / o->threshold : INFINITY;
        *e = x->kind == CONNECT_SURFACES
                 ? vcache_estimate_vertices(o->worker, eye_vertex(o, b, x), light_vertex(o, b, x), worth)
                 : vcache_estimate_pair(o->worker, eye_end(o, b, x), light_end(o, b, x), worth);
        if (!(rng_float(&o->random) < e->probability))
            continue;
        push_connection(o, b, x, &o->visible[i]);
        o->traced[count++] = (uint32_t)i;
    }
    flush_rays(o);
    for (size_t i = 0; i < c->count; i++)
        if (c->items[i].kind != CONNECT_CAMERA)
            o->weights[i] = o->estimates[i].mean;
    for (uint32_t k = 0; k < count; k++) {
        const vcache_estimate *e = &o->estimates[o->traced[k]];
        bool seen = o->visible[o->traced[k]] & 1;
        o->weights[o->traced[k]] += ((seen ? 1.0f : 0.0f) - e->mean) / e->probability;
        vcache_learn_pair(o->worker, e, seen ? VCACHE_VISIBLE : VCACHE_BLOCKED);
    }
    o->counts.traced += count;
    follow_share(o, c, count);
}

static void forget_ends(connection_visibility *o)
{
    ends *all[] = {&o->eye_vertices, &o->light_vertices, &o->eyes, &o->lights};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        memset(all[i]->ready, 0, sizeof all[i]->ready);
}

/* Exact connections, and those to the camera. */
static void trace_rest(connection_visibility *o, const batch *b, const connections *c)
{
    bool exact = o->cache == NULL;
    for (size_t i = 0; i < c->count; i++) {
        bool to_camera = c->items[i].kind == CONNECT_CAMERA;
        o->counts.asked += !to_camera;
        o->counts.camera += to_camera;
        o->counts.traced += !to_camera && exact;
        if (to_camera || exact)
            push_connection(o, b, &c->items[i], &o->visible[i]);
    }
    flush_rays(o);
}

void connection_visibility_resolve(connection_visibility *o, const batch *b, connections *c)
{
    bool estimates = o->v->settings.visibility == VISIBILITY_ESTIMATE && o->cache;
    reserve(o, c->count + 1); /* never NULL */
    if (o->cache)
        forget_ends(o);
    if (estimates)
        estimate(o, b, c);
    else if (o->cache)
        ask_cache(o, b, c);
    trace_rest(o, b, c);
    for (size_t i = 0; i < c->count; i++) {
        connection *x = &c->items[i];
        bool estimated = estimates && x->kind != CONNECT_CAMERA;
        x->value = v3_scale(x->value, estimated ? o->weights[i] : (float)(o->visible[i] & 1));
    }
}
