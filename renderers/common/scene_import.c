/* SPDX-License-Identifier: Apache-2.0 */
/* Reads scene files. Vertex data, nodes and textures come from assimp; for glTF, materials, lights and cameras come
 * from scene_gltf.c. PLY files are read by scene_ply.c. */
#include "scene_import.h"

#include "regular_file.h"
#include "scene_io.h"

#include <assimp/ObjMaterial.h>
#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#define NO_INDEX UINT32_MAX

typedef struct import {
    const char *path;
    const struct aiScene *source;
    scene *s;
    bool is_gltf;
    gltf_facts facts;
    uint32_t *materials, *meshes;  /* assimp's index to ours; a mesh without triangles has NO_INDEX */
    uint32_t *uv_sets;             /* per assimp material */
    char (*texture_names)[MAXLEN]; /* met so far, with their index or -1 for unusable ones */
    int32_t *texture_indices;
    uint32_t texture_count;
} import;

/* --- Files --- */

/* That has anything in it. */
static FILE *open_scene(const char *path, size_t *size, message *err)
{
    message why;
    FILE *f = regular_open(path, size, &why);
    if (!f)
        fail(err, "%s: %s", path, why.text);
    if (!f || *size > 0)
        return f;
    fail(err, "%s: the file is empty", path);
    fclose(f);
    return NULL;
}

bool file_read(const char *path, char **data, size_t *size, message *err)
{
    FILE *f = open_scene(path, size, err);
    if (!f)
        return false;
    *data = xmalloc(*size + 1);
    size_t got = fread(*data, 1, *size, f);
    fclose(f);
    (*data)[got] = 0;
    if (got == *size)
        return true;
    free(*data);
    *data = NULL;
    return fail(err, "%s: cannot be read", path);
}

/* --- Textures --- */

/* assimp names embedded textures "*0", "*1" ... */
static const struct aiTexture *embedded_texture(const struct aiScene *source, const char *name)
{
    char *end = NULL;
    unsigned long index = *name == '*' ? strtoul(name + 1, &end, 10) : ULONG_MAX;
    return index < source->mNumTextures && !*end ? source->mTextures[index] : NULL;
}

static bool read_texture(const import *in, const char *name, texture *out, message *err)
{
    const struct aiTexture *embedded = embedded_texture(in->source, name);
    if (embedded && embedded->mHeight == 0)
        return texture_decode(embedded->pcData, embedded->mWidth, out, err);
    if (embedded)
        return fail(err, "embedded in a form that is not supported");

    const char *slash = strrchr(in->path, '/');
    int folder = slash ? (int)(slash - in->path) + 1 : 0;
    char *data, path[4096];
    size_t size;
    if (snprintf(path, sizeof path, "%.*s%s", folder, in->path, name) >= (int)sizeof path)
        return fail(err, "path too long");
    for (char *p = path + folder; *p; p++)
        if (*p == '\\')
            *p = '/';
    if (!file_read(path, &data, &size, err))
        return false;
    bool ok = texture_decode(data, size, out, err);
    free(data);
    return ok;
}

/* Several materials may share a texture; each is read once. */
static int32_t find_texture(import *in, const struct aiMaterial *m, uint32_t *uv_set)
{
    struct aiString name = {0};
    unsigned count = 1;
    int set = 0;
    if (aiGetMaterialTexture(m, aiTextureType_DIFFUSE, 0, &name, NULL, NULL, NULL, NULL, NULL, NULL) !=
        aiReturn_SUCCESS)
        return -1;
    if (aiGetMaterialIntegerArray(m, AI_MATKEY_UVWSRC(aiTextureType_DIFFUSE, 0), &set, &count) == aiReturn_SUCCESS &&
        set >= 0 && set < AI_MAX_NUMBER_OF_TEXTURECOORDS)
        *uv_set = (uint32_t)set;
    for (uint32_t i = 0; i < in->texture_count; i++)
        if (strcmp(in->texture_names[i], name.data) == 0)
            return in->texture_indices[i];

    texture t;
    message why;
    int32_t index = -1;
    if (read_texture(in, name.data, &t, &why))
        index = (int32_t)scene_add_texture(in->s, t);
    else
        notice("%s: texture '%s' is left out: %s", in->path, name.data, why.text);
    snprintf(in->texture_names[in->texture_count], MAXLEN, "%s", name.data);
    in->texture_indices[in->texture_count++] = index;
    return index;
}

/* --- Materials of .obj --- */

static rgb property_colour(const struct aiMaterial *m, const char *key, unsigned type, unsigned index, rgb fallback)
{
    struct aiColor4D c;
    if (aiGetMaterialColor(m, key, type, index, &c) != aiReturn_SUCCESS)
        return fallback;
    return v3(c.r, c.g, c.b);
}

static float property_float(const struct aiMaterial *m, const char *key, unsigned type, unsigned index, float fallback)
{
    ai_real x;
    return aiGetMaterialFloatArray(m, key, type, index, &x, NULL) == aiReturn_SUCCESS && isfinite(x) ? x : fallback;
}

static material obj_material(const struct aiMaterial *source)
{
    material m = default_material();
    unsigned count = 1;
    int illum = 2;
    aiGetMaterialIntegerArray(source, AI_MATKEY_OBJ_ILLUM, &illum, &count);
    m.color = clamp_colour(property_colour(source, AI_MATKEY_COLOR_DIFFUSE, m.color));
    m.emission = property_colour(source, AI_MATKEY_COLOR_EMISSIVE, v3(0, 0, 0));
    m.two_sided = true; /* the format says nothing about the sides of a face */
    rgb specular = clamp_colour(property_colour(source, AI_MATKEY_COLOR_SPECULAR, v3(0, 0, 0)));
    float exponent = property_float(source, AI_MATKEY_SHININESS, 0.0f);
    float ior = property_float(source, AI_MATKEY_REFRACTI, 1.0f);

    /* Some exporters give illum 4 to everything; their Ni is 1 where nothing refracts. */
    bool refracts = illum >= 4 && illum <= 7 && ior > 1.0f;
    if (illum == 3) {
        m.kind = MATERIAL_CONDUCTOR;
        m.color = specular;
        m.roughness = 0;
    } else if (refracts || property_float(source, AI_MATKEY_OPACITY, 1.0f) < 0.9f) {
        m.kind = MATERIAL_DIELECTRIC;
        m.color = v3(1, 1, 1);
        m.roughness = 0;
        m.ior = ior > 1.0f ? fminf(fmaxf(ior, 1.001f), 10.0f) : 1.5f;
    } else if (luminance(specular) > 0.05f) {
        m.kind = MATERIAL_GLOSSY;
        m.roughness = clamp_unit(sqrtf(sqrtf(2.0f / (fmaxf(exponent, 0.0f) + 2.0f))));
    }
    return m;
}

static void import_materials(import *in)
{
    int64_t plain = -1;
    for (unsigned i = 0; i < in->source->mNumMaterials; i++) {
        const struct aiMaterial *source = in->source->mMaterials[i];
        struct aiString name = {0};
        aiGetMaterialString(source, AI_MATKEY_NAME, &name);
        int64_t index = -1;
        if (in->is_gltf)
            index = gltf_material(&in->facts, i, name.data);
        else
            index = scene_add_material(in->s, obj_material(source));
        if (index < 0 && plain < 0)
            plain = scene_add_material(in->s, default_material());
        if (index < 0)
            index = plain;
        else
            in->s->materials[index].texture = find_texture(in, source, &in->uv_sets[i]);
        in->materials[i] = (uint32_t)index;
    }
}

/* --- Meshes --- */

static float *copy_normals(const struct aiMesh *source)
{
    if (!source->mNormals)
        return NULL;
    float *normals = xmalloc(3 * (size_t)source->mNumVertices * sizeof *normals);
    for (size_t i = 0; i < source->mNumVertices; i++) {
        const struct aiVector3D *n = &source->mNormals[i];
        normals[3 * i] = n->x;
        normals[3 * i + 1] = n->y;
        normals[3 * i + 2] = n->z;
        if (!isfinite(n->x + n->y + n->z)) {
            free(normals);
            return NULL;
        }
    }
    return normals;
}

/* assimp counts v from the bottom for every format. */
static float *copy_uvs(const struct aiMesh *source, uint32_t set)
{
    const struct aiVector3D *from = source->mTextureCoords[set];
    if (!from)
        return NULL;
    float *uvs = xmalloc(2 * (size_t)source->mNumVertices * sizeof *uvs);
    for (size_t i = 0; i < source->mNumVertices; i++) {
        uvs[2 * i] = isfinite(from[i].x) ? from[i].x : 0.0f;
        uvs[2 * i + 1] = isfinite(from[i].y) ? 1.0f - from[i].y : 0.0f;
    }
    return uvs;
}

/* Returns how many triangles; points and lines are left out. */
static uint32_t import_mesh(import *in, unsigned index)
{
    const struct aiMesh *source = in->source->mMeshes[index];
    mesh m = {.vertex_count = source->mNumVertices, .material = in->materials[source->mMaterialIndex]};
    in->meshes[index] = NO_INDEX;
    for (unsigned i = 0; i < source->mNumFaces; i++)
        m.triangle_count += source->mFaces[i].mNumIndices == 3;
    if (m.triangle_count == 0)
        return 0;

    uint32_t *to = m.indices = xmalloc(3 * (size_t)m.triangle_count * sizeof *m.indices);
    for (unsigned i = 0; i < source->mNumFaces; i++)
        if (source->mFaces[i].mNumIndices == 3) {
            memcpy(to, source->mFaces[i].mIndices, 3 * sizeof *to);
            to += 3;
        }
    m.positions = xcalloc(1, 3 * (size_t)m.vertex_count * sizeof *m.positions + VERTEX_PADDING);
    for (size_t i = 0; i < m.vertex_count; i++) {
        m.positions[3 * i] = source->mVertices[i].x;
        m.positions[3 * i + 1] = source->mVertices[i].y;
        m.positions[3 * i + 2] = source->mVertices[i].z;
    }
    m.normals = copy_normals(source);
    m.uvs = copy_uvs(source, in->uv_sets[source->mMaterialIndex]);
    in->meshes[index] = scene_add_mesh(in->s, m);
    return m.triangle_count;
}

static void import_node(import *in, const struct aiNode *node, struct aiMatrix4x4 world)
{
    aiMultiplyMatrix4(&world, &node->mTransformation);
    for (unsigned i = 0; i < node->mNumMeshes; i++)
        if (in->meshes[node->mMeshes[i]] != NO_INDEX)
            scene_add_instance(in->s,
                               (instance){.mesh = in->meshes[node->mMeshes[i]],
                                          .to_world = {world.a1, world.a2, world.a3, world.a4, world.b1, world.b2,
                                                       world.b3, world.b4, world.c1, world.c2, world.c3, world.c4}});
    for (unsigned i = 0; i < node->mNumChildren; i++)
        import_node(in, node->mChildren[i], world);
}

static bool import_source(import *in, message *err)
{
    const struct aiScene *source = in->source;
    uint64_t triangles = 0;
    struct aiMatrix4x4 identity;
    in->materials = xcalloc(source->mNumMaterials, sizeof *in->materials);
    in->uv_sets = xcalloc(source->mNumMaterials, sizeof *in->uv_sets);
    in->meshes = xcalloc(source->mNumMeshes, sizeof *in->meshes);
    in->texture_names = xcalloc(source->mNumMaterials, sizeof *in->texture_names);
    in->texture_indices = xcalloc(source->mNumMaterials, sizeof *in->texture_indices);
    import_materials(in);
    for (unsigned i = 0; i < source->mNumMeshes; i++)
        triangles += import_mesh(in, i);
    if (in->is_gltf && triangles < in->facts.triangle_count)
        return fail(err, "%s: %llu triangles refer to vertices that do not exist", in->path,
                    (unsigned long long)(in->facts.triangle_count - triangles));
    aiIdentityMatrix4(&identity);
    import_node(in, source->mRootNode, identity);
    return true;
}

/* --- Entry --- */

/* The file's name without folders and extension. */
static scene *named_scene(const char *path)
{
    const char *slash = strrchr(path, '/'), *base = slash ? slash + 1 : path;
    char name[sizeof((scene *)0)->name];
    snprintf(name, sizeof name, "%.*s", (int)(strrchr(base, '.') - base), base);
    return scene_new(name);
}

typedef enum format { FORMAT_UNKNOWN, FORMAT_GLTF, FORMAT_OBJ, FORMAT_PLY } format;

static format format_of(const char *path)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    if (dot && (strcasecmp(dot, ".gltf") == 0 || strcasecmp(dot, ".glb") == 0))
        return FORMAT_GLTF;
    if (dot && strcasecmp(dot, ".obj") == 0)
        return FORMAT_OBJ;
    return dot && strcasecmp(dot, ".ply") == 0 ? FORMAT_PLY : FORMAT_UNKNOWN;
}

static bool import_failed(const char *path, message *err)
{
    const char *why = aiGetErrorString();
    if (!*why || strstr(why, "No suitable reader"))
        why = "the contents do not fit the format";
    else if (strstr(why, "too small"))
        why = "the file has no faces";
    return fail(err, "%s: %.*s", path, (int)strcspn(why, "\n"), why);
}

static bool load_with_assimp(import *in, message *err)
{
    bool ok;
    if (in->is_gltf && !gltf_read(in->path, in->s, &in->facts, err))
        return false;
    /* glTF holds no polygons; nodes and shared meshes stay as they are, for they become instances. */
    scene_io reader;
    scene_io_init(&reader);
    in->source = aiImportFileEx(in->path, in->is_gltf ? 0 : aiProcess_Triangulate, &reader.io);
    if (in->source && *reader.missing.text)
        notice("%s: %s", in->path, reader.missing.text);
    if (in->source && in->source->mRootNode)
        ok = import_source(in, err);
    else
        ok = import_failed(in->path, err);
    aiReleaseImport(in->source);
    free(in->materials);
    free(in->meshes);
    free(in->uv_sets);
    free(in->texture_names);
    free(in->texture_indices);
    return ok;
}

bool scene_load(const char *path, scene **out, message *err)
{
    format kind = format_of(path);
    size_t size;
    *out = NULL;
    if (kind == FORMAT_UNKNOWN)
        return fail(err, "%s: unknown scene format (known: .gltf .glb .obj .ply)", path);
    FILE *f = open_scene(path, &size, err);
    if (!f)
        return false;
    fclose(f);

import in = {.path = path, .s = named_scene(path), .is_gltf = kind == FORMAT_GLTF };
    bool ok = kind == FORMAT_PLY ? ply_read(path, in.s, err) : load_with_assimp(&in, err);
    gltf_facts_free(&in.facts);
    if (!ok) {
        scene_free(in.s);
        return false;
    }
    size = strlen(path) + 1;
    in.s->path = memcpy(xmalloc(size), path, size);
    *out = in.s;
    return true;
}
