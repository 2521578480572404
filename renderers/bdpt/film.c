/* SPDX-License-Identifier: Apache-2.0 */
#include "film.h"

#include <stdlib.h>

film film_new(uint32_t width, uint32_t height)
{
    return (film){.mean = image_new(width, height),
                  .seen = image_new(width, height),
                  .normal = image_new(width, height),
                  .depth = xcalloc((size_t)width * height, sizeof(float))};
}

void film_free(film *f)
{
    image_free(&f->mean);
    image_free(&f->seen);
    image_free(&f->normal);
    free(f->depth);
    *f = (film){0};
}

static void add(image *mean, const image *pass, float share)
{
    for (size_t i = 0; i < (size_t)mean->width * mean->height; i++)
        mean->pixels[i] = v3_mad(mean->pixels[i], share, v3_sub(pass->pixels[i], mean->pixels[i]));
}

void film_add(film *f, const image *pass, const image *seen)
{
    float share = 1.0f / (float)++f->passes;
    f->begun = true;
    add(&f->mean, pass, share);
    if (f->seen.pixels)
        add(&f->seen, seen, share);
}
