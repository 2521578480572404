/* SPDX-License-Identifier: Apache-2.0 */
/* Cells of surface points: what lies in one cell, what in the next, and that keys do not depend on rounding, units
 * or place. */
#include "support.h"

#include <float.h>

static vcache_config box_config(float low, float high)
{
    vcache_config config = vcache_default_config();
    for (int i = 0; i < 3; i++)
        config.bounds_min[i] = low, config.bounds_max[i] = high;
    config.table_bytes = 4;
    return config;
}

static vcache *box_cache(float low, float high, int normal_bins)
{
    vcache_config config = box_config(low, high);
    config.normal_bins = normal_bins;
    return make_cache(&config);
}

static uint64_t cell_hash(uint32_t orientation, cell q)
{
    return hash_words((uint64_t)(uint32_t)q.i << 32 | (uint32_t)q.j, (uint64_t)(uint32_t)q.layer << 32 | orientation,
                      1);
}

static uint64_t point_cell(const vcache *c, const float p[3], const float n[3], int step)
{
    grid_point g;
    assert_true(quantize_point(c, p, n, &g));
    return cell_hash(g.orientation, quantize_cell(c, &g, quantize_size(c, step), NULL));
}

/* Step of cells of about this side. */
static int step_of(const vcache *c, double side)
{
    return quantize_step(c, c->diameter * c->diameter / (side * side), c->step_limit);
}

/* Key of the unrefined eye cell; 0: answered exactly. */
static uint64_t eye_key(const vcache *c, const float p[3], float density)
{
    vcache_surface s = {.normal = {0.0f, 0.0f, 1.0f}, .density = density};
    memcpy(s.position, p, sizeof s.position);
    vcache_eye *eye = make_eye(c, &s, 4.0f, 0);
    uint64_t key = vcache_eye_cell(eye, 0);
    free(eye);
    return key;
}

/* ------------------------------------------------------------------------------------------ walls with noisy bits */

static float ulps(float x, uint64_t *seed)
{
    int steps = 1 + (int)(random_bits(seed) % 4);
    float towards = random_bits(seed) & 1 ? INFINITY : -INFINITY;
    while (steps--)
        x = nextafterf(x, towards);
    return x;
}

/* Distinct cells of a wall across `axis`, facing `sign`. */
static size_t wall_cells(const vcache *c, int axis, float sign, float at, double side, bool noisy, uint64_t *seed)
{
    enum { N = 14 };
    uint64_t cells[N * N];
    int step = step_of(c, side);
    for (int k = 0; k < N * N; k++) {
        float p[3], n[3] = {0.0f, 0.0f, 0.0f};
        p[axis] = at;
        p[(axis + 1) % 3] = (float)(side / 2.7) * (float)(k % N);
        p[(axis + 2) % 3] = (float)(side / 2.7) * (float)(k / N);
        n[axis] = sign;
        for (int i = 0; i < 3 && noisy; i++) {
            p[i] = ulps(p[i], seed);
            n[i] += (float)random_between(seed, -1e-7, 1e-7);
        }
        cells[k] = point_cell(c, p, n, step);
    }
    return count_distinct(cells, N * N);
}

static void noisy_walls(void **state)
{
    (void)state;
    /* on the bounds, at round places, and at some that are not */
    static const float places[] = {0.0f,  1.0f, 0.5f,  0.25f,  0.1f,   0.2f,   0.3f,
                                   0.75f, 0.9f, 0.01f, 0.125f, 0.333f, 0.6180f};
    static const double sides[] = {0.3, 0.1, 0.06, 0.02, 0.005};
    static const float scales[] = {1.0f, 10.0f, 3.0f};
    uint64_t seed = 1;
    for (int bins = 1; bins <= 64; bins++)
        for (int b = 0; b < 3; b++) {
            vcache *c = box_cache(0.0f, scales[b], bins);
            for (int w = 0; w < 13; w++)
                for (int face = 0; face < 6; face++) {
                    double side = scales[b] * sides[(w + face + bins) % 5];
                    float at = places[w] * scales[b], sign = face % 2 ? 1.0f : -1.0f;
                    size_t plain = wall_cells(c, face / 2, sign, at, side, false, &seed);
                    size_t noisy = wall_cells(c, face / 2, sign, at, side, true, &seed);
                    if (plain != noisy)
                        fail_msg("C_N %d, wall %d at %g, cells of %g: %zu cells, with noise %zu", bins, face,
                                 (double)at, side, plain, noisy);
                }
            vcache_destroy(&c);
        }
}

/* ------------------------------------------------------------------------------------------------ units and places */

static vcache_surface random_surface(uint64_t *seed)
{
    vcache_surface s = {.density = (float)exp(random_between(seed, 0.0, 14.0))};
    random_direction(seed, s.normal);
    for (int i = 0; i < 3; i++)
        s.position[i] = (float)floor(random_between(seed, 0.0, 1025.0)) / 1024.0f;
    return s;
}

static void assert_same_ends(const vcache *a, const vcache_surface *sa, const vcache *b, const vcache_surface *sb)
{
    vcache_eye *ea = make_eye(a, sa, 16.0f, 5), *eb = make_eye(b, sb, 16.0f, 5);
    assert_int_equal(ea->levels, eb->levels);
    assert_memory_equal(ea->level, eb->level, ea->levels * sizeof(eye_level));
    vcache_light la, lb;
    vcache_prepare_patch(a, sa, &la);
    vcache_prepare_patch(b, sb, &lb);
    assert_true(la.key.hash == lb.key.hash);
    vcache_vertex va, vb;
    vcache_prepare_eye_vertex(a, sa, 4.0f, 1000.0f, 5, &va);
    vcache_prepare_eye_vertex(b, sb, 4.0f, 1000.0f, 5, &vb);
    assert_int_equal(va.quarter_steps, vb.quarter_steps);
    assert_true(vertex_key(a, 7, &va, &va, 9) == vertex_key(b, 7, &vb, &vb, 9));
    free(ea);
    free(eb);
}

static void units_do_not_matter(void **state)
{
    (void)state;
    vcache *one = box_cache(0.0f, 1.0f, 8);
    uint64_t seed = 2;
    for (int k = -20; k <= 30; k++) {
        float scale = ldexpf(1.0f, k);
        vcache *scaled = box_cache(0.0f, scale, 8);
        for (int i = 0; i < 200; i++) {
            vcache_surface s = random_surface(&seed), t = s;
            for (int a = 0; a < 3; a++)
                t.position[a] *= scale;
            t.density = ldexpf(s.density, -2 * k);
            assert_same_ends(one, &s, scaled, &t);
        }
        vcache_destroy(&scaled);
    }
    vcache_destroy(&one);
}

static void place_does_not_matter(void **state)
{
    (void)state;
    static const float offsets[] = {-4096.0f, -1.0f, 7.0f, 1024.0f, 8191.0f};
    vcache *home = box_cache(0.0f, 1.0f, 8);
    uint64_t seed = 3;
    for (int o = 0; o < 5; o++) {
        vcache *away = box_cache(offsets[o], offsets[o] + 1.0f, 8);
        for (int i = 0; i < 1000; i++) {
            vcache_surface s = random_surface(&seed);
            s.density = (float)random_between(&seed, 1.0, 250.0); /* coarser than the rounding far from the origin */
            vcache_surface t = s;
            for (int a = 0; a < 3; a++)
                t.position[a] += offsets[o];
            vcache_light p, q;
            vcache_prepare_patch(home, &s, &p);
            vcache_prepare_patch(away, &t, &q);
            assert_true(p.key.hash == q.key.hash);
        }
        vcache_destroy(&away);
    }
    vcache_destroy(&home);
}

/* --------------------------------------------------------------------------------------------------------- frames */

/* Rows: the grid's axes, found from where unit steps from the centre lead. */
static void axes_of(const vcache *c, const float n[3], double m[3][3])
{
    for (int i = 0; i < 3; i++) {
        float p[3] = {0.0f, 0.0f, 0.0f};
        grid_point g;
        p[i] = 1.0f;
        assert_true(quantize_point(c, p, n, &g));
        m[0][i] = g.u * c->diameter, m[1][i] = g.v * c->diameter, m[2][i] = g.w * c->diameter;
    }
}

static void check_frame(const vcache *c, const float n[3])
{
    double m[3][3];
    axes_of(c, n, m);
    for (int a = 0; a < 3; a++)
        for (int b = 0; b <= a; b++) {
            double dot = m[a][0] * m[b][0] + m[a][1] * m[b][1] + m[a][2] * m[b][2];
            assert_true(fabs(dot - (a == b)) < 1e-12);
        }
    if (c->config.normal_bins == 1)
        return;
    float back[3] = {-n[0], -n[1], -n[2]};
    float origin[3] = {0.0f, 0.0f, 0.0f};
    grid_point front, behind;
    quantize_point(c, origin, n, &front);
    quantize_point(c, origin, back, &behind);
    assert_true(front.orientation != behind.orientation);
    /* a bin is 1 / s wide, so the axis lies within half a diagonal of the normal: sin <= sqrt(3) / (2 s) */
    double length = sqrt((double)n[0] * n[0] + (double)n[1] * n[1] + (double)n[2] * n[2]);
    double cosine = (m[2][0] * n[0] + m[2][1] * n[1] + m[2][2] * n[2]) / length;
    int whole = c->config.normal_bins / 2;
    double s = whole, sine = sqrt(3.0) / (2.0 * s);
    assert_true(cosine > 0.57);
    assert_true(1.0 - cosine * cosine <= sine * sine + 1e-9);
}

static void frames(void **state)
{
    (void)state;
    uint64_t seed = 4;
    for (int bins = 1; bins <= 64; bins++) {
        vcache *c = box_cache(-1.0f, 1.0f, bins);
        for (int i = 0; i < 27; i++)
            if (i != 13)
                check_frame(c, (float[3]){(float)(i % 3 - 1), (float)(i / 3 % 3 - 1), (float)(i / 9 - 1)});
        for (int i = 0; i < 100000 / 64; i++) {
            float n[3];
            random_direction(&seed, n);
            check_frame(c, n);
        }
        vcache_destroy(&c);
    }
}

/* At every C_N: normals have the same orientation just where they have the same axis, bins are 1 / s wide, and the
 * orientation leaves room for the step in its word. Asked around the six axes, where the bins have the largest and the
 * smallest numbers. */
static void orientations(void **state)
{
    (void)state;
    enum { N = 6 * 25 };
    for (int bins = 1; bins <= 64; bins++) {
        vcache *c = box_cache(-1.0f, 1.0f, bins);
        int s = bins / 2;
        grid_point keys[N];
        double m[N][3][3];
        for (int i = 0; i < N; i++) {
            const float side[] = {(float)(i % 5 - 2), (float)(i / 5 % 5 - 2)}, up = i / 25 % 2 ? -1.0f : 1.0f;
            float n[3], within[3], origin[3] = {0.0f, 0.0f, 0.0f};
            int axis = i / 50;
            n[axis] = within[axis] = up * (s ? (float)s : 1.0f);
            for (int k = 0; k < 2; k++)
                n[(axis + 1 + k) % 3] = side[k], within[(axis + 1 + k) % 3] = 0.2f * side[k];
            assert_true(quantize_point(c, origin, n, &keys[i]) && keys[i].orientation < 1u << 21);
            axes_of(c, n, m[i]);
            grid_point middle, near;
            n[(axis + 1) % 3] = n[(axis + 2) % 3] = 0.0f;
            quantize_point(c, origin, n, &middle);
            quantize_point(c, origin, within, &near);
            assert_true(near.orientation == middle.orientation);
        }
        for (int a = 0; a < N; a++)
            for (int b = 0; b < a; b++) {
                double apart = 0.0;
                for (int k = 0; k < 3; k++)
                    apart = fmax(apart, fabs(m[a][2][k] - m[b][2][k]));
                assert_true((keys[a].orientation == keys[b].orientation) == (apart < 1e-9));
                assert_true(s < 8 || apart > 1e-3);
            }
        vcache_destroy(&c);
    }
}

/* ---------------------------------------------------------------------------------------------------- planes, tilted
 */

static void tilted_planes(void **state)
{
    (void)state;
    static const int bins[] = {2, 4, 8, 64};
    enum { N = 80 };
    static uint64_t cells[N * N], columns[N * N];
    const double h = 0.02, spacing = h / 4.0;
    uint64_t seed = 5;
    size_t all_cells = 0, all_columns = 0;
    for (int o = 0; o < 200; o++) {
        vcache *c = box_cache(-0.5f, 0.5f, bins[o % 4]);
        int step = step_of(c, h);
        double side = c->diameter / c->resolution[step];
        float n[3];
        random_direction(&seed, n);
        double m[3][3], offset = random_between(&seed, -0.2, 0.2);
        axes_of(c, n, m);
        double cosine = m[2][0] * n[0] + m[2][1] * n[1] + m[2][2] * n[2], e1[3], e2[3], length = 0.0;
        for (int i = 0; i < 3; i++)
            e1[i] = n[(i + 1) % 3] * m[0][(i + 2) % 3] - n[(i + 2) % 3] * m[0][(i + 1) % 3];
        for (int i = 0; i < 3; i++)
            length += e1[i] * e1[i];
        for (int i = 0; i < 3; i++)
            e1[i] /= sqrt(length);
        for (int i = 0; i < 3; i++)
            e2[i] = n[(i + 1) % 3] * e1[(i + 2) % 3] - n[(i + 2) % 3] * e1[(i + 1) % 3];
        for (int k = 0; k < N * N; k++) {
            float p[3];
            for (int i = 0; i < 3; i++)
                p[i] = (float)(offset * n[i] + spacing * ((k % N - N / 2) * e1[i] + (k / N - N / 2) * e2[i]));
            grid_point g;
            quantize_point(c, p, n, &g);
            cell q = quantize_cell(c, &g, quantize_size(c, step), NULL);
            cells[k] = cell_hash(g.orientation, q);
            columns[k] = (uint64_t)(uint32_t)q.i << 32 | (uint32_t)q.j;
        }
        double edge = N * spacing, inner = edge * edge * cosine / (side * side), rim = 2.0 * edge / side + 1.0;
        size_t distinct = count_distinct(cells, N * N), under = count_distinct(columns, N * N);
        /* a column covers side^2 / cosine of the plane; cells cut by the patch's rim come on top */
        assert_true((double)under > 0.95 * inner && (double)under < inner + 2.0 * rim);
        assert_true(distinct >= under);
        all_cells += distinct, all_columns += under;
        vcache_destroy(&c);
    }
    print_message("%zu columns, %zu cells\n", all_columns, all_cells);
    /* rounding of the positions is 1e-4 of a layer here */
    assert_true((double)all_cells <= 1.001 * (double)all_columns);
}

static bool same_cell(cell a, cell b)
{
    return a.i == b.i && a.j == b.j && a.layer == b.layer;
}

/* A step of one cell along the grid's axes, staying on the plane, leads into the cell that was foretold. */
static void neighbours(void **state)
{
    (void)state;
    static const int du[] = {1, 0, -1, 0}, dv[] = {0, 1, 0, -1};
    uint64_t seed = 6;
    size_t right = 0, all = 0;
    vcache *c = box_cache(-1.0f, 1.0f, 8);
    for (int i = 0; i < 20000; i++) {
        bool aligned = i % 4 == 0;
        float p[3], n[3] = {0.0f, 0.0f, 0.0f};
        if (aligned)
            n[i / 4 % 3] = i / 12 % 2 ? 1.0f : -1.0f;
        else
            random_direction(&seed, n);
        for (int a = 0; a < 3; a++)
            p[a] = (float)random_between(&seed, -1.0, 1.0);
        double m[3][3];
        axes_of(c, n, m);
        cell_size size = quantize_size(c, step_of(c, random_between(&seed, 0.01, 0.2)));
        grid_point g;
        cell around[4];
        quantize_point(c, p, n, &g);
        cell middle = quantize_cell(c, &g, size, around);
        double step = c->diameter / size.resolution;
        for (int k = 0; k < 4; k++) {
            float moved[3];
            double fall = -(g.slope_u * du[k] + g.slope_v * dv[k]);
            for (int a = 0; a < 3; a++)
                moved[a] = (float)(p[a] + step * (du[k] * m[0][a] + dv[k] * m[1][a] + fall * m[2][a]));
            grid_point there;
            quantize_point(c, moved, n, &there);
            bool hit = same_cell(quantize_cell(c, &there, size, NULL), around[k]);
            assert_true(around[k].i == middle.i + du[k] && around[k].j == middle.j + dv[k]);
            if (aligned) {
                assert_int_equal(around[k].layer, middle.layer);
                /* only rounding at a border may differ */
                double u = g.u * size.resolution, v = g.v * size.resolution;
                double bu = fabs(u + 0.4142135623730951 - round(u + 0.4142135623730951));
                double bv = fabs(v + 0.4142135623730951 - round(v + 0.4142135623730951));
                double w = (g.w * size.resolution) * c->config.layers + 0.3819660112501051;
                if (bu > 1e-3 && bv > 1e-3 && fabs(w - round(w)) > 1e-3)
                    assert_true(hit);
            }
            right += hit, all++;
        }
    }
    print_message("%zu of %zu neighbours foretold\n", right, all);
    assert_true((double)right >= 0.999 * (double)all);
    vcache_destroy(&c);
}

/* ------------------------------------------------------------------------------------------------------ resolutions */

static void resolution_curve(void **state)
{
    (void)state;
    static const float ratios[] = {1.05f, 1.1f, 1.2f, 1.5f, 2.0f, 2.5f, 4.0f, 16.0f};
    uint64_t seed = 7;
    for (int k = 0; k < 8; k++) {
        vcache_config config = box_config(-0.5f, 0.5f);
        config.resolution_step = ratios[k];
        vcache *c = make_cache(&config);
        double ratio = ratios[k], finest = c->power[c->step_limit];
        assert_true(c->steps <= VCACHE_MAX_STEPS);
        /* layers of the finest cells are at least 4 roundings of 0.5 thick, and one step finer would not be */
        assert_true(c->diameter / finest / config.layers >= 4.0 * 0.5 * 0x1p-23);
        assert_true(c->diameter / (finest * ratio) / config.layers < 4.0 * 0.5 * 0x1p-23);
        for (int i = 0; i < 20000; i++) {
            double r = exp(random_between(&seed, -2.0, log(finest)));
            double exact = log(r) / log(ratio), whole = floor(exact + 0.5);
            if (fabs(exact - whole) > 0.4999999) /* half way: rounding decides */
                continue;
            whole = whole < 0.0 ? 0.0 : whole;
            double wanted = floor(pow(ratio, whole) * (1.0 + 1e-12));
            assert_true(c->resolution[quantize_step(c, r * r, c->step_limit)] == wanted); /* Eq. 8 */
        }
        vcache_destroy(&c);
    }
}

static void densities_at_the_limits(void **state)
{
    (void)state;
    static const float bad[] = {0.0f, -0.0f, -1.0f, NAN, -INFINITY};
    static const float offsets[] = {0.0f, 1e3f, 1e5f, 1.5e5f, 2e5f, 2.5e5f, 3e5f, 4e5f, 1e6f};
    for (int o = 0; o < 9; o++) {
        vcache *c = box_cache(offsets[o], offsets[o] + 1.0f, 8);
        float p[3] = {offsets[o] + 0.5f, offsets[o] + 0.25f, offsets[o] + 0.125f};
        for (int i = 0; i < 5; i++)
            assert_true(eye_key(c, p, bad[i]) == 0);
        assert_true(eye_key(c, p, INFINITY) != 0);
        assert_true(eye_key(c, p, INFINITY) == eye_key(c, p, FLT_MAX));
        assert_true(eye_key(c, p, INFINITY) == eye_key(c, p, 1e16f));
        assert_true(eye_key(c, p, 1e-45f) == eye_key(c, p, 1e-9f)); /* the coarsest */
        vcache_light a, b;
        vcache_surface s = {.normal = {0.0f, 0.0f, 1.0f}, .density = INFINITY};
        memcpy(s.position, p, sizeof p);
        vcache_prepare_patch(c, &s, &a);
        s.density = FLT_MAX;
        vcache_prepare_patch(c, &s, &b);
        assert_false(a.bad);
        assert_true(a.key.hash == b.key.hash);
        /* one layer of the finest cell is 4 roundings thick, or the cell is the whole scene */
        double rounding = (offsets[o] + 1.0) * 0x1p-23, side = sqrt((double)a.side_squared);
        assert_true(side / c->config.layers >= 3.999 * rounding || side >= 0.999 * c->diameter);
        s.density = 1.0f;
        s.normal[2] = 0.0f;
        vcache_prepare_patch(c, &s, &a);
        assert_true(a.bad);
        vcache_destroy(&c);
    }
}

/* Every level halves C_E, wherever the cells are so coarse, or C_R so large, that two levels meet in one resolution. */
static void last_level_is_reached(void **state)
{
    (void)state;
    static const float ratios[] = {1.05f, 1.2f, 2.0f, 3.0f, 4.0f, 16.0f};
    uint64_t seed = 8;
    for (int k = 0; k < 6; k++) {
        vcache_config config = box_config(0.0f, 1.0f);
        config.resolution_step = ratios[k];
        vcache *c = make_cache(&config);
        for (int i = 0; i < 2000; i++) {
            vcache_surface s = random_surface(&seed);
            vcache_eye *refined = make_eye(c, &s, 32.0f, 0), *plain = make_eye(c, &s, 2.0f, 0);
            assert_int_equal(plain->levels, 1);
            if (refined->level[refined->levels - 1].center != plain->level[0].center)
                fail_msg("C_R %g, density %g: C_E 32 refines to another cell than C_E 2 has", (double)ratios[k],
                         (double)s.density);
            free(refined);
            free(plain);
        }
        vcache_destroy(&c);
    }
}

/* --------------------------------------------------------------------------------------------- scenes of every size */

static void extents(void **state)
{
    (void)state;
    uint64_t seed = 9;
    for (float e = 1e-6f; e < 2e9f; e *= 10.0f)
        for (int far = 0; far < 2; far++) {
            float low = far ? e * 100.0f : -e;
            vcache *c = box_cache(low, low + e, 8);
            double asked = e * 0.02;
            vcache_surface s = {.density = (float)(1.0 / (asked * asked)), .normal = {0.0f, 1.0f, 0.0f}};
            enum { N = 1000 };
            uint64_t keys[N];
            for (int i = 0; i < N; i++) {
                for (int a = 0; a < 3; a++)
                    s.position[a] = (float)random_between(&seed, low, (double)low + e);
                s.position[1] = low;
                vcache_light light;
                vcache_prepare_patch(c, &s, &light);
                keys[i] = light.key.hash;
                double ratio = sqrt((double)light.side_squared) / asked;
                /* half a step of 1.2, and R of about 87 rounded down */
                assert_true(ratio > 1.0 / 1.1 && ratio < 1.1 * 1.02);
            }
            /* 1000 points in about 50 x 50 cells */
            double cells = 2500.0, theory = cells * -expm1(-N / cells);
            assert_true(fabs((double)count_distinct(keys, N) - theory) < 0.1 * theory);
            vcache_destroy(&c);
        }
}

static void odd_scenes(void **state)
{
    (void)state;
    static const float boxes[][2] = {{0.0f, 0.0f},     {5.0f, 5.0f},        {-1e9f, -1e9f},   {1e6f, 1000001.0f},
                                     {1e-45f, 1e-45f}, {-3.4e38f, 3.4e38f}, {3e38f, 3.4e38f}, {0.0f, 1e-38f}};
    static const float places[] = {0.0f, -0.0f, 1.0f, -1e6f, 1e-45f, 1e15f, -1e30f, 3.4e38f, -3.4e38f};
    for (int b = 0; b < 8; b++) {
        vcache *c = box_cache(boxes[b][0], boxes[b][1], 8);
        assert_true(c->diameter > 0.0 && isfinite(c->inverse_diameter));
        for (int i = 0; i < 9 * 9; i++) {
            float p[3] = {places[i % 9], places[i / 9], boxes[b][0]};
            bool near = true; /* within 32 diameters of the centre */
            for (int a = 0; a < 3; a++)
                near = near && fabs((p[a] - c->center[a]) / c->diameter) < 32.0;
            for (float density = 1e-30f; density <= 1e38f; density *= 1e17f)
                assert_true((eye_key(c, p, density) != 0) == near);
            assert_true((eye_key(c, p, INFINITY) != 0) == near);
            p[i % 3] = NAN;
            assert_true(eye_key(c, p, 1.0f) == 0);
        }
        /* -0 is 0 */
        float plus[3] = {0.0f, 0.0f, 0.0f}, minus[3] = {-0.0f, -0.0f, -0.0f};
        assert_true(eye_key(c, plus, 1.0f) == eye_key(c, minus, 1.0f));
        vcache_destroy(&c);
    }
    /* outside the bounds there are cells as inside */
    vcache *c = box_cache(0.0f, 1.0f, 8);
    for (float x = 1.0f; x < 50.0f; x += 1.0f)
        assert_true(eye_key(c, (float[3]){x, 0.0f, 0.0f}, 1e4f) != eye_key(c, (float[3]){x + 1.0f, 0.0f, 0.0f}, 1e4f));
    vcache_destroy(&c);
}

static void density_helpers(void **state)
{
    (void)state;
    vcache *c = box_cache(0.0f, 2.0f, 8);
    assert_float_equal(vcache_density_cone(0.5f, 1.0f, 4.0f), 16.0f, 1e-5f);
    assert_float_equal(vcache_density_cone(0.5f, 0.5f, 4.0f), 8.0f, 1e-5f);
    assert_float_equal(vcache_density_cone(0.5f, 0.01f, 4.0f), 4.0f, 1e-5f); /* capped at 1/4 */
    assert_float_equal(vcache_density_cone(0.5f, -1.0f, 4.0f), 4.0f, 1e-5f);
    assert_float_equal(vcache_density_cone(0.5f, NAN, 4.0f), 4.0f, 1e-5f);
    assert_true(isinf(vcache_density_cone(0.0f, 1.0f, 1.0f))); /* the finest */
    assert_float_equal(vcache_density_pdf(0.25f, 64.0f), 16.0f, 0.0f);
    /* a sphere of diameter 2 sqrt 3 has 12 pi of area */
    assert_float_equal(vcache_density_unknown(c, 120.0f), 120.0 / 37.69911184, 1e-5);
    vcache_destroy(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noisy_walls),
        cmocka_unit_test(units_do_not_matter),
        cmocka_unit_test(place_does_not_matter),
        cmocka_unit_test(frames),
        cmocka_unit_test(orientations),
        cmocka_unit_test(tilted_planes),
        cmocka_unit_test(neighbours),
        cmocka_unit_test(resolution_curve),
        cmocka_unit_test(densities_at_the_limits),
        cmocka_unit_test(last_level_is_reached),
        cmocka_unit_test(extents),
        cmocka_unit_test(odd_scenes),
        cmocka_unit_test(density_helpers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
