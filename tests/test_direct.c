/* SPDX-License-Identifier: Apache-2.0 */
/* Direct light of a chunk, in queues and packets, against the same estimates one by one and with full rays. */
#include "render_support.h"

/* ---------------------------------------------------------------------------------------------------- one by one */

static rgb reflected(const eye_sample *e, vec3 wi)
{
    float cosine = v3_dot(e->surface.normal, wi);
    if (!(cosine > 0.0f) || !(v3_dot(e->surface.geometric_normal, wi) > 0.0f))
        return v3(0, 0, 0);
    return v3_scale(v3_mul(e->weight, material_eval(&e->surface, wi)), cosine);
}

/* The light samples of one eye sample: emitters, then environment. */
static void plain_samples(const view *v, const eye_sample *e, int emitter_samples, int env_samples, rgb *value,
                          vec3 *target)
{
    rng r = rng_make(v->settings.seed ^ 0x6c69676874u, e->random);
    float shift = emitter_samples > 0 ? rng_float(&r) : 0.0f;
    for (int i = 0; i < emitter_samples; i++, value++, target++) {
        float u2 = rng_float(&r), u3 = rng_float(&r), n = (float)emitter_samples;
        emitter_sample s = emitters_sample(v->emitters, fminf(((float)i + shift) / n, 0x1.fffffep-1f), u2, u3);
        vec3 d = v3_sub(s.position, e->origin), wi = v3_normalize(d);
        float r2 = v3_dot(d, d), cosine = -v3_dot(wi, s.normal), pdf = n * s.pdf_area * r2 / cosine;
        *target = s.position;
        *value = v3(0, 0, 0);
        if (cosine > 0.0f)
            *value = v3_scale(v3_mul(reflected(e, wi), s.radiance), 1.0f / (pdf + material_pdf(&e->surface, wi)));
    }
    shift = env_samples > 0 ? rng_float(&r) : 0.0f;
    for (int i = 0; i < env_samples; i++, value++, target++) {
        rgb radiance;
        float n = (float)env_samples, pdf, u2 = rng_float(&r);
        vec3 wi = environment_sample(v->scene->environment, fminf(((float)i + shift) / n, 0x1.fffffep-1f), u2,
                                     &radiance, &pdf);
        *target = wi;
        *value = v3_scale(v3_mul(reflected(e, wi), radiance), 1.0f / (n * pdf + material_pdf(&e->surface, wi)));
    }
}

/* The ray that the material draws, traced through everything. `kind`: 0 nothing, 1 emitter, 2 sky. */
static rgb plain_material_ray(const view *v, const eye_sample *e, int *kind)
{
    bool glows = v->emitters && v->settings.light_samples > 0;
    bool sky = v->scene->environment && v->settings.env_samples > 0;
    rng r = rng_make(v->settings.seed ^ 0x6d6174657269616cu, e->random);
    float u1 = rng_float(&r), u2 = rng_float(&r), u3 = rng_float(&r), pdf;
    vec3 wi;
    rgb weight = v3_mul(e->weight, material_sample(&e->surface, u1, u2, u3, &wi, &pdf));
    *kind = 0;
    if (!(pdf > 0.0f) || !(glows || sky))
        return v3(0, 0, 0);
    surface hit;
    if (tracer_closest_opaque(v->tracer, e->origin, wi, &hit)) {
        float cosine = v3_dot(hit.geometric_normal, hit.wo);
        if (!glows || !(cosine > 0.0f))
            return v3(0, 0, 0);
        float rival = (float)v->settings.light_samples * emitters_pdf_area(v->emitters, &hit) * hit.distance *
                      hit.distance / cosine;
        *kind = v3_max_component(surface_emission(&hit)) > 0.0f;
        return v3_scale(v3_mul(weight, surface_emission(&hit)), pdf / (pdf + rival));
    }
    if (!sky)
        return v3(0, 0, 0);
    *kind = 2;
    float rival = (float)v->settings.env_samples * environment_pdf(v->scene->environment, wi);
    return v3_scale(v3_mul(weight, environment_radiance(v->scene->environment, wi)), pdf / (pdf + rival));
}

/* --------------------------------------------------------------------------------------------------------- scenes */

static environment *bumpy_sky(void)
{
    image map = image_new(64, 32);
    rng r = rng_make(5, 5);
    message err = {{0}};
    environment *e = NULL;
    for (size_t i = 0; i < 64 * 32; i++)
        map.pixels[i] = v3(rng_float(&r), powf(rng_float(&r), 6.0f), i == 400 ? 200.0f : 0.5f);
    if (!environment_from_image(&map, &e, &err))
        fail_msg("%s", err.text);
    image_free(&map);
    return e;
}

/* A floor and a wall of all kinds of material under a hole; lamps that face down, up and both ways, one behind a pane
 * of glass, one behind a wall, one of glass; a point, a spot and a directional light. */
static stage parlour(bool lamps, bool sky)
{
    scene *s = scene_new("parlour");
    const material_kind kinds[] = {MATERIAL_DIFFUSE, MATERIAL_GLOSSY, MATERIAL_CONDUCTOR, MATERIAL_DIFFUSE};
    for (int i = 0; i < 4; i++) {
        uint32_t m = add_material(s, kinds[i], i == 3 ? 0.0f : 0.7f); /* the last one is black */
        add_quad(s, v3((float)i - 2.0f, 0, -2), v3(0, 0, 4), v3(1, 0, 0), m);
    }
    uint32_t wall = add_material(s, MATERIAL_DIFFUSE, 0.5f), glass = add_material(s, MATERIAL_DIELECTRIC, 1.0f);
    add_quad(s, v3(-2, 0, -2), v3(4, 0, 0), v3(0, 2, 0), wall);
    add_quad(s, v3(-2, 2, -2), v3(4, 0, 0), v3(0, 0, 2), wall);
    add_quad(s, v3(-0.9f, 1.2f, 0), v3(0.5f, 0, 0), v3(0, 0, 0.5f), wall);
    add_quad(s, v3(0, 1.2f, 0), v3(0.5f, 0, 0), v3(0, 0, 0.5f), glass);
    for (uint32_t i = 0; lamps && i < 4; i++) {
        uint32_t m = add_material(s, i == 3 ? MATERIAL_DIELECTRIC : MATERIAL_DIFFUSE, 0.3f);
        s->materials[m].emission = v3(3, 2 + (float)i, 1);
        s->materials[m].two_sided = i == 1;
        float x = 0.9f * (float)i - 1.8f;
        add_quad(s, v3(x, 1.5f, 0), v3(0.8f, 0, 0), v3(0, 0, 0.8f), m);     /* faces down */
        add_quad(s, v3(x, 1.0f, -1.5f), v3(0, 0, 0.8f), v3(0.8f, 0, 0), m); /* and up */
    }
    if (sky)
        s->environment = bumpy_sky();
    add_point_light(s, v3(0, 1, 1), 3.0f);
    scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL, .direction = v3(0.6f, -0.8f, 0), .intensity = v3(1, 2, 3)});
    scene_add_light(s, (light){.kind = LIGHT_SPOT,
                               .position = v3(1, 1.8f, 0),
                               .direction = v3(0, -1, 0),
                               .intensity = v3(5, 5, 5),
                               .cos_inner = 0.9f,
                               .cos_outer = 0.4f});
    stage g = stage_new(s, camera_look(v3(0, 1, 5), v3(0, 1, 0), v3(0, 1, 0), 0.5f), 8, 8, 1);
    g.v.settings.light_samples = 3;
    g.v.settings.env_samples = 67; /* more than a queue takes */
    if (!sky) {                    /* scene_finish gave one */
        environment_free(s->environment);
        s->environment = NULL;
    }
    return g;
}

static uint32_t look_around(const view *v, rng *r, uint32_t count, eye_sample *eyes)
{
    uint32_t n = 0;
    while (n < count) {
        vec3 o = v3(0, 1, 1);
        eye_sample e = {.weight = v3(rng_float(r), 1, 0.5f), .pixel = n, .random = rng_u32(r)};
        if (!tracer_closest(v->tracer, o, random_direction(r), &e.surface) || material_is_specular(e.surface.material))
            continue;
        e.origin = surface_offset(&e.surface, e.surface.geometric_normal);
        eyes[n++] = e;
    }
    return n;
}

static bool near_to(rgb a, rgb b)
{
    float scale = 1e-3f * (fabsf(b.x) + fabsf(b.y) + fabsf(b.z)) + 1e-9f;
    return fabsf(a.x - b.x) <= scale && fabsf(a.y - b.y) <= scale && fabsf(a.z - b.z) <= scale;
}

/* ---------------------------------------------------------------------------------------------------------- tests */

typedef struct findings {
    uint32_t rays, differ, kinds[3], asked, punctual;
} findings;

static void check_samples(const view *v, const chunk *c, uint32_t e, findings *f)
{
    const pair_bits *b = &c->bits[LIGHTS_SAMPLED];
    rgb value[80];
    vec3 target[80];
    int from_emitters = v->emitters ? v->settings.light_samples : 0;
    plain_samples(v, c->eyes[e], from_emitters, (int)b->lights - from_emitters, value, target);
    for (uint32_t i = 0; i < b->lights; i++) {
        const light_sample *s = &c->sampled[(size_t)e * b->lights + i];
        bool asked = b->asked[(size_t)e * b->words + i / 64] >> i % 64 & 1u;
        f->asked += asked;
        assert_int_equal(asked, c->reflects[e] && v3_max_component(s->value) > 0.0f);
        if (!c->reflects[e])
            continue;
        assert_int_equal(s->infinite, i >= (uint32_t)from_emitters);
        assert_true(near_to(s->value, value[i]));
        assert_true(v3_length(v3_sub(s->target, target[i])) < 1e-4f);
        assert_true(!asked || c->sampled_density[(size_t)e * b->lights + i] > 0.0f);
    }
}

static void check_punctual(const view *v, const chunk *c, uint32_t e, findings *f)
{
    const pair_bits *b = &c->bits[LIGHTS_PUNCTUAL];
    for (uint32_t i = 0; i < b->lights; i++) {
        bool asked = b->asked[(size_t)e * b->words] >> i & 1u;
        assert_int_equal(b->visible[(size_t)e * b->words], 0);
        light_sample one = direct_punctual(c->eyes[e], &v->scene->lights[i]);
        assert_int_equal(asked, c->reflects[e] && v3_max_component(one.value) > 0.0f);
        f->punctual += asked;
        if (!c->reflects[e])
            continue;
        float geometry = c->punctual_geometry[(size_t)e * c->punctual.padded + i];
        rgb response = punctuals_response(&c->punctual, c->eyes[e], i);
        bool infinite;
        vec3 target = punctuals_target(&c->punctual, i, &infinite);
        assert_true(!asked || near_to(v3_mul(v3_scale(response, geometry), c->eyes[e]->weight), one.value));
        assert_memory_equal(&target, &one.target, sizeof target);
        assert_int_equal(infinite, one.infinite);
    }
}

static findings check_chunks(const view *v)
{
    findings f = {0};
    vpl_set none = vpls_new(v);
    chunk c;
    eye_sample eyes[CHUNK];
    rng r = rng_make(6, 1);
    chunk_new(&c, v, &none, v->scene->light_count);
    for (uint32_t i = 0; i < 60; i++) {
        c.count = look_around(v, &r, i % 3 == 0 ? CHUNK : 1 + rng_u32(&r) % CHUNK, eyes);
        for (uint32_t e = 0; e < c.count; e++)
            c.eyes[e] = &eyes[e];
        shade_unoccluded(v, &none, &c);
        for (uint32_t e = 0; e < c.count; e++) {
            int kind;
            rgb expected = plain_material_ray(v, &eyes[e], &kind);
            f.rays++;
            f.kinds[kind] += c.reflects[e];
            f.differ += !near_to(c.material[e], c.reflects[e] ? expected : v3(0, 0, 0)); /* rays through an edge */
            check_samples(v, &c, e, &f);
            check_punctual(v, &c, e, &f);
        }
    }
    chunk_free(&c);
    vpls_free(&none);
    return f;
}

static void chunks_equal_one_by_one(void **state)
{
    (void)state;
    for (int mask = 0; mask < 8; mask++) {
        bool lamps = mask & 1, sky = mask & 2, off = mask & 4; /* off: lamps are there but not to be drawn */
        stage g = parlour(lamps, sky);
        if (off) {
            emitters_free(g.e);
            g.v.emitters = g.e = NULL;
        }
        findings f = check_chunks(&g.v);
        assert_true(f.rays > 1000 && f.differ <= 3);
        assert_true(f.punctual > 500);
        assert_true((f.kinds[1] > 100) == (lamps && !off));
        assert_true((f.kinds[2] > 100) == sky);
        assert_true((f.asked > 300) == ((lamps && !off) || sky));
        stage_free(&g);
    }
}

/* Rays of a packet go their own ways: each pixel sees its own part of the sky. 37 x 21: with packets left half empty.
 */
static void sky_behind_each_pixel(void **state)
{
    (void)state;
    scene *s = scene_new("sky");
    add_quad(s, v3(-1, -5, -1), v3(0, 0, 2), v3(2, 0, 0),
             add_material(s, MATERIAL_DIFFUSE, 0.5f)); /* out of the picture */
    s->environment = bumpy_sky();
    stage g = stage_new(s, camera_look(v3(0, 1, 0), v3(1, 1.2f, 0.5f), v3(0, 1, 0), 1.0f), 37, 21, 1);
    const camera *c = &g.v.camera;
    vec3 right = v3_cross(c->forward, c->up);
    float pixel = 2.0f * tanf(0.5f * c->yfov) / 21.0f;
    frame f = stage_render(&g, 0.0f);
    for (int y = 0; y < 21; y++)
        for (int x = 0; x < 37; x++) {
            vec3 d = v3_mad(c->forward, ((float)x - 18.0f) * pixel, right);
            d = v3_normalize(v3_mad(d, (10.0f - (float)y) * pixel, c->up));
            assert_true(near_to(f.seen.pixels[37 * y + x], environment_radiance(s->environment, d)));
        }
    assert_true(f.eye_samples == 0);
    frame_free(&f);
    stage_free(&g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(chunks_equal_one_by_one),
        cmocka_unit_test(sky_behind_each_pixel),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
