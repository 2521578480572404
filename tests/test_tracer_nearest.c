/* SPDX-License-Identifier: Apache-2.0 */
/* Nearest hits of packets against those of single rays, and emitters tried first against all surfaces at once. */
#include "embree_compat.h"
#include "emitters.h"
#include "scene_support.h"
#include "tracer.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

/* Mirrors, shears and moves. */
static const float sheared[12] = {-1.0f, 0.5f, 0.1f, 2.0f, 0.2f, 1.5f, -0.7f, -1.0f, 0.0f, 0.3f, 0.6f, 0.5f};

/* Stands before Embree's own, so that tests can play a machine with narrower vectors. */
static int widest = 16;

ssize_t rtcGetDeviceProperty(RTCDevice device, enum RTCDeviceProperty property)
{
    (void)device;
    switch (property) {
    case RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED:
        return widest >= 16;
    case RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED:
        return widest >= 8;
    case RTC_DEVICE_PROPERTY_NATIVE_RAY4_SUPPORTED:
        return widest >= 4;
    case RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED:
        return 1;
    default:
        return 0;
    }
}

static tracer *trace(const scene *s)
{
    tracer *t;
    message err = {""};
    if (!tracer_create(s, 1, &t, &err))
        fail_msg("%s", err.text);
    return t;
}

enum { WALL, GLASS, LAMP, PANEL, NEON, KINDS }; /* dark, dark glass, one-sided, two-sided, glass that glows */

/* Five soups, one of each material; each stands twice, in an instanced scene as Embree instances. */
static scene *glowing_soup(uint64_t seed, bool instanced)
{
    rng r = rng_make(7, seed);
    scene *s = scene_new("glow");
    for (uint32_t k = 0; k < KINDS; k++) {
        material m = plain_material(k == GLASS || k == NEON ? MATERIAL_DIELECTRIC : MATERIAL_DIFFUSE, v3(1, 1, 1));
        m.emission = k >= LAMP ? v3(1.0f + (float)k, 2, 3) : v3(0, 0, 0);
        m.two_sided = k == PANEL;
        scene_add_material(s, m);
        uint32_t at = scene_add_mesh(s, soup_mesh(&r, 60, 0.3f, 1.0f, v3(0, 0, 0), k));
        place_mesh(s, at, transform_identity);
        place_mesh(s, at, sheared);
    }
    if (instanced)
        add_ballast(s, &r, 0.1f, v3(1000, 1000, 1000), WALL);
    return s;
}

/* --- Packets --- */

static void compare_nearest(const tracer *t, rng *r, int *hits, int *misses, int *differ)
{
    for (int i = 0; i < 1500; i++) {
        ray_packet p;
        surface got[TRACER_PACKET], single;
        uint32_t active = i == 0 ? 0xffffu : i == 1 ? 0u : rng_u32(r) & 0xffffu;
        packet_init(&p);
        vec3 o = random_vec3(r, 2.0f), to = random_vec3(r, 1.0f);
        for (int k = 0; k < TRACER_PACKET; k++) {
            vec3 d = v3_normalize(v3_sub(v3_add(to, random_vec3(r, i & 1 ? 0.05f : 1.0f)), o));
            p.org_x[k] = o.x, p.org_y[k] = o.y, p.org_z[k] = o.z;
            p.dir_x[k] = d.x, p.dir_y[k] = d.y, p.dir_z[k] = d.z;
            p.tfar[k] = INFINITY;
        }
        ray_packet before = p;
        uint32_t hit = tracer_closest16(t, &p, active, active % 2, got);
        assert_memory_equal(&p, &before, sizeof p);
        assert_int_equal(hit & ~active, 0);
        for (int k = 0; k < TRACER_PACKET; k++) {
            if (!(active >> k & 1u))
                continue;
            bool expected = tracer_closest(t, o, v3(p.dir_x[k], p.dir_y[k], p.dir_z[k]), &single);
            if (expected != (bool)(hit >> k & 1u) ||
                (expected && (single.instance != got[k].instance || single.primitive != got[k].primitive))) {
                ++*differ; /* at an edge rounding may decide */
                continue;
            }
            *hits += expected, *misses += !expected;
            if (!expected)
                continue;
            assert_int_equal(single.mesh, got[k].mesh);
            assert_int_equal(single.back_side, got[k].back_side);
            assert_ptr_equal(single.material, got[k].material);
            assert_memory_equal(&single.wo, &got[k].wo, sizeof single.wo);
            assert_true(v3_length(v3_sub(single.position, got[k].position)) < 1e-4f);
            assert_true(fabsf(single.distance - got[k].distance) < 1e-4f);
            assert_true(v3_dot(single.geometric_normal, got[k].geometric_normal) > 0.9999f);
        }
    }
}

static void packets_equal_single_rays(void **state)
{
    (void)state;
    const int widths[] = {16, 8, 4, 1};
    for (int instanced = 0; instanced < 2; instanced++) {
        rng r = rng_make(2, 1);
        scene *s = glowing_soup(1, instanced);
        for (int i = 0; i < 4; i++) {
            int hits = 0, misses = 0, differ = 0;
            widest = widths[i];
            tracer *t = trace(s);
            compare_nearest(t, &r, &hits, &misses, &differ);
            assert_true(hits > 2000 && misses > 1000 && differ < 5);
            tracer_free(t);
        }
        widest = 16;
        scene_free(s);
    }
}

/* --- Emitters first --- */

static void emitters_first_equal_everything(void **state)
{
    (void)state;
    for (int instanced = 0; instanced < 2; instanced++) {
        scene *s = glowing_soup(2, instanced);
        tracer *t = trace(s);
        rng r = rng_make(3, 1);
        int lit = 0, walled = 0, backs = 0, through_glass = 0, beyond_neon = 0, differ = 0;
        for (int i = 0; i < 40000; i++) {
            vec3 o = random_vec3(&r, 3.0f), d = v3_normalize(v3_sub(random_vec3(&r, 1.0f), o));
            surface a, b, any;
            bool hit = tracer_closest_opaque(t, o, d, &a), glows = hit && luminance(a.material->emission) > 0.0f;
            bool found = tracer_closest_emitter(t, o, d, &b);
            bool seen = found && !tracer_occluded(t, o, d, surface_reach(&b));
            if (seen != glows || (seen && (a.instance != b.instance || a.primitive != b.primitive))) {
                differ++; /* where two surfaces touch */
                continue;
            }
            walled += found && !seen;
            if (!seen)
                continue;
            rgb want = surface_emission(&a), got = surface_emission(&b);
            assert_memory_equal(&want, &got, sizeof want);
            assert_true(fabsf(a.distance - b.distance) < 1e-4f);
            assert_true(b.material->kind != MATERIAL_DIELECTRIC);
            lit += want.x > 0.0f;
            backs += !(want.x > 0.0f);
            tracer_closest(t, o, d, &any);
            through_glass += any.material == &s->materials[GLASS];
            beyond_neon += any.material == &s->materials[NEON];
        }
        assert_true(lit > 1000 && walled > 1000 && backs > 300 && through_glass > 300 && beyond_neon > 300);
        assert_true(differ < 10);
        tracer_free(t);
        scene_free(s);
    }
}

/* A lamp close to a large wall and far from the origin: its own surface does not block it, what lies before it does. */
static void lamps_do_not_block_themselves(void **state)
{
    (void)state;
    const float scales[] = {1e-3f, 1.0f, 1e4f};
    for (int k = 0; k < 3; k++) {
        float a = scales[k], z = 30.0f * a;
        const vec3 lamp[3] = {{-9 * a, -9 * a, z}, {9 * a, -9 * a, z}, {0, 9 * a, z}};
        vec3 wall[3];
        scene *s = scene_new("lamp");
        material m = plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1));
        scene_add_material(s, m);
        m.emission = v3(1, 1, 1);
        m.two_sided = true;
        scene_add_material(s, m);
        for (int side = -1; side < 2; side += 2) { /* behind and, for x > 0, before */
            for (int i = 0; i < 3; i++)
                wall[i] = v3_add(lamp[i], v3(side > 0 ? 9.0f * a : 0.0f, 0, -0.01f * a * (float)side));
            place_mesh(s, scene_add_mesh(s, corners_mesh(wall, 1, 0)), transform_identity);
        }
        place_mesh(s, scene_add_mesh(s, corners_mesh(lamp, 1, 1)), transform_identity);
        tracer *t = trace(s);
        rng r = rng_make(4, (uint64_t)k);
        int front = 0, hidden = 0;
        for (int i = 0; i < 20000; i++) {
            vec3 o = v3_scale(random_vec3(&r, 20.0f), a), to = v3_scale(random_vec3(&r, 8.0f), a);
            to.z = z;
            surface all, first;
            vec3 d = v3_normalize(v3_sub(to, o));
            bool hit = tracer_closest_opaque(t, o, d, &all) && all.instance == 2;
            bool seen = tracer_closest_emitter(t, o, d, &first) && !tracer_occluded(t, o, d, surface_reach(&first));
            assert_int_equal(hit, seen);
            front += hit, hidden += !hit;
        }
        assert_true(front > 3000 && hidden > 1000);
        tracer_free(t);
        scene_free(s);
    }
}

static void dark_scenes_have_no_emitters(void **state)
{
    (void)state;
    rng r = rng_make(5, 1);
    scene *s = scene_new("dark");
    material m = plain_material(MATERIAL_DIELECTRIC, v3(1, 1, 1));
    scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
    m.emission = v3(1, 1, 1);
    scene_add_material(s, m);
    for (uint32_t k = 0; k < 2; k++)
        place_mesh(s, scene_add_mesh(s, soup_mesh(&r, 100, 1.0f, 1.0f, v3(0, 0, 0), k)), transform_identity);
    tracer *t = trace(s);
    surface h;
    for (int i = 0; i < 100; i++) {
        vec3 o = random_vec3(&r, 1.0f);
        assert_false(tracer_closest_emitter(t, o, random_direction(&r), &h));
    }
    tracer_free(t);
    scene_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(packets_equal_single_rays),
        cmocka_unit_test(emitters_first_equal_everything),
        cmocka_unit_test(lamps_do_not_block_themselves),
        cmocka_unit_test(dark_scenes_have_no_emitters),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
