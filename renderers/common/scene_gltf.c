/* SPDX-License-Identifier: Apache-2.0 */
/* Materials, lights and cameras of a glTF 2.0 file, read from its JSON. assimp drops emissive strengths, transmission
 * and indices of refraction, keeps one node of a light that several share, and sorts materials by their first use. */
#include "scene_gltf.h"
#include "scene_import.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Deeper trees would exhaust the stack of recursive readers. */
#define MAX_DEPTH 256
/* As many bytes of a name as assimp keeps, with the final 0. */
#define MAX_NAME 1024

typedef struct walk {
    const gltf_json *g;
    const char *path;
    scene *s;
    gltf_facts *facts;
    bool *node_seen, *mesh_seen, *material_seen;
    message *err;
} walk;

/* Up to `count` numbers of an array; elements that are none keep their value. */
static void read_floats(const cJSON *array, float *out, uint32_t count)
{
    const cJSON *item;
    uint32_t i = 0;
    cJSON_ArrayForEach(item, array)
    {
        if (i < count && cJSON_IsNumber(item))
            out[i] = (float)item->valuedouble;
        i++;
    }
}

static vec3 read_vec3(const cJSON *object, const char *key, vec3 fallback)
{
    float f[3] = {fallback.x, fallback.y, fallback.z};
    read_floats(json_get(object, key), f, 3);
    return v3(f[0], f[1], f[2]);
}

static const char *name_of(const cJSON *object)
{
    const cJSON *name = json_get(object, "name");
    return cJSON_IsString(name) ? name->valuestring : "";
}

/* --- Materials --- */

static rgb read_emission(const cJSON *json)
{
    const cJSON *strength = json_get(json_get(json, "extensions"), "KHR_materials_emissive_strength");
    const cJSON *radiance = json_get(json_get(json, "extras"), "radiance");
    rgb factor = clamp_colour(read_vec3(json, "emissiveFactor", v3(0, 0, 0)));
    if (!strength && cJSON_IsArray(radiance))
        factor = read_vec3(json_get(json, "extras"), "radiance", v3(0, 0, 0));
    return v3_scale(factor, (float)json_number(strength, "emissiveStrength", 1.0));
}

static material read_material(const cJSON *json)
{
    const cJSON *pbr = json_get(json, "pbrMetallicRoughness"), *extensions = json_get(json, "extensions");
    material m = default_material();
    m.color = clamp_colour(read_vec3(pbr, "baseColorFactor", v3(1, 1, 1)));
    m.roughness = clamp_unit((float)json_number(pbr, "roughnessFactor", 1.0));
    double ior = json_number(json_get(extensions, "KHR_materials_ior"), "ior", 1.5);
    m.ior = (float)fmin(fmax(ior, 1.001), 10.0);
    m.emission = read_emission(json);
    m.two_sided = cJSON_IsTrue(json_get(json, "doubleSided"));

    /* Where a texture says what is metal, the factor (1 by default) says nothing. */
    bool metal = json_number(pbr, "metallicFactor", 1.0) >= 0.5 && !json_get(pbr, "metallicRoughnessTexture");
    bool transmissive =
        cJSON_IsTrue(json_get(json_get(json, "extras"), "transmissive")) ||
        json_number(json_get(extensions, "KHR_materials_transmission"), "transmissionFactor", 0.0) > 0.5;
    if (metal)
        m.kind = MATERIAL_CONDUCTOR;
    else if (transmissive)
        m.kind = MATERIAL_DIELECTRIC;
    else
        m.kind = m.roughness < 0.7f ? MATERIAL_GLOSSY : MATERIAL_DIFFUSE;
    return m;
}

static void read_materials(const gltf_json *g, scene *s, gltf_facts *facts)
{
    facts->material_count = g->materials.count;
    facts->names = xcalloc(g->materials.count, sizeof *facts->names);
    facts->order = xcalloc(g->materials.count, sizeof *facts->order);
    for (uint32_t i = 0; i < g->materials.count; i++) {
        const char *name = name_of(g->materials.items[i]);
        facts->names[i] = xmalloc(MAX_NAME);
        snprintf(facts->names[i], MAX_NAME, "%s", name);
        scene_add_material(s, read_material(g->materials.items[i]));
    }
}

/* --- Lights and cameras: both look along -z of their node --- */

static void add_light(walk *w, const cJSON *json, const float m[12])
{
    const cJSON *type = json_get(json, "type"), *spot = json_get(json, "spot");
    const char *kind = cJSON_IsString(type) ? type->valuestring : "";
    light l = {.kind = LIGHT_POINT, .position = v3(m[3], m[7], m[11])};
    l.direction = v3_normalize(v3(-m[2], -m[6], -m[10]));
    l.intensity = v3_scale(read_vec3(json, "color", v3(1, 1, 1)), (float)json_number(json, "intensity", 1.0));
    if (strcmp(kind, "directional") == 0)
        l.kind = LIGHT_DIRECTIONAL;
    else if (strcmp(kind, "spot") == 0)
        l.kind = LIGHT_SPOT;
    l.cos_inner = (float)cos(json_number(spot, "innerConeAngle", 0.0));
    l.cos_outer = (float)cos(json_number(spot, "outerConeAngle", 0.25 * (double)PI_F));
    scene_add_light(w->s, l);
}

static void add_camera(walk *w, const cJSON *json, const cJSON *node, const float m[12])
{
    const cJSON *perspective = json_get(json, "perspective");
    const char *name = *name_of(json) ? name_of(json) : name_of(node);
    if (!perspective) {
        notice("%s: camera '%s' has no perspective and is left out", w->path, name);
        return;
    }
    camera c = {.eye = v3(m[3], m[7], m[11]), .yfov = (float)json_number(perspective, "yfov", 0.0)};
    vec3 up = v3_normalize(v3(m[1], m[5], m[9]));
    c.forward = v3_normalize(v3(-m[2], -m[6], -m[10]));
    c.up = v3_normalize(v3_mad(up, -v3_dot(up, c.forward), c.forward));
    snprintf(c.name, sizeof c.name, "%s", name);
    scene_add_camera(w->s, c);
}

/* --- Nodes --- */

static void node_matrix(const cJSON *node, float m[12])
{
    float c[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, q[4] = {0, 0, 0, 1};
    if (json_get(node, "matrix")) {
        read_floats(json_get(node, "matrix"), c, 16);
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 4; column++)
                m[4 * row + column] = c[4 * column + row];
        return;
    }
    vec3 t = read_vec3(node, "translation", v3(0, 0, 0)), s = read_vec3(node, "scale", v3(1, 1, 1));
    read_floats(json_get(node, "rotation"), q, 4);
    float x = q[0], y = q[1], z = q[2], w = q[3];
    float r[12] = {
        (1 - 2 * (y * y + z * z)) * s.x, 2 * (x * y - z * w) * s.y,       2 * (x * z + y * w) * s.z,       t.x,
        2 * (x * y + z * w) * s.x,       (1 - 2 * (x * x + z * z)) * s.y, 2 * (y * z - x * w) * s.z,       t.y,
        2 * (x * z - y * w) * s.x,       2 * (y * z + x * w) * s.y,       (1 - 2 * (x * x + y * y)) * s.z, t.z};
    memcpy(m, r, sizeof r);
}

static void compose(const float a[12], const float b[12], float out[12])
{
    for (int row = 0; row < 3; row++)
        for (int column = 0; column < 4; column++) {
            const float *r = a + 4 * row;
            double sum = (double)r[0] * b[column] + (double)r[1] * b[4 + column] + (double)r[2] * b[8 + column];
            out[4 * row + column] = (float)(sum + (column == 3 ? r[3] : 0.0f));
        }
}

static void meet_mesh(walk *w, uint32_t met)
{
    const cJSON *p;
    if (w->mesh_seen[met])
        return;
    w->mesh_seen[met] = true;
    cJSON_ArrayForEach(p, json_get(w->g->meshes.items[met], "primitives"))
    {
        uint32_t i;
        w->facts->triangle_count += gltf_triangles(w->g, p);
        if (gltf_index(p, "material", w->g->materials.count, &i) == 1 && !w->material_seen[i]) {
            w->material_seen[i] = true;
            w->facts->order[w->facts->order_count++] = i;
        }
    }
}

/* Children come before the node's own mesh: so assimp reads them, and materials with them. */
static bool visit_node(walk *w, const cJSON *index, const float parent[12], int depth)
{
    const gltf_json *g = w->g;
    uint32_t i = cJSON_IsNumber(index) && index->valuedouble >= 0.0 && index->valuedouble < g->nodes.count
                     ? (uint32_t)index->valuedouble
                     : UINT32_MAX;
    if (i == UINT32_MAX)
        return fail(w->err, "%s: index of a node out of range", w->path);
    if (w->node_seen[i])
        return fail(w->err, "%s: node %u has several parents", w->path, i);
    if (depth > MAX_DEPTH)
        return fail(w->err, "%s: nodes are nested deeper than %d", w->path, MAX_DEPTH);
    w->node_seen[i] = true;

    const cJSON *node = g->nodes.items[i], *child;
    const cJSON *lit = json_get(json_get(node, "extensions"), "KHR_lights_punctual");
    float local[12], world[12];
    uint32_t met, item;
    node_matrix(node, local);
    compose(parent, local, world);
    cJSON_ArrayForEach(child, json_get(node, "children"))
    {
        if (!visit_node(w, child, world, depth + 1))
            return false;
    }
    int has_mesh = gltf_index(node, "mesh", g->meshes.count, &met);
    int has_camera = gltf_index(node, "camera", g->cameras.count, &item);
    if (has_camera == 1)
        add_camera(w, g->cameras.items[item], node, world);
    int has_light = gltf_index(lit, "light", g->lights.count, &item);
    if (has_light == 1)
        add_light(w, g->lights.items[item], world);
    if (has_mesh == 1)
        meet_mesh(w, met);
    if (has_mesh < 0 || has_camera < 0 || has_light < 0)
        return fail(w->err, "%s: node %u: index of its mesh, camera or light out of range", w->path, i);
    return true;
}

static bool walk_nodes(const gltf_json *g, const char *path, scene *s, gltf_facts *facts, message *err)
{
    walk w = {.g = g, .path = path, .s = s, .facts = facts, .err = err};
    const cJSON *root, *scenes = json_get(g->root, "scenes");
    uint32_t chosen = 0, count = cJSON_IsArray(scenes) ? (uint32_t)cJSON_GetArraySize(scenes) : 0;
    if (count == 0 || gltf_index(g->root, "scene", count, &chosen) < 0)
        return fail(err, "%s: the file names no scene", path);
    w.node_seen = xcalloc(g->nodes.count, sizeof(bool));
    w.mesh_seen = xcalloc(g->meshes.count, sizeof(bool));
    w.material_seen = xcalloc(g->materials.count, sizeof(bool));
    bool ok = true;
    cJSON_ArrayForEach(root, json_get(cJSON_GetArrayItem(scenes, (int)chosen), "nodes"))
    {
        ok = ok && visit_node(&w, root, transform_identity, 0);
    }
    free(w.node_seen);
    free(w.mesh_seen);
    free(w.material_seen);
    return ok;
}

/* --- Entry --- */

bool gltf_read(const char *path, scene *s, gltf_facts *facts, message *err)
{
    char *data;
    size_t size;
    gltf_json g;
    *facts = (gltf_facts){0};
    if (!file_read(path, &data, &size, err))
        return false;
    bool ok = gltf_parse(path, data, size, &g, err);
    free(data);
    if (!ok)
        return false;
    ok = gltf_check(&g, path, err);
    if (ok) {
        read_materials(&g, s, facts);
        ok = walk_nodes(&g, path, s, facts, err);
    }
    gltf_json_free(&g);
    return ok;
}

void gltf_facts_free(gltf_facts *facts)
{
    for (uint32_t i = 0; i < facts->material_count; i++)
        free(facts->names[i]);
    free(facts->names);
    free(facts->order);
    *facts = (gltf_facts){0};
}

int64_t gltf_material(const gltf_facts *facts, uint32_t index, const char *name)
{
    if (index < facts->order_count && strcmp(facts->names[facts->order[index]], name) == 0)
        return facts->order[index];
    if (!*name)
        return -1;
    for (uint32_t i = 0; i < facts->material_count; i++)
        if (strcmp(facts->names[i], name) == 0)
            return i;
    return -1;
}
