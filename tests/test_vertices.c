/* SPDX-License-Identifier: Apache-2.0 */
/* Ends of bidirectional path tracing: cells of Eq. 6, units, keys, densities of any size. */
#include "support.h"

static vcache *box_cache(float low, float high, float ratio)
{
    vcache_config config = vcache_default_config();
    for (int i = 0; i < 3; i++)
        config.bounds_min[i] = low, config.bounds_max[i] = high;
    config.resolution_step = ratio;
    return make_cache(&config);
}

static vcache_surface random_vertex(uint64_t *seed, double low, double high, double log_density)
{
    vcache_surface s = {.density = (float)exp(log_density)};
    for (int i = 0; i < 3; i++)
        s.position[i] = (float)random_between(seed, low, high);
    random_direction(seed, s.normal);
    return s;
}

/* R against 2 B_R (P_e P_l N_P / C_E^2)^(1/4). Eq. 8 rounds it by half a step at most; here each side is rounded to a
 * quarter step before, half of which comes on top from either. */
static void eq_6(void **state)
{
    (void)state;
    static const float ratios[] = {1.05f, 1.2f, 2.0f, 16.0f};
    uint64_t seed = 1;
    for (int k = 0; k < 4; k++) {
        vcache *c = box_cache(-1.0f, 1.0f, ratios[k]);
        double worst = 0.0, sum = 0.0;
        int compared = 0;
        for (int i = 0; i < 20000; i++) {
            vcache_surface e = random_vertex(&seed, -1.0, 1.0, random_between(&seed, -20.0, 30.0));
            vcache_surface l = random_vertex(&seed, -1.0, 1.0, random_between(&seed, -20.0, 30.0));
            float ce = (float)exp(random_between(&seed, 0.0, 5.0)),
                  paths = (float)exp(random_between(&seed, 0.0, 18.0));
            vcache_vertex a, b;
            vcache_prepare_eye_vertex(c, &e, ce, paths, 0, &a);
            vcache_prepare_light_vertex(c, &l, &b);
            int step = vertex_step(c, &a, &b);
            double r4 = (double)e.density * (double)l.density * (double)paths / ((double)ce * (double)ce);
            double r = c->diameter * pow(r4, 0.25), exact = log(r) / log((double)ratios[k]);
            if (exact < -1.0)
                assert_int_equal(c->resolution[step], 1);
            else if (exact > c->step_limit + 1)
                assert_int_equal(step, c->canonical[c->step_limit]);
            else if (c->resolution[step] > 1 && step < c->step_limit && c->canonical[step + 1] == step + 1) {
                double off = step - exact; /* unless two steps share an R */
                worst = fabs(off) > worst ? fabs(off) : worst;
                sum += off, compared++;
            }
        }
        print_message("C_R %g: R is off by at most %.3f steps, on average %+.3f (%d pairs)\n", (double)ratios[k], worst,
                      sum / compared, compared);
        assert_true(compared > 1000);
        assert_true(worst <= 0.5 + 2.0 * 0.125 + 1e-6);
        /* one sum in four lies half way and goes up: R is an eighth of a step too large on average; sigma is 0.32 */
        assert_true(fabs(sum / compared) < 0.125 + 4.0 * 0.32 / sqrt(compared));
        vcache_destroy(&c);
    }
}

/* --------------------------------------------------------------------------------------------------- pairs of paths */

/* One pair, answered in bit `bit`. */
static bool add_pair(vcache_worker *worker, const vcache_vertex *eye, const vcache_vertex *light, uint64_t *visible,
                     uint32_t bit)
{
    vcache_vertex_pair pairs[128];
    pairs[bit] = (vcache_vertex_pair){eye, light};
    return vcache_add_vertices(worker, pairs, bit, bit + 1, visible) == bit + 1;
}

static bool parity(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    *(size_t *)context += count;
    for (size_t i = 0; i < count; i++)
        answers[i] = (misses[i].eye_user ^ misses[i].light_user) & 1 ? VCACHE_VISIBLE : VCACHE_BLOCKED;
    return true;
}

enum { PATHS = 40, LENGTH = 20 };

/* All vertices of each eye path against those of a light path; rays. `unit`: metres times this are the scene's units.
 */
static size_t trace_paths(double unit, uint32_t capacity, vcache_statistics *s)
{
    vcache *c = box_cache(0.0f, (float)unit, 1.2f);
    vcache_worker *worker = make_worker(c, capacity, false);
    uint64_t seed = 2;
    size_t rays = 0;
    for (int path = 0; path < PATHS; path++) {
        static vcache_vertex eye[LENGTH], light[LENGTH];
        uint64_t visible[LENGTH * LENGTH / 64 + 1] = {0};
        for (int i = 0; i < LENGTH; i++) {
            vcache_surface e = random_vertex(&seed, 0.0, 1.0, random_between(&seed, 0.0, 5.0));
            vcache_surface l = random_vertex(&seed, 0.0, 1.0, random_between(&seed, 0.0, 5.0));
            for (int a = 0; a < 3; a++) /* onto two walls */
                e.normal[a] = (float)(a == 2), l.normal[a] = -(float)(a == 2);
            e.position[2] = 0.0f, l.position[2] = 1.0f;
            for (int a = 0; a < 3; a++)
                e.position[a] = (float)(e.position[a] * unit), l.position[a] = (float)(l.position[a] * unit);
            e.density = (float)(e.density / (unit * unit)), l.density = (float)(l.density / (unit * unit));
            e.user = random_bits(&seed), l.user = random_bits(&seed);
            vcache_prepare_eye_vertex(c, &e, 12.0f, 100.0f, 0, &eye[i]);
            vcache_prepare_light_vertex(c, &l, &light[i]);
        }
        vcache_vertex_pair pairs[LENGTH * LENGTH];
        for (uint32_t pair = 0; pair < LENGTH * LENGTH; pair++)
            pairs[pair] = (vcache_vertex_pair){&eye[pair / LENGTH], &light[pair % LENGTH]};
        for (uint32_t next = 0; next < LENGTH * LENGTH;) {
            uint32_t taken = vcache_add_vertices(worker, pairs, next, LENGTH * LENGTH, visible);
            assert_true(taken > next && taken <= LENGTH * LENGTH);
            next = taken;
            if (next < LENGTH * LENGTH)
                assert_true(vcache_resolve(worker, parity, &rays));
        }
        assert_true(vcache_resolve(worker, parity, &rays));
    }
    *s = statistics_of(worker);
    assert_int_equal(s->asked, PATHS * LENGTH * LENGTH);
    assert_int_equal(s->asked, s->traced + hits_of(s));
    assert_int_equal(s->traced, s->stored + s->bypassed);
    assert_int_equal(s->traced, rays);
    vcache_worker_destroy(&worker);
    vcache_destroy(&c);
    return rays;
}

static void units_do_not_matter(void **state)
{
    (void)state;
    vcache_statistics s;
    size_t metres = trace_paths(1.0, 1000, &s);
    print_message("%zu rays for %d pairs, %llu of them bypassed\n", metres, PATHS * LENGTH * LENGTH,
                  (unsigned long long)s.bypassed);
    assert_true(hits_of(&s) > 100);
    assert_int_equal(trace_paths(0x1p-10, 1000, &s), metres);
    assert_int_equal(trace_paths(0x1p20, 1000, &s), metres);
    /* not powers of two: positions are rounded elsewhere, a few points change their cell */
    for (int i = 0; i < 2; i++) {
        double rays = (double)trace_paths(i ? 1e3 : 1e-3, 1000, &s);
        assert_true(fabs(rays - (double)metres) <= 0.002 * (double)metres);
    }
    /* nor does the size of the batch: without refinement each pair of cells costs one ray */
    size_t one = trace_paths(1.0, 1, &s);
    assert_true(fabs((double)one - (double)metres) <= 0.002 * (double)metres);
}

/* An end's seed, its cell and the step count in the key, and nothing else does: not the batch, not what went before. */
static void keys(void **state)
{
    (void)state;
    vcache *c = box_cache(-1.0f, 1.0f, 1.05f);
    uint64_t seed = 3;
    for (int i = 0; i < 2000; i++) {
        vcache_surface s = random_vertex(&seed, -1.0, 1.0, 3.0), t = random_vertex(&seed, -1.0, 1.0, 3.0);
        vcache_vertex eye, salted, light, swapped[2];
        vcache_prepare_eye_vertex(c, &s, 4.0f, 100.0f, 0, &eye);
        vcache_prepare_eye_vertex(c, &s, 4.0f, 100.0f, 1, &salted);
        vcache_prepare_light_vertex(c, &t, &light);
        vcache_prepare_eye_vertex(c, &t, 4.0f, 100.0f, 0, &swapped[0]);
        vcache_prepare_light_vertex(c, &s, &swapped[1]);
        int fine = c->canonical[c->step_limit / 2], finer = c->canonical[c->step_limit / 2 + 2];
        uint64_t key = vertex_key(c, 5, &eye, &light, fine);
        assert_true(key == vertex_key(c, 5, &eye, &light, fine));
        assert_true(key != vertex_key(c, 6, &eye, &light, fine));
        assert_true(key != vertex_key(c, 5, &eye, &light, finer));
        assert_true(key != vertex_key(c, 5, &salted, &light, fine));
        assert_true(key != vertex_key(c, 5, &swapped[0], &swapped[1], fine)); /* the two sides differ */
    }
    vcache_destroy(&c);
}

/* Paths of 20 vertices, densities over 30 and more orders of magnitude, zero, infinite and no numbers: all answered;
 * what cannot be quantized is traced each time. */
static void any_density(void **state)
{
    (void)state;
    static const float odd[] = {0.0f, -1.0f, NAN, INFINITY, -INFINITY};
    static const float ces[] = {4.0f, 1e-30f, 1e30f, 0.0f, NAN, INFINITY},
                       paths[] = {1e6f, 1e-40f, 3e38f, 0.0f, NAN, INFINITY};
    vcache *c = box_cache(-1.0f, 1.0f, 1.2f);
    vcache_worker *worker = make_worker(c, 64, false);
    uint64_t seed = 4;
    size_t rays = 0;
    vcache_vertex eye[LENGTH + 5], light[LENGTH + 5];
    for (int setting = 0; setting < 36; setting++) {
        float ce = ces[setting % 6], n = paths[setting / 6];
        bool usable = setting % 6 < 3 && setting / 6 < 3;
        for (int i = 0; i < LENGTH + 5; i++) {
            vcache_surface s = random_vertex(&seed, -1.0, 1.0, (i - LENGTH / 2) * 8.5);
            if (i >= LENGTH)
                s.density = odd[i - LENGTH];
            vcache_prepare_eye_vertex(c, &s, ce, n, 0, &eye[i]);
            s.position[0] = -s.position[0];
            vcache_prepare_light_vertex(c, &s, &light[i]);
        }
        for (int i = 0; i < LENGTH + 5; i++)
            for (int k = 0; k < LENGTH + 5; k++) {
                int step = vertex_step(c, &eye[i], &light[k]);
                bool odd_end =
                    (i >= LENGTH && odd[i - LENGTH] != INFINITY) || (k >= LENGTH && odd[k - LENGTH] != INFINITY);
                if (odd_end || !usable)
                    assert_int_equal(step, -1);
                else
                    assert_true(step >= 0 && step <= c->step_limit);
                uint64_t visible = 0;
                size_t before = rays;
                for (int again = 0; again < 2; again++) {
                    assert_true(add_pair(worker, &eye[i], &light[k], &visible, 3));
                    assert_true(vcache_resolve(worker, parity, &rays));
                }
                if (step < 0)
                    assert_int_equal(rays - before, 2);
                else
                    assert_true(rays - before <= 2);
            }
    }
    /* bad places */
    vcache_surface s = random_vertex(&seed, -1.0, 1.0, 0.0);
    s.position[1] = NAN;
    vcache_prepare_light_vertex(c, &s, &light[0]);
    s.position[1] = 0.0f;
    s.normal[0] = s.normal[1] = s.normal[2] = 0.0f;
    vcache_prepare_light_vertex(c, &s, &light[1]);
    vcache_prepare_eye_vertex(c, &s, 4.0f, 1.0f, 0, &eye[1]);
    assert_int_equal(light[0].quarter_steps, INT32_MIN);
    assert_int_equal(light[1].quarter_steps, INT32_MIN);
    assert_int_equal(eye[1].quarter_steps, INT32_MIN);
    vcache_worker_destroy(&worker);
    vcache_destroy(&c);
}

/* Exact mode, salts, full batches, nearness. */
static void as_other_ends(void **state)
{
    (void)state;
    vcache *c = box_cache(-1.0f, 1.0f, 1.2f);
    vcache_worker *worker = make_worker(c, 2, false), *exact = make_worker(c, 100, true);
    vcache_surface s = {.position = {0.0f, 0.0f, -1.0f}, .normal = {0.0f, 0.0f, 1.0f}, .density = 1e4f, .user = 1};
    vcache_surface t = {.position = {0.0f, 0.0f, 1.0f}, .normal = {0.0f, 0.0f, -1.0f}, .density = 1e4f, .user = 2};
    vcache_surface near = s;
    near.position[2] = -0.999f;
    vcache_vertex a, salted, b, beside;
    vcache_prepare_eye_vertex(c, &s, 12.0f, 1.0f, 0, &a);
    vcache_prepare_eye_vertex(c, &s, 12.0f, 1.0f, 1, &salted);
    vcache_prepare_light_vertex(c, &t, &b);
    vcache_prepare_light_vertex(c, &near, &beside);
    uint64_t visible[2] = {0, ~(uint64_t)0};
    size_t rays = 0;
    assert_true(add_pair(worker, &a, &b, visible, 64));
    assert_true(add_pair(worker, &a, &b, visible, 65));
    assert_false(add_pair(worker, &a, &b, visible, 66)); /* full */
    const vcache_miss *m;
    assert_int_equal(vcache_misses(worker, &m), 1);
    assert_int_equal(m[0].eye_user, 1);
    assert_int_equal(m[0].light_user, 2);
    assert_false(m[0].infinite);
    assert_memory_equal(m[0].eye_position, s.position, 12);
    assert_memory_equal(m[0].light_position, t.position, 12);
    vcache_commit(worker, (vcache_answer[]){VCACHE_BLOCKED});
    assert_int_equal(vcache_misses(worker, NULL), 0);
    assert_true(visible[0] == 0 && visible[1] == ~(uint64_t)3);
    assert_true(add_pair(worker, &salted, &b, visible, 0)); /* another key */
    assert_int_equal(vcache_misses(worker, NULL), 1);
    assert_true(vcache_resolve(worker, parity, &rays));
    assert_true(add_pair(worker, &salted, &b, visible, 0));
    assert_int_equal(vcache_misses(worker, NULL), 0);
    assert_int_equal(visible[0], 1);
    for (int i = 0; i < 3; i++) {
        add_pair(worker, &a, &beside, visible, 0);
        assert_int_equal(vcache_misses(worker, NULL), 1);
        vcache_resolve(worker, parity, &rays);
        add_pair(exact, &a, &b, visible, 0);
        assert_int_equal(vcache_misses(exact, NULL), i + 1);
    }
    assert_int_equal(statistics_of(worker).bypassed, 3);
    vcache_worker_destroy(&exact);
    vcache_worker_destroy(&worker);
    vcache_destroy(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(eq_6),        cmocka_unit_test(units_do_not_matter), cmocka_unit_test(keys),
        cmocka_unit_test(any_density), cmocka_unit_test(as_other_ends),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
