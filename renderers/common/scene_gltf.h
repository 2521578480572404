/* SPDX-License-Identifier: Apache-2.0 */
/* Private: the JSON of a glTF 2.0 file with its arrays as tables, and the checks that make it safe to hand on. */
#ifndef COMMON_SCENE_GLTF_H
#define COMMON_SCENE_GLTF_H

#include "message.h"

#include <cjson/cJSON.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct json_table {
    const cJSON **items;
    uint32_t count;
} json_table;

typedef struct gltf_json {
    cJSON *root;
    json_table nodes, meshes, materials, accessors, views, buffers, cameras, lights;
    bool binary; /* .glb: the first buffer may be its second chunk */
    size_t binary_size;
} gltf_json;

static inline const cJSON *json_get(const cJSON *object, const char *key)
{
    return cJSON_GetObjectItemCaseSensitive(object, key);
}

/* A number, or `fallback` where there is none. */
static inline double json_number(const cJSON *object, const char *key, double fallback)
{
    const cJSON *item = json_get(object, key);
    return cJSON_IsNumber(item) ? item->valuedouble : fallback;
}

/* Cuts `data` open and parses it; on failure nothing needs freeing. */
bool gltf_parse(const char *path, const char *data, size_t size, gltf_json *out, message *err);
void gltf_json_free(gltf_json *g);

/* False, with a line in err, where an index, offset or count points outside of what the file holds. */
bool gltf_check(const gltf_json *g, const char *path, message *err);
/* Reads an index below `count` at `key`: 1 read, 0 absent, -1 anything else. */
int gltf_index(const cJSON *object, const char *key, uint32_t count, uint32_t *out);
/* Triangles of a checked primitive. */
uint64_t gltf_triangles(const gltf_json *g, const cJSON *primitive);

#endif
