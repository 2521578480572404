/* SPDX-License-Identifier: Apache-2.0 */
/* Where light paths begin: emitters, punctual lights and the environment, one of them chosen in proportion to its
 * power. Read-only: shared by threads. */
#ifndef COMMON_LIGHT_SOURCES_H
#define COMMON_LIGHT_SOURCES_H

#include "emitters.h"
#include "scene.h"

typedef struct light_sources light_sources;

/* Spot lights are SOURCE_POINT. */
typedef enum light_source_kind {
    SOURCE_EMITTER,
    SOURCE_POINT,
    SOURCE_DIRECTIONAL,
    SOURCE_ENVIRONMENT
} light_source_kind;

/* Start of a light path: its first vertex y0 and a ray from it. */
typedef struct light_emission {
    light_source_kind kind;
    uint32_t light;         /* index into scene.lights; punctual ones */
    vec3 position;          /* of y0; SOURCE_DIRECTIONAL, _ENVIRONMENT: where the ray starts, outside of the scene */
    vec3 normal;            /* unit, of the emitting side; SOURCE_EMITTER alone, else 0 */
    vec3 origin, direction; /* of the ray, unit; the origin is off the emitter's surface */
    float cosine;           /* of direction with normal; 1 for all other kinds */
    rgb radiance;     /* EMITTER, ENVIRONMENT: radiance; POINT: intensity along direction; DIRECTIONAL: irradiance */
    float pdf_direct; /* density of y0: choice x per unit area (EMITTER), x 1 (POINT, DIRECTIONAL: discrete), x per
                         steradian (ENVIRONMENT) */
    float pdf_ray;    /* density of the ray: choice x per unit area x per steradian (EMITTER; ENVIRONMENT: area of the
                         disc), x per steradian (POINT), x per unit area of the disc (DIRECTIONAL) */
    rgb flux; /* radiance x cosine / pdf_ray: its mean over all draws (0 where there is none) is the power of all
                 sources, W */
} light_emission;

/* Of a finished scene. `e` may be NULL: none. `with_environment`: whether the scene's environment is one of them. Scene
 * and emitters must outlive the result, which is NULL where nothing emits. */
light_sources *light_sources_new(const scene *s, const emitters *e, bool with_environment);
void light_sources_free(light_sources *l); /* NULL is fine */
/* Whether floats hold the power of all; where not, none emits. */
bool light_sources_finite(const light_sources *l);

/* From six uniform numbers in [0, 1). False where nothing is emitted that way: `out` is undefined then. */
bool light_sources_emit(const light_sources *l, const float u[6], light_emission *out);

/* Densities with which light_sources_emit draws what an eye path found: the point hit (pdf_direct), and the ray from it
 * back along the path (pdf_ray). 0 where it does not. */
void light_sources_emitter_pdf(const light_sources *l, const surface *hit, float *direct, float *ray);
/* The same of the environment seen along unit `direction` (away from the scene). */
void light_sources_environment_pdf(const light_sources *l, vec3 direction, float *direct, float *ray);

/* What y0 sends towards unit `direction` (from it): radiance (EMITTER; 0 behind), intensity (POINT, with the spot's
 * fall-off), irradiance (DIRECTIONAL) or radiance (ENVIRONMENT), these two as they are. *pdf: the density per steradian
 * (EMITTER, POINT) with which light_sources_emit draws the direction, given y0; per unit area of the disc for
 * DIRECTIONAL and ENVIRONMENT. So pdf_direct x *pdf is pdf_ray. */
rgb light_sources_radiance(const light_sources *l, const light_emission *y0, vec3 direction, float *pdf);

/* Radius of the disc that rays of directional lights and the environment start from: that of the scene's bounding
 * sphere. */
float light_sources_disc_radius(const light_sources *l);

/* Fall-off of a spot light between its cones: a linear ramp of the cosine to light.power, its square in
 * KHR_lights_punctual. `direction` is the way the light travels, unit. */
static inline float spot_fall_off(const light *l, vec3 direction)
{
    float range = l->cos_inner - l->cos_outer, cosine = v3_dot(direction, l->direction);
    float ramp = range > 1e-6f ? (cosine - l->cos_outer) / range : cosine > l->cos_outer ? 1.0f : 0.0f;
    ramp = float_min(1.0f, float_max(0.0f, ramp));
    if (l->power == 0)
        return ramp * ramp;
    float out = 1.0f;
    for (uint32_t n = l->power; n; n >>= 1, ramp *= ramp)
        out *= n & 1u ? ramp : 1.0f;
    return out;
}

#endif
