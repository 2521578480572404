/* SPDX-License-Identifier: Apache-2.0 */
#include "temporal.h"

#include <stdio.h>
#include <string.h>

static image copy(const image *from)
{
    image out = image_new(from->width, from->height);
    memcpy(out.pixels, from->pixels, (size_t)out.width * out.height * sizeof *out.pixels);
    return out;
}

/* last.exact + now.mode - now.exact: against last.mode its error is the change of the difference. */
static image carried(const temporal *last, const image *exact, const image *mode)
{
    image out = image_new(mode->width, mode->height);
    for (size_t i = 0; i < (size_t)out.width * out.height; i++)
        out.pixels[i] = v3_add(last->exact.pixels[i], v3_sub(mode->pixels[i], exact->pixels[i]));
    return out;
}

void temporal_add(temporal *t, const image *exact, const image *mode)
{
    image_error e = image_compare(mode, exact);
    t->error += e.l_inf;
    t->error_max = fmax(t->error_max, e.max);
    if (t->frames++ > 0) {
        image moved = carried(t, exact, mode);
        e = image_compare(&moved, &t->mode);
        t->change += e.l_inf;
        t->change_p999 = fmax(t->change_p999, e.p999);
        t->change_max = fmax(t->change_max, e.max);
        t->light += image_compare(exact, &t->exact).l_inf;
        image_free(&moved);
    }
    image_free(&t->exact);
    image_free(&t->mode);
    t->exact = copy(exact);
    t->mode = copy(mode);
}

void temporal_print(const temporal *t)
{
    int steps = t->frames - 1;
    printf("\"frames\": %d, \"error\": %.9g, \"error_max\": %.9g, \"change\": %.9g, \"change_p999\": %.9g, "
           "\"change_max\": %.9g, \"light\": %.9g",
           t->frames, t->error / t->frames, t->error_max, t->change / steps, t->change_p999, t->change_max,
           t->light / steps);
}

void temporal_free(temporal *t)
{
    image_free(&t->exact);
    image_free(&t->mode);
}
