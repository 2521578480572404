/* SPDX-License-Identifier: Apache-2.0 */
/* Which pairs of a chunk see each other: by packets of shadow rays, or by the visibility cache. */
#include "whitted.h"

#include <string.h>

struct visibility {
    const view *view;
    const vpl_set *vpls;
    const caches *caches; /* NULL: exact */
    ray_counts counts;
    ray_packet packet;
    /* cached */
    vcache_worker *worker;
    vcache_light *sampled; /* [CHUNK][samples], in the order in which they ask */
    uint16_t *order;       /* [CHUNK][samples]: which they are */
    pair_bits ordered;     /* their bits */
    uint64_t *again;       /* [CHUNK][words] of virtual lights: who asks a second time */
    char *eyes;            /* [CHUNK][3] */
    chunk *chunk;
    tile_pixels *pixels;
    uint64_t asked, traced;   /* of the cache, in this pass */
    uint32_t aside, patience; /* passes to go that are exact; how many the next time */
};

ray_counts visibility_counts(const visibility *o)
{
    return o->counts;
}

/* Adds the pairs that each eye sample asks for to `counts`, of its pixel. */
static uint64_t count_asked(const chunk *c, uint32_t *counts)
{
    uint64_t all = 0;
    for (uint32_t e = 0; e < c->count; e++) {
        uint32_t asked = 0;
        for (int g = 0; g < LIGHT_GROUPS; g++)
            for (uint32_t w = 0; w < c->bits[g].words; w++)
                asked += (uint32_t)__builtin_popcountll(c->bits[g].asked[(size_t)e * c->bits[g].words + w]);
        counts[c->eyes[e]->pixel] += asked;
        all += asked;
    }
    return all;
}

/* ------------------------------------------------------------------------------------------------------- exact */

/* The fastest arrangement known: a packet is 16 neighbouring eye samples and one light. */
typedef struct lanes {
    uint32_t first, count; /* eye samples of the chunk */
} lanes;

static void aim(visibility *o, const chunk *c, lanes l, int group, uint32_t i)
{
    ray_packet *p = &o->packet;
    if (group == LIGHTS_VIRTUAL) {
        float x = o->vpls->x[i], y = o->vpls->y[i], z = o->vpls->z[i];
        for (int k = 0; k < GROUP; k++) {
            p->dir_x[k] = x - p->org_x[k];
            p->dir_y[k] = y - p->org_y[k];
            p->dir_z[k] = z - p->org_z[k];
            p->tfar[k] = RAY_END;
        }
        return;
    }
    if (group == LIGHTS_PUNCTUAL) {
        bool infinite;
        vec3 to = punctuals_target(&c->punctual, i, &infinite);
        for (int k = 0; k < GROUP; k++) {
            p->dir_x[k] = infinite ? to.x : to.x - p->org_x[k];
            p->dir_y[k] = infinite ? to.y : to.y - p->org_y[k];
            p->dir_z[k] = infinite ? to.z : to.z - p->org_z[k];
            p->tfar[k] = infinite ? INFINITY : RAY_END;
        }
        return;
    }
    for (uint32_t k = 0; k < l.count; k++) {
        const light_sample *s = &c->sampled[(size_t)(l.first + k) * c->bits[group].lights + i];
        p->dir_x[k] = s->infinite ? s->target.x : s->target.x - p->org_x[k];
        p->dir_y[k] = s->infinite ? s->target.y : s->target.y - p->org_y[k];
        p->dir_z[k] = s->infinite ? s->target.z : s->target.z - p->org_z[k];
        p->tfar[k] = s->infinite ? INFINITY : RAY_END;
    }
}

static uint64_t exact_group(visibility *o, chunk *c, lanes l, int first_group, int last_group)
{
    uint64_t rays = 0;
    ray_packet *p = &o->packet;
    for (uint32_t k = 0; k < GROUP; k++) {
        vec3 origin = c->eyes[l.first + (k < l.count ? k : 0)]->origin;
        p->org_x[k] = origin.x, p->org_y[k] = origin.y, p->org_z[k] = origin.z;
    }
    for (int g = first_group; g <= last_group; g++) {
        pair_bits *b = &c->bits[g];
        for (uint32_t w = 0; w < b->words; w++) {
            uint64_t *asked = b->asked + (size_t)l.first * b->words + w, any = 0, seen[GROUP] = {0};
            for (uint32_t k = 0; k < l.count; k++)
                any |= asked[(size_t)k * b->words];
            for (; any; any &= any - 1) {
                uint32_t bit = (uint32_t)__builtin_ctzll(any), active = 0;
                for (uint32_t k = 0; k < l.count; k++)
                    active |= (uint32_t)(asked[(size_t)k * b->words] >> bit & 1u) << k;
                aim(o, c, l, g, 64 * w + bit);
                rays += (uint32_t)__builtin_popcount(active);
                uint32_t free_lanes = active & ~tracer_occluded16(o->view->tracer, p, active, g != LIGHTS_SAMPLED);
                for (uint32_t k = 0; k < l.count; k++)
                    seen[k] |= (uint64_t)(free_lanes >> k & 1u) << bit;
            }
            for (uint32_t k = 0; k < l.count; k++)
                b->visible[(size_t)(l.first + k) * b->words + w] = seen[k];
        }
    }
    return rays;
}

/* All pairs of some groups of lights; returns the number of rays. */
static uint64_t trace_groups(visibility *o, chunk *c, int first_group, int last_group)
{
    uint64_t rays = 0;
    for (uint32_t e = 0; e < c->count; e += GROUP)
        rays += exact_group(o, c, (lanes){e, c->count - e < GROUP ? c->count - e : GROUP}, first_group, last_group);
    return rays;
}

static void resolve_exact(visibility *o, chunk *c, tile_pixels *pixels)
{
    o->counts.traced += trace_groups(o, c, 0, LIGHT_GROUPS - 1);
    count_asked(c, pixels->traced);
}

/* ------------------------------------------------------------------------------------------------------ cached */

/* Rays of misses, as they come: they are in order of eye samples and then of lights, so a packet mostly leaves from one
 * point. */
static bool trace_misses(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    visibility *o = context;
    ray_packet *p = &o->packet;
    for (size_t first = 0; first < count; first += GROUP) {
        uint32_t n = count - first < GROUP ? (uint32_t)(count - first) : GROUP;
        for (uint32_t k = 0; k < n; k++) {
            const vcache_miss *m = &misses[first + k];
            const eye_sample *e = o->chunk->eyes[m->eye_user];
            const float *to = m->light_position;
            p->org_x[k] = e->origin.x, p->org_y[k] = e->origin.y, p->org_z[k] = e->origin.z;
            p->dir_x[k] = m->infinite ? to[0] : to[0] - e->origin.x;
            p->dir_y[k] = m->infinite ? to[1] : to[1] - e->origin.y;
            p->dir_z[k] = m->infinite ? to[2] : to[2] - e->origin.z;
            p->tfar[k] = m->infinite ? INFINITY : RAY_END;
            o->pixels->traced[e->pixel]++;
        }
        uint32_t blocked = tracer_occluded16(o->view->tracer, p, (1u << n) - 1, false);
        for (uint32_t k = 0; k < n; k++)
            answers[first + k] = blocked >> k & 1u ? VCACHE_BLOCKED : VCACHE_VISIBLE;
    }
    return true;
}

static void add_all(visibility *o, const vcache_eye *eye, const vcache_light *lights, vcache_light_set *set,
                    const pair_bits *b, uint32_t e)
{
    const uint64_t *asked = b->asked + (size_t)e * b->words;
    const uint64_t *refine = b->refine ? b->refine + (size_t)e * b->words : NULL;
    uint64_t *visible = b->visible + (size_t)e * b->words;
    for (uint32_t i = 0; i < b->lights;) {
        i = set ? vcache_add_set_refining(o->worker, eye, set, i, asked, refine, visible)
                : vcache_add(o->worker, eye, lights, i, b->lights, asked, visible);
        if (i < b->lights)
            vcache_resolve(o->worker, trace_misses, o);
    }
}

/* Light samples come stratum by stratum. Of those in one cell the first to ask speaks for all, and it must not always
 * be the one of the lowest stratum: each eye sample's ask in an order of their own. */
static void add_sampled(visibility *o, const vcache_eye *eye, const chunk *c, uint32_t e)
{
    const pair_bits *b = &c->bits[LIGHTS_SAMPLED];
    size_t first = (size_t)e * b->lights, row = (size_t)e * b->words;
    vcache_light *out = vcache_light_at(o->sampled, first);
    uint16_t *order = o->order + first;
    direct_order(o->view, c->eyes[e], b->lights, order);
    memset(o->ordered.asked + row, 0, b->words * sizeof(uint64_t));
    memset(o->ordered.visible + row, 0, b->words * sizeof(uint64_t));
    for (uint32_t i = 0; i < b->lights; i++) {
        uint32_t from = order[i];
        if (!(b->asked[row + from / 64] >> from % 64 & 1u))
            continue;
        o->ordered.asked[row + i / 64] |= (uint64_t)1 << i % 64;
        const light_sample *s = &c->sampled[first + from];
        vcache_surface end = {.density = c->sampled_density[first + from], .user = i};
        vec3_store(end.position, s->target);
        vec3_store(end.normal, c->sampled_normal[first + from]);
        if (s->infinite)
            vcache_prepare_solid_angle(o->caches->table, end.position, end.density, i, vcache_light_at(out, i));
        else
            vcache_prepare_patch(o->caches->table, &end, vcache_light_at(out, i));
    }
    add_all(o, eye, out, NULL, &o->ordered, e);
}

/* After the answers are there. */
static void take_sampled(const visibility *o, chunk *c)
{
    const pair_bits *b = &c->bits[LIGHTS_SAMPLED];
    for (uint32_t e = 0; e < c->count; e++)
        for (uint32_t w = 0; w < b->words; w++)
            for (uint64_t word = o->ordered.visible[(size_t)e * b->words + w]; word; word &= word - 1) {
                uint32_t to = o->order[(size_t)e * b->lights + 64 * w + (uint32_t)__builtin_ctzll(word)];
                b->visible[(size_t)e * b->words + to / 64] |= (uint64_t)1 << to % 64;
            }
}

/* Eye ends of one sample, one for each C_E. */
static vcache_eye *eye_at(visibility *o, uint32_t e, uint32_t kind)
{
    return (vcache_eye *)(void *)(o->eyes + (size_t)(3 * e + kind) * VCACHE_EYE_BYTES);
}

/* A group of lights that the user keeps out of the cache. */
static void trace_uncached(visibility *o, chunk *c, int group, tile_pixels *pixels)
{
    const pair_bits *b = &c->bits[group];
    o->counts.traced += trace_groups(o, c, group, group);
    for (size_t i = 0; i < (size_t)c->count * b->words; i++)
        pixels->traced[c->eyes[i / b->words]->pixel] += (uint32_t)__builtin_popcountll(b->asked[i]);
}

static void prepare_eyes(visibility *o, chunk *c, tile_pixels *pixels)
{
    const settings *f = &o->view->settings;
    o->chunk = c;
    o->pixels = pixels;
    for (uint32_t e = 0; e < c->count; e++) {
        const eye_sample *s = c->eyes[e];
        vcache_surface end = {.density = s->density, .user = e};
        vec3_store(end.position, s->surface.position);
        vec3_store(end.normal, s->surface.geometric_normal);
        vcache_prepare_eye(o->caches->table, &end, f->ce, 0, eye_at(o, e, 0));
        if (!pixels->cell[s->pixel])
            pixels->cell[s->pixel] = vcache_eye_cell(eye_at(o, e, 0), 0);
        if (c->bits[LIGHTS_SAMPLED].lights && f->ce_samples > 0.0f && f->ce_samples != f->ce)
            vcache_prepare_eye(o->caches->table, &end, f->ce_samples, 0, eye_at(o, e, 1));
        if (c->bits[LIGHTS_PUNCTUAL].lights && f->ce_delta > 0.0f)
            vcache_prepare_eye(o->caches->table, &end, f->ce_delta, 0, eye_at(o, e, 2));
    }
}

/* In the dark weak lights are all there is: an eye sample that sees none of those which were refined asks again for
 * what it sees, with all of them refined. */
static void refine_dark(visibility *o, chunk *c)
{
    pair_bits *b = &c->bits[LIGHTS_VIRTUAL], again = *b;
    again.refine = NULL;
    again.asked = o->again;
    for (uint32_t e = 0; e < c->count; e++) {
        size_t row = (size_t)e * b->words;
        uint64_t strong = 0, weak = 0;
        for (size_t w = row; w < row + b->words; w++) {
            strong |= b->visible[w] & b->refine[w];
            weak |= b->visible[w];
        }
        if (strong || !weak)
            continue;
        memcpy(o->again + row, b->visible + row, b->words * sizeof(uint64_t));
        add_all(o, eye_at(o, e, 0), o->caches->virtual_ends, o->caches->virtual_set, &again, e);
    }
    vcache_resolve(o->worker, trace_misses, o);
}

static void resolve_cached(visibility *o, chunk *c, tile_pixels *pixels)
{
    const settings *f = &o->view->settings;
    for (uint32_t e = 0; e < c->count; e++) {
        add_all(o, eye_at(o, e, 0), o->caches->virtual_ends, o->caches->virtual_set, &c->bits[LIGHTS_VIRTUAL], e);
        if (c->bits[LIGHTS_SAMPLED].lights && f->ce_samples > 0.0f)
            add_sampled(o, eye_at(o, e, f->ce_samples != f->ce), c, e);
        if (c->bits[LIGHTS_PUNCTUAL].lights && f->ce_delta > 0.0f)
            add_all(o, eye_at(o, e, 2), o->caches->punctual_ends, o->caches->punctual_set, &c->bits[LIGHTS_PUNCTUAL],
                    e);
    }
    vcache_resolve(o->worker, trace_misses, o);
    if (o->caches->virtual_set && c->bits[LIGHTS_VIRTUAL].refine)
        refine_dark(o, c);
    if (f->ce_samples > 0.0f)
        take_sampled(o, c);
    vcache_statistics s = {.size = sizeof s};
    vcache_worker_statistics(o->worker, &s);
    o->counts.traced += s.traced;
    o->asked += s.asked;
    o->traced += s.traced;
    vcache_worker_reset_statistics(o->worker);
    if (!(f->ce_delta > 0.0f))
        trace_uncached(o, c, LIGHTS_PUNCTUAL, pixels);
    if (!(f->ce_samples > 0.0f))
        trace_uncached(o, c, LIGHTS_SAMPLED, pixels);
}

/* A missing ray and its bookkeeping cost some three rays of coherent packets. The longer it does not pay, the more
 * rarely it is tried again. */
enum { ASIDE_ABOVE = 50, PATIENCE_MAX = 32 }; /* per cent; passes */

bool visibility_steps_aside(visibility *o)
{
    if (o->aside > 0) {
        o->aside--;
    } else if (o->asked > 0) {
        bool pays = 100 * o->traced <= ASIDE_ABOVE * o->asked;
        o->patience = pays ? 0 : o->patience == 0 ? 2 : o->patience < PATIENCE_MAX ? 2 * o->patience : PATIENCE_MAX;
        o->aside = o->patience;
    }
    o->asked = o->traced = 0;
    return o->aside > 0;
}

/* -------------------------------------------------------------------------------------------------------- both */

visibility *visibility_new(const view *v, const vpl_set *vpls, const caches *used)
{
    visibility *o = NULL;
    if (posix_memalign((void **)&o, 64, sizeof *o))
        o = xmalloc(SIZE_MAX);
    memset(o, 0, sizeof *o);
    o->view = v;
    o->vpls = vpls;
    o->caches = used;
    packet_init(&o->packet);
    if (!used)
        return o;
    o->eyes = xmalloc((size_t)3 * CHUNK * VCACHE_EYE_BYTES);
    uint32_t samples = direct_sample_count(v), words = (samples + 63) / 64;
    o->sampled = xmalloc(((size_t)CHUNK * samples + 1) * vcache_light_size());
    o->order = xmalloc(((size_t)CHUNK * samples + 1) * sizeof *o->order);
    o->ordered = (pair_bits){.lights = samples,
                             .words = words,
                             .asked = xcalloc((size_t)CHUNK * words + 1, sizeof(uint64_t)),
                             .visible = xcalloc((size_t)CHUNK * words + 1, sizeof(uint64_t))};
    o->again = xcalloc((size_t)CHUNK * (vpls->padded / 64 + 1), sizeof(uint64_t));
    if (vcache_worker_create(used->table, NULL, &o->worker, NULL) != VCACHE_OK)
        o->worker = xmalloc(SIZE_MAX);
    return o;
}

void visibility_free(visibility *o)
{
    if (!o)
        return;
    vcache_worker_destroy(&o->worker);
    free(o->eyes);
    free(o->sampled);
    free(o->order);
    free(o->ordered.asked);
    free(o->ordered.visible);
    free(o->again);
    free(o);
}

void visibility_begin(visibility *o, chunk *c, tile_pixels *pixels)
{
    o->counts.asked += count_asked(c, pixels->asked);
    if (o->caches && !o->aside)
        prepare_eyes(o, c, pixels);
}

void visibility_resolve(visibility *o, chunk *c, tile_pixels *pixels)
{
    visibility_begin(o, c, pixels);
    if (o->caches && !o->aside)
        resolve_cached(o, c, pixels);
    else
        resolve_exact(o, c, pixels);
}

void visibility_test(visibility *o, chunk *c, tile_pixels *pixels)
{
    if (o->caches && !o->aside) {
        resolve_cached(o, c, pixels);
        return;
    }
    o->counts.traced += packed_trace(o->view->tracer, o->vpls, c, pixels);
}
