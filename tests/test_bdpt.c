/* SPDX-License-Identifier: Apache-2.0 */
/* Bidirectional path tracing on scenes with a known answer, and each strategy against all together. Seeds are fixed,
 * and means must lie within 3 standard errors. */
#include "bdpt_support.h"

/* ------------------------------------------------------------------------------------------------------ furnaces */

static void furnaces(void **state)
{
    (void)state;
    const struct {
        const char *name;
        material_kind kind;
        float color, emission;
    } cases[] = {{"empty", MATERIAL_DIFFUSE, -1.0f, 0.0f},
                 {"diffuse", MATERIAL_DIFFUSE, 0.7f, 0.3f},
                 {"white", MATERIAL_DIFFUSE, 1.0f, 0.0f},
                 {"mirror", MATERIAL_CONDUCTOR, 1.0f, 0.0f},
                 {"glass", MATERIAL_DIELECTRIC, 1.0f, 0.0f}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int h = 0; h < 2; h++) {
            scene *s = furnace();
            if (cases[i].color >= 0.0f) {
                uint32_t m = add_material(s, cases[i].kind, cases[i].color);
                s->materials[m].roughness = 0.0f;
                s->materials[m].emission = v3(cases[i].emission, cases[i].emission, cases[i].emission);
                add_sphere(s, 16, cases[i].kind != MATERIAL_DIFFUSE, m);
            }
            stage g = stage_new(s, inside(), 16, 12);
            g.v.settings.heuristic = h ? HEURISTIC_POWER : HEURISTIC_BALANCE;
            tally t = stage_tally(&g, NULL, 600, 1);
            assert_within(&t, 1.0, 0.0, cases[i].name);
            assert_true(tally_error(&t) < 0.004 * error_growth(600, RENDERINGS));
            stage_free(&g);
        }
}

/* Black walls of radiance 1, and a glossy square, seen at a slant: its radiance is its albedo in that direction. */
static void glossy_furnace(void **state)
{
    (void)state;
    const struct {
        material_kind kind;
        float roughness;
    } cases[] = {
        {MATERIAL_GLOSSY, 0.3f}, {MATERIAL_GLOSSY, 0.8f}, {MATERIAL_CONDUCTOR, 0.3f}, {MATERIAL_CONDUCTOR, 1.0f}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene *s = scene_new("glossy furnace");
        uint32_t wall = add_material(s, MATERIAL_DIFFUSE, 0.0f), m = add_material(s, cases[i].kind, 0.9f);
        s->materials[wall].emission = v3(1, 1, 1);
        s->materials[wall].two_sided = true;
        s->materials[m].roughness = cases[i].roughness;
        add_box(s, v3(-2, -2, -2), v3(2, 2, 2), 63, wall);
        add_quad(s, v3(-0.5f, 0, -0.5f), v3(0, 0, 1), v3(1, 0, 0), m);
        stage g = stage_new(s, camera_look(v3(0.9f, 0.8f, 0.5f), v3(0, 0, 0), v3(0, 1, 0), 0.02f), 16, 16);
        surface hit;
        assert_true(tracer_closest(g.t, g.v.camera.eye, g.v.camera.forward, &hit));
        tally t = stage_tally(&g, NULL, 200, 1);
        assert_within(&t, directional_albedo(&hit), 1e-3, "gloss"); /* quadrature, and the angle over the picture */
        assert_true(tally_error(&t) < 0.003 * error_growth(200, RENDERINGS));
        stage_free(&g);
    }
}

/* ---------------------------------------------------------------------------------------------------- strategies */

/* Paths of 2, 3 and 4 edges: each way to find them alone has the mean of all of them weighted. */
static void strategies_agree(void **state)
{
    (void)state;
    for (int kind = 0; kind < ROOMS; kind += case_step()) {
        stage g = stage_new(room_scene(kind), room_camera(), 16, 12);
        settings *f = &g.v.settings;
        for (f->edges = 2; f->edges <= 4; f->edges++) {
            f->light_vertices = -1;
            tally all = stage_tally(&g, NULL, 500, 1000);
            bool met = kind == ROOM_LAMP || kind == ROOM_SKY;
            for (f->light_vertices = met ? 0 : 1; f->light_vertices <= f->edges; f->light_vertices++) {
                char name[64];
                tally one = stage_tally(&g, NULL, 500, 5000 + 2000 * (uint64_t)f->light_vertices);
                snprintf(name, sizeof name, "light %d, %d edges, s = %d", kind, f->edges, f->light_vertices);
                assert_same_mean(&one, &all, name);
            }
        }
        stage_free(&g);
    }
}

/* One room with a lamp, or two with a door between them and the camera in the dark one. It does not see the lamp. */
static stage rooms(bool wall)
{
    scene *s = scene_new("rooms");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[lamp].emission = v3(5, 5, 5);
    add_box(s, v3(-2, -1, -2), v3(2, 1, 2), 63, grey);
    if (wall)
        add_box(s, v3(-2, -1, -0.05f), v3(1, 1, 0.05f), 63, grey);
    add_quad(s, v3(-1, 0.99f, -1.5f), v3(0.8f, 0, 0), v3(0, 0, 0.8f), lamp);
    return stage_new(s, camera_look(v3(-1.5f, 0, 1.8f), v3(-0.5f, -1, 1), v3(0, 1, 0), 1.2f), 128, 128);
}

/* What pilot paths say against a rendering: a tenth of the light that connections and chance bring, in all regions
 * together; occlusion goes first where a wall hides most, and the roulette where nothing is hidden. */
static void pilots(void **state)
{
    (void)state;
    for (int wall = 0; wall < 2; wall++) {
        stage g = rooms(wall);
        settings *f = &g.v.settings;
        f->partners = 4;
        tally rendered = stage_tally(&g, NULL, 12, 5000), least = {0};
        for (f->seed = 1; f->seed <= 24; f->seed++) {
            pilot *p = pilot_new(&g.v, false);
            double sum = 0.0;
            for (int r = 0; r < PILOT_REGIONS * PILOT_REGIONS; r++)
                sum += (double)p->least[r] / (PILOT_REGIONS * PILOT_REGIONS);
            tally_add(&least, 10.0 * sum);
            assert_true(p->visibility_first == wall);
            assert_null(p->eye_density);
            pilot_free(p);
        }
        assert_same_mean(&least, &rendered, wall ? "light behind a wall" : "light");
        assert_true(tally_error(&least) < 0.1 * tally_mean(&least));
        stage_free(&g);
    }
}

/* Visibility before or after what a connection brings: the same image bit for bit. Roulette of little connections
 * leaves fewer, and the mean as it is. */
static void arrangements(void **state)
{
    (void)state;
    for (int kind = 0; kind < ROOMS; kind += case_step()) {
        stage g = stage_new(room_scene(kind), room_camera(), 24, 16);
        settings *f = &g.v.settings;
        f->partners = 4;
        static pilot after, before, roulette;
        before.visibility_first = true;
        const pilot *pilots[] = {NULL, &after, &before, &roulette};
        film films[3];
        counts asked[4];
        double seconds;
        tally t[2];
        for (int i = 0; i < PILOT_REGIONS * PILOT_REGIONS; i++)
            roulette.least[i] = 0.05f;
        for (int i = 0; i < 4; i++) {
            film one = film_new(f->width, f->height);
            g.v.pilot = pilots[i];
            passes *p = passes_new(&g.v, NULL, &one);
            assert_true(passes_render(p, 0));
            asked[i] = passes_counts(p, &seconds, &seconds);
            passes_free(p);
            if (i < 3)
                films[i] = one;
            else
                film_free(&one);
        }
        size_t bytes = (size_t)f->width * f->height * sizeof(rgb);
        assert_memory_equal(films[0].mean.pixels, films[1].mean.pixels, bytes);
        assert_memory_equal(films[0].mean.pixels, films[2].mean.pixels, bytes);
        for (int i = 0; i < 3; i++)
            film_free(&films[i]);
        assert_true(asked[0].asked == asked[1].asked && asked[0].camera == asked[2].camera);
        assert_true(asked[2].asked >= asked[1].asked); /* those that bring nothing are asked as well */
        print_message("light %d: %.3f of the connections survive\n", kind,
                      (double)asked[3].asked / (double)asked[1].asked);
        assert_true(asked[3].asked < asked[1].asked * 9 / 10 && asked[3].camera < asked[1].camera);
        for (int i = 0; i < 2; i++) {
            g.v.pilot = i ? &roulette : NULL;
            t[i] = stage_tally(&g, NULL, 300, 1000 + 1000 * (uint64_t)i);
        }
        assert_same_mean(&t[0], &t[1], "roulette");
        stage_free(&g);
    }
}

/* Light, glass, glass, floor, camera: found by paths from the eye alone and by paths from the light alone. `half`: edge
 * of the lamp; a pane or a ball of glass. */
static stage behind_glass(float half, bool ball)
{
    scene *s = scene_new("glass");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f), glass = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    uint32_t lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[lamp].emission = v3(1.0f / (half * half), 1.0f / (half * half), 1.0f / (half * half));
    add_quad(s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), grey);
    add_quad(s, v3(-half, 2, -half), v3(2 * half, 0, 0), v3(0, 0, 2 * half), lamp);
    if (ball) {
        const float place[12] = {0.3f, 0, 0, 0.1f, 0, 0.3f, 0, 0.5f, 0, 0, 0.3f, 0};
        add_sphere(s, 24, true, glass);
        memcpy(s->instances[s->instance_count - 1].to_world, place, sizeof place);
    } else {
        add_box(s, v3(-1.5f, 1.0f, -1.5f), v3(1.5f, 1.1f, 1.5f), 63, glass);
    }
    /* sees no glass: paths from the light alone do not find the floor behind it */
    camera c = ball ? camera_look(v3(0.9f, 0.5f, 0.3f), v3(0.1f, 0, 0), v3(0, 1, 0), 0.25f)
                    : camera_look(v3(1.5f, 0.6f, 1.5f), v3(0, 0, 0), v3(0, 1, 0), 0.8f);
    return stage_new(s, c, 16, 12);
}

static void caustics(void **state)
{
    (void)state;
    for (int ball = 0; ball < 2; ball++) {
        stage g = behind_glass(0.5f, ball);
        settings *f = &g.v.settings;
        f->edges = 4;
        tally all = stage_tally(&g, NULL, 600, 1);
        f->light_vertices = 0;
        tally eye = stage_tally(&g, NULL, 1500, 10000);
        f->light_vertices = 4;
        tally lit = stage_tally(&g, NULL, 600, 20000);
        assert_same_mean(&eye, &all, ball ? "ball, from the eye" : "pane, from the eye");
        assert_same_mean(&lit, &all, ball ? "ball, from the light" : "pane, from the light");
        assert_true(tally_mean(&all) > 20.0 / error_growth(600, RENDERINGS) * tally_error(&all)); /* there is one */
        stage_free(&g);
    }
}

/* A small light behind glass: eye paths hardly ever meet it, but nothing is lost. Through the pane the floor gets as
 * much as from a lamp forty times as wide and as much dimmer, but for where it falls. */
static void small_light_behind_glass(void **state)
{
    (void)state;
    tally t[2];
    for (int i = 0; i < 2; i++) {
        stage g = behind_glass(i ? 0.05f : 0.0025f, false);
        t[i] = stage_tally(&g, NULL, 600, 1);
        g.v.settings.light_vertices = 0;
        g.v.settings.edges = 4;
        tally eye = stage_tally(&g, NULL, 20, 1);
        if (i == 0)
            assert_true(tally_mean(&eye) < 0.5 * tally_mean(&t[i])); /* not by luck */
        stage_free(&g);
    }
    assert_same_mean(&t[0], &t[1], "small and large light behind glass");
}

/* A texture colours what a lamp reflects, not what it emits, whichever way a path is found. */
static void textured_emitters(void **state)
{
    (void)state;
    scene *s = room_scene(ROOM_LAMP);
    texture x = {.width = 2, .height = 2, .rgba = xmalloc(16)};
    memset(x.rgba, 128, 16);
    x.rgba[0] = 255, x.rgba[13] = 0;
    uint32_t index = scene_add_texture(s, x);
    for (uint32_t i = 0; i < s->mesh_count; i++) {
        mesh *m = &s->meshes[i];
        if (!(luminance(s->materials[m->material].emission) > 0.0f))
            continue;
        s->materials[m->material].texture = (int32_t)index;
        m->uvs = xmalloc(2 * (size_t)m->vertex_count * sizeof(float));
        for (uint32_t k = 0; k < 2 * m->vertex_count; k++)
            m->uvs[k] = 3.0f * m->positions[3 * (k / 2) + 2 * (k % 2)];
    }
    stage g = stage_new(s, room_camera(), 16, 12);
    settings *f = &g.v.settings;
    f->edges = 3;
    tally all = stage_tally(&g, NULL, 500, 1);
    for (f->light_vertices = 0; f->light_vertices <= 3; f->light_vertices++) {
        tally one = stage_tally(&g, NULL, 500, 5000 + 1000 * (uint64_t)f->light_vertices);
        assert_same_mean(&one, &all, "textured lamp");
    }
    stage_free(&g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(furnaces),
        cmocka_unit_test(glossy_furnace),
        cmocka_unit_test(strategies_agree),
        cmocka_unit_test(arrangements),
        cmocka_unit_test(pilots),
        cmocka_unit_test(caustics),
        cmocka_unit_test(small_light_behind_glass),
        cmocka_unit_test(textured_emitters),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
