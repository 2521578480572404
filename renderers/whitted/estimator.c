/* SPDX-License-Identifier: Apache-2.0 */
/*
 * The light of all virtual and punctual lights by few rays: what the cache expects of each light is summed, a few
 * lights are drawn where that is most uncertain, and their rays correct the sum. No bias, whatever the cache holds.
 *
 * With g_i the unoccluded contribution of light i at the middle of a group of eye samples, f_i that at one of them, m_i
 * what is expected of its visibility V_i and p_i > 0 wherever f_i > 0 the probability that it is drawn,
 *
 *     sum g_i m_i  +  sum over drawn (f_i V_i - g_i m_i) / p_i        has the expected value        sum f_i V_i.
 */
#include "whitted.h"

#include "../common/rng.h"

#include <string.h>

/* A ray on its way: if it arrives, `value` is added to the pixel. */
typedef struct correction {
    rgb value;
    uint32_t eye; /* of the chunk */
} correction;

/* Eye samples that share one evaluation of all lights. */
typedef struct group {
    uint32_t first, count; /* members */
    vcache_cells cells;
    uint32_t pick; /* the first */
} group;

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
    rng random;
    group groups[CHUNK + 1];
    uint32_t group_count;
    uint32_t members[CHUNK]; /* eye samples, group by group */
    vcache_pick *picks;
    vcache_answer *answers;
    correction *corrections;
    uint32_t *order; /* of the picks, by light */
    uint32_t *start; /* of each light in it */
};

bool estimates(visibility_mode mode)
{
    return mode == VISIBILITY_ESTIMATE || mode == VISIBILITY_SELECT || mode == VISIBILITY_SELECT_BY_CACHE;
}

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
    static const vcache_drawing drawing[VISIBILITY_MODES] = {[VISIBILITY_ESTIMATE] = VCACHE_DRAW_UNCERTAIN,
                                                             [VISIBILITY_SELECT] = VCACHE_DRAW_BRIGHT,
                                                             [VISIBILITY_SELECT_BY_CACHE] = VCACHE_DRAW_VISIBLE};
    if (vcache_predictor_create(set, drawing[v->settings.visibility], &o->predictor, NULL) != VCACHE_OK)
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

static bool is_diffuse(const eye_sample *e)
{
    return e->surface.material->kind == MATERIAL_DIFFUSE;
}

/* ---------------------------------------------------------------------------------------------------- groups */

/* Whether lights look alike from both: diffuse, in one pixel, on one flat piece of surface. Normals lie within 0.8
 * degrees: what one of them sees below the horizon of another is next to nothing then. Looser bounds save nothing; that
 * of heights is half the distance between eye samples. */
static bool alike(const eye_sample *a, const eye_sample *b)
{
    const float cosine = 0.9999f, height_max = 0.5f, distance_max = 16.0f;
    if (a->pixel != b->pixel || !is_diffuse(a) || !is_diffuse(b))
        return false;
    vec3 d = v3_sub(b->surface.position, a->surface.position), n = a->surface.geometric_normal;
    float height = v3_dot(d, n);
    return v3_dot(a->surface.normal, b->surface.normal) >= cosine && v3_dot(n, b->surface.geometric_normal) >= cosine &&
           height * height * a->density <= height_max * height_max &&
           v3_dot(d, d) * a->density <= distance_max * distance_max;
}

static void find_groups(estimator *o, const eye_sample *const *eyes, uint32_t count)
{
    enum { LOOK_BACK = 4 }; /* surfaces in a pixel, about */
    uint32_t leader[CHUNK], of[CHUNK], at[CHUNK + 1] = {0}, n = 0;
    memset(o->groups, 0, sizeof o->groups);
    for (uint32_t e = 0; e < count; e++) {
        uint32_t g = n, stop = n < LOOK_BACK ? 0 : n - LOOK_BACK;
        while (g > stop && !alike(eyes[leader[g - 1]], eyes[e]))
            g--;
        of[e] = g > stop ? g - 1 : n;
        if (of[e] == n)
            leader[n++] = e;
        o->groups[of[e]].count++;
    }
    o->group_count = n;
    for (uint32_t g = 0; g < n; g++) {
        o->groups[g].first = at[g];
        at[g + 1] = at[g] + o->groups[g].count;
    }
    for (uint32_t e = 0; e < count; e++)
        o->members[at[of[e]]++] = e;
}

/* An eye sample in the middle of a group, white and of weight 1. A glossy one stays as it is. */
static eye_sample middle_of(const group *g, const eye_sample *const *eyes, const uint32_t *members)
{
    eye_sample out = *eyes[members[0]];
    if (!is_diffuse(&out))
        return out;
    out.weight = out.surface.color = v3(1, 1, 1);
    if (g->count == 1)
        return out;
    vec3 origin = {0, 0, 0}, position = {0, 0, 0}, normal = {0, 0, 0}, geometric = {0, 0, 0};
    for (uint32_t k = 0; k < g->count; k++) {
        const eye_sample *e = eyes[members[k]];
        origin = v3_add(origin, e->origin);
        position = v3_add(position, e->surface.position);
        normal = v3_add(normal, e->surface.normal);
        geometric = v3_add(geometric, e->surface.geometric_normal);
    }
    out.origin = v3_scale(origin, 1.0f / (float)g->count);
    out.surface.position = v3_scale(position, 1.0f / (float)g->count);
    out.surface.normal = v3_normalize(normal);
    out.surface.geometric_normal = v3_normalize(geometric);
    return out;
}

/* What an eye sample of a group makes of light at its middle. */
static rgb tint_of(const eye_sample *e)
{
    return is_diffuse(e) ? v3_mul(e->weight, e->surface.color) : v3(1, 1, 1);
}

/* ----------------------------------------------------------------------------------------------- prediction */

/* Contributions of all lights to the middle, as luminance; counts those above 0. */
static uint32_t contributions(estimator *o, const eye_sample *middle)
{
    const vpl_set *l = o->vpls;
    uint32_t asked = shade_contributions(l, middle, l->luminance, o->geometry, o->contribution);
    bool diffuse = is_diffuse(middle);
    for (uint32_t i = 0; i < l->count && !diffuse; i++)
        if (o->geometry[i] > 0.0f) {
            o->response[i] = v3_scale(v3_mul(middle->weight, shade_response(l, middle, i)), o->geometry[i]);
            o->contribution[i] = luminance(o->response[i]) * PI_F;
        }
    if (o->punctual_count == 0)
        return asked;
    direct_punctuals(o->view, middle, o->punctual, NULL);
    for (uint32_t i = 0; i < o->punctual_count; i++) {
        float value = luminance(o->punctual[i].value) * PI_F;
        o->contribution[l->padded + i] = value;
        asked += value > 0.0f;
    }
    return asked;
}

/* All lights must be possible that one of a group may see, those behind the horizon of its middle as well. */
static void keep_possible(estimator *o, float unoccluded)
{
    float mean = unoccluded / (float)o->lights;
    float least = mean > 0.0f ? 1e-3f * mean : 1e-30f; /* in the dark: of no weight to the budget */
    shade_lift(o->contribution, o->vpls->count, least);
    shade_lift(o->contribution + o->vpls->padded, o->punctual_count, least);
}

/* Light i at the middle, unoccluded. */
static rgb light_at_middle(const estimator *o, bool diffuse, uint32_t i)
{
    const vpl_set *l = o->vpls;
    if (i >= l->padded)
        return o->punctual[i - l->padded].value;
    return diffuse ? v3_scale(v3(l->r[i], l->g[i], l->b[i]), o->geometry[i] / PI_F) : o->response[i];
}

/* Light i at a diffuse eye sample, unoccluded. */
static rgb light_at(const estimator *o, const eye_sample *e, uint32_t i)
{
    const vpl_set *l = o->vpls;
    if (i >= l->padded)
        return direct_punctual(e, &o->view->scene->lights[i - l->padded]).value;
    return v3_mul(tint_of(e), v3_scale(v3(l->r[i], l->g[i], l->b[i]), shade_geometry(l, e, i) / PI_F));
}

static rgb expected_light(const estimator *o, const eye_sample *middle, const float *mean)
{
    rgb sum = {0, 0, 0};
    if (is_diffuse(middle))
        sum = shade_expected_diffuse(o->vpls, middle, o->geometry, mean);
    else
        for (uint32_t i = 0; i < o->vpls->count; i++)
            if (o->geometry[i] > 0.0f)
                sum = v3_mad(sum, mean[i], o->response[i]);
    for (uint32_t i = 0; i < o->punctual_count; i++)
        sum = v3_mad(sum, mean[o->vpls->padded + i], o->punctual[i].value);
    return sum;
}

/* In the dark what is left of doubt outweighs what is expected, and would take the rays from where there is light: this
 * much of the light that might be there counts as expected. */
static const float dark_share = 0.1f;

/* What is expected goes to the pixels; what is drawn becomes corrections. Returns the number of picks. */
static uint32_t predict(estimator *o, group *g, const eye_sample *const *eyes, tile_pixels *pixels)
{
    const uint32_t *members = o->members + g->first;
    eye_sample middle = middle_of(g, eyes, members);
    bool diffuse = is_diffuse(&middle);
    float tint = 0.0f; /* mean luminance, and contributions lack their pi */
    for (uint32_t k = 0; k < g->count; k++)
        tint += luminance(tint_of(eyes[members[k]])) / (PI_F * (float)g->count);
    if (!(tint > 0.0f))
        return 0;
    uint32_t asked = contributions(o, &middle);
    float unoccluded = shade_total(o->contribution, vcache_light_set_padded(o->set));
    if (g->count > 1)
        keep_possible(o, unoccluded);
    else if (asked == 0)
        return 0;

    vcache_surface end = {.density = middle.density};
    vec3_store(end.position, middle.surface.position);
    vec3_store(end.normal, middle.surface.geometric_normal);
    vcache_prediction p = vcache_predict(o->predictor, &end, o->view->settings.ce, 0, o->contribution);
    g->cells = p.cells;
    rgb expected = expected_light(o, &middle, p.mean);
    for (uint32_t k = 0; k < g->count; k++) {
        const eye_sample *e = eyes[members[k]];
        pixels->lit[e->pixel] = v3_add(pixels->lit[e->pixel], v3_mul(tint_of(e), expected));
        pixels->asked[e->pixel] += asked;
        o->counts.asked += asked;
        if (!pixels->cell[e->pixel])
            pixels->cell[e->pixel] = p.cells.key[0];
    }

    vcache_pick *picks = o->picks + g->pick;
    float value = p.expected + dark_share * unoccluded;
    float rays = vcache_budget_rays(&o->budget, p.deviation * tint, value * tint, g->count);
    uint32_t n =
        vcache_pick_lights(o->predictor, rays, g->count, rng_double(&o->random), picks, g->count * o->capacity);
    for (uint32_t k = 0; k < n; k++) {
        uint32_t i = picks[k].light, slot = members[picks[k].sample];
        const eye_sample *e = eyes[slot];
        rgb there = v3_mul(tint_of(e), light_at_middle(o, diffuse, i)), here = g->count > 1 ? light_at(o, e, i) : there;
        pixels->lit[e->pixel] = v3_mad(pixels->lit[e->pixel], -picks[k].weight * p.mean[i], there);
        o->corrections[g->pick + k] = (correction){v3_scale(here, picks[k].weight), slot};
    }
    return n;
}

/* ------------------------------------------------------------------------------------------------------ rays */

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

/* Neighbours in the order of lights make packets that go one way. What brings nothing is not traced. Returns how many
 * are. */
static uint32_t sort_picks(estimator *o, uint32_t count)
{
    memset(o->start, 0, (o->lights + 1) * sizeof *o->start);
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++) {
        bool wanted = v3_max_component(o->corrections[i].value) > 0.0f;
        o->answers[i] = VCACHE_ONCE;
        o->start[o->picks[i].light + 1] += wanted;
        n += wanted;
    }
    for (uint32_t i = 0; i < o->lights; i++)
        o->start[i + 1] += o->start[i];
    for (uint32_t i = 0; i < count; i++)
        if (v3_max_component(o->corrections[i].value) > 0.0f)
            o->order[o->start[o->picks[i].light]++] = i;
    return n;
}

static void trace(estimator *o, const eye_sample *const *eyes, uint32_t count, tile_pixels *pixels)
{
    count = sort_picks(o, count);
    o->counts.traced += count;
    for (uint32_t at = 0; at < count; at += GROUP) {
        uint32_t n = count - at < GROUP ? count - at : GROUP;
        for (uint32_t k = 0; k < n; k++) {
            uint32_t pick = o->order[at + k];
            aim(o, k, eyes[o->corrections[pick].eye], o->picks[pick].light);
        }
        uint32_t blocked = tracer_occluded16(o->view->tracer, &o->packet, (1u << n) - 1, false);
        for (uint32_t k = 0; k < n; k++) {
            uint32_t pick = o->order[at + k], pixel = eyes[o->corrections[pick].eye]->pixel;
            bool visible = !(blocked >> k & 1u);
            o->answers[pick] = visible ? VCACHE_VISIBLE : VCACHE_BLOCKED;
            if (visible)
                pixels->lit[pixel] = v3_add(pixels->lit[pixel], o->corrections[pick].value);
            pixels->traced[pixel]++;
        }
    }
}

void estimator_light(estimator *o, const eye_sample *const *eyes, uint32_t count, tile_pixels *pixels)
{
    if (!count)
        return;
    o->random = rng_make(o->view->settings.seed ^ eyes[0]->random, 0x5eed + o->view->settings.frame);
    find_groups(o, eyes, count);
    uint32_t at = 0;
    for (group *g = o->groups; g < o->groups + o->group_count; g++) {
        g->pick = at;
        at += predict(o, g, eyes, pixels);
    }
    o->groups[o->group_count].pick = at;
    trace(o, eyes, at, pixels);
    vcache_adapt(o->predictor, o->picks, o->answers, at);
    for (const group *g = o->groups; g < o->groups + o->group_count; g++)
        vcache_learn(o->set, &g->cells, o->picks + g->pick, o->answers + g->pick, g[1].pick - g->pick);
}
