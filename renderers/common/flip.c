/* SPDX-License-Identifier: Apache-2.0 */
/* See flip.h. Equations of the LDR paper. */
#include "flip.h"
#include "scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define PI_D 3.14159265358979323846

typedef struct triple {
    double v[3];
} triple;

/* XYZ of linear Rec. 709 (D65); rows of white sum to the illuminant. */
static const double to_xyz[3][3] = {{10135552.0 / 24577794, 8788810.0 / 24577794, 4435075.0 / 24577794},
                                    {2613072.0 / 12288897, 8788810.0 / 12288897, 887015.0 / 12288897},
                                    {1425312.0 / 73733382, 8788810.0 / 73733382, 70074185.0 / 73733382}};
static const double from_xyz[3][3] = {{3.241003275, -1.537398934, -0.498615861},
                                      {-0.969224334, 1.875930071, 0.041554224},
                                      {0.055639423, -0.204011202, 1.057148933}};

static triple apply(const double m[3][3], triple c)
{
    triple out;
    for (int i = 0; i < 3; i++)
        out.v[i] = m[i][0] * c.v[0] + m[i][1] * c.v[1] + m[i][2] * c.v[2];
    return out;
}

static triple white(void)
{
    return apply(to_xyz, (triple){{1.0, 1.0, 1.0}});
}

static double clamped(double x)
{
    return x > 0.0 ? x < 1.0 ? x : 1.0 : 0.0; /* NaN: 0 */
}

/* XYZ over white's. */
static triple relative_xyz(triple linear)
{
    triple xyz = apply(to_xyz, linear), w = white();
    for (int i = 0; i < 3; i++)
        xyz.v[i] /= w.v[i];
    return xyz;
}

/* A linear opponent space: achromatic, red against green, blue against yellow (Sect. 4.1). */
static triple opponent(triple linear)
{
    triple c = relative_xyz(linear);
    return (triple){{116.0 * c.v[1] - 16.0, 500.0 * (c.v[0] - c.v[1]), 200.0 * (c.v[1] - c.v[2])}};
}

static triple from_opponent(triple o)
{
    double y = (o.v[0] + 16.0) / 116.0;
    triple w = white(), xyz = {{(y + o.v[1] / 500.0) * w.v[0], y * w.v[1], (y - o.v[2] / 200.0) * w.v[2]}};
    return apply(from_xyz, xyz);
}

/* CIELAB; colours count the less the darker they are (Hunt 1952). */
static triple lab(triple linear)
{
    const double delta = 6.0 / 29.0;
    triple c = relative_xyz(linear), f;
    for (int i = 0; i < 3; i++)
        f.v[i] = c.v[i] > delta * delta * delta ? cbrt(c.v[i]) : c.v[i] / (3.0 * delta * delta) + 4.0 / 29.0;
    double l = 116.0 * f.v[1] - 16.0;
    return (triple){{l, 0.01 * l * 500.0 * (f.v[0] - f.v[1]), 0.01 * l * 200.0 * (f.v[1] - f.v[2])}};
}

static double hyab(triple a, triple b)
{
    return fabs(a.v[0] - b.v[0]) + hypot(a.v[1] - b.v[1], a.v[2] - b.v[2]);
}

/* Compresses large differences, of which green to blue is the largest, into [0, 1] (Sect. 4.1.4). */
static double compressed(double distance)
{
    const double power = 0.7, knee = 0.4, at_knee = 0.95;
    double most = pow(hyab(lab((triple){{0, 1, 0}}), lab((triple){{0, 0, 1}})), power), d = pow(distance, power);
    if (d < knee * most)
        return at_knee / (knee * most) * d;
    return at_knee + (d - knee * most) / (most - knee * most) * (1.0 - at_knee);
}

/* ---------------------------------------------------------------------------------------------------- filters */

/* One-dimensional, from -radius to radius. */
typedef struct kernel {
    int radius;
    double *weights;
} kernel;

static kernel kernel_new(int radius)
{
    return (kernel){radius, xmalloc((size_t)(2 * radius + 1) * sizeof(double))};
}

static kernel gaussian(int radius, double falloff)
{
    kernel k = kernel_new(radius);
    for (int i = -radius; i <= radius; i++)
        k.weights[i + radius] = exp(-falloff * i * i);
    return k;
}

static double total(const kernel *k)
{
    double sum = 0.0;
    for (int i = 0; i <= 2 * k->radius; i++)
        sum += k->weights[i];
    return sum;
}

/* Pixels beyond the border are those at it. One row or column of values that lie `stride` apart. */
static void convolve_line(const double *in, double *out, int length, size_t stride, const kernel *k)
{
    for (int x = 0; x < length; x++) {
        double sum = 0.0;
        for (int i = -k->radius; i <= k->radius; i++) {
            int at = x + i < 0 ? 0 : x + i >= length ? length - 1 : x + i;
            sum += k->weights[i + k->radius] * in[(size_t)at * stride];
        }
        out[(size_t)x * stride] = sum;
    }
}

/* `across` along rows, then `down` along columns. */
static void convolve(const double *in, double *between, double *out, int width, int height, const kernel *across,
                     const kernel *down)
{
    for (int y = 0; y < height; y++)
        convolve_line(in + (size_t)y * (size_t)width, between + (size_t)y * (size_t)width, width, 1, across);
    for (int x = 0; x < width; x++)
        convolve_line(between + x, out + x, height, (size_t)width, down);
}

typedef struct planes {
    int width, height;
    size_t count;
    double *v[3];
} planes;

static planes planes_new(int width, int height)
{
    planes p = {width, height, (size_t)width * (size_t)height, {NULL}};
    for (int k = 0; k < 3; k++)
        p.v[k] = xmalloc(p.count * sizeof(double));
    return p;
}

static void planes_free(planes *p)
{
    for (int k = 0; k < 3; k++)
        free(p->v[k]);
}

/* What the eye resolves: the contrast sensitivity of each opponent channel as a sum of two Gaussians
 * a sqrt(pi / b) exp(-pi^2 x^2 / b), x in degrees (Table 1). */
static void filter_contrast(const planes *in, planes *out)
{
    static const double a[3][2] = {{1.0, 0.0}, {1.0, 0.0}, {34.1, 13.5}};
    static const double b[3][2] = {{0.0047, 1e-5}, {0.0053, 1e-5}, {0.04, 0.025}};
    const double ppd = FLIP_PIXELS_PER_DEGREE;
    int radius = (int)ceil(3.0 * sqrt(0.04 / (2.0 * PI_D * PI_D)) * ppd);
    double *between = xmalloc(in->count * sizeof(double)), *sum = xmalloc(in->count * sizeof(double));
    for (int c = 0; c < 3; c++) {
        double weight = 0.0;
        memset(out->v[c], 0, in->count * sizeof(double));
        for (int g = 0; g < 2; g++) {
            double scale = a[c][g] * sqrt(PI_D / b[c][g]);
            if (scale == 0.0)
                continue;
            kernel k = gaussian(radius, PI_D * PI_D / (b[c][g] * ppd * ppd));
            convolve(in->v[c], between, sum, in->width, in->height, &k, &k);
            for (size_t i = 0; i < in->count; i++)
                out->v[c][i] += scale * sum[i];
            weight += scale * total(&k) * total(&k);
            free(k.weights);
        }
        for (size_t i = 0; i < in->count; i++)
            out->v[c][i] /= weight;
    }
    free(between);
    free(sum);
}

/* Edges and points: first and second derivatives of a Gaussian, their positive and negative weights summing to 1 and -1
 * (Sect. 4.2); across and down. */
static void derivative(int radius, double deviation, bool second, kernel *slope, kernel *smooth)
{
    *smooth = gaussian(radius, 1.0 / (2.0 * deviation * deviation));
    *slope = kernel_new(radius);
    double positive = 0.0, negative = 0.0, across = total(smooth);
    for (int i = -radius; i <= radius; i++) {
        double g = smooth->weights[i + radius];
        double w = second ? (i * i / (deviation * deviation) - 1.0) * g : -i * g;
        slope->weights[i + radius] = w;
        *(w > 0.0 ? &positive : &negative) += fabs(w) * across;
    }
    for (int i = 0; i <= 2 * radius; i++)
        slope->weights[i] /= slope->weights[i] > 0.0 ? positive : negative;
}

static void magnitude(const double *luminance, int width, int height, bool second, double *out)
{
    size_t count = (size_t)width * (size_t)height;
    const double deviation = 0.5 * 0.082 * FLIP_PIXELS_PER_DEGREE; /* 0.082 degrees: width of what is looked for */
    kernel slope, smooth;
    derivative((int)ceil(3.0 * deviation), deviation, second, &slope, &smooth);
    double *between = xmalloc(count * sizeof(double)), *down = xmalloc(count * sizeof(double));
    convolve(luminance, between, out, width, height, &slope, &smooth);
    convolve(luminance, between, down, width, height, &smooth, &slope);
    for (size_t i = 0; i < count; i++)
        out[i] = hypot(out[i], down[i]);
    free(between);
    free(down);
    free(slope.weights);
    free(smooth.weights);
}

/* ------------------------------------------------------------------------------------------------------- pictures */

typedef struct prepared {
    planes seen;            /* CIELAB of what the eye resolves */
    double *edges, *points; /* of what is there */
} prepared;

/* What becomes of a channel before it is clamped. */
typedef double (*tone)(double value, double exposure);

static prepared prepare(const image *picture, tone curve, double exposure)
{
    int width = (int)picture->width, height = (int)picture->height;
    planes all = planes_new(width, height);
    prepared p = {planes_new(width, height), xmalloc(all.count * sizeof(double)), xmalloc(all.count * sizeof(double))};
    for (size_t i = 0; i < all.count; i++) {
        rgb c = picture->pixels[i];
        triple linear = {{c.x, c.y, c.z}};
        for (int k = 0; k < 3; k++)
            linear.v[k] = clamped(curve(linear.v[k], exposure));
        triple o = opponent(linear);
        for (int k = 0; k < 3; k++)
            all.v[k][i] = o.v[k];
    }
    filter_contrast(&all, &p.seen);
    for (size_t i = 0; i < all.count; i++) {
        triple linear = from_opponent((triple){{p.seen.v[0][i], p.seen.v[1][i], p.seen.v[2][i]}});
        for (int k = 0; k < 3; k++)
            linear.v[k] = clamped(linear.v[k]);
        triple l = lab(linear);
        for (int k = 0; k < 3; k++)
            p.seen.v[k][i] = l.v[k];
        all.v[0][i] = (all.v[0][i] + 16.0) / 116.0;
    }
    magnitude(all.v[0], width, height, false, p.edges);
    magnitude(all.v[0], width, height, true, p.points);
    planes_free(&all);
    return p;
}

static void prepared_free(prepared *p)
{
    planes_free(&p->seen);
    free(p->edges);
    free(p->points);
}

/* Where edges or points differ, a difference of colours counts more (Eq. 8). */
static double pixel_error(const prepared *a, const prepared *b, size_t i)
{
    triple ca = {{a->seen.v[0][i], a->seen.v[1][i], a->seen.v[2][i]}};
    triple cb = {{b->seen.v[0][i], b->seen.v[1][i], b->seen.v[2][i]}};
    double feature = fmax(fabs(a->edges[i] - b->edges[i]), fabs(a->points[i] - b->points[i]));
    return pow(compressed(hyab(ca, cb)), 1.0 - sqrt(feature / sqrt(2.0)));
}

/* Keeps the larger of each pixel's error and what stands in `worst`. */
static void raise(const image *test, const image *reference, tone curve, double exposure, float *worst)
{
    prepared a = prepare(test, curve, exposure), b = prepare(reference, curve, exposure);
    for (size_t i = 0; i < a.seen.count; i++)
        worst[i] = fmaxf(worst[i], (float)pixel_error(&a, &b, i));
    prepared_free(&a);
    prepared_free(&b);
}

static double mean_of(const float *map, size_t count)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++)
        sum += (double)map[i];
    return count ? sum / (double)count : 0.0;
}

static double finish(float *worst, float *map, size_t count)
{
    double mean = mean_of(worst, count);
    if (map)
        memcpy(map, worst, count * sizeof *map);
    free(worst);
    return mean;
}

static double straight(double value, double exposure)
{
    return value * exposure;
}

double flip_ldr(const image *test, const image *reference, float exposure, float *map)
{
    size_t count = (size_t)reference->width * reference->height;
    float *worst = xcalloc(count + 1, sizeof *worst);
    if (count)
        raise(test, reference, straight, (double)exposure, worst);
    return finish(worst, map, count);
}

/* ------------------------------------------------------------------------------------------------ high dynamic range
 */

/* A fit of the ACES curve (Narkowicz 2015), input scaled by 0.6. */
static const double aces[6] = {0.6 * 0.6 * 2.51, 0.6 * 0.03, 0.0, 0.6 * 0.6 * 2.43, 0.6 * 0.59, 0.14};

static double aces_curve(double value, double exposure)
{
    double x = value > 0.0 && isfinite(value) ? value * exp2(exposure) : 0.0;
    return (aces[0] * x * x + aces[1] * x + aces[2]) / (aces[3] * x * x + aces[4] * x + aces[5]);
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Exposures at which the brightest pixel and the median come out as 0.85 (Sect. 2 of the second paper). */
static void exposures(const image *reference, size_t count, double *start, double *stop)
{
    const double shown = 0.85;
    double a = aces[0] - shown * aces[3], b = aces[1] - shown * aces[4], c = aces[2] - shown * aces[5];
    double brightest = (-b - sqrt(b * b - 4.0 * a * c)) / (2.0 * a);
    if (brightest < 0.0)
        brightest = (-b + sqrt(b * b - 4.0 * a * c)) / (2.0 * a);
    double *luminance = xmalloc(count * sizeof *luminance);
    for (size_t i = 0; i < count; i++) {
        rgb p = reference->pixels[i];
        double y = to_xyz[1][0] * p.x + to_xyz[1][1] * p.y + to_xyz[1][2] * p.z;
        luminance[i] = y > 0.0 && isfinite(y) ? y : 0.0;
    }
    qsort(luminance, count, sizeof *luminance, ascending);
    double most = fmax(luminance[count - 1], 1e-30), middle = fmax(luminance[count / 2], 1e-30);
    *start = log2(brightest / most);
    *stop = log2(brightest / middle);
    free(luminance);
}

double flip_hdr(const image *test, const image *reference, float *map)
{
    size_t count = (size_t)reference->width * reference->height;
    float *worst = xcalloc(count + 1, sizeof *worst);
    if (count) {
        double start, stop;
        exposures(reference, count, &start, &stop);
        int steps = (int)fmax(2.0, ceil(stop - start));
        for (int i = 0; i < steps; i++)
            raise(test, reference, aces_curve, start + (stop - start) * i / (steps - 1), worst);
    }
    return finish(worst, map, count);
}
