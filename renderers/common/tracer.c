/* SPDX-License-Identifier: Apache-2.0 */
/* Embree behind tracer.h: geometry set-up, queries, and the reconstruction of the surface that was hit. */
#include "tracer.h"

#include "embree_compat.h"
#include "triangle.h"

#include <float.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#if defined(__SSE__)
#include <xmmintrin.h>
#endif

/* Scenes up to this size are flattened altogether: a single level traces faster, and 4 M triangles fit anywhere. */
#define MAX_FLATTENED 4000000u

/* Ray masks: shadow rays pass through dielectrics. */
#define MASK_OPAQUE 1u
#define MASK_DIELECTRIC 2u

/* Positions, and Embree's own differences of them, are good to a few ulp of the largest coordinate involved;
 * 8 ulp leave room for the sum of them all. */
#define ERROR_SCALE 0x1p-20f

/* Shading normals are bent until they face both the geometric normal and the viewer by at least this cosine. */
#define MIN_SHADING_COSINE 0.01f

typedef struct placement {
    bool mirrored;
    /* Position error of Embree instances: ERROR_SCALE * (condition * world coordinates + stretch * object coordinates).
     * For flattened ones condition = 1, stretch = 0. */
    float condition, stretch, translation;
} placement;

struct tracer {
    const scene *scene;
    RTCDevice device;
    RTCScene top;
    RTCScene emitters;     /* NULL: none */
    RTCScene *prototypes;  /* per mesh; NULL: flattened */
    placement *placements; /* per instance */
    int width;             /* widest native packet: 16, 8, 4 or 1 */
    bool instanced;        /* some mesh is an Embree instance */
    char error[256];       /* first thing Embree complained about */
};

_Static_assert(sizeof(ray_packet) == sizeof(struct RTCRay16), "ray_packet must be Embree's RTCRay16");
_Static_assert(offsetof(ray_packet, tfar) == offsetof(struct RTCRay16, tfar), "ray_packet must be Embree's RTCRay16");
_Static_assert(offsetof(ray_packet, flags) == offsetof(struct RTCRay16, flags), "ray_packet must be Embree's RTCRay16");

/* --- Building --- */

static void on_error(void *user, enum RTCError code, const char *text)
{
    tracer *t = user;
    if (t->error[0])
        return;
    if (code == RTC_ERROR_OUT_OF_MEMORY)
        snprintf(t->error, sizeof t->error, "out of memory");
    else
        snprintf(t->error, sizeof t->error, "%s (error %d)", text ? text : "unknown failure", (int)code);
}

static double norm3x3(const double m[9])
{
    double sum = 0.0;
    for (int i = 0; i < 9; i++)
        sum += m[i] * m[i];
    return sqrt(sum);
}

/* An Embree instance transforms the ray by a rounded inverse M' and meets the triangle in object space. Seen from the
 * world that moves the triangle by |M| |M'| ulps of the coordinates transformed, and the inverse itself is rounded. */
static placement place(const float m[12], bool instanced)
{
    placement p = {.mirrored = transform_mirrors(m), .condition = 1.0f};
    if (!instanced)
        return p;
    double a[9], c[9];
    for (int i = 0; i < 9; i++)
        a[i] = m[4 * (i / 3) + i % 3];
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 3; k++) {
            int r1 = (r + 1) % 3, r2 = (r + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            c[3 * r + k] = a[3 * r1 + k1] * a[3 * r2 + k2] - a[3 * r1 + k2] * a[3 * r2 + k1];
        }
    double det = a[0] * c[0] + a[1] * c[1] + a[2] * c[2], norm = norm3x3(a);
    double rounding = norm * norm3x3(c) / fabs(det);
    p.condition = (float)(1.0 + rounding);
    p.stretch = (float)norm;
    p.translation = float_max(fabsf(m[3]), float_max(fabsf(m[7]), fabsf(m[11])));
    return p;
}

/* Emitters stand in two scenes, by the same geometry. */
static void attach(const tracer *t, RTCScene to, RTCGeometry g, unsigned id, const mesh *m)
{
    const material *made_of = &t->scene->materials[m->material];
    bool glass = made_of->kind == MATERIAL_DIELECTRIC;
    rtcSetGeometryMask(g, glass ? MASK_DIELECTRIC : MASK_OPAQUE);
    rtcCommitGeometry(g);
    rtcAttachGeometryByID(to, g, id);
    if (to == t->top && t->emitters && !glass && luminance(made_of->emission) > 0.0f)
        rtcAttachGeometryByID(t->emitters, g, id);
    rtcReleaseGeometry(g);
}

static bool emits(const scene *s)
{
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const material *m = &s->materials[s->meshes[s->instances[i].mesh].material];
        if (m->kind != MATERIAL_DIELECTRIC && luminance(m->emission) > 0.0f)
            return true;
    }
    return false;
}

/* The mesh under `to_world` as a triangle geometry. Embree's own vertex buffer: a shared one needs padding. */
static bool add_triangles(tracer *t, RTCScene to, unsigned id, const mesh *m, const float to_world[12])
{
    RTCGeometry g = rtcNewGeometry(t->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float *v =
        g ? rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), m->vertex_count)
          : NULL;
    if (!v) {
        if (g)
            rtcReleaseGeometry(g);
        return false;
    }
    for (size_t i = 0; i < m->vertex_count; i++) {
        const float *q = m->positions + 3 * i;
        vec3 p = transform_point(to_world, v3(q[0], q[1], q[2]));
        v[3 * i] = p.x;
        v[3 * i + 1] = p.y;
        v[3 * i + 2] = p.z;
    }
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, m->indices, 0, 3 * sizeof(uint32_t),
                               m->triangle_count);
    attach(t, to, g, id, m);
    return true;
}

/* Medium quality, and not "robust". Measured with 16-wide shadow rays in four scenes, high quality is within 7 % either
 * way and builds 2 to 3 times longer; robust costs 10 to 20 % and closes the edges through which 4 rays in 1e6 slip. */
static RTCScene new_scene(tracer *t)
{
    RTCScene s = rtcNewScene(t->device);
    if (s)
        rtcSetSceneBuildQuality(s, RTC_BUILD_QUALITY_MEDIUM);
    return s;
}

static bool add_instance(tracer *t, unsigned id, const instance *in)
{
    const mesh *m = &t->scene->meshes[in->mesh];
    RTCScene *prototype = &t->prototypes[in->mesh];
    if (!*prototype) {
        *prototype = new_scene(t);
        if (!*prototype || !add_triangles(t, *prototype, 0, m, transform_identity))
            return false;
        rtcCommitScene(*prototype);
    }
    RTCGeometry g = rtcNewGeometry(t->device, RTC_GEOMETRY_TYPE_INSTANCE);
    if (!g)
        return false;
    rtcSetGeometryInstancedScene(g, *prototype);
    rtcSetGeometryTransform(g, 0, RTC_FORMAT_FLOAT3X4_ROW_MAJOR, in->to_world);
    attach(t, t->top, g, id, m);
    return true;
}

/* Geometry ids of the top scene are the scene's instance indices. */
static bool build(tracer *t)
{
    const scene *s = t->scene;
    uint64_t flattened = 0;
    uint32_t *uses = xcalloc(s->mesh_count, sizeof *uses);
    bool ok = true;
    for (uint32_t i = 0; i < s->instance_count; i++) {
        uses[s->instances[i].mesh]++;
        flattened += s->meshes[s->instances[i].mesh].triangle_count;
    }
    for (uint32_t i = 0; ok && i < s->instance_count; i++) {
        const instance *in = &s->instances[i];
        bool instanced = flattened > MAX_FLATTENED && uses[in->mesh] > 1;
        t->placements[i] = place(in->to_world, instanced);
        t->instanced |= instanced;
        ok = instanced ? add_instance(t, i, in) : add_triangles(t, t->top, i, &s->meshes[in->mesh], in->to_world);
    }
    free(uses);
    if (ok)
        rtcCommitScene(t->top);
    if (ok && t->emitters)
        rtcCommitScene(t->emitters);
    return ok && !t->error[0];
}

bool tracer_create(const scene *s, int threads, tracer **out, message *err)
{
    char config[32] = "";
    tracer *t = xcalloc(1, sizeof *t);
    *out = NULL;
    t->scene = s;
    t->prototypes = xcalloc(s->mesh_count, sizeof *t->prototypes);
    t->placements = xcalloc(s->instance_count, sizeof *t->placements);
    if (threads > 0)
        snprintf(config, sizeof config, "threads=%d", threads);
    t->device = rtcNewDevice(config);
    if (!t->device) {
        tracer_free(t);
        return fail(err, "Embree: no device (error %d)", (int)rtcGetDeviceError(NULL));
    }
    rtcSetDeviceErrorFunction(t->device, on_error, t);
    if (!rtcGetDeviceProperty(t->device, RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED)) {
        tracer_free(t);
        return fail(err, "Embree: this build has no ray masks (configure it with EMBREE_RAY_MASK)");
    }
    t->width = rtcGetDeviceProperty(t->device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)  ? 16
               : rtcGetDeviceProperty(t->device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8
               : rtcGetDeviceProperty(t->device, RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED) ? 4
                                                                                            : 1;
    t->top = new_scene(t);
    bool glows = emits(s);
    if (glows)
        t->emitters = new_scene(t);
    if (!t->top || (glows && !t->emitters) || !build(t)) {
        fail(err, "Embree: %s", t->error[0] ? t->error : "cannot build the scene");
        tracer_free(t);
        return false;
    }
    *out = t;
    return true;
}

void tracer_free(tracer *t)
{
    if (!t)
        return;
    if (t->top)
        rtcReleaseScene(t->top);
    if (t->emitters)
        rtcReleaseScene(t->emitters);
    for (uint32_t i = 0; i < t->scene->mesh_count; i++)
        if (t->prototypes[i])
            rtcReleaseScene(t->prototypes[i]);
    if (t->device)
        rtcReleaseDevice(t->device);
    free(t->prototypes);
    free(t->placements);
    free(t);
}

void tracer_thread_init(void)
{
#if defined(__SSE__)
    _mm_setcsr(_mm_getcsr() | 0x8040u); /* FTZ, DAZ */
#endif
}

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

static void fill_surface(const tracer *t, const struct RTCRayHit *r, surface *h)
{
    const scene *s = t->scene;
    bool instanced = r->hit.instID[0] != RTC_INVALID_GEOMETRY_ID;
    float u = r->hit.u, v = r->hit.v, area;
    vec3 p[3], direction = v3(r->ray.dir_x, r->ray.dir_y, r->ray.dir_z);
    h->instance = instanced ? r->hit.instID[0] : r->hit.geomID;
    h->primitive = r->hit.primID;
    h->mesh = s->instances[h->instance].mesh;
    h->distance = r->ray.tfar;
    h->wo = v3_neg(direction);

    const mesh *m = &s->meshes[h->mesh];
    const placement *at = &t->placements[h->instance];
    const uint32_t *index = m->indices + 3 * (size_t)h->primitive;
    triangle_corners(s, h->instance, h->primitive, p);
    h->position = interpolate(p, u, v);
    h->position_error = float_max(largest(p[0]), float_max(largest(p[1]), largest(p[2])));
    if (instanced) {
        float object = 0.0f;
        for (int k = 0; k < 3; k++)
            for (size_t i = 0; i < 3; i++)
                object = float_max(object, fabsf(m->positions[3 * (size_t)index[k] + i]));
        h->position_error = at->condition * (h->position_error + at->translation) + at->stretch * object;
    }
    h->position_error = ERROR_SCALE * h->position_error + FLT_MIN;

    h->geometric_normal = triangle_normal(p, &area);
    if (at->mirrored)
        h->geometric_normal = v3_neg(h->geometric_normal);
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
    fill_surface(t, &r, hit);
    return true;
}

bool tracer_closest(const tracer *t, vec3 origin, vec3 direction, surface *hit)
{
    return closest(t, t->top, origin, direction, MASK_OPAQUE | MASK_DIELECTRIC, hit);
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

bool tracer_occluded(const tracer *t, vec3 origin, vec3 direction, float tfar)
{
    struct RTCRay r = make_ray(origin, direction, tfar, MASK_OPAQUE);
    embree_occluded1(t->top, &r);
    return r.tfar == -INFINITY;
}

/* The lanes that hit, of rays already in Embree's layout. */
static uint32_t intersect16(const tracer *t, RTCScene in, struct RTCRayHit16 *r, uint32_t active)
{
    enum { FIELDS = sizeof *r / (TRACER_PACKET * sizeof(float)) };
    _Alignas(64) int valid[TRACER_PACKET];
    bool coherent = !t->instanced;
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

uint32_t tracer_closest16(const tracer *t, const ray_packet *p, uint32_t active, surface hits[TRACER_PACKET])
{
    struct RTCRayHit16 r;
    memcpy(&r.ray, p, sizeof r.ray);
    memset(&r.hit, 0xff, sizeof r.hit); /* invalid ids */
    for (uint32_t i = 0; i < TRACER_PACKET; i++)
        r.ray.mask[i] = MASK_OPAQUE | MASK_DIELECTRIC;
    uint32_t hit = intersect16(t, t->top, &r, active);
    for (uint32_t lanes = hit; lanes; lanes &= lanes - 1) {
        uint32_t i = (uint32_t)__builtin_ctz(lanes);
        struct RTCRayHit one = {
            .ray = {.dir_x = p->dir_x[i], .dir_y = p->dir_y[i], .dir_z = p->dir_z[i], .tfar = r.ray.tfar[i]},
            .hit = {.u = r.hit.u[i], .v = r.hit.v[i], .primID = r.hit.primID[i], .geomID = r.hit.geomID[i]}};
        one.hit.instID[0] = r.hit.instID[0][i];
        fill_surface(t, &one, &hits[i]);
    }
    return hit;
}

void packet_init(ray_packet *p)
{
    memset(p, 0, sizeof *p);
    for (int i = 0; i < TRACER_PACKET; i++)
        p->mask[i] = MASK_OPAQUE;
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
