/* SPDX-License-Identifier: Apache-2.0 */
/* The course of a run; see comparison.h. */
#include "comparison_internal.h"

#include "flip.h"
#include "interrupt.h"

#include <stdlib.h>
#include <string.h>

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, by_size);
    return count % 2 ? values[count / 2] : 0.5 * (values[count / 2 - 1] + values[count / 2]);
}

double comparison_ratio(const comparison *c, bool shade, double *low, double *high)
{
    double ratios[RUNS_MAX];
    for (int i = 0; i < c->runs; i++)
        ratios[i] = shade ? c->exact[i].shade_s / c->mode[i].shade_s : c->exact[i].frame_s / c->mode[i].frame_s;
    double middle = median(ratios, c->runs);
    *low = ratios[0];
    *high = ratios[c->runs - 1];
    return middle;
}

double comparison_ray_ratio(const comparison *c)
{
    uint64_t traced = c->mode_frame.rays.traced;
    return traced ? (double)c->exact_frame.rays.traced / (double)traced : 1.0;
}

static times times_of(const frame *f)
{
    return (times){f->frame_s, f->shade_s};
}

static times medians(const times *t, int count, const frame *f)
{
    double frames[RUNS_MAX], shades[RUNS_MAX];
    if (count == 0)
        return times_of(f);
    for (int i = 0; i < count; i++) {
        frames[i] = t[i].frame_s;
        shades[i] = t[i].shade_s;
    }
    return (times){median(frames, count), median(shades, count)};
}

times comparison_exact(const comparison *c)
{
    return medians(c->exact, c->runs, &c->exact_frame);
}

times comparison_mode(const comparison *c)
{
    return medians(c->mode, c->runs, &c->mode_frame);
}

bool frame_begun(const frame *f)
{
    return f->image.pixels != NULL;
}

const frame *comparison_frame(const comparison *c)
{
    return frame_begun(&c->mode_frame) ? &c->mode_frame : &c->exact_frame;
}

const image *frame_lit(const frame *f)
{
    return f->lit.pixels ? &f->lit : &f->image;
}

float frame_exposure(const frame *f)
{
    return image_exposure(frame_lit(f));
}

static void comparison_free(comparison *c)
{
    free(c->flip_map);
    c->flip_map = NULL;
    frame_free(&c->exact_frame);
    frame_free(&c->mode_frame);
}

/* One pair. An incomplete one does not replace one that is there. */
static bool render_pair(comparison *c, option_size size, bool count, message *err)
{
    const renderer *r = c->renderer;
    frame_request wanted = {size.width, size.height, true, count, "exact", c->arguments->quiet};
    frame exact = {0}, mode = {0};
    bool ok = r->render(r->context, &wanted, &exact, err);
    wanted.exact = false;
    wanted.title = "chosen";
    if (ok && exact.complete && !interrupted())
        ok = r->render(r->context, &wanted, &mode, err);
    if (c->runs > 0 && !mode.complete) {
        frame_free(&exact);
        frame_free(&mode);
        return ok;
    }
    comparison_free(c);
    c->exact_frame = exact;
    c->mode_frame = mode;
    return ok;
}

/* What comes first pays for cold caches and fresh pages; where there is one pair alone, a sixteenth of it warms up. */
static bool warm_up(const comparison *c, message *err)
{
    option_size size = c->arguments->size;
    comparison small = {.renderer = c->renderer, .arguments = c->arguments};
    bool ok = render_pair(&small, (option_size){(size.width + 3) / 4, (size.height + 3) / 4}, false, err);
    comparison_free(&small);
    return ok;
}

static bool run_pairs(comparison *c, int runs, message *err)
{
    bool ok = true, count = c->renderer->mispredictions;
    if (runs == 1)
        ok = warm_up(c, err);
    for (int i = runs > 1 ? -1 : 0; i < runs && ok && !interrupted(); i++) {
        ok = render_pair(c, c->arguments->size, count, err);
        if (!ok || interrupted())
            break;
        if (count && c->mode_frame.rays.asked)
            c->mispredicted = (double)c->mode_frame.mispredicted / (double)c->mode_frame.rays.asked;
        count = false;          /* once: in the pair that warms up, where there are several */
        int at = i < 0 ? 0 : i; /* times of the pair that warms up are replaced */
        c->exact[at] = times_of(&c->exact_frame);
        c->mode[at] = times_of(&c->mode_frame);
        c->runs = at + 1;
    }
    if (ok && c->runs > 0) {
        c->lit = image_compare(frame_lit(&c->mode_frame), frame_lit(&c->exact_frame));
        const image *test = &c->mode_frame.image, *exact = &c->exact_frame.image;
        c->whole = image_compare(test, exact);
        c->flip_map = xmalloc((size_t)exact->width * exact->height * sizeof *c->flip_map);
        c->flip = flip_ldr(test, exact, frame_exposure(&c->exact_frame), c->flip_map);
    }
    return ok;
}

/* The chosen visibility alone. */
static bool run_single(comparison *c, message *err)
{
    const program_arguments *a = c->arguments;
    frame_request wanted = {a->size.width, a->size.height, false, false, "rendering", a->quiet};
    return c->renderer->render(c->renderer->context, &wanted, &c->mode_frame, err);
}

static void compare_with(comparison *c, const image *reference)
{
    float exposure = image_file_exposure(c->arguments->reference, reference);
    if (c->exact_frame.complete) {
        c->exact_reference = image_compare(&c->exact_frame.image, reference);
        c->exact_reference_flip = flip_ldr(&c->exact_frame.image, reference, exposure, NULL);
    }
    if (c->mode_frame.complete) {
        c->mode_reference = image_compare(&c->mode_frame.image, reference);
        c->mode_reference_flip = flip_ldr(&c->mode_frame.image, reference, exposure, NULL);
    }
}

static bool write_files(const comparison *c, message *err)
{
    const program_arguments *a = c->arguments;
    for (int i = 0; i < a->outputs.count; i++)
        if (!comparison_save(c, a->outputs.items[i], err))
            return false;
    if (a->picture && c->runs > 0 && !comparison_picture(c, a->picture, err))
        return false;
    return !a->json || comparison_json(c, a->json, err);
}

bool renderer_run(const renderer *r, const program_arguments *a, const image *reference, message *err)
{
    comparison c = {.renderer = r, .arguments = a, .mispredicted = -1.0};
    if (a->outputs.count == 0 && !a->picture && !a->json && !a->compare && !a->reference)
        notice("no --output: the image will not be kept");
    int runs = a->runs ? a->runs : 1;
    bool ok = a->compare ? run_pairs(&c, runs, err) : run_single(&c, err);
    if (ok && !frame_begun(comparison_frame(&c))) {
        notice("interrupted before the first pixel: nothing is written");
    } else if (ok) {
        if (a->reference)
            compare_with(&c, reference);
        if (!a->quiet)
            comparison_print(&c, a->json && strcmp(a->json, "-") == 0 ? stderr : stdout);
        if (a->compare && c.runs == 0)
            notice("interrupted: no pair of frames to compare; the image is a part of one");
        else if (a->compare && c.runs < runs)
            notice("interrupted: %d of %d pairs of frames", c.runs, runs);
        else if (!a->compare && !c.mode_frame.complete)
            notice("interrupted: image and figures are of a part of the frame");
        size_t bad = image_not_finite(&c.mode_frame.image);
        if (bad > 0)
            notice("%zu pixels are infinite or no number: light or scale is beyond what floats hold", bad);
        ok = write_files(&c, err);
    }
    comparison_free(&c);
    return ok;
}
