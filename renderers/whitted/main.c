/* SPDX-License-Identifier: Apache-2.0 */
/* whitted: command line and scene. */
#include "renderer.h"

#include "../common/environment_lights.h"
#include "../common/light_sources.h"

#include <string.h>

typedef struct arguments {
    program_arguments common;
    int visibility, store, hash, cache_mb;
    const char *grid; /* NAME of --visibility grid=NAME */
    bool shared;
    bool select_given, adaptive_given; /* --select; --tolerance or --certainty */
    settings settings;
} arguments;

/* -1: what suits the other settings. */
static arguments defaults(void)
{
    arguments a = {.common = program_defaults("whitted"), .visibility = -1, .cache_mb = 4};
    settings *s = &a.settings;
    s->vpls = 1024;
    s->env_samples = s->light_samples = -1;
    s->rays = -1.0f;
    s->refine_above = 0.5f;
    s->ce = -1.0f;
    s->ce_delta = -1.0f;
    s->tolerance = s->certainty = -1.0f;
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
        {.name = "spp", .kind = OPTION_INT, .value = &p->spp, .min = 1, .max = 4096, .help = "eye paths per pixel"},
        {.name = "vpls", .kind = OPTION_INT, .value = &s->vpls, .min = 0, .max = 65536,
         .help = "virtual point lights"},
        {.name = "vpl-draw", .kind = OPTION_INT, .value = &s->vpl_draw, .min = 0, .max = 1000000, .metavar = "N",
         .help = "which draw of them; eye paths stay"},
        PROGRAM_OPTIONS_ENV(p),
        {.name = "env-samples", .kind = OPTION_INT, .value = &s->env_samples, .min = 0, .max = 4096,
         .shown = "8 / sqrt(spp)", .help = "environment samples per path"},
        {.name = "env-lights", .kind = OPTION_INT, .value = &s->env_lights, .min = 0, .max = 4096,
         .help = "the environment as N directional lights"},
        {.name = "light-samples", .kind = OPTION_INT, .value = &s->light_samples, .min = 0, .max = 4096,
         .shown = "8 / sqrt(spp)", .help = "samples of emissive surfaces per eye path"},
        PROGRAM_OPTIONS_CAMERA(p),
        {.name = "visibility", .kind = OPTION_CHOICE, .value = &a->visibility, .choices = visibility_names,
         .detail = &a->grid, .metavar = "MODE", .shown = "cache",
         .help = "exact, cache, estimate, adaptive[-cache], grid[=NAME]"},
        {.name = "select", .kind = OPTION_FLOAT, .value = &s->rays, .min = 0.1, .max = 1000, .metavar = "K",
         .shown = "all; estimate 96 / spp, 1 or more", .help = "lights drawn per eye path"},
        {.name = "tolerance", .kind = OPTION_FLOAT, .value = &s->tolerance, .min = 0, .max = 1000, .metavar = "T",
         .shown = "0.1", .help = "adaptive: lights below T of the rest go untested"},
        {.name = "certainty", .kind = OPTION_FLOAT, .value = &s->certainty, .min = 0, .max = 1, .metavar = "C",
         .shown = "0.5", .help = "adaptive: share of the lights that are looked at together"},
        {.name = "ce", .kind = OPTION_FLOAT, .value = &s->ce, .min = 0.01, .max = 10000, .metavar = "X",
         .shown = "8; estimate 12", .help = "C_E of virtual lights: eye samples a cell side"},
        {.name = "ce-delta", .kind = OPTION_FLOAT, .value = &s->ce_delta, .min = 0, .max = 10000, .metavar = "X",
         .shown = "a pixel; 0 if few", .help = "C_E of punctual lights; 0: they are traced"},
        {.name = "ce-samples", .kind = OPTION_FLOAT, .value = &s->ce_samples, .min = 0, .max = 10000, .metavar = "X",
         .help = "C_E of area and environment samples; 0: they are traced"},
        {.name = "cn", .kind = OPTION_INT, .value = &c->normal_bins, .min = 1, .max = 64,
         .help = "C_N: bins of the normal per axis"},
        {.name = "cz", .kind = OPTION_INT, .value = &c->layers, .min = 1, .max = 64,
         .help = "C_Z: layers per cell side"},
        {.name = "cr", .kind = OPTION_FLOAT, .value = &c->resolution_step, .min = 1.05, .max = 16, .metavar = "X",
         .help = "C_R: ratio of successive resolutions"},
        {.name = "refine", .kind = OPTION_INT, .value = &c->levels, .min = 0, .max = VCACHE_MAX_LEVELS,
         .help = "C_MSR: levels of refinement, 1 for none, 0 for log2 C_E"},
        {.name = "refine-above", .kind = OPTION_FLOAT, .value = &s->refine_above, .min = 0, .max = 1000, .metavar = "X",
         .help = "lights below X times the mean are refined in the dark only"},
        {.name = "cache-mb", .kind = OPTION_INT, .value = &a->cache_mb, .min = 1, .max = 16384,
         .help = "size of each cache in MiB"},
        {.name = "shared", .kind = OPTION_FLAG, .value = &a->shared, 
         .help = "one cache for all threads; adaptive: hit rates at once"},
        {.name = "store", .kind = OPTION_CHOICE, .value = &a->store, .choices = store_names,
         .help = "answers as rows of light bits or as 32-bit words"},
        {.name = "hash", .kind = OPTION_CHOICE, .value = &a->hash, .choices = hash_names, .metavar = "H",
         .help = "hash family: split, lcg-pair or lcg-xorshift"},
        PROGRAM_OPTIONS_RUN(p),
    };
    options_status status =
        program_parse(p, "Whitted ray tracing with instant radiosity, shadows exact or by the visibility cache.", table,
                      sizeof table / sizeof *table, argc, argv, err);
    s->width = p->size.width;
    s->height = p->size.height;
    s->spp = p->spp;
    s->threads = p->threads;
    s->seed = p->seed;
    const vcache_adaptive_config usual = vcache_adaptive_default_config();
    a->adaptive_given = s->tolerance >= 0.0f || s->certainty >= 0.0f;
    s->tolerance = s->tolerance < 0.0f ? usual.tolerance : s->tolerance;
    s->certainty = s->certainty < 0.0f ? usual.certainty : s->certainty;
    bool select = a->select_given = s->rays >= 0.0f;
    if (a->visibility < 0)
        a->visibility = select ? VISIBILITY_ESTIMATE : VISIBILITY_CACHE;
    s->visibility = (visibility_mode)a->visibility;
    if (select && !adapts(s->visibility) && s->visibility != VISIBILITY_ESTIMATE && s->visibility != VISIBILITY_GRID)
        s->visibility = s->visibility == VISIBILITY_CACHE ? VISIBILITY_SELECT_BY_CACHE : VISIBILITY_SELECT;
    s->shared = a->shared;
    s->words = a->store == 1;
    if (s->ce < 0.0f)
        s->ce = estimates(s->visibility) ? 12.0f : 8.0f;
    if (s->rays < 0.0f) /* about the same error with any number of paths */
        s->rays = fmaxf(1.0f, 96.0f / (float)s->spp);
    int samples = (int)ceilf(8.0f / sqrtf((float)s->spp));
    s->env_samples = s->env_samples >= 0 ? s->env_samples : s->env_lights > 0 ? 0 : samples;
    s->light_samples = s->light_samples < 0 ? samples : s->light_samples;
    c->hash = (vcache_hash)a->hash; /* in the order of hash_names */
    c->table_bytes = (uint64_t)a->cache_mb << 20;
    s->lattice = s->visibility == VISIBILITY_GRID;
    return status;
}

/* What whitted adds to program_check; reads the grid's mode. */
static bool check(arguments *a, message *err)
{
    settings *s = &a->settings;
    if (a->adaptive_given && !adapts(s->visibility))
        return fail(err, "--tolerance and --certainty need --visibility adaptive or adaptive-cache");
    if (a->select_given && (s->lattice || adapts(s->visibility)))
        return fail(err, "--select draws lights: not with --visibility %s", s->lattice ? "grid" : visibility_names[s->visibility]);
    if (s->lattice && !grid_parse(a->grid, s, err))
        return false;
    if (s->env_lights > 0 && s->env_samples > 0)
        return fail(err, "--env-lights stand for the environment: --env-samples must be 0");
    if (s->lattice && !grid_samples_fit(s->spp))
        return fail(err, "--visibility grid: --spp must be a square, at most %d", PASS);
    if (estimates(s->visibility) && (s->words || s->ce_delta > 0.0f || s->ce_samples > 0.0f))
        return fail(err, "%s does without --store words, --ce-delta and --ce-samples",
                    s->visibility == VISIBILITY_ESTIMATE ? "--visibility estimate" : "--select");
    return true;
}

static bool load_scene(const arguments *a, scene **out, message *err)
{
    if (!program_load_scene(&a->common, out, err))
        return false;
    if (a->settings.env_lights > 0 && !(*out)->environment)
        return fail(err, "--env-lights: the scene has no environment; --env gives it one");
    if (a->settings.env_lights > 0)
        scene_add_environment_lights(*out, a->settings.env_lights);
    return scene_finish(*out, err);
}

/* Hard shadows show every cell that is larger than a pixel. Where there is nothing to share in one, or their rays do
 * not count beside the others, they are traced. */
static float hard_shadow_ce(const scene *s, const settings *f)
{
    bool few = (uint64_t)64 * s->light_count <= (uint64_t)f->vpls;
    return f->spp == 1 || few ? 0.0f : sqrtf((float)f->spp);
}

int main(int argc, char *argv[])
{
    arguments a = defaults();
    message err = {0};
    options_status status = parse(&a, argc, argv, &err);
    if (status != OPTIONS_OK || !program_check(&a.common, &err) || !check(&a, &err))
        return program_stop(&a.common, status, &err);
    whitted w = {.view = {.settings = a.settings}};
    view *v = &w.view;
    scene *s = NULL;
    tracer *t = NULL;
    emitters *e = NULL;
    image reference;
    bool ok = program_begin(&a.common, frame_bytes(&a.settings), &reference, &err) && load_scene(&a, &s, &err) &&
              program_choose_camera(&a.common, s, &v->camera, &err) && tracer_create(s, a.common.threads, &t, &err);
    if (ok) {
        if (v->settings.ce_delta < 0.0f)
            v->settings.ce_delta = hard_shadow_ce(s, &v->settings);
        v->scene = s;
        v->tracer = t;
        v->emitters = e = emitters_new(s);
        const float low[3] = {s->bounds_min.x, s->bounds_min.y, s->bounds_min.z};
        const float high[3] = {s->bounds_max.x, s->bounds_max.y, s->bounds_max.z};
        memcpy(v->settings.cache.bounds_min, low, sizeof low);
        memcpy(v->settings.cache.bounds_max, high, sizeof high);
        light_sources *lights = v->settings.vpls > 0 ? light_sources_new(s, e, !v->settings.env_lights) : NULL;
        if (lights && !light_sources_finite(lights))
            notice("no virtual point lights: the power of all lights is beyond what floats hold");
        light_sources_free(lights);
        renderer r = whitted_renderer(&w, a.common.compare);
        ok = renderer_run(&r, &a.common, &reference, &err);
        truth_free(&w.known);
    }
    image_free(&reference);
    emitters_free(e);
    tracer_free(t);
    scene_free(s);
    return program_end(&a.common, ok, &err);
}
