/* SPDX-License-Identifier: Apache-2.0 */
/* Known radiance where paths are odd, in each mode: specular chains, lamps in glass, water, each kind of light alone
 * and none, more partners than paths. Means over seeds lie within 3 standard errors. */
#include "bdpt_support.h"

/* ------------------------------------------------------------------------------------------------ specular chains */

/* Independent renderings: sample_count(seeds, 10). */
static tally mode_tally(stage *g, visibility_mode mode, int seeds)
{
    tally t = {0};
    for (int i = 0, count = sample_count(seeds, 10); i < count; i++) {
        g->v.settings.seed = 1 + (uint64_t)i;
        frame f = picture(g, mode);
        tally_add(&t, image_mean(&f.image));
        frame_free(&f);
    }
    return t;
}

static void add_placed_sphere(scene *s, float radius, vec3 at, uint32_t material_index)
{
    const float place[12] = {radius, 0, 0, at.x, 0, radius, 0, at.y, 0, 0, radius, at.z};
    add_sphere(s, 24, true, material_index);
    memcpy(s->instances[s->instance_count - 1].to_world, place, sizeof place);
}

/* In a furnace: two mirrors that face each other, glass in glass, a mirror and a diffuse ball in glass; 0.3 % are
 * allowed for paths that are cut off at 32 edges, and 1 % more for cells that the edges of shadows cross. */
static void specular_chains(void **state)
{
    (void)state;
    const char *const names[] = {"mirrors", "glass in glass", "mirror in glass", "diffuse in glass"};
    for (int i = 0; i < 4; i++) {
        scene *s = furnace();
        uint32_t mirror = add_material(s, MATERIAL_CONDUCTOR, 1.0f), glass = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
        uint32_t heavy = add_material(s, MATERIAL_DIELECTRIC, 1.0f), white = add_material(s, MATERIAL_DIFFUSE, 1.0f);
        s->materials[mirror].roughness = 0.0f;
        s->materials[heavy].ior = 2.2f;
        if (i == 0) {
            add_box(s, v3(-1.0f, -0.8f, -0.8f), v3(-0.9f, 0.8f, 0.8f), 63, mirror);
            add_box(s, v3(0.9f, -0.8f, -0.8f), v3(1.0f, 0.8f, 0.8f), 63, mirror);
        } else {
            add_placed_sphere(s, 1.0f, v3(0, 0, 0), glass);
            add_placed_sphere(s, 0.5f, v3(0.1f, 0, 0), i == 1 ? heavy : i == 2 ? mirror : white);
        }
        stage g = cached_stage(s, inside(), 32, 24, 4);
        for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++) {
            tally t = mode_tally(&g, (visibility_mode)mode, 10);
            assert_within(&t, 1.0, mode == VISIBILITY_CACHE ? 0.013 : 0.003, names[i]);
            assert_true(tally_error(&t) < 0.004);
        }
        stage_free(&g);
    }
}

/* Paths that meet the lamp in a glass ball by chance have the mean of all strategies; estimates as well. */
static void emitter_in_glass(void **state)
{
    (void)state;
    scene *s = scene_new("bulb");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f), glass = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    uint32_t lamp = add_material(s, MATERIAL_DIFFUSE, 0.2f);
    s->materials[lamp].emission = v3(10, 10, 10);
    add_quad(s, v3(-2, -1, -2), v3(0, 0, 4), v3(4, 0, 0), grey);
    add_quad(s, v3(-2, -1, -2), v3(4, 0, 0), v3(0, 3, 0), grey);
    add_placed_sphere(s, 0.6f, v3(0, 0, 0), glass);
    add_placed_sphere(s, 0.3f, v3(0, 0, 0), lamp);
    stage g = cached_stage(s, camera_look(v3(0.5f, 1.5f, 3.0f), v3(0, -0.5f, 0), v3(0, 1, 0), 0.8f), 16, 12, 1);
    tally all = mode_tally(&g, VISIBILITY_EXACT, 600);
    g.v.settings.light_vertices = 0;
    tally met = stage_tally(&g, NULL, 2000, 5000);
    assert_same_mean(&met, &all, "met by chance");
    g.v.settings.light_vertices = -1;
    assert_no_bias(&g, 40, "bulb");
    frame exact = picture(&g, VISIBILITY_EXACT), f = picture(&g, VISIBILITY_CACHE);
    assert_true(l_inf(&f.image, &exact.image) < 0.1);
    frame_free(&exact);
    frame_free(&f);
    stage_free(&g);
}

/* A corner under water, lit through its surface: paths that meet the lamp by chance, and those that are connected under
 * water, have the same mean. */
static void under_water(void **state)
{
    (void)state;
    scene *s = scene_new("water");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f), water = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    uint32_t lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[lamp].emission = v3(100, 100, 100);
    add_quad(s, v3(-1, -1, -1), v3(0, 0, 2), v3(2, 0, 0), grey);
    add_quad(s, v3(-1, -1, -1), v3(2, 0, 0), v3(0, 0.9f, 0), grey);
    add_quad(s, v3(-20, 0, -20), v3(0, 0, 40), v3(40, 0, 0), water);
    add_quad(s, v3(-1, 1.5f, -1), v3(2, 0, 0), v3(0, 0, 2), lamp);
    stage g = cached_stage(s, camera_look(v3(0, 1.2f, 1.8f), v3(0, -0.9f, -0.9f), v3(0, 1, 0), 0.5f), 16, 12, 1);
    settings *f = &g.v.settings;
    f->edges = 5;
    tally all = stage_tally(&g, NULL, 1000, 1);
    f->light_vertices = 0;
    tally met = stage_tally(&g, NULL, 2000, 5000);
    f->light_vertices = 3;
    tally connected = stage_tally(&g, NULL, 2000, 10000);
    assert_same_mean(&connected, &met, "connected under water, met by chance");
    assert_same_mean(&all, &met, "all, met by chance");
    assert_true(tally_error(&connected) < 0.05 * error_growth(2000, RENDERINGS) * tally_mean(&connected));
    stage_free(&g);
}

/* ------------------------------------------------------------------------------------------------- lights, none */

/* A floor alone under one light: what it reflects is known, and nothing is hidden, so the cache has no error either. */
static void lights_alone(void **state)
{
    (void)state;
    const char *const names[] = {"point", "directional", "environment"};
    for (int i = 0; i < 3; i++) {
        scene *s = scene_new("light");
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.5f);
        add_quad(s, v3(-10, 0, -10), v3(0, 0, 20), v3(20, 0, 0), grey);
        double expected = 0.5 / 3.14159265358979;
        if (i == 0)
            add_point_light(s, v3(0, 2, 0), 4.0f);
        else if (i == 1)
            scene_add_light(s,
                            (light){.kind = LIGHT_DIRECTIONAL, .direction = {0.6f, -0.8f, 0}, .intensity = {1, 1, 1}});
        else
            s->environment = environment_uniform(v3(1, 1, 1));
        expected *= i == 0 ? 1.0 : i == 1 ? 0.8 : 3.14159265358979;
        stage g = cached_stage(s, camera_look(v3(0, 3, 0), v3(0, 0, 0), v3(0, 0, -1), 0.02f), 24, 18, 4);
        for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++)
            for (int partners = 1; partners <= 4; partners += 3) {
                g.v.settings.partners = partners;
                tally t = mode_tally(&g, (visibility_mode)mode, 10);
                assert_within(&t, expected, 1e-3 * expected, names[i]); /* angles over the picture */
                assert_true(tally_error(&t) < 0.02 * expected);
            }
        stage_free(&g);
    }
}

/* No light at all, a light of no power, and the camera in a closed box, black or grey, in a lit room: black pictures.
 */
static void darkness(void **state)
{
    (void)state;
    for (int i = 0; i < 5; i++) {
        scene *s = i < 2 ? scene_new("dark") : room_scene(i < 4 ? ROOM_LAMP : ROOM_SKY);
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f), black = add_material(s, MATERIAL_DIFFUSE, 0.0f);
        if (i < 2) {
            add_box(s, v3(-2, -2, -2), v3(2, 2, 2), 31, grey);
            add_placed_sphere(s, 0.5f, v3(0, 0, 0), grey);
            if (i == 0)
                s->environment = environment_uniform(v3(0, 0, 0));
            else
                add_point_light(s, v3(0, 1, 0), 0.0f);
        } else {
            add_box(s, v3(0.1f, 0.2f, 3.0f), v3(0.7f, 0.8f, 4.0f), 63, i == 2 ? black : grey);
        }
        stage g = cached_stage(s, room_camera(), 32, 24, 4);
        assert_true((g.l == NULL) == (i < 2));
        for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++) {
            frame f = picture(&g, (visibility_mode)mode);
            if (mode != VISIBILITY_ESTIMATE || i <= 2)
                assert_true(image_mean(&f.image) == 0.0);
            assert_true(i <= 2 ? f.rays.asked == 0 : f.rays.asked > 1000);
            frame_free(&f);
        }
        stage_free(&g);
    }
}

/* ------------------------------------------------------------------------------------------------------ partners */

/* A furnace with a ball has radiance 1 with any number of partners, also in pictures whose batches have fewer paths
 * than that. */
static void few_partners(void **state)
{
    (void)state;
    const int partners[] = {1, 4, 64}, sizes[][2] = {{3, 5}, {1, 1}, {18, 3}};
    /* pictures of 15, 1, and 48 + 6 paths a batch; a share of the paths has so many partners */
    const double batches[][2] = {{15, 0}, {1, 0}, {48, 6}};
    for (int i = 0; i < 3; i++) {
        double asked = 0.0;
        for (int k = 0; k < 3; k++) {
            scene *s = furnace();
            add_placed_sphere(s, 1.0f, v3(0, 0, 0), add_material(s, MATERIAL_DIFFUSE, 1.0f));
            stage g = cached_stage(s, inside(), (uint32_t)sizes[i][0], (uint32_t)sizes[i][1], 1);
            g.v.settings.partners = partners[k];
            tally t = {0};
            uint64_t count = 0;
            for (int n = 0, all = sample_count(1000, RENDERINGS); n < all; n++) {
                g.v.settings.seed = 1 + (uint64_t)n;
                frame f = picture(&g, VISIBILITY_EXACT);
                tally_add(&t, image_mean(&f.image));
                count += f.rays.asked;
                frame_free(&f);
            }
            char name[64];
            snprintf(name, sizeof name, "%dx%d, %d partners", sizes[i][0], sizes[i][1], partners[k]);
            assert_within(&t, 1.0, 0.0, name);
            if (k == 0)
                asked = (double)count;
            const double *b = batches[i];
            double more = (b[0] * fmin(partners[k], b[0]) + b[1] * fmin(partners[k], b[1])) / (b[0] + b[1]);
            print_message("%.3f times the connections, expected %.3f\n", (double)count / asked, more);
            assert_true(fabs((double)count / asked / more - 1.0) < 0.05);
            stage_free(&g);
        }
    }
}

/* Batches of 64, 16 and 1 paths in one picture, of a floor of which a spot lights what is seen: paths from the light
 * weigh as much as connections. The single path in the last pixel has the mean that it has with one partner. */
static void unequal_batches(void **state)
{
    (void)state;
    enum { SIZE = 17, PARTNERS = 64 };
    scene *s = scene_new("spot");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.5f);
    add_quad(s, v3(-10, 0, -10), v3(0, 0, 20), v3(20, 0, 0), grey);
    scene_add_light(s, (light){.kind = LIGHT_SPOT,
                               .position = {0, 4, 0},
                               .direction = {0, -1, 0},
                               .intensity = {16, 16, 16},
                               .cos_inner = 0.9f,
                               .cos_outer = 0.89f});
    stage g = cached_stage(s, camera_look(v3(0, 3, 0), v3(0, 0, 0), v3(0, 0, -1), 0.64350111f), SIZE, SIZE, 1);
    double d2 = 2.0 * pow(16.0 / 17.0, 2) + 16.0; /* the light is so far from the floor there */
    double expected = 0.5 / 3.14159265358979 * 16.0 * 4.0 / pow(d2, 1.5);
    for (int partners = 1; partners <= PARTNERS; partners *= PARTNERS) {
        g.v.settings.partners = partners;
        tally all = {0}, last = {0};
        for (int n = 0, count = sample_count(600, RENDERINGS); n < count; n++) {
            g.v.settings.seed = 1 + (uint64_t)n;
            frame f = picture(&g, VISIBILITY_EXACT);
            tally_add(&all, image_mean(&f.image));
            tally_add(&last, (double)luminance(f.image.pixels[SIZE * SIZE - 1]));
            frame_free(&f);
        }
        print_message("%d partners: mean %f +- %f\n", partners, tally_mean(&all), tally_error(&all));
        assert_within(&last, expected, 1e-3 * expected, "last pixel"); /* floats, the angle over the pixel */
        assert_true(tally_error(&last) < 0.05 * error_growth(600, RENDERINGS) * expected);
    }
    stage_free(&g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(specular_chains), cmocka_unit_test(emitter_in_glass), cmocka_unit_test(under_water),
        cmocka_unit_test(lights_alone),    cmocka_unit_test(darkness),         cmocka_unit_test(few_partners),
        cmocka_unit_test(unequal_batches),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
