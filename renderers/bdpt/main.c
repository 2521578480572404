/* SPDX-License-Identifier: Apache-2.0 */
/* bdpt: command line and scene. */
#include "resume.h"

#include <string.h>

static const char *const visibility_names[] = {"exact", "cache", "estimate", NULL};
static const char *const heuristic_names[] = {"balance", "power", NULL};

typedef struct arguments {
    program_arguments common;
    int visibility, heuristic, cache_mb;
    float seconds;
    const char *resume;
    settings settings;
} arguments;

static arguments defaults(void)
{
    arguments a = {.common = program_defaults("bdpt"), .visibility = VISIBILITY_CACHE, .heuristic = HEURISTIC_POWER};
    a.common.spp = 16;
    a.cache_mb = 1024;
    settings *s = &a.settings;
    s->epoch = 16;
    s->ce = 12.0f;
    s->light_vertices = -1;
    s->partners = 4;
    s->rays = 0.25f;
    s->cache = vcache_default_config();
    return a;
}

static options_status parse(arguments *a, int argc, char *argv[], message *err)
{
    program_arguments *p = &a->common;
    settings *s = &a->settings;
    vcache_config *c = &s->cache;
    const option table[] = {
        PROGRAM_OPTION_SIZE(p),
        {.name = "spp", .kind = OPTION_INT, .value = &p->spp, .min = 1, .max = 1 << 20,
         .help = "pairs of eye and light paths per pixel"},
        {.name = "time", .kind = OPTION_FLOAT, .value = &a->seconds, .min = 0, .max = 1e9, .metavar = "S", .shown = "none",
         .help = "begin no pass (1 spp) after S seconds"},
        {.name = "epoch", .kind = OPTION_INT, .value = &s->epoch, .min = 1, .max = 1 << 20, .metavar = "K",
         .help = "passes that share what the cache has learnt"},
        {.name = "resume", .kind = OPTION_STRING, .value = &a->resume, .metavar = "FILE",
         .help = "go on from an .exr that bdpt wrote with these options"},
        PROGRAM_OPTIONS_ENV(p),
        PROGRAM_OPTIONS_CAMERA(p),
        {.name = "visibility", .kind = OPTION_CHOICE, .value = &a->visibility, .choices = visibility_names,
         .metavar = "MODE", .help = "of connections: exact, cache or estimate (no bias)"},
        {.name = "trace", .kind = OPTION_FLOAT, .value = &s->rays, .min = 0.01, .max = 1, .metavar = "X",
         .help = "of estimates: share of the connections that is traced"},
        {.name = "ce", .kind = OPTION_FLOAT, .value = &s->ce, .min = 0.01, .max = 10000, .metavar = "X",
         .help = "C_E: root of the connections per pair of cells (Eq. 6)"},
        {.name = "cn", .kind = OPTION_INT, .value = &c->normal_bins, .min = 1, .max = 64,
         .help = "C_N: bins of the normal per axis"},
        {.name = "cz", .kind = OPTION_INT, .value = &c->layers, .min = 1, .max = 64,
         .help = "C_Z: layers per cell side"},
        {.name = "cr", .kind = OPTION_FLOAT, .value = &c->resolution_step, .min = 1.05, .max = 16, .metavar = "X",
         .help = "C_R: ratio of successive resolutions"},
        {.name = "cache-mb", .kind = OPTION_INT, .value = &a->cache_mb, .min = 1, .max = 16384,
         .help = "most MiB of the cache, which all threads share"},
        {.name = "partners", .kind = OPTION_INT, .value = &s->partners, .min = 1, .max = BATCH, .metavar = "M",
         .help = "light paths that each eye path is connected to"},
        {.name = "heuristic", .kind = OPTION_CHOICE, .value = &a->heuristic, .choices = heuristic_names,
         .help = "weights of strategies"},
        {.name = "edges", .kind = OPTION_INT, .value = &s->edges, .min = 0, .max = EDGES_MAX, .metavar = "N",
         .shown = "all", .help = "paths of N edges alone"},
        {.name = "strategy", .kind = OPTION_INT, .value = &s->light_vertices, .min = -1, .max = EDGES_MAX, .metavar = "S",
         .shown = "all", .help = "paths with S light vertices alone, unweighted"},
        {.name = "deterministic", .kind = OPTION_FLAG, .value = &s->deterministic,
         .help = "the picture of one thread, bit for bit, from any number"},
        PROGRAM_OPTIONS_RUN(p),
    };
    options_status status =
        program_parse(p, "Bidirectional path tracing, connections exact or by the visibility cache.", table,
                      sizeof table / sizeof *table, argc, argv, err);
    s->width = p->size.width;
    s->height = p->size.height;
    s->spp = p->spp;
    s->threads = p->threads;
    s->seed = p->seed;
    s->seconds = a->seconds > 0.0f ? (double)a->seconds : INFINITY;
    s->visibility = (visibility_mode)a->visibility;
    s->heuristic = (heuristic)a->heuristic;
    c->table_bytes = (uint64_t)a->cache_mb << 20;
    return status;
}

static bool check(const arguments *a, message *err)
{
    if (a->resume && a->common.compare)
        return fail(err, "--resume goes on with one rendering: not with --compare");
    return true;
}

/* ------------------------------------------------------------------------------------------------ the renderer */

typedef struct bdpt {
    view view;
    camera camera;
    film start; /* to go on from; no passes: nothing */
    uint64_t not_finite; /* of the last frame */
} bdpt;

static const settings *settings_of(const void *context)
{
    return &((const bdpt *)context)->view.settings;
}

static bool render(void *context, const frame_request *wanted, frame *out, message *err)
{
    bdpt *b = context;
    view v = b->view;
    v.settings.width = wanted->width;
    v.settings.height = wanted->height;
    v.camera = camera_frame_of(&b->camera, wanted->width, wanted->height);
    if (wanted->exact)
        v.settings.visibility = VISIBILITY_EXACT;
    bool ok = bdpt_render(&v, b->start.passes ? &b->start : NULL, wanted->title, wanted->quiet, out, err);
    b->not_finite = out->extra ? passes_of(out)->not_finite : 0;
    return ok;
}

static void name(const void *context, const frame *f, char *out, size_t size)
{
    const settings *s = settings_of(context);
    (void)f;
    if (s->visibility == VISIBILITY_CACHE)
        snprintf(out, size, "cache C_E %g", (double)s->ce);
    else if (s->visibility == VISIBILITY_ESTIMATE)
        snprintf(out, size, "estimate %g", (double)s->rays);
}

static void heading(const void *context, const frame *f, FILE *out)
{
    (void)context;
    print_count(out, passes_of(f)->camera_rays, "camera ray");
}

static void json(const void *context, const frame *f, cJSON *out)
{
    const settings *s = settings_of(context);
    (void)f;
    json_add_number(out, "epoch", s->epoch);
    cJSON_AddStringToObject(out, "heuristic", heuristic_names[s->heuristic]);
    json_add_float(out, "ce", s->ce);
    json_add_float(out, "trace", s->rays);
    json_add_number(out, "partners", s->partners);
    json_add_number(out, "cn", s->cache.normal_bins);
    json_add_number(out, "cz", s->cache.layers);
    json_add_float(out, "cr", s->cache.resolution_step);
    json_add_number(out, "cache_mb", (double)(s->cache.table_bytes >> 20));
    cJSON_AddBoolToObject(out, "deterministic", s->deterministic);
    json_add_number(out, "edges", s->edges);
    json_add_number(out, "strategy", s->light_vertices);
}

static void json_run(const void *context, const frame *f, cJSON *out)
{
    (void)context;
    json_add_number(out, "passes", passes_of(f)->passes);
    json_add_number(out, "camera_rays", (double)passes_of(f)->camera_rays);
    json_add_number(out, "not_finite", (double)passes_of(f)->not_finite);
    json_add_number(out, "asking_s", passes_of(f)->asking_s);
}

static void texts(const void *context, const frame *f, bool exact, image_texts *out)
{
    settings s = *settings_of(context);
    if (exact)
        s.visibility = VISIBILITY_EXACT;
    resume_texts(&((const bdpt *)context)->view, &s, passes_of(f)->passes, out);
}

int main(int argc, char *argv[])
{
    arguments a = defaults();
    message err = {0};
    options_status status = parse(&a, argc, argv, &err);
    if (status != OPTIONS_OK || !program_check(&a.common, &err) || !check(&a, &err))
        return program_stop(&a.common, status, &err);
    bdpt b = {.view = {.settings = a.settings}};
    view *v = &b.view;
    scene *s = NULL;
    tracer *t = NULL;
    emitters *e = NULL;
    light_sources *l = NULL;
    image reference;
    bool ok = program_begin(&a.common, bdpt_frame_bytes(&v->settings), &reference, &err) &&
              program_load_scene(&a.common, &s, &err) && scene_finish(s, &err) &&
              program_choose_camera(&a.common, s, &b.camera, &err) && tracer_create(s, a.common.threads, &t, &err);
    if (ok) {
        e = emitters_new(s);
        l = light_sources_new(s, e, true);
        view_set(v, s, t, l, &b.camera);
        ok = !a.resume || resume_load(a.resume, v, &b.start, &err);
    }
    if (ok) {
        renderer r = {.context = &b,
                      .scene = s,
                      .mode = visibility_names[a.visibility],
                      .render = render,
                      .name = name,
                      .heading = heading,
                      .json = json,
                      .json_run = json_run,
                      .texts = texts};
        ok = renderer_run(&r, &a.common, &reference, &err);
        if (ok && b.not_finite > 0)
            notice("%llu contributions are left out: light or scale is beyond what floats hold",
                   (unsigned long long)b.not_finite);
    }
    image_free(&reference);
    film_free(&b.start);
    light_sources_free(l);
    emitters_free(e);
    tracer_free(t);
    scene_free(s);
    return program_end(&a.common, ok, &err);
}
