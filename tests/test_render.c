/* SPDX-License-Identifier: Apache-2.0 */
/* The whitted renderer on scenes with a known answer, by exact and by cached visibility: direct light. */
#include "render_support.h"

static const float modes[] = {0.0f, 2.0f, 8.0f, 32.0f}; /* C_E; 0: exact */
enum { MODES = sizeof modes / sizeof *modes };

/* A square of half edge `half` on the plane y = 0, seen from above at a slant, filling the picture. */
static camera slanted(float half, float yfov)
{
    return camera_look(v3(0.7f * half, 0.9f * half, 0.5f * half), v3(0, 0, 0), v3(0, 1, 0), yfov);
}

static void add_floor(scene *s, float half, uint32_t material_index)
{
    add_quad(s, v3(-half, 0, -half), v3(0, 0, 2 * half), v3(2 * half, 0, 0), material_index);
}

static scene *floor_scene(material_kind kind, float color)
{
    scene *s = scene_new("floor");
    add_floor(s, 1.0f, add_material(s, kind, color));
    return s;
}

/* -------------------------------------------------------------------------------------------------------- furnace */

/* A convex polyhedron sees only sky. All asked pairs are visible, so no cached answer can be another. */
static void furnace_diffuse(void **state)
{
    (void)state;
    scene *s = scene_new("furnace");
    add_sphere(s, 16, false, add_material(s, MATERIAL_DIFFUSE, 1.0f));
    s->environment = environment_uniform(v3(1, 1, 1));
    stage g = stage_new(s, camera_look(v3(1, 2, 3), v3(0, 0, 0), v3(0, 1, 0), 0.25f), 32, 32, 4);
    frame exact = stage_render(&g, 0.0f);
    tally t = {0};
    for (size_t i = 0; i < 32 * 32; i++)
        tally_add(&t, (double)exact.lit.pixels[i].y);
    assert_mean(&t, 1.0, 0.0, "white furnace");
    assert_true(tally_error(&t) < 0.005);
    for (int m = 1; m < MODES; m++) {
        frame cached = stage_render(&g, modes[m]);
        assert_true(same_images(&exact.image, &cached.image));
        frame_free(&cached);
    }
    frame_free(&exact);
    stage_free(&g);
}

static void furnace_gloss(void **state)
{
    (void)state;
    const struct {
        material_kind kind;
        float roughness;
    } cases[] = {
        {MATERIAL_GLOSSY, 0.3f}, {MATERIAL_GLOSSY, 0.8f}, {MATERIAL_CONDUCTOR, 0.3f}, {MATERIAL_CONDUCTOR, 1.0f}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene *s = floor_scene(cases[i].kind, 1.0f);
        s->materials[0].roughness = cases[i].roughness;
        s->environment = environment_uniform(v3(1, 1, 1));
        stage g = stage_new(s, slanted(1.0f, 0.02f), 32, 32, 16);
        surface center;
        assert_true(tracer_closest(g.t, g.v.camera.eye, g.v.camera.forward, &center));
        double expected = directional_albedo(&center);
        assert_true(expected < 1.0 && expected > 0.3); /* what single scattering of a rough metal leaves */
        frame exact = stage_render(&g, 0.0f), cached = stage_render(&g, 8.0f);
        tally t = {0};
        for (size_t k = 0; k < 32 * 32; k++)
            tally_add(&t, (double)exact.lit.pixels[k].y);
        assert_mean(&t, expected, 1e-3, "gloss"); /* quadrature, and the angle over the picture */
        assert_true(same_images(&exact.image, &cached.image));
        frame_free(&exact);
        frame_free(&cached);
        stage_free(&g);
    }
}

/* A white mirror shows the sky undimmed, glass of index 1 as well. Of glass, branches below 0.005 are cut: in the
 * middle that is the third inner reflection, at the rim (reflectance r -> 1) all inner ones, of which (1 - r) r^k are
 * left. */
static void furnace_specular(void **state)
{
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        scene *s = scene_new("specular");
        uint32_t m = add_material(s, kind == 0 ? MATERIAL_CONDUCTOR : MATERIAL_DIELECTRIC, 1.0f);
        s->materials[m].roughness = 0.0f;
        s->materials[m].ior = kind == 1 ? 1.0f : 1.5f;
        add_sphere(s, 128, true, m);
        s->environment = environment_uniform(v3(1, 1, 1));
        stage g = stage_new(s, camera_look(v3(0, 0, 4), v3(0, 0, 0), v3(0, 1, 0), 0.55f), 64, 64, 1);
        frame f = stage_render(&g, 0.0f);
        for (int y = 0; y < 64; y++)
            for (int x = 0; x < 64; x++) {
                double v = (double)f.image.pixels[64 * y + x].y, r = hypot(x - 31.5, y - 31.5) / 29.0;
                double loss = kind < 2 ? 1e-3 : r < 0.7 ? 0.005 : 0.12;
                if (!(v <= 1.0 + 1e-4 && v >= 1.0 - loss))
                    fail_msg("kind %d, pixel %d %d: %g", kind, x, y, v);
            }
        assert_true(f.rays.asked == 0 && f.eye_samples == 0);
        frame_free(&f);
        stage_free(&g);
    }
}

/* ------------------------------------------------------------------------------------------------- punctual lights */

/* Radiance of a diffuse floor of albedo 0.6 under a light. */
static double under(const light *l, vec3 p)
{
    if (l->kind == LIGHT_DIRECTIONAL)
        return 0.6 / 3.14159265358979 * (double)l->intensity.y * -(double)l->direction.y;
    vec3 d = v3_sub(p, l->position);
    double r = (double)v3_length(d), e = (double)l->intensity.y * (double)l->position.y / (r * r * r);
    if (l->kind == LIGHT_SPOT) {
        double cosine = (double)v3_dot(d, l->direction) / r;
        double ramp = (cosine - (double)l->cos_outer) / ((double)l->cos_inner - (double)l->cos_outer);
        ramp = fmin(1.0, fmax(0.0, ramp));
        e *= ramp * ramp;
    }
    return 0.6 / 3.14159265358979 * e;
}

static void punctual(void **state)
{
    (void)state;
    vec3 aim = v3_normalize(v3(0.3f, -1.0f, -0.1f));
    const light lights[3] = {
        {.kind = LIGHT_POINT, .position = v3(0.2f, 0.5f, -0.3f), .intensity = v3(1, 2, 3)},
        {.kind = LIGHT_SPOT,
         .position = v3(0.0f, 0.6f, 0.0f),
         .direction = aim,
         .intensity = v3(2, 2, 2),
         .cos_inner = 0.985f,
         .cos_outer = 0.95f},
        {.kind = LIGHT_DIRECTIONAL, .direction = v3_normalize(v3(1.0f, -2.0f, 0.5f)), .intensity = v3(4, 3, 2)}};
    for (int which = 1; which < 8; which++) {
        scene *s = floor_scene(MATERIAL_DIFFUSE, 0.6f);
        for (int i = 0; i < 3; i++)
            if (which >> i & 1)
                scene_add_light(s, lights[i]);
        stage g = stage_new(s, slanted(1.0f, 0.5f), 33, 17, 1);
        frame exact = stage_render(&g, 0.0f);
        int dark = 0, ramp = 0, full = 0;
        for (int y = 0; y < 17; y++)
            for (int x = 0; x < 33; x++) {
                vec3 p = floor_point(&g.v, x + 0.5, y + 0.5);
                double expected = 0.0, spot = under(&lights[1], p), v = (double)exact.lit.pixels[33 * y + x].y;
                light bare = lights[1];
                bare.kind = LIGHT_POINT;
                dark += spot == 0.0, full += spot >= 0.9999 * under(&bare, p),
                    ramp += spot > 0.0 && spot < under(&bare, p);
                for (int i = 0; i < 3; i++)
                    expected += which >> i & 1 ? under(&lights[i], p) : 0.0;
                /* the ramp is steep: 30 ulp of the cosine are 1e-4 of it */
                if (!(fabs(v - expected) <= 1e-4 * expected + 2e-4))
                    fail_msg("lights %d, pixel %d %d: %g, expected %g", which, x, y, v, expected);
            }
        assert_true(dark > 20 && ramp > 20 && full > 20);
        for (int m = 1; m < MODES; m++) {
            frame cached = stage_render(&g, modes[m]);
            assert_true(same_images(&exact.image, &cached.image)); /* nothing is blocked */
            frame_free(&cached);
        }
        frame_free(&exact);
        stage_free(&g);
    }
}

/* A half-plane at height 1 whose edge runs through (0, 1, 0) along (0.3, 0, 1); light above it, camera below it. */
static const vec3 edge_light = {0.3f, 2.0f, 0.1f};

static double edge_distance(vec3 p)
{
    /* the edge's shadow: through 2 (0, 1, 0) - light, along the same direction */
    double x = (double)p.x + (double)edge_light.x, z = (double)p.z + (double)edge_light.z;
    return (x - 0.3 * z) / sqrt(1.09);
}

static stage edge_stage(float yfov, uint32_t size, int spp)
{
    scene *s = scene_new("edge");
    add_floor(s, 2.0f, add_material(s, MATERIAL_DIFFUSE, 0.6f));
    uint32_t black = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    add_quad(s, v3(-0.9f, 1, -3), v3(1.8f, 0, 6), v3(-3, 0, 0), black);
    add_point_light(s, edge_light, 1.0f);
    return stage_new(s, camera_look(v3(-0.3f, 0.9f, -0.1f), v3(-0.3f, 0, -0.1f), v3(0, 0, 1), yfov), size, size, spp);
}

static void hard_shadow_exact(void **state)
{
    (void)state;
    stage g = edge_stage(0.6f, 96, 1);
    frame f = stage_render(&g, 0.0f);
    int lit = 0;
    for (int y = 0; y < 96; y++)
        for (int x = 0; x < 96; x++) {
            vec3 p = floor_point(&g.v, x + 0.5, y + 0.5);
            double d = edge_distance(p), v = (double)f.lit.pixels[96 * y + x].y;
            bool expected = d > 0.0; /* the screen lies at smaller x */
            if (fabs(d) < 1e-5)
                continue;
            assert_true((v > 0.0) == expected);
            if (expected)
                assert_true(fabs(v - under(&g.s->lights[0], p)) < 1e-4 * v);
            lit += v > 0.0;
        }
    assert_true(lit > 2000 && lit < 7000);
    frame_free(&f);
    stage_free(&g);
}

/* Farthest wrong pixel from the edge, in pixels. */
static double farthest(stage *g, float ce)
{
    uint32_t n = g->v.settings.width;
    frame exact = stage_render(g, 0.0f), cached = stage_render(g, ce);
    double pixel = 2.0 * tan(0.5 * (double)g->v.camera.yfov) / n * (double)g->v.camera.eye.y, far = 0.0;
    for (uint32_t i = 0; i < n * n; i++) {
        double d = edge_distance(floor_point(&g->v, i % n + 0.5, i / n + 0.5)) / pixel;
        double difference = fabs((double)exact.lit.pixels[i].y - (double)cached.lit.pixels[i].y);
        if (difference > 1e-4)
            far = fmax(far, fabs(d));
    }
    frame_free(&exact);
    frame_free(&cached);
    return far;
}

/* The paper's claim: the error of a cell stays inside about C_E x C_E eye samples. Wide views too: there a pixel at the
 * border covers less of the floor than its distance squared says. */
static void hard_shadow_cached(void **state)
{
    (void)state;
    static const int rates[] = {1, 4, 16};
    static const float yfovs[] = {0.6f, 1.4f};
    double largest = 0.0;
    for (int v = 0; v < 2; v++)
        for (int r = 0; r < 3; r++)
            for (float ce = 2.0f; ce <= 32.0f; ce *= 2.0f) {
                stage g = edge_stage(yfovs[v], 96, rates[r]);
                double far = farthest(&g, ce), bound = (double)ce / sqrt(rates[r]) + 1.0;
                if (!(far <= bound))
                    fail_msg("field of view %.1f, %d spp, C_E %g: wrong %.2f pixels from the edge, bound %.2f",
                             (double)yfovs[v], rates[r], (double)ce, far, bound);
                largest = fmax(largest, far);
                stage_free(&g);
            }
    assert_true(largest > 1.0); /* there is something to see */
}

/* --------------------------------------------------------------------------------------------------- area lights */

/* Radiance over its expected value at the pixel's centre: each pixel an estimate, or each picture. */
static void tally_picture(stage *g, float ce, bool by_picture, double (*expected)(vec3 p), tally *t)
{
    uint32_t w = g->v.settings.width, h = g->v.settings.height;
    frame f = stage_render(g, ce);
    tally picture = {0}, *to = by_picture ? &picture : t;
    for (uint32_t i = 0; i < w * h; i++)
        tally_add(to, (double)f.lit.pixels[i].y / expected(floor_point(&g->v, i % w + 0.5, i / w + 0.5)));
    if (by_picture)
        tally_add(t, tally_mean(&picture));
    frame_free(&f);
}

/* Exact visibility: every pixel is an independent estimate. Cached: pixels share cells, so only pictures are, each with
 * grids of its own (the bounds decide where cells begin): one light cell at a shadow's edge is right or wrong as a
 * whole, wherever C_E is. */
static void check_picture(stage *g, double (*expected)(vec3 p), double bias, double cached_bias, const char *what)
{
    enum { PICTURES = 12 };
    tally exact = {0};
    for (uint64_t seed = 0; seed < 2; seed++) {
        g->v.settings.seed = seed;
        tally_picture(g, 0.0f, false, expected, &exact);
    }
    assert_true(tally_error(&exact) < 0.01);
    assert_mean(&exact, 1.0, bias, what);
    for (int m = 1; m < MODES; m++) {
        tally cached = {0};
        vcache_config fitting = g->v.settings.cache;
        for (uint64_t seed = 0; seed < PICTURES; seed++) {
            rng r = rng_make(seed, 0);
            for (int k = 0; k < 3; k++) {
                float extent = fitting.bounds_max[k] - fitting.bounds_min[k];
                g->v.settings.cache.bounds_max[k] = fitting.bounds_max[k] + extent * rng_float(&r);
            }
            g->v.settings.seed = seed;
            tally_picture(g, modes[m], true, expected, &cached);
        }
        g->v.settings.cache = fitting;
        assert_true(tally_error(&cached) < 0.03);
        assert_mean(&cached, 1.0, cached_bias, what);
    }
}

/* Above the floor beside the camera's line of sight, looking down. */
static const vec3 lamp[4] = {{-0.5f, 0.8f, -0.9f}, {0.3f, 0.8f, -0.9f}, {0.3f, 0.8f, -0.3f}, {-0.5f, 0.8f, -0.3f}};

static double under_lamp(vec3 p)
{
    return 0.5 / 3.14159265358979 * polygon_irradiance(p, v3(0, 1, 0), lamp, 4);
}

/* The screen leaves x > -0.1. */
static double under_half_lamp(vec3 p)
{
    const vec3 half[4] = {{-0.1f, 0.8f, -0.9f}, lamp[1], lamp[2], {-0.1f, 0.8f, -0.3f}};
    return 0.5 / 3.14159265358979 * polygon_irradiance(p, v3(0, 1, 0), half, 4);
}

static stage lamp_stage(bool up, bool two_sided, bool screen)
{
    scene *s = floor_scene(MATERIAL_DIFFUSE, 0.5f);
    uint32_t m = add_material(s, MATERIAL_DIFFUSE, 0.0f);
    s->materials[m].emission = v3(0.5f, 1.0f, 2.0f);
    s->materials[m].two_sided = two_sided;
    vec3 x = v3_sub(lamp[1], lamp[0]), z = v3_sub(lamp[3], lamp[0]);
    add_quad(s, lamp[0], up ? z : x, up ? x : z, m);
    if (screen)
        add_quad(s, v3(-0.6f, 0.7999f, -1.0f), v3(0.5f, 0, 0), v3(0, 0, 0.8f), add_material(s, MATERIAL_DIFFUSE, 0.0f));
    return stage_new(s, slanted(1.0f, 0.3f), 32, 32, 4);
}

static void area_light(void **state)
{
    (void)state;
    for (int two_sided = 0; two_sided < 2; two_sided++) {
        stage g = lamp_stage(false, two_sided, false);
        check_picture(&g, under_lamp, 0.0, 0.0, "lamp");
        stage_free(&g);
    }
    stage g = lamp_stage(true, true, false);
    check_picture(&g, under_lamp, 0.0, 0.0, "lamp upside down, two sides");
    stage_free(&g);
    g = lamp_stage(true, false, false);
    for (int m = 0; m < MODES; m++) {
        frame f = stage_render(&g, modes[m]);
        for (size_t i = 0; i < 32 * 32; i++)
            assert_true(f.lit.pixels[i].y == 0.0f);
        frame_free(&f);
    }
    stage_free(&g);
}

static void area_light_half_blocked(void **state)
{
    (void)state;
    stage g = lamp_stage(false, false, true);
    check_picture(&g, under_half_lamp, 1e-3, 0.01, "half a lamp"); /* parallax of 1e-4 */
    stage_free(&g);
}

/* --------------------------------------------------------------------------------------------------- environment */

/* A wall along x = 0, 40 high and wide, beside a floor of 0.2. */
static const vec3 wall[4] = {{0, 0, -20}, {0, 20, -20}, {0, 20, 20}, {0, 0, 20}};

static double half_sky(vec3 p)
{
    return 1.0 - polygon_irradiance(p, v3(0, 1, 0), wall, 4) / 3.14159265358979;
}

static void half_environment(void **state)
{
    (void)state;
    scene *s = scene_new("half sky");
    add_quad(s, v3(0, 0, -0.1f), v3(0, 0, 0.2f), v3(0.2f, 0, 0), add_material(s, MATERIAL_DIFFUSE, 1.0f));
    add_quad(s, wall[0], v3(0, 20, 0), v3(0, 0, 40), add_material(s, MATERIAL_DIFFUSE, 0.0f));
    s->environment = environment_uniform(v3(1, 1, 1));
    stage g = stage_new(s, camera_look(v3(0.1f, 0.5f, 0), v3(0.1f, 0, 0), v3(1, 0, 0), 0.3f), 32, 32, 4);
    assert_true(fabs(half_sky(v3(0.1f, 0, 0)) - 0.5) < 0.005); /* half of it, but for what is seen over the wall */
    check_picture(&g, half_sky, 0.0, 0.01, "half sky");
    stage_free(&g);
}

/* Irradiance of the floor under a map, by quadrature. */
static double map_irradiance(const environment *e)
{
    enum { ROWS = 500, COLUMNS = 2000 };
    double sum = 0.0;
    for (int i = 0; i < ROWS; i++)
        for (int j = 0; j < COLUMNS; j++) {
            float y = sqrtf(((float)i + 0.5f) / ROWS), phi = 2.0f * PI_F * ((float)j + 0.5f) / COLUMNS;
            sum +=
                (double)environment_radiance(e, v3(sqrtf(1.0f - y * y) * cosf(phi), y, sqrtf(1.0f - y * y) * sinf(phi)))
                    .y;
        }
    return sum * 3.14159265358979 / ((double)ROWS * COLUMNS);
}

static double one(vec3 p)
{
    (void)p;
    return 1.0;
}

/* 500 of 501 parts of the light come from one texel of 2048. */
static void bright_spot(void **state)
{
    (void)state;
    image map = image_new(64, 32);
    for (size_t i = 0; i < 64 * 32; i++)
        map.pixels[i] = v3(1, 1, 1);
    map.pixels[64 * 7 + 20] = v3(1e6f, 1e6f, 1e6f);
    scene *s = floor_scene(MATERIAL_DIFFUSE, 1.0f);
    assert_true(environment_from_image(&map, &s->environment, NULL));
    image_free(&map);
    double e = map_irradiance(s->environment) / 3.14159265358979;
    s->materials[0].color = v3(0, (float)(1.0 / e), 0); /* so that the answer is 1 */
    stage g = stage_new(s, slanted(1.0f, 0.3f), 32, 32, 4);
    check_picture(&g, one, 2e-3, 2e-3, "bright spot"); /* the quadrature's error */
    stage_free(&g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(furnace_diffuse),   cmocka_unit_test(furnace_gloss),
        cmocka_unit_test(furnace_specular),  cmocka_unit_test(punctual),
        cmocka_unit_test(hard_shadow_exact), cmocka_unit_test(hard_shadow_cached),
        cmocka_unit_test(area_light),        cmocka_unit_test(area_light_half_blocked),
        cmocka_unit_test(half_environment),  cmocka_unit_test(bright_spot),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
