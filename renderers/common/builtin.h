/* SPDX-License-Identifier: Apache-2.0 */
/* Private to builtin_*.c: triangle shapes, foliage and placement for the generated scenes. */
#ifndef COMMON_BUILTIN_H
#define COMMON_BUILTIN_H

#include "rng.h"
#include "scene.h"

/* A growing triangle mesh; start from {0}. Triangles run counter-clockwise seen from outside. */
typedef struct shape {
    float *positions;
    uint32_t *indices;
    uint32_t vertex_count, triangle_count, vertex_capacity, triangle_capacity;
} shape;

uint32_t shape_vertex(shape *s, vec3 p);
void shape_triangle(shape *s, uint32_t a, uint32_t b, uint32_t c);
void shape_quad(shape *s, uint32_t a, uint32_t b, uint32_t c, uint32_t d);
void shape_free(shape *s);

/* Closed solids, appended to what the shape holds. */
void shape_box(shape *s, vec3 lo, vec3 hi, float bevel); /* bevel 0: sharp edges */
void shape_sphere(shape *s, vec3 center, float radius, uint32_t segments);
void shape_torus(shape *s, float radius, float tube_radius, uint32_t segments, uint32_t tube_segments); /* around y */
/* Pipe along `count` >= 2 points with a radius at each, closed by flat ends. */
void shape_tube(shape *s, const vec3 *path, const float *radii, uint32_t count, uint32_t segments);
/* Wall piece |x| < half_width, 0 < y < height, |z| < depth with a round opening of radius `inner` around the origin. */
void shape_arch(shape *s, float inner, float half_width, float height, float depth, uint32_t segments);
/* Half ring over the origin between two radii, |z| < depth. */
void shape_half_ring(shape *s, float inner, float outer, float depth, uint32_t segments);

/* Outline (radius, y) of a lathed solid, from the axis at the bottom to the axis at the top. */
#define PROFILE_MAX 160
typedef struct profile {
    float r[PROFILE_MAX], y[PROFILE_MAX];
    uint32_t count;
} profile;

void profile_to(profile *p, float r, float y);
/* Arc around (r, y); angles in degrees, 0 outwards, 90 up. */
void profile_arc(profile *p, float r, float y, float radius, float from, float to, uint32_t steps);
void shape_lathe(shape *s, const profile *p, uint32_t segments);

/* Moves the shape into the scene (the shape is empty afterwards) and returns the mesh's index. Edges sharper than
 * `crease` degrees stay sharp, the others get smooth normals; 0: flat, no normals. */
uint32_t shape_to_mesh(scene *s, shape *from, uint32_t surface, float crease);

/* Affine map, row-major 3 x 4 as instance.to_world. */
typedef struct xform {
    float m[12];
} xform;

xform xform_frame(vec3 origin, vec3 x, vec3 y, vec3 z);
xform xform_place(vec3 origin, float yaw, float scale); /* yaw in radians around y */
xform xform_mul(xform a, xform b);                      /* b first */
/* y axis along unit `up`, turned around it by `yaw`. */
xform xform_along(vec3 origin, vec3 up, float yaw, float scale);
void shape_append(shape *s, const shape *part, xform at);

void place(scene *s, uint32_t mesh_index, xform at);
/* Adds the shape as a mesh that stands once, where it is. */
void place_shape(scene *s, shape *from, uint32_t surface, float crease);
uint32_t material_add(scene *s, material_kind kind, rgb color, float roughness);
void camera_add(scene *s, const char *name, vec3 eye, vec3 at, float yfov_degrees);
float rng_range(rng *r, float lo, float hi);

/* Leaf blade along +z from the origin, facing +y, bent down by `curl` radians in all; a single sheet. */
void shape_leaf(shape *s, xform at, float length, float width, float curl, uint32_t rows);

/* Twig of `length` along +y with leaves all around: meshes to be placed together. */
typedef struct sprig {
    uint32_t twig, leaves;
} sprig;
sprig sprig_add(scene *s, uint64_t seed, uint32_t leaf_count, float length, float leaf_length, uint32_t leaf_rows,
                uint32_t wood, uint32_t green);

typedef struct tree_style {
    uint32_t levels, children, sprigs; /* generations of branches, branches per branch, sprigs per outermost branch */
    float length, radius;              /* of the stem, m */
    float shrink, spread;              /* child's length / parent's; radians between them */
    float rise;                        /* pull upwards, 0 ... 1 */
    float sprig_scale;
} tree_style;

/* Branching stems as one mesh, with placed sprigs. Returns the number of sprigs. */
uint32_t tree_add(scene *s, uint64_t seed, tree_style style, xform at, uint32_t wood, const sprig *kinds,
                  uint32_t kind_count);

void build_atrium(scene *s);
void build_cornell(scene *s);
void build_shapes(scene *s);
void build_dominoes(scene *s);
void build_plant(scene *s);
/* conference-lights[-N][-floating|-diffuse]: N lights with a cut-off, 24 without N, furniture that floats off the
 * floor; -diffuse: the same with cosine emitters, 192 without N. False for other names. */
bool build_conference(const char *name, scene **out);
/* Furniture and plants of the atrium's court, whose floor lies at y = `floor`. */
void build_atrium_garden(scene *s, float floor);

#endif
