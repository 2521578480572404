/* SPDX-License-Identifier: Apache-2.0 */
/* Where does the cache put the edges of hard shadows, and how ragged are they (Popov et al. 2013, Fig. 3, 4, 8)?
 *
 *     edges SCENE [--ce X] [--picture PREFIX] [--size WxH] [--env-lights N] ...
 *
 * One eye path a pixel. Of each punctual light, rows of 4 C_E pixels (at least 16) on one plane, all facing the light,
 * of which exact has the left half in light and the right in shade, or the other way round: an edge, in its middle. How
 * many more of these pixels the cache sees as the left half is the edge's shift to the right; the same down in columns.
 * Where the row below has an edge too, at most two pixels aside, the change of the shift from one to the other is
 * raggedness that exact does not have: its root mean square, in pixels. Orders of eye samples: the renderer's own
 * (Halton order in tiles along a Morton curve), scanlines, random; with refinement and without. Prints JSON. --picture:
 * the image in each way as PREFIX-WAY.png and of the square where unrefined edges are shifted most, the same in all,
 * PREFIX-zoom-WAY.png.
 */
#include "lighting.h"

#include "renderers/common/metrics.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct way {
    const char *name;
    eye_order order;
    int levels; /* 0: as many as C_E takes */
} way;

static const way ways[] = {
    {"halton", ORDER_HALTON, 0},       {"scanline", ORDER_SCANLINE, 0},       {"random", ORDER_RANDOM, 0},
    {"halton-plain", ORDER_HALTON, 1}, {"scanline-plain", ORDER_SCANLINE, 1}, {"random-plain", ORDER_RANDOM, 1},
};
/* PLAIN: Halton order, not refined; SIDE: of what is enlarged, in pixels. */
enum { WAYS = sizeof ways / sizeof *ways, PLAIN = 3, JOINED = 2, SIDE = 64 };

/* A view with one eye sample a pixel. */
typedef struct scan {
    uint32_t width, height, half; /* of the image; pixels on either side of an edge */
    const eye_list *eyes;
    uint32_t *eye; /* of each pixel; UINT32_MAX: none */
} scan;

/* What was found of edges along one axis. */
typedef struct shifts {
    uint64_t edges, pairs;
    double sum, absolute, ragged; /* of squares, the last */
    const image *shown;           /* the exact image; NULL where `where` is not wanted */
    float *where; /* of each pixel: how much of the shifts of edges before it shows, by the root of light */
} shifts;

static scan scan_new(const settings *f, const eye_list *eyes, uint32_t half)
{
    scan s = {f->width, f->height, half, eyes, xmalloc((size_t)f->width * f->height * sizeof *s.eye)};
    memset(s.eye, 0xff, (size_t)f->width * f->height * sizeof *s.eye);
    for (uint32_t i = 0; i < eyes->count; i++)
        if (eyes->items[i].place != PLACE_NONE)
            s.eye[eyes->pixel[i]] = i;
    return s;
}

static bool bit(const uint64_t *rows, const light_bits *b, uint32_t eye, uint32_t of_light)
{
    return rows[(size_t)eye * b->words + b->punctual + of_light / 64] >> of_light % 64 & 1u;
}

/* Eye samples of the pixels from `at` on in steps of `step`: all there, facing the light, on the plane of the first. */
static bool on_plane(const scan *s, const light_bits *exact, uint32_t of_light, size_t at, size_t step)
{
    if (s->eye[at] == UINT32_MAX)
        return false;
    const surface *first = &s->eyes->items[s->eye[at]].surface;
    for (uint32_t k = 0; k < 2 * s->half; k++) {
        uint32_t eye = s->eye[at + k * step];
        if (eye == UINT32_MAX || !bit(exact->asked, exact, eye, of_light))
            return false;
        const surface *p = &s->eyes->items[eye].surface;
        vec3 d = v3_sub(p->position, first->position);
        if (!(v3_dot(p->geometric_normal, first->geometric_normal) > 0.9999f) ||
            fabsf(v3_dot(d, first->geometric_normal)) > 0.01f * v3_length(d))
            return false;
    }
    return true;
}

/* Whether an edge lies in the middle of these pixels; *shift of it along them. */
static bool edge(const scan *s, const light_bits *exact, const light_bits *other, uint32_t of_light, size_t at,
                 size_t step, double *shift)
{
    uint32_t middle = s->eye[at + (s->half - 1) * step], behind = s->eye[at + s->half * step];
    if (middle == UINT32_MAX || behind == UINT32_MAX ||
        bit(exact->visible, exact, middle, of_light) == bit(exact->visible, exact, behind, of_light) ||
        !on_plane(s, exact, of_light, at, step))
        return false;
    bool left = bit(exact->visible, exact, middle, of_light);
    double same = 0.0;
    for (uint32_t k = 0; k < 2 * s->half; k++) {
        uint32_t eye = s->eye[at + k * step];
        if (bit(exact->visible, exact, eye, of_light) != (k < s->half ? left : !left))
            return false;
        same += bit(other->visible, other, eye, of_light) == left;
    }
    *shift = same - s->half;
    return true;
}

static float contrast(rgb a, rgb b)
{
    return fabsf(sqrtf(luminance(a)) - sqrtf(luminance(b)));
}

/* All edges of a light across rows (`down` false: shifts to the right) or columns. */
static void measure(const scan *s, const light_bits *exact, const light_bits *other, uint32_t of_light, bool down,
                    shifts *out)
{
    uint32_t along = down ? s->height : s->width, across = down ? s->width : s->height;
    size_t step = down ? s->width : 1, next = down ? 1 : s->width;
    if (along < 2 * s->half)
        return;
    double *last = xmalloc(2 * (size_t)along * sizeof *last), *now = last + along; /* NAN: no edge there */
    for (uint32_t i = 0; i < along; i++)
        last[i] = NAN;
    for (uint32_t row = 0; row < across; row++) {
        for (uint32_t i = 0; i < along; i++)
            now[i] = NAN;
        for (uint32_t i = 0; i + 2 * s->half <= along; i++) {
            double shift;
            if (!edge(s, exact, other, of_light, row * next + i * step, step, &shift))
                continue;
            now[i] = shift;
            out->edges++;
            if (out->shown) {
                size_t behind = row * next + (i + s->half) * step;
                out->where[behind] +=
                    contrast(out->shown->pixels[behind - step], out->shown->pixels[behind]) * (float)fabs(shift);
            }
            out->sum += shift;
            out->absolute += fabs(shift);
            for (uint32_t k = i < JOINED ? 0 : i - JOINED; k <= i + JOINED && k < along; k++)
                if (!isnan(last[k])) {
                    out->pairs++;
                    out->ragged += (shift - last[k]) * (shift - last[k]);
                    break;
                }
        }
        memcpy(last, now, along * sizeof *last);
    }
    free(last);
}

static double share(double sum, uint64_t count)
{
    return count ? sum / (double)count : 0.0;
}

static void print(const way *w, const scan *s, const stage *of, const lit *exact, const lit *l, ray_counts rays)
{
    shifts x = {.shown = NULL}, y = {.shown = NULL};
    for (uint32_t i = 0; i < of->scene->light_count; i++) {
        measure(s, &exact->bits, &l->bits, i, false, &x);
        measure(s, &exact->bits, &l->bits, i, true, &y);
    }
    printf("{\"name\": \"%s\", \"edges\": %llu, \"rows\": %llu, \"columns\": %llu, \"pairs\": %llu, ", w->name,
           (unsigned long long)(x.edges + y.edges), (unsigned long long)x.edges, (unsigned long long)y.edges,
           (unsigned long long)(x.pairs + y.pairs));
    printf("\"right\": %.9g, \"down\": %.9g, \"off\": %.9g, \"ragged\": %.9g, ", share(x.sum, x.edges),
           share(y.sum, y.edges), share(x.absolute + y.absolute, x.edges + y.edges),
           sqrt(share(x.ragged + y.ragged, x.pairs + y.pairs)));
    printf("\"rays\": %.9g, \"mispredicted\": %.9g, \"l_inf\": %.9g}", share((double)rays.traced, rays.asked),
           lit_mispredicted(l, exact, s->eyes->count), image_compare(&l->image, &exact->image).l_inf);
}

/* ------------------------------------------------------------------------------------------------------- pictures */

/* The square in which the shifts of edges show most, those of all lights together. */
static void worst_edges(const scan *s, const lit *exact, const lit *other, uint32_t lights, uint32_t side, uint32_t *x,
                        uint32_t *y)
{
    shifts found = {.shown = &exact->image, .where = xcalloc((size_t)s->width * s->height, sizeof *found.where)};
    uint32_t pace = side > 8 ? side / 8 : 1;
    double most = -1.0;
    for (uint32_t i = 0; i < lights; i++) {
        measure(s, &exact->bits, &other->bits, i, false, &found);
        measure(s, &exact->bits, &other->bits, i, true, &found);
    }
    for (uint32_t v = 0; v + side <= s->height; v += pace)
        for (uint32_t u = 0; u + side <= s->width; u += pace) {
            double sum = 0.0;
            for (uint32_t j = v; j < v + side; j++)
                for (uint32_t i = u; i < u + side; i++)
                    sum += (double)found.where[(size_t)j * s->width + i];
            if (sum > most)
                most = sum, *x = u, *y = v;
        }
    free(found.where);
}

static bool save(const char *prefix, const char *name, const image *i, float exposure, uint32_t x, uint32_t y,
                 uint32_t side, message *err)
{
    char path[4096];
    snprintf(path, sizeof path, "%s-%s.png", prefix, name);
    if (!png_save(path, i, exposure, NULL, 0, err))
        return false;
    image part = image_cut(i, x, y, side, side);
    snprintf(path, sizeof path, "%s-zoom-%s.png", prefix, name);
    bool ok = png_save(path, &part, exposure, NULL, 0, err);
    image_free(&part);
    return ok;
}

static bool save_all(const char *prefix, const scan *s, uint32_t lights, const lit *exact, const lit lits[WAYS],
                     message *err)
{
    const image *e = &exact->image;
    uint32_t smaller = e->width < e->height ? e->width : e->height, side = smaller < SIDE ? smaller : SIDE, x = 0,
             y = 0;
    float exposure = image_exposure(e);
    worst_edges(s, exact, &lits[PLAIN], lights, side, &x, &y);
    printf(", \"x\": %u, \"y\": %u, \"side\": %u", x, y, side);
    bool ok = save(prefix, "exact", e, exposure, x, y, side, err);
    for (int i = 0; i < WAYS && ok; i++)
        ok = save(prefix, ways[i].name, &lits[i].image, exposure, x, y, side, err);
    return ok;
}

/* ----------------------------------------------------------------------------------------------------------- ways */

static bool render(const stage *s, const way *w, const eye_list *eyes, lit *out, ray_counts *rays, message *err)
{
    view v = s->view;
    caches used;
    v.settings.visibility = VISIBILITY_CACHE;
    v.settings.ce_delta = v.settings.ce;
    v.settings.cache.levels = w->levels;
    bool ok = caches_new(&v, &s->lights, &used, err);
    if (ok) {
        visibility *by = visibility_new(&v, &s->lights, &used);
        uint32_t *order = xmalloc(((size_t)eyes->count + 1) * sizeof *order);
        eyes_sort(eyes->pixel, eyes->count, v.settings.width, w->order, (double)v.settings.ce, order);
        *out = lighting_render(&v, &s->lights, eyes, order, lighting_resolve, by);
        *rays = visibility_counts(by);
        visibility_free(by);
        free(order);
    }
    caches_free(&used);
    return ok;
}

static bool compare(stage *s, const char *prefix, message *err)
{
    lit lits[WAYS] = {{.seconds = 0}};
    ray_counts rays[WAYS] = {{0, 0}};
    double half = ceil(2.0 * (double)s->view.settings.ce);
    eye_list eyes = eye_list_new(&s->view);
    lit exact = lighting_exact(&s->view, &s->lights, &eyes);
    scan of = scan_new(&s->settings, &eyes, half < 8.0 ? 8 : (uint32_t)half);
    bool ok = true;
    for (int i = 0; i < WAYS && ok; i++)
        ok = render(s, &ways[i], &eyes, &lits[i], &rays[i], err);
    if (ok) {
        printf("{");
        stage_print(s, eyes.count);
        printf(", \"ce\": %g, \"half\": %u", (double)s->view.settings.ce, of.half);
        ok = !prefix || save_all(prefix, &of, s->scene->light_count, &exact, lits, err);
        printf(", \"ways\": [");
        for (int i = 0; i < WAYS; i++) {
            printf("%s", i ? ", " : "");
            print(&ways[i], &of, s, &exact, &lits[i], rays[i]);
        }
        printf("]}\n");
    }
    for (int i = 0; i < WAYS; i++)
        lit_free(&lits[i]);
    free(of.eye);
    lit_free(&exact);
    eye_list_free(&eyes);
    return ok;
}

int main(int argc, char *argv[])
{
    stage s = stage_defaults("edges");
    const char *prefix = NULL;
    int code = 0;
    message err = {{0}};
    s.arguments.spp = 1;
    s.cache_mb = 64;
    const option table[] = {
        STAGE_OPTIONS(&s),
        {.name = "ce",
         .kind = OPTION_FLOAT,
         .value = &s.settings.ce,
         .min = 1,
         .max = 256,
         .metavar = "X",
         .help = "C_E: pixels a cell side"},
        {.name = "picture", .kind = OPTION_STRING, .value = &prefix, .metavar = "PREFIX", .help = "of PNG files"},
    };
    if (stage_open(&s, "Shift and raggedness of the edges of hard shadows by the cache, as JSON.", table,
                   sizeof table / sizeof *table, argc, argv, &code)) {
        bool ok = (s.settings.spp == 1 && s.settings.vpls == 0 && s.scene->light_count > 0) ||
                  fail(&err, "edges are those of punctual lights, with one path a pixel: --spp 1, --vpls 0");
        ok = ok && compare(&s, prefix, &err);
        code = program_end(&s.arguments, ok, &err);
    }
    stage_free(&s);
    return code;
}
