/* SPDX-License-Identifier: Apache-2.0 */
/* Connections of bidirectional path tracing by the cache: sizes of cells, units, bias, threads, going on. */
#include "bdpt_support.h"

#include "interrupt.h"

#include <signal.h>

static stage room(int kind)
{
    return cached_stage(room_scene(kind), room_camera(), 32, 24, 16);
}

static bool same_images(const image *a, const image *b)
{
    return memcmp(a->pixels, b->pixels, (size_t)a->width * a->height * sizeof(rgb)) == 0;
}

/* ---------------------------------------------------------------------------------------------------- densities */

/* A square of area 0.25 with four fifths of the vertices and one of area 1 with the rest, in any unit of length. */
static void densities(void **state)
{
    (void)state;
    enum { COUNT = 20000, PATHS = 5000 };
    vec3 *p = xmalloc(COUNT * sizeof *p);
    const float units[] = {1.0f, 1e-9f, 1e9f};
    for (int u = 0; u < 3; u++) {
        rng r = rng_make(7, 1);
        for (int i = 0; i < COUNT; i++) {
            bool dense = i % 5 != 0;
            float edge = dense ? 0.5f : 1.0f, a = rng_float(&r), b = rng_float(&r);
            p[i] = v3_scale(v3(0.1f + edge * a, dense ? -0.43f : 0.71f, edge * b - 0.97f), units[u]);
        }
        density_map *m = density_map_new(p, COUNT, PATHS, v3(0, 0, 0), units[u]);
        for (int dense = 0; dense < 2; dense++) {
            tally t = {0};
            for (int i = 0; i < 400; i++) {
                float edge = dense ? 0.5f : 1.0f, a = 0.1f + 0.8f * rng_float(&r), b = 0.1f + 0.8f * rng_float(&r);
                vec3 at = v3_scale(v3(0.1f + edge * a, dense ? -0.43f : 0.71f, edge * b - 0.97f), units[u]);
                double d = (double)density_at(m, at) * (double)units[u] * (double)units[u];
                assert_true(d > 0.0 && isfinite(d));
                tally_add(&t, d);
            }
            double expected = dense ? 0.8 * COUNT / PATHS / 0.25 : 0.2 * COUNT / PATHS;
            print_message("density %f, expected %f\n", tally_mean(&t), expected);
            assert_true(tally_mean(&t) > 0.5 * expected && tally_mean(&t) < 1.5 * expected);
        }
        const vec3 nowhere[] = {{-0.9f, -0.9f, 0.9f}, {5, 5, 5}, {-1, -1, -1}, {1, 1, 1}};
        for (size_t i = 0; i < sizeof nowhere / sizeof *nowhere; i++) {
            float d = density_at(m, v3_scale(nowhere[i], units[u]));
            assert_true(d > 0.0f && isfinite(d));
        }
        density_map_free(m);
    }
    for (uint32_t count = 0; count < 3; count++) { /* hardly any vertices; many at one point */
        density_map *m = density_map_new(p, count, PATHS, v3(0, 0, 0), 1e9f);
        assert_true(density_at(m, v3(0, 0, 0)) > 0.0f);
        density_map_free(m);
    }
    for (int i = 0; i < COUNT; i++)
        p[i] = v3(0.3f, 0.3f, 0.3f);
    density_map *m = density_map_new(p, COUNT, PATHS, v3(0, 0, 0), 1.0f);
    assert_true(isfinite(density_at(m, p[0])) && density_at(m, p[0]) > 1e6f);
    density_map_free(m);
    free(p);
}

/* ------------------------------------------------------------------------------------------------------- units */

static void scale_scene(scene *s, float unit)
{
    for (uint32_t i = 0; i < s->instance_count; i++)
        for (int k = 0; k < 12; k++)
            s->instances[i].to_world[k] *= unit;
    for (uint32_t i = 0; i < s->light_count; i++) {
        s->lights[i].position = v3_scale(s->lights[i].position, unit);
        if (s->lights[i].kind != LIGHT_DIRECTIONAL)
            s->lights[i].intensity = v3_scale(s->lights[i].intensity, unit * unit);
    }
}

/* Millimetres, kilometres: the same number of rays, and the same picture. */
static void units_of_length(void **state)
{
    (void)state;
    const float units[] = {1.0f, 1e-3f, 1e3f, 1e-6f, 2e8f};
    const int kinds[] = {ROOM_LAMP, ROOM_POINT, ROOM_SKY};
    for (int k = 0; k < 3; k++) {
        int kind = kinds[k];
        uint64_t traced = 0;
        double mean = 0.0;
        for (size_t u = 0; u < sizeof units / sizeof *units; u++) {
            scene *s = room_scene(kind);
            scale_scene(s, units[u]);
            camera c = room_camera();
            c.eye = v3_scale(c.eye, units[u]);
            stage g = stage_new(s, c, 96, 72);
            g.v.settings.spp = 4;
            g.v.settings.seconds = INFINITY;
            g.v.settings.cache.table_bytes = 1 << 24;
            frame f = stage_frame(&g, VISIBILITY_CACHE, NULL);
            assert_true(sane(&f.image));
            if (u == 0) {
                traced = f.rays.traced;
                mean = image_mean(&f.image);
            }
            double rays = (double)f.rays.traced / (double)traced, shown = image_mean(&f.image) / mean;
            print_message("light %d, unit %g: rays %.4f, mean %.5f\n", kind, (double)units[u], rays, shown);
            assert_true(rays > 0.985 && rays < 1.015 && shown > 0.995 && shown < 1.005);
            frame_free(&f);
            stage_free(&g);
        }
    }
}

/* Paths of 20 edges between bright walls, and through glass. */
static void long_paths(void **state)
{
    (void)state;
    scene *s = scene_new("long");
    uint32_t white = add_material(s, MATERIAL_DIFFUSE, 0.98f), lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    uint32_t glass = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    s->materials[lamp].emission = v3(1, 1, 1);
    add_box(s, v3(-2, -2, -2), v3(2, 2, 2), 63, white);
    add_quad(s, v3(-0.2f, 1.99f, -0.2f), v3(0.4f, 0, 0), v3(0, 0, 0.4f), lamp);
    add_sphere(s, 16, true, glass);
    stage g = stage_new(s, camera_look(v3(0.3f, 0.2f, 1.8f), v3(0, 0, 0), v3(0, 1, 0), 1.0f), 16, 12);
    g.v.settings.edges = 20;
    g.v.settings.spp = 64;
    g.v.settings.seconds = INFINITY;
    g.v.settings.cache.table_bytes = 1 << 24;
    for (int mode = VISIBILITY_EXACT; mode <= VISIBILITY_CACHE; mode++) {
        frame f = stage_frame(&g, (visibility_mode)mode, NULL);
        assert_true(sane(&f.image) && image_mean(&f.image) > 0.0 && f.rays.asked > 1000);
        frame_free(&f);
    }
    stage_free(&g);
}

/* -------------------------------------------------------------------------------------------------------- bias */

/* The plain cache errs little with few rays; cells of all the room are far off. */
static void cached_connections(void **state)
{
    (void)state;
    stage g = room(ROOM_LAMP);
    g.v.settings.spp = 64;
    g.v.settings.epoch = 64;
    frame exact = stage_frame(&g, VISIBILITY_EXACT, NULL), cached = stage_frame(&g, VISIBILITY_CACHE, NULL);
    g.v.settings.ce = 60.0f;
    frame coarse = stage_frame(&g, VISIBILITY_CACHE, NULL);
    double share = (double)cached.rays.traced / (double)cached.rays.asked;
    print_message("%.1f %% of the rays, error %.2f %%; coarse %.2f %%\n", 100.0 * share,
                  100.0 * l_inf(&cached.image, &exact.image), 100.0 * l_inf(&coarse.image, &exact.image));
    assert_true(exact.rays.traced == exact.rays.asked && cached.rays.asked == exact.rays.asked);
    assert_true(share < 0.35 && l_inf(&cached.image, &exact.image) < 0.03);
    assert_true(l_inf(&coarse.image, &exact.image) > 2.0 * l_inf(&cached.image, &exact.image));
    frame_free(&exact);
    frame_free(&cached);
    frame_free(&coarse);
    stage_free(&g);
}

/* Mean difference of estimates to exact connections of the same paths, over seeds: none, also with coarse cells and a
 * table of four words, and with threads that write into one table. */
static void estimates_have_no_bias(void **state)
{
    (void)state;
    for (int kind = 0; kind < ROOMS; kind += case_step())
        for (int hard = 0; hard < 3; hard++) {
            stage g = room(kind);
            settings *f = &g.v.settings;
            f->spp = hard == 2 ? 8 : 16; /* many for each seed, which costs pilot paths of its own */
            f->width = hard == 2 ? 64 : 16, f->height = hard == 2 ? 16 : 12; /* a tile a thread, and one more */
            camera c = room_camera();
            view_set(&g.v, g.s, g.t, g.l, &c);
            f->threads = hard == 2 ? 3 : 1;
            f->ce = hard == 1 ? 500.0f : 12.0f;
            f->cache.table_bytes = hard == 1 ? 16 : 1 << 22;
            tally t = {0}, share = {0};
            for (f->seed = 1; f->seed <= (hard == 2 ? 20u : (unsigned)sample_count(16, 8)); f->seed++) {
                frame exact = stage_frame(&g, VISIBILITY_EXACT, NULL),
                      other = stage_frame(&g, VISIBILITY_ESTIMATE, NULL);
                double base = image_mean(&exact.image);
                tally_add(&t, (image_mean(&other.image) - base) / base);
                tally_add(&share, (double)other.rays.traced / (double)other.rays.asked);
                frame_free(&exact);
                frame_free(&other);
            }
            print_message("light %d, case %d: %.5f +- %.5f, %.3f of the rays\n", kind, hard, tally_mean(&t),
                          tally_error(&t), tally_mean(&share));
            /* racing threads draw a new sample each time: of ten thousand runs a few may fail (Student's t, 19 degrees:
             * 5.0 is exceeded once in 12,500) */
            assert_true(fabs(tally_mean(&t)) <= (hard == 2 ? 5.0 : 3.0) * tally_error(&t));
            assert_true(tally_mean(&share) < 0.7);
            stage_free(&g);
        }
}

/* ------------------------------------------------------------------------------------------- threads, going on */

/* Of any number of threads the picture of one, bit for bit, where they take turns; exact ones also where they do not.
 * Of a cache that threads share without turns, who comes first decides: the same up to its bias. */
static void threads_change_nothing(void **state)
{
    (void)state;
    const int threads[] = {1, 2, 3, 7, 3}, kinds[] = {ROOM_LAMP, ROOM_SKY};
    for (size_t kind = 0; kind < sizeof kinds / sizeof *kinds; kind++) {
        stage g = room(kinds[kind]);
        settings *f = &g.v.settings;
        f->width = 70, f->height = 45; /* cut tiles; large enough for pilot paths to measure light */
        f->spp = 3, f->epoch = 2;
        camera c = room_camera();
        view_set(&g.v, g.s, g.t, g.l, &c);
        for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++) {
            f->threads = 1, f->deterministic = false;
            frame one = stage_frame(&g, (visibility_mode)mode, NULL);
            assert_true(mode == VISIBILITY_EXACT || one.rays.traced < one.rays.asked);
            for (size_t i = 0; i < sizeof threads / sizeof *threads; i += (size_t)case_step()) {
                f->threads = threads[i];
                f->deterministic = i < 4;
                frame more = stage_frame(&g, (visibility_mode)mode, NULL);
                assert_true(same_images(&one.normal, &more.normal) && one.rays.asked == more.rays.asked);
                bool same = same_images(&one.image, &more.image) && one.rays.traced == more.rays.traced;
                if (!same && (f->deterministic || mode == VISIBILITY_EXACT))
                    fail_msg("light %d, mode %d, %d threads: another picture, or %llu rays instead of %llu",
                             kinds[kind], mode, f->threads, (unsigned long long)more.rays.traced,
                             (unsigned long long)one.rays.traced);
                assert_true(finite_image(&more.image) && l_inf(&more.image, &one.image) < 0.2);
                frame_free(&more);
            }
            frame_free(&one);
        }
        stage_free(&g);
    }
}

static void going_on(void **state)
{
    (void)state;
    for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++) {
        stage g = room(ROOM_LAMP);
        settings *f = &g.v.settings;
        f->epoch = 4;
        f->threads = 2, f->deterministic = true;
        f->spp = 12;
        frame whole = stage_frame(&g, (visibility_mode)mode, NULL);
        f->spp = 4;
        frame first = stage_frame(&g, (visibility_mode)mode, NULL);
        film start = {.mean = first.image, .passes = passes_of(&first)->passes};
        f->spp = 12;
        frame rest = stage_frame(&g, (visibility_mode)mode, &start);
        assert_true(passes_of(&rest)->passes == 12 && passes_of(&rest)->from == 4);
        /* what an estimate traces follows from what it has traced before */
        if (mode != VISIBILITY_ESTIMATE)
            assert_true(same_images(&whole.image, &rest.image) && same_images(&whole.normal, &rest.normal));
        assert_false(same_images(&whole.image, &first.image));
        frame_free(&whole);
        frame_free(&first);
        frame_free(&rest);
        stage_free(&g);
    }
}

static void time_is_up(void **state)
{
    (void)state;
    stage g = room(ROOM_POINT);
    g.v.settings.seconds = 0.0;
    frame f = stage_frame(&g, VISIBILITY_CACHE, NULL);
    assert_true(f.complete && passes_of(&f)->passes == 1);
    frame_free(&f);
    stage_free(&g);
}

/* Nothing in place of a black image. Last: it stays interrupted. */
static void interrupted_before_it_begins(void **state)
{
    (void)state;
    interrupt_install();
    raise(SIGINT);
    for (int mode = VISIBILITY_EXACT; mode < VISIBILITY_MODES; mode++)
        for (int turns = 0; turns < 2; turns++) {
            stage g = room(ROOM_LAMP);
            g.v.settings.threads = 2, g.v.settings.deterministic = turns > 0;
            frame f = stage_frame(&g, (visibility_mode)mode, NULL);
            assert_true(!f.image.pixels && !f.seen.pixels && !f.complete);
            stage_free(&g);
        }
}

int main(int argc, char *argv[])
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(densities),
        cmocka_unit_test(units_of_length),
        cmocka_unit_test(long_paths),
        cmocka_unit_test(cached_connections),
        cmocka_unit_test(estimates_have_no_bias),
        cmocka_unit_test(threads_change_nothing),
        cmocka_unit_test(going_on),
        cmocka_unit_test(time_is_up),
        cmocka_unit_test(interrupted_before_it_begins),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
