/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The light of all virtual and punctual lights by few rays: what the cache expects of each light is summed, a few
 * lights are drawn where that is most uncertain, and their rays correct the sum. No bias, whatever the cache holds.
 */
#include "whitted.h"

#include "../common/rng.h"

#include <string.h>

/* A ray on its way: its answer adds (visible - mean) * value to the pixel. */
typedef struct correction {
    rgb value;
    float mean;
    uint32_t eye; /* of the chunk */
} correction;

struct estimator {
    const view *view;
    const vpl_set *vpls;
    vcache_light_set *set;
    vcache_predictor *predictor;
    vcache_budget budget;
    uint32_t punctual_count;
    uint32_t lights; /* padded virtual point lights, then punctual ones */
    float *geometry, *contribution;
    rgb *response; /* of a glossy eye sample to each virtual point light, geometry included */
    light_sample *punctual;
    ray_packet packet;
    ray_counts counts;
    uint32_t capacity; /* picks of one eye sample, at most */
    /* of one chunk; picks [CHUNK * capacity] */
    uint64_t turn; /* random */
    vcache_cells cells[CHUNK];
    uint32_t first[CHUNK + 1]; /* pick of each eye sample */
    vcache_pick *picks;
    vcache_answer *answers;
    correction *corrections;
    uint32_t *order; /* of the picks, by light */
    uint32_t *start; /* of each light in it */
};

uint32_t estimator_punctual(const view *v)
{
    uint32_t count = v->scene->light_count;
    uint64_t all = ((uint64_t)v->settings.vpls + 63) / 64 * 64 + count;
    bool many = count > 8 && (float)count > 0.5f * v->settings.rays;
    return many && all <= VCACHE_MAX_SET ? count : 0;
}

/* A ray drawn alone costs two to four of a coherent packet, the rest of a prediction some ten. */
bool estimator_pays(const view *v, const vpl_set *vpls)
{
    return (float)(vpls->count + estimator_punctual(v)) > 4.0f * v->settings.rays + 16.0f;
}

estimator *estimator_new(const view *v, const vpl_set *vpls, vcache_light_set *set)
{
    estimator *o = NULL;
    if (posix_memalign((void **)&o, 64, sizeof *o))
        o = xmalloc(SIZE_MAX);
    memset(o, 0, sizeof *o);
    uint32_t padded = vcache_light_set_padded(set);
    o->view = v;
    o->vpls = vpls;
    o->set = set;
    o->budget.rays = v->settings.rays;
    o->geometry = floats_new(vpls->padded);
    o->contribution = floats_new(padded);
    o->response = xcalloc(vpls->padded + 1, sizeof *o->response);
    o->punctual_count = estimator_punctual(v);
    o->punctual = xcalloc(o->punctual_count + 1, sizeof *o->punctual);
    o->lights = vpls->padded + o->punctual_count;
    o->start = xcalloc(o->lights + 1, sizeof *o->start);
    /* a budget gives up to four times its mean, a comb one more */
    o->capacity = (uint32_t)fminf(4.0f * v->settings.rays, (float)o->lights) + 4;
    size_t picks = (size_t)CHUNK * o->capacity;
    o->picks = xmalloc(picks * sizeof *o->picks);
    o->answers = xmalloc(picks * sizeof *o->answers);
    o->corrections = xmalloc(picks * sizeof *o->corrections);
    o->order = xmalloc(picks * sizeof *o->order);
    packet_init(&o->packet);
    if (vcache_predictor_create(set, &o->predictor, NULL) != VCACHE_OK)
        o->predictor = xmalloc(SIZE_MAX);
    return o;
}

void estimator_free(estimator *o)
{
    if (!o)
        return;
    vcache_predictor_destroy(&o->predictor);
    free(o->geometry);
    free(o->contribution);
    free(o->response);
    free(o->punctual);
    free(o->picks);
    free(o->answers);
    free(o->corrections);
    free(o->order);
    free(o->start);
    free(o);
}

ray_counts estimator_counts(const estimator *o)
{
    return o->counts;
}

/* The unit of contributions: luminance that the eye sample leaves of the light that arrives. Of gloss, that of the path
 * alone: black gloss shines too. */
static float tint_of(const eye_sample *e)
{
    bool diffuse = e->surface.material->kind == MATERIAL_DIFFUSE;
    return luminance(diffuse ? v3_mul(e->weight, e->surface.color) : e->weight) / PI_F;
}

/* Contributions of all lights to one eye sample, up to its tint; counts those above 0. */
static uint32_t contributions(estimator *o, const eye_sample *e, float tint)
{
    uint32_t asked = shade_contributions(o->vpls, e, o->vpls->luminance, o->geometry, o->contribution);
    if (e->surface.material->kind != MATERIAL_DIFFUSE)
        for (uint32_t i = 0; i < o->vpls->count; i++)
            if (o->geometry[i] > 0.0f) {
                o->response[i] = v3_scale(v3_mul(e->weight, shade_response(o->vpls, e, i)), o->geometry[i]);
                o->contribution[i] = luminance(o->response[i]) / tint;
            }
    if (o->punctual_count == 0)
        return asked;
    direct_punctuals(o->view, e, o->punctual, NULL);
    for (uint32_t i = 0; i < o->punctual_count; i++) {
        float value = luminance(o->punctual[i].value) / tint;
        o->contribution[o->vpls->padded + i] = value;
        asked += value > 0.0f;
    }
    return asked;
}

/* `albedo`: of a diffuse eye sample, weight included. */
static rgb light_value(const estimator *o, bool diffuse, rgb albedo, uint32_t i)
{
    if (i >= o->vpls->padded)
        return o->punctual[i - o->vpls->padded].value;
    if (!diffuse)
        return o->response[i];
    return v3_mul(albedo, v3_scale(v3(o->vpls->r[i], o->vpls->g[i], o->vpls->b[i]), o->geometry[i]));
}

static rgb expected_light(const estimator *o, const eye_sample *e, const float *mean)
{
    rgb sum = {0, 0, 0};
    if (e->surface.material->kind == MATERIAL_DIFFUSE)
        sum = v3_mul(e->weight, shade_expected_diffuse(o->vpls, e, o->geometry, mean));
    else
        for (uint32_t i = 0; i < o->vpls->count; i++)
            if (o->geometry[i] > 0.0f)
                sum = v3_mad(sum, mean[i], o->response[i]);
    for (uint32_t i = 0; i < o->punctual_count; i++)
        sum = v3_mad(sum, mean[o->vpls->padded + i], o->punctual[i].value);
    return sum;
}

/* Where the comb of picks begins. Evenly spread over the samples of a pixel in one chunk; from chunk to chunk turned at
 * random, for what earlier samples of the pixel drew has been learnt, and draws must be independent of that. */
static float offset(const estimator *o, const eye_sample *e)
{
    rng r = rng_make(o->turn, e->pixel);
    float sum = e->stratum + rng_float(&r);
    return sum < 1.0f ? sum : sum - 1.0f;
}

/* What is expected goes to the pixel; what is drawn becomes a correction. Returns the number of picks. */
static uint32_t predict(estimator *o, const eye_sample *e, uint32_t slot, uint32_t at, tile_pixels *pixels)
{
    float tint = tint_of(e);
    if (!(tint > 0.0f))
        return 0;
    uint32_t asked = contributions(o, e, tint);
    o->counts.asked += asked;
    pixels->asked[e->pixel] += asked;
    if (!asked)
        return 0;
    vcache_surface end = {
        .position = {e->surface.position.x, e->surface.position.y, e->surface.position.z},
        .normal = {e->surface.geometric_normal.x, e->surface.geometric_normal.y, e->surface.geometric_normal.z},
        .density = e->density};
    vcache_prediction p = vcache_predict(o->predictor, &end, o->view->settings.ce, 0, o->contribution);
    o->cells[slot] = p.cells;
    if (!pixels->cell[e->pixel])
        pixels->cell[e->pixel] = p.cells.key[0];
    pixels->lit[e->pixel] = v3_add(pixels->lit[e->pixel], expected_light(o, e, p.mean));

    float rays = vcache_budget_rays(&o->budget, p.deviation * tint);
    uint32_t n = vcache_pick_lights(o->predictor, rays, offset(o, e), o->picks + at, o->capacity);
    bool diffuse = e->surface.material->kind == MATERIAL_DIFFUSE;
    rgb albedo = v3_scale(v3_mul(e->weight, e->surface.color), 1.0f / PI_F);
    for (uint32_t k = 0; k < n; k++) {
        uint32_t i = o->picks[at + k].light;
        rgb value = v3_scale(light_value(o, diffuse, albedo, i), o->picks[at + k].weight);
        o->corrections[at + k] = (correction){value, p.mean[i], slot};
    }
    pixels->traced[e->pixel] += n;
    o->counts.traced += n;
    return n;
}

static void aim(estimator *o, uint32_t lane, const eye_sample *e, uint32_t i)
{
    ray_packet *p = &o->packet;
    vec3 from = e->origin, to;
    float end = RAY_END;
    if (i < o->vpls->padded)
        to = v3_sub(v3(o->vpls->x[i], o->vpls->y[i], o->vpls->z[i]), from);
    else {
        const light *l = &o->view->scene->lights[i - o->vpls->padded];
        bool infinite = l->kind == LIGHT_DIRECTIONAL;
        to = infinite ? v3_neg(l->direction) : v3_sub(l->position, from);
        end = infinite ? INFINITY : RAY_END;
    }
    p->org_x[lane] = from.x, p->org_y[lane] = from.y, p->org_z[lane] = from.z;
    p->dir_x[lane] = to.x, p->dir_y[lane] = to.y, p->dir_z[lane] = to.z;
    p->tfar[lane] = end;
}

/* Neighbours in the order of lights make packets that go one way. */
static void sort_picks(estimator *o, uint32_t count)
{
    memset(o->start, 0, (o->lights + 1) * sizeof *o->start);
    for (uint32_t i = 0; i < count; i++)
        o->start[o->picks[i].light + 1]++;
    for (uint32_t i = 0; i < o->lights; i++)
        o->start[i + 1] += o->start[i];
    for (uint32_t i = 0; i < count; i++)
        o->order[o->start[o->picks[i].light]++] = i;
}

static void trace(estimator *o, const eye_sample *const *eyes, uint32_t count, tile_pixels *pixels)
{
    sort_picks(o, count);
    for (uint32_t at = 0; at < count; at += GROUP) {
        uint32_t n = count - at < GROUP ? count - at : GROUP;
        for (uint32_t k = 0; k < n; k++) {
            uint32_t pick = o->order[at + k];
            aim(o, k, eyes[o->corrections[pick].eye], o->picks[pick].light);
        }
        uint32_t blocked = tracer_occluded16(o->view->tracer, &o->packet, (1u << n) - 1, false);
        for (uint32_t k = 0; k < n; k++) {
            uint32_t pick = o->order[at + k];
            const correction *c = &o->corrections[pick];
            bool visible = !(blocked >> k & 1u);
            o->answers[pick] = visible ? VCACHE_VISIBLE : VCACHE_BLOCKED;
            rgb *pixel = &pixels->lit[eyes[c->eye]->pixel];
            *pixel = v3_mad(*pixel, (visible ? 1.0f : 0.0f) - c->mean, c->value);
        }
    }
}

void estimator_light(estimator *o, const eye_sample *const *eyes, uint32_t count, tile_pixels *pixels)
{
    o->turn = count ? o->view->settings.seed ^ eyes[0]->random : 0;
    for (uint32_t e = 0; e < count; e++)
        o->first[e + 1] = o->first[e] + predict(o, eyes[e], e, o->first[e], pixels);
    trace(o, eyes, o->first[count], pixels);
    for (uint32_t e = 0; e < count; e++)
        if (o->first[e + 1] > o->first[e])
            vcache_learn(o->set, &o->cells[e], o->picks + o->first[e], o->answers + o->first[e],
                         o->first[e + 1] - o->first[e]);
}
