/* SPDX-License-Identifier: Apache-2.0 */
/* whitted --visibility grid on small scenes: against exact visibility, and the failures that the paper shows. */
#include "render_support.h"

#include "environment_lights.h"

/* A tilted ring, a box and a ball over a floor, under `lights` directional lights all over the sky. */
static stage ring_stage(uint32_t width, uint32_t height, int spp, int lights)
{
    scene *s = scene_new("ring");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f);
    add_box(s, v3(-4, -0.2f, -4), v3(4, 0, 4), 63, grey);
    add_box(s, v3(0.9f, 0.3f, -1.2f), v3(1.5f, 1.0f, -0.5f), 63, grey);
    enum { PIECES = 24 };
    vec3 corner[6 * PIECES]; /* a flat ring, standing askew */
    for (int i = 0; i < PIECES; i++) {
        vec3 p[4];
        for (int k = 0; k < 4; k++) {
            float angle = 2.0f * PI_F * (float)(i + (k & 1)) / PIECES, radius = k < 2 ? 0.55f : 0.9f;
            float x = radius * cosf(angle), y = radius * sinf(angle);
            p[k] = v3(-0.6f + x, 1.1f + 0.8f * y, 0.6f * y);
        }
        const int order[6] = {0, 1, 3, 0, 3, 2};
        for (int k = 0; k < 6; k++)
            corner[6 * i + k] = p[order[k]];
    }
    scene_add_instance(s, (instance){.mesh = scene_add_mesh(s, corners_mesh(corner, 2 * PIECES, grey))});
    memcpy(s->instances[s->instance_count - 1].to_world, transform_identity, sizeof transform_identity);
    rng r = rng_make(5, 0);
    for (int i = 0; i < lights; i++) {
        vec3 d = random_direction(&r);
        d.y = -fabsf(d.y);
        float e = 0.5f + rng_float(&r);
        scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL, .direction = d, .intensity = v3(e, 0.9f * e, 0.8f * e)});
    }
    s->environment = environment_uniform(v3(0.1f, 0.1f, 0.1f));
    stage g = stage_new(s, camera_look(v3(1.0f, 4.5f, 5.0f), v3(0, 0.3f, 0), v3(0, 1, 0), 0.75f), width, height, spp);
    g.v.settings.env_samples = g.v.settings.light_samples = 0;
    return g;
}

/* A sky that is brighter towards the horizon, a sun of a hundredth of a radian in its halo, clouds, dark ground. */
static float sun_and_sky(float u, float v)
{
    const vec3 sun = v3_normalize(v3(0.5f, 0.6f, 0.4f));
    float theta = PI_F * v, phi = 2.0f * PI_F * u;
    vec3 d = v3(sinf(theta) * cosf(phi), cosf(theta), sinf(theta) * sinf(phi));
    float angle = acosf(fminf(v3_dot(d, sun), 1.0f));
    float cloud = 1.0f + 0.6f * sinf(7.0f * d.x + 3.0f * d.y) * sinf(9.0f * d.z) * cosf(5.0f * d.y);
    float sky = d.y > 0.0f ? cloud * (1.0f - 0.6f * d.y) + 3.0f * expf(-angle / 0.08f) : 0.1f;
    return angle < 0.01f ? 20000.0f : sky;
}

/* Two clusters of lamps in a hall. */
static float lamps(float u, float v)
{
    const float lamp[][3] = {
        {0.2f, 0.3f, 60}, {0.22f, 0.32f, 90}, {0.24f, 0.3f, 60}, {0.6f, 0.2f, 120}, {0.62f, 0.22f, 80}};
    float e = (v < 0.5f ? 0.6f : 0.15f) * (1.0f + 0.5f * sinf(12.0f * u + 5.0f * v) * sinf(9.0f * v));
    for (size_t i = 0; i < sizeof lamp / sizeof *lamp; i++)
        e += fabsf(u - lamp[i][0]) < 0.012f && fabsf(v - lamp[i][1]) < 0.024f ? lamp[i][2] : 0.0f;
    return e;
}

static environment *map_of(float (*radiance)(float u, float v), uint32_t height)
{
    image map = image_new(2 * height, height);
    for (uint32_t i = 0; i < 2 * height * height; i++) {
        float u = ((float)(i % (2 * height)) + 0.5f) / (float)(2 * height),
              v = ((float)(i / (2 * height)) + 0.5f) / (float)height;
        float e = radiance(u, v);
        map.pixels[i] = v3(0.9f * e, e, 1.1f * e);
    }
    environment *e;
    message err = {{0}};
    if (!environment_from_image(&map, &e, &err))
        fail_msg("%s", err.text);
    image_free(&map);
    return e;
}

typedef struct outcome {
    frame exact, grid;
    double share, mispredicted; /* of what was asked */
} outcome;

static outcome run(stage *g, const char *mode)
{
    settings *f = &g->v.settings;
    outcome o;
    message err = {{0}};
    truth known = {0};
    f->lattice = true;
    f->visibility = VISIBILITY_EXACT;
    if (!grid_parse(mode, f, &err) || !frame_render(&g->v, "test", true, &known, NULL, &o.exact, &err))
        fail_msg("%s", err.text);
    f->visibility = VISIBILITY_GRID;
    if (!frame_render(&g->v, "test", true, NULL, &known, &o.grid, &err))
        fail_msg("%s", err.text);
    assert_sane(&o.exact);
    assert_sane(&o.grid);
    assert_int_equal(o.grid.rays.asked, o.exact.rays.asked);
    o.share = (double)o.grid.rays.traced / (double)o.grid.rays.asked;
    o.mispredicted = (double)o.grid.mispredicted / (double)o.grid.rays.asked;
    truth_free(&known);
    return o;
}

static void outcome_free(outcome *o)
{
    frame_free(&o->exact);
    frame_free(&o->grid);
}

/* -------------------------------------------------------------------------------------------------- TRUE and exact */

static void true_is_exact(void **state)
{
    (void)state;
    const struct {
        uint32_t width, height;
        int spp;
        const char *mode;
    } cases[] = {{97, 65, 1, "TRUE"}, {70, 41, 4, "TRUE,block=0"}, {33, 33, 16, "TRUE,block=64"}, {1, 1, 1, "TRUE"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        stage g = ring_stage(cases[i].width, cases[i].height, cases[i].spp, 70);
        outcome o = run(&g, cases[i].mode);
        assert_true(same_images(&o.exact.image, &o.grid.image));
        assert_int_equal(o.grid.rays.traced, o.exact.rays.traced);
        assert_int_equal(o.grid.mispredicted, 0);
        outcome_free(&o);
        stage_free(&g);
    }
}

/* All kinds of lights and materials: what is not the grid's is traced. The first directional light is not the scene's
 * first light. */
static void other_lights(void **state)
{
    (void)state;
    for (int spp = 1; spp <= 4; spp += 3) {
        stage g = mixed_stage(64, 48, spp);
        rng r = rng_make(6, 0);
        for (int i = 0; i < 20; i++) {
            vec3 d = random_direction(&r);
            scene_add_light(g.s, (light){.kind = i == 9 ? LIGHT_POINT : LIGHT_DIRECTIONAL,
                                         .direction = d,
                                         .position = v3(1, 2, 1),
                                         .intensity = v3(0.2f, 0.2f, i == 3 ? 0 : 0.2f)});
        }
        outcome o = run(&g, "TRUE");
        assert_true(same_images(&o.exact.image, &o.grid.image));
        assert_int_equal(o.grid.mispredicted, 0);
        outcome_free(&o);
        o = run(&g, "OPT,spacing=8");
        assert_true(o.grid.rays.traced < o.exact.rays.traced);
        assert_true(o.mispredicted < 1e-3);
        outcome_free(&o);
        stage_free(&g);
    }
}

/* Nothing for the grid to decide. */
static void no_directional_lights(void **state)
{
    (void)state;
    stage g = mixed_stage(32, 32, 1);
    outcome o = run(&g, "OPT");
    assert_int_equal(lights_of(&o.grid)->served, VISIBILITY_EXACT);
    assert_true(same_images(&o.exact.image, &o.grid.image));
    outcome_free(&o);
    stage_free(&g);
}

/* ------------------------------------------------------------------------------------------------------------ cells */

/* Cells of lights that come from a map, where many stand in rows: a triangulation, whose n corners have 3 n - 6 edges
 * (Euler). */
static void cells_of_a_map(void **state)
{
    (void)state;
    enum { MOST = 4096 };
    static environment_light lights[MOST];
    static float directions[3 * MOST];
    environment *sky = map_of(sun_and_sky, 256);
    for (uint32_t n = 200; n <= MOST; n += n == 200 ? 800 : 3096) {
        assert_int_equal(environment_lights(sky, n, lights), n);
        uint32_t edges = 0, close = 0;
        for (uint32_t i = 0; i < n; i++) {
            vec3_store(directions + 3 * (size_t)i, lights[i].direction);
            close += v3_dot(lights[i].direction, lights[0].direction) > 0.99995f; /* the first: of the sun */
        }
        assert_true(close >= (n == 200 ? 2 : 8)); /* stand in it */
        vcache_grid_lights *l;
        char why[VCACHE_MESSAGE_BYTES];
        if (vcache_grid_create_lights(directions, NULL, n, NULL, &l, why) != VCACHE_OK)
            fail_msg("%s", why);
        for (uint32_t i = 0; i < n; i++) {
            uint32_t degree = 0;
            for (uint32_t k = 0; k < n; k++)
                if (vcache_grid_neighbours(l, i)[k / 64] >> k % 64 & 1u) {
                    degree++;
                    if (!(vcache_grid_neighbours(l, k)[i / 64] >> i % 64 & 1u))
                        fail_msg("%u lights: %u and %u are neighbours one way", n, i, k);
                }
            assert_true(degree >= 3);
            assert_int_equal(vcache_grid_nearest(l, directions + 3 * (size_t)i), i);
            edges += degree;
        }
        if (edges != 2 * (3 * n - 6))
            fail_msg("%u lights: %u ends of edges, not %u", n, edges, 2 * (3 * n - 6));
        vcache_grid_destroy_lights(&l);
    }
    environment_free(sky);
}

/* ------------------------------------------------------------------------------------------------------ the methods */

/* Pixels in a row of which the lit radiance is wrong, at most: how far what was missed spreads along a scan line. */
static uint32_t longest_run(const outcome *o)
{
    uint32_t longest = 0, run = 0;
    const image *a = &o->exact.lit, *b = &o->grid.lit;
    for (uint32_t i = 0; i < a->width * a->height; i++) {
        bool wrong = memcmp(&a->pixels[i], &b->pixels[i], sizeof(rgb)) != 0;
        run = wrong && i % a->width != 0 ? run + 1 : wrong;
        longest = run > longest ? run : longest;
    }
    return longest;
}

/* What the paper says of them (Fig. 7, Table 1): in scanline order shadows that come out of nothing are missed, and
 * what was missed spreads, as staircases and filled holes. GNU does not do so; restricted flooding may, rarely. */
static void methods(void **state)
{
    (void)state;
    static const char *const names[] = {"SNB", "SNU", "SWU", "SWB", "GWB", "GNB",
                                        "GWU", "GNU", "FLO", "RES", "OPT", "NEAR"};
    enum { SNB, SNU, SWU, SWB, GWB, GNB, GWU, GNU, FLO, RES, OPT, NEAR, METHODS };
    double share[METHODS], wrong[METHODS];
    uint32_t runs[METHODS];
    stage g = ring_stage(161, 129, 1, 60);
    for (int m = 0; m < METHODS; m++) {
        char mode[16];
        snprintf(mode, sizeof mode, "%s,block=0", names[m]);
        outcome o = run(&g, mode);
        share[m] = o.share;
        wrong[m] = o.mispredicted;
        runs[m] = longest_run(&o);
        print_message("%s: %5.2f %% traced, %.4f %% wrong, %u in a row\n", names[m], 100 * share[m], 100 * wrong[m],
                      runs[m]);
        outcome_free(&o);
    }
    assert_true(wrong[SNB] > 5.0 * wrong[GNU] && wrong[SNU] > 5.0 * wrong[GNU]);
    for (int m = GWB; m < METHODS; m++)
        assert_true(wrong[m] < 0.001);
    assert_true(wrong[GNU] <= wrong[OPT] && wrong[SNB] > 3.0 * wrong[OPT] && wrong[SNU] > 3.0 * wrong[OPT]);
    assert_true(runs[SNB] > 20 && runs[SNU] > 20 && runs[GNU] < 12);
    assert_true(share[NEAR] < 0.7 * share[OPT] && share[OPT] < share[RES] && share[OPT] < share[FLO]);
    assert_true(share[RES] < share[GNU] && share[FLO] < share[GNU] && share[GNU] < share[GNB]);
    assert_true(share[GWU] < share[GWB]);
    stage_free(&g);
}

/* The shadow of a ring that is seen through its hole (Fig. 7): in scanline order it is filled, unless blockers are
 * warped and boundaries traced. */
static void torus(void **state)
{
    (void)state;
    scene *s;
    assert_true(scene_builtin("shapes", &s));
    s->environment = map_of(lamps, 128);
    scene_add_environment_lights(s, 60);
    camera c = camera_look(s->cameras[2].eye, v3(1.5f, 0.4f, 1.3f), v3(0, 1, 0), 16.0f * PI_F / 180.0f);
    stage g = stage_new(s, c, 129, 129, 1);
    g.v.settings.env_samples = g.v.settings.light_samples = 0;
    static const char *const names[] = {"SNB", "SNU", "SWU", "SWB", "GNU", "OPT"};
    enum { SNB, SNU, SWU, SWB, GNU, OPT, METHODS };
    double wrong[METHODS];
    for (int m = 0; m < METHODS; m++) {
        char mode[16];
        snprintf(mode, sizeof mode, "%s,block=0", names[m]);
        outcome o = run(&g, mode);
        wrong[m] = o.mispredicted;
        print_message("%s: %5.2f %% traced, %.4f %% wrong\n", names[m], 100 * o.share, 100 * wrong[m]);
        outcome_free(&o);
    }
    for (int m = SNB; m <= SWU; m++) /* 50 to 130 times */
        assert_true(wrong[m] > 20.0 * wrong[OPT] && wrong[m] > 20.0 * wrong[SWB]);
    assert_true(wrong[SWB] < 2.0 * wrong[OPT]); /* 1.3 */
    assert_true(wrong[GNU] < wrong[OPT] && wrong[OPT] < 0.0003);
    stage_free(&g);
}

/* --------------------------------------------------------------------------------------------------------- threads */

static void threads_change_nothing(void **state)
{
    (void)state;
    const char *const modes[] = {"OPT,block=32", "GWU,block=64", "OPT,block=0"};
    for (size_t m = 0; m < sizeof modes / sizeof *modes; m++) {
        stage g = ring_stage(150, 100, 1, 66);
        outcome one = run(&g, modes[m]);
        for (int threads = 2; threads <= 7; threads += threads == 3 ? 4 : 1) {
            g.v.settings.threads = threads;
            outcome more = run(&g, modes[m]);
            assert_true(same_images(&one.grid.image, &more.grid.image));
            assert_int_equal(one.grid.rays.traced, more.grid.rays.traced);
            assert_int_equal(one.grid.mispredicted, more.grid.mispredicted);
            outcome_free(&more);
        }
        outcome_free(&one);
        stage_free(&g);
    }
}

/* Blocks of any size give a picture that is as good. */
static void blocks(void **state)
{
    (void)state;
    stage g = ring_stage(161, 97, 4, 60);
    double whole = 0.0;
    const char *const modes[] = {"OPT,block=0", "OPT,block=256", "OPT,block=128", "OPT,block=64", "OPT,block=1"};
    for (size_t m = 0; m < sizeof modes / sizeof *modes; m++) {
        outcome o = run(&g, modes[m]);
        whole = m == 0 ? o.share : whole;
        print_message("%s: %g %g\n", modes[m], o.share, o.mispredicted);
        assert_true(o.share >= whole && o.share < 1.3 * whole && o.mispredicted < 1e-3);
        outcome_free(&o);
    }
    stage_free(&g);
}

/* Two blocks of 64 x 64 that know nothing of each other, and one light whose shadow lies across their border, on
 * columns 60 ... 69 of the image, all rows alike. Each has a coarsest lattice of columns and rows 0, 16, 32, 48 and 63,
 * where all lights are traced. Elsewhere it is that one light alone, nowhere flooded, where its informers disagree:
 *
 * First block, seen up to column 59 of it. Column 63 is of the lattice.
 *   step 8: 56, between 48 (seen) and 63 (blocked), in rows 8 k and 63; 63 in rows 8, 24, 40, 56, whose only informer
 * off the column is 56 step 4: 60, between 56 and 63, in rows 4 k and 63; 56 in rows 4, 12, 20 ..., beside 60 step 2:
 * 58, between 56 and 60, in rows 2 k and 63; 60 in rows 2, 6, 10 ... step 1: 59, between 58 and 60, in all rows; 60 in
 * odd rows Second block, blocked up to column 5 of it. step 8: 8, between 0 and 16, in rows 8 k and 63; 0 in rows 8,
 * 24, 40, 56, beside 8 step 4: 4, between 0 and 8, in rows 4 k and 63; 8 in rows 4, 12, 20 ..., beside 4 step 2: 6,
 * between 4 and 8, in rows 2 k and 63; 4 in rows 2, 6, 10 ... step 1: 5, between 4 and 6, in all rows; 6 in odd rows,
 * beside 5 */
static int lights_traced(uint32_t x, uint32_t y)
{
    bool of8 = y % 8 == 0 || y == 63, of4 = y % 4 == 0 || y == 63, of2 = y % 2 == 0 || y == 63;
    bool lattice = (x % 16 == 0 || x % 64 == 63) && (y % 16 == 0 || y == 63);
    bool edge = false;
    switch (x) {
    case 56:
    case 64 + 8:
        edge = of4;
        break;
    case 58:
    case 64 + 4:
        edge = of2;
        break;
    case 59:
    case 60:
    case 64 + 5:
    case 64 + 6:
        edge = true;
        break;
    case 63:
    case 64:
        edge = of8;
        break;
    default:;
    }
    return lattice ? 5 : edge;
}

static void border_of_blocks(void **state)
{
    (void)state;
    const float pixel = 0.02f, height = 4.0f, slab = 8.0f;
    scene *s = scene_new("strip");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.7f);
    add_box(s, v3(-9, -0.2f, -9), v3(9, 0, 9), 63, grey);
    const vec3 towards[5] = {{0.6f, 0.8f, 0}, {-0.6f, 0.8f, 0}, {0, 0.8f, 0.6f}, {0, 0.8f, -0.6f}, {0, 1, 0}};
    for (int i = 0; i < 5; i++)
        scene_add_light(s,
                        (light){.kind = LIGHT_DIRECTIONAL, .direction = v3_neg(towards[i]), .intensity = v3(1, 1, 1)});
    float x = -4 * pixel + slab * 0.75f; /* above the camera, in the first light alone */
    add_box(s, v3(x, slab, -5), v3(x + 10 * pixel, slab + 1e-4f, 5), 63, grey);
    s->environment = environment_uniform(v3(0.1f, 0.1f, 0.1f));
    stage g = stage_new(s, camera_look(v3(0, height, 0), v3(0, 0, 0), v3(0, 0, -1), 2.0f * atanf(32 * pixel / height)),
                        128, 64, 1);
    g.v.settings.env_samples = g.v.settings.light_samples = 0;
    outcome o = run(&g, "GNU,flood=64,block=64");
    assert_int_equal(o.grid.mispredicted, 0);
    for (uint32_t i = 0; i < 128 * 64; i++) {
        double traced = 5.0 * (double)o.grid.traced_share[i];
        if (fabs(traced - lights_traced(i % 128, i / 128)) > 0.01)
            fail_msg("pixel %u %u: %g lights traced, not %d", i % 128, i / 128, traced,
                     lights_traced(i % 128, i / 128));
    }
    outcome_free(&o);
    stage_free(&g);
}

static void words(void **state)
{
    (void)state;
    settings f = {0};
    message err = {{0}};
    assert_true(grid_parse("GNU,block=64,spacing=8", &f, &err) && f.grid_block == 64 && f.grid.spacing == 8);
    assert_true(grid_parse("GNU,spacing=8,block=0", &f, &err) && f.grid_block == 0 && f.grid.flood == 0);
    assert_true(grid_parse(NULL, &f, &err) && f.grid.near == 2);
    const char *const bad[] = {"",
                               "GNX",
                               "OPT,block=",
                               "OPT,block=x",
                               "OPT,block=-1",
                               "OPT,block=99999999",
                               "OPT,blocks=2",
                               "OPT,block=64x",
                               "block=64"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        err.text[0] = 0;
        if (grid_parse(bad[i], &f, &err) || !err.text[0])
            fail_msg("\"%s\" was taken", bad[i]);
    }
    assert_true(grid_samples_fit(1) && grid_samples_fit(16) && grid_samples_fit(64));
    assert_false(grid_samples_fit(2) || grid_samples_fit(15) || grid_samples_fit(81));
}

int main(int argc, char *argv[])
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(true_is_exact),
        cmocka_unit_test(other_lights),
        cmocka_unit_test(no_directional_lights),
        cmocka_unit_test(cells_of_a_map),
        cmocka_unit_test(methods),
        cmocka_unit_test(torus),
        cmocka_unit_test(threads_change_nothing),
        cmocka_unit_test(blocks),
        cmocka_unit_test(border_of_blocks),
        cmocka_unit_test(words),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
