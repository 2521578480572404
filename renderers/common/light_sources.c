/* SPDX-License-Identifier: Apache-2.0 */
/* Choice of a source, then of a ray from it (Pharr et al., "Physically Based Rendering", 4th ed., Sect. 12). */
#include "light_sources.h"

#include <stdlib.h>

struct light_sources {
    const scene *scene;
    const emitters *emitters;
    /* luminance of the flux, W: of each, and of all */
    float power_emitters, power_environment, *power_lights, power_total;
    /* of the scene's bounding sphere */
    vec3 center;
    float radius;
    float disc; /* area of its great disc */
};

light_sources *light_sources_new(const scene *s, const emitters *e, bool with_environment)
{
    light_sources *l = xcalloc(1, sizeof *l);
    vec3 size = v3_sub(s->bounds_max, s->bounds_min);
    l->scene = s;
    l->emitters = e;
    l->center = v3_mad(s->bounds_min, 0.5f, size);
    l->radius = 0.5f * v3_length(size);
    l->disc = PI_F * l->radius * l->radius;
    l->power_emitters = emitters_power(e);
    l->power_environment =
        with_environment && s->environment ? 4.0f * PI_F * l->disc * luminance(environment_mean(s->environment)) : 0.0f;
    l->power_total = l->power_emitters + l->power_environment;
    l->power_lights = xcalloc(s->light_count + 1, sizeof *l->power_lights);
    for (uint32_t i = 0; i < s->light_count; i++) {
        /* spots as if they shone all around: a bound is enough to choose by */
        float extent = s->lights[i].kind == LIGHT_DIRECTIONAL ? l->disc : 4.0f * PI_F;
        l->power_lights[i] = extent * luminance(s->lights[i].intensity);
        l->power_total += l->power_lights[i];
    }
    if (l->power_total > 0.0f)
        return l;
    light_sources_free(l);
    return NULL;
}

bool light_sources_finite(const light_sources *l)
{
    return l->power_total < INFINITY;
}

void light_sources_free(light_sources *l)
{
    if (!l)
        return;
    free(l->power_lights);
    free(l);
}

float light_sources_disc_radius(const light_sources *l)
{
    return l->radius;
}

/* ---------------------------------------------------------------------------------------------------- directions */

static vec3 cosine_direction(vec3 n, float u1, float u2)
{
    vec3 t, b;
    v3_basis(n, &t, &b);
    float radius = sqrtf(u1), phi = 2.0f * PI_F * u2;
    vec3 flat = v3_add(v3_scale(t, radius * cosf(phi)), v3_scale(b, radius * sinf(phi)));
    return v3_normalize(v3_mad(flat, sqrtf(fmaxf(0.0f, 1.0f - u1)), n));
}

static vec3 sphere_direction(float u1, float u2)
{
    float z = 1.0f - 2.0f * u1, s = sqrtf(fmaxf(0.0f, 1.0f - z * z)), phi = 2.0f * PI_F * u2;
    return v3(s * cosf(phi), s * sinf(phi), z);
}

/* Uniform in the cone around `axis`. */
static vec3 cone_direction(vec3 axis, float cos_outer, float u1, float u2)
{
    vec3 t, b;
    v3_basis(axis, &t, &b);
    float z = 1.0f - u1 * (1.0f - cos_outer), s = sqrtf(fmaxf(0.0f, 1.0f - z * z));
    vec3 flat = v3_add(v3_scale(t, s * cosf(2.0f * PI_F * u2)), v3_scale(b, s * sinf(2.0f * PI_F * u2)));
    return v3_normalize(v3_mad(flat, z, axis));
}

/* A point of the disc that faces `direction` behind the scene's bounding sphere. */
static vec3 disc_origin(const light_sources *l, vec3 direction, float u1, float u2)
{
    vec3 t, b;
    v3_basis(direction, &t, &b);
    float radius = l->radius * sqrtf(u1), phi = 2.0f * PI_F * u2;
    vec3 p = v3_mad(l->center, -2.0f * l->radius, direction);
    return v3_add(p, v3_add(v3_scale(t, radius * cosf(phi)), v3_scale(b, radius * sinf(phi))));
}

/* ------------------------------------------------------------------------------------------------------ emission */

static bool emit_surface(const light_sources *l, const float u[5], light_emission *out)
{
    emitter_sample s = emitters_sample(l->emitters, u[0], u[1], u[2]);
    vec3 direction = cosine_direction(s.normal, u[3], u[4]);
    float cosine = v3_dot(s.normal, direction);
    *out = (light_emission){.kind = SOURCE_EMITTER,
                            .position = s.position,
                            .normal = s.normal,
                            .origin = emitter_offset(&s),
                            .direction = direction,
                            .cosine = cosine,
                            .radiance = s.radiance,
                            .pdf_direct = l->power_emitters / l->power_total * s.pdf_area,
                            /* the cosine is that of pdf_ray */
                            .flux = v3_scale(s.radiance, PI_F / s.pdf_area * l->power_total / l->power_emitters)};
    out->pdf_ray = out->pdf_direct * cosine * (1.0f / PI_F);
    return cosine > 0.0f;
}

static bool emit_punctual(const light_sources *l, uint32_t index, const float u[2], light_emission *out)
{
    const light *from = &l->scene->lights[index];
    float scale = l->power_total / l->power_lights[index], pdf;
    *out = (light_emission){.light = index, .cosine = 1.0f, .pdf_direct = l->power_lights[index] / l->power_total};
    if (from->kind == LIGHT_DIRECTIONAL) {
        out->kind = SOURCE_DIRECTIONAL;
        out->direction = from->direction;
        out->position = disc_origin(l, from->direction, u[0], u[1]);
        out->flux = v3_scale(from->intensity, l->disc * scale);
    } else {
        out->kind = SOURCE_POINT;
        out->position = from->position;
        if (from->kind == LIGHT_SPOT) {
            out->direction = cone_direction(from->direction, from->cos_outer, u[0], u[1]);
            scale *= 0.5f * (1.0f - from->cos_outer) * spot_fall_off(from, out->direction);
        } else {
            out->direction = sphere_direction(u[0], u[1]);
        }
        out->flux = v3_scale(from->intensity, 4.0f * PI_F * scale);
    }
    out->origin = out->position;
    out->radiance = light_sources_radiance(l, out, out->direction, &pdf);
    out->pdf_ray = out->pdf_direct * pdf;
    return v3_max_component(out->flux) > 0.0f;
}

static bool emit_environment(const light_sources *l, const float u[4], light_emission *out)
{
    rgb radiance;
    float pdf;
    vec3 to_light = environment_sample(l->scene->environment, u[0], u[1], &radiance, &pdf);
    if (!(pdf > 0.0f) || !(v3_max_component(radiance) > 0.0f))
        return false;
    vec3 direction = v3_neg(to_light), origin = disc_origin(l, direction, u[2], u[3]);
    *out = (light_emission){.kind = SOURCE_ENVIRONMENT,
                            .position = origin,
                            .origin = origin,
                            .direction = direction,
                            .cosine = 1.0f,
                            .radiance = radiance,
                            .pdf_direct = l->power_environment / l->power_total * pdf,
                            .flux = v3_scale(radiance, l->disc / pdf * l->power_total / l->power_environment)};
    out->pdf_ray = out->pdf_direct / l->disc;
    return true;
}

bool light_sources_emit(const light_sources *l, const float u[6], light_emission *out)
{
    float choice = u[0] * l->power_total;
    if (choice < l->power_emitters)
        return emit_surface(l, u + 1, out);
    choice -= l->power_emitters;
    for (uint32_t i = 0; i < l->scene->light_count; choice -= l->power_lights[i], i++)
        if (choice < l->power_lights[i])
            return emit_punctual(l, i, u + 1, out);
    return l->power_environment > 0.0f && emit_environment(l, u + 1, out);
}

/* ----------------------------------------------------------------------------------------------------- densities */

void light_sources_emitter_pdf(const light_sources *l, const surface *hit, float *direct, float *ray)
{
    float cosine = float_max(0.0f, v3_dot(hit->geometric_normal, hit->wo));
    *direct = l->power_emitters / l->power_total * emitters_pdf_area(l->emitters, hit);
    *ray = *direct * cosine * (1.0f / PI_F);
}

void light_sources_environment_pdf(const light_sources *l, vec3 direction, float *direct, float *ray)
{
    *direct = 0.0f;
    if (l->power_environment > 0.0f)
        *direct = l->power_environment / l->power_total * environment_pdf(l->scene->environment, direction);
    *ray = *direct / l->disc;
}

static rgb punctual_radiance(const light_sources *l, const light *from, vec3 direction, float *pdf)
{
    if (from->kind == LIGHT_DIRECTIONAL) {
        *pdf = 1.0f / l->disc;
        return from->intensity;
    }
    *pdf = 0.25f / PI_F;
    if (from->kind == LIGHT_POINT)
        return from->intensity;
    float fall_off = spot_fall_off(from, direction), cone = 2.0f * PI_F * (1.0f - from->cos_outer);
    *pdf = fall_off > 0.0f && cone > 0.0f ? 1.0f / cone : 0.0f;
    return v3_scale(from->intensity, fall_off);
}

rgb light_sources_radiance(const light_sources *l, const light_emission *y0, vec3 direction, float *pdf)
{
    if (y0->kind == SOURCE_POINT || y0->kind == SOURCE_DIRECTIONAL)
        return punctual_radiance(l, &l->scene->lights[y0->light], direction, pdf);
    *pdf = 1.0f / l->disc;
    if (y0->kind == SOURCE_ENVIRONMENT)
        return y0->radiance;
    float cosine = float_max(0.0f, v3_dot(y0->normal, direction));
    *pdf = cosine * (1.0f / PI_F);
    return cosine > 0.0f ? y0->radiance : v3(0, 0, 0);
}
