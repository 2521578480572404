/* SPDX-License-Identifier: Apache-2.0 */
/* Direct light: punctual lights, and Monte Carlo samples of emitters and environment (Veach 1997, Sect. 9.2). */
#include "whitted.h"

#include "../common/light_sources.h"

enum { QUEUE = 64 };

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

/* Weight, BRDF and cosine for light of radiance 1 per steradian from wi, and how dense the material draws wi. */
static rgb response(const eye_sample *e, vec3 wi, float *pdf)
{
    float cosine = v3_dot(e->surface.normal, wi);
    *pdf = 0.0f;
    if (!(cosine > 0.0f) || !(v3_dot(e->surface.geometric_normal, wi) > 0.0f))
        return v3(0, 0, 0);
    return v3_scale(v3_mul(e->weight, material_eval_pdf(&e->surface, wi, pdf)), cosine);
}

/* `albedo`: weight times BRDF where that is `diffuse`. */
static inline light_sample punctual(const eye_sample *e, const light *l, bool diffuse, rgb albedo)
{
    light_sample out = {.target = l->position, .infinite = l->kind == LIGHT_DIRECTIONAL};
    float unused, fall_off = 1.0f;
    vec3 wi = v3_neg(l->direction);
    if (out.infinite) {
        out.target = wi;
    } else {
        vec3 d = v3_sub(l->position, e->origin);
        float r2 = v3_dot(d, d);
        if (!(r2 > 0.0f))
            return out;
        float inverse = 1.0f / sqrtf(r2);
        wi = v3_scale(d, inverse);
        fall_off = inverse * inverse;
    }
    float cosine = v3_dot(e->surface.normal, wi);
    if (!(cosine > 0.0f) || !(v3_dot(e->surface.geometric_normal, wi) > 0.0f))
        return out;
    if (l->kind == LIGHT_SPOT)
        fall_off *= spot_fall_off(l, v3_neg(wi));
    out.value = diffuse ? v3_scale(v3_mul(albedo, l->intensity), cosine * fall_off)
                        : v3_scale(v3_mul(response(e, wi, &unused), l->intensity), fall_off);
    return out;
}

light_sample direct_punctual(const eye_sample *e, const light *l)
{
    return punctual(e, l, false, v3(0, 0, 0));
}

void direct_punctuals(const view *v, const eye_sample *e, light_sample *out, uint64_t *asked)
{
    const surface *s = &e->surface;
    /* Where there are many lights, all but this product would be the same for each. */
    bool diffuse = s->material->kind == MATERIAL_DIFFUSE && v3_dot(s->wo, s->normal) > 0.0f;
    rgb albedo = v3_scale(v3_mul(e->weight, s->color), 1.0f / PI_F);
    for (uint32_t i = 0; i < v->scene->light_count; i++) {
        out[i] = punctual(e, &v->scene->lights[i], diffuse, albedo);
        if (asked)
            asked[i / 64] |= (uint64_t)(v3_max_component(out[i].value) > 0.0f) << i % 64;
    }
}

/* ------------------------------------------------------------------------------------------------- light samples */

/* Light samples that wait to be drawn from the environment together. */
typedef struct env_queue {
    uint32_t count;
    uint32_t eye[QUEUE], slot[QUEUE]; /* slot: of the eye sample's light samples */
    float u1[QUEUE], u2[QUEUE];
    vec3 normal[QUEUE];
} env_queue;

static void store(chunk *c, uint32_t e, uint32_t slot, light_sample s, float density, vec3 normal)
{
    pair_bits *b = &c->bits[LIGHTS_SAMPLED];
    size_t at = (size_t)e * b->lights + slot;
    c->sampled[at] = s;
    c->sampled_density[at] = density;
    c->sampled_normal[at] = normal;
    if (v3_max_component(s.value) > 0.0f)
        b->asked[(size_t)e * b->words + slot / 64] |= (uint64_t)1 << slot % 64;
}

static void draw_environment(const view *v, chunk *c, env_queue *q)
{
    float n = (float)v->settings.env_samples, pdf[QUEUE], rival;
    vec3 wi[QUEUE];
    rgb radiance[QUEUE];
    environment_sample_batch(v->scene->environment, q->count, q->u1, q->u2, q->normal, wi, radiance, pdf);
    for (uint32_t k = 0; k < q->count; k++) {
        light_sample s = {.target = wi[k], .infinite = true};
        if (pdf[k] > 0.0f) {
            rgb value = response(c->eyes[q->eye[k]], wi[k], &rival);
            s.value = v3_scale(v3_mul(value, radiance[k]), 1.0f / (n * pdf[k] + rival));
        }
        store(c, q->eye[k], q->slot[k], s, n * pdf[k], wi[k]);
    }
    q->count = 0;
}

static void draw_emitter(const view *v, chunk *c, uint32_t e, uint32_t slot, float u1, float u2, float u3)
{
    const eye_sample *eye = c->eyes[e];
    float n = (float)v->settings.light_samples, rival;
    emitter_sample l = emitters_sample(v->emitters, float_min(u1, 0x1.fffffep-1f), u2, u3);
    light_sample s = {.target = emitter_offset(&l)};
    vec3 d = v3_sub(l.position, eye->origin);
    float r2 = v3_dot(d, d), away = -v3_dot(d, l.normal);
    if (away > 0.0f && r2 > 0.0f) {
        float distance = sqrtf(r2), pdf = n * l.pdf_area * r2 * distance / away;
        rgb value = response(eye, v3_scale(d, 1.0f / distance), &rival);
        s.value = v3_scale(v3_mul(value, l.radiance), 1.0f / (pdf + rival));
    }
    store(c, e, slot, s, n * l.pdf_area, l.normal);
}

static void draw_lights(const view *v, chunk *c)
{
    uint32_t from_emitters = has_emitters(v) ? (uint32_t)v->settings.light_samples : 0;
    uint32_t from_environment = has_environment(v) ? (uint32_t)v->settings.env_samples : 0;
    env_queue q = {.count = 0};
    for (uint32_t e = 0; e < c->count; e++) {
        if (!c->reflects[e])
            continue;
        rng r = rng_make(v->settings.seed ^ 0x6c69676874u, c->eyes[e]->random);
        float shift = from_emitters ? rng_float(&r) : 0.0f;
        for (uint32_t i = 0; i < from_emitters; i++) {
            float u2 = rng_float(&r), u3 = rng_float(&r);
            draw_emitter(v, c, e, i, ((float)i + shift) / (float)from_emitters, u2, u3);
        }
        shift = from_environment ? rng_float(&r) : 0.0f;
        for (uint32_t i = 0; i < from_environment; i++) {
            q.eye[q.count] = e;
            q.slot[q.count] = from_emitters + i;
            q.u1[q.count] = float_min(((float)i + shift) / (float)from_environment, 0x1.fffffep-1f);
            q.u2[q.count] = rng_float(&r);
            q.normal[q.count] = c->eyes[e]->surface.normal;
            if (++q.count == QUEUE)
                draw_environment(v, c, &q);
        }
    }
    if (q.count > 0)
        draw_environment(v, c, &q);
}

/* ------------------------------------------------------------------------------------------------- material rays */

/* Rays that find light unless something is in between. */
typedef struct ray_queue {
    ray_packet packet;
    uint32_t count, eye[GROUP];
    rgb value[GROUP]; /* emitters: to the pixel; environment: for radiance 1 */
    float pdf[GROUP]; /* of the material; environment only */
} ray_queue;

static void trace_queue(const view *v, chunk *c, ray_queue *q)
{
    const ray_packet *p = &q->packet;
    uint32_t all = (1u << q->count) - 1u, seen = all & ~tracer_occluded16(v->tracer, &q->packet, all, false);
    for (; seen; seen &= seen - 1) {
        uint32_t k = (uint32_t)__builtin_ctz(seen);
        rgb value = q->value[k];
        if (p->tfar[k] == INFINITY) {
            float rival;
            rgb sky = environment_lookup(v->scene->environment, v3(p->dir_x[k], p->dir_y[k], p->dir_z[k]), &rival);
            rival *= (float)v->settings.env_samples;
            value = v3_scale(v3_mul(value, sky), q->pdf[k] / (q->pdf[k] + rival));
        }
        c->material[q->eye[k]] = value;
    }
    q->count = 0;
}

static void push_ray(const view *v, chunk *c, ray_queue *q, uint32_t e, vec3 wi, float tfar, rgb value, float pdf)
{
    ray_packet *p = &q->packet;
    vec3 o = c->eyes[e]->origin;
    uint32_t k = q->count++;
    p->org_x[k] = o.x, p->org_y[k] = o.y, p->org_z[k] = o.z;
    p->dir_x[k] = wi.x, p->dir_y[k] = wi.y, p->dir_z[k] = wi.z;
    p->tfar[k] = tfar;
    q->eye[k] = e;
    q->value[k] = value;
    q->pdf[k] = pdf;
    if (q->count == GROUP)
        trace_queue(v, c, q);
}

/* Emitters are few: rays are tried against them first, and only what hits one is worth a shadow ray. */
static void draw_material(const view *v, chunk *c, uint32_t e, ray_queue *q)
{
    const eye_sample *eye = c->eyes[e];
    rng r = rng_make(v->settings.seed ^ 0x6d6174657269616cu, eye->random);
    float u1 = rng_float(&r), u2 = rng_float(&r), u3 = rng_float(&r), pdf;
    vec3 wi;
    rgb weight = v3_mul(eye->weight, material_sample(&eye->surface, u1, u2, u3, &wi, &pdf));
    surface hit;
    if (!(pdf > 0.0f) || !(v3_max_component(weight) > 0.0f))
        return;
    if (has_emitters(v) && tracer_closest_emitter(v->tracer, eye->origin, wi, &hit)) {
        float cosine = v3_dot(hit.geometric_normal, hit.wo);
        if (!(cosine > 0.0f) || (hit.back_side && !hit.material->two_sided))
            return;
        float rival = (float)v->settings.light_samples * emitters_pdf_area(v->emitters, &hit) * hit.distance *
                      hit.distance / cosine;
        rgb value = v3_scale(v3_mul(weight, surface_emission(&hit)), pdf / (pdf + rival));
        push_ray(v, c, q, e, wi, surface_reach(&hit), value, pdf);
    } else if (has_environment(v)) {
        push_ray(v, c, q, e, wi, INFINITY, weight, pdf);
    }
}

void direct_samples(const view *v, chunk *c)
{
    if (!has_emitters(v) && !has_environment(v))
        return;
    draw_lights(v, c);
    ray_queue q;
    packet_init(&q.packet);
    q.count = 0;
    for (uint32_t e = 0; e < c->count; e++)
        if (c->reflects[e])
            draw_material(v, c, e, &q);
    if (q.count > 0)
        trace_queue(v, c, &q);
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
