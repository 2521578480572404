/* SPDX-License-Identifier: Apache-2.0 */
/* Where is an image wrong, and how does it look there?
 *
 *     zoom EXACT.exr OTHER.exr PREFIX [BETTER.exr]
 *
 * writes PREFIX-exact.png, -other.png, -error.png (8 x the difference), -flip.png (black: none, white: 1; by the root)
 * and of the worst blocks PREFIX-I-exact.png, -I-other.png and -I-flip.png; prints JSON: errors of the whole image and
 * the blocks, worst first: place, side in pixels, mean FLIP, share of all absolute differences, change of light. With
 * BETTER also PREFIX-strip.png: the worst third of the image's height in OTHER, BETTER and EXACT, enlarged, side by
 * side; and as `strip` where that is and what FLIP is there, in OTHER and in BETTER.
 */
#include "../renderers/common/flip.h"
#include "../renderers/common/metrics.h"
#include "../renderers/common/scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

enum { BLOCKS = 3 };

typedef struct block {
    uint32_t x, y, side;
    double flip;
} block;

static rgb heat(float t)
{
    return v3(fminf(1.0f, 2.0f * t * t), fmaxf(0.0f, (2.0f * t - 0.7f) / 1.3f) * fmaxf(0.0f, (2.0f * t - 0.7f) / 1.3f),
              fmaxf(0.0f, 4.0f * t - 3.0f));
}

static image map_picture(const float *map, uint32_t width, uint32_t height)
{
    image out = image_new(width, height);
    for (size_t i = 0; i < (size_t)width * height; i++)
        out.pixels[i] = heat(sqrtf(map[i])); /* what is seen at all lies far below 1 */
    return out;
}

static bool apart(const block *blocks, int count, uint32_t x, uint32_t y, uint32_t side)
{
    for (int i = 0; i < count; i++)
        if (x < blocks[i].x + side && blocks[i].x < x + side && y < blocks[i].y + side && blocks[i].y < y + side)
            return false;
    return true;
}

/* Squares of the largest mean error that do not overlap, tried at every fourth of their side. */
static int worst_blocks(const float *map, uint32_t width, uint32_t height, uint32_t side, int wanted, block *out)
{
    uint32_t smaller = width < height ? width : height, step = side / 4;
    int count = 0;
    for (; count < wanted && side <= smaller; count++) {
        block best = {0, 0, side, 0.0};
        for (uint32_t y = 0; y + side <= height; y += step)
            for (uint32_t x = 0; x + side <= width; x += step) {
                double sum = 0.0;
                for (uint32_t j = 0; j < side && apart(out, count, x, y, side); j++)
                    for (uint32_t i = 0; i < side; i++)
                        sum += (double)map[(size_t)(y + j) * width + x + i];
                if (sum > best.flip)
                    best = (block){x, y, side, sum};
            }
        if (best.flip == 0.0)
            break;
        best.flip /= (double)side * side;
        out[count] = best;
    }
    return count;
}

static bool save(const char *prefix, const char *name, const image *i, float exposure, message *err)
{
    char path[4096];
    snprintf(path, sizeof path, "%s-%s.png", prefix, name);
    return png_save(path, i, exposure, NULL, 0, err);
}

/* What a difference in this block brings: its share of all differences, and its own change of light. */
static bool show_block(const char *prefix, int number, block b, const image *const three[3], float exposure, double all,
                       message *err)
{
    static const char *const names[3] = {"exact", "other", "flip"};
    image cuts[3];
    bool ok = true;
    for (int k = 0; k < 3; k++) {
        char name[32];
        snprintf(name, sizeof name, "%d-%s", number, names[k]);
        cuts[k] = image_cut(three[k], b.x, b.y, b.side, b.side);
        ok = ok && save(prefix, name, &cuts[k], k < 2 ? exposure : 1.0f, err);
    }
    double l_inf = image_compare(&cuts[1], &cuts[0]).l_inf, sum = 0.0;
    for (size_t i = 0; i < (size_t)b.side * b.side; i++)
        sum += (double)(cuts[0].pixels[i].x + cuts[0].pixels[i].y + cuts[0].pixels[i].z);
    printf("%s{\"x\": %u, \"y\": %u, \"side\": %u, \"flip\": %.9g, \"share\": %.9g, \"l_inf\": %.9g}",
           number ? ", " : "", b.x, b.y, b.side, b.flip, all > 0.0 && isfinite(l_inf) ? l_inf * sum / all : 0.0,
           isfinite(l_inf) ? l_inf : 0.0);
    for (int k = 0; k < 3; k++)
        image_free(&cuts[k]);
    return ok;
}

static image enlarge(const image *from, uint32_t times)
{
    image out = image_new(from->width * times, from->height * times);
    for (uint32_t y = 0; y < out.height; y++)
        for (uint32_t x = 0; x < out.width; x++)
            out.pixels[(size_t)y * out.width + x] = from->pixels[(size_t)(y / times) * from->width + x / times];
    return out;
}

static double mean_inside(const float *map, uint32_t width, block b)
{
    double sum = 0.0;
    for (uint32_t y = 0; y < b.side; y++)
        for (uint32_t x = 0; x < b.side; x++)
            sum += (double)map[(size_t)(b.y + y) * width + b.x + x];
    return sum / ((double)b.side * b.side);
}

static bool show_strip(const image *exact, const image *other, const image *better, const float *map, float exposure,
                       const char *prefix, message *err)
{
    enum { WIDE = 240 };
    uint32_t smaller = exact->width < exact->height ? exact->width : exact->height;
    block worst = {0, 0, smaller / 3 > 4 ? smaller / 3 : smaller, 0.0};
    worst_blocks(map, exact->width, exact->height, worst.side, 1, &worst); /* none where nothing differs */
    const image *three[3] = {other, better, exact};
    image cuts[3];
    for (int k = 0; k < 3; k++) {
        image small = image_cut(three[k], worst.x, worst.y, worst.side, worst.side);
        cuts[k] = enlarge(&small, WIDE / worst.side > 1 ? WIDE / worst.side : 1);
        image_free(&small);
        three[k] = &cuts[k];
    }
    image side = image_side_by_side(three, 3);
    bool ok = save(prefix, "strip", &side, exposure, err);
    float *left = xcalloc((size_t)exact->width * exact->height, sizeof *left);
    flip_ldr(better, exact, exposure, left);
    printf(", \"strip\": {\"x\": %u, \"y\": %u, \"side\": %u, \"flip\": %.9g, \"better\": %.9g}", worst.x, worst.y,
           worst.side, mean_inside(map, exact->width, worst), mean_inside(left, exact->width, worst));
    free(left);
    image_free(&side);
    for (int k = 0; k < 3; k++)
        image_free(&cuts[k]);
    return ok;
}

static bool show(const image *exact, const image *other, const image *better, float exposure, const char *prefix,
                 message *err)
{
    float *map = xcalloc((size_t)exact->width * exact->height, sizeof *map);
    image_error e = image_compare(other, exact);
    double flip = flip_ldr(other, exact, exposure, map), flip_high = flip_hdr(other, exact, NULL), sum = 0.0;
    for (size_t i = 0; i < (size_t)exact->width * exact->height; i++)
        sum += (double)(exact->pixels[i].x + exact->pixels[i].y + exact->pixels[i].z);
    image error = image_difference(other, exact, 8.0f * exposure),
          picture = map_picture(map, exact->width, exact->height);
    bool ok = save(prefix, "exact", exact, exposure, err) && save(prefix, "other", other, exposure, err) &&
              save(prefix, "error", &error, 1.0f, err) && save(prefix, "flip", &picture, 1.0f, err);
    block blocks[BLOCKS];
    uint32_t smaller = exact->width < exact->height ? exact->width : exact->height;
    int count = worst_blocks(map, exact->width, exact->height, smaller / 6 > 12 ? smaller / 6 : 12, BLOCKS, blocks);
    const image *three[3] = {exact, other, &picture};
    printf("{\"width\": %u, \"height\": %u, \"l_inf\": %.9g, \"rel_mse\": %.9g, \"p999\": %.9g, \"flip\": %.9g, "
           "\"flip_hdr\": %.9g, "
           "\"blocks\": [",
           exact->width, exact->height, e.l_inf, e.rel_mse, e.p999, flip, flip_high);
    for (int i = 0; i < count && ok; i++)
        ok = show_block(prefix, i, blocks[i], three, exposure, e.l_inf * sum, err);
    printf("]");
    if (ok && better->pixels)
        ok = show_strip(exact, other, better, map, exposure, prefix, err);
    printf("}\n");
    image_free(&error);
    image_free(&picture);
    free(map);
    return ok;
}

static bool same_size(const image *a, const image *b)
{
    return a->width == b->width && a->height == b->height;
}

int main(int argc, char *argv[])
{
    message err = {{0}};
    image exact = {0}, other = {0}, better = {0};
    if (argc != 4 && argc != 5) {
        fprintf(stderr, "usage: zoom EXACT.exr OTHER.exr PREFIX [BETTER.exr]\n");
        return 2;
    }
    bool ok = image_load_exr(argv[1], &exact, &err) && image_load_exr(argv[2], &other, &err) &&
              (argc == 4 || image_load_exr(argv[4], &better, &err));
    if (ok && !same_size(&exact, &other))
        ok = fail(&err, "%s and %s are not of one size", argv[1], argv[2]);
    if (ok && argc == 5 && !same_size(&exact, &better))
        ok = fail(&err, "%s and %s are not of one size", argv[1], argv[4]);
    ok = ok && show(&exact, &other, &better, image_file_exposure(argv[1], &exact), argv[3], &err);
    image_free(&exact);
    image_free(&other);
    image_free(&better);
    if (!ok)
        fprintf(stderr, "zoom: %s\n", err.text);
    return !ok;
}
