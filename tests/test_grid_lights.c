/* SPDX-License-Identifier: Apache-2.0 */
/* Cells of directional lights: neighbours and the nearest light, against brute force. */
#include "support.h"

#include "../vcache/grid_internal.h"

enum { LIGHTS_MAX = 4096 };

static vcache_grid_lights *lights_of(const float *directions, uint32_t count)
{
    vcache_grid_lights *l;
    char message[VCACHE_MESSAGE_BYTES];
    if (vcache_grid_create_lights(directions, NULL, count, NULL, &l, message) != VCACHE_OK)
        fail_msg("%s", message);
    return l;
}

/* Kinds of sets: all over the sphere, the upper half, half of them in a sun, all of them in a sun. */
static const char *const kinds[] = {"sphere", "sky", "sun and sky", "sun"};
enum { KINDS = 4 };

static void make(int kind, uint32_t count, uint64_t seed, float *out)
{
    for (uint32_t i = 0; i < count; i++) {
        float *d = out + 3 * (size_t)i;
        random_direction(&seed, d);
        if (kind == 1)
            d[1] = fabsf(d[1]);
        if (kind == 3 || (kind == 2 && i % 2)) {
            d[0] = 0.48f + 0.02f * d[0];
            d[1] = 0.6f + 0.02f * d[1];
            d[2] = 0.64f + 0.02f * d[2];
        }
    }
}

static bool are_neighbours(const vcache_grid_lights *l, uint32_t a, uint32_t b)
{
    return vcache_grid_neighbours(l, a)[b / 64] >> b % 64 & 1u;
}

static double square(const vcache_grid_lights *l, uint32_t i, const float p[3])
{
    double sum = 0.0, length = sqrt((double)(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]));
    for (int k = 0; k < 3; k++) {
        double d = (double)p[k] / length - (double)l->direction[3 * (size_t)i + (size_t)k];
        sum += d * d;
    }
    return sum;
}

/* The two nearest lights to p, and how much nearer they are than the third. */
static void nearest_two(const vcache_grid_lights *l, const float p[3], uint32_t two[2], double squares[3])
{
    squares[0] = squares[1] = squares[2] = 1e9;
    two[0] = two[1] = 0;
    for (uint32_t i = 0; i < l->count; i++) {
        double d = square(l, i, p);
        if (d < squares[0])
            squares[2] = squares[1], squares[1] = squares[0], squares[0] = d, two[1] = two[0], two[0] = i;
        else if (d < squares[1])
            squares[2] = squares[1], squares[1] = d, two[1] = i;
        else if (d < squares[2])
            squares[2] = d;
    }
}

static uint32_t degree(const vcache_grid_lights *l, uint32_t i)
{
    uint32_t n = 0;
    for (uint32_t w = 0; w < vcache_grid_words(l); w++)
        n += count_ones(vcache_grid_neighbours(l, i)[w]);
    return n;
}

/* Leaves out lights that would share a cell with an earlier one; returns how many stay. */
static uint32_t thin(float *d, uint32_t count)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < count; i++) {
        const float *p = d + 3 * (size_t)i;
        double length = sqrt((double)(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]));
        float unit[3] = {(float)(p[0] / length), (float)(p[1] / length), (float)(p[2] / length)};
        uint32_t k = 0;
        for (; k < n; k++) {
            const float *q = d + 3 * (size_t)k, e[3] = {unit[0] - q[0], unit[1] - q[1], unit[2] - q[2]};
            if (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] < 4e-10f) /* 2e-5 */
                break;
        }
        if (k == n)
            memcpy(d + 3 * (size_t)n++, unit, sizeof unit);
    }
    return n;
}

/* A triangulation of the sphere has 3 n - 6 edges (Euler): 6 - 12 / n neighbours on average. */
static void euler(void **state)
{
    (void)state;
    static float d[3 * LIGHTS_MAX];
    const uint32_t counts[] = {4, 5, 50, 200, 400, 1000, 4096};
    for (int kind = 0; kind < KINDS; kind++)
        for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
            uint32_t sum = 0;
            make(kind, counts[c], 7 + c, d);
            uint32_t n = thin(d, counts[c]);
            assert_true(n + n / 200 >= counts[c]); /* it is about so many */
            vcache_grid_lights *l = lights_of(d, n);
            for (uint32_t i = 0; i < n; i++) {
                assert_false(are_neighbours(l, i, i));
                assert_true(degree(l, i) >= 3);
                sum += degree(l, i);
                for (uint32_t k = 0; k < i; k++)
                    if (are_neighbours(l, i, k) != are_neighbours(l, k, i))
                        fail_msg("%s, %u lights: %u and %u are neighbours one way", kinds[kind], n, i, k);
            }
            if (sum != 2 * (3 * n - 6))
                fail_msg("%s, %u lights: %u ends of edges, not %u", kinds[kind], n, sum, 2 * (3 * n - 6));
            vcache_grid_destroy_lights(&l);
        }
}

/* Wherever one looks, the second nearest light is a neighbour of the nearest. */
static void second_nearest_of(int kind, uint32_t count, int looks)
{
    static float d[3 * LIGHTS_MAX];
    uint64_t seed = 3;
    make(kind, count, 11, d);
    vcache_grid_lights *l = lights_of(d, count);
    for (int i = 0; i < looks; i++) {
        float p[3];
        uint32_t two[2];
        double squares[3];
        make(kind == 0 ? 0 : i % 2 ? 3 : 0, 1, random_bits(&seed), p);
        nearest_two(l, p, two, squares);
        if (squares[2] - squares[1] > 1e-6 * sqrt(squares[2]) && !are_neighbours(l, two[0], two[1]))
            fail_msg("%s: %u and %u should be neighbours", kinds[kind], two[0], two[1]);
        uint32_t found = vcache_grid_nearest(l, p);
        if (square(l, found, p) > squares[0] + 1e-7 * sqrt(squares[0]) + 1e-12)
            fail_msg("%s: nearest is %u, not %u", kinds[kind], found, two[0]);
    }
    vcache_grid_destroy_lights(&l);
}

static void second_nearest(void **state)
{
    (void)state;
    for (int kind = 0; kind < KINDS; kind++) {
        second_nearest_of(kind, 300, 20000);
        second_nearest_of(kind, LIGHTS_MAX, 1500);
    }
}

/* Between two neighbours there is a place where both are nearest: cells do touch. */
static void cells_touch(void **state)
{
    (void)state;
    static float d[3 * LIGHTS_MAX];
    make(0, 60, 5, d);
    vcache_grid_lights *l = lights_of(d, 60);
    for (uint32_t a = 0; a < 60; a++)
        for (uint32_t b = 0; b < a; b++) {
            const float *p = l->direction + 3 * (size_t)a, *q = l->direction + 3 * (size_t)b;
            double u[3], v[3], least = 1e9; /* the great circle between them */
            double n[3] = {(double)p[0] - (double)q[0], (double)p[1] - (double)q[1], (double)p[2] - (double)q[2]};
            double lu = 0.0, lv = 0.0;
            for (int k = 0; k < 3; k++)
                u[k] = (double)p[k] + (double)q[k], lu += u[k] * u[k];
            v[0] = n[1] * u[2] - n[2] * u[1], v[1] = n[2] * u[0] - n[0] * u[2], v[2] = n[0] * u[1] - n[1] * u[0];
            for (int k = 0; k < 3; k++)
                lv += v[k] * v[k];
            for (int step = 0; step < 20000; step++) {
                double angle = 6.283185307179586 * step / 20000, excess;
                float at[3];
                uint32_t two[2];
                double squares[3];
                for (int k = 0; k < 3; k++)
                    at[k] = (float)(cos(angle) * u[k] / sqrt(lu) + sin(angle) * v[k] / sqrt(lv));
                excess = square(l, a, at);
                nearest_two(l, at, two, squares);
                excess -= squares[0];
                least = excess < least ? excess : least;
                if (least < 1e-6)
                    break;
                step += (int)(excess * 500.0); /* nothing is near */
            }
            if (are_neighbours(l, a, b) != (least < 1e-6) && least > 2e-4)
                fail_msg("%u and %u: neighbours %d, but a third is nearer by %g", a, b, are_neighbours(l, a, b), least);
        }
    vcache_grid_destroy_lights(&l);
}

/* Few lights; on one circle; coinciding. */
static void degenerate(void **state)
{
    (void)state;
    const float three[] = {1, 0, 0, 0, 2, 0, 0, 0, -3};
    for (uint32_t n = 1; n <= 3; n++) {
        vcache_grid_lights *l = lights_of(three, n);
        for (uint32_t i = 0; i < n; i++) {
            assert_int_equal(degree(l, i), n - 1);
            assert_int_equal(vcache_grid_nearest(l, three + 3 * (size_t)i), i);
        }
        vcache_grid_destroy_lights(&l);
    }
    float ring[3 * 64];
    for (int i = 0; i < 64; i++) {
        ring[3 * i] = (float)cos(0.098174770424681 * i);
        ring[3 * i + 1] = 0.0f;
        ring[3 * i + 2] = (float)sin(0.098174770424681 * i);
    }
    vcache_grid_lights *l = lights_of(ring, 64);
    for (uint32_t i = 0; i < 64; i++)
        assert_true(are_neighbours(l, i, (i + 1) % 64));
    vcache_grid_destroy_lights(&l);

    float twins[3 * 40]; /* 0 ... 19 are 20 ... 39 */
    make(0, 20, 9, twins);
    memcpy(twins + 60, twins, 60 * sizeof *twins);
    l = lights_of(twins, 40);
    vcache_grid_lights *single = lights_of(twins, 20);
    for (uint32_t i = 0; i < 40; i++) {
        assert_true(are_neighbours(l, i, (i + 20) % 40));
        for (uint32_t k = 0; k < 40; k++)
            if (i % 20 != k % 20)
                assert_int_equal(are_neighbours(l, i, k), are_neighbours(single, i % 20, k % 20));
    }
    vcache_grid_destroy_lights(&l);
    vcache_grid_destroy_lights(&single);

    static float same[3 * 500]; /* all of them */
    for (size_t i = 0; i < 500; i++)
        memcpy(same + 3 * i, three, 3 * sizeof *same);
    l = lights_of(same, 500);
    for (uint32_t i = 0; i < 500; i++)
        assert_int_equal(degree(l, i), 499);
    vcache_grid_destroy_lights(&l);
}

static void bad_input(void **state)
{
    (void)state;
    vcache_grid_lights *l = (vcache_grid_lights *)&l;
    char message[VCACHE_MESSAGE_BYTES];
    float d[6] = {1, 0, 0, 0, 1, 0};
    assert_int_equal(vcache_grid_create_lights(NULL, NULL, 1, NULL, &l, message), VCACHE_ERROR_ARGUMENT);
    assert_null(l);
    assert_int_equal(vcache_grid_create_lights(d, NULL, 0, NULL, &l, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_grid_create_lights(d, NULL, VCACHE_GRID_MAX_LIGHTS + 1, NULL, &l, NULL),
                     VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_grid_create_lights(d, NULL, 1, NULL, NULL, message), VCACHE_ERROR_ARGUMENT);
    d[4] = 0.0f;
    assert_int_equal(vcache_grid_create_lights(d, NULL, 2, NULL, &l, message), VCACHE_ERROR_ARGUMENT);
    assert_non_null(strstr(message, "directions[1]"));
    d[4] = NAN;
    assert_int_equal(vcache_grid_create_lights(d, NULL, 2, NULL, &l, message), VCACHE_ERROR_ARGUMENT);
    vcache_grid_destroy_lights(&l);
    vcache_grid_destroy_lights(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(euler),      cmocka_unit_test(second_nearest), cmocka_unit_test(cells_touch),
        cmocka_unit_test(degenerate), cmocka_unit_test(bad_input),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
