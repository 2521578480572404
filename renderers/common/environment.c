/* SPDX-License-Identifier: Apache-2.0 */
/* Environment light. Directions are drawn from a piecewise-constant density over the texels (Pharr, Jakob, Humphreys,
 * "Physically Based Rendering", 4th ed., Sect. 12.5.2), here constant per steradian instead of per (u, v). */
#include "environment.h"

#include "angles.h"
#include "cumulative.h"
#include "scene.h"

#include <float.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Side by side: who wants one of them mostly wants the other, and a large map is in no cache. */
typedef struct texel {
    rgb radiance;
    float density; /* 1 / sr; all 0 for a black map */
} texel;

struct environment {
    rgb uniform; /* the radiance where width == 0 */
    rgb mean;
    uint32_t width, height;
    texel *texels;
    cumulative rows;
    cumulative columns; /* of each row its own, one behind the other */
    double *cosines;    /* height + 1: cos of the polar angle at the upper edge of each row */
    bool black;         /* nothing to prefer: drawn uniformly */
    double turn;        /* of environment_rotate, 0 ... 1: the map's u is that of the direction plus this */
    float sine, cosine; /* of it */
};

static const double pi = 3.14159265358979323846;
enum { MAX_SIDE = 1 << 20 }; /* single-precision coordinates still tell texels apart */
#define UNIFORM_DENSITY (0.25f / PI_F)
enum { BATCH = 32 }; /* samples whose memory accesses overlap */

#if defined(__GNUC__)
#define PREFETCH(address) __builtin_prefetch(address)
#else
#define PREFETCH(address) ((void)(address))
#endif

environment *environment_uniform(rgb radiance)
{
    environment *e = xcalloc(1, sizeof *e);
    e->uniform = e->mean = radiance;
    e->cosine = 1.0f;
    return e;
}

void environment_free(environment *e)
{
    if (!e)
        return;
    free(e->texels);
    cumulative_free(&e->rows);
    cumulative_free(&e->columns);
    free(e->cosines);
    free(e);
}

void environment_rotate(environment *e, double degrees)
{
    double turn = degrees / 360.0;
    e->turn = turn - floor(turn);
    e->sine = (float)sin(2.0 * pi * e->turn);
    e->cosine = (float)cos(2.0 * pi * e->turn);
}

vec3 environment_rotated(const environment *e, vec3 d)
{
    return v3(e->cosine * d.x + e->sine * d.z, d.y, e->cosine * d.z - e->sine * d.x);
}

/* Continuous texel coordinates of a direction; atan2 keeps its precision at the poles, where acos(y) loses it. */
static inline void direction_to_map(const environment *e, vec3 d, float *s, float *t)
{
    float u = 0.5f + angle_atan2(d.x, -d.z) * (0.5f / PI_F) + (float)e->turn;
    u = u > 1.0f ? u - 1.0f : u;
    float v = angle_atan2(sqrtf(d.x * d.x + d.z * d.z), d.y) * (1.0f / PI_F);
    *s = u * (float)e->width;
    *t = v * (float)e->height;
}

static uint32_t clamp_index(float x, uint32_t count)
{
    if (!(x > 0.0f))
        return 0;
    return x < (float)(count - 1) ? (uint32_t)x : count - 1;
}

static const texel *texel_at(const environment *e, float s, float t)
{
    return e->texels + (size_t)clamp_index(t, e->height) * e->width + clamp_index(s, e->width);
}

static rgb mix(rgb a, rgb b, float t)
{
    return v3_mad(v3_scale(a, 1.0f - t), t, b);
}

/* The rows and columns whose texel centres are around a point, and the weights of the latter ones. */
typedef struct footprint {
    const texel *upper, *lower;
    uint32_t i0, i1;
    float fs, ft;
} footprint;

static footprint footprint_at(const environment *e, float s, float t)
{
    float s0 = floorf(s - 0.5f), t0 = floorf(t - 0.5f);
    /* The seam wraps around in u; the poles repeat their row. */
    uint32_t i0 = s0 < 0.0f ? e->width - 1 : clamp_index(s0, e->width);
    uint32_t j0 = clamp_index(t0, e->height), j1 = clamp_index(t0 + 1.0f, e->height);
    return (footprint){.upper = e->texels + (size_t)j0 * e->width,
                       .lower = e->texels + (size_t)j1 * e->width,
                       .i0 = i0,
                       .i1 = i0 + 1 < e->width ? i0 + 1 : 0,
                       .fs = s - 0.5f - s0,
                       .ft = t - 0.5f - t0};
}

static rgb bilinear(const footprint *f)
{
    return mix(mix(f->upper[f->i0].radiance, f->upper[f->i1].radiance, f->fs),
               mix(f->lower[f->i0].radiance, f->lower[f->i1].radiance, f->fs), f->ft);
}

rgb environment_radiance(const environment *e, vec3 direction)
{
    if (e->width == 0)
        return e->uniform;
    float s, t;
    direction_to_map(e, direction, &s, &t);
    footprint f = footprint_at(e, s, t);
    return bilinear(&f);
}

void environment_map_size(const environment *e, uint32_t *width, uint32_t *height)
{
    *width = e->width > 0 ? e->width : 1;
    *height = e->width > 0 ? e->height : 1;
}

rgb environment_map_radiance(const environment *e, float s, float t)
{
    if (e->width == 0)
        return e->uniform;
    footprint f = footprint_at(e, s, t);
    return bilinear(&f);
}

rgb environment_lookup(const environment *e, vec3 direction, float *pdf)
{
    float s, t;
    *pdf = UNIFORM_DENSITY;
    if (e->width == 0)
        return e->uniform;
    direction_to_map(e, direction, &s, &t);
    if (!e->black)
        *pdf = texel_at(e, s, t)->density;
    footprint f = footprint_at(e, s, t);
    return bilinear(&f);
}

/* --- preparation --- */

static size_t copy_pixels(environment *e, const image *map)
{
    size_t repaired = 0, count = (size_t)e->width * e->height;
    for (size_t i = 0; i < count; ++i) {
        float c[3] = {map->pixels[i].x, map->pixels[i].y, map->pixels[i].z};
        bool bad = false;
        for (int k = 0; k < 3; ++k)
            if (!(c[k] >= 0.0f && c[k] <= FLT_MAX)) {
                c[k] = 0.0f;
                bad = true;
            }
        repaired += bad;
        e->texels[i].radiance = v3(c[0], c[1], c[2]);
    }
    return repaired;
}

static double texel_luminance(const environment *e, uint32_t i, uint32_t j)
{
    rgb c = e->texels[(size_t)j * e->width + i].radiance;
    return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
}

/* Mean over a texel's square of the bilinear lookup: 1 6 1 over 8 along each axis. So the density follows what the
 * lookup gives, and is positive in every texel into which a bright neighbour bleeds. */
static double lookup_luminance(const environment *e, uint32_t i, uint32_t j)
{
    uint32_t is[3] = {i > 0 ? i - 1 : e->width - 1, i, i + 1 < e->width ? i + 1 : 0};
    uint32_t js[3] = {j > 0 ? j - 1 : 0, j, j + 1 < e->height ? j + 1 : j};
    static const double weight[3] = {0.125, 0.75, 0.125};
    double sum = 0.0;
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 3; ++x)
            sum += weight[y] * weight[x] * texel_luminance(e, is[x], js[y]);
    return sum;
}

static void build_density(environment *e, double *texels, double *row_sums)
{
    double total = 0.0;
    for (uint32_t j = 0; j < e->height; ++j) {
        double solid_angle = 2.0 * pi * (e->cosines[j] - e->cosines[j + 1]) / e->width, sum = 0.0;
        float *columns = cumulative_at(&e->columns, 0, j, 0);
        for (uint32_t i = 0; i < e->width; ++i) {
            double l = lookup_luminance(e, i, j);
            texels[i] = l * solid_angle;
            sum += texels[i];
            /* Not yet divided by the total; however dim, what is not black stays positive. */
            e->texels[(size_t)j * e->width + i].density = l > 0.0 ? (float)fmax(l, FLT_TRUE_MIN) : 0.0f;
        }
        double running = 0.0;
        for (uint32_t i = 0; i < e->width && sum > 0.0; ++i) {
            running += texels[i];
            columns[i] = (float)(running / sum);
        }
        cumulative_finish(&e->columns, j);
        row_sums[j] = sum;
        total += sum;
    }
    e->black = !(total > 0.0);
    double running = 0.0;
    for (uint32_t j = 0; j < e->height && !e->black; ++j) {
        running += row_sums[j];
        cumulative_at(&e->rows, 0, 0, 0)[j] = (float)(running / total);
        for (uint32_t i = 0; i < e->width; ++i) {
            float *d = &e->texels[(size_t)j * e->width + i].density;
            *d = *d > 0.0f ? (float)fmax(*d / total, FLT_MIN) : 0.0f;
        }
    }
    cumulative_finish(&e->rows, 0);
}

/* The exact mean of the bilinear lookup: a row weighs as much as its hat function times sin(theta) integrates to. */
static rgb mean_radiance(const environment *e)
{
    double step = pi / e->height, mean[3] = {0.0, 0.0, 0.0};
    for (uint32_t j = 0; j < e->height; ++j) {
        double centre = (j + 0.5) * step, above = centre - step, below = centre + step;
        double rising = (sin(centre) - sin(above)) / step - cos(centre);
        double falling = cos(centre) - (sin(below) - sin(centre)) / step;
        if (j == 0)
            rising = 1.0 - cos(centre);
        if (j + 1 == e->height)
            falling = cos(centre) + 1.0;
        double sum[3] = {0.0, 0.0, 0.0};
        const texel *row = e->texels + (size_t)j * e->width;
        for (uint32_t i = 0; i < e->width; ++i) {
            sum[0] += row[i].radiance.x;
            sum[1] += row[i].radiance.y;
            sum[2] += row[i].radiance.z;
        }
        for (int k = 0; k < 3; ++k)
            mean[k] += 0.5 * (rising + falling) * sum[k] / e->width;
    }
    return v3((float)mean[0], (float)mean[1], (float)mean[2]);
}

bool environment_from_image(const image *map, environment **out, message *err)
{
    *out = NULL;
    if (map->width == 0 || map->height == 0 || !map->pixels)
        return fail(err, "the environment map is empty");
    if (map->width > MAX_SIDE || map->height > MAX_SIDE)
        return fail(err, "the environment map has more than %d pixels along a side", MAX_SIDE);
    environment *e = xcalloc(1, sizeof *e);
    e->cosine = 1.0f;
    e->width = map->width;
    e->height = map->height;
    size_t count = (size_t)map->width * map->height;
    e->texels = table_new(count, sizeof *e->texels);
    e->cosines = calloc((size_t)map->height + 1, sizeof *e->cosines);
    double *texels = calloc(map->width, sizeof *texels), *row_sums = calloc(map->height, sizeof *row_sums);
    bool good = e->texels && e->cosines && texels && row_sums && cumulative_new(&e->rows, e->height, 1) &&
                cumulative_new(&e->columns, e->width, e->height);
    if (good) {
        size_t repaired = copy_pixels(e, map);
        if (repaired > 0)
            notice("environment map: negative or non-finite values of %zu pixels were set to 0", repaired);
        for (uint32_t j = 0; j <= e->height; ++j)
            e->cosines[j] = cos(pi * j / e->height);
        build_density(e, texels, row_sums);
        e->mean = mean_radiance(e);
        *out = e;
    } else {
        environment_free(e);
        fail(err, "no memory for an environment map of %u x %u pixels", (unsigned)map->width, (unsigned)map->height);
    }
    free(texels);
    free(row_sums);
    return good;
}

bool environment_load(const char *path, environment **out, message *err)
{
    *out = NULL;
    image map;
    if (!image_load(path, &map, err))
        return false;
    bool good = environment_from_image(&map, out, err);
    image_free(&map);
    return good;
}

/* --- sampling --- */

static const float almost_one = 0x1.fffffep-1f;

/* `u` as in the map, which without `turn` looks at +z where it is 0, at -x where it is 1/4. */
static inline vec3 spherical(double u, double turn, double cos_theta)
{
    float sine, cosine, sin_theta = (float)sqrt(fabs(1.0 - cos_theta * cos_theta));
    u = u < turn ? u - turn + 1.0 : u - turn;
    angle_turn(u - 0.5, &sine, &cosine);
    return v3(sin_theta * sine, (float)cos_theta, -sin_theta * cosine);
}

static void draw_uniformly(const environment *e, uint32_t count, const float *u1, const float *u2, const vec3 *normals,
                           vec3 *directions, rgb *radiance, float *pdf)
{
    for (uint32_t k = 0; k < count; k++) {
        directions[k] = spherical(u2[k], e->turn, 1.0 - 2.0 * u1[k]);
        bool wanted = !normals || v3_dot(normals[k], directions[k]) > 0.0f;
        pdf[k] = wanted ? UNIFORM_DENSITY : 0.0f;
        radiance[k] = wanted ? environment_radiance(e, directions[k]) : v3(0, 0, 0);
    }
}

/* Each step of all samples before the next: the tables of a large map are in no cache, and so all samples wait for them
 * together instead of one after the other. */
static void draw(const environment *e, uint32_t count, const float *u1, const float *u2, const vec3 *normals,
                 vec3 *directions, rgb *radiance, float *pdf)
{
    uint32_t row[BATCH], column[BATCH] = {0}, wanted[BATCH], wanted_count = 0;
    double u[BATCH] = {0}, cos_theta[BATCH] = {0};
    float x[BATCH], y[BATCH], z[BATCH], s[BATCH], t[BATCH];
    footprint around[BATCH];
    for (uint32_t k = 0; k < count; k++) {
        float at = float_min(u1[k], almost_one);
        uint32_t j = 0;
        for (uint32_t l = e->rows.levels; l-- > 0;)
            j = cumulative_step(&e->rows, l, 0, j, at);
        row[k] = j;
        PREFETCH(cumulative_at(&e->columns, e->columns.levels - 1, j, 0));
        double down = (double)cumulative_inside(&e->rows, 0, j, at);
        cos_theta[k] = e->cosines[j] + down * (e->cosines[j + 1] - e->cosines[j]);
    }
    for (uint32_t l = e->columns.levels; l-- > 0;)
        for (uint32_t k = 0; k < count; k++) {
            column[k] = cumulative_step(&e->columns, l, row[k], column[k], float_min(u2[k], almost_one));
            if (l > 0)
                PREFETCH(cumulative_at(&e->columns, l - 1, row[k], column[k]));
        }
    for (uint32_t k = 0; k < count; k++) {
        double along = (double)cumulative_inside(&e->columns, row[k], column[k], float_min(u2[k], almost_one));
        u[k] = ((double)column[k] + along) / e->width;
    }
    uint32_t whole = (count + 7u) & ~7u; /* whole vectors */
    for (uint32_t k = 0; k < whole; k++) {
        vec3 d = spherical(u[k], e->turn, cos_theta[k]);
        x[k] = d.x, y[k] = d.y, z[k] = d.z;
    }
    for (uint32_t k = 0; k < whole; k++)
        direction_to_map(e, v3(x[k], y[k], z[k]), &s[k], &t[k]);
    for (uint32_t k = 0; k < count; k++) {
        directions[k] = v3(x[k], y[k], z[k]);
        radiance[k] = v3(0, 0, 0);
        pdf[k] = 0.0f;
        wanted[wanted_count] = k;
        wanted_count += !normals || v3_dot(normals[k], directions[k]) > 0.0f;
    }
    for (uint32_t i = 0; i < wanted_count; i++) {
        uint32_t k = wanted[i];
        footprint f = around[k] = footprint_at(e, s[k], t[k]);
        PREFETCH(f.upper + f.i0);
        PREFETCH(f.lower + f.i0);
        PREFETCH(f.upper + f.i1);
        PREFETCH(f.lower + f.i1);
    }
    for (uint32_t i = 0; i < wanted_count; i++) {
        uint32_t k = wanted[i];
        /* Looked up by direction, as environment_pdf does: rounding may have moved it into the next texel. */
        pdf[k] = texel_at(e, s[k], t[k])->density;
        if (!(pdf[k] > 0.0f)) {
            size_t j = row[k];
            directions[k] = spherical((column[k] + 0.5) / e->width, e->turn, 0.5 * (e->cosines[j] + e->cosines[j + 1]));
            direction_to_map(e, directions[k], &s[k], &t[k]);
            around[k] = footprint_at(e, s[k], t[k]);
            pdf[k] = e->texels[j * e->width + column[k]].density;
        }
        radiance[k] = bilinear(&around[k]);
    }
}

void environment_sample_batch(const environment *e, uint32_t count, const float *u1, const float *u2,
                              const vec3 *normals, vec3 *directions, rgb *radiance, float *pdf)
{
    for (uint32_t k = 0; k < count; k += BATCH) {
        uint32_t n = count - k < BATCH ? count - k : BATCH;
        const vec3 *above = normals ? normals + k : NULL;
        if (e->width == 0 || e->black)
            draw_uniformly(e, n, u1 + k, u2 + k, above, directions + k, radiance + k, pdf + k);
        else
            draw(e, n, u1 + k, u2 + k, above, directions + k, radiance + k, pdf + k);
    }
}

vec3 environment_sample(const environment *e, float u1, float u2, rgb *radiance, float *pdf)
{
    vec3 d;
    environment_sample_batch(e, 1, &u1, &u2, NULL, &d, radiance, pdf);
    return d;
}

float environment_pdf(const environment *e, vec3 direction)
{
    float s, t;
    if (e->width == 0 || e->black)
        return UNIFORM_DENSITY;
    direction_to_map(e, direction, &s, &t);
    return texel_at(e, s, t)->density;
}

rgb environment_mean(const environment *e)
{
    return e->mean;
}
