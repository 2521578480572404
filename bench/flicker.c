/* SPDX-License-Identifier: Apache-2.0 */
/* Does an error pop? Of a sequence of frames, each rendered exactly and by a mode, how much their difference changes
 * from one frame to the next. A difference that stands still is a stain, one that changes is seen at once.
 *
 *     flicker EXACT0.exr MODE0.exr EXACT1.exr MODE1.exr ...
 *
 * Prints JSON: `error`, `error_max`: of the frames themselves, mean of l_inf (share of all light) and the largest
 * difference of a pixel over the mean pixel; `change`, `change_p999`, `change_max`: the same of the change of the
 * signed difference, with its 99.9th percentile, mean and largest over the frames; `light`: l_inf of the exact frames'
 * own change.
 */
#include "../renderers/common/image.h"
#include "../renderers/common/metrics.h"

#include <stdio.h>

typedef struct pair {
    image exact, mode;
} pair;

static bool load(char *const names[2], pair *out, message *err)
{
    return image_load_exr(names[0], &out->exact, err) && image_load_exr(names[1], &out->mode, err) &&
           ((out->exact.width == out->mode.width && out->exact.height == out->mode.height) ||
            fail(err, "%s and %s are not of one size", names[0], names[1]));
}

static void pair_free(pair *p)
{
    image_free(&p->exact);
    image_free(&p->mode);
}

/* last.exact + now.mode - now.exact: against last.mode its error is the change of the difference. */
static image carried(const pair *last, const pair *now)
{
    image out = image_new(now->mode.width, now->mode.height);
    for (size_t i = 0; i < (size_t)out.width * out.height; i++)
        out.pixels[i] = v3_add(last->exact.pixels[i], v3_sub(now->mode.pixels[i], now->exact.pixels[i]));
    return out;
}

static double larger(double a, double b)
{
    return a > b ? a : b;
}

int main(int argc, char *argv[])
{
    message err = {{0}};
    pair last = {{0}, {0}}, now = {{0}, {0}};
    double error = 0, error_max = 0, change = 0, change_p999 = 0, change_max = 0, light = 0;
    int frames = (argc - 1) / 2;
    if (frames < 2 || argc % 2 == 0) {
        fprintf(stderr, "usage: flicker EXACT0.exr MODE0.exr EXACT1.exr MODE1.exr ...\n");
        return 2;
    }
    bool ok = true;
    for (int i = 0; ok && i < frames; i++) {
        now = (pair){{0}, {0}};
        ok = load(argv + 1 + 2 * i, &now, &err);
        if (ok && i > 0 && (now.exact.width != last.exact.width || now.exact.height != last.exact.height))
            ok = fail(&err, "%s is not of the size of the frame before", argv[1 + 2 * i]);
        if (ok) {
            image_error e = image_compare(&now.mode, &now.exact);
            error += e.l_inf / frames;
            error_max = larger(error_max, e.max);
        }
        if (ok && i > 0) {
            image moved = carried(&last, &now);
            image_error e = image_compare(&moved, &last.mode), own = image_compare(&now.exact, &last.exact);
            change += e.l_inf / (frames - 1);
            change_p999 = larger(change_p999, e.p999);
            change_max = larger(change_max, e.max);
            light += own.l_inf / (frames - 1);
            image_free(&moved);
        }
        pair_free(&last);
        last = now;
    }
    pair_free(&last);
    if (!ok) {
        fprintf(stderr, "flicker: %s\n", err.text);
        return 1;
    }
    printf("{\"frames\": %d, \"error\": %.9g, \"error_max\": %.9g, \"change\": %.9g, \"change_p999\": %.9g, "
           "\"change_max\": %.9g, \"light\": %.9g}\n",
           frames, error, error_max, change, change_p999, change_max, light);
    return 0;
}
