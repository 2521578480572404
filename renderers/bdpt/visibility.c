/* SPDX-License-Identifier: Apache-2.0 */
/* Which connections of a batch see each other: by packets of rays, or by the cache and packets of what it misses. */
#include "prepared.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct connection_visibility {
    const view *v;
    vcache *cache;             /* NULL: exact */
    vcache_worker *worker;     /* of the cache */
    prepared *ends;            /* for it */
    vcache_vertex_pair *pairs; /* of surfaces */
    uint32_t pair_count;
    uint64_t *pairs_visible; /* a bit each */
    /* by prepared_sky and eye vertex: a bit for each path's light */
    uint64_t asked[2][BATCH * EDGES_MAX], lights_visible[2][BATCH * EDGES_MAX];
    rng random;        /* of a batch: which connections are traced */
    uint64_t *visible; /* a word for each connection, bit 0 */
    vcache_estimate *estimates;
    float *weights;   /* of estimates */
    uint32_t *traced; /* connections */
    size_t capacity;  /* connections that there is room for */
    counts counts;
    ray_packet packet;
    uint32_t lanes;
    uint64_t *lane_answer[TRACER_PACKET];
};

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
    o->ends = prepared_new(v, cache);
    return o;
}

void connection_visibility_free(connection_visibility *o)
{
    if (!o)
        return;
    vcache_worker_destroy(&o->worker);
    prepared_free(o->ends);
    free(o->visible);
    free(o->pairs);
    free(o->pairs_visible);
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

/* -------------------------------------------------------------------------------------------------- decisions */

static void reserve(connection_visibility *o, size_t count)
{
    if (count <= o->capacity)
        return;
    o->capacity = 2 * count;
    o->visible = xrealloc(o->visible, o->capacity * sizeof *o->visible);
    o->pairs = xrealloc(o->pairs, o->capacity * sizeof *o->pairs);
    o->pairs_visible = xrealloc(o->pairs_visible, (o->capacity / 64 + 1) * sizeof *o->pairs_visible);
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

static void prepare_pairs(connection_visibility *o, const batch *b, const connections *c)
{
    enum { AHEAD = 16 };
    o->pair_count = 0;
    for (size_t i = 0; i < c->count; i++) {
        if (i + AHEAD < c->count && c->items[i + AHEAD].kind == CONNECT_SURFACES)
            prepared_prefetch_vertices(o->ends, b, &c->items[i + AHEAD]);
        if (c->items[i].kind == CONNECT_SURFACES)
            o->pairs[o->pair_count++] = (vcache_vertex_pair){prepared_eye_vertex(o->ends, b, &c->items[i]),
                                                             prepared_light_vertex(o->ends, b, &c->items[i])};
    }
}

static void ask_pairs(connection_visibility *o)
{
    for (uint32_t next = 0; next < o->pair_count;) {
        next = vcache_add_vertices(o->worker, o->pairs, next, o->pair_count, o->pairs_visible);
        if (next < o->pair_count)
            vcache_resolve(o->worker, trace_misses, o);
    }
}

static void prepare_lights(connection_visibility *o, const batch *b, const connections *c)
{
    for (int sky = 0; sky < 2; sky++)
        memset(o->asked[sky], 0, b->eye.total * sizeof o->asked[sky][0]);
    for (size_t i = 0; i < c->count; i++) {
        const connection *x = &c->items[i];
        if (x->kind != CONNECT_LIGHT)
            continue;
        vcache_prefetch(o->worker, prepared_eye_end(o->ends, b, x), prepared_light_end(o->ends, b, x));
        o->asked[prepared_sky(b, x)][x->eye] |= (uint64_t)1 << x->path;
    }
}

/* Each eye vertex with all paths' lights at a time. */
static void ask_lights(connection_visibility *o, const batch *b)
{
    const vcache_light *lights = prepared_lights(o->ends);
    for (int sky = 0; sky < 2; sky++)
        for (uint32_t i = 0; i < b->eye.total; i++) {
            const vcache_eye *eye = prepared_eye(o->ends, sky, i);
            for (uint32_t next = 0; o->asked[sky][i] && next < BATCH;) {
                next = vcache_add(o->worker, eye, lights, next, BATCH, &o->asked[sky][i], &o->lights_visible[sky][i]);
                if (next < BATCH)
                    vcache_resolve(o->worker, trace_misses, o);
            }
        }
}

/* After the answers are there. */
static void take_answers(connection_visibility *o, const batch *b, const connections *c)
{
    for (size_t i = 0, pair = 0; i < c->count; i++) {
        const connection *x = &c->items[i];
        if (x->kind == CONNECT_SURFACES) {
            o->visible[i] = o->pairs_visible[pair / 64] >> pair % 64;
            pair++;
        } else if (x->kind == CONNECT_LIGHT) {
            o->visible[i] = o->lights_visible[prepared_sky(b, x)][x->eye] >> x->path;
        }
    }
}

/* The threshold for the next batches follows from what the last ones took: no random number of theirs depends on it. */
static void follow_share(const settings *f, const connections *c, uint32_t count, float *threshold)
{
    float sum = 0.0f, n = 0.0f;
    for (size_t i = 0; i < c->count; i++)
        if (c->items[i].kind != CONNECT_CAMERA)
            sum += luminance(c->items[i].value), n += 1.0f;
    if (!(sum > 0.0f))
        return;
    if (!(*threshold > 0.0f)) {
        *threshold = sum / n;
        return;
    }
    float share = (float)count / n, wanted = f->rays;
    *threshold *= expf(0.1f * (share - wanted) / (share + wanted));
}

/* Connections are traced with the probability that their estimate asks for, the rest are what is expected. */
static void estimate(connection_visibility *o, const batch *b, const connections *c, float *threshold)
{
    uint32_t count = 0;
    o->random = rng_make(o->v->settings.seed ^ 0x657374696d617465u, b->random[0]);
    for (size_t i = 0; i < c->count; i++) {
        const connection *x = &c->items[i];
        vcache_estimate *e = &o->estimates[i];
        if (x->kind == CONNECT_CAMERA)
            continue;
        float worth = *threshold > 0.0f ? luminance(x->value) / *threshold : INFINITY;
        *e = x->kind == CONNECT_SURFACES ? vcache_estimate_vertices(o->worker, prepared_eye_vertex(o->ends, b, x),
                                                                    prepared_light_vertex(o->ends, b, x), worth)
                                         : vcache_estimate_pair(o->worker, prepared_eye_end(o->ends, b, x),
                                                                prepared_light_end(o->ends, b, x), worth);
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
    follow_share(&o->v->settings, c, count, threshold);
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

static bool estimates(const connection_visibility *o)
{
    return o->cache && o->v->settings.visibility == VISIBILITY_ESTIMATE;
}

void connection_visibility_prepare(connection_visibility *o, const batch *b, const connections *c)
{
    reserve(o, c->count + 1); /* never NULL */
    if (!o->cache)
        return;
    prepared_forget(o->ends);
    prepare_pairs(o, b, c);
    prepare_lights(o, b, c);
}

void connection_visibility_ask(connection_visibility *o, const batch *b, const connections *c, float *threshold)
{
    if (estimates(o)) {
        estimate(o, b, c, threshold);
    } else if (o->cache) {
        ask_pairs(o);
        ask_lights(o, b);
        vcache_resolve(o->worker, trace_misses, o);
    }
}

void connection_visibility_finish(connection_visibility *o, const batch *b, connections *c)
{
    if (o->cache && !estimates(o))
        take_answers(o, b, c);
    trace_rest(o, b, c);
    for (size_t i = 0; i < c->count; i++) {
        connection *x = &c->items[i];
        bool estimated = estimates(o) && x->kind != CONNECT_CAMERA;
        x->value = v3_scale(x->value, estimated ? o->weights[i] : (float)(o->visible[i] & 1));
    }
}
