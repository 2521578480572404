/* SPDX-License-Identifier: Apache-2.0 */
/* Starts of light paths are drawn as often as the densities asked for say: a histogram over all rays. */
#include "light_sources.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

#include "lit_room.h"

/* A ray by four coordinates in [0, 1): of emitters the point along both edges, cosine and azimuth; of lights with a
 * place cosine and azimuth; on the disc squared radius and azimuth, for the sky behind the map's u and v. */
typedef struct coordinates {
    double at[4];
} coordinates;

static double azimuth(vec3 axis, vec3 d)
{
    vec3 t, b;
    v3_basis(axis, &t, &b);
    double turn = atan2((double)v3_dot(d, b), (double)v3_dot(d, t)) / (2.0 * pi);
    return turn < 0.0 ? turn + 1.0 : turn;
}

static vec3 sky_direction(double u, double v)
{
    double sine = sin(pi * v), phi = 2.0 * pi * (u - 0.5);
    return v3((float)(sine * sin(phi)), (float)cos(pi * v), (float)(-sine * cos(phi)));
}

static const vec3 z_axis = {0, 0, 1};

static void disc_coordinates(const scene *s, const light_emission *y, double at[2])
{
    vec3 off = v3_sub(y->position, center_of(s));
    off = v3_mad(off, -v3_dot(off, y->direction), y->direction);
    at[0] = (double)v3_dot(off, off) / ((double)radius_of(s) * radius_of(s));
    at[1] = azimuth(y->direction, off);
}

static coordinates coordinates_of(const scene *s, place from, const light_emission *y)
{
    coordinates c = {{0, 0, 0, 0}};
    const light *spot = &s->lights[SPOT - BULB];
    const quad *q = from == LAMP ? &lamp : &panel;
    vec3 off = v3_sub(y->position, q->a), n = v3_cross(q->ab, q->ac);
    switch (from) {
    case LAMP:
    case PANEL_FRONT:
    case PANEL_BACK:
        c.at[0] = (double)(v3_dot(v3_cross(off, q->ac), n) / v3_dot(n, n));
        c.at[1] = (double)(v3_dot(v3_cross(q->ab, off), n) / v3_dot(n, n));
        c.at[2] = v3_dot(y->normal, y->direction);
        c.at[3] = azimuth(y->normal, y->direction);
        break;
    case BULB:
        c.at[0] = 0.5 * (1.0 + (double)v3_dot(y->direction, z_axis));
        c.at[1] = azimuth(z_axis, y->direction);
        break;
    case SPOT:
        c.at[0] = (double)((v3_dot(y->direction, spot->direction) - spot->cos_outer) / (1.0f - spot->cos_outer));
        c.at[1] = azimuth(spot->direction, y->direction);
        break;
    case SUN:
        disc_coordinates(s, y, c.at);
        break;
    case SKY:
        c.at[0] = 0.5 - atan2((double)y->direction.x, (double)y->direction.z) / (2.0 * pi);
        c.at[1] = acos(fmin(1.0, fmax(-1.0, (double)-y->direction.y))) / pi;
        disc_coordinates(s, y, c.at + 2);
        break;
    case PLACES:
        break;
    }
    return c;
}

/* Of one place and direction, by what the library says: per unit of all four coordinates. `choice`: pdf_direct of
 * lights without an extent. */
static double density_at(const room *r, place from, coordinates c, double choice)
{
    const quad *q = from == LAMP ? &lamp : &panel;
    const light *l = &r->s->lights[from >= BULB && from <= SUN ? from - BULB : 0];
    double radius = radius_of(r->s), disc = pi * radius * radius, cone = 1.0 - (double)l->cos_outer;
    light_emission y0 = {.kind = from == SUN ? SOURCE_DIRECTIONAL : SOURCE_POINT, .light = (uint32_t)(from - BULB)};
    surface hit = {.back_side = from == PANEL_BACK, .material = &r->s->materials[from == LAMP ? 1 : 2]};
    float direct = 0.0f, ray = 0.0f;
    switch (from) {
    case LAMP:
    case PANEL_FRONT:
    case PANEL_BACK:
        hit.geometric_normal = from == PANEL_BACK ? v3_neg(quad_normal(q)) : quad_normal(q);
        hit.wo = around(hit.geometric_normal, c.at[2], c.at[3]);
        light_sources_emitter_pdf(r->l, &hit, &direct, &ray);
        return ray * (double)v3_length(v3_cross(q->ab, q->ac)) * 2.0 * pi;
    case BULB:
        light_sources_radiance(r->l, &y0, around(z_axis, 2.0 * c.at[0] - 1.0, c.at[1]), &ray);
        return choice * ray * 4.0 * pi;
    case SPOT:
        light_sources_radiance(r->l, &y0, around(l->direction, l->cos_outer + cone * c.at[0], c.at[1]), &ray);
        return choice * ray * 2.0 * pi * cone;
    case SUN:
        light_sources_radiance(r->l, &y0, l->direction, &ray);
        return choice * ray * disc;
    case SKY:
        light_sources_environment_pdf(r->l, sky_direction(c.at[0], c.at[1]), &direct, &ray);
        return ray * 2.0 * pi * pi * sin(pi * c.at[1]) * disc;
    case PLACES:
        break;
    }
    return 0.0;
}

/* Bins along each coordinate, and parts of a bin for the midpoint rule: the cosine's density is linear, the sky's is
 * constant over the sine in each texel. */
enum { BINS_MAX = 288 };
static const int bins[PLACES][4] = {{3, 3, 4, 4}, {3, 3, 4, 4}, {3, 3, 4, 4}, {8, 8, 1, 1},
                                    {8, 8, 1, 1}, {8, 8, 1, 1}, {8, 4, 3, 3}};
static const int parts[PLACES][4] = {{1, 1, 1, 1}, {1, 1, 1, 1}, {1, 1, 1, 1}, {1, 1, 1, 1},
                                     {1, 1, 1, 1}, {1, 1, 1, 1}, {2, 16, 1, 1}};

static int bin_count(place from)
{
    return bins[from][0] * bins[from][1] * bins[from][2] * bins[from][3];
}

static int bin_of(place from, coordinates c)
{
    int bin = 0;
    for (int k = 0; k < 4; k++) {
        int n = bins[from][k], i = (int)(c.at[k] * n);
        assert_true(c.at[k] > -1e-4 && c.at[k] < 1.0001);
        bin = bin * n + (i < 0 ? 0 : i < n ? i : n - 1);
    }
    return bin;
}

/* Mass of a bin. */
static double expected_share(const room *r, place from, int bin, double choice)
{
    const int *n = bins[from], *p = parts[from];
    int index[4], count = p[0] * p[1] * p[2] * p[3];
    for (int k = 3; k >= 0; bin /= n[k], k--)
        index[k] = bin % n[k];
    double sum = 0.0;
    for (int i = 0; i < count; i++) {
        coordinates c;
        for (int k = 3, rest = i; k >= 0; rest /= p[k], k--)
            c.at[k] = (index[k] + (rest % p[k] + 0.5) / p[k]) / n[k];
        sum += density_at(r, from, c, choice);
    }
    return sum / count / bin_count(from);
}

static void draws_follow_the_densities(void **state)
{
    (void)state;
    enum { N = 1000000 };
    room r = room_of(furnished(), true);
    rng random = rng_make(2, 1);
    static double counts[PLACES][BINS_MAX];
    double choice[PLACES] = {0}, sum = 0.0;
    for (int i = 0; i < N; i++) {
        light_emission y;
        if (!emit(&r, &random, &y))
            continue;
        place from = place_of(&y);
        counts[from][bin_of(from, coordinates_of(r.s, from, &y))] += 1.0;
        choice[from] = y.pdf_direct;
    }
    for (int k = 0; k < PLACES; k++) {
        double chi = 0.0, n = bin_count((place)k);
        assert_true(n <= BINS_MAX);
        for (int b = 0; b < (int)n; b++) {
            double share = expected_share(&r, (place)k, b, choice[k]), expected = N * share;
            sum += share;
            assert_true(expected > 20.0);
            chi += (counts[k][b] - expected) * (counts[k][b] - expected) / expected;
        }
        if (!(fabs(chi - n) < 4.0 * sqrt(2.0 * n)))
            fail_msg("place %d: chi square %.1f in %.0f bins", k, chi, n);
    }
    assert_true(close_to(sum, 1.0, 1e-3));
    room_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(draws_follow_the_densities),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
