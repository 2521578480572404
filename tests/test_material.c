/* SPDX-License-Identifier: Apache-2.0 */
/* Scattering: densities, energy, reciprocity, sampling against quadrature, glass, extremes, textures. */
#include "scene_support.h"
#include "material.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

static const material_kind smooth_kinds[] = {MATERIAL_DIFFUSE, MATERIAL_CONDUCTOR, MATERIAL_GLOSSY};

static surface make_surface(const material *m, vec3 normal, vec3 wo)
{
    return (surface){.geometric_normal = normal, .normal = normal, .wo = wo, .material = m, .color = m->color};
}

static vec3 polar(float cosine, float phi)
{
    float s = sqrtf(fmaxf(0.0f, 1.0f - cosine * cosine));
    return v3(s * cosf(phi), s * sinf(phi), cosine);
}

/* Integrals over the hemisphere, by half vectors at even steps of log tan(theta): resolves lobes of any width. */
typedef struct integrals {
    double pdf, reflectance, moments[5]; /* moments of pdf: x, y, z, x z, y y */
} integrals;

static void add_moments(double m[5], vec3 w, double weight)
{
    const double f[5] = {w.x, w.y, w.z, (double)w.x * w.z, (double)w.y * w.y};
    for (int i = 0; i < 5; i++)
        m[i] += weight * f[i];
}

static integrals integrate(const surface *s)
{
    enum { NX = 300, NP = 200 };
    const double low = log(1e-5), range = log(1e4) - low;
    integrals sum = {0.0, 0.0, {0.0, 0.0, 0.0, 0.0, 0.0}};
    for (int i = 0; i < NX; i++)
        for (int k = 0; k < NP; k++) {
            double t = exp(low + range * (i + 0.5) / NX), phi = 2.0 * (double)PI_F * (k + 0.5) / NP;
            double c = 1.0 / sqrt(1.0 + t * t), sine = t * c;
            double jacobian = sine * range * t / (1.0 + t * t) * 2.0 * (double)PI_F / NP / NX;
            vec3 h = v3((float)(sine * cos(phi)), (float)(sine * sin(phi)), (float)c);
            float cos_h = v3_dot(h, s->wo);
            vec3 wi = v3_normalize(v3_sub(v3_scale(h, 2.0f * cos_h), s->wo));
            if (cos_h <= 0.0f || wi.z <= 0.0f)
                continue;
            double w = 4.0 * (double)cos_h * jacobian, pdf = w * (double)material_pdf(s, wi);
            sum.pdf += pdf;
            sum.reflectance += w * (double)(material_eval(s, wi).x * wi.z);
            add_moments(sum.moments, wi, pdf);
        }
    return sum;
}

static material rough(material_kind kind, float roughness, float ior)
{
    material m = plain_material(kind, v3(1, 1, 1));
    m.roughness = roughness;
    m.ior = ior;
    return m;
}

static const float roughnesses[] = {0.03f, 0.1f, 0.3f, 0.6f, 1.0f};
static const float cosines[] = {1.0f, 0.9f, 0.6f, 0.3f, 0.1f};

/* --- Energy --- */

static void nothing_reflects_more_than_it_gets(void **state)
{
    (void)state;
    const float iors[] = {1.01f, 1.5f, 3.0f};
    for (int k = 0; k < 3; k++)
        for (int r = 0; r < 5; r++)
            for (int c = 0; c < 5; c++)
                for (int i = 0; i < 3; i++) {
                    material m = rough(smooth_kinds[k], roughnesses[r], iors[i]);
                    surface s = make_surface(&m, v3(0, 0, 1), polar(cosines[c], 0.3f));
                    double reflectance = integrate(&s).reflectance;
                    if (reflectance > 1.001)
                        print_error("kind %d roughness %g cosine %g ior %g: %g\n", (int)m.kind, (double)m.roughness,
                                    (double)cosines[c], (double)m.ior, reflectance);
                    assert_true(reflectance < 1.001);
                    assert_true(reflectance > 0.25); /* single scattering at roughness 1 keeps 1 - log 2 */
                    if (m.kind == MATERIAL_DIFFUSE || (m.kind == MATERIAL_CONDUCTOR && m.roughness < 0.2f && c < 3))
                        assert_true(reflectance > 0.995);
                    if (m.kind == MATERIAL_GLOSSY && i == 0 && c < 3)
                        assert_true(reflectance > 0.9);
                }
}

/* --- Densities --- */

/* The density integrates to the share of samples that leave above the surface, and samples follow it: their mean
 * direction and second moments are those of the density, within 4 sigma and the quadrature's error of 3e-3. */
static void samples_follow_their_density(void **state)
{
    (void)state;
    enum { N = 40000 };
    rng r = rng_make(1, 1);
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < 5; j++)
            for (int c = 0; c < 5; c++) {
                material m = rough(smooth_kinds[k], roughnesses[j], 1.5f);
                surface s = make_surface(&m, v3(0, 0, 1), polar(cosines[c], 2.0f));
                integrals exact = integrate(&s);
                double mean[5] = {0.0, 0.0, 0.0, 0.0, 0.0}, above = 0.0;
                for (int i = 0; i < N; i++) {
                    vec3 wi;
                    float pdf, u1 = rng_float(&r), u2 = rng_float(&r), u3 = rng_float(&r);
                    material_sample(&s, u1, u2, u3, &wi, &pdf);
                    if (pdf > 0.0f) {
                        above += 1.0 / N;
                        add_moments(mean, wi, 1.0 / N);
                    }
                }
                double tolerance = 3e-3 + 4.0 * sqrt(0.25 / N);
                assert_true(fabs(above - exact.pdf) < tolerance);
                assert_true(above > 0.4);
                if (m.kind == MATERIAL_DIFFUSE)
                    assert_true(fabs(exact.pdf - 1.0) < 3e-3);
                for (int i = 0; i < 5; i++) /* components lie in [-1, 1]: sigma <= 1 */
                    assert_true(fabs(mean[i] - exact.moments[i]) < 3e-3 + 4.0 * sqrt(1.0 / N));
            }
}

static void weights_are_f_cos_over_pdf(void **state)
{
    (void)state;
    rng r = rng_make(2, 1);
    int drawn = 0;
    for (int i = 0; i < 50000; i++) {
        material m = rough(smooth_kinds[i % 3], 0.03f + 0.97f * rng_float(&r), 1.01f + rng_float(&r));
        m.color = v3(rng_float(&r), rng_float(&r), rng_float(&r));
        surface s = make_surface(&m, random_direction(&r), random_direction(&r));
        s.geometric_normal = v3_normalize(v3_add(s.normal, random_vec3(&r, 0.3f)));
        if (v3_dot(s.wo, s.geometric_normal) < 0.0f)
            s.wo = v3_neg(s.wo);
        vec3 wi;
        float pdf, u1 = rng_float(&r), u2 = rng_float(&r), u3 = rng_float(&r);
        rgb w = material_sample(&s, u1, u2, u3, &wi, &pdf);
        if (pdf == 0.0f) {
            assert_true(w.x == 0.0f && w.y == 0.0f && w.z == 0.0f);
            continue;
        }
        drawn++;
        assert_true(fabsf(v3_length(wi) - 1.0f) < 1e-5f);
        assert_true(v3_dot(wi, s.normal) > 0.0f && v3_dot(wi, s.geometric_normal) > 0.0f);
        rgb f = v3_scale(material_eval(&s, wi), v3_dot(wi, s.normal) / material_pdf(&s, wi));
        assert_true(fabsf(pdf - material_pdf(&s, wi)) <= 1e-3f * pdf);
        assert_true(fabsf(f.x - w.x) <= 1e-3f * w.x && fabsf(f.y - w.y) <= 1e-3f * w.y);
        assert_true(fabsf(f.z - w.z) <= 1e-3f * w.z);
    }
    assert_true(drawn > 30000);
}

static void scattering_is_reciprocal(void **state)
{
    (void)state;
    rng r = rng_make(3, 1);
    for (int i = 0; i < 30000; i++) {
        material m = rough(smooth_kinds[i % 3], 0.03f + 0.97f * rng_float(&r), 1.01f + rng_float(&r));
        vec3 a = random_direction(&r), b = random_direction(&r), n = random_direction(&r);
        surface s = make_surface(&m, n, v3_dot(a, n) < 0.0f ? v3_neg(a) : a), back = s;
        back.wo = v3_dot(b, n) < 0.0f ? v3_neg(b) : b;
        if (v3_dot(s.wo, n) < 1e-3f || v3_dot(back.wo, n) < 1e-3f)
            continue;
        float x = material_eval(&s, back.wo).x, y = material_eval(&back, s.wo).x;
        assert_true(x > 0.0f && fabsf(x - y) <= 1e-3f * x);
        assert_true(material_eval(&s, v3_neg(back.wo)).x == 0.0f && material_pdf(&s, v3_neg(back.wo)) == 0.0f);
    }
}

/* --- Mirrors and glass --- */

static void glass_splits_light_without_loss(void **state)
{
    (void)state;
    rng r = rng_make(4, 1);
    int total = 0;
    for (int i = 0; i < 20000; i++) {
        material m = rough(MATERIAL_DIELECTRIC, 0.5f, 1.0f + 2.0f * rng_float(&r));
        surface s = make_surface(&m, random_direction(&r), random_direction(&r));
        specular_branch b[2];
        s.back_side = i & 1;
        if (v3_dot(s.wo, s.normal) < 0.0f)
            s.wo = v3_neg(s.wo);
        int count = material_specular(&s, b);
        float eta = s.back_side ? 1.0f / m.ior : m.ior, cos_i = v3_dot(s.wo, s.normal), sum = 0.0f;
        float sin_t = sqrtf(fmaxf(0.0f, 1.0f - cos_i * cos_i)) / eta;
        for (int k = 0; k < count; k++) {
            float cos_o = v3_dot(b[k].wi, s.normal);
            sum += b[k].weight.y;
            assert_true(fabsf(v3_length(b[k].wi) - 1.0f) < 1e-5f);
            assert_true(fabsf(v3_dot(v3_cross(s.wo, b[k].wi), s.normal)) < 1e-5f); /* all in one plane */
            assert_int_equal(b[k].transmitted, cos_o < 0.0f);
            if (b[k].transmitted) {
                assert_true(b[k].eta == eta);
                assert_true(fabsf(sqrtf(fmaxf(0.0f, 1.0f - cos_o * cos_o)) - sin_t) < 1e-3f); /* Snell */
                assert_true(v3_dot(s.wo, b[k].wi) < 0.0f);
            } else {
                assert_true(b[k].eta == 1.0f && fabsf(cos_o - cos_i) < 1e-5f);
            }
        }
        assert_true(fabsf(sum - 1.0f) < 1e-6f);
        if (sin_t > 1.001f) {
            total++;
            assert_true(count == 1 && !b[0].transmitted && b[0].weight.x == 1.0f);
        } else if (sin_t < 0.999f) {
            assert_true(b[count - 1].transmitted);
        }
    }
    assert_true(total > 1000);
}

static void fresnel_at_normal_incidence(void **state)
{
    (void)state;
    material m = rough(MATERIAL_DIELECTRIC, 0.0f, 1.5f);
    surface s = make_surface(&m, v3(0, 0, 1), v3(0, 0, 1));
    specular_branch b[2];
    s.color = v3(0.5f, 1.0f, 1.0f);
    for (int side = 0; side < 2; side++) {
        s.back_side = side;
        assert_int_equal(material_specular(&s, b), 2);
        assert_true(fabsf(b[0].weight.x - 0.04f) < 1e-6f && fabsf(b[1].weight.x - 0.48f) < 1e-6f);
        assert_true(fabsf(b[1].wi.z + 1.0f) < 1e-6f);
    }
    m.ior = 1.0f; /* not there at all */
    assert_int_equal(material_specular(&s, b), 1);
    assert_true(b[0].transmitted && b[0].wi.z == -1.0f);
}

/* All that leaves a white glass sphere in a furnace of radiance 1, over all inner reflections. */
static void glass_sphere_in_a_furnace(void **state)
{
    (void)state;
    material m = rough(MATERIAL_DIELECTRIC, 0.0f, 1.5f);
    for (int i = 1; i <= 20; i++) {
        surface s = make_surface(&m, v3(0, 0, 1), polar((float)i / 20.0f, 1.0f));
        specular_branch b[2];
        assert_int_equal(material_specular(&s, b), 2);
        double radiance = b[0].weight.x, inside = b[1].weight.x;
        surface inner = make_surface(&m, v3(0, 0, 1), polar(-b[1].wi.z, 0.0f)); /* the same angle at each inner hit */
        inner.back_side = true;
        for (int bounce = 0; bounce < 500; bounce++) {
            assert_int_equal(material_specular(&inner, b), 2);
            radiance += inside * (double)b[1].weight.x;
            inside *= (double)b[0].weight.x;
        }
        assert_true(fabs(radiance - 1.0) < 1e-4);
    }
}

static void mirror_reflects(void **state)
{
    (void)state;
    material m = rough(MATERIAL_CONDUCTOR, 0.0f, 1.5f);
    m.color = v3(0.9f, 0.5f, 0.0f);
    surface s = make_surface(&m, v3(0, 0, 1), polar(0.8f, 0.0f));
    specular_branch b[2];
    assert_true(material_is_specular(&m));
    assert_int_equal(material_specular(&s, b), 1);
    assert_true(fabsf(b[0].wi.x + 0.6f) < 1e-6f && fabsf(b[0].wi.z - 0.8f) < 1e-6f && !b[0].transmitted);
    assert_true(fabsf(b[0].weight.x - (0.9f + 0.1f * powf(0.2f, 5.0f))) < 1e-6f);
    assert_true(fabsf(b[0].weight.z - powf(0.2f, 5.0f)) < 1e-6f);
    m.roughness = 0.04f;
    assert_false(material_is_specular(&m));
    assert_int_equal(material_specular(&s, b), 0);
}

/* A shading normal tilted away must not send branches to the wrong side. */
static void branches_respect_the_geometric_normal(void **state)
{
    (void)state;
    rng r = rng_make(5, 1);
    for (int i = 0; i < 20000; i++) {
        material m = rough(i & 1 ? MATERIAL_DIELECTRIC : MATERIAL_CONDUCTOR, 0.0f, 1.5f);
        surface s = make_surface(&m, v3(0, 0, 1), random_direction(&r));
        specular_branch b[2];
        s.wo.z = fabsf(s.wo.z) + 1e-6f;
        s.back_side = i & 2;
        s.normal = v3_normalize(v3_add(s.normal, random_vec3(&r, 0.9f)));
        if (v3_dot(s.normal, s.wo) < 0.0f)
            continue;
        for (int k = material_specular(&s, b) - 1; k >= 0; k--)
            assert_true(b[k].transmitted ? b[k].wi.z < 0.0f : b[k].wi.z > 0.0f);
    }
}

/* --- One branch drawn --- */

/* Each branch as often as its luminance says, and on the mean with its own weight. */
static void drawn_branches_stand_for_both(void **state)
{
    (void)state;
    enum { N = 100000 };
    material m = rough(MATERIAL_DIELECTRIC, 0.0f, 1.5f);
    m.color = v3(0.9f, 0.5f, 0.1f);
    for (int i = 1; i <= 10; i++) {
        surface s = make_surface(&m, v3(0, 0, 1), polar((float)i / 10.0f, 1.0f));
        specular_branch b[2], drawn;
        assert_int_equal(material_specular(&s, b), 2);
        double share = luminance(b[0].weight) / (luminance(b[0].weight) + luminance(b[1].weight)), reflected = 0.0;
        double mean[2][3] = {{0, 0, 0}, {0, 0, 0}};
        rng r = rng_make(6, (uint64_t)i);
        for (int n = 0; n < N; n++) {
            rgb through = v3(2, 3, 4);
            assert_true(material_specular_sample(&s, &r, &through, &drawn));
            assert_memory_equal(&drawn.wi, &b[drawn.transmitted].wi, sizeof(vec3));
            assert_memory_equal(&drawn.weight, &b[drawn.transmitted].weight, sizeof(rgb));
            reflected += !drawn.transmitted;
            for (int c = 0; c < 3; c++)
                mean[drawn.transmitted][c] += (double)(&through.x)[c] / N;
        }
        double sigma = sqrt(share * (1.0 - share) / N);
        assert_true(fabs(reflected / N - share) < 4.0 * sigma);
        for (int k = 0; k < 2; k++)
            for (int c = 0; c < 3; c++) {
                double expected = (2.0 + c) * (double)(&b[k].weight.x)[c], p = k ? 1.0 - share : share;
                assert_true(fabs(mean[k][c] - expected) < 4.0 * sigma / p * expected + 1e-5);
            }
    }
}

static bool same_state(rng a, rng b)
{
    return a.state == b.state && a.stream == b.stream;
}

/* Streams of random numbers depend on it. */
static void one_branch_takes_no_random_number(void **state)
{
    (void)state;
    material glass = rough(MATERIAL_DIELECTRIC, 0.0f, 1.5f), mirror = rough(MATERIAL_CONDUCTOR, 0.0f, 1.5f);
    material paint = rough(MATERIAL_DIFFUSE, 1.0f, 1.5f);
    rng r = rng_make(7, 1), before = r;
    rgb through = v3(1, 1, 1);
    specular_branch b;
    surface s = make_surface(&glass, v3(0, 0, 1), polar(0.1f, 1.0f));
    s.back_side = true; /* total reflection */
    assert_true(material_specular_sample(&s, &r, &through, &b) && !b.transmitted);
    assert_true(same_state(r, before) && through.x == 1.0f);
    mirror.color = v3(0.5f, 0.25f, 1.0f);
    s = make_surface(&mirror, v3(0, 0, 1), v3(0, 0, 1));
    assert_true(material_specular_sample(&s, &r, &through, &b));
    assert_true(same_state(r, before) && through.x == 0.5f && through.y == 0.25f && through.z == 1.0f);
    s.color = v3(0, 0, 0);
    assert_false(material_specular_sample(&s, &r, &through, &b));
    s = make_surface(&paint, v3(0, 0, 1), v3(0, 0, 1));
    assert_false(material_specular_sample(&s, &r, &through, &b));
    assert_true(same_state(r, before));
    s = make_surface(&glass, v3(0, 0, 1), polar(0.5f, 1.0f));
    assert_true(material_specular_sample(&s, &r, &through, &b));
    rng_float(&before);
    assert_true(same_state(r, before));
}

/* --- Extremes --- */

static bool finite3(vec3 v)
{
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

static void check_finite(const surface *s, vec3 wi, float u1, float u2, float u3)
{
    specular_branch b[2];
    float pdf = -1.0f;
    vec3 drawn;
    rgb f = material_eval(s, wi), w = material_sample(s, u1, u2, u3, &drawn, &pdf);
    assert_true(finite3(f) && f.x >= 0.0f && f.y >= 0.0f && f.z >= 0.0f);
    assert_true(isfinite(material_pdf(s, wi)) && material_pdf(s, wi) >= 0.0f);
    assert_true(finite3(w) && w.x >= 0.0f && w.x < 30.0f && isfinite(pdf) && pdf >= 0.0f && finite3(drawn));
    for (int k = material_specular(s, b) - 1; k >= 0; k--)
        assert_true(finite3(b[k].wi) && finite3(b[k].weight) && b[k].weight.x <= 1.0f);
    assert_true(material_reflectance(s) >= 0.0f && material_reflectance(s) <= 1.0f);
}

static void nothing_is_nan(void **state)
{
    (void)state;
    const float z[] = {0.0f, -0.0f, 1e-30f, 1e-12f, 1e-7f, 1e-4f, 0.5f, 1.0f}, u[] = {0.0f, 0.5f, 1.0f - 0x1p-24f};
    const float roughness[] = {0.0f, 0.02f, 0.03f, 0.5f, 1.0f}, iors[] = {1.0f, 1.5f, 1e6f};
    for (int kind = 0; kind < 4; kind++)
        for (int i = 0; i < 8 * 8 * 5 * 3 * 27; i++) {
            material m = rough((material_kind)kind, roughness[i % 5], iors[i / 5 % 3]);
            m.color = i & 1 ? v3(0, 0, 0) : v3(1, 1, 1);
            float a = z[i / 15 % 8], b = z[i / 120 % 8];
            surface s = make_surface(&m, v3(0, 0, 1), v3(sqrtf(1.0f - a * a), 0, a));
            s.back_side = i & 4;
            float side = i & 2 ? -1.0f : 1.0f; /* equal directions where a = b, opposite ones at grazing angles */
            check_finite(&s, v3(side * sqrtf(1.0f - b * b), 0, b), u[i % 3], u[i / 3 % 3], u[i / 9 % 3]);
        }
}

static void summaries(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; kind++) {
        material m = rough((material_kind)kind, 0.5f, 1.5f);
        m.color = v3(0.25f, 0.5f, 0.125f);
        surface s = make_surface(&m, v3(0, 0, 1), v3(0, 0, 1));
        bool diffuse = kind == MATERIAL_DIFFUSE || kind == MATERIAL_GLOSSY;
        assert_true(material_diffuse_albedo(&s).x == (diffuse ? 0.25f : 0.0f));
        float expected = kind == MATERIAL_DIELECTRIC || kind == MATERIAL_GLOSSY ? 0.04f + 0.96f * 0.5f : 0.5f;
        assert_true(fabsf(material_reflectance(&s) - expected) < 1e-6f);
        assert_int_equal(material_is_specular(&m), kind == MATERIAL_DIELECTRIC);
    }
}

/* --- Textures --- */

static void textures_are_linear_and_repeat(void **state)
{
    (void)state;
    uint8_t bytes[4 * 256 * 2];
    texture t = {.width = 256, .height = 2, .rgba = bytes};
    for (int i = 0; i < 512; i++) {
        bytes[4 * i] = (uint8_t)i;
        bytes[4 * i + 1] = i < 256 ? 255 : 0;
        bytes[4 * i + 2] = bytes[4 * i + 3] = 0;
    }
    for (int i = 0; i < 256; i++) {
        float c = (float)i / 255.0f, u = ((float)i + 0.5f) / 256.0f;
        float linear = c <= 0.04045f ? c / 12.92f : powf((c + 0.055f) / 1.055f, 2.4f);
        for (int shift = -2; shift <= 2; shift++) {
            rgb x = texture_lookup(&t, u + (float)shift, 0.25f - (float)shift);
            assert_true(fabsf(x.x - linear) < 1e-4f && fabsf(x.y - 1.0f) < 1e-6f && x.z == 0.0f);
        }
        assert_true(fabsf(texture_lookup(&t, u, 0.75f).y) < 1e-6f);
        assert_true(fabsf(texture_lookup(&t, u, 0.5f).y - 0.5f) < 1e-6f);
        assert_true(fabsf(texture_lookup(&t, u, 1.0f).y - 0.5f) < 1e-6f);
    }
    assert_true(fabsf(texture_lookup(&t, 0.0f, 0.25f).x - 0.5f) < 1e-5f); /* between the last texel and the first */
    const float odd[] = {NAN, INFINITY, -INFINITY, 1e30f, -1e30f, -1e-30f, 1.0f - 0x1p-24f};
    for (int i = 0; i < 7; i++)
        for (int k = 0; k < 7; k++)
            assert_true(finite3(texture_lookup(&t, odd[i], odd[k])));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_reflects_more_than_it_gets),
        cmocka_unit_test(samples_follow_their_density),
        cmocka_unit_test(weights_are_f_cos_over_pdf),
        cmocka_unit_test(scattering_is_reciprocal),
        cmocka_unit_test(glass_splits_light_without_loss),
        cmocka_unit_test(fresnel_at_normal_incidence),
        cmocka_unit_test(glass_sphere_in_a_furnace),
        cmocka_unit_test(mirror_reflects),
        cmocka_unit_test(branches_respect_the_geometric_normal),
        cmocka_unit_test(drawn_branches_stand_for_both),
        cmocka_unit_test(one_branch_takes_no_random_number),
        cmocka_unit_test(nothing_is_nan),
        cmocka_unit_test(summaries),
        cmocka_unit_test(textures_are_linear_and_repeat),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
