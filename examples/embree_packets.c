/* SPDX-License-Identifier: Apache-2.0 */
/* A host with Embree: 64 hits at a time ask for all of their lamps, and what the cache does not know goes out in
 * packets of 16 rays. */
#include "../renderers/common/embree_compat.h"
#include "host.h"
#include <string.h>

enum { BATCH = 64, WORDS = (LAMPS + 63) / 64 };

static RTCScene build(RTCDevice device)
{
    RTCScene scene = rtcNewScene(device);
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_SPHERE_POINT);
    float *p = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof *p, BALLS);
    for (int i = 0; i < BALLS; i++) {
        p[4 * i] = balls[i].center.x, p[4 * i + 1] = balls[i].center.y, p[4 * i + 2] = balls[i].center.z;
        p[4 * i + 3] = balls[i].radius;
    }
    rtcCommitGeometry(g);
    rtcAttachGeometry(scene, g);
    rtcReleaseGeometry(g);
    rtcCommitScene(scene);
    return scene;
}

/* The callback gets all misses of a batch: full packets, whatever pixel they come from. */
static bool trace_packets(void *context, const vcache_miss *rays, size_t count, vcache_answer *answers)
{
    for (size_t first = 0; first < count; first += 16) {
        struct RTCRay16 packet;
        memset(&packet, 0, sizeof packet);
        _Alignas(64) int valid[16] = {0};
        size_t n = count - first < 16 ? count - first : 16;
        for (size_t k = 0; k < n; k++) {
            const vcache_miss *m = &rays[first + k];
            vec o = at(m->eye_position), d = sub(at(m->light_position), o);
            packet.org_x[k] = o.x, packet.org_y[k] = o.y, packet.org_z[k] = o.z;
            packet.dir_x[k] = d.x, packet.dir_y[k] = d.y, packet.dir_z[k] = d.z;
            packet.tnear[k] = 1e-3f, packet.tfar[k] = 1.0f;
            packet.mask[k] = ~0u;
            valid[k] = -1;
        }
        embree_occluded16(valid, *(RTCScene *)context, &packet, false);
        for (size_t k = 0; k < n; k++)
            answers[first + k] = packet.tfar[k] >= 0.0f; /* minus infinity where something was hit */
    }
    return true;
}

typedef struct eye_sample {
    int pixel;
    float light[LAMPS]; /* unoccluded */
    uint64_t asked[WORDS], visible[WORDS];
    uint64_t end[VCACHE_EYE_BYTES / 8];
} eye_sample;

static void finish(eye_sample *batch, int count, vcache_worker *worker, RTCScene *scene, float *image)
{
    vcache_resolve(worker, trace_packets, scene);
    for (int b = 0; b < count; b++)
        for (int i = 0; i < LAMPS; i++)
            if (batch[b].asked[i / 64] & batch[b].visible[i / 64] & (uint64_t)1 << i % 64)
                image[batch[b].pixel] += batch[b].light[i] / SAMPLES;
}

static void render(vcache *cache, vcache_worker *worker, const vcache_light *lamps, RTCScene *scene, float *image)
{
    static eye_sample batch[BATCH];
    int count = 0;
    for (int i = 0; i < PIXELS * SAMPLES; i++) {
        hit h;
        if (!see(i / SAMPLES, i % SAMPLES, 0.0f, &h))
            continue;
        eye_sample *e = &batch[count++];
        *e = (eye_sample){.pixel = i / SAMPLES};
        for (int l = 0; l < LAMPS; l++) {
            e->light[l] = light_of(&h, l);
            e->asked[l / 64] |= (uint64_t)(e->light[l] > 0.0f) << l % 64;
        }
        vcache_surface surface = surface_of(&h, SAMPLES);
        vcache_prepare_eye(cache, &surface, 8.0f, 0, (vcache_eye *)e->end);
        for (uint32_t next = 0; next < LAMPS;) { /* a full batch is resolved, then it goes on */
            next = vcache_add(worker, (vcache_eye *)e->end, lamps, next, LAMPS, e->asked, e->visible);
            if (next < LAMPS)
                vcache_resolve(worker, trace_packets, scene);
        }
        if (count == BATCH) {
            finish(batch, count, worker, scene, image);
            count = 0;
        }
    }
    finish(batch, count, worker, scene, image);
}

int main(void)
{
    static float image[PIXELS], exact[PIXELS];
    make_scene(0.0f);
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = build(device);
    vcache_config config = config_of_scene();
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    vcache_bundle_lights(cache, lamps, LAMPS); /* they are always asked for together */
    vcache_worker *worker = make_worker(cache, false), *exact_worker = make_worker(cache, true);
    render(cache, exact_worker, lamps, &scene, exact);
    render(cache, worker, lamps, &scene, image);
    vcache_statistics s = statistics_of(worker);
    print_figures("", s.asked, s.traced, image_error(image, exact, PIXELS));
    vcache_worker_destroy(&worker);
    vcache_worker_destroy(&exact_worker);
    free(lamps);
    vcache_destroy(&cache);
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
    return 0;
}
