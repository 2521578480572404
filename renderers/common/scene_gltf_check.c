/* SPDX-License-Identifier: Apache-2.0 */
/* Opens the container of a glTF file and checks every index and range in its JSON, because the importer that reads the
 * vertex data trusts them. */
#include "scene_gltf.h"
#include "scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define GLB_MAGIC 0x46546c67u
#define GLB_JSON 0x4e4f534au
#define GLB_BIN 0x004e4942u

static uint32_t little_endian(const char *p)
{
    const unsigned char *b = (const unsigned char *)p;
    return b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
}

/* --- Container --- */

static bool cut_glb(const char *path, const char *data, size_t size, const char **json, size_t *json_size,
                    gltf_json *out, message *err)
{
    if (size < 20 || little_endian(data) != GLB_MAGIC)
        return fail(err, "%s: not a GLB file", path);
    if (little_endian(data + 4) != 2)
        return fail(err, "%s: GLB version %u, only 2 is known", path, little_endian(data + 4));
    if (little_endian(data + 8) > size)
        return fail(err, "%s: truncated: %zu of %u bytes", path, size, little_endian(data + 8));
    *json_size = little_endian(data + 12);
    *json = data + 20;
    if (little_endian(data + 16) != GLB_JSON || *json_size > size - 20)
        return fail(err, "%s: bad JSON chunk", path);
    out->binary = true;
    size_t at = 20 + *json_size;
    at += -at & 3;
    if (at + 8 <= size) {
        out->binary_size = little_endian(data + at);
        if (little_endian(data + at + 4) != GLB_BIN || out->binary_size > size - at - 8)
            return fail(err, "%s: bad binary chunk", path);
    }
    return true;
}

static json_table table(const cJSON *object, const char *key)
{
    const cJSON *array = json_get(object, key), *item;
    json_table t = {0};
    int count = cJSON_IsArray(array) ? cJSON_GetArraySize(array) : 0;
    t.items = xmalloc((size_t)count * sizeof *t.items);
    cJSON_ArrayForEach(item, array)
    {
        if (t.count < (uint32_t)count)
            t.items[t.count++] = item;
    }
    return t;
}

bool gltf_parse(const char *path, const char *data, size_t size, gltf_json *out, message *err)
{
    const char *json = data;
    size_t json_size = size;
    *out = (gltf_json){0};
    if (strcasecmp(strrchr(path, '.'), ".glb") == 0 && !cut_glb(path, data, size, &json, &json_size, out, err))
        return false;
    out->root = cJSON_ParseWithLength(json, json_size);
    if (!cJSON_IsObject(out->root)) {
        cJSON_Delete(out->root);
        return fail(err, "%s: the JSON of the file cannot be parsed", path);
    }
    out->nodes = table(out->root, "nodes");
    out->meshes = table(out->root, "meshes");
    out->materials = table(out->root, "materials");
    out->accessors = table(out->root, "accessors");
    out->views = table(out->root, "bufferViews");
    out->buffers = table(out->root, "buffers");
    out->cameras = table(out->root, "cameras");
    out->lights = table(json_get(json_get(out->root, "extensions"), "KHR_lights_punctual"), "lights");
    return true;
}

void gltf_json_free(gltf_json *g)
{
    json_table *tables[] = {&g->nodes, &g->meshes,  &g->materials, &g->accessors,
                            &g->views, &g->buffers, &g->cameras,   &g->lights};
    for (size_t i = 0; i < sizeof tables / sizeof *tables; i++)
        free(tables[i]->items);
    cJSON_Delete(g->root);
    *g = (gltf_json){0};
}

/* --- Numbers --- */

/* A whole number in [0, 2^48], or -1: sums and products with strides stay exact in a double. */
static double whole(const cJSON *object, const char *key, double fallback)
{
    const cJSON *item = json_get(object, key);
    if (!item)
        return fallback;
    double x = cJSON_IsNumber(item) ? item->valuedouble : -1.0;
    return x >= 0.0 && x <= 0x1p48 && x == floor(x) ? x : -1.0;
}

int gltf_index(const cJSON *object, const char *key, uint32_t count, uint32_t *out)
{
    const cJSON *item = json_get(object, key);
    double x = whole(object, key, -1.0);
    if (!item)
        return 0;
    if (x < 0.0 || x >= count)
        return -1;
    *out = (uint32_t)x;
    return 1;
}

static uint32_t component_size(const cJSON *accessor)
{
    static const uint32_t sizes[] = {1, 1, 2, 2, 0, 4, 4};
    double type = whole(accessor, "componentType", -1.0);
    return type >= 5120.0 && type <= 5126.0 ? sizes[(int)type - 5120] : 0;
}

static bool has_text(const cJSON *object, const char *key, const char *text)
{
    const cJSON *item = json_get(object, key);
    return cJSON_IsString(item) && strcmp(item->valuestring, text) == 0;
}

static uint32_t component_count(const cJSON *accessor)
{
    static const struct {
        const char *name;
        uint32_t count;
    } types[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (has_text(accessor, "type", types[i].name))
            return types[i].count;
    return 0;
}

/* --- Ranges --- */

static bool check_buffers(const gltf_json *g, const char *path, message *err)
{
    for (uint32_t i = 0; i < g->buffers.count; i++) {
        const cJSON *b = g->buffers.items[i], *uri = json_get(b, "uri");
        double length = whole(b, "byteLength", -1.0);
        if (length < 0.0 || (uri && !cJSON_IsString(uri)))
            return fail(err, "%s: buffer %u has no valid length or uri", path, i);
        if (!uri && !(g->binary && i == 0 && length <= (double)g->binary_size))
            return fail(err, "%s: buffer %u: its %.0f bytes are not in the file", path, i, length);
    }
    for (uint32_t i = 0; i < g->views.count; i++) {
        const cJSON *v = g->views.items[i];
        double offset = whole(v, "byteOffset", 0.0), length = whole(v, "byteLength", -1.0);
        uint32_t buffer;
        if (gltf_index(v, "buffer", g->buffers.count, &buffer) != 1 || offset < 0.0 || length < 0.0 ||
            offset + length > whole(g->buffers.items[buffer], "byteLength", 0.0))
            return fail(err, "%s: bufferView %u does not lie in its buffer", path, i);
    }
    return true;
}

static bool check_accessors(const gltf_json *g, const char *path, message *err)
{
    for (uint32_t i = 0; i < g->accessors.count; i++) {
        const cJSON *a = g->accessors.items[i];
        double count = whole(a, "count", -1.0), offset = whole(a, "byteOffset", 0.0);
        double element = (double)component_size(a) * component_count(a);
        uint32_t view;
        if (json_get(a, "sparse"))
            return fail(err, "%s: accessor %u is sparse, which is not supported", path, i);
        if (element == 0.0 || count < 0.0 || count >= 0x1p31 || offset < 0.0)
            return fail(err, "%s: accessor %u has no valid type, count or offset", path, i);
        if (gltf_index(a, "bufferView", g->views.count, &view) != 1)
            return fail(err, "%s: accessor %u has no bufferView", path, i);
        double stride = whole(g->views.items[view], "byteStride", element);
        double length = whole(g->views.items[view], "byteLength", 0.0);
        if (stride < element || stride > 0xffff)
            return fail(err, "%s: bufferView %u has a bad stride", path, view);
        if (count > 0.0 && offset + (count - 1.0) * stride + element > length)
            return fail(err, "%s: accessor %u does not lie in its bufferView", path, i);
    }
    return true;
}

/* Elements that the primitive strings together, or -1. */
static double primitive_length(const gltf_json *g, const cJSON *p)
{
    uint32_t a;
    int found = gltf_index(p, "indices", g->accessors.count, &a);
    if (found == 0)
        found = gltf_index(json_get(p, "attributes"), "POSITION", g->accessors.count, &a);
    return found == 1 ? whole(g->accessors.items[a], "count", -1.0) : -1.0;
}

static bool check_primitive(const gltf_json *g, const cJSON *p, const char *path, uint32_t owner, message *err)
{
    const cJSON *attributes = json_get(p, "attributes"), *item;
    uint32_t position, other = 0, unused;
    double mode = whole(p, "mode", 4.0);
    if (mode < 0.0 || mode > 6.0)
        return fail(err, "%s: mesh %u: unknown primitive mode", path, owner);
    if (gltf_index(attributes, "POSITION", g->accessors.count, &position) != 1)
        return fail(err, "%s: mesh %u has no positions", path, owner);
    const cJSON *a = g->accessors.items[position];
    if (component_count(a) != 3 || whole(a, "componentType", -1.0) != 5126.0)
        return fail(err, "%s: mesh %u: positions are not three floats", path, owner);
    cJSON_ArrayForEach(item, attributes)
    {
        if (gltf_index(attributes, item->string, g->accessors.count, &other) != 1 ||
            whole(g->accessors.items[other], "count", -1.0) != whole(a, "count", -1.0))
            return fail(err, "%s: mesh %u: attribute %s does not fit the positions", path, owner, item->string);
    }
    int indexed = gltf_index(p, "indices", g->accessors.count, &other);
    if (indexed < 0 || gltf_index(p, "material", g->materials.count, &unused) < 0)
        return fail(err, "%s: mesh %u: index of its accessor or material out of range", path, owner);
    double type = indexed ? whole(g->accessors.items[other], "componentType", -1.0) : 5125.0;
    bool is_unsigned = type == 5121.0 || type == 5123.0 || type == 5125.0;
    if (indexed && (component_count(g->accessors.items[other]) != 1 || !is_unsigned))
        return fail(err, "%s: mesh %u: its indices are not unsigned integers", path, owner);
    if (mode == 4.0 && fmod(primitive_length(g, p), 3.0) != 0.0)
        return fail(err, "%s: mesh %u: the number of its indices is no multiple of 3", path, owner);
    return true;
}

/* assimp takes what follows the slash of a media type without looking whether there is one. */
static bool check_images(const gltf_json *g, const char *path, message *err)
{
    const cJSON *item;
    cJSON_ArrayForEach(item, json_get(g->root, "images"))
    {
        const cJSON *type = json_get(item, "mimeType"), *uri = json_get(item, "uri");
        if (type && !(cJSON_IsString(type) && strncmp(type->valuestring, "image/", 6) == 0))
            return fail(err, "%s: an image has a bad mimeType", path);
        if (uri && (!cJSON_IsString(uri) ||
                    (strncmp(uri->valuestring, "data:", 5) == 0 && strncmp(uri->valuestring, "data:image/", 11) != 0)))
            return fail(err, "%s: an image has a bad uri", path);
    }
    return true;
}

static bool check_extensions(const gltf_json *g, const char *path, message *err)
{
    const cJSON *item;
    cJSON_ArrayForEach(item, json_get(g->root, "extensionsRequired"))
    {
        const char *name = cJSON_IsString(item) ? item->valuestring : "?";
        if (strncmp(name, "KHR_materials_", 14) != 0 && strcmp(name, "KHR_lights_punctual") != 0 &&
            strcmp(name, "KHR_texture_transform") != 0)
            return fail(err, "%s: needs the glTF extension %s, which is not supported", path, name);
    }
    return true;
}

bool gltf_check(const gltf_json *g, const char *path, message *err)
{
    if (!check_extensions(g, path, err) || !check_buffers(g, path, err) || !check_accessors(g, path, err) ||
        !check_images(g, path, err))
        return false;
    for (uint32_t i = 0; i < g->meshes.count; i++) {
        const cJSON *primitives = json_get(g->meshes.items[i], "primitives"), *p;
        if (!cJSON_IsArray(primitives))
            return fail(err, "%s: mesh %u has no primitives", path, i);
        cJSON_ArrayForEach(p, primitives)
        {
            if (!check_primitive(g, p, path, i, err))
                return false;
        }
    }
    return true;
}

uint64_t gltf_triangles(const gltf_json *g, const cJSON *primitive)
{
    double mode = whole(primitive, "mode", 4.0), length = primitive_length(g, primitive);
    if (mode < 4.0)
        return 0;
    if (mode == 4.0)
        return (uint64_t)(length / 3.0);
    return length > 2.0 ? (uint64_t)length - 2 : 0;
}
