/* SPDX-License-Identifier: Apache-2.0 */
/* Virtual point lights on scenes with a known answer, and what holds for every frame: counts, threads, odd sizes. */
#include "render_support.h"

/* ---------------------------------------------------------------------------------------------- integrating sphere */

/* A sphere of radius 1 and albedo 1/2 with a light of 1 W/sr in its centre: E = 1 direct, radiance albedo / pi * E / (1
 * - albedo) = 1 / pi in all, half of it indirect. Every pair of points has the geometric term 1/4, but for the 0.2 % of
 * the sphere that lie nearer than the clamp (0.05 B_R). */
static scene *sphere_scene(void)
{
    scene *s = scene_new("sphere");
    add_sphere(s, 48, false, add_material(s, MATERIAL_DIFFUSE, 0.5f));
    return s;
}

static stage sphere_stage(scene *s, int vpls)
{
    stage g = stage_new(s, camera_look(v3(0.3f, 0.1f, 0), v3(1, 0, 0.2f), v3(0, 1, 0), 1.0f), 16, 16, 1);
    g.v.settings.vpls = vpls;
    return g;
}

static stage lit_sphere_stage(int vpls)
{
    scene *s = sphere_scene();
    add_point_light(s, v3(0, 0, 0), 1.0f);
    return sphere_stage(s, vpls);
}

static double mean_lit(const frame *f)
{
    tally t = {0};
    for (size_t i = 0; i < (size_t)f->lit.width * f->lit.height; i++)
        tally_add(&t, (double)f->lit.pixels[i].y);
    return tally_mean(&t);
}

/* Facets lie up to (pi / 96)^2 / 2 nearer than the sphere: 0.1 % of the direct light. */
static void integrating_sphere(void **state)
{
    (void)state;
    const double half = 0.5 / 3.14159265358979;
    stage g = lit_sphere_stage(0);
    frame f = stage_render(&g, 0.0f);
    double direct = mean_lit(&f);
    assert_true(fabs(direct - half) < 0.002 * half);
    frame_free(&f);
    stage_free(&g);

    g = lit_sphere_stage(512);
    tally t = {0};
    for (uint64_t seed = 0; seed < 16; seed++) {
        g.v.settings.seed = seed;
        f = stage_render(&g, 0.0f);
        assert_true(lights_of(&f)->vpls == 512);
        tally_add(&t, (mean_lit(&f) - direct) / half);
        frame_free(&f);
    }
    assert_true(tally_error(&t) < 0.01);
    assert_mean(&t, 1.0, 0.002 + 0.002, "integrating sphere"); /* clamp, facets */

    /* Everything is visible, so no cached answer can be another. */
    frame exact = stage_render(&g, 0.0f);
    for (float ce = 2.0f; ce <= 32.0f; ce *= 4.0f) {
        frame cached = stage_render(&g, ce);
        assert_true(same_images(&exact.image, &cached.image));
        assert_true(cached.rays.traced < cached.rays.asked && cached.rays.asked == exact.rays.asked);
        frame_free(&cached);
    }
    frame_free(&exact);
    stage_free(&g);
}

/* Lights on a sphere evenly lit are spread evenly, each with the same power. */
static void density(void **state)
{
    (void)state;
    stage g = lit_sphere_stage(1024);
    vpl_set l = vpls_new(&g.v);
    assert_true(l.count == 1024 && l.padded == 1024);
    tally logs = {0};
    double power = 0.0;
    int within = 0;
    for (uint32_t i = 0; i < l.count; i++) {
        double expected = 1024.0 / (4.0 * 3.14159265358979),
               r = sqrt((double)(l.x[i] * l.x[i] + l.y[i] * l.y[i] + l.z[i] * l.z[i]));
        assert_true(isfinite(l.density[i]) && l.density[i] > 0.0f);
        assert_true(r < 1.00001 && r > 0.997); /* on the facets' inner side */
        assert_true(-(l.x[i] * l.nx[i] + l.y[i] * l.ny[i] + l.z[i] * l.nz[i]) > 0.99f);
        tally_add(&logs, log((double)l.density[i] / expected));
        within += fabs(log((double)l.density[i] / expected)) < log(2.0);
        power += (double)l.r[i];
    }
    /* the 8th neighbour's estimate spreads by 1 / sqrt(6): 93 % within a factor of two */
    assert_true(fabs(exp(tally_mean(&logs)) - 1.0) < 0.25 && within > 820);
    /* flux 4 pi times albedo / (1 - albedo), over pi; 4 sigma of some 3000 paths with 2 +- sqrt 2 bounces */
    assert_true(fabs(power / 4.0 - 1.0) < 4.0 * 0.71 / sqrt(3000.0));
    vpls_free(&l);
    stage_free(&g);
}

/* In the sphere the indirect light is everywhere the same, whatever the source: flux / (4 pi) * albedo / (1 - albedo).
 */
static void sphere_by_flux(void **state)
{
    (void)state;
    const double pi = 3.14159265358979;
    for (int spot = 0; spot < 2; spot++) {
        scene *s = sphere_scene();
        double flux;
        if (spot) {
            scene_add_light(s, (light){.kind = LIGHT_SPOT,
                                       .direction = v3(0, 0, 1),
                                       .intensity = v3(1, 1, 1),
                                       .cos_inner = 0.9f,
                                       .cos_outer = 0.6f});
            flux = 2.0 * pi * (0.1 + 0.3 / 3.0); /* the ramp is squared */
        } else {
            uint32_t lamp = add_material(s, MATERIAL_DIFFUSE, 0.0f);
            s->materials[lamp].emission = v3(100, 100, 100);
            s->materials[lamp].two_sided = true;
            add_quad(s, v3(-0.05f, -0.05f, 0), v3(0.1f, 0, 0), v3(0, 0.1f, 0), lamp);
            flux = 2.0 * pi * 100.0 * 0.01;
        }
        stage g = sphere_stage(s, 256);
        tally t = {0};
        for (uint64_t seed = 0; seed < 16; seed++) {
            g.v.settings.seed = seed;
            g.v.settings.vpls = 0;
            frame direct = stage_render(&g, 0.0f);
            g.v.settings.vpls = 256;
            frame all = stage_render(&g, 0.0f);
            tally_add(&t, (mean_lit(&all) - mean_lit(&direct)) / (0.5 / pi * flux / (4.0 * pi)));
            frame_free(&direct);
            frame_free(&all);
        }
        assert_true(tally_error(&t) < 0.02);
        /* the lamp itself hides and takes 0.0025 / pi of it at each of two bounces */
        assert_mean(&t, 1.0, 0.006, spot ? "spot" : "lamp");
        stage_free(&g);
    }
}

/* A lone square of area 4 gives off what falls on it: from a directional light its irradiance, from the sky pi on each
 * side. No pilot sees a light, so all have the same chance. */
static void power_from_outside(void **state)
{
    (void)state;
    for (int sky = 0; sky < 2; sky++) {
        scene *s = scene_new("square");
        add_quad(s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), add_material(s, MATERIAL_DIFFUSE, 0.5f));
        light sun = {.kind = LIGHT_DIRECTIONAL, .direction = v3_normalize(v3(1, -2, 0.5f)), .intensity = v3(3, 3, 3)};
        if (sky)
            s->environment = environment_uniform(v3(1, 1, 1));
        else
            scene_add_light(s, sun);
        stage g = stage_new(s, camera_look(v3(0, 2, 1), v3(0, 0, 0), v3(0, 1, 0), 0.3f), 4, 4, 1);
        g.v.settings.vpls = 256;
        vpl_set l = vpls_new(&g.v);
        assert_true(l.count == 256);
        double power = 0.0, cosine = sky ? 0.5 : -(double)sun.direction.y;
        for (uint32_t i = 0; i < l.count; i++)
            power += (double)l.g[i];
        double expected = 4.0 * 0.5 / 3.14159265358979 * (sky ? 2.0 * 3.14159265358979 : 3.0 * cosine);
        /* of 131072 paths through a disc of area 2 pi a share hits; sampling 256 of these is good to one */
        double share = 4.0 * cosine / (2.0 * 3.14159265358979), error = sqrt((1.0 - share) / (share * 131072.0));
        if (!(fabs(power / expected - 1.0) < 4.0 * error + 1.0 / 256.0))
            fail_msg("sky %d: %g, expected %g, relative error %g", sky, power, expected, error);
        vpls_free(&l);
        stage_free(&g);
    }
}

/* Under water the flux that is left by Fresnel counts over eta^2, as radiance does there. */
static void power_under_water(void **state)
{
    (void)state;
    scene *s = scene_new("water");
    const float albedo = 0.02f; /* what goes to and fro is less than that */
    uint32_t water = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    s->materials[water].ior = 1.33f;
    add_quad(s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), add_material(s, MATERIAL_DIFFUSE, albedo));
    add_quad(s, v3(-1.1f, 0.2f, -1.1f), v3(0, 0, 2.2f), v3(2.2f, 0, 0), water);
    scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL, .direction = v3(0, -1, 0), .intensity = v3(3, 3, 3)});
    stage g = stage_new(s, camera_look(v3(0, 2, 1), v3(0, 0, 0), v3(0, 1, 0), 0.3f), 4, 4, 1);
    g.v.settings.vpls = 256;
    vpl_set l = vpls_new(&g.v);
    double power = 0.0, n = 1.33, lost = (n - 1.0) / (n + 1.0);
    for (uint32_t i = 0; i < l.count; i++)
        power += (double)l.g[i];
    double expected = 4.0 * (double)albedo / 3.14159265358979 * 3.0 * (1.0 - lost * lost) / (n * n);
    print_message("under water %g, expected %g\n", power, expected);
    assert_true(l.count == 256 && fabs(power / expected - 1.0) < 0.03);
    vpls_free(&l);
    stage_free(&g);
}

/* ---------------------------------------------------------------------------------------------------- resampling */

/* Two rooms with a door between them: most candidates lie where the camera does not look. */
static stage rooms_stage(bool door)
{
    scene *s = scene_new("rooms");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f);
    add_box(s, v3(-1, 0, 0), v3(1, 1, 1), 63, grey);
    add_box(s, v3(-0.0005f, 0, 0), v3(0.0005f, 1, door ? 0.6f : 1.0f), 63, grey);
    add_point_light(s, v3(-0.5f, 0.7f, 0.4f), 1.0f);
    return stage_new(s, camera_look(v3(0.95f, 0.5f, 0.5f), v3(0, 0.4f, 0.5f), v3(0, 1, 0), 1.2f), 16, 16, 4);
}

/* Indirect radiance of the picture by path tracing with the light sampled at each vertex. */
static void trace_paths(const view *v, uint64_t count, tally *t)
{
    vec3 right = v3_cross(v->camera.forward, v->camera.up);
    float h = 2.0f * tanf(0.5f * v->camera.yfov);
    for (uint64_t i = 0; i < count; i++) {
        rng r = rng_make(99, i);
        vec3 d = v3_mad(v->camera.forward, (rng_float(&r) - 0.5f) * h, right), o = v->camera.eye;
        d = v3_normalize(v3_mad(d, (rng_float(&r) - 0.5f) * h, v->camera.up));
        double sum = 0.0;
        eye_sample e = {.weight = v3(1, 1, 1)};
        for (int depth = 0; depth < 12 && tracer_closest(v->tracer, o, d, &e.surface); depth++) {
            o = e.origin = surface_offset(&e.surface, e.surface.geometric_normal);
            light_sample s = direct_punctual(&e, &v->scene->lights[0]);
            if (depth > 0 && !tracer_occluded(v->tracer, o, v3_sub(s.target, o), 1.0f))
                sum += (double)s.value.y;
            float pdf, u1 = rng_float(&r), u2 = rng_float(&r);
            e.weight = v3_mul(e.weight, material_sample(&e.surface, u1, u2, 0.5f, &d, &pdf));
        }
        tally_add(t, sum);
    }
}

/* Resampling few of many candidates, by far the most behind the wall, keeps their light. */
static void resampling_keeps_energy(void **state)
{
    (void)state;
    static const int counts[] = {48, 1000};
    stage g = rooms_stage(true);
    tally paths = {0};
    trace_paths(&g.v, 150000, &paths);
    for (int i = 0; i < 2; i++) {
        tally t = {0};
        for (uint64_t seed = 0; seed < (i ? 8 : 40); seed++) {
            g.v.settings.seed = seed;
            g.v.settings.vpls = 0;
            frame direct = stage_render(&g, 0.0f);
            g.v.settings.vpls = counts[i];
            frame all = stage_render(&g, 0.0f);
            assert_true((int)lights_of(&all)->vpls == counts[i]);
            tally_add(&t, mean_lit(&all) - mean_lit(&direct));
            frame_free(&direct);
            frame_free(&all);
        }
        /* 2 %: what the clamp takes from corners */
        double mean = tally_mean(&paths), error = hypot(tally_error(&t), tally_error(&paths));
        assert_true(error < 0.05 * mean);
        if (!(fabs(tally_mean(&t) - mean) < 4.0 * error + 0.02 * mean))
            fail_msg("%d lights: %g, expected %g, error %g", counts[i], tally_mean(&t), mean, error);
    }
    stage_free(&g);
}

/* ----------------------------------------------------------------------------------------------------------- leaks */

/* A wall of 0.05 % of the rooms' length, no door: no light comes through. */
static void no_leak(void **state)
{
    (void)state;
    stage g = rooms_stage(false);
    g.v.settings.width = g.v.settings.height = 32;
    g.v.settings.vpls = 256;
    static const float ces[] = {0.0f, 8.0f, 32.0f};
    for (int i = 0; i < 3; i++) {
        frame f = stage_render(&g, ces[i]);
        assert_true(f.rays.asked > 100000);
        for (size_t k = 0; k < 32 * 32; k++)
            assert_true(v3_max_component(f.image.pixels[k]) == 0.0f);
        frame_free(&f);
    }
    stage_free(&g);
}

/* Both rooms from above through a roof of clear glass: cells lie across the wall, and light may only leak as far as a
 * cell reaches. */
static void leak_is_a_cell(void **state)
{
    (void)state;
    enum { SIZE = 64 };
    scene *s = scene_new("roofed");
    uint32_t grey = add_material(s, MATERIAL_DIFFUSE, 0.6f), clear = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    s->materials[clear].ior = 1.0f;
    add_box(s, v3(-1, 0, -1), v3(1, 1, 1), 63 & ~8, grey);
    add_box(s, v3(-1, 0, -1), v3(1, 1, 1), 8, clear);
    add_box(s, v3(-0.0005f, 0, -1), v3(0.0005f, 1, 1), 63, grey);
    add_point_light(s, v3(-0.5f, 0.7f, 0.4f), 1.0f);
    stage g = stage_new(s, camera_look(v3(0, 4, 0), v3(0, 0, 0), v3(0, 0, -1), 0.3f), SIZE, SIZE, 4);
    double pixel = 2.0 * tan(0.15) * 4.0 / SIZE;
    g.v.settings.vpls = 128;
    for (float ce = 0.0f; ce <= 32.0f; ce = ce > 0.0f ? 2.0f * ce : 4.0f) {
        frame f = stage_render(&g, ce);
        double far = 0.0;
        int lit = 0;
        for (int y = 0; y < SIZE; y++)
            for (int x = 0; x < SIZE; x++) {
                double at = (x + 0.5 - SIZE / 2) * pixel; /* on the floor; the wall's faces are beside it */
                bool bright = f.lit.pixels[SIZE * y + x].y > 0.0f;
                if (at > 0.0 && bright)
                    far = fmax(far, at / pixel);
                lit += at < 0.0 && bright;
            }
        double bound = (double)ce / 2.0 + 1.0;
        assert_true(lit > SIZE * SIZE / 2 - 4 * SIZE);
        if (!(far <= bound))
            fail_msg("C_E %g: light %.1f pixels behind the wall, bound %.1f", (double)ce, far, bound);
        frame_free(&f);
    }
    stage_free(&g);
}

/* ---------------------------------------------------------------------------------------------------------- frames */

static void repeatable(void **state)
{
    (void)state;
    stage g = mixed_stage(70, 40, 2);
    frame one = stage_render(&g, 0.0f);
    g.v.settings.threads = 2;
    frame two = stage_render(&g, 0.0f);
    assert_true(same_images(&one.image, &two.image) && one.rays.asked == two.rays.asked);
    frame_free(&two);
    g.v.settings.seed++;
    two = stage_render(&g, 0.0f);
    assert_false(same_images(&one.image, &two.image));
    frame_free(&two);
    g.v.settings.seed--;
    g.v.settings.threads = 1;
    frame first = stage_render(&g, 8.0f), second = stage_render(&g, 8.0f);
    assert_true(same_images(&first.image, &second.image) && first.rays.traced == second.rays.traced);
    assert_false(same_images(&one.image, &first.image)); /* the cache was used */
    assert_true(first.rays.asked == one.rays.asked && first.rays.traced < one.rays.traced);
    assert_true(one.rays.traced == one.rays.asked && one.eye_samples == first.eye_samples);
    frame_free(&first);
    frame_free(&second);
    frame_free(&one);
    stage_free(&g);
}

/* Counted against itself nothing is wrong; tiny cells leave what light cells share; large ones more. */
static void mispredictions(void **state)
{
    (void)state;
    stage g = mixed_stage(70, 40, 2);
    frame exact, again, tiny, large;
    truth known = {0};
    stage_mode(&g, 0.0f);
    assert_true(frame_render(&g.v, "", true, &known, NULL, &exact, NULL));
    assert_true(frame_render(&g.v, "", true, NULL, &known, &again, NULL));
    assert_true(again.mispredicted == 0 && exact.rays.asked > 100000);
    stage_mode(&g, 0.02f);
    assert_true(frame_render(&g.v, "", true, NULL, &known, &tiny, NULL));
    stage_mode(&g, 32.0f);
    assert_true(frame_render(&g.v, "", true, NULL, &known, &large, NULL));
    assert_true(tiny.mispredicted < exact.rays.asked / 50);
    assert_true(large.mispredicted > tiny.mispredicted && large.mispredicted < exact.rays.asked / 20);
    truth_free(&known);
    frame *frames[] = {&exact, &again, &tiny, &large};
    for (int i = 0; i < 4; i++)
        frame_free(frames[i]);
    stage_free(&g);
}

/* Light ends that no two share: points and directions. There, cells far below a pixel give the exact picture. */
static void tiny_cells_are_exact(void **state)
{
    (void)state;
    stage g = mixed_stage(70, 40, 2);
    g.v.settings.vpls = g.v.settings.env_samples = g.v.settings.light_samples = 0;
    frame exact = stage_render(&g, 0.0f), cached = stage_render(&g, 0.02f), coarse = stage_render(&g, 16.0f);
    assert_true(same_images(&exact.image, &cached.image));
    assert_false(same_images(&exact.image, &coarse.image));
    frame_free(&exact);
    frame_free(&cached);
    frame_free(&coarse);
    stage_free(&g);
}

/* One tile by hand: the counts of its pixels add up to those of the thread. */
static void counts_add_up(void **state)
{
    (void)state;
    stage g = mixed_stage(TILE, TILE, 2);
    for (int mode = 0; mode < 3; mode++) {
        stage_mode(&g, mode ? 8.0f : 0.0f);
        if (mode == 2)
            g.v.settings.ce_delta = g.v.settings.ce_samples = 0.0f; /* these are traced */
        vpl_set vpls = vpls_new(&g.v);
        caches used = {0};
        if (mode)
            assert_true(caches_new(&g.v, &vpls, &used, NULL));
        visibility *o = visibility_new(&g.v, &vpls, mode ? &used : NULL);
        chunk c;
        chunk_new(&c, &g.v, &vpls, g.v.scene->light_count);
        eye_samples samples = {0};
        tile_pixels *pixels = xcalloc(1, sizeof *pixels);
        eye_paths(&g.v, (tile){0, 0, TILE, TILE, 0}, 0, 2, &samples, pixels);
        for (size_t i = 0; i < samples.count; i += CHUNK) {
            for (c.count = 0; c.count < CHUNK && i + c.count < samples.count; c.count++)
                c.eyes[c.count] = &samples.items[i + c.count];
            shade_unoccluded(&g.v, &vpls, &c);
            visibility_resolve(o, &c, pixels);
            for (int k = 0; k < LIGHT_GROUPS; k++)
                for (size_t w = 0; w < (size_t)c.count * c.bits[k].words; w++)
                    assert_true((c.bits[k].visible[w] & ~c.bits[k].asked[w]) == 0);
            shade_sum(&vpls, &c, pixels);
        }
        uint64_t asked = 0, traced = 0;
        for (int i = 0; i < TILE * TILE; i++)
            asked += pixels->asked[i], traced += pixels->traced[i];
        ray_counts counts = visibility_counts(o);
        assert_true(asked == counts.asked && traced == counts.traced && asked > 100000);
        assert_true(mode ? traced < asked : traced == asked);
        visibility_free(o);
        chunk_free(&c);
        caches_free(&used);
        vpls_free(&vpls);
        free(samples.items);
        free(pixels);
    }
    stage_free(&g);
}

/* Eye paths in parts are those of the whole. */
static void passes(void **state)
{
    (void)state;
    stage g = mixed_stage(TILE, TILE, 5);
    tile t = {0, 0, TILE, TILE, 0};
    eye_samples whole = {0}, part = {0};
    tile_pixels *one = xcalloc(1, sizeof *one), *two = xcalloc(1, sizeof *two);
    eye_paths(&g.v, t, 0, 5, &whole, one);
    tally balance = {0};
    for (size_t i = 0; i < whole.count; i++)
        tally_add(&balance, (double)whole.items[i].origin.x * (double)whole.items[i].weight.y);
    double sum = balance.sum;
    size_t count = 0;
    for (int first = 0; first < 5; first += 3) {
        eye_paths(&g.v, t, first, first ? 2 : 3, &part, two);
        count += part.count;
        for (size_t i = 0; i < part.count; i++)
            sum -= (double)part.items[i].origin.x * (double)part.items[i].weight.y;
    }
    assert_true(count == whole.count && count > 1000);
    assert_true(fabs(sum) < 1e-9 * sqrt(balance.squares));
    assert_memory_equal(one, two, sizeof *one);
    free(whole.items);
    free(part.items);
    free(one);
    free(two);
    /* more than one pass a tile: nothing is lost between them */
    g.v.settings.spp = PASS;
    frame few = stage_render(&g, 0.0f);
    g.v.settings.spp = 2 * PASS + 1;
    frame many = stage_render(&g, 0.0f);
    assert_true(many.eye_samples > 2 * few.eye_samples);
    assert_true(fabs(mean_lit(&many) / mean_lit(&few) - 1.0) < 0.01);
    frame_free(&few);
    frame_free(&many);
    stage_free(&g);
}

/* Each light sample of an eye sample is first as often as any other. */
static void samples_ask_in_random_order(void **state)
{
    (void)state;
    enum { SAMPLES = 4, EYES = 4000 };
    view v = {.settings = {.seed = 1}};
    int count[SAMPLES * SAMPLES] = {0};
    for (uint64_t i = 0; i < EYES; i++) {
        eye_sample e = {.random = i};
        uint16_t order[SAMPLES];
        unsigned seen = 0;
        direct_order(&v, &e, SAMPLES, order);
        for (int k = 0; k < SAMPLES; k++) {
            assert_in_range(order[k], 0, SAMPLES - 1);
            seen |= 1u << order[k];
            count[k * SAMPLES + order[k]]++;
        }
        assert_int_equal(seen, 15);
    }
    for (int i = 0; i < SAMPLES * SAMPLES; i++)
        assert_in_range(count[i], EYES / SAMPLES - 140, EYES / SAMPLES + 140); /* 5 sigma */
}

static void odd_sizes(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {33, 7}, {1, 40}};
    for (int i = 0; i < 3; i++)
        for (int spp = 1; spp <= 16; spp += 15) {
            stage g = mixed_stage(sizes[i][0], sizes[i][1], spp);
            frame exact = stage_render(&g, 0.0f), cached = stage_render(&g, 8.0f);
            g.v.settings.shared = true;
            g.v.settings.threads = 3;
            frame shared = stage_render(&g, 8.0f);
            assert_true(exact.rays.asked > 0 && exact.rays.asked == shared.rays.asked);
            if (i > 0 || spp > 1) { /* a single path can lie in the dark, as between boxes that touch */
                assert_true(mean_lit(&exact) > 0.0);
                assert_true(fabs(mean_lit(&cached) / mean_lit(&exact) - 1.0) < 0.3);
            }
            frame_free(&exact);
            frame_free(&cached);
            frame_free(&shared);
            stage_free(&g);
        }
}

/* A closed box without light; a view of nothing but sky; a scene whose light is all specular. */
static void nothing_to_light(void **state)
{
    (void)state;
    for (int which = 0; which < 3; which++) {
        scene *s = scene_new("nothing");
        uint32_t m = add_material(s, which == 2 ? MATERIAL_DIELECTRIC : MATERIAL_DIFFUSE, which ? 0.5f : 0.0f);
        add_box(s, v3(-1, -1, -1), v3(1, 1, 1), 63, m);
        s->environment = environment_uniform(which ? v3(0.25f, 0.5f, 1) : v3(0, 0, 0));
        stage g = stage_new(s, camera_look(v3(0, which == 1 ? 3 : 0, 0), v3(0, 9, 1), v3(1, 0, 0), 0.5f), 20, 20, 4);
        g.v.settings.vpls = 64;
        if (which == 0) {
            environment_free(s->environment);
            s->environment = NULL;
        }
        for (float ce = 0.0f; ce < 9.0f; ce += 8.0f) {
            frame f = stage_render(&g, ce);
            assert_true(lights_of(&f)->vpls == 0 && f.rays.asked == 0 && f.rays.traced == 0);
            for (size_t i = 0; i < 20 * 20; i++) {
                assert_true(f.lit.pixels[i].y == 0.0f);
                if (which == 1)
                    assert_true(f.depth[i] == 0.0f && fabsf(f.image.pixels[i].y - 0.5f) < 1e-6f);
                else
                    assert_true(which ? f.image.pixels[i].y > 0.1f : f.image.pixels[i].y == 0.0f);
            }
            frame_free(&f);
        }
        stage_free(&g);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(integrating_sphere),
        cmocka_unit_test(density),
        cmocka_unit_test(sphere_by_flux),
        cmocka_unit_test(power_from_outside),
        cmocka_unit_test(power_under_water),
        cmocka_unit_test(no_leak),
        cmocka_unit_test(resampling_keeps_energy),
        cmocka_unit_test(leak_is_a_cell),
        cmocka_unit_test(repeatable),
        cmocka_unit_test(mispredictions),
        cmocka_unit_test(tiny_cells_are_exact),
        cmocka_unit_test(counts_add_up),
        cmocka_unit_test(passes),
        cmocka_unit_test(samples_ask_in_random_order),
        cmocka_unit_test(odd_sizes),
        cmocka_unit_test(nothing_to_light),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
