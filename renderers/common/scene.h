/* SPDX-License-Identifier: Apache-2.0 */
/* What a renderer sees of a scene: triangle meshes, instances, materials, lights, cameras.
 * Filled by scene_load (files, scene_import.c) or scene_builtin (generated, builtin_*.c); then scene_finish checks it.
 * A finished scene is read-only and may be shared by threads. */
#ifndef COMMON_SCENE_H
#define COMMON_SCENE_H

#include "environment.h"
#include "message.h"
#include "vec.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum material_kind {
    MATERIAL_DIFFUSE,    /* Lambertian, albedo `color` */
    MATERIAL_CONDUCTOR,  /* GGX metal, reflectance `color` at normal incidence (Schlick); a mirror at roughness 0 */
    MATERIAL_DIELECTRIC, /* smooth glass, index `ior`, tinted by `color`; shadow rays pass it unattenuated */
    MATERIAL_GLOSSY      /* Lambertian `color` under a GGX coat of index `ior` */
} material_kind;

typedef struct material {
    material_kind kind;
    rgb color;
    float roughness; /* 0 ... 1; GGX alpha = roughness^2 */
    float ior;       /* > 1 */
    rgb emission;    /* radiance, W / (sr m^2) */
    bool two_sided;  /* emits from the back as well (glTF doubleSided) */
    int32_t texture; /* index into scene.textures that multiplies `color`, or -1 */
} material;

/* 8-bit sRGB, row 0 at v = 0, repeated outside [0, 1). */
typedef struct texture {
    uint32_t width, height;
    uint8_t *rgba; /* 4 * width * height */
} texture;

typedef struct mesh {
    uint32_t vertex_count, triangle_count;
    float *positions;  /* 3 * vertex_count, object space */
    float *normals;    /* 3 * vertex_count or NULL: flat */
    float *uvs;        /* 2 * vertex_count or NULL */
    uint32_t *indices; /* 3 * triangle_count */
    uint32_t material;
} mesh;

typedef struct instance {
    uint32_t mesh;
    float to_world[12]; /* row-major 3 x 4; may mirror and shear */
} instance;

typedef enum light_kind { LIGHT_POINT, LIGHT_SPOT, LIGHT_DIRECTIONAL } light_kind;

#define LIGHT_POWER_MAX 31
/* Lights and cameras lie no farther from the origin: rays are ended by Embree where squares leave float's range. */
#define SCENE_MAX_DISTANCE 1e12f

typedef struct light {
    light_kind kind;
    vec3 position;              /* point, spot */
    vec3 direction;             /* spot, directional: unit, the way the light travels */
    rgb intensity;              /* point, spot: W / sr; directional: irradiance W / m^2 on a facing surface */
    float cos_inner, cos_outer; /* spot: full inside the inner cone, none outside the outer */
    /* Spot: of the ramp between the cones (spot_fall_off), at most LIGHT_POWER_MAX; 0: 2, as KHR_lights_punctual has
     * it. With cones of 0 and 90 degrees a cosine-power emitter, diffuse at 1. */
    uint32_t power;
} light;

typedef struct camera {
    char name[64];
    vec3 eye, forward, up; /* forward, up: unit, perpendicular; right = forward x up */
    float yfov;            /* radians, full vertical angle */
} camera;

typedef struct scene {
    char name[64];
    char *path; /* of the file as the user gave it, for messages; NULL: generated */
    mesh *meshes;
    uint32_t mesh_count;
    instance *instances;
    uint32_t instance_count;
    material *materials;
    uint32_t material_count;
    texture *textures;
    uint32_t texture_count;
    light *lights;
    uint32_t light_count;
    camera *cameras;
    uint32_t camera_count;
    environment *environment; /* owned; NULL: black */
    /* filled by scene_finish */
    vec3 bounds_min, bounds_max; /* world space */
    uint64_t triangle_count;     /* with instances counted as often as they stand */
} scene;

scene *scene_new(const char *name); /* empty; never NULL (exits on lack of memory, as all small allocations here) */
void scene_free(scene *s);          /* NULL is fine */

/* Each takes ownership of the arrays inside and returns the new index. */
uint32_t scene_add_mesh(scene *s, mesh m);
uint32_t scene_add_instance(scene *s, instance i);
uint32_t scene_add_material(scene *s, material m);
uint32_t scene_add_texture(scene *s, texture t);
uint32_t scene_add_light(scene *s, light l);
uint32_t scene_add_camera(scene *s, camera c);

extern const float transform_identity[12];
vec3 transform_point(const float m[12], vec3 p);
vec3 transform_vector(const float m[12], vec3 v);
vec3 transform_normal(const float m[12], vec3 n); /* by the inverse transpose; not normalised */
camera camera_look(vec3 eye, vec3 at, vec3 up, float yfov);

/* Reads glTF 2.0 (.gltf, .glb), .obj or .ply. On failure *out is NULL and err says in one line what is wrong. */
bool scene_load(const char *path, scene **out, message *err);

/* Generated scenes by name; false for an unknown name. conference-lights also takes a number of lights
 * (builtin.h). */
bool scene_builtin(const char *name, scene **out);
extern const char *const scene_builtin_names[]; /* NULL-terminated */

/* Checks and completes: indices in range, positions finite, at least one triangle with area (zero-area ones are
 * dropped with a notice); bounds and counts; a camera that frames the bounds and a uniform sky where none is there,
 * each with a notice. Call once, after the environment was set. */
bool scene_finish(scene *s, message *err);

/* malloc/realloc/calloc that print one line and exit(1) when memory runs out. */
void *xmalloc(size_t bytes);
void *xcalloc(size_t count, size_t bytes);
void *xrealloc(void *p, size_t bytes);

#endif
