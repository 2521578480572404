/* SPDX-License-Identifier: Apache-2.0 */
/* Error of an image against a reference, and pictures of it. */
#include "metrics.h"
#include "scene.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { GAP = 4 }; /* pixels between pictures side by side */

static bool finite_pixel(rgb c)
{
    return isfinite(c.x) && isfinite(c.y) && isfinite(c.z);
}

static double luminance_of(rgb c)
{
    return 0.2126 * c.x + 0.7152 * c.y + 0.0722 * c.z;
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The smallest of `sorted` that at least the share p of all values does not exceed. */
static double percentile(const double *sorted, size_t count, double p)
{
    size_t rank = (size_t)ceil(p * (double)count - 1e-9); /* 0.999 * 1000 may come out above 999 */
    return sorted[rank > 0 ? rank - 1 : 0];
}

/* 0 / 0 is no error; anything else over 0 is infinite. */
static double relative(double difference, double to)
{
    return difference == 0.0 ? 0.0 : to > 0.0 ? difference / to : INFINITY;
}

typedef struct totals {
    double max_channel, max_luminance; /* of the reference; infinite where it is black, see image_compare */
    double sum, mean_luminance;
} totals;

static totals survey(const image *reference, size_t count)
{
    totals t = {0.0, 0.0, 0.0, 0.0};
    for (size_t i = 0; i < count; ++i) {
        rgb b = reference->pixels[i];
        if (!finite_pixel(b))
            continue;
        t.max_channel = fmax(t.max_channel, fmax(b.x, fmax(b.y, b.z)));
        t.max_luminance = fmax(t.max_luminance, luminance_of(b));
        t.sum += (double)b.x + b.y + b.z;
        t.mean_luminance += luminance_of(b) / (double)count;
    }
    /* A NaN against black would otherwise count as no difference at all. */
    if (!(t.max_channel > 0.0))
        t.max_channel = INFINITY;
    if (!(t.max_luminance > 0.0))
        t.max_luminance = INFINITY;
    return t;
}

image_error image_compare(const image *test, const image *reference)
{
    size_t count = (size_t)reference->width * reference->height;
    if (test->width != reference->width || test->height != reference->height)
        return (image_error){INFINITY, INFINITY, INFINITY, INFINITY, INFINITY, INFINITY};
    if (count == 0)
        return (image_error){0.0, 0.0, 0.0, 0.0, 0.0, 0.0};

    totals t = survey(reference, count);
    double *squares = xmalloc(count * sizeof *squares), *differences = xmalloc(count * sizeof *differences);
    double absolute = 0.0, ratios = 0.0, largest = 0.0;
    size_t lit = 0;
    for (size_t i = 0; i < count; ++i) {
        rgb a = test->pixels[i], b = reference->pixels[i];
        double as[3] = {a.x, a.y, a.z}, bs[3] = {b.x, b.y, b.z};
        bool seen = finite_pixel(a) && finite_pixel(b);
        squares[i] = 0.0;
        for (int k = 0; k < 3; ++k) {
            double d = seen ? fabs(as[k] - bs[k]) : t.max_channel, base = finite_pixel(b) ? bs[k] : 0.0;
            absolute += d;
            squares[i] += d * d / (base * base + 0.01) / 3.0;
        }
        differences[i] = seen ? fabs(luminance_of(a) - luminance_of(b)) : t.max_luminance;
        if (finite_pixel(b) && luminance_of(b) > 0.0) {
            double ratio = differences[i] / luminance_of(b);
            ratios += ratio;
            largest = fmax(largest, ratio);
            lit++;
        }
    }
    qsort(squares, count, sizeof *squares, ascending);
    qsort(differences, count, sizeof *differences, ascending);

    image_error e = {relative(absolute, t.sum),
                     0.0,
                     relative(percentile(differences, count, 0.999), t.mean_luminance),
                     relative(differences[count - 1], t.mean_luminance),
                     lit ? ratios / (double)lit : 0.0,
                     largest};
    size_t kept = count - count / 1000;
    for (size_t i = 0; i < kept; ++i)
        e.rel_mse += squares[i] / (double)kept;
    free(squares);
    free(differences);
    return e;
}

size_t image_not_finite(const image *i)
{
    size_t count = 0;
    for (size_t p = 0; p < (size_t)i->width * i->height; p++)
        count += !finite_pixel(i->pixels[p]);
    return count;
}

image image_difference(const image *test, const image *reference, float scale)
{
    const rgb none = {0.05f, 0.05f, 0.05f}, full = {1.0f, 0.0f, 0.0f};
    uint32_t width = test->width < reference->width ? test->width : reference->width;
    uint32_t height = test->height < reference->height ? test->height : reference->height;
    image out = image_new(width, height);
    for (uint32_t y = 0; y < height; ++y)
        for (uint32_t x = 0; x < width; ++x) {
            rgb d =
                v3_sub(test->pixels[(size_t)y * test->width + x], reference->pixels[(size_t)y * reference->width + x]);
            float size = scale * fmaxf(fabsf(d.x), fmaxf(fabsf(d.y), fabsf(d.z)));
            /* Non-finite pixels show in full red. */
            float t = finite_pixel(d) && size < 1.0f ? size : 1.0f;
            out.pixels[(size_t)y * width + x] = v3_mad(v3_scale(none, 1.0f - t), t, full);
        }
    return out;
}

image image_side_by_side(const image *const *images, size_t count)
{
    uint32_t width = 0, height = 0;
    for (size_t i = 0; i < count; ++i) {
        width += images[i]->width + (i > 0 ? GAP : 0);
        height = images[i]->height > height ? images[i]->height : height;
    }
    image out = image_new(width, height);
    uint32_t left = 0;
    for (size_t i = 0; i < count; ++i) {
        const image *from = images[i];
        for (uint32_t y = 0; y < from->height; ++y)
            memcpy(out.pixels + (size_t)y * width + left, from->pixels + (size_t)y * from->width,
                   from->width * sizeof(rgb));
        left += from->width + GAP;
    }
    return out;
}

float image_exposure(const image *i)
{
    size_t count = 0, all = (size_t)i->width * i->height;
    double *values = xmalloc((all + 1) * sizeof *values);
    for (size_t p = 0; p < all; ++p)
        if (finite_pixel(i->pixels[p]))
            values[count++] = luminance_of(i->pixels[p]);
    qsort(values, count, sizeof *values, ascending);
    double bright = count > 0 ? percentile(values, count, 0.99) : 0.0;
    if (count > 0 && !(bright > 0.0))
        bright = values[count - 1]; /* a few lights in the dark: show those */
    free(values);
    return bright > FLT_MIN ? (float)(0.9 / bright) : 1.0f;
}

float image_file_exposure(const char *path, const image *i)
{
    exr_text text = {.name = "exposure"};
    image same = {0};
    bool said = image_load_exr_texts(path, &text, 1, &same, NULL);
    float value = said ? strtof(text.value, NULL) : 0.0f;
    image_free(&same);
    return value > 0.0f && isfinite(value) ? value : image_exposure(i);
}
