/* SPDX-License-Identifier: Apache-2.0 */
#include "compare.h"

#include "../common/interrupt.h"

#include <stdarg.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

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

times comparison_median(const times *t, int count)
{
    double frames[RUNS_MAX], shades[RUNS_MAX];
    for (int i = 0; i < count; i++) {
        frames[i] = t[i].frame_s;
        shades[i] = t[i].shade_s;
    }
    return (times){median(frames, count), median(shades, count)};
}

static times times_of(const frame *f)
{
    return (times){f->frame_s, f->shade_s};
}

bool frame_begun(const frame *f)
{
    return f->image.pixels != NULL;
}

const frame *comparison_frame(const comparison *c)
{
    return frame_begun(&c->mode_frame) ? &c->mode_frame : &c->exact_frame;
}

uint64_t memory_budget(void)
{
    return (uint64_t)sysconf(_SC_PHYS_PAGES) / 2 * (uint64_t)sysconf(_SC_PAGESIZE);
}

uint64_t comparison_bytes(const settings *f, bool compare, int runs)
{
    return frame_bytes(f) * (!compare ? 1 : runs > 1 ? 4 : 2);
}

bool comparison_single(const view *v, bool quiet, comparison *out, message *err)
{
    memset(out, 0, sizeof *out);
    out->view = v;
    out->mispredicted = -1.0;
    return frame_render(v, "rendering", quiet, NULL, NULL, &out->mode_frame, err);
}

/* Whether one bit for each pair of eye sample and light can be kept. */
static bool truth_fits(const view *v)
{
    const settings *f = &v->settings;
    uint64_t lights = (uint64_t)f->vpls + v->scene->light_count + direct_sample_count(v);
    return (uint64_t)f->width * f->height * (uint64_t)f->spp <= memory_budget() / (lights / 8 + 24);
}

/* One pair; `known` (NULL: none) is recorded by the exact frame and checked by the other. */
static bool render_pair(const view *v, bool quiet, truth *known, comparison *out, message *err)
{
    view exact = *v;
    exact.settings.visibility = VISIBILITY_EXACT;
    frame first, second = {0};
    bool ok = frame_render(&exact, "exact", quiet, known, NULL, &first, err);
    if (ok && first.complete && !interrupted())
        ok = frame_render(v, "chosen", quiet, NULL, known, &second, err);
    if (out->runs > 0 && !second.complete) {
        frame_free(&first);
        frame_free(&second);
        return ok;
    }
    comparison_free(out);
    out->exact_frame = first;
    out->mode_frame = second;
    return ok;
}

/* What comes first pays for cold caches and fresh pages; where there is one pair alone, a sixteenth of it warms up. */
static bool warm_up(const view *v, bool quiet, message *err)
{
    view small = *v;
    small.settings.width = (v->settings.width + 3) / 4;
    small.settings.height = (v->settings.height + 3) / 4;
    comparison c = {.view = &small};
    bool ok = render_pair(&small, quiet, NULL, &c, err);
    comparison_free(&c);
    return ok;
}

bool comparison_run(const view *v, int runs, bool quiet, comparison *out, message *err)
{
    memset(out, 0, sizeof *out);
    out->view = v;
    out->mispredicted = -1.0;
    truth known = {0};
    /* an estimate predicts no single ray */
    bool ok = true, estimate = estimates(v->settings.visibility), record = !estimate && truth_fits(v);
    if (!record && !estimate)
        notice("too many pairs to keep a record of: mispredictions are not counted");
    if (runs == 1)
        ok = warm_up(v, quiet, err);
    /* interrupted before the first pair: it is begun all the same, so that there is a picture to write */
    for (int i = runs > 1 ? -1 : 0; i < runs && ok && (!interrupted() || !frame_begun(&out->exact_frame)); i++) {
        /* the truth is taken down once: in the pair that warms up, where there are several */
        ok = render_pair(v, quiet, record ? &known : NULL, out, err);
        truth_free(&known);
        if (!ok || interrupted())
            break;
        if (record && out->mode_frame.rays.asked)
            out->mispredicted = (double)out->mode_frame.mispredicted / (double)out->mode_frame.rays.asked;
        record = false;
        int at = i < 0 ? 0 : i; /* times of the pair that warms up are replaced */
        out->exact[at] = times_of(&out->exact_frame);
        out->mode[at] = times_of(&out->mode_frame);
        out->runs = at + 1;
    }
    if (ok && out->runs > 0) {
        out->lit = image_compare(&out->mode_frame.lit, &out->exact_frame.lit);
        out->whole = image_compare(&out->mode_frame.image, &out->exact_frame.image);
    }
    return ok;
}

void comparison_reference(comparison *c, const char *file, const image *reference)
{
    c->reference = file;
    if (c->exact_frame.complete)
        c->exact_reference = image_compare(&c->exact_frame.image, reference);
    if (c->mode_frame.complete)
        c->mode_reference = image_compare(&c->mode_frame.image, reference);
}

void comparison_free(comparison *c)
{
    frame_free(&c->exact_frame);
    frame_free(&c->mode_frame);
}

const char *const visibility_names[] = {"exact", "cache", "estimate", NULL};
const char *const mode_names[VISIBILITY_MODES] = {"exact", "cache", "estimate", "selection", "cached-selection"};
const char *const store_names[] = {"rows", "words", NULL};
const char *const hash_names[] = {"split", "lcg-pair", "lcg-xorshift", NULL};

/* 1234567 as 1,234,567 */
static const char *grouped(uint64_t n, char out[32])
{
    char digits[24];
    int length = snprintf(digits, sizeof digits, "%llu", (unsigned long long)n), at = 0;
    for (int i = 0; i < length; i++) {
        if (i > 0 && (length - i) % 3 == 0)
            out[at++] = ',';
        out[at++] = digits[i];
    }
    out[at] = 0;
    return out;
}

static void print_frame(FILE *out, const char *name, times t, const frame *f)
{
    char text[32];
    fprintf(out, "%-19s frame %8.3f s   shading %8.3f s   shadow rays %15s", name, t.frame_s, t.shade_s,
            grouped(f->rays.traced, text));
    if (f->rays.traced != f->rays.asked && f->rays.asked)
        fprintf(out, " (%.2f %% of those asked for)", 100.0 * (double)f->rays.traced / (double)f->rays.asked);
    fputs(f->complete ? "\n" : " (interrupted)\n", out);
}

static void print_count(FILE *out, uint64_t n, const char *what)
{
    char text[32];
    fprintf(out, ", %s %s%s", grouped(n, text), what, n == 1 ? "" : "s");
}

static void print_heading(const comparison *c, FILE *out)
{
    const settings *f = &c->view->settings;
    const frame *m = comparison_frame(c);
    char text[32];
    uint64_t triangles = c->view->scene->triangle_count;
    fprintf(out, "%s: %s triangle%s, %ux%u, %d spp", c->view->scene->name, grouped(triangles, text),
            triangles == 1 ? "" : "s", f->width, f->height, f->spp);
    print_count(out, m->vpls, "virtual point light");
    print_count(out, m->punctual, "punctual light");
    print_count(out, m->samples, "light sample");
    fputc('\n', out);
}

/* The chosen visibility beside the exact one. */
static void print_pair(const comparison *c, FILE *out)
{
    const frame *e = &c->exact_frame, *m = &c->mode_frame;
    double low, high, ratio = comparison_ratio(c, false, &low, &high);
    fprintf(out, "%-19s frame %8.2f x ", "speed-up", ratio);
    if (c->runs > 1)
        fprintf(out, "(%.2f ... %.2f in %d pairs)", low, high, c->runs);
    double shade = comparison_ratio(c, true, &low, &high);
    fprintf(out, "  shading %8.2f x   shadow rays %15.2f x\n", shade,
            m->rays.traced ? (double)e->rays.traced / (double)m->rays.traced : 1.0);
    fprintf(out, "difference          l_inf %.3f %% (whole image %.3f %%)   relMSE %.3g   p99.9 %.3f   max %.3f",
            100.0 * c->lit.l_inf, 100.0 * c->whole.l_inf, c->lit.rel_mse, c->lit.p999, c->lit.max);
    if (c->mispredicted >= 0.0)
        fprintf(out, "   mispredicted %.3f %%", 100.0 * c->mispredicted);
    fputc('\n', out);
}

static void print_error(FILE *out, const char *name, const image_error *e)
{
    fprintf(out, " %s: l_inf %.3f %%   relMSE %.3g   p99.9 %.3f   max %.3f", name, 100.0 * e->l_inf, e->rel_mse,
            e->p999, e->max);
}

/* `name`: of the chosen visibility. */
static void print_reference(const comparison *c, const char *name, FILE *out)
{
    bool exact = c->exact_frame.complete, mode = c->mode_frame.complete;
    if (!c->reference || (!exact && !mode))
        return;
    fprintf(out, "%-19s", "reference");
    if (exact)
        print_error(out, "exact", &c->exact_reference);
    if (exact && mode)
        fputs("  ", out);
    if (mode)
        print_error(out, name, &c->mode_reference);
    fputc('\n', out);
}

void comparison_print(const comparison *c, FILE *out)
{
    const settings *f = &c->view->settings;
    const frame *e = &c->exact_frame, *m = &c->mode_frame;
    char name[32] = "exact";
    print_heading(c, out);
    if (f->visibility == VISIBILITY_CACHE)
        snprintf(name, sizeof name, "cache C_E %g", (double)f->ce);
    else if (estimates(f->visibility) && frame_begun(m) && m->served == VISIBILITY_EXACT)
        snprintf(name, sizeof name, "%s: all", mode_names[f->visibility]);
    else if (estimates(f->visibility))
        snprintf(name, sizeof name, "%s %g", mode_names[f->visibility], (double)f->rays);
    if (frame_begun(e))
        print_frame(out, "exact", c->runs ? comparison_median(c->exact, c->runs) : times_of(e), e);
    if (frame_begun(m))
        print_frame(out, name, c->runs ? comparison_median(c->mode, c->runs) : times_of(m), m);
    if (c->runs > 0)
        print_pair(c, out);
    print_reference(c, name, out);
}

/* ------------------------------------------------------------------------------------------------------- files */

/* Mode - exact, for the .exr. */
static image signed_error(const comparison *c)
{
    const image *test = &c->mode_frame.image, *reference = &c->exact_frame.image;
    image out = image_new(test->width, test->height);
    for (size_t i = 0; i < (size_t)out.width * out.height; i++)
        out.pixels[i] = v3_sub(test->pixels[i], reference->pixels[i]);
    return out;
}

/* Emitters and sky may blow out; what is lit must be seen. */
static float exposure_of(const frame *f)
{
    return image_exposure(&f->lit);
}

bool comparison_picture(const comparison *c, const char *path, message *err)
{
    float exposure = exposure_of(&c->exact_frame);
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

enum { TEXT_MAX = 24 };

typedef struct texts {
    exr_attribute items[TEXT_MAX];
    char values[TEXT_MAX][64];
    int count;
} texts;

#if defined(__GNUC__)
__attribute__((format(printf, 3, 4)))
#endif
static void
add_text(texts *t, const char *name, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    vsnprintf(t->values[t->count], sizeof t->values[0], format, args);
    va_end(args);
    t->items[t->count] = (exr_attribute){name, t->values[t->count]};
    t->count++;
}

static bool uses_cache(visibility_mode mode)
{
    return mode != VISIBILITY_EXACT && mode != VISIBILITY_SELECT;
}

/* Every parameter, times and rays. */
static void describe(const comparison *c, texts *t)
{
    const settings *f = &c->view->settings;
    const frame *m = comparison_frame(c);
    visibility_mode mode = m == &c->mode_frame ? f->visibility : VISIBILITY_EXACT;
    t->count = 0;
    add_text(t, "scene", "%s", c->view->scene->name);
    add_text(t, "spp", "%d", f->spp);
    add_text(t, "vpls", "%u", m->vpls);
    add_text(t, "lightSamples", "%d", f->light_samples);
    add_text(t, "envSamples", "%d", f->env_samples);
    add_text(t, "seed", "%llu", (unsigned long long)f->seed);
    add_text(t, "threads", "%d", f->threads);
    add_text(t, "visibility", "%s", mode_names[mode]);
    add_text(t, "served", "%s", mode_names[m->served]);
    if (estimates(mode))
        add_text(t, "select", "%g", (double)f->rays);
    if (uses_cache(mode)) {
        add_text(t, "ce", "%g", (double)f->ce);
        add_text(t, "ceDelta", "%g", (double)f->ce_delta);
        add_text(t, "ceSamples", "%g", (double)f->ce_samples);
        add_text(t, "normalBins", "%d", f->cache.normal_bins);
        add_text(t, "layers", "%d", f->cache.layers);
        add_text(t, "resolutionStep", "%g", (double)f->cache.resolution_step);
        add_text(t, "levels", "%d", f->cache.levels);
        add_text(t, "hash", "%s", hash_names[f->cache.hash]);
        add_text(t, "cacheBytes", "%llu", (unsigned long long)m->cache_bytes);
    }
    add_text(t, "frameSeconds", "%.6f", m->frame_s);
    add_text(t, "shadeSeconds", "%.6f", m->shade_s);
    add_text(t, "raysAsked", "%llu", (unsigned long long)m->rays.asked);
    add_text(t, "raysTraced", "%llu", (unsigned long long)m->rays.traced);
    add_text(t, "complete", "%s", m->complete ? "yes" : "no, interrupted");
}

bool has_extension(const char *path, const char *extension)
{
    size_t n = strlen(path), m = strlen(extension);
    return n > m && strcasecmp(path + n - m, extension) == 0;
}

bool comparison_save(const comparison *c, const char *path, exr_options options, message *err)
{
    const settings *f = &c->view->settings;
    const frame *m = comparison_frame(c);
    texts t;
    describe(c, &t);
    if (has_extension(path, ".png"))
        return png_save(path, &m->image, exposure_of(m), t.items, (size_t)t.count, err);

    exr_channel channels[16];
    size_t n = 0;
    image error = {0};
    const struct {
        const image *image;
        const char *names[3];
        bool wanted;
    } layers[] = {{&m->image, {"R", "G", "B"}, true},
                  {&m->normal, {"normal.X", "normal.Y", "normal.Z"}, true},
                  {&m->cells, {"cell.R", "cell.G", "cell.B"}, m == &c->mode_frame && uses_cache(f->visibility)},
                  {&error, {"error.R", "error.G", "error.B"}, c->runs > 0}};
    if (c->runs > 0)
        error = signed_error(c);
    for (size_t i = 0; i < sizeof layers / sizeof *layers; i++)
        for (int k = 0; k < 3 && layers[i].wanted; k++)
            channels[n++] = (exr_channel){layers[i].names[k], &layers[i].image->pixels[0].x + k, 3};
    channels[n++] = (exr_channel){"depth.Z", m->depth, 1};
    channels[n++] = (exr_channel){"traced.Y", m->traced_share, 1};
    bool ok = exr_save(path, f->width, f->height, channels, n, t.items, (size_t)t.count, options, err);
    image_free(&error);
    return ok;
}
