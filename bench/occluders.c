/* SPDX-License-Identifier: Apache-2.0 */
#include "occluders.h"

#include "renderers/common/embree_compat.h"
#include "renderers/common/triangle.h"

#include <string.h>

struct occluders {
    RTCDevice device;
    RTCScene top;
    float *corners; /* [triangles][3][3] */
    uint32_t blocker[TRACER_PACKET];
};

/* Every hit is accepted, which ends the ray. Rays and hits of N lanes lie as one array of N a member; Embree's
 * accessors are for C++ alone. */
static void take_down(const struct RTCFilterFunctionNArguments *a)
{
    enum { RAY_ID = 10, HIT_PRIMITIVE = 5 };
    occluders *o = a->geometryUserPtr;
    const uint32_t *rays = (const uint32_t *)(const void *)a->ray, *hits = (const uint32_t *)(const void *)a->hit;
    for (unsigned i = 0; i < a->N; i++)
        if (a->valid[i])
            o->blocker[rays[RAY_ID * a->N + i]] = hits[HIT_PRIMITIVE * a->N + i];
}

bool occluders_new(const scene *s, bool reporting, occluders **out, message *err)
{
    occluders *o = xcalloc(1, sizeof *o);
    uint64_t count = 0;
    o->corners = xmalloc((s->triangle_count + 1) * 9 * sizeof *o->corners);
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const mesh *m = &s->meshes[s->instances[i].mesh];
        for (uint32_t k = 0; k < m->triangle_count && s->materials[m->material].kind != MATERIAL_DIELECTRIC; k++) {
            vec3 p[3];
            triangle_corners(s, i, k, p);
            memcpy(o->corners + 9 * count++, p, sizeof p);
        }
    }
    *out = o;
    o->device = rtcNewDevice("threads=1");
    RTCGeometry g = o->device ? rtcNewGeometry(o->device, RTC_GEOMETRY_TYPE_TRIANGLE) : NULL;
    float *v = NULL;
    uint32_t *index = NULL;
    if (g) {
        v = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof *v, 3 * count);
        index = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof *index, count);
    }
    if (!v || !index)
        return fail(err, "Embree: cannot make a mesh of %llu triangles", (unsigned long long)count);
    memcpy(v, o->corners, 9 * count * sizeof *v);
    for (uint64_t i = 0; i < 3 * count; i++)
        index[i] = (uint32_t)i;
    rtcSetGeometryMask(g, 1);
    rtcSetGeometryUserData(g, o);
    if (reporting)
        rtcSetGeometryOccludedFilterFunction(g, take_down);
    rtcCommitGeometry(g);
    o->top = rtcNewScene(o->device);
    rtcSetSceneBuildQuality(o->top, RTC_BUILD_QUALITY_MEDIUM); /* as the renderer's */
    rtcAttachGeometry(o->top, g);
    rtcReleaseGeometry(g);
    rtcCommitScene(o->top);
    return true;
}

void occluders_free(occluders *o)
{
    if (!o)
        return;
    if (o->top)
        rtcReleaseScene(o->top);
    if (o->device)
        rtcReleaseDevice(o->device);
    free(o->corners);
    free(o);
}

bool occluders_ray(occluders *o, vec3 origin, vec3 direction, float tfar)
{
    struct RTCRay r = {.org_x = origin.x,
                       .org_y = origin.y,
                       .org_z = origin.z,
                       .dir_x = direction.x,
                       .dir_y = direction.y,
                       .dir_z = direction.z,
                       .tfar = tfar,
                       .mask = 1};
    embree_occluded1(o->top, &r);
    return r.tfar == -INFINITY;
}

uint32_t occluders_packet(occluders *o, ray_packet *p, uint32_t active)
{
    _Alignas(64) int valid[TRACER_PACKET];
    uint32_t blocked = 0;
    for (uint32_t i = 0; i < TRACER_PACKET; i++)
        valid[i] = -(int)(active >> i & 1u);
    embree_occluded16(valid, o->top, (struct RTCRay16 *)(void *)p, false);
    for (uint32_t i = 0; i < TRACER_PACKET; i++)
        blocked |= (uint32_t)(p->tfar[i] == -INFINITY) << i;
    return blocked & active;
}

uint32_t occluders_blocker(const occluders *o, uint32_t lane)
{
    return o->blocker[lane];
}

void occluders_remember(const occluders *o, uint32_t triangle, remembered *out)
{
    vec3 p[3];
    memcpy(p, o->corners + 9 * (size_t)triangle, sizeof p);
    *out = (remembered){p[0], {v3_sub(p[1], p[0]), v3_sub(p[2], p[0])}, 1};
}
