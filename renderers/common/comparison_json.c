/* SPDX-License-Identifier: Apache-2.0 */
/* The figures of a comparison as JSON; reports read this. */
#include "comparison_internal.h"

#include "atomic_file.h"

#include <stdlib.h>
#include <string.h>

void json_add_number(cJSON *object, const char *name, double value)
{
    if (isfinite(value))
        cJSON_AddNumberToObject(object, name, value);
    else
        cJSON_AddNullToObject(object, name);
}

void json_add_float(cJSON *object, const char *name, float value)
{
    char text[32];
    snprintf(text, sizeof text, "%.7g", (double)value);
    json_add_number(object, name, strtod(text, NULL));
}

/* Seeds need all of their 64 bits, more than a double has. */
static void add_whole(cJSON *object, const char *name, uint64_t value)
{
    char text[24];
    snprintf(text, sizeof text, "%llu", (unsigned long long)value);
    cJSON_AddRawToObject(object, name, text);
}

static void add_scene(cJSON *j, const comparison *c)
{
    const renderer *r = c->renderer;
    const program_arguments *a = c->arguments;
    const frame *f = comparison_frame(c);
    cJSON_AddStringToObject(j, "scene", r->scene->name);
    json_add_number(j, "triangles", (double)r->scene->triangle_count);
    json_add_number(j, "width", a->size.width);
    json_add_number(j, "height", a->size.height);
    json_add_number(j, "spp", a->spp);
    json_add_number(j, "eye_samples", (double)f->eye_samples);
    json_add_number(j, "threads", a->threads);
    json_add_float(j, "env_rotate", a->env_rotate);
    add_whole(j, "seed", a->seed);
    cJSON_AddStringToObject(j, "mode", r->mode);
    if (r->json)
        r->json(r->context, f, j);
    json_add_number(j, "runs", c->runs);
    cJSON_AddBoolToObject(j, "complete", f->complete && (c->runs > 0 || !frame_begun(&c->exact_frame)));
}

static cJSON *add_run(cJSON *j, const comparison *c, const char *name, times t, const frame *f)
{
    cJSON *run = cJSON_AddObjectToObject(j, name);
    json_add_number(run, "frame_s", t.frame_s);
    json_add_number(run, "shade_s", t.shade_s);
    if (c->renderer->json_run)
        c->renderer->json_run(c->renderer->context, f, run);
    return run;
}

static void add_differences(cJSON *j, const comparison *c)
{
    cJSON *error = cJSON_AddObjectToObject(j, "error");
    json_add_number(error, "l_inf", c->lit.l_inf);
    json_add_number(error, "l_inf_whole", c->whole.l_inf);
    json_add_number(error, "rel_mse", c->lit.rel_mse);
    json_add_number(error, "p999", c->lit.p999);
    json_add_number(error, "max", c->lit.max);
    json_add_number(error, "mean_relative", c->lit.mean_relative);
    json_add_number(error, "max_relative", c->lit.max_relative);
    json_add_number(error, "flip", c->flip);
    json_add_number(error, "mispredicted", c->mispredicted >= 0.0 ? c->mispredicted : (double)NAN);
    cJSON *s = cJSON_AddObjectToObject(j, "speedup");
    double low, high;
    json_add_number(s, "frame", comparison_ratio(c, false, &low, &high));
    json_add_number(s, "frame_min", low);
    json_add_number(s, "frame_max", high);
    json_add_number(s, "shade", comparison_ratio(c, true, &low, &high));
    cJSON *frames = cJSON_AddArrayToObject(s, "frames");
    for (int i = 0; i < c->runs; i++)
        cJSON_AddItemToArray(frames, cJSON_CreateNumber(c->exact[i].frame_s / c->mode[i].frame_s));
    json_add_number(s, "rays", comparison_ray_ratio(c));
}

static void add_reference_error(cJSON *reference, const char *name, const frame *f, const image_error *e, double flip)
{
    if (!f->complete)
        return;
    cJSON *j = cJSON_AddObjectToObject(reference, name);
    json_add_number(j, "l_inf", e->l_inf);
    json_add_number(j, "rel_mse", e->rel_mse);
    json_add_number(j, "p999", e->p999);
    json_add_number(j, "max", e->max);
    json_add_number(j, "flip", flip);
}

/* Frames as they are named in the whole; none where nothing is complete. */
static void add_reference(cJSON *j, const comparison *c)
{
    cJSON *reference = cJSON_AddObjectToObject(j, "reference");
    cJSON_AddStringToObject(reference, "file", c->arguments->reference);
    add_reference_error(reference, "exact", &c->exact_frame, &c->exact_reference, c->exact_reference_flip);
    add_reference_error(reference, "mode_run", &c->mode_frame, &c->mode_reference, c->mode_reference_flip);
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
        cJSON *run = add_run(j, c, "exact", comparison_exact(c), &c->exact_frame);
        json_add_number(run, "rays", (double)c->exact_frame.rays.traced);
    }
    if (frame_begun(m)) {
        cJSON *run = add_run(j, c, "mode_run", comparison_mode(c), m);
        json_add_number(run, "lights_s", m->lights_s);
        json_add_number(run, "rays_asked", (double)m->rays.asked);
        json_add_number(run, "rays_traced", (double)m->rays.traced);
        json_add_number(run, "cache_bytes", (double)m->cache_bytes);
    }
    if (c->runs)
        add_differences(j, c);
    if (c->arguments->reference)
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
