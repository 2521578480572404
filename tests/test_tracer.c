/* SPDX-License-Identifier: Apache-2.0 */
/* The tracer against brute force, against itself (packets, instances), and its surface points. */
#include "embree_compat.h"
#include "scene_support.h"
#include "tracer.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

/* Mirrors, shears and moves; condition number about 5. */
static const float sheared[12] = {-1.0f, 0.5f, 0.1f, 2.0f, 0.2f, 1.5f, -0.7f, -1.0f, 0.0f, 0.3f, 0.6f, 0.5f};

static tracer *trace(const scene *s)
{
    tracer *t;
    message err = {""};
    if (!tracer_create(s, 1, &t, &err))
        fail_msg("%s", err.text);
    return t;
}

/* Half opaque, half glass, in the cube [-1, 1]^3. */
static scene *mixed_soup(rng *r, uint32_t count)
{
    scene *s = scene_new("soup");
    scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
    scene_add_material(s, plain_material(MATERIAL_DIELECTRIC, v3(1, 1, 1)));
    for (uint32_t i = 0; i < 2; i++)
        place_mesh(s, scene_add_mesh(s, soup_mesh(r, count / 2, 0.2f, 1.0f, v3(0, 0, 0), i)), transform_identity);
    return s;
}

/* --- Against brute force --- */

typedef struct brute {
    double t;
    uint32_t instance, primitive;
    bool clear; /* neither an edge nor a second hit is so near that rounding could decide */
} brute;

static double det3(const double a[3], const double b[3], const double c[3])
{
    return a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

static brute brute_closest(const scene *s, vec3 o, vec3 d)
{
    brute best = {INFINITY, UINT32_MAX, 0, true};
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const mesh *m = &s->meshes[s->instances[i].mesh];
        for (uint32_t k = 0; k < m->triangle_count; k++) {
            vec3 p[3];
            for (int c = 0; c < 3; c++) {
                const float *q = m->positions + 3 * (size_t)m->indices[3 * k + (uint32_t)c];
                p[c] = transform_point(s->instances[i].to_world, v3(q[0], q[1], q[2]));
            }
            double e1[3] = {(double)p[1].x - p[0].x, (double)p[1].y - p[0].y, (double)p[1].z - p[0].z};
            double e2[3] = {(double)p[2].x - p[0].x, (double)p[2].y - p[0].y, (double)p[2].z - p[0].z};
            double x[3] = {(double)o.x - p[0].x, (double)o.y - p[0].y, (double)o.z - p[0].z}, n[3] = {-d.x, -d.y, -d.z};
            double det = det3(e1, e2, n), u = det3(x, e2, n) / det, v = det3(e1, x, n) / det, t = det3(e1, e2, x) / det;
            double inside = fmin(u, fmin(v, 1.0 - u - v));
            if (!(inside > -1e-4 && t > -1e-4 && t < best.t + 1e-4))
                continue;
            bool clear = inside > 1e-4 && t > 1e-4 && (t < best.t - 1e-4 || best.t == INFINITY);
            if (inside > 0.0 && t > 0.0 && t < best.t)
                best = (brute){t, i, k, clear};
            else
                best.clear = false;
        }
    }
    return best;
}

static void closest_equals_brute_force(void **state)
{
    (void)state;
    rng r = rng_make(1, 1);
    scene *s = mixed_soup(&r, 200);
    place_mesh(s, 0, sheared);
    tracer *t = trace(s);
    int hits = 0, misses = 0;
    for (int i = 0; i < 4000; i++) {
        vec3 o = random_vec3(&r, 1.5f), d = random_direction(&r);
        brute b = brute_closest(s, o, d);
        surface h;
        bool hit = tracer_closest(t, o, d, &h);
        if (!b.clear)
            continue;
        assert_int_equal(hit, b.instance != UINT32_MAX);
        if (!hit) {
            misses++;
            continue;
        }
        hits++;
        assert_int_equal(h.instance, b.instance);
        assert_int_equal(h.primitive, b.primitive);
        assert_int_equal(h.mesh, s->instances[h.instance].mesh);
        assert_ptr_equal(h.material, &s->materials[s->meshes[h.mesh].material]);
        assert_true(fabs(h.distance - b.t) < 2e-5);
        assert_true(v3_length(v3_sub(h.position, v3_mad(o, h.distance, d))) < 2e-5f);
    }
    assert_true(hits > 500 && misses > 500);
    tracer_free(t);
    scene_free(s);
}

/* --- Packets --- */

/* `solid`: rays that glass blocks. */
static void compare_packets(const tracer *t, rng *r, bool solid, int *blocked, int *open)
{
    bool (*occluded)(const tracer *, vec3, vec3, float) = solid ? tracer_occluded_solid : tracer_occluded;
    for (int i = 0; i < 2000; i++) {
        ray_packet p, before;
        uint32_t active = i == 0 ? 0xffffu : i == 1 ? 0u : rng_u32(r) & 0xffffu;
        (solid ? packet_init_solid : packet_init)(&p);
        vec3 center = random_vec3(r, 1.0f);
        for (int k = 0; k < TRACER_PACKET; k++) {
            vec3 o = v3_add(center, random_vec3(r, i & 1 ? 0.1f : 1.0f)), d = random_vec3(r, 2.0f);
            p.org_x[k] = o.x, p.org_y[k] = o.y, p.org_z[k] = o.z;
            p.dir_x[k] = d.x, p.dir_y[k] = d.y, p.dir_z[k] = d.z;
            p.tfar[k] = !(active >> k & 1u) && i & 4 ? -INFINITY : 0.5f + rng_float(r); /* as if blocked before */
        }
        before = p;
        uint32_t got = tracer_occluded16(t, &p, active, i & 2), expected = 0;
        for (int k = 0; k < TRACER_PACKET; k++) {
            vec3 o = v3(before.org_x[k], before.org_y[k], before.org_z[k]);
            vec3 d = v3(before.dir_x[k], before.dir_y[k], before.dir_z[k]);
            bool hit = active >> k & 1u && occluded(t, o, d, before.tfar[k]);
            expected |= (uint32_t)hit << k;
            if (!hit)
                assert_true(p.tfar[k] == before.tfar[k]);
            *blocked += hit;
            *open += !hit && active >> k & 1u;
        }
        assert_int_equal(got, expected);
        memcpy(p.tfar, before.tfar, sizeof p.tfar);
        assert_memory_equal(&p, &before, sizeof p);
    }
}

/* What Embree has on this machine: wider packets are emulated, and touch lanes that are not active. */
static int native_width(void)
{
#if defined(__x86_64__)
    return __builtin_cpu_supports("avx512vl") ? 16 : __builtin_cpu_supports("avx") ? 8 : 4;
#else
    return 4;
#endif
}

/* Stands before Embree's own, so that tests can play a machine with narrower vectors. */
static int widest;
static bool ray_masks = true;

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
        return ray_masks;
    default:
        return 0;
    }
}

static void packets_equal_single_rays(void **state)
{
    (void)state;
    const int widths[] = {16, 8, 4, 1};
    rng r = rng_make(2, 1);
    scene *s = mixed_soup(&r, 400);
    for (int i = 0; i < 4; i++) {
        int blocked[2] = {0, 0}, open[2] = {0, 0};
        if (widths[i] > native_width())
            continue;
        widest = widths[i];
        tracer *t = trace(s);
        for (int solid = 0; solid < 2; solid++) {
            compare_packets(t, &r, solid, &blocked[solid], &open[solid]);
            assert_true(blocked[solid] > 1000 && open[solid] > 1000);
        }
        assert_true(blocked[1] > 1.3 * blocked[0]); /* half of all is glass */
        tracer_free(t);
    }
    widest = native_width();
    scene_free(s);
}

static void embree_without_masks_is_refused(void **state)
{
    (void)state;
    scene *s = scene_new("empty");
    tracer *t;
    message err = {""};
    ray_masks = false;
    assert_false(tracer_create(s, 1, &t, &err));
    ray_masks = true;
    assert_null(t);
    assert_non_null(strstr(err.text, "ray masks"));
    scene_free(s);
}

/* --- Masks --- */

/* Even lanes look at the pane of glass, odd ones at the opaque pane. */
static uint32_t blocked_by_panes(const tracer *t, void (*init)(ray_packet *), float far)
{
    ray_packet p;
    init(&p);
    for (int k = 0; k < TRACER_PACKET; k++) {
        p.org_z[k] = k & 1 ? 19.0f : -1.0f;
        p.dir_z[k] = 1.0f;
        p.tfar[k] = far;
    }
    return tracer_occluded16(t, &p, 0xffffu, false);
}

static void check_panes(const tracer *t)
{
    const vec3 before = v3(0, 0, -1), between = v3(0, 0, 19), ahead = v3(0, 0, 1);
    surface h;
    assert_true(tracer_closest(t, before, ahead, &h));
    assert_int_equal(h.mesh, 0);
    assert_false(tracer_occluded(t, before, ahead, 10.0f));
    assert_false(tracer_occluded(t, between, ahead, 0.5f));
    assert_true(tracer_occluded(t, between, ahead, 2.0f));
    assert_true(tracer_occluded(t, before, ahead, 30.0f));
    assert_true(tracer_occluded_solid(t, before, ahead, 10.0f));
    assert_false(tracer_occluded_solid(t, before, ahead, 0.5f));
    assert_true(tracer_occluded_solid(t, between, ahead, 2.0f));
    assert_false(tracer_occluded_solid(t, between, ahead, 0.5f));
    assert_int_equal(blocked_by_panes(t, packet_init, 2.0f), 0xaaaa);
    assert_int_equal(blocked_by_panes(t, packet_init_solid, 2.0f), 0xffff);
    assert_int_equal(blocked_by_panes(t, packet_init_solid, 0.5f), 0);
}

static void glass_blocks_solid_rays_alone(void **state)
{
    (void)state;
    const vec3 pane[3] = {{-5, -5, 0}, {5, -5, 0}, {0, 5, 0}};
    const float moved[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 20};
    for (int instanced = 0; instanced < 2; instanced++) {
        rng r = rng_make(3, 1);
        scene *s = scene_new("pane");
        scene_add_material(s, plain_material(MATERIAL_DIELECTRIC, v3(1, 1, 1)));
        scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
        for (uint32_t k = 0; k < 2; k++) {
            uint32_t m = scene_add_mesh(s, corners_mesh(pane, 1, k));
            place_mesh(s, m, k ? moved : transform_identity);
            if (instanced)
                place_mesh(s, m, k ? moved : transform_identity);
        }
        if (instanced)
            add_ballast(s, &r, 0.1f, v3(100, 100, 100), 1);
        for (widest = 16; widest > 0; widest /= 2) { /* 2: single rays, as 1 */
            tracer *t = trace(s);
            check_panes(t);
            tracer_free(t);
        }
        widest = native_width();
        scene_free(s);
    }
}

/* --- Instances --- */

static void add_normals_and_uvs(mesh *m, rng *r)
{
    m->normals = xmalloc(3 * (size_t)m->vertex_count * sizeof(float));
    m->uvs = xmalloc(2 * (size_t)m->vertex_count * sizeof(float));
    for (uint32_t i = 0; i < m->vertex_count; i++) {
        vec3 n = random_direction(r);
        memcpy(m->normals + 3 * (size_t)i, &n, sizeof n);
        m->uvs[2 * (size_t)i] = rng_float(r);
        m->uvs[2 * (size_t)i + 1] = rng_float(r);
    }
}

static scene *two_soups(bool instanced)
{
    rng r = rng_make(4, 1);
    scene *s = scene_new("instances");
    scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
    mesh m = soup_mesh(&r, 300, 0.2f, 1.0f, v3(0, 0, 0), 0);
    add_normals_and_uvs(&m, &r);
    uint32_t k = scene_add_mesh(s, m);
    place_mesh(s, k, transform_identity);
    place_mesh(s, k, sheared);
    if (instanced)
        add_ballast(s, &r, 0.1f, v3(1000, 1000, 1000), 0);
    return s;
}

static void instances_equal_flattened_geometry(void **state)
{
    (void)state;
    scene *s[2] = {two_soups(false), two_soups(true)};
    tracer *t[2] = {trace(s[0]), trace(s[1])};
    rng r = rng_make(4, 2);
    int hits = 0, moved = 0, differ = 0;
    for (int i = 0; i < 20000; i++) {
        vec3 o = random_vec3(&r, 4.0f), d = v3_normalize(v3_sub(random_vec3(&r, 2.0f), o));
        surface a, b;
        bool hit = tracer_closest(t[0], o, d, &a);
        if (hit != tracer_closest(t[1], o, d, &b) ||
            (hit && (a.primitive != b.primitive || a.instance != b.instance))) {
            differ++; /* at an edge rounding may decide */
            continue;
        }
        float far = 4.0f * rng_float(&r);
        differ += tracer_occluded(t[0], o, d, far) != tracer_occluded(t[1], o, d, far);
        if (!hit)
            continue;
        hits++;
        moved += a.instance == 1;
        assert_int_equal(a.mesh, b.mesh);
        assert_int_equal(a.back_side, b.back_side);
        assert_true(v3_length(v3_sub(a.position, b.position)) < 1e-4f);
        assert_true(v3_dot(a.geometric_normal, b.geometric_normal) > 0.9999f);
        assert_true(fabsf(a.u - b.u) < 1e-2f && fabsf(a.v - b.v) < 1e-2f);
        assert_true(b.position_error > a.position_error);
    }
    assert_true(hits > 5000 && moved > 1000);
    int blocked = 0, open = 0;
    compare_packets(t[1], &r, false, &blocked, &open);
    assert_true(blocked > 1000 && open > 1000);
    assert_true(differ < 10);
    for (int i = 0; i < 2; i++) {
        tracer_free(t[i]);
        scene_free(s[i]);
    }
}

/* --- Offsets --- */

/* Points on triangles of one size, rays to the same side in all directions: none may meet the triangle it starts on. */
static void check_offsets(float size, float distance, bool instanced, int points)
{
    rng r = rng_make(5, (uint64_t)instanced);
    scene *s = scene_new("offsets");
    scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
    uint32_t m = scene_add_mesh(s, soup_mesh(&r, 64, size, distance, v3(0, 0, 0), 0));
    float transform[12];
    memcpy(transform, sheared, sizeof transform);
    for (int i = 0; i < 3; i++)
        transform[4 * i + 3] *= distance;
    place_mesh(s, m, instanced ? transform : transform_identity);
    if (instanced) {
        for (int i = 0; i < 3; i++)
            transform[4 * i + 3] *= 10.0f;
        place_mesh(s, m, transform);
        add_ballast(s, &r, size, v3(50.0f * distance, 0, 0), 0);
    }
    tracer *t = trace(s);
    int tested = 0, own = 0;
    for (int tries = 0; tested < points && tries < 100 * points; tries++) {
        const float *q = s->meshes[m].positions + 9 * (size_t)(rng_u32(&r) % 64);
        vec3 a = v3(q[0], q[1], q[2]), b = v3(q[3], q[4], q[5]), c = v3(q[6], q[7], q[8]);
        float u = sqrtf(rng_float(&r)), v = rng_float(&r) * u;
        vec3 target = transform_point(s->instances[0].to_world,
                                      v3_add(v3_scale(a, 1.0f - u), v3_add(v3_scale(b, u - v), v3_scale(c, v))));
        vec3 o = v3_add(target, random_vec3(&r, 4.0f * size)), d = v3_normalize(v3_sub(target, o));
        surface h, again;
        if (!tracer_closest(t, o, d, &h))
            continue;
        ray_packet p;
        packet_init(&p);
        for (int k = 0; k < TRACER_PACKET; k++) {
            vec3 toward = random_direction(&r), from = surface_offset(&h, toward);
            bool blocked = tracer_occluded(t, from, toward, INFINITY);
            if (tracer_closest(t, from, toward, &again) != blocked)
                own++;
            else
                own += blocked && again.instance == h.instance && again.primitive == h.primitive;
            p.org_x[k] = from.x, p.org_y[k] = from.y, p.org_z[k] = from.z;
            p.dir_x[k] = toward.x, p.dir_y[k] = toward.y, p.dir_z[k] = toward.z;
            p.tfar[k] = 0.01f * size;
        }
        uint32_t blocked = tracer_occluded16(t, &p, 0xffffu, false);
        for (int k = 0; k < TRACER_PACKET; k++) /* so near there is another triangle only by chance */
            if (blocked >> k & 1u) {
                vec3 d16 = v3(p.dir_x[k], p.dir_y[k], p.dir_z[k]);
                own += !tracer_occluded(t, v3(p.org_x[k], p.org_y[k], p.org_z[k]), d16, 0.01f * size);
            }
        tested++;
    }
    if (own)
        print_error("size %g, distance %g, instanced %d: %d rays of %d meet their own triangle\n", (double)size,
                    (double)distance, instanced, own, TRACER_PACKET * tested);
    assert_int_equal(tested, points);
    assert_int_equal(own, 0);
    tracer_free(t);
    scene_free(s);
}

static void offset_rays_leave_their_triangle(void **state)
{
    (void)state;
    const float sizes[] = {1e6f, 1.0f, 1e-6f};
    for (int i = 0; i < 3; i++)
        for (int far = 0; far < 2; far++)
            for (int instanced = 0; instanced < 2; instanced++)
                check_offsets(sizes[i], sizes[i] * (far ? 1000.0f : 10.0f), instanced, 8400);
}

/* --- Normals, colours --- */

static void normals_face_the_ray(void **state)
{
    (void)state;
    const vec3 corners[3] = {{-5, -5, 0}, {5, -5, 0}, {0, 5, 0}}; /* own normal +z */
    const float mirror[12] = {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
    for (int i = 0; i < 4; i++) {
        scene *s = scene_new("normals");
        scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
        place_mesh(s, scene_add_mesh(s, corners_mesh(corners, 1, 0)), i & 2 ? mirror : transform_identity);
        tracer *t = trace(s);
        surface h;
        float side = i & 1 ? -1.0f : 1.0f;
        assert_true(tracer_closest(t, v3(0.5f, 0.25f, 2.0f * side), v3(0, 0, -side), &h));
        assert_true(h.geometric_normal.z == side && h.normal.z == side && h.wo.z == side);
        assert_int_equal(h.back_side, i & 1); /* a mirrored mesh keeps its outside */
        assert_true(h.distance == 2.0f && h.position.x == 0.5f && h.position.y == 0.25f && h.position.z == 0.0f);
        assert_true(surface_offset(&h, v3(0, 0, 1)).z > 0.0f && surface_offset(&h, v3(1, 0, -0.1f)).z < 0.0f);
        tracer_free(t);
        scene_free(s);
    }
}

/* One triangle of a sphere around the origin, seen from both sides, scaled unevenly. */
static void smooth_normals(void **state)
{
    (void)state;
    const vec3 corners[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const float squeezed[12] = {2, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0.5f, 0};
    for (int inward = 0; inward < 2; inward++) {
        rng r = rng_make(6, 1);
        scene *s = scene_new("smooth");
        scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
        mesh m = corners_mesh(corners, 1, 0);
        m.normals = xmalloc(sizeof corners);
        for (int i = 0; i < 9; i++)
            m.normals[i] = inward ? -m.positions[i] : m.positions[i];
        place_mesh(s, scene_add_mesh(s, m), squeezed);
        tracer *t = trace(s);
        for (int i = 0; i < 1000; i++) {
            float a = rng_float(&r), b = rng_float(&r), c = rng_float(&r), side = i & 1 ? -1.0f : 1.0f;
            vec3 x = v3_scale(v3(a, b, c), 1.0f / (a + b + c + 1e-3f));
            vec3 p = transform_point(squeezed, x);
            vec3 expected = v3_scale(v3_normalize(v3(x.x / 2.0f, -x.y, x.z / 0.5f)), side);
            vec3 d = v3_neg(expected), o = v3_mad(p, -1.0f, d);
            surface h;
            if (!tracer_closest(t, o, d, &h) || v3_dot(h.geometric_normal, expected) < 0.1f)
                continue;
            vec3 y = v3(h.position.x / 2.0f, -h.position.y, h.position.z / 0.5f);
            expected = v3_scale(v3_normalize(v3(y.x / 2.0f, -y.y, y.z / 0.5f)), side);
            assert_true(v3_dot(h.normal, expected) > 0.99999f);
        }
        tracer_free(t);
        scene_free(s);
    }
}

/* Whatever a file holds as normals: unit, and facing both the viewer and the geometric normal. */
static void wild_normals_are_tamed(void **state)
{
    (void)state;
    rng r = rng_make(7, 1);
    scene *s = scene_new("wild");
    scene_add_material(s, plain_material(MATERIAL_DIFFUSE, v3(1, 1, 1)));
    mesh m = soup_mesh(&r, 400, 0.5f, 1.0f, v3(0, 0, 0), 0);
    add_normals_and_uvs(&m, &r);
    const float bad[] = {0.0f, NAN, INFINITY, 1e30f, 1e-30f};
    for (uint32_t i = 0; i < 9 * 100; i++)
        m.normals[i] = bad[(i / 9) % 5];
    place_mesh(s, scene_add_mesh(s, m), sheared);
    tracer *t = trace(s);
    int hits = 0, bent = 0;
    for (int i = 0; i < 20000; i++) {
        surface h;
        vec3 o = random_vec3(&r, 4.0f);
        if (!tracer_closest(t, o, v3_normalize(v3_sub(random_vec3(&r, 2.0f), o)), &h))
            continue;
        hits++;
        assert_true(fabsf(v3_length(h.normal) - 1.0f) < 1e-5f);
        assert_true(v3_dot(h.normal, h.geometric_normal) > 0.0f);
        assert_true(v3_dot(h.normal, h.wo) > 0.0f);
        assert_true(v3_dot(h.geometric_normal, h.wo) >= 0.0f);
        if (h.primitive < 20 && h.primitive % 5 < 3)
            assert_memory_equal(&h.normal, &h.geometric_normal, sizeof h.normal);
        else
            bent += v3_dot(h.normal, h.geometric_normal) < 0.99f;
    }
    assert_true(hits > 2000 && bent > 1000);
    tracer_free(t);
    scene_free(s);
}

static void texture_multiplies_colour(void **state)
{
    (void)state;
    const vec3 corners[3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    scene *s = scene_new("texture");
    material textured = plain_material(MATERIAL_DIFFUSE, v3(0.5f, 1.0f, 0.25f));
    texture x = {.width = 2, .height = 1, .rgba = xmalloc(8)};
    memcpy(x.rgba, (const uint8_t[]){255, 0, 188, 255, 0, 255, 188, 255}, 8);
    textured.texture = (int32_t)scene_add_texture(s, x);
    scene_add_material(s, textured);
    mesh m = corners_mesh(corners, 1, 0);
    m.uvs = xmalloc(6 * sizeof(float));
    memcpy(m.uvs, (const float[]){0, 0, 1, 0, 0, 1}, 6 * sizeof(float));
    place_mesh(s, scene_add_mesh(s, m), transform_identity);
    tracer *t = trace(s);
    surface h;
    assert_true(tracer_closest(t, v3(0.25f, 0.125f, 1), v3(0, 0, -1), &h)); /* centre of the first texel */
    assert_true(fabsf(h.u - 0.25f) < 1e-6f && fabsf(h.v - 0.125f) < 1e-6f);
    assert_true(fabsf(h.color.x - 0.5f) < 1e-5f && fabsf(h.color.y) < 1e-5f);
    assert_true(fabsf(h.color.z - 0.25f * 0.5029f) < 1e-4f);
    assert_true(tracer_closest(t, v3(0.75f, 0.125f, 1), v3(0, 0, -1), &h));
    assert_true(fabsf(h.color.x) < 1e-5f && fabsf(h.color.y - 1.0f) < 1e-5f);
    tracer_free(t);
    scene_free(s);
}

static void empty_scene_has_no_hits(void **state)
{
    (void)state;
    scene *s = scene_new("empty");
    tracer *t = trace(s);
    surface h;
    assert_false(tracer_closest(t, v3(0, 0, 0), v3(0, 0, 1), &h));
    assert_false(tracer_occluded(t, v3(0, 0, 0), v3(0, 0, 1), INFINITY));
    tracer_free(t);
    tracer_free(NULL);
    scene_free(s);
}

int main(void)
{
    widest = native_width();
    tracer_thread_init();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(closest_equals_brute_force),
        cmocka_unit_test(packets_equal_single_rays),
        cmocka_unit_test(embree_without_masks_is_refused),
        cmocka_unit_test(glass_blocks_solid_rays_alone),
        cmocka_unit_test(instances_equal_flattened_geometry),
        cmocka_unit_test(offset_rays_leave_their_triangle),
        cmocka_unit_test(normals_face_the_ray),
        cmocka_unit_test(smooth_normals),
        cmocka_unit_test(wild_normals_are_tamed),
        cmocka_unit_test(texture_multiplies_colour),
        cmocka_unit_test(empty_scene_has_no_hits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
