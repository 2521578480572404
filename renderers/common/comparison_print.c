/* SPDX-License-Identifier: Apache-2.0 */
/* The table of a comparison. */
#include "comparison_internal.h"

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

void print_count(FILE *out, uint64_t n, const char *what)
{
    char text[32];
    fprintf(out, ", %s %s%s", grouped(n, text), what, n == 1 ? "" : "s");
}

static void print_heading(const comparison *c, FILE *out)
{
    const renderer *r = c->renderer;
    const program_arguments *a = c->arguments;
    char text[32];
    uint64_t triangles = r->scene->triangle_count;
    fprintf(out, "%s: %s triangle%s, %ux%u, %d spp", r->scene->name, grouped(triangles, text),
            triangles == 1 ? "" : "s", a->size.width, a->size.height, a->spp);
    if (r->heading)
        r->heading(r->context, comparison_frame(c), out);
    fputc('\n', out);
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

/* The chosen visibility beside the exact one. */
static void print_pair(const comparison *c, FILE *out)
{
    double low, high, ratio = comparison_ratio(c, false, &low, &high);
    fprintf(out, "%-19s frame %8.2f x ", "speed-up", ratio);
    if (c->runs > 1)
        fprintf(out, "(%.2f ... %.2f in %d pairs)", low, high, c->runs);
    double shade = comparison_ratio(c, true, &low, &high);
    fprintf(out, "  shading %8.2f x   shadow rays %15.2f x\n", shade, comparison_ray_ratio(c));
    fprintf(out,
            "difference          l_inf %.3f %% (whole image %.3f %%)   relMSE %.3g   p99.9 %.3f   max %.3f   FLIP %.4f",
            100.0 * c->lit.l_inf, 100.0 * c->whole.l_inf, c->lit.rel_mse, c->lit.p999, c->lit.max, c->flip);
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
    if (!c->arguments->reference || (!exact && !mode))
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
    const renderer *r = c->renderer;
    const frame *e = &c->exact_frame, *m = &c->mode_frame;
    char name[32];
    snprintf(name, sizeof name, "%s", r->mode);
    if (r->name && frame_begun(m))
        r->name(r->context, m, name, sizeof name);
    print_heading(c, out);
    if (frame_begun(e))
        print_frame(out, "exact", comparison_exact(c), e);
    if (frame_begun(m))
        print_frame(out, name, comparison_mode(c), m);
    if (c->runs > 0)
        print_pair(c, out);
    print_reference(c, name, out);
}
