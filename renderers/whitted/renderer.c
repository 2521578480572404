/* SPDX-License-Identifier: Apache-2.0 */
#include "renderer.h"

const char *const visibility_names[] = {"exact",          "cache",       "estimate", "adaptive",
                                        "adaptive-cache", "grid[=NAME]", NULL};
const char *const store_names[] = {"rows", "words", NULL};
const char *const hash_names[] = {"split", "lcg-pair", "lcg-xorshift", NULL};
static const char *const mode_names[VISIBILITY_MODES] = {"exact",          "cache", "estimate",  "adaptive",
                                                         "adaptive-cache", "grid",  "selection", "cached-selection"};

static const settings *settings_of(const void *context)
{
    return &((const whitted *)context)->view.settings;
}

static bool render(void *context, const frame_request *wanted, frame *out, message *err)
{
    whitted *w = context;
    view v = w->view;
    v.settings.width = wanted->width;
    v.settings.height = wanted->height;
    truth *known = wanted->count ? &w->known : NULL;
    if (wanted->exact) {
        v.settings.visibility = VISIBILITY_EXACT;
        return frame_render(&v, wanted->title, wanted->quiet, known, NULL, out, err);
    }
    bool ok = frame_render(&v, wanted->title, wanted->quiet, NULL, known, out, err);
    truth_free(&w->known);
    return ok;
}

/* "adaptive 0.2 0.5": tolerance, and certainty where there is room. */
static void name_adaptive(const settings *s, visibility_mode served, char *out, size_t size)
{
    const char *mode = mode_names[s->visibility];
    if (served != s->visibility)
        snprintf(out, size, "%s: all", mode);
    else if (s->visibility == VISIBILITY_ADAPTIVE)
        snprintf(out, size, "%s %.3g %.2g", mode, (double)s->tolerance, (double)s->certainty);
    else
        snprintf(out, size, "%s %.2g", mode, (double)s->tolerance);
}

static void name(const void *context, const frame *f, char *out, size_t size)
{
    const settings *s = settings_of(context);
    if (s->visibility == VISIBILITY_CACHE)
        snprintf(out, size, "cache C_E %g", (double)s->ce);
    else if (adapts(s->visibility))
        name_adaptive(s, lights_of(f)->served, out, size);
    else if (estimates(s->visibility) && lights_of(f)->served == VISIBILITY_EXACT)
        snprintf(out, size, "%s: all", mode_names[s->visibility]);
    else if (estimates(s->visibility))
        snprintf(out, size, "%s %g", mode_names[s->visibility], (double)s->rays);
}

static void heading(const void *context, const frame *f, FILE *out)
{
    (void)context;
    print_count(out, lights_of(f)->vpls, "virtual point light");
    print_count(out, lights_of(f)->punctual, "punctual light");
    print_count(out, lights_of(f)->samples, "light sample");
}

static void json(const void *context, const frame *f, cJSON *out)
{
    const settings *s = settings_of(context);
    const frame_lights *l = lights_of(f);
    json_add_number(out, "lights", l->vpls + l->punctual + l->samples);
    json_add_number(out, "vpls", l->vpls);
    json_add_number(out, "vpl_draw", s->vpl_draw);
    json_add_number(out, "punctual_lights", l->punctual);
    json_add_number(out, "samples", l->samples);
    json_add_number(out, "env_samples", s->env_samples);
    json_add_number(out, "env_lights", s->env_lights);
    json_add_number(out, "light_samples", s->light_samples);
    cJSON_AddStringToObject(out, "served", mode_names[l->served]);
    json_add_float(out, "ce", s->ce);
    if (estimates(s->visibility))
        json_add_float(out, "select", s->rays);
    if (adapts(s->visibility)) {
        json_add_float(out, "tolerance", s->tolerance);
        json_add_float(out, "certainty", s->certainty);
    }
    json_add_float(out, "refine_above", s->refine_above);
    json_add_float(out, "ce_delta", s->ce_delta);
    json_add_float(out, "ce_samples", s->ce_samples);
    json_add_number(out, "cn", s->cache.normal_bins);
    json_add_number(out, "cz", s->cache.layers);
    json_add_float(out, "cr", s->cache.resolution_step);
    json_add_number(out, "refine", s->cache.levels);
    cJSON_AddStringToObject(out, "hash", hash_names[s->cache.hash]);
    cJSON_AddStringToObject(out, "store", store_names[s->words]);
    cJSON_AddBoolToObject(out, "shared", s->shared);
    json_add_number(out, "cache_mb", (double)(s->cache.table_bytes >> 20));
}

static void json_run(const void *context, const frame *f, cJSON *out)
{
    const grid_figures *g = &lights_of(f)->grid;
    (void)context;
    if (!estimates(lights_of(f)->served))
        json_add_number(out, "visibility_s", lights_of(f)->visibility_s);
    if (lights_of(f)->served != VISIBILITY_GRID)
        return;
    json_add_number(out, "rays_s", g->rays_s);
    json_add_number(out, "rays_coarse", (double)g->coarse);
    json_add_number(out, "rays_silhouette", (double)g->silhouette);
    json_add_number(out, "rays_uncertain", (double)g->uncertain);
    json_add_number(out, "rays_flooded", (double)g->flooded);
    json_add_number(out, "surprises", (double)g->surprises);
    json_add_number(out, "batches", (double)g->batches);
}

static void texts(const void *context, const frame *f, bool exact, image_texts *out)
{
    const settings *s = settings_of(context);
    visibility_mode mode = exact ? VISIBILITY_EXACT : s->visibility;
    image_text(out, "vpls", "%u", lights_of(f)->vpls);
    image_text(out, "lightSamples", "%d", s->light_samples);
    image_text(out, "envSamples", "%d", s->env_samples);
    image_text(out, "served", "%s", mode_names[lights_of(f)->served]);
    if (estimates(mode))
        image_text(out, "select", "%g", (double)s->rays);
    if (adapts(mode)) {
        image_text(out, "tolerance", "%g", (double)s->tolerance);
        image_text(out, "certainty", "%g", (double)s->certainty);
    }
    if (!uses_cache(mode))
        return;
    image_text(out, "ce", "%g", (double)s->ce);
    image_text(out, "ceDelta", "%g", (double)s->ce_delta);
    image_text(out, "ceSamples", "%g", (double)s->ce_samples);
    image_text(out, "normalBins", "%d", s->cache.normal_bins);
    image_text(out, "layers", "%d", s->cache.layers);
    image_text(out, "resolutionStep", "%g", (double)s->cache.resolution_step);
    image_text(out, "levels", "%d", s->cache.levels);
    image_text(out, "hash", "%s", hash_names[s->cache.hash]);
    image_text(out, "cacheBytes", "%llu", (unsigned long long)f->cache_bytes);
}

/* Whether one bit for each pair of eye sample and light can be kept. */
static bool truth_fits(const view *v)
{
    const settings *s = &v->settings;
    uint64_t lights = (uint64_t)s->vpls + v->scene->light_count + direct_sample_count(v);
    return (uint64_t)s->width * s->height * (uint64_t)s->spp <= memory_budget() / (lights / 8 + 24);
}

static bool has_directional_light(const scene *s)
{
    for (uint32_t i = 0; i < s->light_count; i++)
        if (s->lights[i].kind == LIGHT_DIRECTIONAL)
            return true;
    return false;
}

renderer whitted_renderer(whitted *w, bool compare)
{
    /* an estimate predicts no single ray, nor what is left untested */
    visibility_mode mode = w->view.settings.visibility;
    bool wanted = compare && !estimates(mode) && !adapts(mode), fits = wanted && truth_fits(&w->view);
    if (wanted && !fits)
        notice("too many pairs to keep a record of: mispredictions are not counted");
    if (mode == VISIBILITY_GRID && !has_directional_light(w->view.scene))
        notice("--visibility grid decides directional lights, and there is none (--env-lights): all is traced");
    return (renderer){.context = w,
                      .scene = w->view.scene,
                      .mode = mode_names[w->view.settings.visibility],
                      .mispredictions = fits,
                      .render = render,
                      .name = name,
                      .heading = heading,
                      .json = json,
                      .json_run = json_run,
                      .texts = texts};
}
