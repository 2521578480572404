/* SPDX-License-Identifier: Apache-2.0 */
/* Emissive triangles of a scene as one area light, drawn in proportion to their power. Read-only: shared by threads. */
#ifndef COMMON_EMITTERS_H
#define COMMON_EMITTERS_H

#include "material.h"
#include "scene.h"

typedef struct emitters emitters;

typedef struct emitter_sample {
    vec3 position, normal; /* world space, unit; of the emitting side drawn, of two-sided ones each half of the time */
    rgb radiance;
    float pdf_area; /* density per unit area and side */
} emitter_sample;

/* NULL where nothing in the scene emits. */
emitters *emitters_new(const scene *s);
void emitters_free(emitters *e);
uint32_t emitters_count(const emitters *e); /* triangles; 0 for NULL */
float emitters_power(const emitters *e);    /* luminance of the flux, W; 0 for NULL */
emitter_sample emitters_sample(const emitters *e, float u1, float u2, float u3);
/* Its position, moved a few ulp of the largest coordinate off the surface: end of shadow rays, start of light paths. */
static inline vec3 emitter_offset(const emitter_sample *s)
{
    vec3 a = v3(fabsf(s->position.x), fabsf(s->position.y), fabsf(s->position.z));
    return v3_mad(s->position, 0x1p-19f * v3_max_component(a), s->normal);
}
/* Density per unit area and side with which emitters_sample draws the point hit; 0 where that side does not emit. */
float emitters_pdf_area(const emitters *e, const surface *hit);
/* Radiance that leaves the hit towards hit->wo. */
rgb surface_emission(const surface *hit);

#endif
