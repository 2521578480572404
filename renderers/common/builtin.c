/* SPDX-License-Identifier: Apache-2.0 */
/* Names of the generated scenes, and what their builders share. */
#include "builtin.h"

#include <stdio.h>
#include <string.h>

const char *const scene_builtin_names[] = {
    "atrium",
    "cornell",
    "shapes",
    "dominoes",
    "plant",
    "conference-lights",
    "conference-lights-192",
    "conference-lights-floating",
    "conference-lights-diffuse",
    NULL,
};

static void (*const builders[])(scene *) = {build_atrium, build_cornell, build_shapes, build_dominoes, build_plant};

bool scene_builtin(const char *name, scene **out)
{
    *out = NULL;
    for (size_t i = 0; name && i < sizeof builders / sizeof *builders; ++i)
        if (strcmp(name, scene_builtin_names[i]) == 0) {
            *out = scene_new(name);
            builders[i](*out);
            return true;
        }
    return name && build_conference(name, out);
}

void place(scene *s, uint32_t mesh_index, xform at)
{
    instance i = {.mesh = mesh_index};
    memcpy(i.to_world, at.m, sizeof at.m);
    scene_add_instance(s, i);
}

void place_shape(scene *s, shape *from, uint32_t surface, float crease)
{
    place(s, shape_to_mesh(s, from, surface, crease), xform_place(v3(0.0f, 0.0f, 0.0f), 0.0f, 1.0f));
}

uint32_t material_add(scene *s, material_kind kind, rgb color, float roughness)
{
    return scene_add_material(
        s, (material){.kind = kind, .color = color, .roughness = roughness, .ior = 1.5f, .texture = -1});
}

void camera_add(scene *s, const char *name, vec3 eye, vec3 at, float yfov_degrees)
{
    camera c = camera_look(eye, at, v3(0.0f, 1.0f, 0.0f), yfov_degrees * PI_F / 180.0f);
    snprintf(c.name, sizeof c.name, "%s", name);
    scene_add_camera(s, c);
}

float rng_range(rng *r, float lo, float hi)
{
    return lo + (hi - lo) * rng_float(r);
}
