/* SPDX-License-Identifier: Apache-2.0 */
/* Unoccluded contributions of all lights to the eye samples of a chunk, and the sum of what turns out visible. */
#include "whitted.h"

#include "clones.h"

#include <string.h>

/* 16 floats, in whatever registers the machine has; loaded from anywhere. */
typedef float lanes16 __attribute__((vector_size(64), aligned(4), may_alias));
#define LANES16_OF(p) (*(const lanes16 *)(p))

float *floats_new(size_t count)
{
    size_t bytes = (count * sizeof(float) + 64) / 64 * 64;
    void *p = aligned_alloc(64, bytes);
    return memset(p ? p : xmalloc(SIZE_MAX), 0, bytes);
}

static void bits_new(pair_bits *b, uint32_t lights)
{
    b->lights = lights;
    b->words = (lights + 63) / 64;
    b->asked = xcalloc((size_t)CHUNK * b->words + 1, sizeof *b->asked);
    b->visible = xcalloc((size_t)CHUNK * b->words + 1, sizeof *b->visible);
}

void chunk_new(chunk *c, const view *v, const vpl_set *vpls, uint32_t punctual)
{
    memset(c, 0, sizeof *c);
    uint32_t samples = direct_sample_count(v);
    bits_new(&c->bits[LIGHTS_VIRTUAL], vpls->count);
    if (v->settings.visibility == VISIBILITY_CACHE && v->settings.refine_above > 0.0f)
        c->bits[LIGHTS_VIRTUAL].refine = xcalloc((size_t)CHUNK * c->bits[LIGHTS_VIRTUAL].words + 1, sizeof(uint64_t));
    bits_new(&c->bits[LIGHTS_PUNCTUAL], punctual);
    bits_new(&c->bits[LIGHTS_SAMPLED], samples);
    c->geometry = floats_new((size_t)CHUNK * vpls->padded);
    c->punctual = punctuals_new(v->scene, punctual);
    c->punctual_geometry = floats_new((size_t)CHUNK * c->punctual.padded);
    c->contribution = floats_new(vpls->padded);
    c->weight = floats_new(vpls->padded + c->punctual.padded + (size_t)64 * c->bits[LIGHTS_SAMPLED].words);
    /* zeroed: lanes of packets are aimed for eye samples that reflect nothing and so have no samples */
    c->sampled = xcalloc((size_t)CHUNK * samples + 1, sizeof *c->sampled);
    c->sampled_density = xmalloc(((size_t)CHUNK * samples + 1) * sizeof *c->sampled_density);
    c->sampled_normal = xmalloc(((size_t)CHUNK * samples + 1) * sizeof *c->sampled_normal);
}

void chunk_free(chunk *c)
{
    for (int g = 0; g < LIGHT_GROUPS; g++) {
        free(c->bits[g].asked);
        free(c->bits[g].visible);
        free(c->bits[g].refine);
    }
    free(c->geometry);
    free(c->contribution);
    free(c->weight);
    punctuals_free(&c->punctual);
    free(c->punctual_geometry);
    free(c->sampled);
    free(c->sampled_density);
    free(c->sampled_normal);
}

/* cos cos / (r^2 max(r^2, clamp)) of all lights, and times `power`; returns how many are above 0. Both cosines stand
 * without their division by r. Where the shading normal is the geometric one (`flat`), one horizon is enough. The form
 * is one that compilers make vectors of. */
static inline __attribute__((always_inline)) uint32_t contributions(const vpl_set *l, const eye_sample *e, bool flat,
                                                                    const float *restrict power,
                                                                    float *restrict geometry, float *restrict out)
{
    const vec3 p = e->origin, n = e->surface.normal, h = e->surface.geometric_normal;
    const float *restrict x = l->x, *restrict y = l->y, *restrict z = l->z;
    const float *restrict nx = l->nx, *restrict ny = l->ny, *restrict nz = l->nz;
    const float clamp = l->clamp;
    const uint32_t count = l->padded;
    for (uint32_t i = 0; i < count; i++) {
        float dx = x[i] - p.x, dy = y[i] - p.y, dz = z[i] - p.z;
        float r2 = dx * dx + dy * dy + dz * dz;
        float eye = n.x * dx + n.y * dy + n.z * dz;
        float side = flat ? eye : h.x * dx + h.y * dy + h.z * dz;
        float away = -(nx[i] * dx + ny[i] * dy + nz[i] * dz);
        float clamped = r2 > clamp ? r2 : clamp;
        float value = eye * away / (r2 * clamped);
        int lit = (eye > 0.0f) & (side > 0.0f) & (away > 0.0f);
        value = lit ? value : 0.0f;
        geometry[i] = value;
        out[i] = value * power[i];
    }
    uint32_t positive = 0;
    for (uint32_t i = 0; i < count; i++)
        positive += geometry[i] > 0.0f;
    return positive;
}

CLONES static uint32_t contributions_flat(const vpl_set *l, const eye_sample *e, const float *restrict power,
                                          float *restrict geometry, float *restrict out)
{
    return contributions(l, e, true, power, geometry, out);
}

CLONES static uint32_t contributions_smooth(const vpl_set *l, const eye_sample *e, const float *restrict power,
                                            float *restrict geometry, float *restrict out)
{
    return contributions(l, e, false, power, geometry, out);
}

uint32_t shade_contributions(const vpl_set *vpls, const eye_sample *e, const float *power, float *geometry, float *out)
{
    const vec3 *n = &e->surface.normal, *g = &e->surface.geometric_normal;
    bool flat = n->x == g->x && n->y == g->y && n->z == g->z;
    return (flat ? contributions_flat : contributions_smooth)(vpls, e, power, geometry, out);
}

float shade_geometry(const vpl_set *l, const eye_sample *e, uint32_t i)
{
    vec3 d = v3_sub(v3(l->x[i], l->y[i], l->z[i]), e->origin);
    float r2 = v3_dot(d, d), eye = v3_dot(e->surface.normal, d), side = v3_dot(e->surface.geometric_normal, d);
    float away = -v3_dot(v3(l->nx[i], l->ny[i], l->nz[i]), d);
    bool lit = eye > 0.0f && side > 0.0f && away > 0.0f;
    return lit ? eye * away / (r2 * float_max(r2, l->clamp)) : 0.0f;
}

CLONES static void bytes_above(const float *restrict values, float bound, uint8_t *restrict bytes)
{
    for (uint32_t i = 0; i < 64; i++)
        bytes[i] = values[i] > bound;
}

void shade_bits_above(const float *values, float bound, uint32_t words, uint64_t *bits)
{
    for (uint32_t w = 0; w < words; w++) {
        uint8_t bytes[64];
        bytes_above(values + (size_t)64 * w, bound, bytes);
        bits[w] = 0;
        for (uint32_t i = 0; i < 8; i++) { /* byte k of eight to bit k */
            uint64_t eight;
            memcpy(&eight, bytes + 8 * i, sizeof eight);
            bits[w] |= (eight * 0x0102040810204080u >> 56) << 8 * i;
        }
    }
}

CLONES static float total(const float *values, uint32_t count)
{
    float lane[16] = {0}, sum = 0.0f;
    for (uint32_t i = 0; i < count; i += 16)
        for (uint32_t k = 0; k < 16; k++)
            lane[k] += values[i + k];
    for (uint32_t k = 0; k < 16; k++)
        sum += lane[k];
    return sum;
}

CLONES static void lift(float *values, uint32_t count, float least)
{
    for (uint32_t i = 0; i < count; i++)
        values[i] = values[i] > least ? values[i] : least;
}

/* Clones are static: compilers name others in ways of their own. */
float shade_total(const float *values, uint32_t count)
{
    return total(values, count);
}

void shade_lift(float *values, uint32_t count, float least)
{
    lift(values, count, least);
}

/* Each bit as 0 or 1. */
CLONES static void spread_bits(const uint64_t *restrict bits, uint32_t words, float *restrict out)
{
    for (uint32_t w = 0; w < words; w++)
        for (uint32_t part = 0; part < 64; part += 16) {
            uint32_t lanes = (uint32_t)(bits[w] >> part) & 0xffffu;
            for (uint32_t k = 0; k < 16; k++)
                out[64 * w + part + k] = (float)(lanes >> k & 1u);
        }
}

/* The light of `padded` lights, each seen as far as `seen` says. */
CLONES static rgb weighted_sum(const float *red, const float *green, const float *blue, uint32_t padded,
                               const float *geometry, const float *seen)
{
    lanes16 r = {0}, g = {0}, b = {0};
    for (uint32_t at = 0; at < padded; at += 16) {
        lanes16 v = LANES16_OF(geometry + at) * LANES16_OF(seen + at);
        r += v * LANES16_OF(red + at);
        g += v * LANES16_OF(green + at);
        b += v * LANES16_OF(blue + at);
    }
    rgb sum = {0, 0, 0};
    for (uint32_t k = 0; k < 16; k++)
        sum = v3_add(sum, v3(r[k], g[k], b[k]));
    return sum;
}

rgb shade_response(const vpl_set *l, const eye_sample *e, uint32_t i)
{
    vec3 wi = v3_normalize(v3_sub(v3(l->x[i], l->y[i], l->z[i]), e->origin));
    return v3_mul(material_eval(&e->surface, wi), v3(l->r[i], l->g[i], l->b[i]));
}

rgb shade_expected_diffuse(const vpl_set *l, const eye_sample *e, const float *geometry, const float *seen)
{
    rgb sum = weighted_sum(l->r, l->g, l->b, l->padded, geometry, seen);
    return v3_mul(v3_scale(e->surface.color, 1.0f / PI_F), sum);
}

void shade_unoccluded(const view *v, const vpl_set *vpls, chunk *c)
{
    for (int g = 0; g < LIGHT_GROUPS; g++) {
        size_t bytes = (size_t)CHUNK * c->bits[g].words * sizeof(uint64_t);
        memset(c->bits[g].asked, 0, bytes);
        memset(c->bits[g].visible, 0, bytes);
    }
    const pair_bits *virtual = &c->bits[LIGHTS_VIRTUAL], *punctual = &c->bits[LIGHTS_PUNCTUAL];
    for (uint32_t e = 0; e < c->count; e++) {
        const eye_sample *s = c->eyes[e];
        c->material[e] = v3(0, 0, 0);
        c->reflects[e] = material_reflectance(&s->surface) > 0.0f;
        if (!c->reflects[e])
            continue;
        float *geometry = c->geometry + (size_t)e * vpls->padded;
        uint32_t asked = shade_contributions(vpls, s, vpls->luminance, geometry, c->contribution);
        shade_bits_above(geometry, 0.0f, virtual->words, virtual->asked + (size_t)e * virtual->words);
        if (virtual->refine) {
            float mean = shade_total(c->contribution, vpls->padded) / (float)(asked + 1);
            shade_bits_above(c->contribution, v->settings.refine_above * mean, virtual->words,
                             virtual->refine + (size_t)e * virtual->words);
        }

        geometry = c->punctual_geometry + (size_t)e * c->punctual.padded;
        punctuals_geometry(&c->punctual, s, geometry);
        shade_bits_above(geometry, 0.0f, punctual->words, punctual->asked + (size_t)e * punctual->words);
    }
    direct_samples(v, c);
}

/* Virtual or punctual lights. Materials with a gloss need their BRDF for each. */
static rgb light_of(const vpl_set *vpls, const chunk *c, uint32_t e, bool punctual, const float *weight)
{
    const eye_sample *s = c->eyes[e];
    const punctual_set *p = &c->punctual;
    const float *geometry =
        punctual ? c->punctual_geometry + (size_t)e * p->padded : c->geometry + (size_t)e * vpls->padded;
    rgb sum = {0, 0, 0};
    if (s->surface.material->kind == MATERIAL_DIFFUSE) {
        if (!punctual)
            return shade_expected_diffuse(vpls, s, geometry, weight);
        sum = weighted_sum(p->r, p->g, p->b, p->padded, geometry, weight);
        return v3_mul(v3_scale(s->surface.color, 1.0f / PI_F), sum);
    }
    for (uint32_t i = 0; i < (punctual ? p->count : vpls->count); i++)
        if (weight[i] > 0.0f)
            sum = v3_mad(sum, geometry[i] * weight[i],
                         punctual ? punctuals_response(p, s, i) : shade_response(vpls, s, i));
    return sum;
}

rgb shade_weighted(const vpl_set *vpls, const chunk *c, uint32_t e, const float *const weight[LIGHT_GROUPS])
{
    const eye_sample *s = c->eyes[e];
    rgb sum = v3_mul(light_of(vpls, c, e, false, weight[LIGHTS_VIRTUAL]), s->weight), samples = {0, 0, 0};
    sum = v3_add(sum, c->material[e]);
    if (c->punctual.count > 0)
        sum = v3_add(sum, v3_mul(light_of(vpls, c, e, true, weight[LIGHTS_PUNCTUAL]), s->weight));
    const pair_bits *b = &c->bits[LIGHTS_SAMPLED];
    for (uint32_t i = 0; i < b->lights; i++)
        if (weight[LIGHTS_SAMPLED][i] > 0.0f)
            samples = v3_mad(samples, weight[LIGHTS_SAMPLED][i], c->sampled[(size_t)e * b->lights + i].value);
    return v3_add(sum, samples);
}

void shade_sum(const vpl_set *vpls, const chunk *c, tile_pixels *pixels)
{
    for (uint32_t e = 0; e < c->count; e++) {
        const float *weight[LIGHT_GROUPS];
        float *to = c->weight;
        for (int g = 0; g < LIGHT_GROUPS; g++) {
            const pair_bits *b = &c->bits[g];
            spread_bits(b->visible + (size_t)e * b->words, b->words, to);
            weight[g] = to;
            to += (size_t)64 * b->words;
        }
        rgb *lit = &pixels->lit[c->eyes[e]->pixel];
        *lit = v3_add(*lit, shade_weighted(vpls, c, e, weight));
    }
}
