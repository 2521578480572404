/* SPDX-License-Identifier: Apache-2.0 */
/* The images of a comparison. */
#include "comparison_internal.h"

#include <assert.h>
#include <stdarg.h>

void image_text(image_texts *t, const char *name, const char *format, ...)
{
    assert(t->count < TEXTS_MAX);
    va_list args;
    va_start(args, format);
    vsnprintf(t->values[t->count], sizeof t->values[0], format, args);
    va_end(args);
    t->items[t->count] = (exr_attribute){name, t->values[t->count]};
    t->count++;
}

/* Every parameter, times and rays. */
static void describe(const comparison *c, image_texts *t)
{
    const renderer *r = c->renderer;
    const program_arguments *a = c->arguments;
    const frame *f = comparison_frame(c);
    bool exact = f == &c->exact_frame;
    t->count = 0;
    image_text(t, "scene", "%s", r->scene->name);
    image_text(t, "spp", "%d", a->spp);
    image_text(t, "envRotate", "%g", (double)a->env_rotate);
    image_text(t, "seed", "%llu", (unsigned long long)a->seed);
    image_text(t, "threads", "%d", a->threads);
    image_text(t, "visibility", "%s", exact ? "exact" : r->mode);
    if (r->texts)
        r->texts(r->context, f, exact, t);
    image_text(t, "frameSeconds", "%.6f", f->frame_s);
    image_text(t, "shadeSeconds", "%.6f", f->shade_s);
    image_text(t, "raysAsked", "%llu", (unsigned long long)f->rays.asked);
    image_text(t, "raysTraced", "%llu", (unsigned long long)f->rays.traced);
    image_text(t, "exposure", "%.9g",
               (double)frame_exposure(c->runs > 0 ? &c->exact_frame : f)); /* of pictures, FLIP */
    image_text(t, "complete", "%s", f->complete ? "yes" : "no, interrupted");
}

/* Mode - exact, for the .exr. */
static image signed_error(const comparison *c)
{
    const image *test = &c->mode_frame.image, *reference = &c->exact_frame.image;
    image out = image_new(test->width, test->height);
    for (size_t i = 0; i < (size_t)out.width * out.height; i++)
        out.pixels[i] = v3_sub(test->pixels[i], reference->pixels[i]);
    return out;
}

bool comparison_picture(const comparison *c, const char *path, message *err)
{
    float exposure = frame_exposure(&c->exact_frame);
    image error = image_difference(&c->mode_frame.image, &c->exact_frame.image, 8.0f * exposure);
    for (size_t i = 0; i < (size_t)error.width * error.height; i++)
        error.pixels[i] = v3_scale(error.pixels[i], 1.0f / exposure); /* its colours are final */
    const image *three[3] = {&c->exact_frame.image, &c->mode_frame.image, &error};
    image side = image_side_by_side(three, 3);
    bool ok = png_save(path, &side, exposure, NULL, 0, err);
    image_free(&error);
    image_free(&side);
    return ok;
}

bool comparison_save(const comparison *c, const char *path, message *err)
{
    const program_arguments *a = c->arguments;
    const frame *f = comparison_frame(c);
    image_texts t;
    describe(c, &t);
    if (has_extension(path, ".png"))
        return png_save(path, &f->image, frame_exposure(f), t.items, (size_t)t.count, err);

    exr_channel channels[16];
    size_t n = 0;
    image error = {0};
    if (c->runs > 0)
        error = signed_error(c);
    const struct {
        const image *image;
        const char *names[3];
    } layers[] = {{&f->image, {"R", "G", "B"}},
                  {&f->normal, {"normal.X", "normal.Y", "normal.Z"}},
                  {&f->cells, {"cell.R", "cell.G", "cell.B"}},
                  {&error, {"error.R", "error.G", "error.B"}}};
    for (size_t i = 0; i < sizeof layers / sizeof *layers; i++)
        for (int k = 0; k < 3 && layers[i].image->pixels; k++)
            channels[n++] = (exr_channel){layers[i].names[k], &layers[i].image->pixels[0].x + k, 3};
    if (c->flip_map)
        channels[n++] = (exr_channel){"flip.Y", c->flip_map, 1};
    if (f->depth)
        channels[n++] = (exr_channel){"depth.Z", f->depth, 1};
    if (f->traced_share)
        channels[n++] = (exr_channel){"traced.Y", f->traced_share, 1};
    exr_options options = {.half = a->half, .tiles = a->tiles};
    bool ok = exr_save(path, a->size.width, a->size.height, channels, n, t.items, (size_t)t.count, options, err);
    image_free(&error);
    return ok;
}
