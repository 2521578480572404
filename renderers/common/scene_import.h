/* SPDX-License-Identifier: Apache-2.0 */
/* Private parts shared by the files that read scenes. */
#ifndef COMMON_SCENE_IMPORT_H
#define COMMON_SCENE_IMPORT_H

#include "message.h"
#include "scene.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Embree reads 16 bytes from the last vertex on. */
#define VERTEX_PADDING 16

/* Reads a regular file whole, with a 0 behind its end. */
bool file_read(const char *path, char **data, size_t *size, message *err);

/* Decodes PNG, JPEG, TGA, BMP ...; on failure returns false and says why. */
bool texture_decode(const void *bytes, size_t size, texture *out, message *err);

/* What assimp leaves out of a glTF file or reads in an order of its own. */
typedef struct gltf_facts {
    char **names; /* of the file's materials, "" where they have none */
    uint32_t material_count;
    uint32_t *order; /* the file's materials in the order in which assimp keeps them */
    uint32_t order_count;
    uint64_t triangle_count; /* of the meshes that nodes use, each once */
} gltf_facts;

/* Checks the file and adds its materials (without textures; in the file's order), lights and cameras to the empty
 * scene `s`. */
bool gltf_read(const char *path, scene *s, gltf_facts *facts, message *err);
void gltf_facts_free(gltf_facts *facts);
/* Index into the scene's materials for assimp's material `index` called `name`, or -1 for the default material. */
int64_t gltf_material(const gltf_facts *facts, uint32_t index, const char *name);

bool ply_read(const char *path, scene *s, message *err);

static inline float clamp_unit(float x)
{
    return x > 0.0f ? fminf(x, 1.0f) : 0.0f; /* NaN becomes 0 */
}

static inline rgb clamp_colour(rgb c)
{
    return v3(clamp_unit(c.x), clamp_unit(c.y), clamp_unit(c.z));
}

/* The material of what has none. */
static inline material default_material(void)
{
    return (material){
        .kind = MATERIAL_DIFFUSE, .color = {0.8f, 0.8f, 0.8f}, .roughness = 1, .ior = 1.5f, .texture = -1};
}

#endif
