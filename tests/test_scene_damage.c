/* SPDX-License-Identifier: Apache-2.0 */
/* Scene files that are absent, cut off, damaged or hostile: one clear line and never a crash. */
#include "../renderers/common/scene.h"
#include "../renderers/common/rng.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <cmocka.h>

#include "scene_files.h"

/* Loads and finishes; false with exactly one line, or a scene that holds something. */
static bool survives(const char *path, message *err)
{
    scene *s = NULL;
    *err = (message){""};
    bool loaded = scene_load(path, &s, err), finished = loaded && scene_finish(s, err);
    assert_true(loaded == (s != NULL));
    if (finished) {
        assert_true(s->triangle_count > 0);
    } else {
        assert_true(*err->text != 0);
        assert_null(strchr(err->text, '\n'));
    }
    scene_free(s);
    return finished;
}

static void assert_refused(const char *path, const char *part)
{
    message err;
    if (survives(path, &err))
        fail_msg("%s was taken, not refused with '%s'", path, part);
    if (!strstr(err.text, part))
        fail_msg("'%s' does not say '%s'", err.text, part);
}

static void not_a_file(void **state)
{
    files *f = *state;
    assert_refused("/nowhere/at/all.glb", "No such file");
    assert_refused("/nowhere/at/all.obj", "/nowhere/at/all.obj");
    assert_refused(write_text(f, "a.stl", "solid"), "unknown scene format");
    assert_refused(f->folder, "unknown scene format");
    assert_refused("", "unknown scene format");
    snprintf(f->path, sizeof f->path, "%s/folder.glb", f->folder);
    assert_int_equal(mkdir(f->path, 0700), 0);
    assert_refused(f->path, "not a regular file");
    rmdir(f->path);
    const char *const names[] = {"e.glb", "e.gltf", "e.obj", "e.ply"};
    for (int i = 0; i < 4; i++) {
        assert_refused(write_text(f, names[i], ""), "empty");
        assert_refused(write_text(f, names[i], "\x01\x02 nonsense"), names[i]);
    }
}

#define ONE "'scenes':[{'nodes':[0]}],'nodes':[{'mesh':0}],"
#define MESH "'meshes':[{'primitives':[{" PRIMITIVE "}]}]"

/* Nobody writes to a pipe that a scene names: a scene that can do without is read, any other is refused. */
static void named_pipes(void **state)
{
    files *f = *state;
    message err;
    char pipe[128], text[4096], json[2048];
    const char *triangle = "usemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    snprintf(pipe, sizeof pipe, "%s/pipe.obj", f->folder);
    assert_int_equal(mkfifo(pipe, 0600), 0);
    alarm(20);
    assert_refused(pipe, "not a regular file");
    snprintf(text, sizeof text, "mtllib pipe.obj\n%s", triangle);
    assert_true(survives(write_text(f, "library.obj", text), &err));
    write_text(f, "texture.mtl", "newmtl a\nmap_Kd pipe.obj\n");
    snprintf(text, sizeof text, "mtllib texture.mtl\n%s", triangle);
    assert_true(survives(write_text(f, "texture.obj", text), &err));

    json[frame_json(ONE MESH, json, sizeof json)] = 0;
    const char *buffer = strstr(json, "172}");
    assert_non_null(buffer);
    snprintf(text, sizeof text, "%.*s172,\"uri\":\"%s\"%s", (int)(buffer - json), json, "square.bin", buffer + 3);
    write_file(f, "square.bin", f->bin, sizeof f->bin);
    assert_true(survives(write_text(f, "square.gltf", text), &err));
    snprintf(text, sizeof text, "%.*s172,\"uri\":\"%s\"%s", (int)(buffer - json), json, "pipe.obj", buffer + 3);
    assert_refused(write_text(f, "pipe.gltf", text), "pipe.obj");
    alarm(0);
}

static void bad_geometry(void **state)
{
    files *f = *state;
    const float not_a_number = NAN;
    memcpy(f->bin + 16, &not_a_number, sizeof not_a_number);
    assert_refused(write_glb(f, "nan.glb", ONE MESH), "vertex 1 is not finite");
    fill_bin(f->bin);
    f->bin[BIN_INDICES + 2] = 4;
    assert_refused(write_glb(f, "index.glb", ONE MESH), "1 triangles refer to vertices that do not exist");
    fill_bin(f->bin);
    memset(f->bin + BIN_INDICES, 0, 12);
    assert_refused(write_glb(f, "flat.glb", ONE MESH), "no triangle with area");
    fill_bin(f->bin);
    assert_refused(write_glb(f, "unused.glb", "'scenes':[{'nodes':[0]}],'nodes':[{}]," MESH), "no triangle with area");
    assert_refused(write_glb(f, "points.glb", ONE "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'mode':0}]}]"),
                   "no triangle with area");
    assert_refused(write_glb(f, "scale.glb", "'scenes':[{'nodes':[0]}],'nodes':[{'mesh':0,'scale':[1,1,0]}]," MESH),
                   "singular");
    assert_refused(write_text(f, "flat.obj", "v 0 0 0\nv 1 1 1\nv 2 2 2\nf 1 2 3\n"), "no triangle with area");
    assert_refused(write_text(f, "none.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"), "no triangle with area");
    assert_refused(write_text(f, "index.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"), "index.obj");
    assert_refused(write_text(f, "nan.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "not finite");
}

static void bad_structure(void **state)
{
    files *f = *state;
    assert_refused(write_glb(f, "none.glb", MESH), "names no scene");
    assert_refused(write_glb(f, "scene.glb", "'scene':1," ONE MESH), "names no scene");
    assert_refused(write_glb(f, "node.glb", "'scenes':[{'nodes':[1]}],'nodes':[{'mesh':0}]," MESH),
                   "node out of range");
    assert_refused(write_glb(f, "cycle.glb", "'scenes':[{'nodes':[0]}],'nodes':[{'mesh':0,'children':[0]}]," MESH),
                   "several parents");
    assert_refused(write_glb(f, "shared.glb", "'scenes':[{'nodes':[1,0]}],'nodes':[{'mesh':0},{'children':[0]}]," MESH),
                   "several parents");
    assert_refused(write_glb(f, "mesh.glb", "'scenes':[{'nodes':[0]}],'nodes':[{'mesh':1}]," MESH), "out of range");
    assert_refused(write_glb(f, "material.glb", ONE "'meshes':[{'primitives':[{" PRIMITIVE ",'material':0}]}]"),
                   "material out of range");
    assert_refused(write_glb(f, "accessor.glb", ONE "'meshes':[{'primitives':[{'attributes':{'POSITION':9}}]}]"),
                   "no positions");
    assert_refused(
        write_glb(f, "fewer.glb", ONE "'meshes':[{'primitives':[{'attributes':{'POSITION':0,'NORMAL':3}}]}]"),
        "does not fit");
    assert_refused(write_glb(f, "lines.glb", ONE "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}]"),
                   "multiple of 3");
    assert_refused(write_glb(f, "needs.glb", ONE MESH ",'extensionsRequired':['KHR_draco_mesh_compression']"),
                   "KHR_draco_mesh_compression");
    assert_refused(write_glb(f, "image.glb", ONE MESH ",'images':[{'bufferView':4,'mimeType':'png'}]"), "mimeType");
    char deep[12000], *at = deep + sprintf(deep, "'scenes':[{'nodes':[299]}],'nodes':[{'mesh':0}");
    for (int i = 1; i < 300; i++)
        at += sprintf(at, ",{'children':[%d]}", i - 1);
    sprintf(at, "]," MESH);
    assert_refused(write_glb(f, "deep.glb", deep), "nested deeper");
}

static void bad_ranges(void **state)
{
    files *f = *state;
    static const char *const edits[][3] = {
        {"\"byteLength\":172", "\"byteLength\":173", "not in the file"},
        {"\"byteOffset\":128,\"byteLength\":12}", "\"byteOffset\":128,\"byteLength\":99}", "bufferView 3"},
        {"\"byteOffset\":128,\"byteLength\":12}", "\"byteOffset\":9e9,\"byteLength\":12}", "bufferView 3"},
        {"\"byteOffset\":128,\"byteLength\":12}", "\"byteOffset\":-12,\"byteLength\":12}", "bufferView 3"},
        {"\"count\":6,", "\"count\":9,", "accessor 3"},
        {"\"count\":4,\"type\":\"VEC2\"", "\"count\":5,\"type\":\"VEC2\"", "accessor 2"},
        {"\"count\":6,", "\"cXXnt\":6,", "accessor 3"},
        {"\"componentType\":5123", "\"componentType\":5122", "unsigned"},
        {"\"componentType\":5123", "\"componentType\":5124", "accessor 3"},
        {"\"componentType\":5126", "\"componentType\":5121", "three floats"},
        {"\"bufferView\":3,", "\"bufferView\":7,", "accessor 3"},
    };
    for (size_t i = 0; i < sizeof edits / sizeof *edits; i++) {
        char data[8192];
        size_t size = make_glb(f, ONE MESH, data, sizeof data);
        char *at = strstr(data + 20, edits[i][0]);
        assert_non_null(at);
        assert_int_equal(strlen(edits[i][0]), strlen(edits[i][1]));
        memcpy(at, edits[i][1], strlen(edits[i][1]));
        assert_refused(write_file(f, "range.glb", data, size), edits[i][2]);
    }
}

static const char text_ply[] = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
                               "property float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n"
                               "0 0 0\n1 0 0\n1 1 0\n0 2 0\n4 0 1 2 3\n3 0 1 3\n";
static const char text_obj[] =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\no one\nf 1/1/1 2/1/1 3/1/1 4/1/1\n"
    "g two\nusemtl x\nf 1 2 3\nf -4//1 -3//1 -2//1\nl 1 2\np 1\n";

static void bad_ply(void **state)
{
    files *f = *state;
    const char vertices[] = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
    const char faces[] = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
    static const char *const cases[][3] = {
        {"", "0 0 0 1 0 0 0 1 0 3 0 1 3", "vertex index 3 out of range"},
        {"", "0 0 0 1 0 0 0 1 0 3 0 1 -1", "face 0"},
        {"", "0 0 0 1 0 0 0 1 0 3 0 1", "face 0 is damaged or cut off"},
        {"", "0 0 0 1 0 0 0 nan 0 3 0 1 2", "not finite"},
        {"element other 4294967295\nproperty int a\n", "0 0 0 1 0 0 0 1 0 3 0 1 2", "too short"},
        {"element empty 999999999999\n", "0 0 0 1 0 0 0 1 0 2 0 1", "no triangle"},
        {"element vertex 1\nproperty int x\n", "0 0 0 1 0 0 0 1 0 3 0 1 2", "x, y and z"},
        {"property list float\n", "", "bad line"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[1024];
        snprintf(text, sizeof text, "ply\nformat ascii 1.0\n%s%s%s%s\n", vertices, cases[i][0], faces, cases[i][1]);
        assert_refused(write_text(f, "bad.ply", text), cases[i][2]);
    }
    assert_refused(write_text(f, "bad.ply", "ply\nformat martian 1.0\nend_header\n"), "martian");
    assert_refused(write_text(f, "bad.ply", "ply\nformat ascii 1.0\nelement vertex 3\n"), "no end");
}

/* Every length, and many wrong bytes. Some damage does no harm, most of it does. */
static void damage(files *f, const char *name, const char *data, size_t size, uint32_t variants)
{
    static char bad[16384];
    message err;
    uint32_t taken = 0, refused = 0;
    assert_true(survives(write_file(f, name, data, size), &err));
    for (size_t length = 0; length < size; length += length < 64 || size < 400 ? 1 : 7)
        if (survives(write_file(f, name, data, length), &err))
            taken++;
    assert_true(strstr(name, ".glb") == NULL || taken == 0); /* a GLB says how long it is */
    taken = 0;
    for (uint32_t i = 0; i < variants; i++) {
        rng r = rng_make(7, i);
        memcpy(bad, data, size);
        for (uint32_t flips = 1 + rng_u32(&r) % 4; flips > 0; flips--) {
            uint32_t at = rng_u32(&r) % (uint32_t)size;
            bad[at] = (char)(bad[at] ^ 1 << rng_u32(&r) % 8);
        }
        if (survives(write_file(f, name, bad, size), &err))
            taken++;
        else
            refused++;
    }
    assert_true(taken > 0 && refused > 0);
}

static void damaged_files(void **state)
{
    static char data[16384];
    files *f = *state;
    size_t size = make_glb(f, RICH_JSON, data, sizeof data);
    damage(f, "damaged.glb", data, size, 300);
    damage(f, "damaged.ply", text_ply, sizeof text_ply - 1, 300);
    damage(f, "damaged.obj", text_obj, sizeof text_obj - 1, 300);
}

/* assimp forgets part of an OBJ file that it refuses; nobody else here allocates by C++. */
__attribute__((visibility("default"))) const char *__lsan_default_suppressions(void);
const char *__lsan_default_suppressions(void)
{
    return "leak:libassimp\nleak:libstdc++\n";
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(not_a_file),  cmocka_unit_test(bad_geometry), cmocka_unit_test(bad_structure),
        cmocka_unit_test(bad_ranges),  cmocka_unit_test(bad_ply),      cmocka_unit_test(damaged_files),
        cmocka_unit_test(named_pipes),
    };
    notice_enable(false);
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
