/* SPDX-License-Identifier: Apache-2.0 */
/* Scattering at a surface point. All directions are unit, point away from the surface; all calls are pure. */
#ifndef COMMON_MATERIAL_H
#define COMMON_MATERIAL_H

#include "rng.h"
#include "scene.h"

/* A surface point as a ray sees it. */
typedef struct surface {
    vec3 position;
    vec3 geometric_normal; /* unit, on the side of the arriving ray */
    vec3 normal;           /* shading normal, unit, in the hemisphere of geometric_normal */
    vec3 wo;               /* unit, back along the arriving ray */
    float distance;        /* of the arriving ray */
    float position_error;  /* bound on the error of `position`, scene units: offset rays by it along the normal */
    float u, v;            /* texture coordinates */
    bool back_side;        /* the ray arrived from the side opposite to the triangle's own normal */
    uint32_t mesh, primitive, instance;
    const material *material;
    rgb color; /* material->color times texture */
} surface;

/* True for perfect mirrors and glass, which only scatter into discrete directions. */
bool material_is_specular(const material *m);

/* Non-specular part f(wi, wo), 1/sr, without the cosine; 0 for directions below either normal. */
rgb material_eval(const surface *s, vec3 wi);
/* Density per steradian of material_sample for a non-specular wi. */
float material_pdf(const surface *s, vec3 wi);
/* Both in one. */
rgb material_eval_pdf(const surface *s, vec3 wi, float *pdf);
/* Draws a non-specular wi; returns f cos / pdf, and 0 with *pdf = 0 where nothing can be drawn. */
rgb material_sample(const surface *s, float u1, float u2, float u3, vec3 *wi, float *pdf);

/* The discrete branches of a specular material: up to two (reflection, refraction) with their weights. Returns how
 * many. `eta` of a branch is the ratio of the index on the far side to the near side for a refraction, 1 for a
 * reflection. */
typedef struct specular_branch {
    vec3 wi;
    rgb weight;
    bool transmitted;
    float eta;
} specular_branch;
int material_specular(const surface *s, specular_branch branches[2]);
/* Draws one of the branches in proportion to the luminance of its weight; takes a random number only where there are
 * two. Multiplies *throughput by that weight over the branch's probability (out->weight stays what material_specular
 * says). False where nothing goes on. */
bool material_specular_sample(const surface *s, rng *r, rgb *throughput, specular_branch *out);

/* The Lambertian albedo (0 for conductors and dielectrics): what a virtual point light there scatters with. */
rgb material_diffuse_albedo(const surface *s);
/* Hemispherical reflectance estimate in [0, 1], for Russian roulette. */
float material_reflectance(const surface *s);
rgb texture_lookup(const texture *t, float u, float v);

#endif
