/* SPDX-License-Identifier: Apache-2.0 */
/* Direct light: punctual lights, and Monte Carlo samples of emitters and environment (Veach 1997, Sect. 9.2). */
#include "whitted.h"

static bool has_emitters(const view *v)
{
    return v->emitters && v->settings.light_samples > 0;
}

static bool has_environment(const view *v)
{
    return v->scene->environment && v->settings.env_samples > 0;
}

uint32_t direct_sample_count(const view *v)
{
    return (has_emitters(v) ? (uint32_t)v->settings.light_samples : 0u) +
           (has_environment(v) ? (uint32_t)v->settings.env_samples : 0u);
}

/* Weight, BRDF and cosine for light of radiance 1 per steradian from wi. */
static rgb response(const eye_sample *e, vec3 wi)
{
    float cosine = v3_dot(e->surface.normal, wi);
    if (!(cosine > 0.0f) || !(v3_dot(e->surface.geometric_normal, wi) > 0.0f))
        return v3(0, 0, 0);
    return v3_scale(v3_mul(e->weight, material_eval(&e->surface, wi)), cosine);
}

float direct_spot(const light *l, vec3 direction)
{
    float range = l->cos_inner - l->cos_outer, cosine = v3_dot(direction, l->direction);
    float ramp = range > 1e-6f ? (cosine - l->cos_outer) / range : cosine > l->cos_outer ? 1.0f : 0.0f;
    ramp = fminf(1.0f, fmaxf(0.0f, ramp));
    return ramp * ramp;
}

light_sample direct_punctual(const eye_sample *e, const light *l)
{
    light_sample out = {.infinite = l->kind == LIGHT_DIRECTIONAL};
    if (out.infinite) {
        out.target = v3_neg(l->direction);
        out.value = v3_mul(response(e, out.target), l->intensity);
        return out;
    }
    out.target = l->position;
    vec3 d = v3_sub(l->position, e->origin);
    float r2 = v3_dot(d, d);
    if (!(r2 > 0.0f))
        return out;
    vec3 wi = v3_scale(d, 1.0f / sqrtf(r2));
    float fall_off = 1.0f / r2;
    if (l->kind == LIGHT_SPOT)
        fall_off *= direct_spot(l, v3_neg(wi));
    out.value = v3_scale(v3_mul(response(e, wi), l->intensity), fall_off);
    return out;
}

/* Keeps the end of a shadow ray off the emitter: a few ulp of its largest coordinate. */
static vec3 off_surface(vec3 p, vec3 n)
{
    vec3 a = v3(fabsf(p.x), fabsf(p.y), fabsf(p.z));
    return v3_mad(p, 0x1p-19f * v3_max_component(a), n);
}

void direct_sample(const view *v, const eye_sample *e, light_sample *out, float *density, vec3 *normal)
{
    rng r = rng_make(v->settings.seed ^ 0x6c69676874u, e->random);
    if (has_emitters(v)) {
        int n = v->settings.light_samples;
        float shift = rng_float(&r);
        for (int i = 0; i < n; i++, out++, density++, normal++) {
            float u1 = ((float)i + shift) / (float)n, u2 = rng_float(&r), u3 = rng_float(&r);
            emitter_sample s = emitters_sample(v->emitters, fminf(u1, 0x1.fffffep-1f), u2, u3);
            *out = (light_sample){.target = off_surface(s.position, s.normal)};
            *density = s.pdf_area * (float)n;
            *normal = s.normal;
            vec3 d = v3_sub(s.position, e->origin);
            float r2 = v3_dot(d, d), distance = sqrtf(r2);
            vec3 wi = v3_scale(d, 1.0f / distance);
            float cosine = -v3_dot(wi, s.normal);
            if (!(cosine > 0.0f) || !(r2 > 0.0f))
                continue;
            float pdf = (float)n * s.pdf_area * r2 / cosine;
            out->value = v3_scale(v3_mul(response(e, wi), s.radiance), 1.0f / (pdf + material_pdf(&e->surface, wi)));
        }
    }
    if (has_environment(v)) {
        int n = v->settings.env_samples;
        float shift = rng_float(&r);
        for (int i = 0; i < n; i++, out++, density++, normal++) {
            rgb radiance;
            float pdf, u1 = ((float)i + shift) / (float)n, u2 = rng_float(&r);
            vec3 wi = environment_sample(v->scene->environment, fminf(u1, 0x1.fffffep-1f), u2, &radiance, &pdf);
            *out = (light_sample){.target = wi, .infinite = true};
            *density = pdf * (float)n;
            *normal = wi;
            if (pdf > 0.0f)
                out->value = v3_scale(v3_mul(response(e, wi), radiance),
                                      1.0f / ((float)n * pdf + material_pdf(&e->surface, wi)));
        }
    }
}

rgb direct_material_sample(const view *v, const eye_sample *e)
{
    if (!has_emitters(v) && !has_environment(v))
        return v3(0, 0, 0);
    rng r = rng_make(v->settings.seed ^ 0x6d6174657269616cu, e->random);
    float u1 = rng_float(&r), u2 = rng_float(&r), u3 = rng_float(&r), pdf;
    vec3 wi;
    rgb weight = v3_mul(e->weight, material_sample(&e->surface, u1, u2, u3, &wi, &pdf));
    if (!(pdf > 0.0f))
        return v3(0, 0, 0);
    surface hit;
    if (tracer_closest_opaque(v->tracer, e->origin, wi, &hit)) {
        float cosine = v3_dot(hit.geometric_normal, hit.wo);
        if (!has_emitters(v) || !(cosine > 0.0f))
            return v3(0, 0, 0);
        float rival = (float)v->settings.light_samples * emitters_pdf_area(v->emitters, &hit) * hit.distance *
                      hit.distance / cosine;
        return v3_scale(v3_mul(weight, surface_emission(&hit)), pdf / (pdf + rival));
    }
    if (!has_environment(v))
        return v3(0, 0, 0);
    float rival = (float)v->settings.env_samples * environment_pdf(v->scene->environment, wi);
    return v3_scale(v3_mul(weight, environment_radiance(v->scene->environment, wi)), pdf / (pdf + rival));
}

void direct_order(const view *v, const eye_sample *e, uint32_t count, uint16_t *order)
{
    rng r = rng_make(v->settings.seed ^ 0x6f72646572u, e->random);
    for (uint32_t i = 0; i < count; i++) { /* Fisher-Yates from the inside out */
        uint32_t k = (uint32_t)((uint64_t)rng_u32(&r) * (i + 1) >> 32);
        order[i] = order[k];
        order[k] = (uint16_t)i;
    }
}
