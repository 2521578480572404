/* SPDX-License-Identifier: Apache-2.0 */
/* NaN, infinities, denormals, zeros, the largest and smallest floats in every number that a host hands over. What
 * cannot be quantized is traced each time and never stored; all else is stored, and answered as it was found. */
#include "../vcache/adaptive.h"
#include "../vcache/worker.h"
#include "support.h"

#include <float.h>

static const float odd[] = {NAN,     INFINITY, -INFINITY, 0.0f,     -0.0f,  1e-42f,
                            -1e-42f, FLT_MIN,  FLT_MAX,   -FLT_MAX, 1e-30f, 1e30f};
enum { ODD = sizeof odd / sizeof *odd };

static bool answer_with(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    (void)misses;
    for (size_t i = 0; i < count; i++)
        answers[i] = *(const vcache_answer *)context;
    return true;
}

/* Asks twice while the truth changes: a pair that is stored still says what it said first. */
static void expect_stored(vcache_worker *w, const vcache_eye *eye, const vcache_light *light, bool stored,
                          const char *what, double value)
{
    vcache_answer yes = VCACHE_VISIBLE, no = VCACHE_BLOCKED;
    vcache_clear(w->cache);
    bool first = vcache_visible(w, eye, light, answer_with, &yes);
    bool second = vcache_visible(w, eye, light, answer_with, &no);
    if (!first || second != stored)
        fail_msg("%s = %g: %s", what, value, !first ? "the ray's answer is lost" : stored ? "not stored" : "stored");
}

typedef struct ends {
    vcache *cache;
    vcache_worker *worker;
    vcache_light light; /* a good one, far away */
    vcache_eye *eye;    /* a good one */
} ends;

static ends good_ends(void)
{
    vcache_config config = vcache_default_config();
    ends e = {.cache = make_cache(&config)};
    e.worker = make_worker(e.cache, 16, false);
    vcache_prepare_direction(e.cache, (float[3]){0.3f, 0.2f, 1.0f}, 0, &e.light);
    vcache_surface s = {.position = {0.2f, 0.3f, 0.1f}, .normal = {0, 0, 1}, .density = 1e4f};
    e.eye = make_eye(e.cache, &s, 4.0f, 0);
    return e;
}

static void free_ends(ends *e)
{
    free(e->eye);
    vcache_worker_destroy(&e->worker);
    vcache_destroy(&e->cache);
}

/* Number `field` of a surface: position, normal, density. */
static float *number_of(vcache_surface *s, int field)
{
    return field < 3 ? &s->position[field] : field < 6 ? &s->normal[field - 3] : &s->density;
}

static bool good_surface(const vcache_surface *s)
{
    double length = 0.0;
    for (int i = 0; i < 3; i++) {
        if (!isfinite(s->position[i]) || fabsf(s->position[i]) > 20.0f || !isfinite(s->normal[i]))
            return false;
        length += (double)s->normal[i] * s->normal[i];
    }
    return length > 0.0 && s->density > 0.0f;
}

static void surfaces(void **state)
{
    (void)state;
    ends e = good_ends();
    for (int field = 0; field < 7; field++)
        for (int i = 0; i < ODD; i++)
            for (int zero = 0; zero < 2; zero++) { /* the rest of the normal is 0 */
                vcache_surface s = {.position = {0.2f, 0.3f, 0.1f}, .normal = {0.1f, 0.2f, 1}, .density = 1e4f};
                if (zero)
                    s.normal[0] = s.normal[1] = s.normal[2] = 0.0f;
                *number_of(&s, field) = odd[i];
                bool good = good_surface(&s);
                vcache_eye *eye = make_eye(e.cache, &s, 4.0f, 0);
                expect_stored(e.worker, eye, &e.light, good, "eye", (double)odd[i]);
                vcache_light patch;
                vcache_surface l = s;
                l.position[2] += field == 2 ? 0.0f : 0.9f;
                l.density = field == 6 ? odd[i] : 1e5f;
                vcache_prepare_patch(e.cache, &l, &patch);
                /* a cell as large as the scene holds the eye as well: that is traced */
                bool large = patch.side_squared > 0.1f;
                expect_stored(e.worker, e.eye, &patch, good_surface(&l) && !large, "patch", (double)odd[i]);
                vcache_vertex a, b;
                vcache_prepare_eye_vertex(e.cache, &s, 4.0f, 1e4f, 0, &a);
                vcache_prepare_light_vertex(e.cache, &l, &b);
                uint64_t visible = 0;
                const vcache_vertex_pair both = {&a, &b};
                vcache_answer yes = VCACHE_VISIBLE;
                assert_int_equal(vcache_add_vertices(e.worker, &both, 0, 1, &visible), 1);
                assert_true(vcache_resolve(e.worker, answer_with, &yes) && visible == 1);
                vcache_estimate p = vcache_estimate_vertices(e.worker, &a, &b, 1.0f);
                assert_true(p.mean >= 0.0f && p.mean <= 1.0f && p.probability > 0.0f && p.probability <= 1.0f);
                if (!good_surface(&s) || !good_surface(&l))
                    assert_true(p.probability == 1.0f);
                free(eye);
            }
    free_ends(&e);
}

static void lights(void **state)
{
    (void)state;
    ends e = good_ends();
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < ODD; i++) {
            float v[3] = {0.3f, -0.4f, 2.0f}, density = k == 3 ? odd[i] : 100.0f;
            if (k < 3)
                v[k] = odd[i];
            bool finite = isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
            vcache_light l;
            vcache_prepare_point(e.cache, v, 0, &l);
            expect_stored(e.worker, e.eye, &l, finite, "point", (double)odd[i]);
            vcache_prepare_direction(e.cache, v, 0, &l);
            expect_stored(e.worker, e.eye, &l, finite, "direction", (double)odd[i]);
            vcache_prepare_solid_angle(e.cache, v, density, 0, &l);
            expect_stored(e.worker, e.eye, &l, finite && density > 0.0f, "solid angle", (double)odd[i]);
        }
    free_ends(&e);
}

/* C_E, N_P, contributions, the adaptive tests' own, and the helpers. */
static void other_numbers(void **state)
{
    (void)state;
    ends e = good_ends();
    vcache_surface s = {.position = {0.2f, 0.3f, 0.1f}, .normal = {0, 0, 1}, .density = 1e4f};
    vcache_light_set *set = NULL;
    vcache_predictor *predictor = NULL;
    assert_int_equal(vcache_light_set_create(e.cache, &e.light, 1, 1 << 12, &set, NULL), VCACHE_OK);
    assert_int_equal(vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, &predictor, NULL), VCACHE_OK);
    _Alignas(64) float contribution[64] = {1.0f};
    for (int i = 0; i < ODD; i++) {
        float x = odd[i];
        vcache_eye *eye = make_eye(e.cache, &s, x, 0);
        /* a cell as large as the scene does not matter to a direction */
        expect_stored(e.worker, eye, &e.light, x > 0.0f && isfinite(x), "C_E", (double)x);
        free(eye);
        vcache_vertex a, b;
        vcache_prepare_eye_vertex(e.cache, &s, x, x, 0, &a);
        vcache_prepare_light_vertex(e.cache, &s, &b);
        vcache_estimate p = vcache_estimate_vertices(e.worker, &a, &b, x);
        assert_true(p.mean >= 0.0f && p.mean <= 1.0f && p.probability >= 0.0f && p.probability <= 1.0f);
        p = vcache_estimate_pair(e.worker, e.eye, &e.light, x);
        assert_true(p.mean >= 0.0f && p.mean <= 1.0f && p.probability >= 0.0f && p.probability <= 1.0f);
        assert_true(!isnan(x) || p.probability == 1.0f);
        assert_true(x > 0.0f || isnan(x) || p.probability == 0.0f);
        vcache_prediction known = vcache_predict(predictor, &s, x, 0, contribution);
        assert_true(known.mean[0] > 0.0f && known.mean[0] < 1.0f && known.expected > 0.0f);
        assert_true((known.cells.key[0] != 0) == (x > 0.0f && isfinite(x)));
        vcache_pick picks[8];
        assert_true(vcache_pick_lights(predictor, x, 1, 0.5, picks, 8) <= 1);
        vcache_budget budget = {.rays = 4.0f};
        for (int k = 0; k < ODD; k++) {
            float rays = vcache_budget_rays(&budget, x, odd[k], 1);
            if (!(rays >= 0.0f && rays <= 16.0f))
                fail_msg("budget of error %g, value %g: %g rays", (double)x, (double)odd[k], (double)rays);
        }
        if (!isfinite(x)) { /* it goes on as if that had not been */
            budget = (vcache_budget){.rays = 4.0f};
            (void)vcache_budget_rays(&budget, x, 1.0f, 1);
            (void)vcache_budget_rays(&budget, 1.0f, x, 1);
            float more = vcache_budget_rays(&budget, 1.0f, 1.0f, 1), less = vcache_budget_rays(&budget, 0.1f, 1.0f, 1);
            assert_true(more > 0.0f && less < more);
        }
        for (int k = 0; k < ODD; k++) {
            (void)vcache_density_cone(x, odd[k], 1.0f);
            (void)vcache_density_pdf(x, odd[k]);
        }
        vcache_adaptive_config config = vcache_adaptive_default_config();
        config.sources = 1;
        config.tolerance = x;
        vcache_adaptive *adaptive = NULL;
        vcache_status status = vcache_adaptive_create(&config, &adaptive, NULL);
        assert_true((status == VCACHE_OK) == (isfinite(x) && x >= 0.0f));
        vcache_adaptive_destroy(&adaptive);
    }
    vcache_predictor_destroy(&predictor);
    vcache_light_set_destroy(&set);
    free_ends(&e);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(surfaces), cmocka_unit_test(lights),
                                       cmocka_unit_test(other_numbers)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
