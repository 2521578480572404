/* SPDX-License-Identifier: Apache-2.0 */
/* The figures of a comparison as JSON; reports read this. */
#include "compare.h"

#include "../common/atomic_file.h"

#include <cjson/cJSON.h>
#include <string.h>

static void number(cJSON *object, const char *name, double value)
{
    /* JSON has no infinity */
    if (isfinite(value))
        cJSON_AddNumberToObject(object, name, value);
    else
        cJSON_AddNullToObject(object, name);
}

/* Seeds need all of their 64 bits, more than a double has. */
static void whole(cJSON *object, const char *name, uint64_t value)
{
    char text[24];
    snprintf(text, sizeof text, "%llu", (unsigned long long)value);
    cJSON_AddRawToObject(object, name, text);
}

/* The shortest decimal number, as it was given. */
static void setting(cJSON *object, const char *name, float value)
{
    char text[32];
    snprintf(text, sizeof text, "%.7g", (double)value);
    number(object, name, strtod(text, NULL));
}

static void add_scene(cJSON *j, const comparison *c)
{
    const settings *f = &c->view->settings;
    const frame *m = comparison_frame(c);
    cJSON_AddStringToObject(j, "scene", c->view->scene->name);
    number(j, "triangles", (double)c->view->scene->triangle_count);
    number(j, "width", f->width);
    number(j, "height", f->height);
    number(j, "spp", f->spp);
    number(j, "lights", m->vpls + m->punctual + m->samples);
    number(j, "vpls", m->vpls);
    number(j, "punctual_lights", m->punctual);
    number(j, "samples", m->samples);
    number(j, "env_samples", f->env_samples);
    number(j, "env_lights", f->env_lights);
    number(j, "light_samples", f->light_samples);
    number(j, "eye_samples", (double)m->eye_samples);
    number(j, "threads", f->threads);
    whole(j, "seed", f->seed);
    cJSON_AddStringToObject(j, "mode", mode_names[f->visibility]);
    cJSON_AddStringToObject(j, "served", mode_names[m->served]);
    setting(j, "ce", f->ce);
    if (estimates(f->visibility))
        setting(j, "select", f->rays);
    setting(j, "refine_above", f->refine_above);
    setting(j, "ce_delta", f->ce_delta);
    setting(j, "ce_samples", f->ce_samples);
    number(j, "cn", f->cache.normal_bins);
    number(j, "cz", f->cache.layers);
    setting(j, "cr", f->cache.resolution_step);
    number(j, "refine", f->cache.levels);
    cJSON_AddStringToObject(j, "hash", hash_names[f->cache.hash]);
    cJSON_AddStringToObject(j, "store", store_names[f->words]);
    cJSON_AddBoolToObject(j, "shared", f->shared);
    number(j, "cache_mb", (double)(f->cache.table_bytes >> 20));
    number(j, "runs", c->runs);
    cJSON_AddBoolToObject(j, "complete", m->complete && (c->runs > 0 || !frame_begun(&c->exact_frame)));
}

static void add_reference_error(cJSON *reference, const char *name, const frame *f, const image_error *e)
{
    if (!f->complete)
        return;
    cJSON *j = cJSON_AddObjectToObject(reference, name);
    number(j, "l_inf", e->l_inf);
    number(j, "rel_mse", e->rel_mse);
    number(j, "p999", e->p999);
    number(j, "max", e->max);
}

/* Frames as they are named in the whole; none where nothing is complete. */
static void add_reference(cJSON *j, const comparison *c)
{
    cJSON *reference = cJSON_AddObjectToObject(j, "reference");
    cJSON_AddStringToObject(reference, "file", c->reference);
    add_reference_error(reference, "exact", &c->exact_frame, &c->exact_reference);
    add_reference_error(reference, "mode_run", &c->mode_frame, &c->mode_reference);
}

static bool text_save(const char *path, const char *text, message *err)
{
    atomic_file f;
    if (!atomic_open(&f, path, err))
        return false;
    fprintf(f.stream, "%s\n", text);
    return atomic_commit(&f, err);
}

bool comparison_json(const comparison *c, const char *path, message *err)
{
    const frame *m = &c->mode_frame;
    cJSON *j = cJSON_CreateObject();
    add_scene(j, c);
    if (c->runs) {
        times exact = comparison_median(c->exact, c->runs);
        cJSON *e = cJSON_AddObjectToObject(j, "exact");
        number(e, "frame_s", exact.frame_s);
        number(e, "shade_s", exact.shade_s);
        number(e, "rays", (double)c->exact_frame.rays.traced);
    }
    if (frame_begun(m)) {
        times t = c->runs ? comparison_median(c->mode, c->runs) : (times){m->frame_s, m->shade_s};
        cJSON *run = cJSON_AddObjectToObject(j, "mode_run");
        number(run, "frame_s", t.frame_s);
        number(run, "shade_s", t.shade_s);
        number(run, "lights_s", m->lights_s);
        number(run, "rays_asked", (double)m->rays.asked);
        number(run, "rays_traced", (double)m->rays.traced);
        number(run, "cache_bytes", (double)m->cache_bytes);
    }
    if (c->runs) {
        cJSON *error = cJSON_AddObjectToObject(j, "error");
        number(error, "l_inf", c->lit.l_inf);
        number(error, "l_inf_whole", c->whole.l_inf);
        number(error, "rel_mse", c->lit.rel_mse);
        number(error, "p999", c->lit.p999);
        number(error, "max", c->lit.max);
        number(error, "mispredicted", c->mispredicted >= 0.0 ? c->mispredicted : (double)NAN);
        cJSON *s = cJSON_AddObjectToObject(j, "speedup");
        double low, high;
        number(s, "frame", comparison_ratio(c, false, &low, &high));
        number(s, "frame_min", low);
        number(s, "frame_max", high);
        number(s, "shade", comparison_ratio(c, true, &low, &high));
        cJSON *frames = cJSON_AddArrayToObject(s, "frames");
        for (int i = 0; i < c->runs; i++)
            cJSON_AddItemToArray(frames, cJSON_CreateNumber(c->exact[i].frame_s / c->mode[i].frame_s));
        number(s, "rays", m->rays.traced ? (double)c->exact_frame.rays.traced / (double)m->rays.traced : 1.0);
    }
    if (c->reference)
        add_reference(j, c);
    char *text = cJSON_Print(j);
    cJSON_Delete(j);
    if (!text)
        return fail(err, "%s: out of memory", path);
    bool ok;
    if (strcmp(path, "-") == 0)
        ok = puts(text) >= 0 && fflush(stdout) == 0 ? true : fail(err, "standard output: cannot write");
    else
        ok = text_save(path, text, err);
    cJSON_free(text);
    return ok;
}
