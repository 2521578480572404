/* SPDX-License-Identifier: Apache-2.0 */
#include "support.h"

#include "sobol.h"

static void point(uint32_t n, uint32_t seed_x, uint32_t seed_y, uint32_t *x, uint32_t *y)
{
    *x = sobol_scramble(sobol_reverse(n), seed_x);
    *y = sobol_scramble(sobol_second(n), seed_y);
}

/* Of 2^k points in a row, from a multiple of 2^k on, each box of area 2^-k holds one. */
static void boxes_hold_one(void **state)
{
    (void)state;
    uint64_t seed = 1;
    for (uint32_t k = 1; k <= 10; k++)
        for (uint32_t block = 0; block < 5; block++) {
            uint32_t sx = (uint32_t)random_bits(&seed), sy = (uint32_t)random_bits(&seed);
            for (uint32_t across = 0; across <= k; across++) {
                static uint8_t hits[1024];
                memset(hits, 0, sizeof hits);
                for (uint32_t i = 0; i < 1u << k; i++) {
                    uint32_t x, y, along = k - across;
                    point((block << k) + i, sx, sy, &x, &y);
                    uint32_t column = across ? x >> (32 - across) : 0, row = along ? y >> (32 - along) : 0;
                    hits[column << along | row]++;
                }
                for (uint32_t i = 0; i < 1u << k; i++)
                    assert_int_equal(hits[i], 1);
            }
        }
}

/* Over seeds each point is uniform, and its coordinates do not hang together. */
static void points_are_uniform(void **state)
{
    (void)state;
    enum { SEEDS = 40000 };
    uint64_t seed = 2;
    for (uint32_t n = 0; n < 7; n += 3) {
        double sum = 0.0, squares = 0.0, product = 0.0;
        for (int i = 0; i < SEEDS; i++) {
            uint32_t x, y;
            point(n, (uint32_t)random_bits(&seed), (uint32_t)random_bits(&seed), &x, &y);
            double u = (double)sobol_float(x), v = (double)sobol_float(y);
            assert_true(u >= 0.0 && u < 1.0 && v >= 0.0 && v < 1.0);
            sum += u, squares += u * u, product += (u - 0.5) * (v - 0.5);
        }
        double error = sqrt(1.0 / 12.0 / SEEDS);
        assert_true(fabs(sum / SEEDS - 0.5) < 4.0 * error);
        assert_true(fabs(squares / SEEDS - 1.0 / 3.0) < 4.0 * sqrt(4.0 / 45.0 / SEEDS));
        assert_true(fabs(product / SEEDS) < 4.0 * error * error * sqrt((double)SEEDS));
    }
}

/* The integral of an edge across the square, which is what a pixel is: by far less error than from random points. */
static void edges_are_integrated(void **state)
{
    (void)state;
    enum { POINTS = 64, EDGES = 2000 };
    double squares = 0.0;
    uint64_t seed = 3;
    for (int e = 0; e < EDGES; e++) {
        uint32_t sx = (uint32_t)random_bits(&seed), sy = (uint32_t)random_bits(&seed);
        double slope = random_unit(&seed), offset = random_unit(&seed), inside = 0.0, exact = 0.0;
        for (uint32_t n = 0; n < POINTS; n++) {
            uint32_t x, y;
            point(n, sx, sy, &x, &y);
            inside += (double)sobol_float(y) < slope * (double)sobol_float(x) + offset ? 1.0 / POINTS : 0.0;
        }
        for (int i = 0; i < 1000; i++)
            exact += fmin(1.0, slope * (i + 0.5) / 1000.0 + offset) / 1000.0;
        squares += (inside - exact) * (inside - exact) / EDGES;
    }
    print_message("standard error of an edge %.4f\n", sqrt(squares));
    assert_true(sqrt(squares) < 0.02); /* random points: 0.05 */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boxes_hold_one),
        cmocka_unit_test(points_are_uniform),
        cmocka_unit_test(edges_are_integrated),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
