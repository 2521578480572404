/* SPDX-License-Identifier: Apache-2.0 */
/* Scene files that are in order: what a file says is what the scene holds. */
#include "../renderers/common/scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cjson/cJSON.h>
#include <cmocka.h>

#include "scene_files.h"

static void assert_vec(vec3 a, float x, float y, float z, float tolerance)
{
    assert_float_equal(a.x, x, tolerance);
    assert_float_equal(a.y, y, tolerance);
    assert_float_equal(a.z, z, tolerance);
}

static scene *load(const char *path)
{
    scene *s;
    message err = {""};
    if (!scene_load(path, &s, &err) || !scene_finish(s, &err))
        fail_msg("%s", err.text);
    return s;
}

static const material *material_of(const scene *s, uint32_t index)
{
    return &s->materials[s->meshes[s->instances[index].mesh].material];
}

/* The material of the instance that was moved to x. */
static const material *material_at(const scene *s, float x)
{
    for (uint32_t i = 0; i < s->instance_count; i++)
        if (fabsf(s->instances[i].to_world[3] - x) < 1e-3f)
            return material_of(s, i);
    fail_msg("nothing stands at %g", (double)x);
    return NULL;
}

#define USE(m) "{'primitives':[{" PRIMITIVE ",'material':" #m "}]}"
#define PUT(m) "{'mesh':" #m ",'translation':[" #m "e1,0,0]}"

/* Mesh i wears material i, but the scene meets them in another order, and material 2 is worn by nothing. */
static void glb_materials(void **state)
{
    scene *s = load(write_glb(
        *state, "materials.glb",
        "'scenes':[{'nodes':[5,3,8,0,1,4,6,7]}],'nodes':[" PUT(0) "," PUT(1) "," PUT(2) "," PUT(3) "," PUT(4) "," PUT(
            5) "," PUT(6) "," PUT(7) "," PUT(8) "],"
                                                "'meshes':[" USE(0) "," USE(1) "," USE(2) "," USE(3) "," USE(4) "," USE(
                                                    5) "," USE(6) "," USE(7) ",{'primitives':[{" PRIMITIVE
                                                                             "}]}],'materials':["
                                                                             "{'name':'same','emissiveFactor':[1,1,0.5]"
                                                                             ",'doubleSided':true,'extensions':"
                                                                             "{'KHR_materials_emissive_strength':{'"
                                                                             "emissiveStrength':16}}},"
                                                                             "{'name':'same','emissiveFactor':[1,0,0],'"
                                                                             "extras':{'radiance':[7,7,7]},'extensions'"
                                                                             ":"
                                                                             "{'KHR_materials_emissive_strength':{'"
                                                                             "emissiveStrength':4}}},"
                                                                             "{'name':'same'},"
                                                                             "{'pbrMetallicRoughness':{'"
                                                                             "baseColorFactor':[2,0.5,-1,1],'"
                                                                             "roughnessFactor':0.2}},"
                                                                             "{'pbrMetallicRoughness':{'metallicFactor'"
                                                                             ":0.4,'roughnessFactor':0.5}},"
                                                                             "{'pbrMetallicRoughness':{'metallicFactor'"
                                                                             ":0},'extensions':{'KHR_materials_"
                                                                             "transmission':"
                                                                             "{'transmissionFactor':0.9},'KHR_"
                                                                             "materials_ior':{'ior':1.33}}},"
                                                                             "{'pbrMetallicRoughness':{'metallicFactor'"
                                                                             ":0},'extras':{'transmissive':true}},"
                                                                             "{'pbrMetallicRoughness':{'metallicFactor'"
                                                                             ":0,'roughnessFactor':9},"
                                                                             "'extras':{'radiance':[1,2,3]}}]"));
    assert_int_equal(s->instance_count, 8);
    assert_vec(material_at(s, 0)->emission, 16, 16, 8, 1e-4f);
    assert_true(material_at(s, 0)->two_sided);
    assert_vec(material_at(s, 10)->emission, 4, 0, 0, 1e-4f);
    assert_false(material_at(s, 10)->two_sided);
    assert_int_equal(material_at(s, 30)->kind, MATERIAL_CONDUCTOR);
    assert_vec(material_at(s, 30)->color, 1, 0.5f, 0, 1e-6f);
    assert_float_equal(material_at(s, 30)->roughness, 0.2f, 1e-6f);
    assert_int_equal(material_at(s, 40)->kind, MATERIAL_GLOSSY);
    assert_int_equal(material_at(s, 50)->kind, MATERIAL_DIELECTRIC);
    assert_float_equal(material_at(s, 50)->ior, 1.33f, 1e-6f);
    assert_int_equal(material_at(s, 60)->kind, MATERIAL_DIELECTRIC);
    assert_float_equal(material_at(s, 60)->ior, 1.5f, 1e-6f);
    assert_int_equal(material_at(s, 70)->kind, MATERIAL_DIFFUSE);
    assert_float_equal(material_at(s, 70)->roughness, 1, 1e-6f);
    assert_vec(material_at(s, 70)->emission, 1, 2, 3, 1e-6f);
    assert_int_equal(material_at(s, 80)->kind, MATERIAL_DIFFUSE); /* none given */
    assert_null(s->environment);
    scene_free(s);
}

static void glb_instances_and_cameras(void **state)
{
    /* Node 0 turns a quarter about y (x -> -z, z -> x), scales by 2, moves. */
    scene *s = load(write_glb(
        *state, "nodes.glb",
        "'scenes':[{'nodes':[]},{'nodes':[0]}],'scene':1,'nodes':[{'children':[1,2,3],'translation':[1,2,3],"
        "'rotation':[0,0.7071068,0,0.7071068],'scale':[2,2,2]},{'mesh':0},{'mesh':0,'translation':[0,0,1]},"
        "{'children':[4],'translation':[1,0,0]},{'camera':1,'name':'eye'}],'meshes':[{'primitives':[{" PRIMITIVE "}]}],"
        "'cameras':[{'type':'perspective','perspective':{'yfov':0.1}},{'type':'perspective',"
        "'perspective':{'yfov':0.7,'aspectRatio':2}}]"));
    assert_int_equal(s->mesh_count, 1);
    assert_int_equal(s->instance_count, 2);
    assert_int_equal(s->triangle_count, 4);
    assert_vec(transform_point(s->instances[0].to_world, v3(1, 1, 1)), 3, 4, 1, 1e-5f);
    assert_vec(transform_point(s->instances[1].to_world, v3(1, 1, 1)), 5, 4, 1, 1e-5f);
    assert_vec(s->bounds_min, 1, 2, 1, 1e-5f);
    assert_vec(s->bounds_max, 3, 4, 3, 1e-5f);
    assert_int_equal(s->camera_count, 1);
    assert_string_equal(s->cameras[0].name, "eye");
    assert_vec(s->cameras[0].eye, 1, 2, 1, 1e-5f);
    assert_vec(s->cameras[0].forward, -1, 0, 0, 1e-5f);
    assert_vec(s->cameras[0].up, 0, 1, 0, 1e-5f);
    assert_float_equal(s->cameras[0].yfov, 0.7f, 1e-6f);
    scene_free(s);
}

static void glb_lights(void **state)
{
    scene *s = load(write_glb(
        *state, "lights.glb",
        "'scenes':[{'nodes':[0,1,2,3,4]}],'extensions':{'KHR_lights_punctual':{'lights':["
        "{'type':'point','color':[1,0.5,0.25],'intensity':1000},{'type':'directional','intensity':3},"
        "{'type':'spot','intensity':8,'spot':{'innerConeAngle':0.2,'outerConeAngle':0.5}}]}},'nodes':[{'mesh':0},"
        "{'translation':[1,2,3],'extensions':{'KHR_lights_punctual':{'light':0}}},"
        "{'translation':[4,5,6],'extensions':{'KHR_lights_punctual':{'light':0}}},"
        "{'rotation':[-0.7071068,0,0,0.7071068],'scale':[3,3,3],'extensions':{'KHR_lights_punctual':{'light':1}}},"
        "{'translation':[7,8,9],'rotation':[0,0.7071068,0,0.7071068],'extensions':{'KHR_lights_punctual':{'light':2}}}]"
        ","
        "'meshes':[{'primitives':[{" PRIMITIVE "}]}]"));
    assert_int_equal(s->light_count, 4);
    assert_int_equal(s->lights[0].kind, LIGHT_POINT);
    assert_vec(s->lights[0].position, 1, 2, 3, 1e-6f);
    assert_vec(s->lights[0].intensity, 1000, 500, 250, 1e-3f);
    assert_vec(s->lights[1].position, 4, 5, 6, 1e-6f); /* the same light, on another node */
    assert_int_equal(s->lights[2].kind, LIGHT_DIRECTIONAL);
    assert_vec(s->lights[2].direction, 0, -1, 0, 1e-5f);
    assert_vec(s->lights[2].intensity, 3, 3, 3, 1e-6f);
    assert_int_equal(s->lights[3].kind, LIGHT_SPOT);
    assert_vec(s->lights[3].position, 7, 8, 9, 1e-6f);
    assert_vec(s->lights[3].direction, -1, 0, 0, 1e-5f);
    assert_float_equal(s->lights[3].cos_inner, cosf(0.2f), 1e-6f);
    assert_float_equal(s->lights[3].cos_outer, cosf(0.5f), 1e-6f);
    assert_null(s->environment);
    scene_free(s);
}

#define TEXTURED(i) "{'pbrMetallicRoughness':{'metallicFactor':0,'baseColorTexture':{'index':" #i "}}}"

static void textures_and_normals(void **state)
{
    files *f = *state;
    write_file(f, "beside.tga", f->bin + BIN_TEXTURE, 30);
    scene *s = load(
        write_glb(f, "textures.glb",
                  "'scenes':[{'nodes':[0,1,3,4,5]}],'nodes':[" PUT(0) "," PUT(1) ",{}," PUT(3) "," PUT(4) "," PUT(
                      5) "],"
                         "'meshes':[" USE(0) "," USE(1) "," USE(0) "," USE(2) "," USE(
                             3) ",{'primitives':[{'attributes':"
                                "{'POSITION':0},'indices':3}]}],'materials':[" TEXTURED(0) "," TEXTURED(1) "," TEXTURED(
                                    2) "," TEXTURED(0) "],"
                                                       "'textures':[{'source':0},{'source':1},{'source':2}],'images':[{"
                                                       "'bufferView':4,'mimeType':'image/png'},"
                                                       "{'uri':'beside.tga'},{'uri':'nowhere.png'}]"));
    assert_int_equal(s->texture_count, 2); /* material 3 shares the first one's */
    assert_int_equal(material_at(s, 30)->texture, -1);
    assert_int_equal(material_at(s, 0)->texture, material_at(s, 40)->texture);
    assert_int_not_equal(material_at(s, 0)->texture, material_at(s, 10)->texture);
    for (int i = 0; i < 2; i++) {
        const texture *t = &s->textures[material_at(s, i == 0 ? 0 : 10)->texture];
        const uint8_t expected[16] = {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255};
        assert_int_equal(t->width, 2);
        assert_int_equal(t->height, 2);
        assert_memory_equal(t->rgba, expected, sizeof expected);
    }
    const mesh *m = &s->meshes[s->instances[0].mesh], *bare = &s->meshes[s->instances[4].mesh];
    assert_non_null(m->normals);
    assert_non_null(m->uvs);
    assert_memory_equal(m->normals, f->bin + BIN_NORMALS, 48);
    assert_float_equal(m->uvs[1], 0.25f, 1e-6f);
    assert_float_equal(m->uvs[4], 1, 1e-6f);
    assert_float_equal(m->uvs[5], 1, 1e-6f);
    assert_null(bare->normals);
    assert_null(bare->uvs);
    scene_free(s);
}

static void gltf_with_its_buffer_beside(void **state)
{
    files *f = *state;
    char json[8192];
    size_t length =
        frame_json("'scenes':[{'nodes':[0]}],'nodes':[{'mesh':0}],'meshes':[{'primitives':[{" PRIMITIVE "}]}]", json,
                   sizeof json - 64);
    char *at = strstr(json, "172}");
    const char uri[] = "172,\"uri\":\"shape.bin\"";
    memmove(at + strlen(uri), at + 3, length - (size_t)(at + 3 - json));
    memcpy(at, uri, strlen(uri));
    write_file(f, "shape.bin", f->bin, BIN_SIZE);
    scene *s = load(write_file(f, "text.gltf", json, length + strlen(uri) - 3));
    assert_string_equal(s->name, "text");
    assert_int_equal(s->triangle_count, 2);
    assert_vec(s->bounds_max, 1, 1, 0, 0);
    scene_free(s);
}

static void obj_file(void **state)
{
    files *f = *state;
    write_file(f, "beside.tga", f->bin + BIN_TEXTURE, 30);
    write_text(
        f, "shapes.mtl",
        "newmtl matte\nKd 0.1 0.2 0.3\nmap_Kd beside.tga\nillum 1\n"
        "newmtl shiny\nKd 0.4 0.4 0.4\nKs 0.5 0.5 0.5\nNs 30\nillum 2\n"
        "newmtl mirror\nKs 0.9 0.8 0.7\nillum 3\nnewmtl glass\nNi 1.4\nillum 4\nnewmtl lamp\nKd 0 0 0\nKe 3 20 1\n"
        "newmtl exported\nKd 0.5 0.5 0.5\nNi 1\nillum 4\nnewmtl thin\nd 0.2\nillum 2\n");
    scene *s = load(write_text(
        f, "shapes.obj",
        "mtllib shapes.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 0.75\nvt 0 1\nvn 0 0 1\n"
        "usemtl matte\nf 1/1/1 2/2/1 3/3/1 4/4/1\nusemtl shiny\nf 1 2 3\nusemtl mirror\nf 1 2 3\nf 1 3 4\nf 2 3 4\n"
        "usemtl glass\nf 1 2 3\nusemtl lamp\nf -4 -3 -2\nusemtl exported\nf 1 2 3\nusemtl thin\nf 1 2 3\nl 1 2\n"));
    assert_int_equal(s->triangle_count, 10);
    assert_int_equal(s->instance_count, 7);
    const material *matte = material_of(s, 0), *shiny = material_of(s, 1), *mirror = material_of(s, 2);
    const mesh *square = &s->meshes[s->instances[0].mesh];
    assert_int_equal(matte->kind, MATERIAL_DIFFUSE);
    assert_vec(matte->color, 0.1f, 0.2f, 0.3f, 1e-6f);
    assert_int_equal(matte->texture, 0);
    assert_int_equal(square->triangle_count, 2);
    assert_non_null(square->normals);
    for (uint32_t i = 0; i < square->vertex_count; i++) /* the file counts v from the bottom */
        if (square->positions[3 * i] == 1.0f && square->positions[3 * i + 1] == 1.0f)
            assert_float_equal(square->uvs[2 * i + 1], 0.25f, 1e-6f);
    assert_int_equal(shiny->kind, MATERIAL_GLOSSY);
    assert_float_equal(shiny->roughness, 0.5f, 1e-5f);
    assert_null(s->meshes[s->instances[1].mesh].normals);
    assert_int_equal(mirror->kind, MATERIAL_CONDUCTOR);
    assert_vec(mirror->color, 0.9f, 0.8f, 0.7f, 1e-6f);
    assert_float_equal(mirror->roughness, 0, 0);
    assert_int_equal(material_of(s, 3)->kind, MATERIAL_DIELECTRIC);
    assert_float_equal(material_of(s, 3)->ior, 1.4f, 1e-6f);
    assert_vec(material_of(s, 4)->emission, 3, 20, 1, 1e-5f);
    assert_int_equal(material_of(s, 5)->kind, MATERIAL_DIFFUSE);
    assert_int_equal(material_of(s, 6)->kind, MATERIAL_DIELECTRIC);
    scene_free(s);
}

static void ply_files(void **state)
{
    files *f = *state;
    scene *s = load(write_text(
        f, "text.ply",
        "ply\nformat ascii 1.0\ncomment a square\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
        "z\n"
        "property float nx\nproperty float ny\nproperty float nz\nproperty uchar red\nproperty float s\nproperty float "
        "t\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0 0 0 1 9 0 0.25\n1 0 0 0 0 1 9 1 0\n1 1 0 0 0 1 9 1 1\n0 2 0 0 0 1 9 0 1\n4 0 1 2 3\n3 0 1 3\n"));
    assert_int_equal(s->triangle_count, 3);
    assert_vec(s->bounds_max, 1, 2, 0, 0);
    assert_float_equal(s->meshes[0].normals[5], 1, 0);
    assert_float_equal(s->meshes[0].uvs[1], 0.75f, 0);
    assert_int_equal(s->materials[0].kind, MATERIAL_DIFFUSE);
    scene_free(s);

    const char head[] = "ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nproperty short y\n"
                        "property int z\nelement face 1\nproperty list uint ushort vertex_index\nend_header\n";
    const unsigned char body[] = {0,    0,    0, 0, 0, 0, 0, 0, 0xff, 0xfe, 0, 0, 0, 5, /* 0 -2 5 */
                                  0x40, 0x04, 0, 0, 0, 0, 0, 0, 0,    0,    0, 0, 0, 0, /* 2.5 0 0 */
                                  0,    0,    0, 0, 0, 0, 0, 0, 1,    0,    0, 0, 0, 0, /* 0 256 0 */
                                  0,    0,    0, 3, 0, 0, 0, 1, 0,    2};
    char data[512];
    memcpy(data, head, strlen(head));
    memcpy(data + strlen(head), body, sizeof body);
    s = load(write_file(f, "binary.ply", data, strlen(head) + sizeof body));
    assert_int_equal(s->triangle_count, 1);
    assert_vec(s->bounds_min, 0, -2, 0, 0);
    assert_vec(s->bounds_max, 2.5f, 256, 5, 0);
    assert_null(s->meshes[0].normals);
    scene_free(s);
}

/* --- Scenes too large to be part of the project --- */

static cJSON *read_json(const char *path)
{
    static char text[65536];
    FILE *in = fopen(path, "rb");
    if (!in)
        return NULL;
    size_t size = fread(text, 1, sizeof text, in);
    fclose(in);
    return cJSON_ParseWithLength(text, size);
}

static vec3 json_vec(const cJSON *camera_json, const char *key, bool z_up)
{
    const cJSON *a = cJSON_GetObjectItem(camera_json, key);
    float x = (float)cJSON_GetArrayItem(a, 0)->valuedouble, y = (float)cJSON_GetArrayItem(a, 1)->valuedouble;
    float z = (float)cJSON_GetArrayItem(a, 2)->valuedouble;
    return z_up ? v3(x, z, -y) : v3(x, y, z);
}

/* One of the scene's cameras is the one described. */
static bool has_camera(const scene *s, const cJSON *expected, bool z_up)
{
    vec3 eye = json_vec(expected, "eye", z_up), forward = json_vec(expected, "dir", z_up);
    vec3 up = json_vec(expected, "up", z_up);
    float yfov = (float)cJSON_GetObjectItem(expected, "yfov_deg")->valuedouble * PI_F / 180;
    vec3 right = v3_normalize(v3_cross(forward, up));
    up = v3_cross(right, v3_normalize(forward));
    for (uint32_t i = 0; i < s->camera_count; i++) {
        const camera *c = &s->cameras[i];
        if (v3_length(v3_sub(c->eye, eye)) < 1e-3f && v3_length(v3_sub(c->forward, forward)) < 1e-3f &&
            v3_length(v3_sub(c->up, up)) < 1e-3f && fabsf(c->yfov - yfov) < 1e-3f)
            return true;
    }
    return false;
}

static void check_large(const char *folder, const char *name, uint32_t lights, uint32_t cameras)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s/scene.json", folder, name);
    cJSON *facts = read_json(path);
    if (!facts)
        fail_msg("cannot read %s", path);
    bool z_up = strcmp(cJSON_GetObjectItem(facts, "up_axis")->valuestring, "z") == 0;
    snprintf(path, sizeof path, "%s/%s/%s.glb", folder, name, name);
    scene *s;
    message err = {""};
    if (!scene_load(path, &s, &err))
        fail_msg("%s", err.text);
    double unique = 0, all = 0;
    for (uint32_t i = 0; i < s->mesh_count; i++)
        unique += s->meshes[i].triangle_count;
    for (uint32_t i = 0; i < s->instance_count; i++)
        all += s->meshes[s->instances[i].mesh].triangle_count;
    assert_true(unique == cJSON_GetObjectItem(facts, "triangles_unique")->valuedouble);
    assert_true(all == cJSON_GetObjectItem(facts, "triangles_instanced")->valuedouble);
    assert_int_equal(s->mesh_count, cJSON_GetObjectItem(facts, "unique_meshes")->valueint);
    assert_int_equal(s->instance_count, cJSON_GetObjectItem(facts, "mesh_instances")->valueint);
    if (!scene_finish(s, &err))
        fail_msg("%s", err.text);
    assert_true((double)s->triangle_count > 0.998 * all);
    assert_int_equal(s->light_count, lights);
    assert_int_equal(s->camera_count, cameras);
    const cJSON *box = cJSON_GetObjectItem(facts, "bbox"), *expected;
    vec3 low = v3((float)cJSON_GetArrayItem(cJSON_GetArrayItem(box, 0), 0)->valuedouble, 0, 0);
    assert_float_equal(s->bounds_min.x, low.x, 1e-3f * fabsf(low.x));
    int met = 0;
    const char *lists[] = {"cameras", "suggested_cameras_not_from_source"};
    for (int i = 0; i < 2; i++)
        cJSON_ArrayForEach(expected, cJSON_GetObjectItem(facts, lists[i]))
        {
            assert_true(has_camera(s, expected, z_up));
            met++;
        }
    assert_int_equal(met, cameras);
    if (strcmp(name, "kitchen") == 0) { /* two materials of one name; the meshes tell them apart */
        assert_vec(s->materials[s->meshes[295].material].emission, 16.03204f, 16.03204f, 16.03204f, 1e-3f);
        assert_vec(s->materials[s->meshes[298].material].emission, 11.22124f, 11.22124f, 11.22124f, 1e-3f);
    } else if (strcmp(name, "conference") == 0) {
        assert_vec(s->lights[23].position, 1500, 640, 400, 1e-3f);
        assert_vec(s->lights[23].intensity, 180000, 180000, 180000, 1);
    } else if (strcmp(name, "breakfast") == 0) { /* along (-9, 4, -8), z up */
        vec3 d = v3_normalize(v3(-9, -8, -4));
        assert_int_equal(s->lights[0].kind, LIGHT_DIRECTIONAL);
        assert_vec(s->lights[0].direction, d.x, d.y, d.z, 1e-3f);
    }
    scene_free(s);
    cJSON_Delete(facts);
}

static void large_scenes(void **state)
{
    const char *folder = getenv("VCACHE_SCENES");
    (void)state;
    if (!folder)
        folder = "../shared/scenes";
    if (access(folder, R_OK) != 0) {
        print_message("skipped: no scenes at %s (set VCACHE_SCENES)\n", folder);
        skip();
    }
    check_large(folder, "kitchen", 0, 1);
    check_large(folder, "conference", 24, 1);
    check_large(folder, "living-room", 0, 1);
    check_large(folder, "breakfast", 1, 1);
    check_large(folder, "san-miguel", 0, 13);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(glb_materials),
        cmocka_unit_test(glb_instances_and_cameras),
        cmocka_unit_test(glb_lights),
        cmocka_unit_test(textures_and_normals),
        cmocka_unit_test(gltf_with_its_buffer_beside),
        cmocka_unit_test(obj_file),
        cmocka_unit_test(ply_files),
        cmocka_unit_test(large_scenes),
    };
    notice_enable(false);
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
