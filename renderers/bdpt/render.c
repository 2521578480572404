/* SPDX-License-Identifier: Apache-2.0 */
#include "pilot.h"
#include "render.h"

#include "../common/interrupt.h"
#include "../common/progress.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void store(float out[3], vec3 p)
{
    out[0] = p.x, out[1] = p.y, out[2] = p.z;
}

void view_set(view *v, const scene *s, const tracer *t, const light_sources *l, const camera *c)
{
    v->scene = s;
    v->tracer = t;
    v->lights = l;
    v->camera = camera_frame_of(c, v->settings.width, v->settings.height);
    store(v->settings.cache.bounds_min, s->bounds_min);
    store(v->settings.cache.bounds_max, s->bounds_max);
}

/* Of an epoch: some connections each, a sixth of which are traced, in a table that is mostly empty. */
enum { BYTES_PER_PATH = 16 };

static bool make_cache(const settings *f, vcache **out, message *err)
{
    char text[VCACHE_MESSAGE_BYTES];
    *out = NULL;
    if (f->visibility == VISIBILITY_EXACT)
        return true;
    vcache_config config = f->cache;
    config.levels = 1; /* no refinement (Sect. 3.4) */
    /* Larger tables cost misses of the processor's caches and no ray less. */
    uint64_t enough = BYTES_PER_PATH * (uint64_t)f->width * f->height * (uint64_t)f->epoch;
    config.table_bytes = config.table_bytes < enough ? config.table_bytes : enough;
    return vcache_create(&config, out, text) == VCACHE_OK || fail(err, "%s", text);
}

static film begin(const settings *f, const film *start)
{
    film out = film_new(f->width, f->height);
    if (start) {
        memcpy(out.mean.pixels, start->mean.pixels, (size_t)f->width * f->height * sizeof(rgb));
        out.passes = start->passes;
        out.begun = true;
        image_free(&out.seen);
    }
    return out;
}

static image lit_of(const film *f)
{
    if (!f->seen.pixels)
        return (image){0};
    image out = image_new(f->mean.width, f->mean.height);
    for (size_t i = 0; i < (size_t)out.width * out.height; i++)
        out.pixels[i] = v3_sub(f->mean.pixels[i], f->seen.pixels[i]);
    return out;
}

/* What a cache has learnt serves N_P paths; the next epoch begins anew (Sect. 3.4). */
static bool run(const view *v, vcache *cache, passes *p, film *f, progress *shown, double start, message *err)
{
    const settings *s = &v->settings;
    bool complete = true;
    uint32_t first = f->passes;
    if (first > 0 && !passes_first_hits(p)) /* a file without them must not replace the one gone on from */
        return fail(err, "interrupted before the first new pass: nothing is written");
    /* keys of an epoch depend on how many went before */
    for (uint32_t epoch = 0; cache && epoch < (first + (uint32_t)s->epoch - 1) / (uint32_t)s->epoch; epoch++)
        vcache_clear(cache);
    while (complete && f->passes < (uint32_t)s->spp && (f->passes == first || now() - start < s->seconds)) {
        if (cache && f->passes % (uint32_t)s->epoch == 0)
            vcache_clear(cache);
        complete = passes_render(p, f->passes);
        progress_add(shown, (uint64_t)s->width * s->height);
    }
    return true;
}

uint64_t bdpt_frame_bytes(const settings *f)
{
    enum { IMAGES = 7, SPLATS = 4 }; /* those that see the camera, with room to grow */
    return (uint64_t)f->width * f->height *
           (IMAGES * sizeof(rgb) + sizeof(float) + SPLATS * (sizeof(uint32_t) + sizeof(rgb)));
}

bool bdpt_render(const view *given, const film *start, const char *title, bool quiet, frame *out, message *err)
{
    view own = *given, *v = &own;
    const settings *s = &v->settings;
    double begun = now();
    vcache *cache;
    if (!make_cache(s, &cache, err))
        return false;
    pilot *ahead = pilot_new(v, cache != NULL);
    own.pilot = ahead;
    film f = begin(s, start);
    frame_passes *extra = xcalloc(1, sizeof *extra);
    extra->from = f.passes;
    passes *p = passes_new(v, cache, &f);
    uint64_t pixels = (uint64_t)s->width * s->height;
    progress *shown = progress_new(title, pixels * ((uint64_t)s->spp - f.passes), quiet);
    bool ok = run(v, cache, p, &f, shown, begun, err);
    progress_free(shown);
    double visibility_s;
    counts c = passes_counts(p, &visibility_s, &extra->asking_s);
    passes_free(p);
    extra->passes = f.passes;
    extra->camera_rays = c.camera;
    extra->not_finite = c.not_finite;
    *out = (frame){.image = f.mean,
                   .lit = lit_of(&f),
                   .seen = f.seen,
                   .normal = f.normal,
                   .depth = f.depth,
                   .frame_s = now() - begun,
                   .shade_s = visibility_s,
                   .rays = {c.asked, c.traced},
                   .cache_bytes = cache ? 4 * vcache_table_words(cache) : 0,
                   .eye_samples = (f.passes - extra->from) * pixels,
                   .complete = !interrupted(),
                   .extra = extra};
    vcache_destroy(&cache);
    pilot_free(ahead);
    if (!ok || !f.begun)
        frame_free(out);
    return ok;
}
