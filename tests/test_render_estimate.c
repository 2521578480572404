/* SPDX-License-Identifier: Apache-2.0 */
/* Whole frames by few rays against all rays: the same light on average, in every kind of scene. Both modes trace the
 * same eye paths, virtual lights and light samples of a seed, so that their difference is the estimate's error alone.
 */
#include "render_support.h"

enum { SEEDS = 64, SIZE = 24 };

typedef struct lighting {
    const char *name;
    int vpls;
    bool point, sun, lamp;
} lighting;

/* A room of 2 x 2 x 2 without its front, a screen in it; the floor and what stands on it of `kind`. */
static stage room(material_kind kind, float color, float roughness, const lighting *by)
{
    scene *s = scene_new("room");
    uint32_t white = add_material(s, MATERIAL_DIFFUSE, 0.7f), special = add_material(s, kind, color);
    s->materials[special].roughness = roughness;
    uint32_t red = scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(0.8f, 0.1f, 0.1f)));
    add_quad(s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), special); /* floor */
    add_quad(s, v3(-1, 0, -1), v3(2, 0, 0), v3(0, 2, 0), white);   /* back */
    add_quad(s, v3(-1, 0, -1), v3(0, 2, 0), v3(0, 0, 2), red);     /* left */
    add_quad(s, v3(1, 0, -1), v3(0, 0, 2), v3(0, 2, 0), white);    /* right */
    add_box(s, v3(-0.3f, 0.0f, -0.5f), v3(0.2f, 0.6f, 0.0f), 63, white);
    add_box(s, v3(0.3f, 0.9f, -0.6f), v3(0.8f, 0.92f, 0.4f), 63, red); /* thinner than a cell */
    for (int i = 0; by->point && i < 20; i++) {                        /* so many that they are drawn, not all traced */
        float x = 0.03f * (float)i;
        add_point_light(s, v3(x, 1.7f, 0.2f - x), 0.1f);
        add_point_light(s, v3(-0.8f + x, 0.3f, 0.5f), 0.025f);
    }
    if (by->sun)
        scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL,
                                   .direction = v3_normalize(v3(-0.4f, -1.0f, -0.3f)),
                                   .intensity = v3(2, 2, 1)});
    if (by->lamp) {
        uint32_t m = add_material(s, MATERIAL_DIFFUSE, 0.0f);
        s->materials[m].emission = v3(4, 4, 3);
        add_quad(s, v3(-0.3f, 1.99f, -0.3f), v3(0.6f, 0, 0), v3(0, 0, 0.6f), m);
    }
    stage g = stage_new(s, camera_look(v3(0.2f, 1.0f, 3.2f), v3(0, 0.8f, 0), v3(0, 1, 0), 0.7f), SIZE, SIZE, 2);
    g.v.settings.vpls = by->vpls;
    g.v.settings.light_samples = 1, g.v.settings.env_samples = 0;
    g.v.settings.cache.table_bytes = 1 << 16; /* few rows: they are replaced */
    return g;
}

static frame render(stage *g, visibility_mode mode, float rays)
{
    frame f;
    message err = {{0}};
    settings *o = &g->v.settings;
    o->visibility = mode, o->rays = rays, o->ce = 4.0f;
    if (!frame_render(&g->v, "test", true, NULL, NULL, &f, &err))
        fail_msg("%s", err.text);
    for (size_t i = 0; i < (size_t)f.image.width * f.image.height; i++) {
        rgb p = f.image.pixels[i]; /* corrections may be negative */
        assert_true(isfinite(p.x) && isfinite(p.y) && isfinite(p.z));
        assert_true(f.traced_share[i] >= 0.0f && f.traced_share[i] <= 1.0f);
    }
    assert_true(f.complete && f.rays.traced <= f.rays.asked);
    return f;
}

static double energy(const frame *f)
{
    double sum = 0.0;
    for (size_t i = 0; i < (size_t)f->lit.width * f->lit.height; i++)
        sum += (double)f->lit.pixels[i].x + (double)f->lit.pixels[i].y + (double)f->lit.pixels[i].z;
    return sum;
}

/* Frames of other seeds are independent: their mean difference lies within 3 standard errors of 0. */
static void check_energy(stage *g, visibility_mode mode, float rays, bool lit, const char *what)
{
    tally difference = {0};
    double exact_sum = 0.0;
    ray_counts all = {0};
    for (uint64_t seed = 1; seed <= (uint64_t)sample_count(SEEDS, 16); seed++) {
        g->v.settings.seed = seed;
        frame exact = render(g, VISIBILITY_EXACT, rays), few = render(g, mode, rays);
        assert_true(same_images(&exact.seen, &few.seen));
        exact_sum += energy(&exact) / sample_count(SEEDS, 16);
        tally_add(&difference, energy(&few) - energy(&exact));
        all.asked += few.rays.asked, all.traced += few.rays.traced;
        frame_free(&exact);
        frame_free(&few);
    }
    double error = tally_error(&difference), mean = tally_mean(&difference);
    print_message("%s: %+.2f standard errors of %.3f %%, %.1f %% of the rays\n", what, error > 0.0 ? mean / error : 0.0,
                  100.0 * error / (exact_sum > 0.0 ? exact_sum : 1.0),
                  all.asked ? 100.0 * (double)all.traced / (double)all.asked : 0.0);
    assert_true((exact_sum > 0.0) == lit);
    if (!(fabs(mean) <= 3.0 * error))
        fail_msg("%s: energy off by %g of %g, standard error %g", what, mean, exact_sum, error);
    assert_true(!lit || error < 0.02 * error_growth(SEEDS, 16) * exact_sum); /* else nothing would be seen */
}

static const lighting lightings[] = {{"point lights and sun", 0, true, true, false},
                                     {"virtual lights of a lamp", 100, false, false, true},
                                     {"all lights", 100, true, true, true},
                                     {"no light", 0, false, false, false},
                                     {"virtual lights of a sky", 64, false, false, false}};
enum { LIGHTINGS = sizeof lightings / sizeof *lightings };

static void lights(void **state)
{
    (void)state;
    for (int i = 0; i < LIGHTINGS; i++) {
        stage g = room(MATERIAL_DIFFUSE, 0.6f, 1.0f, &lightings[i]);
        check_energy(&g, VISIBILITY_ESTIMATE, 3.0f, i != 3, lightings[i].name);
        stage_free(&g);
    }
}

/* Without control variate the error is larger; drawn by what is expected to be seen it is smaller again. */
static void selections(void **state)
{
    (void)state;
    for (visibility_mode mode = VISIBILITY_SELECT; mode <= VISIBILITY_SELECT_BY_CACHE; mode++)
        for (int gloss = 0; gloss < 2; gloss++) {
            stage g = room(gloss ? MATERIAL_GLOSSY : MATERIAL_DIFFUSE, 0.6f, 0.5f, &lightings[2]);
            check_energy(&g, mode, 3.0f, true,
                         mode == VISIBILITY_SELECT ? "selection without cache" : "selection by cache");
            stage_free(&g);
        }
}

/* Black gloss too: all its light comes from the coat. */
static void materials(void **state)
{
    (void)state;
    static const struct {
        material_kind kind;
        float color, roughness;
        const char *name;
    } cases[] = {{MATERIAL_GLOSSY, 0.5f, 0.3f, "gloss"},
                 {MATERIAL_GLOSSY, 0.0f, 0.3f, "black gloss"},
                 {MATERIAL_CONDUCTOR, 0.9f, 0.4f, "metal"},
                 {MATERIAL_CONDUCTOR, 0.9f, 0.0f, "mirror"},
                 {MATERIAL_DIELECTRIC, 1.0f, 0.0f, "glass"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        stage g = room(cases[i].kind, cases[i].color, cases[i].roughness, &lightings[2]);
        check_energy(&g, VISIBILITY_ESTIMATE, 3.0f, true, cases[i].name);
        stage_free(&g);
    }
}

/* Samples of one pixel in several passes: what the first ones draw teaches the others, whose draws must not follow from
 * it. */
static void samples_of_one_pixel(void **state)
{
    (void)state;
    stage g = room(MATERIAL_DIFFUSE, 0.6f, 1.0f, &lightings[0]);
    g.v.settings.width = g.v.settings.height = 1, g.v.camera.yfov = 0.02f;
    for (int spp = 128; spp <= 256; spp *= 2) {
        tally difference = {0};
        g.v.settings.spp = spp;
        for (uint64_t seed = 1; seed <= (uint64_t)sample_count(1500, 16); seed++) {
            g.v.settings.seed = seed;
            frame exact = render(&g, VISIBILITY_EXACT, 0.5f), few = render(&g, VISIBILITY_ESTIMATE, 0.5f);
            tally_add(&difference, energy(&few) - energy(&exact));
            frame_free(&exact);
            frame_free(&few);
        }
        double sigmas = tally_mean(&difference) / tally_error(&difference);
        print_message("one pixel of %d samples: %+.2f standard errors\n", spp, sigmas);
        assert_true(fabs(sigmas) <= 3.0);
    }
    stage_free(&g);
}

/* Pixel by pixel: what black gloss reflects is there. */
static void black_gloss_shines(void **state)
{
    (void)state;
    scene *s = scene_new("gloss");
    uint32_t m = add_material(s, MATERIAL_GLOSSY, 0.0f);
    s->materials[m].roughness = 0.5f;
    add_quad(s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), m);
    add_point_light(s, v3(0, 1, -0.5f), 1.0f);
    stage g = stage_new(s, camera_look(v3(0, 1, 1), v3(0, 0, 0), v3(0, 1, 0), 0.5f), SIZE, SIZE, 1);
    frame exact = render(&g, VISIBILITY_EXACT, 4.0f), few = render(&g, VISIBILITY_ESTIMATE, 4.0f);
    assert_true(energy(&exact) > 0.0 && few.rays.asked == exact.rays.asked && few.rays.traced > 0);
    frame_free(&exact);
    frame_free(&few);
    stage_free(&g);
}

/* Where no light comes nothing is drawn, in any unit of light, and those who have light get their rays. */
static void dark_parts(void **state)
{
    (void)state;
    double traced[2];
    for (int dim = 0; dim < 2; dim++) {
        scene *s = scene_new("half dark");
        uint32_t white = add_material(s, MATERIAL_DIFFUSE, 0.7f);
        add_quad(s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), white);          /* floor */
        add_quad(s, v3(-1, 0.9f, -1), v3(1.5f, 0, 0), v3(0, 0, 1.8f), white); /* ceiling, below all lights */
        add_quad(s, v3(-0.5f, 0.3f, -1), v3(1, 0, 0), v3(0, 0.5f, 0), white); /* a screen */
        for (int i = 0; i < 60; i++)
            add_point_light(s, v3(-0.9f + 0.03f * (float)i, 1.0f, 0.8f - 0.02f * (float)(i % 7)), dim ? 1e-7f : 0.1f);
        stage g = stage_new(s, camera_look(v3(0, 0.6f, 3.2f), v3(0, 0.6f, 0), v3(0, 1, 0), 0.7f), SIZE, SIZE, 16);
        g.v.settings.vpls = 0, g.v.settings.light_samples = 0;
        frame few = render(&g, VISIBILITY_ESTIMATE, 3.0f);
        traced[dim] = (double)few.rays.traced / (double)few.eye_samples;
        frame_free(&few);
        stage_free(&g);
    }
    print_message("%.3f rays of 3, %.3f in dim light\n", traced[0], traced[1]);
    assert_true(fabs(traced[1] / traced[0] - 1.0) < 0.01 && traced[0] > 2.0);
}

/* The error of the mean of n images, over the light. */
static double image_error(const double *sum, const double *truth_sum, int n)
{
    double error = 0.0, whole = 0.0;
    for (int i = 0; i < SIZE * SIZE; i++)
        error += fabs(sum[i]) / n, whole += truth_sum[i] / n;
    return error / whole;
}

static void images_converge(void **state)
{
    (void)state;
    stage g = room(MATERIAL_GLOSSY, 0.5f, 0.5f, &lightings[2]);
    static double sum[SIZE * SIZE], exact_sum[SIZE * SIZE];
    double first = 0.0, last = 0.0;
    const int count = sample_count(256, 64);
    for (int n = 1; n <= count; n++) {
        g.v.settings.seed = (uint64_t)n;
        frame exact = render(&g, VISIBILITY_EXACT, 3.0f), few = render(&g, VISIBILITY_ESTIMATE, 3.0f);
        for (int i = 0; i < SIZE * SIZE; i++) {
            sum[i] += (double)few.lit.pixels[i].y - (double)exact.lit.pixels[i].y;
            exact_sum[i] += (double)exact.lit.pixels[i].y;
        }
        frame_free(&exact);
        frame_free(&few);
        if (n == 16)
            first = image_error(sum, exact_sum, n);
    }
    last = image_error(sum, exact_sum, count);
    print_message("error of the mean of 16 images %.3f %%, of %d %.3f %%\n", 100.0 * first, count, 100.0 * last);
    double gain = sqrt(count / 16.0);
    assert_true(last < 0.02 * error_growth(256, 64) && fabs(first / last / gain - 1.0) < 0.15);
    stage_free(&g);
}

/* A frame of many samples a cell, with rows for all of them against one row, which forgets: what is learnt pays. */
static void learning_helps(void **state)
{
    (void)state;
    double error[2], rays[2];
    for (int rows = 0; rows < 2; rows++) {
        stage g = room(MATERIAL_DIFFUSE, 0.6f, 1.0f, &lightings[2]);
        g.v.settings.width = g.v.settings.height = 128, g.v.settings.spp = 4;
        g.v.settings.cache.table_bytes = rows ? 1 << 24 : 128;
        frame exact = render(&g, VISIBILITY_EXACT, 3.0f), few = render(&g, VISIBILITY_ESTIMATE, 3.0f);
        double off = 0.0;
        for (size_t i = 0; i < 128 * 128; i++)
            off += fabs((double)few.lit.pixels[i].y - (double)exact.lit.pixels[i].y);
        error[rows] = off * 3.0 / energy(&exact), rays[rows] = (double)few.rays.traced;
        frame_free(&exact);
        frame_free(&few);
        stage_free(&g);
    }
    print_message("error with one row %.2f %%, with all %.2f %% of %.2f times the rays\n", 100.0 * error[0],
                  100.0 * error[1], rays[1] / rays[0]);
    assert_true(error[1] < 0.8 * error[0] && rays[1] < 1.1 * rays[0]);
}

/* Threads that share a cache write to it in any order. Two runs must agree that the mean is off. */
static void threads_share_a_cache(void **state)
{
    (void)state;
    for (int shared = 0; shared < 2; shared++) {
        stage g = room(MATERIAL_DIFFUSE, 0.6f, 1.0f, &lightings[2]);
        g.v.settings.threads = 3, g.v.settings.shared = shared;
        g.v.settings.width = 5, g.v.settings.height = 1000; /* 32 tiles: a region for each of two threads */
        bool off = true;
        for (uint64_t run = 0; run < 2 && off; run++) {
            tally difference = {0};
            for (uint64_t seed = 0; seed < 16; seed++) {
                g.v.settings.seed = 100 * run + seed;
                frame exact = render(&g, VISIBILITY_EXACT, 3.0f), few = render(&g, VISIBILITY_ESTIMATE, 3.0f);
                tally_add(&difference, energy(&few) - energy(&exact));
                frame_free(&exact);
                frame_free(&few);
            }
            print_message("%s: off by %+.2f standard errors\n", shared ? "one cache" : "a cache for each region",
                          tally_mean(&difference) / tally_error(&difference));
            off = fabs(tally_mean(&difference)) > 3.0 * tally_error(&difference);
        }
        assert_false(off);
        stage_free(&g);
    }
}

/* The ridge of a roof within one pixel, whose sides share a prediction, and lights a degree below or above the horizon
 * of its middle: one side sees what the middle does not, the other does not see what the middle does. */
static void ridge(void **state)
{
    (void)state;
    for (int above = 0; above < 2; above++) {
        enum { LIGHTS = 64, FRAMES = 300 };
        scene *s = scene_new("ridge");
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.8f);
        const float slope = 0.0068f; /* 0.39 degrees */
        add_quad(s, v3(-1, -slope, -1), v3(0, 0, 2), v3(1, slope, 0), grey);
        add_quad(s, v3(0, 0, -1), v3(0, 0, 2), v3(1, -slope, 0), grey);
        for (int i = 0; i < LIGHTS; i++)
            add_point_light(s, v3(i % 2 ? 20 : -20, above ? 0.05f : -0.05f, (float)i / LIGHTS - 0.5f), 100.0f);
        stage g = stage_new(s, camera_look(v3(0, 5, 0), v3(0, 0, 0), v3(0, 0, 1), 0.1f), 1, 1, 16);
        g.v.settings.light_samples = g.v.settings.env_samples = 0;
        tally t = {0};
        double exact_energy = 0.0;
        for (g.v.settings.seed = 1; g.v.settings.seed <= (uint64_t)sample_count(FRAMES, 16); g.v.settings.seed++) {
            /* more is traced than the middle asks for */
            frame exact = render(&g, VISIBILITY_EXACT, 4.0f), estimate;
            g.v.settings.visibility = VISIBILITY_ESTIMATE;
            assert_true(frame_render(&g.v, "test", true, NULL, NULL, &estimate, NULL));
            exact_energy += energy(&exact) / sample_count(FRAMES, 16);
            tally_add(&t, energy(&estimate) - energy(&exact));
            frame_free(&exact);
            frame_free(&estimate);
        }
        print_message("lights %s: %+.3f %% +- %.3f %%\n", above ? "above" : "below",
                      100.0 * tally_mean(&t) / exact_energy, 100.0 * tally_error(&t) / exact_energy);
        assert_true(fabs(tally_mean(&t)) <= 3.0 * tally_error(&t));
        assert_true(tally_error(&t) < 0.02 * error_growth(FRAMES, 16) * exact_energy);
        stage_free(&g);
    }
}

int main(int argc, char *argv[])
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lights),
        cmocka_unit_test(selections),
        cmocka_unit_test(materials),
        cmocka_unit_test(black_gloss_shines),
        cmocka_unit_test(dark_parts),
        cmocka_unit_test(images_converge),
        cmocka_unit_test(samples_of_one_pixel),
        cmocka_unit_test(learning_helps),
        cmocka_unit_test(threads_share_a_cache),
        cmocka_unit_test(ridge),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
