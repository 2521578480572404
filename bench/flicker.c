/* SPDX-License-Identifier: Apache-2.0 */
/* How much the difference of frames to exact ones changes from one frame to the next, as JSON (temporal.h).
 *
 *     flicker EXACT0.exr MODE0.exr EXACT1.exr MODE1.exr ...
 */
#include "temporal.h"

#include <stdio.h>

static bool of_size(const image *i, const image *wanted)
{
    return i->width == wanted->width && i->height == wanted->height;
}

static bool add(temporal *t, char *const names[2], message *err)
{
    image exact = {0}, mode = {0};
    bool ok = image_load_exr(names[0], &exact, err) && image_load_exr(names[1], &mode, err);
    if (ok && !of_size(&exact, &mode))
        ok = fail(err, "%s and %s are not of one size", names[0], names[1]);
    if (ok && t->frames > 0 && !of_size(&exact, &t->exact))
        ok = fail(err, "%s is not of the size of the frame before", names[0]);
    if (ok)
        temporal_add(t, &exact, &mode);
    image_free(&exact);
    image_free(&mode);
    return ok;
}

int main(int argc, char *argv[])
{
    message err = {{0}};
    temporal t = {0};
    int frames = (argc - 1) / 2;
    if (frames < 2 || argc % 2 == 0) {
        fprintf(stderr, "usage: flicker EXACT0.exr MODE0.exr EXACT1.exr MODE1.exr ...\n");
        return 2;
    }
    bool ok = true;
    for (int i = 0; ok && i < frames; i++)
        ok = add(&t, argv + 1 + 2 * i, &err);
    if (ok) {
        printf("{");
        temporal_print(&t);
        printf("}\n");
    } else {
        fprintf(stderr, "flicker: %s\n", err.text);
    }
    temporal_free(&t);
    return !ok;
}
