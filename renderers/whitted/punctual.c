/* SPDX-License-Identifier: Apache-2.0 */
/* All punctual lights at an eye sample: what they would bring, in the manner of virtual point lights. */
#include "whitted.h"

#include "clones.h"

punctual_set punctuals_new(const scene *s, uint32_t count)
{
    punctual_set l = {.count = count, .padded = (count + 63) / 64 * 64};
    float **rows[] = {&l.x, &l.y, &l.z, &l.dx, &l.dy, &l.dz, &l.finite, &l.slope, &l.rise, &l.r, &l.g, &l.b};
    enum { ROWS = sizeof rows / sizeof *rows };
    float *all = floats_new((size_t)(ROWS + 1) * l.padded);
    for (size_t k = 0; k < ROWS; k++)
        *rows[k] = all + k * l.padded;
    l.power = (uint32_t *)(void *)(all + (size_t)ROWS * l.padded);
    l.directional = xcalloc(l.padded / 64 + 1, sizeof *l.directional);
    l.all_directional = true;
    for (uint32_t i = 0; i < count; i++) {
        const light *from = &s->lights[i];
        bool infinite = from->kind == LIGHT_DIRECTIONAL;
        l.all_directional = l.all_directional && infinite;
        l.directional[i / 64] |= (uint64_t)infinite << i % 64;
        if (!(v3_max_component(from->intensity) > 0.0f))
            continue; /* nothing arrives */
        bool spot = from->kind == LIGHT_SPOT;
        vec3 at = infinite ? v3_neg(from->direction) : from->position;
        l.x[i] = at.x, l.y[i] = at.y, l.z[i] = at.z;
        l.dx[i] = from->direction.x, l.dy[i] = from->direction.y, l.dz[i] = from->direction.z;
        l.finite[i] = !infinite;
        l.slope[i] = spot ? 1.0f / float_max(from->cos_inner - from->cos_outer, 1e-6f) : 0.0f;
        l.rise[i] = spot ? -from->cos_outer * l.slope[i] : 1.0f;
        l.power[i] = !spot ? 1 : from->power ? from->power : 2;
        l.r[i] = from->intensity.x, l.g[i] = from->intensity.y, l.b[i] = from->intensity.z;
    }
    return l;
}

void punctuals_free(punctual_set *l)
{
    free(l->x);
    free(l->directional);
}

CLONES static void cosines_of(const punctual_set *l, vec3 n, vec3 h, float *restrict out)
{
    const float *restrict x = l->x, *restrict y = l->y, *restrict z = l->z, *restrict finite = l->finite;
    for (uint32_t i = 0; i < l->padded; i++) {
        float eye = n.x * x[i] + n.y * y[i] + n.z * z[i], side = h.x * x[i] + h.y * y[i] + h.z * z[i];
        int lit = (eye > 0.0f) & (side > 0.0f) & (finite[i] == 0.0f);
        out[i] = lit ? eye : 0.0f;
    }
}

void punctuals_cosines(const punctual_set *l, const surface *s, float *out)
{
    cosines_of(l, s->normal, s->geometric_normal, out);
}

/* Every light is looked at as if it were a spot light with a fall-off; those that are none have one of 1. */
CLONES static void geometry_of(const punctual_set *l, const eye_sample *e, float *restrict out)
{
    const vec3 p = e->origin, n = e->surface.normal, h = e->surface.geometric_normal;
    const float *restrict x = l->x, *restrict y = l->y, *restrict z = l->z;
    const float *restrict dx = l->dx, *restrict dy = l->dy, *restrict dz = l->dz;
    const float *restrict finite = l->finite, *restrict slope = l->slope, *restrict rise = l->rise;
    const float *restrict r = l->r, *restrict g = l->g, *restrict b = l->b;
    const uint32_t *restrict power = l->power;
    for (uint32_t i = 0; i < l->padded; i++) {
        float wx = x[i] - finite[i] * p.x, wy = y[i] - finite[i] * p.y, wz = z[i] - finite[i] * p.z;
        float r2 = wx * wx + wy * wy + wz * wz, inverse = 1.0f / sqrtf(r2);
        float cosine = (n.x * wx + n.y * wy + n.z * wz) * inverse, side = h.x * wx + h.y * wy + h.z * wz;
        float along = -(dx[i] * wx + dy[i] * wy + dz[i] * wz) * inverse, ramp = along * slope[i] + rise[i];
        ramp = ramp < 1.0f ? ramp : 1.0f;
        ramp = ramp > 0.0f ? ramp : 0.0f;
        float fall_off = inverse * inverse;
        fall_off = finite[i] > 0.0f ? fall_off : 1.0f;
        for (uint32_t bit = 0; bit < 5; bit++) { /* LIGHT_POWER_MAX */
            fall_off *= power[i] >> bit & 1u ? ramp : 1.0f;
            ramp *= ramp;
        }
        int lit = (cosine > 0.0f) & (side > 0.0f) & (r2 > 0.0f) & (r[i] + g[i] + b[i] > 0.0f);
        float value = cosine * fall_off;
        out[i] = lit ? value : 0.0f;
    }
}

void punctuals_geometry(const punctual_set *l, const eye_sample *e, float *out)
{
    const surface *s = &e->surface;
    if (s->material->kind == MATERIAL_DIFFUSE && !(v3_dot(s->wo, s->normal) > 0.0f)) {
        for (uint32_t i = 0; i < l->padded; i++)
            out[i] = 0.0f;
        return;
    }
    if (l->all_directional) /* that is all they differ in */
        punctuals_cosines(l, s, out);
    else
        geometry_of(l, e, out);
    if (s->material->kind == MATERIAL_DIFFUSE)
        return;
    for (uint32_t i = 0; i < l->count; i++) /* some directions are out of a gloss's reach */
        if (out[i] > 0.0f && !(v3_max_component(punctuals_response(l, e, i)) > 0.0f))
            out[i] = 0.0f;
}

vec3 punctuals_target(const punctual_set *l, uint32_t i, bool *infinite)
{
    *infinite = l->finite[i] == 0.0f;
    return v3(l->x[i], l->y[i], l->z[i]);
}

rgb punctuals_response(const punctual_set *l, const eye_sample *e, uint32_t i)
{
    bool infinite;
    vec3 to = punctuals_target(l, i, &infinite), wi = infinite ? to : v3_normalize(v3_sub(to, e->origin));
    return v3_mul(material_eval(&e->surface, wi), v3(l->r[i], l->g[i], l->b[i]));
}
