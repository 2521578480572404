/* SPDX-License-Identifier: Apache-2.0 */
/* Ray casting by Embree. One tracer per scene; all queries may run from any number of threads. */
#ifndef COMMON_TRACER_H
#define COMMON_TRACER_H

#include "material.h"
#include "scene.h"

#include <stdbool.h>
#include <stdint.h>

#define TRACER_PACKET 16

typedef struct tracer tracer;

/* 16 shadow rays, one array a component. Directions need not be unit: t counts in their length. */
typedef struct ray_packet {
    _Alignas(64) float org_x[TRACER_PACKET];
    float org_y[TRACER_PACKET], org_z[TRACER_PACKET], tnear[TRACER_PACKET];
    float dir_x[TRACER_PACKET], dir_y[TRACER_PACKET], dir_z[TRACER_PACKET], time[TRACER_PACKET];
    float tfar[TRACER_PACKET];
    uint32_t mask[TRACER_PACKET], id[TRACER_PACKET], flags[TRACER_PACKET];
} ray_packet;

/* Builds the acceleration structure. Meshes that stand once are flattened into world space; those that stand more often
 * become Embree instances where that saves memory. The scene must outlive the tracer. */
bool tracer_create(const scene *s, int threads, tracer **out, message *err);
void tracer_free(tracer *t);

/* Call once in each thread that traces: flushes denormals to zero (x86; else nothing), as Embree asks for speed. */
void tracer_thread_init(void);

/* Nearest hit of origin + t direction, 0 < t < tfar; direction unit. Sees all surfaces. */
bool tracer_closest(const tracer *t, vec3 origin, vec3 direction, surface *hit);
/* The same for the lanes of `active`; returns the mask of lanes that hit. Directions unit; the rest of `p` as below.
 * `coherent`: the rays run close together, as those of neighbouring pixels. */
uint32_t tracer_closest16(const tracer *t, const ray_packet *p, uint32_t active, bool coherent,
                          surface hits[TRACER_PACKET]);
/* The same through dielectrics, as shadow rays go. */
bool tracer_closest_opaque(const tracer *t, vec3 origin, vec3 direction, surface *hit);

/* The same as if emitters were all there is (dielectric ones, which tracer_closest_opaque does not see, are not
 * either). Where this misses, no emitter is hit; a hit counts if nothing is in front of it. */
bool tracer_closest_emitter(const tracer *t, vec3 origin, vec3 direction, surface *hit);
/* How far a shadow ray along the same direction may go so that the surface hit does not block it itself. */
float surface_reach(const surface *hit);

/* Shadow rays: surfaces of dielectrics do not block. True where something lies in (0, tfar). */
bool tracer_occluded(const tracer *t, vec3 origin, vec3 direction, float tfar);
/* The same with dielectrics blocking as all surfaces do. */
bool tracer_occluded_solid(const tracer *t, vec3 origin, vec3 direction, float tfar);

/* The same for the lanes of `active`; returns the mask of blocked lanes. tnear, mask, id, flags and time are set by
 * packet_init or packet_init_solid once: rays as of tracer_occluded, tracer_occluded_solid. `p` is unchanged but for
 * tfar of blocked lanes. */
void packet_init(ray_packet *p);
void packet_init_solid(ray_packet *p);
uint32_t tracer_occluded16(const tracer *t, ray_packet *p, uint32_t active, bool coherent);
/* Distances alone, of packets as of tracer_occluded16: tfar of the lanes that hit becomes theirs, in lengths of the
 * direction. Returns the mask of these lanes. */
uint32_t tracer_distance16(const tracer *t, ray_packet *p, uint32_t active, bool coherent);

/* `position` moved off the surface to the side of `toward` (any direction) so that no ray from there meets its own
 * triangle. */
vec3 surface_offset(const surface *s, vec3 toward);

#endif
