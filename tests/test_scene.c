/* SPDX-License-Identifier: Apache-2.0 */
/* The scene container: transforms, cameras, and the check that completes a scene. */
#include "../renderers/common/scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#define assert_close(a, b) assert_float_equal(a, b, 1e-5f)

static void assert_vec(vec3 a, float x, float y, float z)
{
    assert_close(a.x, x);
    assert_close(a.y, y);
    assert_close(a.z, z);
}

static void *copy(const void *from, size_t bytes)
{
    return memcpy(xcalloc(1, bytes + 16), from, bytes);
}

/* Two triangles of a unit square in z = 0, standing once. */
static scene *square_scene(void)
{
    const float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    scene *s = scene_new("square");
    instance once = {.mesh = 0};
    scene_add_material(s, (material){.color = {0.5f, 0.5f, 0.5f}, .roughness = 1, .ior = 1.5f, .texture = -1});
    scene_add_mesh(s, (mesh){.vertex_count = 4,
                             .triangle_count = 2,
                             .positions = copy(positions, sizeof positions),
                             .indices = copy(indices, sizeof indices)});
    memcpy(once.to_world, transform_identity, sizeof once.to_world);
    scene_add_instance(s, once);
    return s;
}

static void assert_refused(scene *s, const char *part)
{
    message err = {""};
    assert_false(scene_finish(s, &err));
    if (!strstr(err.text, part))
        fail_msg("'%s' does not say '%s'", err.text, part);
    assert_null(strchr(err.text, '\n'));
    scene_free(s);
}

static void transforms(void **state)
{
    (void)state;
    /* scale by (2, 3, 4), then a quarter turn about z, then a shift */
    const float m[12] = {0, -3, 0, 10, 2, 0, 0, 20, 0, 0, 4, 30};
    assert_vec(transform_point(m, v3(1, 1, 1)), 7, 22, 34);
    assert_vec(transform_vector(m, v3(1, 1, 1)), -3, 2, 4);
    assert_vec(transform_normal(m, v3(1, 1, 1)), -1.0f / 3, 0.5f, 0.25f);
    /* a mirror and a shear: normals stay perpendicular to what they stood on, and on its outside */
    const float shear[12] = {-1, 0.5f, 0, 0, 0, 2, 0, 0, 0.25f, 0, 1, 0};
    vec3 n = transform_normal(shear, v3(0, 0, 1));
    assert_close(v3_dot(n, transform_vector(shear, v3(1, 0, 0))), 0);
    assert_close(v3_dot(n, transform_vector(shear, v3(0, 1, 0))), 0);
    assert_true(v3_dot(n, transform_vector(shear, v3(0, 0, 1))) > 0.5f);
    /* cubes of these scales leave the range of float */
    const float tiny[12] = {1e-15f, 0, 0, 0, 0, 1e-15f, 0, 0, 0, 0, 1e-15f, 0};
    assert_vec(v3_normalize(transform_normal(tiny, v3(0, 0, 1))), 0, 0, 1);
}

static void camera_axes(void **state)
{
    (void)state;
    camera c = camera_look(v3(1, 2, 3), v3(1, 2, -7), v3(0.1f, 5, 4), 0.5f);
    assert_vec(c.eye, 1, 2, 3);
    assert_vec(c.forward, 0, 0, -1);
    assert_close(v3_dot(c.forward, c.up), 0);
    assert_close(v3_length(c.up), 1);
    assert_true(c.up.y > 0.9f);
    assert_close(c.yfov, 0.5f);
    /* along up, and nowhere at all: still a frame */
    camera down = camera_look(v3(0, 5, 0), v3(0, 0, 0), v3(0, 1, 0), 1),
           none = camera_look(v3(1, 1, 1), v3(1, 1, 1), v3(0, 1, 0), 1);
    assert_vec(down.forward, 0, -1, 0);
    assert_close(v3_length(down.up), 1);
    assert_close(v3_dot(down.forward, down.up), 0);
    assert_close(v3_length(none.forward), 1);
    assert_close(v3_dot(none.forward, none.up), 0);
}

static void completes(void **state)
{
    message err = {""};
    (void)state;
    scene *s = square_scene();
    instance far = {.mesh = 0, .to_world = {2, 0, 0, 5, 0, 2, 0, 6, 0, 0, 2, 7}};
    scene_add_instance(s, far);
    for (int i = 0; i < 4; i++) /* inside the others' bounds */
        scene_add_instance(s, (instance){.mesh = 0, .to_world = {1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1}});
    scene_add_instance(
        s, (instance){.mesh = 0, .to_world = {1, 0, 0, -0.5f, 0, 1, 0, 0.5f, 0, 0, 1, 0}}); /* half inside */
    assert_true(scene_finish(s, &err));
    assert_int_equal(s->triangle_count, 14);
    assert_vec(s->bounds_min, -0.5f, 0, 0);
    assert_vec(s->bounds_max, 7, 8, 7);
    assert_non_null(s->environment);
    assert_int_equal(s->camera_count, 1);
    /* all corners of the bounds lie inside the cone of the camera */
    const camera *c = &s->cameras[0];
    for (int i = 0; i < 8; i++) {
        vec3 p = v3(i & 1 ? 7 : -0.5f, i & 2 ? 8 : 0, i & 4 ? 7 : 0), d = v3_normalize(v3_sub(p, c->eye));
        assert_true(v3_dot(d, c->forward) >= cosf(0.5f * c->yfov) - 1e-4f);
    }
    scene_free(s);
}

static void adds_a_sky_only_to_the_dark(void **state)
{
    message err;
    (void)state;
    scene *s = square_scene();
    scene_add_light(s, (light){.kind = LIGHT_POINT, .intensity = {1, 1, 1}});
    scene_add_camera(s, camera_look(v3(0, 0, 5), v3(0, 0, 0), v3(0, 1, 0), 1));
    assert_true(scene_finish(s, &err));
    assert_null(s->environment);
    assert_int_equal(s->camera_count, 1);
    scene_free(s);

    s = square_scene();
    s->materials[0].emission = v3(0, 1, 0);
    assert_true(scene_finish(s, &err));
    assert_null(s->environment);
    scene_free(s);

    s = square_scene(); /* a lamp that is off is meant to be */
    scene_add_light(s, (light){.kind = LIGHT_POINT});
    assert_true(scene_finish(s, &err));
    assert_null(s->environment);
    scene_free(s);

    s = square_scene(); /* an emissive material that nothing wears gives no light */
    scene_add_material(s, s->materials[0]);
    s->materials[1].emission = v3(9, 9, 9);
    assert_true(scene_finish(s, &err));
    assert_non_null(s->environment);
    scene_free(s);
}

static void drops_flat_triangles(void **state)
{
    message err;
    (void)state;
    scene *s = square_scene();
    const float positions[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0.1f, 0.1f, 0, 0.3f, 0.3f, 0, 100, 100, 100};
    const uint32_t indices[] = {0, 1, 1, 0, 1, 2, 0, 4, 5, 0, 2, 3, 3, 3, 3}, flat[] = {0, 0, 1};
    free(s->meshes[0].positions);
    free(s->meshes[0].indices);
    s->meshes[0].positions = copy(positions, sizeof positions);
    s->meshes[0].indices = copy(indices, sizeof indices);
    s->meshes[0].vertex_count = 7;
    s->meshes[0].triangle_count = 5;
    uint32_t empty = scene_add_mesh(s, (mesh){.vertex_count = 7,
                                              .triangle_count = 1,
                                              .positions = copy(positions, sizeof positions),
                                              .indices = copy(flat, sizeof flat)});
    scene_add_instance(s, s->instances[0]);
    s->instances[1].mesh = empty;
    scene_add_instance(s, s->instances[0]);
    assert_true(scene_finish(s, &err));
    assert_int_equal(s->meshes[0].triangle_count, 2);
    assert_int_equal(s->meshes[0].indices[2], 2);
    assert_int_equal(s->meshes[0].indices[5], 3);
    assert_int_equal(s->triangle_count, 4);
    assert_int_equal(s->instance_count, 2);
    assert_int_equal(s->instances[1].mesh, 0);
    assert_vec(s->bounds_max, 1, 1, 0); /* the unused vertex does not count */
    scene_free(s);
}

static void refuses(void **state)
{
    (void)state;
    assert_refused(scene_new("empty"), "no triangle with area");

    scene *s = square_scene();
    s->meshes[0].positions[4] = NAN;
    assert_refused(s, "vertex 1 is not finite");
    s = square_scene();
    s->meshes[0].indices[5] = 4;
    assert_refused(s, "vertex index 4 out of range");
    s = square_scene();
    s->meshes[0].material = 1;
    assert_refused(s, "material index 1 out of range");
    s = square_scene();
    s->instances[0].mesh = 1;
    assert_refused(s, "mesh index 1 out of range");
    s = square_scene();
    s->materials[0].texture = 0;
    assert_refused(s, "texture index 0 out of range");
    s = square_scene();
    memset(s->meshes[0].indices, 0, 6 * sizeof(uint32_t));
    assert_refused(s, "no triangle with area");
    s = square_scene();
    s->instance_count = 0;
    assert_refused(s, "no triangle with area");
}

static void refuses_bad_values(void **state)
{
    (void)state;
    scene *s = square_scene();
    s->instances[0].to_world[10] = 0;
    assert_refused(s, "singular");
    s = square_scene();
    s->instances[0].to_world[3] = INFINITY;
    assert_refused(s, "transform is not finite");
    s = square_scene();
    s->instances[0].to_world[3] = 3e38f;
    assert_refused(s, "beyond 1e+09 units");
    s = square_scene();
    for (int i = 0; i < 12; i++)
        s->meshes[0].positions[i] *= 3e38f;
    s->instances[0].to_world[0] = s->instances[0].to_world[5] = s->instances[0].to_world[10] =
        100; /* finite, then not */
    assert_refused(s, "beyond 1e+09 units");
    s = square_scene();
    s->materials[0].emission.y = -1;
    assert_refused(s, "colour");
    s = square_scene();
    s->materials[0].roughness = 2;
    assert_refused(s, "roughness");
    s = square_scene();
    scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL, .intensity = {1, 1, 1}});
    assert_refused(s, "light 0");
    s = square_scene();
    scene_add_light(s, (light){.kind = LIGHT_SPOT, .direction = {0, 0, 1}, .cos_inner = 0.1f, .cos_outer = 0.9f});
    assert_refused(s, "cone");
    s = square_scene();
    scene_add_light(s, (light){.kind = LIGHT_SPOT, .direction = {0, 0, 1}, .power = LIGHT_POWER_MAX + 1});
    assert_refused(s, "light 0: fall-off to the power of 32");
    s = square_scene();
    scene_add_camera(s, camera_look(v3(0, 0, 0), v3(0, 0, 1), v3(0, 1, 0), 0));
    assert_refused(s, "camera 0");
    s = square_scene(); /* Embree takes no rays that begin or point so far away */
    scene_add_camera(s, camera_look(v3(0, -1e30f, 0), v3(0, 0, 1), v3(1, 0, 0), 1));
    assert_refused(s, "camera 0: lies beyond 1e+12 units");
    s = square_scene();
    scene_add_light(s, (light){.kind = LIGHT_POINT, .position = {0, 0, 1e30f}, .intensity = {1, 1, 1}});
    assert_refused(s, "light 0: lies beyond 1e+12 units");
}

static void grows(void **state)
{
    (void)state;
    scene *s = scene_new("a name that is much too long for the sixty-four bytes that are there for it");
    assert_int_equal(strlen(s->name), 63);
    for (uint32_t i = 0; i < 1000; i++)
        assert_int_equal(scene_add_instance(s, (instance){.mesh = i}), i);
    for (uint32_t i = 0; i < 1000; i++)
        assert_int_equal(s->instances[i].mesh, i);
    scene_free(s);
    scene_free(NULL);
    free(xmalloc(0));
    free(xcalloc(0, 5));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(transforms),
        cmocka_unit_test(camera_axes),
        cmocka_unit_test(completes),
        cmocka_unit_test(adds_a_sky_only_to_the_dark),
        cmocka_unit_test(drops_flat_triangles),
        cmocka_unit_test(refuses),
        cmocka_unit_test(refuses_bad_values),
        cmocka_unit_test(grows),
    };
    notice_enable(false);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
