/* SPDX-License-Identifier: Apache-2.0 */
/* Numerical hard cases of whitted with cached and estimated visibility: scenes of any size, far away, turned, with thin
 * walls, contacts, needles and giants, extreme options. Two frames of one seed have the same paths in each mode, so
 * that their difference is that of visibility alone. */
#include "render_support.h"
#include "samples.h"

#include "bench/distances.h"

enum { W = 96, H = 72 };

/* A room that is open to the camera, with a box, a ball, a screen; a lamp and a point light. */
static scene *room(void)
{
    scene *s = scene_new("room");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), gloss = add_material(s, MATERIAL_GLOSSY, 0.5f);
    uint32_t lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[lamp].emission = v3(4, 4, 4);
    add_box(s, v3(-2, -1, -2), v3(2, 1, 2), 31, grey);
    add_box(s, v3(-1.2f, -1, -0.9f), v3(-0.5f, 0.1f, -0.2f), 63, grey);
    add_box(s, v3(0.2f, -1, -0.4f), v3(0.9f, -0.5f, 0.5f), 63, gloss);
    add_quad(s, v3(-0.3f, -0.6f, -1.4f), v3(1.2f, 0.1f, 0.2f), v3(0.1f, 0.9f, 0), grey);
    add_quad(s, v3(-0.4f, 0.98f, -0.6f), v3(0.8f, 0, 0), v3(0, 0, 0.8f), lamp);
    add_point_light(s, v3(1.3f, 0.5f, 0.7f), 0.5f);
    return s;
}

static camera room_camera(void)
{
    return camera_look(v3(0.3f, 0.4f, 4.6f), v3(0, -0.2f, 0), v3(0, 1, 0), 0.65f);
}

static stage hard_stage(scene *s, camera c)
{
    stage g = stage_new(s, c, W, H, 4);
    g.v.settings.vpls = 192;
    g.v.settings.light_samples = g.v.settings.env_samples = 2;
    g.v.settings.rays = 8.0f;
    g.v.settings.cache.table_bytes = 1 << 22;
    return g;
}

static frame picture(stage *g, visibility_mode mode)
{
    settings *f = &g->v.settings;
    f->visibility = mode;
    f->ce_samples = 0.0f;
    frame out;
    message err = {{0}};
    if (!frame_render(&g->v, "test", true, NULL, NULL, &out, &err))
        fail_msg("%s", err.text);
    for (size_t i = 0; i < (size_t)out.image.width * out.image.height; i++) {
        rgb p = out.image.pixels[i];
        if (!isfinite(p.x) || !isfinite(p.y) || !isfinite(p.z) || (mode <= VISIBILITY_CACHE && p.x < 0.0f))
            fail_msg("mode %d: pixel %zu is %g %g %g", (int)mode, i, (double)p.x, (double)p.y, (double)p.z);
    }
    return out;
}

static double share(const frame *f)
{
    return (double)f->rays.traced / (double)f->rays.asked;
}

static double l_inf(const frame *a, const frame *b)
{
    double difference = 0.0, sum = 0.0;
    for (size_t i = 0; i < (size_t)a->lit.width * a->lit.height; i++) {
        difference += fabs((double)luminance(a->lit.pixels[i]) - (double)luminance(b->lit.pixels[i]));
        sum += (double)luminance(b->lit.pixels[i]);
    }
    return difference / sum;
}

/* ------------------------------------------------------------------------------------------------- size and place */

static void scale_scene(scene *s, camera *c, float scale)
{
    const float m[12] = {scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0};
    move_scene(s, c, m);
    for (uint32_t i = 0; i < s->light_count; i++) /* light per area stays */
        s->lights[i].intensity = v3_scale(s->lights[i].intensity, scale * scale);
}

/* From 1e-6 to 6e8 units (no vertex may lie beyond 1e9): by powers of two the same picture bit for bit, from as many
 * rays. */
static void any_size(void **state)
{
    (void)state;
    frame first[3];
    const float scales[] = {1.0f, 0x1p-20f, 0x1p-7f, 0x1p10f, 0x1p28f};
    for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
        scene *s = room();
        camera c = room_camera();
        scale_scene(s, &c, scales[i]);
        stage g = hard_stage(s, c);
        g.v.settings.ce = 12.0f, g.v.settings.ce_delta = 4.0f;
        for (int mode = VISIBILITY_EXACT; mode <= VISIBILITY_ESTIMATE; mode++) {
            g.v.settings.ce_delta = mode == VISIBILITY_ESTIMATE ? 0.0f : 4.0f;
            frame f = picture(&g, (visibility_mode)mode);
            if (i == 0) {
                first[mode] = f;
                continue;
            }
            print_message("scale %g, mode %d: %llu rays of %llu\n", (double)scales[i], mode,
                          (unsigned long long)f.rays.traced, (unsigned long long)first[mode].rays.traced);
            assert_int_equal(f.rays.asked, first[mode].rays.asked);
            assert_int_equal(f.rays.traced, first[mode].rays.traced);
            assert_true(same_images(&f.lit, &first[mode].lit));
            frame_free(&f);
        }
        stage_free(&g);
    }
    for (int mode = 0; mode < 3; mode++)
        frame_free(&first[mode]);
}

/* Sizes that are no powers of two round differently, and far away floats are coarse: within 1 % as many rays (2 % of
 * estimates) and within 5 % the same error at a thousand times the scene's size. Turned, walls lie across the bins of
 * orientations: within 15 %. The lights are many points: light paths would make other virtual ones wherever a rounding
 * differs. */
static void far_and_turned(void **state)
{
    (void)state;
    const struct {
        float scale, angle;
        vec3 offset; /* in sizes of the scene, 6 units */
    } places[] = {{1, 0, {0, 0, 0}},         {1e-6f, 0, {0, 0, 0}},   {4e8f, 0, {0, 0, 0}}, {1, 0, {10, -10, 10}},
                  {1, 0, {100, 0, 30}},      {1, 0, {1000, 0, -300}}, {1, 0.1f, {0, 0, 0}}, {1, 0.4f, {0, 0, 0}},
                  {1, 0.785398f, {0, 0, 0}}, {1, 2.1f, {0, 0, 0}},    {1, 3, {0, 0, 0}},    {1, 5, {0, 0, 0}}};
    double rays[2] = {0}, error[2] = {0};
    for (size_t i = 0; i < sizeof places / sizeof *places; i += (size_t)case_step()) {
        scene *s = room();
        for (int l = 0; l < 100; l++)
            add_point_light(
                s, v3(-1.8f + 0.4f * (float)(l % 10), 0.9f - 0.01f * (float)l, -1.8f + 0.4f * (float)(l / 10)), 0.05f);
        camera c = room_camera();
        float m[12];
        motion(places[i].angle, v3_scale(places[i].offset, 6.0f), m);
        move_scene(s, &c, m);
        scale_scene(s, &c, places[i].scale);
        stage g = hard_stage(s, c);
        g.v.settings.vpls = 0;
        g.v.settings.ce = 12.0f;
        frame exact = picture(&g, VISIBILITY_EXACT);
        for (int k = 0; k < 2; k++) {
            g.v.settings.ce_delta = k ? 0.0f : 12.0f;
            frame f = picture(&g, k ? VISIBILITY_ESTIMATE : VISIBILITY_CACHE);
            double e = l_inf(&f, &exact), r = share(&f);
            if (i == 0)
                rays[k] = r, error[k] = e;
            print_message("%s, scale %g, angle %.2f, offset %g: %.4f of the rays, %.4f of the error (%.2f %%)\n",
                          k ? "estimate" : "cache", (double)places[i].scale, (double)places[i].angle,
                          (double)v3_length(places[i].offset), r / rays[k], e / error[k], 100.0 * e);
            double least = places[i].angle == 0.0f ? k ? 0.02 : 0.01 : 0.15;
            assert_true(fabs(r / rays[k] - 1.0) < least);
            assert_true(fabs(e / error[k] - 1.0) < (places[i].angle == 0.0f ? 0.05 : 0.15));
            frame_free(&f);
        }
        frame_free(&exact);
        stage_free(&g);
    }
}

/* --------------------------------------------------------------------------------------------------------- leaks */

typedef struct leaks {
    int count, wrong, dark; /* pixels that are lit, dark in the exact image, and far from all that are lit there; ... */
    double farthest;        /* in pixels, of those that are wrong */
} leaks;

/* Pixels that are lit where the exact picture is black, and those of them that are farther than `reach` pixels from all
 * that are lit there. */
static leaks find_leaks(const frame *exact, const frame *f, double reach)
{
    leaks l = {0};
    size_t count = (size_t)f->lit.width * f->lit.height;
    uint8_t *lit = xmalloc(count);
    float *nearest = xmalloc(count * sizeof *nearest);
    for (size_t i = 0; i < count; i++)
        lit[i] = luminance(exact->lit.pixels[i]) > 0.0f;
    mask_distances(lit, f->lit.width, f->lit.height, nearest);
    for (size_t i = 0; i < count; i++) {
        bool dark = exact->depth[i] > 0.0f && !lit[i];
        l.dark += dark;
        if (!dark || !(luminance(f->lit.pixels[i]) > 0.0f))
            continue;
        l.wrong++;
        l.count += (double)nearest[i] > reach;
        l.farthest = fmax(l.farthest, (double)nearest[i]);
    }
    free(lit);
    free(nearest);
    return l;
}

/* A cell is about a square of C_E / sqrt(spp) pixels; in these pictures what it answers wrongly lies no farther than
 * that from the edge of a shadow, which is half a pixel before the first that is lit. Seen at an angle its longer side
 * is more, and single pixels may lie farther (docs/robustness.md). */
static void expect_no_leaks(stage *g, const char *what)
{
    static const float ces[] = {2.0f, 4.0f, 8.0f, 16.0f, 32.0f};
    frame exact = picture(g, VISIBILITY_EXACT);
    for (size_t i = 0; i < sizeof ces / sizeof *ces; i += (size_t)case_step()) {
        settings *o = &g->v.settings;
        o->ce = o->ce_delta = ces[i];
        double side = (double)ces[i] / sqrt(o->spp);
        frame f = picture(g, VISIBILITY_CACHE);
        leaks l = find_leaks(&exact, &f, side + 0.5);
        print_message("%s, C_E %g: %d of %d dark pixels lit, %d leaks; the farthest %.1f pixels = %.2f sides from "
                      "light; %.1f %% of the rays\n",
                      what, (double)ces[i], l.wrong, l.dark, l.count, l.farthest, l.farthest / side, 100.0 * share(&f));
        assert_true(l.dark > 500 && l.count == 0 && share(&f) < 0.35);
        frame_free(&f);
    }
    frame_free(&exact);
}

/* A lit room beside a dark one, two walls 1e-4 of the scene apart between them; floors and ceilings are one plane. */
static void rooms_side_by_side(float angle, float refine_above)
{
    for (int kind = 0; kind < 2; kind++) {
        scene *s = scene_new("rooms");
        uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
        s->materials[lamp].emission = v3(5, 5, 5);
        add_box(s, v3(0, -1, -1), v3(2, 1, 1), 31, grey);
        add_box(s, v3(-2, -1, -1), v3(-4e-4f, 1, 1), 31, grey);
        if (kind)
            add_point_light(s, v3(0.3f, 0.2f, 0.1f), 2.0f);
        else
            add_quad(s, v3(0.3f, 0.9f, -0.3f), v3(0.5f, 0, 0), v3(0, 0, 0.5f), lamp);
        camera c = camera_look(v3(-0.1f, 0, 5), v3(-0.05f, 0, 0), v3(0, 1, 0), 0.55f);
        float m[12];
        motion(angle, v3(0, 0, 0), m);
        if (angle != 0.0f)
            move_scene(s, &c, m);
        stage g = hard_stage(s, c);
        g.v.settings.refine_above = refine_above;
        expect_no_leaks(&g, kind ? "thin walls, point" : "thin walls, lamp");
        stage_free(&g);
    }
}

/* Axis-aligned, and turned so that the edges of shadows run across the cells. */
static void thin_walls(void **state)
{
    (void)state;
    static const float angles[] = {0.0f, 0.4f, 0.785398f, 2.1f, 5.0f};
    for (size_t i = 0; i < sizeof angles / sizeof *angles; i += (size_t)case_step())
        rooms_side_by_side(angles[i], 0.0f);
}

/* The same as whitted's options have it: weak lights are not refined, but in the dark they are. */
static void thin_walls_weak_lights(void **state)
{
    (void)state;
    static const float angles[] = {0.0f, 0.4f, 0.785398f, 2.1f, 5.0f};
    for (size_t i = 0; i < sizeof angles / sizeof *angles; i += (size_t)case_step())
        rooms_side_by_side(angles[i], 0.5f);
}

/* A point light over a floor with boxes that stand on it, seen from above: their contact, their corners. */
static void contacts(void **state)
{
    (void)state;
    scene *s = scene_new("contacts");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f);
    add_quad(s, v3(-3, 0, -3), v3(0, 0, 6), v3(6, 0, 0), grey);
    for (int i = 0; i < 5; i++)
        add_box(s, v3(-1.8f + 0.8f * (float)i, 0, -0.5f), v3(-1.5f + 0.8f * (float)i, 0.02f + 0.1f * (float)i, 0.4f),
                63, grey);
    add_point_light(s, v3(-2.6f, 0.35f, 1.2f), 2.0f);
    stage g = hard_stage(s, camera_look(v3(0, 6, 0), v3(0, 0, 0), v3(0, 0, -1), 0.62f));
    g.v.settings.vpls = 0;
    expect_no_leaks(&g, "contacts");
    stage_free(&g);
}

/* Light at 0.5 degrees over a floor with low steps: shadows are a hundred times as long as high. */
static void grazing_light(void **state)
{
    (void)state;
    scene *s = scene_new("grazing");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f);
    add_quad(s, v3(-3, 0, -3), v3(0, 0, 6), v3(6, 0, 0), grey);
    for (int i = 0; i < 4; i++)
        add_box(s, v3(-1.8f, 0, -1.3f + 0.8f * (float)i),
                v3(-1.7f, 0.002f + 0.006f * (float)i, -0.9f + 0.8f * (float)i), 63, grey);
    scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL,
                               .direction = v3_normalize(v3(1, -0.0087f, 0.01f)),
                               .intensity = v3(100, 100, 100)});
    stage g = hard_stage(s, camera_look(v3(0, 6, 0), v3(0, 0, 0), v3(0, 0, -1), 0.62f));
    g.v.settings.vpls = 0;
    expect_no_leaks(&g, "grazing");
    stage_free(&g);
}

/* --------------------------------------------------------------------------------------------- shapes and options */

static void expect_close(stage *g, const char *what, double bound)
{
    frame exact = picture(g, VISIBILITY_EXACT);
    for (int mode = VISIBILITY_CACHE; mode <= VISIBILITY_ESTIMATE; mode++) {
        g->v.settings.ce = 12.0f;
        g->v.settings.ce_delta = mode == VISIBILITY_CACHE ? 4.0f : 0.0f;
        frame f = picture(g, (visibility_mode)mode);
        print_message("%s, mode %d: error %.2f %%, %.1f %% of the rays\n", what, mode, 100.0 * l_inf(&f, &exact),
                      100.0 * share(&f));
        assert_true(l_inf(&f, &exact) < bound && share(&f) < 0.3);
        frame_free(&f);
    }
    frame_free(&exact);
}

/* Triangles without area, needles, dust, and a floor ten thousand times as large as the things on it. */
static void needles_and_giants(void **state)
{
    (void)state;
    for (int giant = 0; giant < 2; giant++) {
        scene *s = room();
        rng r = rng_make(5, 1);
        uint32_t grey = 0;
        vec3 needles[3 * 60];
        for (int k = 0; k < 60; k++) {
            needles[3 * k] = random_vec3(&r, 1.0f);
            needles[3 * k + 1] = random_vec3(&r, 1.0f);
            needles[3 * k + 2] = v3_add(needles[3 * k + 1], random_vec3(&r, k % 2 ? 1e-5f : 0.02f));
        }
        add_triangles(s, needles, 60, grey);
        const vec3 flat[] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {0, 0, 1}, {1, 0, 1}, {0.5f, 0, 1}};
        add_triangles(s, flat, 2, grey);
        place_mesh(s, scene_add_mesh(s, soup_mesh(&r, 2000, 1e-3f, 0.8f, v3(0, 0, 0), grey)), transform_identity);
        if (giant)
            add_quad(s, v3(-4e4f, -1.5f, -4e4f), v3(0, 0, 8e4f), v3(8e4f, 0, 0), grey);
        stage g = hard_stage(s, room_camera());
        expect_close(&g, giant ? "needles, dust and a giant" : "needles and dust", 0.02);
        stage_free(&g);
    }
}

/* The ends of each option, and all at once. Cells of a hundredth of a sample are exact; those as large as the scene
 * leave light in the right amount at least. */
static void extreme_options(void **state)
{
    (void)state;
    static const struct {
        float ce, step;
        int bins, layers;
        uint64_t bytes;
        double bound;
    } cases[] = {
        {0.01f, 1.2f, 8, 8, 1 << 22, 1e-4}, {10000, 1.2f, 8, 8, 1 << 22, 1e-4}, {8, 1.2f, 1, 8, 1 << 22, 0.01},
        {8, 1.2f, 64, 8, 1 << 22, 0.005},   {8, 1.2f, 8, 1, 1 << 22, 0.005},    {8, 1.2f, 8, 64, 1 << 22, 0.005},
        {8, 1.05f, 8, 8, 1 << 22, 0.005},   {8, 16, 8, 8, 1 << 22, 0.01},       {8, 1.2f, 8, 8, 4096, 0.01},
        {0.01f, 1.05f, 64, 64, 4096, 1e-4}, {10000, 16, 1, 1, 1 << 22, 1e-4}};
    stage g = hard_stage(room(), room_camera());
    frame exact = picture(&g, VISIBILITY_EXACT);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (int mode = VISIBILITY_CACHE; mode <= VISIBILITY_ESTIMATE; mode++) {
            settings *o = &g.v.settings;
            o->ce = cases[i].ce, o->ce_delta = mode == VISIBILITY_CACHE ? cases[i].ce : 0.0f;
            o->cache.resolution_step = cases[i].step;
            o->cache.normal_bins = cases[i].bins, o->cache.layers = cases[i].layers;
            o->cache.table_bytes = cases[i].bytes;
            frame f = picture(&g, (visibility_mode)mode);
            print_message("case %zu, mode %d: error %.2f %%, %.1f %% of the rays\n", i, mode, 100.0 * l_inf(&f, &exact),
                          100.0 * share(&f));
            assert_true(l_inf(&f, &exact) < (mode == VISIBILITY_ESTIMATE ? 0.03 : cases[i].bound));
            frame_free(&f);
        }
    frame_free(&exact);
    stage_free(&g);
}

/* Every number of bins of the normal. */
static void all_bins(void **state)
{
    (void)state;
    scene *s = room();
    add_sphere(s, 12, true, 0);
    stage g = hard_stage(s, room_camera());
    g.v.settings.vpls = 64, g.v.settings.spp = 1;
    g.v.settings.ce = 4.0f;
    frame exact = picture(&g, VISIBILITY_EXACT);
    for (int bins = 1; bins <= 64; bins += case_step()) {
        g.v.settings.cache.normal_bins = bins;
        frame f = picture(&g, VISIBILITY_CACHE);
        double e = l_inf(&f, &exact);
        if (bins < 4 || bins % 16 == 0)
            print_message("C_N %d: error %.2f %%, %.1f %% of the rays\n", bins, 100.0 * e, 100.0 * share(&f));
        assert_true(e < (bins == 1 ? 0.005 : 0.003) && share(&f) < 0.32);
        frame_free(&f);
    }
    frame_free(&exact);
    stage_free(&g);
}

int main(int argc, char *argv[])
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_size),           cmocka_unit_test(far_and_turned),
        cmocka_unit_test(thin_walls),         cmocka_unit_test(thin_walls_weak_lights),
        cmocka_unit_test(contacts),           cmocka_unit_test(grazing_light),
        cmocka_unit_test(needles_and_giants), cmocka_unit_test(extreme_options),
        cmocka_unit_test(all_bins),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
