/* SPDX-License-Identifier: Apache-2.0 */
/* Embree behind tracer.h: queries, and the reconstruction of the surface that was hit. */
#include "tracer_internal.h"

#include "triangle.h"

#include <float.h>
#include <stddef.h>
#include <string.h>

/* Positions, and Embree's own differences of them, are good to a few ulp of the largest coordinate involved;
 * 8 ulp leave room for the sum of them all. */
#define ERROR_SCALE 0x1p-20f

/* Shading normals are bent until they face both the geometric normal and the viewer by at least this cosine. */
#define MIN_SHADING_COSINE 0.01f

_Static_assert(sizeof(ray_packet) == sizeof(struct RTCRay16), "ray_packet must be Embree's RTCRay16");
_Static_assert(offsetof(ray_packet, tfar) == offsetof(struct RTCRay16, tfar), "ray_packet must be Embree's RTCRay16");
_Static_assert(offsetof(ray_packet, flags) == offsetof(struct RTCRay16, flags), "ray_packet must be Embree's RTCRay16");

/* --- The surface hit --- */

static float largest(vec3 v)
{
    return float_max(fabsf(v.x), float_max(fabsf(v.y), fabsf(v.z)));
}

/* a0 + u (a1 - a0) + v (a2 - a0): differences of nearby floats are exact, so only the last sum rounds. */
static vec3 interpolate(const vec3 a[3], float u, float v)
{
    vec3 e = v3_scale(v3_sub(a[1], a[0]), u);
    return v3_add(a[0], v3_mad(e, v, v3_sub(a[2], a[0])));
}

static vec3 shading_normal(const scene *s, const surface *h, float u, float v)
{
    const instance *in = &s->instances[h->instance];
    const mesh *m = &s->meshes[h->mesh];
    vec3 corner[3], n;
    for (int k = 0; k < 3; k++) {
        const float *q = m->normals + 3 * (size_t)m->indices[3 * (size_t)h->primitive + (size_t)k];
        corner[k] = v3(q[0], q[1], q[2]);
    }
    n = v3_normalize(transform_normal(in->to_world, v3_normalize(interpolate(corner, u, v))));
    if (!(v3_dot(n, n) > 0.5f)) /* zero or not a number */
        return h->geometric_normal;
    float side = v3_dot(n, h->geometric_normal);
    if (side < 0.0f) /* seen from behind, or the file's normals point inwards */
        n = v3_neg(n), side = -side;
    if (side < MIN_SHADING_COSINE)
        n = v3_normalize(v3_mad(n, MIN_SHADING_COSINE - side, h->geometric_normal));
    float facing = v3_dot(n, h->wo);
    if (facing < MIN_SHADING_COSINE) /* otherwise silhouettes of smooth meshes get black rims */
        n = v3_normalize(v3_mad(n, MIN_SHADING_COSINE - facing, h->wo));
    return n;
}

/* What all hits of one triangle share. */
typedef struct facet {
    uint32_t instance, primitive;
    vec3 p[3], normal;
    float error; /* of positions */
} facet;

static facet facet_of(const tracer *t, uint32_t id, uint32_t primitive, bool instanced)
{
    const scene *s = t->scene;
    const mesh *m = &s->meshes[s->instances[id].mesh];
    const placement *at = &t->placements[id];
    const uint32_t *index = m->indices + 3 * (size_t)primitive;
    facet f = {.instance = id, .primitive = primitive};
    float area;
    triangle_corners(s, id, primitive, f.p);
    f.error = float_max(largest(f.p[0]), float_max(largest(f.p[1]), largest(f.p[2])));
    if (instanced) {
        float object = 0.0f;
        for (int k = 0; k < 3; k++)
            for (size_t i = 0; i < 3; i++)
                object = float_max(object, fabsf(m->positions[3 * (size_t)index[k] + i]));
        f.error = at->condition * (f.error + at->translation) + at->stretch * object;
    }
    f.error = ERROR_SCALE * f.error + FLT_MIN;
    f.normal = triangle_normal(f.p, &area);
    if (at->mirrored)
        f.normal = v3_neg(f.normal);
    return f;
}

/* `last`: the triangle hit before, often the same one; its primitive RTC_INVALID_GEOMETRY_ID before the first. */
static void fill_surface(const tracer *t, const struct RTCRayHit *r, facet *last, surface *h)
{
    const scene *s = t->scene;
    bool instanced = r->hit.instID[0] != RTC_INVALID_GEOMETRY_ID;
    float u = r->hit.u, v = r->hit.v;
    vec3 direction = v3(r->ray.dir_x, r->ray.dir_y, r->ray.dir_z);
    h->instance = instanced ? r->hit.instID[0] : r->hit.geomID;
    h->primitive = r->hit.primID;
    h->mesh = s->instances[h->instance].mesh;
    h->distance = r->ray.tfar;
    h->wo = v3_neg(direction);

    const mesh *m = &s->meshes[h->mesh];
    const uint32_t *index = m->indices + 3 * (size_t)h->primitive;
    if (last->primitive != h->primitive || last->instance != h->instance)
        *last = facet_of(t, h->instance, h->primitive, instanced);
    h->position = interpolate(last->p, u, v);
    h->position_error = last->error;
    h->geometric_normal = last->normal;
    h->back_side = v3_dot(h->geometric_normal, direction) > 0.0f;
    if (h->back_side)
        h->geometric_normal = v3_neg(h->geometric_normal);
    h->normal = m->normals ? shading_normal(s, h, u, v) : h->geometric_normal;

    h->material = &s->materials[m->material];
    h->color = h->material->color;
    h->u = h->v = 0.0f;
    if (m->uvs) {
        const float *a = m->uvs + 2 * (size_t)index[0], *b = m->uvs + 2 * (size_t)index[1],
                    *c = m->uvs + 2 * (size_t)index[2];
        h->u = a[0] + u * (b[0] - a[0]) + v * (c[0] - a[0]);
        h->v = a[1] + u * (b[1] - a[1]) + v * (c[1] - a[1]);
        if (h->material->texture >= 0)
            h->color = v3_mul(h->color, texture_lookup(&s->textures[h->material->texture], h->u, h->v));
    }
}

vec3 surface_offset(const surface *s, vec3 toward)
{
    float side = v3_dot(s->geometric_normal, toward) < 0.0f ? -1.0f : 1.0f;
    return v3_mad(s->position, side * s->position_error, s->geometric_normal);
}

/* --- Queries --- */

static struct RTCRay make_ray(vec3 origin, vec3 direction, float tfar, unsigned mask)
{
    return (struct RTCRay){.org_x = origin.x,
                           .org_y = origin.y,
                           .org_z = origin.z,
                           .dir_x = direction.x,
                           .dir_y = direction.y,
                           .dir_z = direction.z,
                           .tfar = tfar,
                           .mask = mask};
}

static bool closest(const tracer *t, RTCScene in, vec3 origin, vec3 direction, unsigned mask, surface *hit)
{
    struct RTCRayHit r = {.ray = make_ray(origin, direction, INFINITY, mask),
                          .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .instID = {RTC_INVALID_GEOMETRY_ID}}};
    embree_intersect1(in, &r);
    if (r.hit.geomID == RTC_INVALID_GEOMETRY_ID)
        return false;
    facet one = {.primitive = RTC_INVALID_GEOMETRY_ID};
    fill_surface(t, &r, &one, hit);
    return true;
}

bool tracer_closest(const tracer *t, vec3 origin, vec3 direction, surface *hit)
{
    return closest(t, t->top, origin, direction, MASK_ALL, hit);
}

bool tracer_closest_opaque(const tracer *t, vec3 origin, vec3 direction, surface *hit)
{
    return closest(t, t->top, origin, direction, MASK_OPAQUE, hit);
}

bool tracer_closest_emitter(const tracer *t, vec3 origin, vec3 direction, surface *hit)
{
    return t->emitters && closest(t, t->emitters, origin, direction, MASK_OPAQUE, hit);
}

/* Distances come out with the surface's own error along the ray, and with a few ulp of the ray's length. */
float surface_reach(const surface *hit)
{
    float cosine = v3_dot(hit->geometric_normal, hit->wo);
    float reach = hit->distance * (1.0f - 0x1p-19f) - 2.0f * hit->position_error / float_max(cosine, 1e-6f);
    return float_max(0.0f, reach);
}

static bool occluded(const tracer *t, vec3 origin, vec3 direction, float tfar, unsigned mask)
{
    struct RTCRay r = make_ray(origin, direction, tfar, mask);
    embree_occluded1(t->top, &r);
    return r.tfar == -INFINITY;
}

bool tracer_occluded(const tracer *t, vec3 origin, vec3 direction, float tfar)
{
    return occluded(t, origin, direction, tfar, MASK_OPAQUE);
}

bool tracer_occluded_solid(const tracer *t, vec3 origin, vec3 direction, float tfar)
{
    return occluded(t, origin, direction, tfar, MASK_ALL);
}

/* The lanes that hit, of rays already in Embree's layout. */
static uint32_t intersect16(const tracer *t, RTCScene in, struct RTCRayHit16 *r, uint32_t active, bool coherent)
{
    enum { FIELDS = sizeof *r / (TRACER_PACKET * sizeof(float)) };
    _Alignas(64) int valid[TRACER_PACKET];
    coherent = coherent && !t->instanced;
    uint32_t hits = 0;
    int w = t->width;
    for (uint32_t i = 0; i < TRACER_PACKET; i++)
        valid[i] = -(int)(active >> i & 1u);
    if (w == TRACER_PACKET)
        embree_intersect16(valid, in, r, coherent);
    for (int first = 0; w < TRACER_PACKET && first < TRACER_PACKET; first += w) {
        _Alignas(64) float part[(FIELDS + 4) * 8]; /* single rays are padded */
        _Alignas(64) int part_valid[8];
        char *from = (char *)r + (size_t)first * sizeof(float);
        if (!(active >> first & ((1u << w) - 1u)))
            continue;
        memcpy(part_valid, valid + first, (size_t)w * sizeof *valid);
        for (int i = 0; i < FIELDS; i++)
            memcpy(part + i * w, from + (size_t)i * sizeof r->ray.tfar, (size_t)w * sizeof(float));
        if (w == 8)
            embree_intersect8(part_valid, in, (struct RTCRayHit8 *)(void *)part, coherent);
        else if (w == 4)
            embree_intersect4(part_valid, in, (struct RTCRayHit4 *)(void *)part, coherent);
        else
            embree_intersect1(in, (struct RTCRayHit *)(void *)part);
        for (int i = 0; i < FIELDS; i++)
            memcpy(from + (size_t)i * sizeof r->ray.tfar, part + i * w, (size_t)w * sizeof(float));
    }
    for (uint32_t i = 0; i < TRACER_PACKET; i++)
        hits |= (uint32_t)(r->hit.geomID[i] != RTC_INVALID_GEOMETRY_ID) << i;
    return hits & active;
}

uint32_t tracer_closest16(const tracer *t, const ray_packet *p, uint32_t active, bool coherent,
                          surface hits[TRACER_PACKET])
{
    struct RTCRayHit16 r;
    memcpy(&r.ray, p, sizeof r.ray);
    memset(&r.hit, 0xff, sizeof r.hit); /* invalid ids */
    for (uint32_t i = 0; i < TRACER_PACKET; i++)
        r.ray.mask[i] = MASK_ALL;
    uint32_t hit = intersect16(t, t->top, &r, active, coherent);
    facet last = {.primitive = RTC_INVALID_GEOMETRY_ID};
    for (uint32_t lanes = hit; lanes; lanes &= lanes - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(lanes);
        struct RTCRayHit one = {
            .ray = {.dir_x = p->dir_x[i], .dir_y = p->dir_y[i], .dir_z = p->dir_z[i], .tfar = r.ray.tfar[i]},
            .hit = {.u = r.hit.u[i], .v = r.hit.v[i], .primID = r.hit.primID[i], .geomID = r.hit.geomID[i]}};
        one.hit.instID[0] = r.hit.instID[0][i];
        fill_surface(t, &one, &last, &hits[i]);
    }
    return hit;
}

uint32_t tracer_distance16(const tracer *t, ray_packet *p, uint32_t active, bool coherent)
{
    struct RTCRayHit16 r;
    memcpy(&r.ray, p, sizeof r.ray);
    memset(&r.hit, 0xff, sizeof r.hit); /* invalid ids */
    uint32_t hit = intersect16(t, t->top, &r, active, coherent);
    memcpy(p->tfar, r.ray.tfar, sizeof p->tfar);
    return hit;
}

static void init_with(ray_packet *p, uint32_t mask)
{
    memset(p, 0, sizeof *p);
    for (int i = 0; i < TRACER_PACKET; i++)
        p->mask[i] = mask;
}

void packet_init(ray_packet *p)
{
    init_with(p, MASK_OPAQUE);
}

void packet_init_solid(ray_packet *p)
{
    init_with(p, MASK_ALL);
}

/* Where 16 rays are not native: the same packet in parts of 8, 4 or 1, each with the layout of its width. */
static void occluded_in_parts(const tracer *t, ray_packet *p, uint32_t active, bool coherent)
{
    int w = t->width;
    for (int first = 0; first < TRACER_PACKET; first += w) {
        _Alignas(64) float part[12 * 8];
        _Alignas(64) int valid[8];
        const char *from = (const char *)p + (size_t)first * sizeof(float);
        if (!(active >> first & ((1u << w) - 1u)))
            continue;
        for (int i = 0; i < 12; i++)
            memcpy(part + i * w, from + (size_t)i * sizeof p->org_x, (size_t)w * sizeof(float));
        for (int i = 0; i < w; i++)
            valid[i] = active >> (first + i) & 1u ? -1 : 0;
        if (w == 8)
            embree_occluded8(valid, t->top, (struct RTCRay8 *)(void *)part, coherent);
        else if (w == 4)
            embree_occluded4(valid, t->top, (struct RTCRay4 *)(void *)part, coherent);
        else
            embree_occluded1(t->top, (struct RTCRay *)(void *)part);
        memcpy(p->tfar + first, part + 8 * w, (size_t)w * sizeof(float));
    }
}

uint32_t tracer_occluded16(const tracer *t, ray_packet *p, uint32_t active, bool coherent)
{
    uint32_t blocked = 0;
    coherent = coherent && !t->instanced; /* Embree 3.13.5 never returns from some coherent packets in instances */
    if (t->width == TRACER_PACKET) {
        _Alignas(64) int valid[TRACER_PACKET];
        for (uint32_t i = 0; i < TRACER_PACKET; i++)
            valid[i] = -(int)(active >> i & 1u);
        embree_occluded16(valid, t->top, (struct RTCRay16 *)(void *)p, coherent);
    } else {
        occluded_in_parts(t, p, active, coherent);
    }
    for (uint32_t i = 0; i < TRACER_PACKET; i++)
        blocked |= (uint32_t)(p->tfar[i] == -INFINITY) << i;
    return blocked & active;
}
