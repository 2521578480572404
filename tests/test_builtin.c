/* SPDX-License-Identifier: Apache-2.0 */
/* The generated scenes and the shapes they are made of. */
#include "../renderers/common/builtin.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

static const char *const names[] = {"atrium",
                                    "cornell",
                                    "shapes",
                                    "dominoes",
                                    "plant",
                                    "conference-lights",
                                    "conference-lights-192",
                                    "conference-lights-floating",
                                    "conference-lights-diffuse"};
enum { SCENES = sizeof names / sizeof *names };

static scene *build(const char *name)
{
    scene *s = NULL;
    assert_true(scene_builtin(name, &s));
    assert_non_null(s);
    return s;
}

static uint64_t count_triangles(const scene *s)
{
    uint64_t n = 0;
    for (uint32_t i = 0; i < s->instance_count; ++i)
        n += s->meshes[s->instances[i].mesh].triangle_count;
    return n;
}

static void test_names(void **state)
{
    (void)state;
    scene *s;
    for (int i = 0; i < SCENES; ++i)
        assert_string_equal(scene_builtin_names[i], names[i]);
    assert_null(scene_builtin_names[SCENES]);
    const char *const unknown[] = {"",  "Atrium", "atrium ", "teapot", "conference-lights-0", "conference-lights-5x",
                                   NULL};
    for (int i = 0; i < 7; ++i) {
        s = (scene *)&s;
        assert_false(scene_builtin(unknown[i], &s));
        assert_null(s);
    }
}

/* Every generated triangle survives the check of scene_finish: the count with instances does not go down. */
static void test_accepted_with_expected_counts(void **state)
{
    (void)state;
    static const struct {
        uint64_t least, most;
        uint32_t lights, cameras;
        bool environment;
    } expected[SCENES] = {
        {200000, 600000, 1, 2, true},   {80, 200, 0, 1, false},        {40000, 100000, 0, 3, false},
        {400 * 44, 20000, 0, 3, false}, {30000, 200000, 0, 3, false},  {50000, 200000, 24, 2, false},
        {50000, 200000, 192, 2, false}, {50000, 200000, 24, 2, false}, {50000, 200000, 192, 2, false}};
    notice_enable(false);
    for (int i = 0; i < SCENES; ++i) {
        scene *s = build(names[i]);
        message err = {""};
        const uint64_t before = count_triangles(s);
        assert_in_range(before, expected[i].least, expected[i].most);
        assert_int_equal(s->light_count, expected[i].lights);
        assert_int_equal(s->camera_count, expected[i].cameras);
        assert_int_equal(s->environment != NULL, expected[i].environment);
        if (!scene_finish(s, &err))
            fail_msg("%s", err.text);
        assert_int_equal(s->triangle_count, before);
        assert_int_equal(count_triangles(s), before);
        assert_int_equal(s->camera_count, expected[i].cameras);
        scene_free(s);
    }
}

static void check_mesh(const scene *s, const mesh *m)
{
    assert_true(m->vertex_count && m->triangle_count);
    assert_true(m->material < s->material_count);
    for (size_t i = 0; i < 3 * (size_t)m->vertex_count; ++i)
        assert_true(isfinite(m->positions[i]));
    for (size_t i = 0; i < 3 * (size_t)m->triangle_count; ++i)
        assert_true(m->indices[i] < m->vertex_count);
    for (uint32_t i = 0; m->normals && i < m->vertex_count; ++i) {
        const float *n = m->normals + 3 * (size_t)i;
        assert_true(fabsf(v3_length(v3(n[0], n[1], n[2])) - 1.0f) < 1e-5f);
    }
}

/* Smooth normals stay on the outer side of their triangles, within the crease angle's reach. */
static void check_normals_face_out(const mesh *m)
{
    for (size_t t = 0; m->normals && t < m->triangle_count; ++t) {
        vec3 p[3];
        for (int k = 0; k < 3; ++k) {
            const float *q = m->positions + 3 * (size_t)m->indices[3 * t + (size_t)k];
            p[k] = v3(q[0], q[1], q[2]);
        }
        vec3 face = v3_normalize(v3_cross(v3_sub(p[1], p[0]), v3_sub(p[2], p[0])));
        for (int k = 0; k < 3; ++k) {
            const float *n = m->normals + 3 * (size_t)m->indices[3 * t + (size_t)k];
            assert_true(v3_dot(face, v3(n[0], n[1], n[2])) > 0.3f);
        }
    }
}

static void test_meshes(void **state)
{
    (void)state;
    for (int i = 0; i < SCENES; ++i) {
        scene *s = build(names[i]);
        uint32_t smooth = 0;
        for (uint32_t k = 0; k < s->mesh_count; ++k) {
            check_mesh(s, &s->meshes[k]);
            check_normals_face_out(&s->meshes[k]);
            smooth += s->meshes[k].normals != NULL;
        }
        assert_int_equal(smooth == 0, strcmp(names[i], "cornell") == 0);
        for (uint32_t k = 0; k < s->instance_count; ++k) {
            assert_true(s->instances[k].mesh < s->mesh_count);
            for (int j = 0; j < 12; ++j)
                assert_true(isfinite(s->instances[k].to_world[j]));
        }
        scene_free(s);
    }
}

static bool same(const void *a, const void *b, size_t bytes)
{
    return (!a && !b) || (a && b && memcmp(a, b, bytes) == 0);
}

static void test_deterministic(void **state)
{
    (void)state;
    for (int i = 0; i < SCENES; ++i) {
        scene *a = build(names[i]), *b = build(names[i]);
        assert_int_equal(a->mesh_count, b->mesh_count);
        assert_int_equal(a->instance_count, b->instance_count);
        assert_true(same(a->instances, b->instances, a->instance_count * sizeof(instance)));
        for (uint32_t k = 0; k < a->mesh_count; ++k) {
            const mesh *m = &a->meshes[k], *n = &b->meshes[k];
            assert_int_equal(m->vertex_count, n->vertex_count);
            assert_int_equal(m->triangle_count, n->triangle_count);
            assert_true(same(m->positions, n->positions, 12 * (size_t)m->vertex_count));
            assert_true(same(m->normals, n->normals, 12 * (size_t)m->vertex_count));
            assert_true(same(m->indices, n->indices, 12 * (size_t)m->triangle_count));
        }
        scene_free(a);
        scene_free(b);
    }
}

/* The middle of the picture looks at the scene's box. */
static bool looks_at_bounds(const scene *s, const camera *c)
{
    const float eye[3] = {c->eye.x, c->eye.y, c->eye.z}, way[3] = {c->forward.x, c->forward.y, c->forward.z};
    const float lo[3] = {s->bounds_min.x, s->bounds_min.y, s->bounds_min.z};
    const float hi[3] = {s->bounds_max.x, s->bounds_max.y, s->bounds_max.z};
    float from = 0.0f, to = 1e9f;
    for (int a = 0; a < 3; ++a) {
        if (fabsf(way[a]) < 1e-9f) {
            if (eye[a] < lo[a] || eye[a] > hi[a])
                return false;
            continue;
        }
        float t0 = (lo[a] - eye[a]) / way[a], t1 = (hi[a] - eye[a]) / way[a];
        from = fmaxf(from, fminf(t0, t1));
        to = fminf(to, fmaxf(t0, t1));
    }
    return from <= to;
}

static void test_cameras(void **state)
{
    (void)state;
    notice_enable(false);
    for (int i = 0; i < SCENES; ++i) {
        scene *s = build(names[i]);
        assert_true(scene_finish(s, NULL));
        for (uint32_t k = 0; k < s->camera_count; ++k) {
            const camera *c = &s->cameras[k];
            assert_true(c->name[0] != '\0');
            assert_true(looks_at_bounds(s, c));
            assert_true(fabsf(v3_dot(c->forward, c->up)) < 1e-5f);
            assert_true(fabsf(v3_length(c->forward) - 1.0f) < 1e-5f && fabsf(v3_length(c->up) - 1.0f) < 1e-5f);
            assert_true(c->yfov > 0.3f && c->yfov < 1.5f);
        }
        scene_free(s);
    }
}

/* What the sun gives the atrium's floor is some times what the whole sky gives. */
static void test_atrium_light_is_balanced(void **state)
{
    (void)state;
    scene *s = build("atrium");
    const light *sun = &s->lights[0];
    assert_int_equal(sun->kind, LIGHT_DIRECTIONAL);
    float from_sky = 0.0f, from_sun = luminance(sun->intensity) * -sun->direction.y;
    enum { STEPS = 64 };
    for (int i = 0; i < STEPS; ++i) {
        float y = sqrtf(((float)i + 0.5f) / STEPS);
        from_sky += PI_F / STEPS * luminance(environment_radiance(s->environment, v3(sqrtf(1.0f - y * y), y, 0.0f)));
    }
    assert_true(from_sun > 4.0f * from_sky && from_sun < 10.0f * from_sky);
    scene_free(s);
}

typedef struct edge {
    float from[3], to[3];
} edge;

static int edge_order(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(edge));
}

/* Closed and consistently turned: each directed edge has its reverse. Takes vertices at one position for one vertex.
 * A `single` solid has each directed edge once; solids that touch may share some. Returns the enclosed volume, or -1.
 */
static double closed_volume(const mesh *m, bool single)
{
    const size_t n = 3 * (size_t)m->triangle_count;
    edge *edges = calloc(n, sizeof *edges), *reverse = calloc(n, sizeof *reverse);
    double volume = 0.0;
    for (size_t i = 0; i < n; ++i) {
        const float *p = m->positions + 3 * (size_t)m->indices[i];
        const float *q = m->positions + 3 * (size_t)m->indices[i % 3 == 2 ? i - 2 : i + 1];
        for (int k = 0; k < 3; ++k) {
            edges[i].from[k] = p[k] + 0.0f; /* -0 becomes 0 */
            edges[i].to[k] = q[k] + 0.0f;
        }
        if (i % 3 == 0) {
            const float *r = m->positions + 3 * (size_t)m->indices[i + 2];
            volume += v3_dot(v3(p[0], p[1], p[2]), v3_cross(v3(q[0], q[1], q[2]), v3(r[0], r[1], r[2]))) / 6.0;
        }
    }
    for (size_t i = 0; i < n; ++i) {
        memcpy(reverse[i].from, edges[i].to, sizeof edges[i].to);
        memcpy(reverse[i].to, edges[i].from, sizeof edges[i].from);
    }
    qsort(edges, n, sizeof *edges, edge_order);
    qsort(reverse, n, sizeof *reverse, edge_order);
    bool closed = memcmp(edges, reverse, n * sizeof *edges) == 0;
    for (size_t i = 1; i < n && single; ++i)
        closed &= edge_order(&edges[i - 1], &edges[i]) != 0;
    free(reverse);
    free(edges);
    return closed ? volume : -1.0;
}

/* Moves the shape into a scene with and without smooth normals; both must be closed and enclose `volume`. */
static void check_solid(shape *s, double volume, double tolerance)
{
    scene *home = scene_new("solid");
    shape copy = {0};
    shape_append(&copy, s, xform_place(v3(0.0f, 0.0f, 0.0f), 0.0f, 1.0f));
    uint32_t flat = shape_to_mesh(home, s, 0, 0.0f), smooth = shape_to_mesh(home, &copy, 0, 40.0f);
    assert_null(s->positions);
    assert_null(home->meshes[flat].normals);
    assert_non_null(home->meshes[smooth].normals);
    check_normals_face_out(&home->meshes[smooth]);
    assert_true(fabs(closed_volume(&home->meshes[flat], true) - volume) <= tolerance * volume);
    assert_true(fabs(closed_volume(&home->meshes[smooth], true) - volume) <= tolerance * volume);
    scene_free(home);
}

static void test_solids_closed(void **state)
{
    (void)state;
    const double pi = 3.14159265358979;
    shape s = {0};
    shape_box(&s, v3(-1.0f, 0.0f, 2.0f), v3(1.0f, 3.0f, 4.0f), 0.0f);
    assert_int_equal(s.triangle_count, 12);
    check_solid(&s, 12.0, 1e-6);
    shape_box(&s, v3(-1.0f, 0.0f, 2.0f), v3(1.0f, 3.0f, 4.0f), 0.1f);
    assert_int_equal(s.triangle_count, 44);
    /* each edge loses a prism of 0.1 x 0.1 / 2, of the small cube at each corner a sixth is left */
    check_solid(&s, 12.0 - 0.005 * (4 * 7 - 24 * 0.1) - 8 * (5.0 / 6.0) * 0.001, 1e-5);
    shape_sphere(&s, v3(0.5f, 1.0f, -2.0f), 0.5f, 96);
    check_solid(&s, pi / 6.0, 0.01);
    shape_torus(&s, 2.0f, 0.5f, 96, 48);
    check_solid(&s, 2.0 * pi * pi * 2.0 * 0.25, 0.01);
    const vec3 path[3] = {{0.0f, 0.0f, 0.0f}, {0.0f, 1.0f, 0.0f}, {0.0f, 2.0f, 0.0f}};
    const float radii[3] = {0.2f, 0.2f, 0.2f};
    shape_tube(&s, path, radii, 3, 64);
    check_solid(&s, pi * 0.08, 0.01);
    shape_arch(&s, 1.0f, 1.3f, 1.5f, 0.25f, 48);
    check_solid(&s, 0.5 * (2.6 * 1.5 - pi / 2.0), 0.01);
    shape_half_ring(&s, 1.0f, 1.2f, 0.25f, 48);
    check_solid(&s, 0.5 * pi / 2.0 * (1.44 - 1.0), 0.01);
    profile p = {0};
    profile_to(&p, 0.0f, 0.0f);
    profile_to(&p, 1.0f, 0.0f);
    profile_to(&p, 1.0f, 0.0f);
    profile_to(&p, 1.0f, 2.0f);
    profile_to(&p, 0.5f, 2.0f);
    profile_to(&p, 0.5f, 1.0f);
    profile_to(&p, 0.0f, 1.0f);
    assert_int_equal(p.count, 6);
    shape_lathe(&s, &p, 128);
    check_solid(&s, pi * 1.75, 0.01);
}

/* All meshes of a scene are closed but the leaves, which are single sheets. */
static void test_scene_meshes_closed(void **state)
{
    (void)state;
    static const uint32_t sheets[SCENES] = {6, 0, 0, 0, 3, 1, 1, 1, 1};
    for (int i = 0; i < SCENES; ++i) {
        scene *s = build(names[i]);
        uint32_t open = 0;
        for (uint32_t k = 0; k < s->mesh_count; ++k)
            open += closed_volume(&s->meshes[k], false) <= 0.0;
        assert_int_equal(open, sheets[i]);
        scene_free(s);
    }
}

/* As many lights as the name says, all as bright together, below their fixtures; floating furniture is the same but
 * higher. */
static void test_conference_lights(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint32_t lights;
    } expected[] = {{"conference-lights-1", 1},
                    {"conference-lights", 24},
                    {"conference-lights-25-floating", 25},
                    {"conference-lights-1000", 1000},
                    {"conference-lights-65536-floating", 65536}};
    float floor_height[2] = {0};
    double power = 0.0;
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
        scene *s = build(expected[i].name);
        double all = 0.0;
        assert_int_equal(s->light_count, expected[i].lights);
        for (uint32_t k = 0; k < s->light_count; k++) {
            const light *l = &s->lights[k];
            all += (double)l->intensity.y;
            assert_true(l->position.y > 2.9f && l->position.y < 2.97f);
            assert_true(fabsf(l->position.x) < 5.61f && fabsf(l->position.z) < 3.31f);
        }
        if (i == 0)
            power = all;
        else
            assert_true(fabs(all / power - 1.0) < 1e-4);
        bool floating = strstr(expected[i].name, "floating") != NULL;
        floor_height[floating] = s->instances[s->instance_count - 1].to_world[7];
        scene_free(s);
    }
    assert_true(floor_height[0] == 0.0f && fabsf(floor_height[1] - 0.3f) < 1e-6f);
    scene *diffuse = build("conference-lights-48-diffuse");
    assert_int_equal(diffuse->light_count, 48);
    assert_true(diffuse->lights[47].power == 1 && diffuse->lights[47].cos_outer == 0.0f);
    scene_free(diffuse);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_names),
        cmocka_unit_test(test_accepted_with_expected_counts),
        cmocka_unit_test(test_meshes),
        cmocka_unit_test(test_deterministic),
        cmocka_unit_test(test_cameras),
        cmocka_unit_test(test_atrium_light_is_balanced),
        cmocka_unit_test(test_solids_closed),
        cmocka_unit_test(test_scene_meshes_closed),
        cmocka_unit_test(test_conference_lights),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
