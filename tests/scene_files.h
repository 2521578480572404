/* SPDX-License-Identifier: Apache-2.0 */
/* Small scene files for the tests of the importers, written to a temporary folder. Include the renderers' headers, and
 * after them cmocka.h, before this one. */
#ifndef TESTS_SCENE_FILES_H
#define TESTS_SCENE_FILES_H

#include "temporary_folder.h"

#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The binary chunk: a unit square with normals and texture coordinates, its indices, a texture of 2 x 2 pixels. */
enum { BIN_POSITIONS = 0, BIN_NORMALS = 48, BIN_UVS = 96, BIN_INDICES = 128, BIN_TEXTURE = 140, BIN_SIZE = 172 };

typedef struct files {
    char folder[TEMPORARY_FOLDER_MAX];
    char path[TEMPORARY_FOLDER_MAX + 64]; /* of the file written last */
    unsigned char bin[BIN_SIZE];
} files;

/* What all the files share; ' stands for ". A test adds materials, meshes (accessor 0 positions, 1 normals, 2 texture
 * coordinates, 3 indices), nodes and scenes. */
static const char *const json_frame =
    "{'asset':{'version':'2.0'},'buffers':[{'byteLength':172}],'bufferViews':[{'buffer':0,'byteLength':48},"
    "{'buffer':0,'byteOffset':48,'byteLength':48},{'buffer':0,'byteOffset':96,'byteLength':32},"
    "{'buffer':0,'byteOffset':128,'byteLength':12},{'buffer':0,'byteOffset':140,'byteLength':30}],"
    "'accessors':[{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'},"
    "{'bufferView':1,'componentType':5126,'count':4,'type':'VEC3'},"
    "{'bufferView':2,'componentType':5126,'count':4,'type':'VEC2'},"
    "{'bufferView':3,'componentType':5123,'count':6,'type':'SCALAR'}],%s}";

#define PRIMITIVE "'attributes':{'POSITION':0,'NORMAL':1,'TEXCOORD_0':2},'indices':3"

static inline void fill_bin(unsigned char bin[BIN_SIZE])
{
    const float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    const float uvs[] = {0, 0.25f, 1, 0.25f, 1, 1, 0, 1};
    const uint16_t indices[] = {0, 1, 2, 0, 2, 3};
    /* TGA: true colour, 2 x 2, 24 bits, first row on top; red, green / blue, white as B, G, R */
    const unsigned char tga[30] = {0, 0,  2,  0, 0, 0,   0, 0,   0, 0,   0, 0, 2,   0,   2,
                                   0, 24, 32, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255};
    memset(bin, 0, BIN_SIZE);
    memcpy(bin + BIN_POSITIONS, positions, sizeof positions);
    memcpy(bin + BIN_NORMALS, normals, sizeof normals);
    memcpy(bin + BIN_UVS, uvs, sizeof uvs);
    memcpy(bin + BIN_INDICES, indices, sizeof indices);
    memcpy(bin + BIN_TEXTURE, tga, sizeof tga);
}

static inline const char *write_file(files *f, const char *name, const void *data, size_t size)
{
    snprintf(f->path, sizeof f->path, "%s/%s", f->folder, name);
    FILE *out = fopen(f->path, "wb");
    assert_non_null(out);
    assert_int_equal(fwrite(data, 1, size, out), size);
    fclose(out);
    return f->path;
}

static inline const char *write_text(files *f, const char *name, const char *text)
{
    return write_file(f, name, text, strlen(text));
}

static inline void put32(char *to, size_t value)
{
    for (int i = 0; i < 4; i++)
        to[i] = (char)(value >> (8 * i) & 255);
}

/* Puts `rest` into the frame, padded with blanks to a multiple of four bytes; returns the length. */
static inline size_t frame_json(const char *rest, char *out, size_t size)
{
    size_t length = (size_t)snprintf(out, size, json_frame, rest);
    assert_true(length + 4 < size);
    for (size_t i = 0; i < length; i++)
        if (out[i] == '\'')
            out[i] = '"';
    while (length % 4)
        out[length++] = ' ';
    return length;
}

/* Makes a GLB of f->bin; returns its size. */
static inline size_t make_glb(const files *f, const char *rest, char *out, size_t size)
{
    size_t json = frame_json(rest, out + 20, size - 20 - BIN_SIZE - 8), total = 28 + json + BIN_SIZE;
    memcpy(out, "glTF", 4);
    put32(out + 4, 2);
    put32(out + 8, total);
    put32(out + 12, json);
    memcpy(out + 16, "JSON", 4);
    put32(out + 20 + json, BIN_SIZE);
    memcpy(out + 24 + json, "BIN", 4);
    memcpy(out + 28 + json, f->bin, BIN_SIZE);
    return total;
}

static inline const char *write_glb(files *f, const char *name, const char *rest)
{
    static char data[16384];
    size_t size = make_glb(f, rest, data, sizeof data);
    return write_file(f, name, data, size);
}

static inline int open_folder(void **state)
{
    files *f = calloc(1, sizeof *f);
    if (!f)
        return -1;
    fill_bin(f->bin);
    *state = f;
    return temporary_folder(NULL, f->folder);
}

static inline int close_folder(void **state)
{
    files *f = *state;
    DIR *d = opendir(f->folder);
    for (struct dirent *e; d && (e = readdir(d));) {
        snprintf(f->path, sizeof f->path, "%s/%.60s", f->folder, e->d_name);
        if (e->d_name[0] != '.')
            remove(f->path);
    }
    if (d)
        closedir(d);
    rmdir(f->folder);
    free(f);
    return 0;
}

/* A file with every kind of thing in it, for damaging. */
#define RICH_JSON                                                                                                      \
    "'scene':0,'scenes':[{'nodes':[0,2]}],'extensions':{'KHR_lights_punctual':{'lights':[{'type':'spot',"              \
    "'intensity':10,'spot':{'innerConeAngle':0.2,'outerConeAngle':0.5}},{'type':'directional'}]}},"                    \
    "'nodes':[{'children':[1,3],'translation':[1,2,3],'rotation':[0,0.7071068,0,0.7071068],'scale':[2,2,2]},"          \
    "{'mesh':0},{'mesh':1,'matrix':[1,0,0,0,0,1,0,0,0,0,1,0,5,0,0,1],"                                                 \
    "'extensions':{'KHR_lights_punctual':{'light':0}}},"                                                               \
    "{'mesh':0,'camera':0,'extensions':{'KHR_lights_punctual':{'light':1}}}],"                                         \
    "'cameras':[{'type':'perspective','perspective':{'yfov':0.7,'aspectRatio':1.5,'znear':0.1}}],"                     \
    "'materials':[{'name':'x','emissiveFactor':[1,0.5,0],'extensions':{'KHR_materials_emissive_strength':"             \
    "{'emissiveStrength':4}}},{'name':'x','pbrMetallicRoughness':{'metallicFactor':0,'roughnessFactor':0.3,"           \
    "'baseColorTexture':{'index':0}}}],'textures':[{'source':0}],"                                                     \
    "'images':[{'bufferView':4,'mimeType':'image/png'}],"                                                              \
    "'meshes':[{'primitives':[{" PRIMITIVE ",'material':1},{" PRIMITIVE "}]},{'primitives':[{" PRIMITIVE               \
    ",'material':0}]}]"

#endif
