/* SPDX-License-Identifier: Apache-2.0 */
/* Directions: the octahedral map and its cells (Eq. 9), poles and seams, directional lights taken bit by bit. */
#include "support.h"

static vcache *unit_cache(float offset)
{
    vcache_config config = vcache_default_config();
    for (int i = 0; i < 3; i++)
        config.bounds_min[i] = offset, config.bounds_max[i] = offset + 1.0f;
    config.table_bytes = 4;
    return make_cache(&config);
}

static uint64_t cell_of(const vcache *c, const float d[3], float density)
{
    vcache_light light;
    vcache_prepare_solid_angle(c, d, density, 0, &light);
    assert_false(light.bad);
    return light.key.hash;
}

/* Inverse of the map, written from its geometry: the square's inner diamond is the upper half. */
static void unmap(double s, double t, double d[3])
{
    double x = 2.0 * s - 1.0, y = 2.0 * t - 1.0, z = 1.0 - fabs(x) - fabs(y);
    if (z < 0.0) {
        double fx = (1.0 - fabs(y)) * (x < 0.0 ? -1.0 : 1.0), fy = (1.0 - fabs(x)) * (y < 0.0 ? -1.0 : 1.0);
        x = fx, y = fy;
    }
    double length = sqrt(x * x + y * y + z * z);
    d[0] = x / length, d[1] = y / length, d[2] = z / length;
}

static void there_and_back(void **state)
{
    (void)state;
    uint64_t seed = 1;
    for (int i = 0; i < 100000; i++) {
        float d[3];
        double s, t, back[3];
        random_direction(&seed, d);
        quantize_octahedral(d, &s, &t);
        assert_true(s >= 0.0 && s <= 1.0 && t >= 0.0 && t <= 1.0);
        unmap(s, t, back);
        assert_true(d[0] * back[0] + d[1] * back[1] + d[2] * back[2] > 1.0 - 1e-6);
        /* length does not matter */
        double s2, t2;
        quantize_octahedral((float[3]){d[0] * 4096.0f, d[1] * 4096.0f, d[2] * 4096.0f}, &s2, &t2);
        assert_true(s == s2 && t == t2);
    }
}

static void poles_and_seams(void **state)
{
    (void)state;
    static const float values[] = {0.0f,   -0.0f,   1.0f,  -1.0f,  1e-45f,     -1e-45f,
                                   1e-20f, -1e-20f, 3e38f, -3e38f, 0.70710678f};
    enum { N = sizeof values / sizeof *values };
    vcache *c = unit_cache(0.0f);
    for (int i = 0; i < N * N * N; i++) {
        float d[3] = {values[i % N], values[i / N % N], values[i / N / N]};
        if (d[0] == 0.0f && d[1] == 0.0f && d[2] == 0.0f)
            continue;
        double s, t;
        quantize_octahedral(d, &s, &t);
        assert_true(s >= 0.0 && s <= 1.0 && t >= 0.0 && t <= 1.0);
        for (float density = 1e-30f; density < 1e38f; density *= 1e4f)
            cell_of(c, d, density);
        /* -0 and 0 are one direction */
        float plain[3] = {d[0] + 0.0f, d[1] + 0.0f, d[2] + 0.0f};
        assert_true(cell_of(c, d, 1000.0f) == cell_of(c, plain, 1000.0f));
    }
    double s, t;
    quantize_octahedral((float[3]){0.0f, 0.0f, 1.0f}, &s, &t);
    assert_true(s == 0.5 && t == 0.5);
    quantize_octahedral((float[3]){1.0f, 0.0f, 0.0f}, &s, &t);
    assert_true(s == 1.0 && t == 0.5);
    quantize_octahedral((float[3]){0.0f, -1.0f, 0.0f}, &s, &t);
    assert_true(s == 0.5 && t == 0.0);
    /* the square's far edges belong to the last cells, not to cells beyond */
    assert_true(cell_of(c, (float[3]){1.0f, 0.0f, 0.0f}, 9.0f) == cell_of(c, (float[3]){1.0f, 0.0f, 1e-4f}, 9.0f));
    assert_true(cell_of(c, (float[3]){0.0f, 1.0f, 0.0f}, 9.0f) == cell_of(c, (float[3]){0.0f, 1.0f, 1e-4f}, 9.0f));
    assert_true(cell_of(c, (float[3]){0.0f, 0.0f, -1.0f}, 9.0f) == cell_of(c, (float[3]){1e-4f, 1e-4f, -1.0f}, 9.0f));
    vcache_destroy(&c);
}

/* Every cell of a coarse map is reached, the last row and column too, and none beyond. */
static void cells_inside(void **state)
{
    (void)state;
    vcache *c = unit_cache(0.0f);
    uint64_t seed = 2;
    for (int wanted = 1; wanted <= 12; wanted++) {
        float density = (float)(wanted * wanted / 12.566370614);
        int step = quantize_step(c, 12.566370614359172 * (double)density, c->direction_limit);
        size_t cells = (size_t)c->resolution[step] * c->resolution[step];
        uint64_t hashes[4096];
        for (int i = 0; i < 4096; i++) {
            float d[3];
            random_direction(&seed, d);
            hashes[i] = cell_of(c, d, density);
        }
        assert_int_equal(count_distinct(hashes, 4096), cells);
    }
    vcache_destroy(&c);
}

/* Cells that n uniform directions are expected to fill: 1 - (1 - p)^n each, p its share of the sphere. On the
 * octahedron |x| + |y| + |z| = 1 a piece dx dy subtends dx dy / |(x, y, z)|^3. */
static double expected_filled(double r, double n)
{
    const int parts = r < 32.0 ? 16 : 2;
    double sum = 0.0;
    for (int i = 0; i < (int)r; i++)
        for (int j = 0; j < (int)r; j++) {
            double share = 0.0;
            for (int k = 0; k < parts * parts; k++) {
                double x = 2.0 * (i + (k % parts + 0.5) / parts) / r - 1.0;
                double y = 2.0 * (j + (k / parts + 0.5) / parts) / r - 1.0, z = 1.0 - fabs(x) - fabs(y);
                if (z < 0.0) { /* folded: the squares of |x| and |y| are those of the mirrored point */
                    double swap = 1.0 - fabs(y);
                    y = 1.0 - fabs(x), x = swap;
                }
                share += pow(x * x + y * y + z * z, -1.5) / (r * r * parts * parts * 3.141592653589793);
            }
            sum -= expm1(n * log1p(-share));
        }
    return sum;
}

/* n uniform directions with their density get about n cells, and fill them as balls fill bins. */
static void filled_cells(void **state)
{
    (void)state;
    vcache *c = unit_cache(0.0f);
    uint64_t seed = 3;
    enum { MOST = 1 << 16 };
    uint64_t *hashes = malloc(sizeof *hashes * MOST);
    assert_non_null(hashes);
    for (int n = 16; n <= MOST; n *= 4) {
        float density = (float)(n / 12.566370614359172);
        int step = quantize_step(c, 12.566370614359172 * (double)density, c->direction_limit);
        double cells = (double)c->resolution[step] * c->resolution[step];
        /* rounding down to a whole R takes at most one from it */
        double ratio = (double)c->config.resolution_step;
        assert_true(cells <= n * ratio * 1.0001 && c->resolution[step] + 1.0 >= sqrt(n / ratio));
        double filled = 0.0, theory = expected_filled(c->resolution[step], n);
        int repeats = MOST / n;
        for (int r = 0; r < repeats; r++) {
            for (int i = 0; i < n; i++) {
                float d[3];
                random_direction(&seed, d);
                hashes[i] = cell_of(c, d, density);
            }
            filled += (double)count_distinct(hashes, (size_t)n) / repeats;
        }
        /* variance of filled bins: at most 0.1 per ball for about as many balls as bins */
        double sigma = sqrt(0.1 * n / repeats);
        print_message("%6d directions, %6.0f cells: %8.1f filled, expected %8.1f\n", n, cells, filled, theory);
        assert_true(fabs(filled - theory) < 4.0 * sigma);
    }
    free(hashes);
    vcache_destroy(&c);
}

/* Directions have nothing to do with where the scene lies or how finely its positions are rounded. */
static void far_scene_keeps_directions(void **state)
{
    (void)state;
    vcache *near = unit_cache(0.0f), *far = unit_cache(1048576.0f);
    uint64_t seed = 4, a[4096], b[4096];
    for (int i = 0; i < 4096; i++) {
        float d[3];
        random_direction(&seed, d);
        a[i] = cell_of(near, d, 4096.0f / 12.566f);
        b[i] = cell_of(far, d, 4096.0f / 12.566f);
        assert_true(a[i] == b[i]);
    }
    vcache_destroy(&near);
    vcache_destroy(&far);
}

static void bad_directions(void **state)
{
    (void)state;
    vcache *c = unit_cache(0.0f);
    static const float bad[][3] = {
        {0.0f, 0.0f, 0.0f}, {-0.0f, 0.0f, -0.0f}, {NAN, 0.0f, 1.0f}, {0.0f, INFINITY, 0.0f}, {0.0f, 0.0f, -INFINITY}};
    static const float bad_density[] = {0.0f, -0.0f, -1.0f, NAN, -INFINITY};
    vcache_light light;
    for (int i = 0; i < 5; i++) {
        vcache_prepare_solid_angle(c, bad[i], 1.0f, 7, &light);
        assert_true(light.bad);
        assert_int_equal(light.user, 7);
        assert_true(light.side_squared < 0.0f);
        vcache_prepare_direction(c, bad[i], 7, &light);
        assert_true(light.bad);
        assert_true(light.side_squared < 0.0f);
        vcache_prepare_solid_angle(c, (float[3]){0.0f, 0.0f, 1.0f}, bad_density[i], 7, &light);
        assert_true(light.bad);
    }
    vcache_prepare_solid_angle(c, (float[3]){0.0f, 0.0f, 1.0f}, INFINITY, 7, &light);
    assert_false(light.bad);
    vcache_destroy(&c);
}

/* Point and directional lights: one bit of difference is another light, -0 is 0, and the kinds do not meet. */
static void bit_by_bit(void **state)
{
    (void)state;
    vcache *c = unit_cache(0.0f);
    vcache_light p, q;
    uint64_t seed = 5;
    for (int i = 0; i < 10000; i++) {
        float v[3];
        random_direction(&seed, v);
        vcache_prepare_point(c, v, 0, &p);
        vcache_prepare_direction(c, v, 0, &q);
        assert_true(p.key.hash != q.key.hash);
        vcache_prepare_point(c, v, 99, &q);
        assert_true(p.key.hash == q.key.hash);
        v[i % 3] = nextafterf(v[i % 3], 2.0f);
        vcache_prepare_point(c, v, 0, &q);
        assert_true(p.key.hash != q.key.hash);
        v[i % 3] = 0.0f;
        vcache_prepare_point(c, v, 0, &p);
        v[i % 3] = -0.0f;
        vcache_prepare_point(c, v, 0, &q);
        assert_true(p.key.hash == q.key.hash && !p.bad && p.side_squared == 0.0f);
        vcache_prepare_direction(c, v, 0, &p);
        v[i % 3] = 0.0f;
        vcache_prepare_direction(c, v, 0, &q);
        assert_true(p.key.hash == q.key.hash && !p.bad && p.side_squared < 0.0f);
    }
    vcache_prepare_point(c, (float[3]){0.0f, NAN, 0.0f}, 0, &p);
    assert_true(p.bad);
    vcache_prepare_point(c, (float[3]){0.0f, 0.0f, -INFINITY}, 0, &p);
    assert_true(p.bad);
    vcache_prepare_point(c, (float[3]){0.0f, 0.0f, 0.0f}, 0, &p);
    assert_false(p.bad);
    vcache_destroy(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(there_and_back),
        cmocka_unit_test(poles_and_seams),
        cmocka_unit_test(cells_inside),
        cmocka_unit_test(filled_cells),
        cmocka_unit_test(far_scene_keeps_directions),
        cmocka_unit_test(bad_directions),
        cmocka_unit_test(bit_by_bit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
