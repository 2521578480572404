/* SPDX-License-Identifier: Apache-2.0 */
/* whitted: command line, scene, runs, files. */
#include "compare.h"

#include "../common/interrupt.h"
#include "../common/options.h"
#include "../common/parallel.h"

#include <libgen.h>
#include <signal.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

typedef struct arguments {
    const char *scene, *env, *json, *picture, *reference;
    option_size size;
    option_list outputs;
    float look[7]; /* the last is NaN where it is not given */
    int camera, visibility, store, hash, cache_mb;
    int runs; /* 0: not given */
    bool compare, half, tiles, quiet, shared;
    settings settings;
} arguments;

/* -1: what suits the other settings. */
static arguments defaults(void)
{
    arguments a = {.scene = "atrium", .size = {640, 360}, .visibility = -1, .cache_mb = 4};
    a.look[6] = NAN;
    settings *s = &a.settings;
    s->spp = 1;
    s->vpls = 1024;
    s->env_samples = s->light_samples = -1;
    s->rays = -1.0f;
    s->refine_above = 0.5f;
    s->ce = -1.0f;
    s->ce_delta = -1.0f;
    s->cache = vcache_default_config();
    return a;
}

static options_status parse(arguments *a, int argc, char *argv[], message *err)
{
    settings *s = &a->settings;
    vcache_config *c = &s->cache;
    const option table[] = {
        {.name = "size", .kind = OPTION_SIZE, .value = &a->size, .help = "image size in pixels"},
        {.name = "spp", .kind = OPTION_INT, .value = &s->spp, .min = 1, .max = 4096, .help = "eye paths per pixel"},
        {.name = "vpls", .kind = OPTION_INT, .value = &s->vpls, .min = 0, .max = 65536,
         .help = "virtual point lights"},
        {.name = "env", .kind = OPTION_STRING, .value = &a->env, .metavar = "FILE",
         .help = "environment map (.hdr, .exr) in place of the scene's"},
        {.name = "env-samples", .kind = OPTION_INT, .value = &s->env_samples, .min = 0, .max = 4096,
         .shown = "8 / sqrt(spp)", .help = "environment samples per path"},
        {.name = "env-lights", .kind = OPTION_INT, .value = &s->env_lights, .min = 0, .max = 4096,
         .help = "the environment as N directional lights"},
        {.name = "light-samples", .kind = OPTION_INT, .value = &s->light_samples, .min = 0, .max = 4096,
         .shown = "8 / sqrt(spp)", .help = "samples of emissive surfaces per eye path"},
        {.name = "camera", .kind = OPTION_INT, .value = &a->camera, .min = 0, .max = 65535, .metavar = "I",
         .help = "camera of the scene, from 0"},
        {.name = "look", .kind = OPTION_FLOATS, .value = a->look, .count = 7, .min = -3e38, .max = 3e38,
         .shown = "", .metavar = "EX,EY,EZ,AX,AY,AZ,FOV",
         .help = "camera at E that looks at A, vertical FOV in degrees"},
        {.name = "visibility", .kind = OPTION_CHOICE, .value = &a->visibility, .choices = visibility_names,
         .metavar = "MODE", .shown = "cache; with --select estimate", .help = "exact, cache or estimate"},
        {.name = "select", .kind = OPTION_FLOAT, .value = &s->rays, .min = 0.1, .max = 1000, .metavar = "K",
         .shown = "all; estimate 96 / spp, 1 or more", .help = "lights drawn per eye path"},
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
         .help = "lights below X times the mean are not refined"},
        {.name = "cache-mb", .kind = OPTION_INT, .value = &a->cache_mb, .min = 1, .max = 16384,
         .help = "size of each cache in MiB"},
        {.name = "shared", .kind = OPTION_FLAG, .value = &a->shared, .help = "one cache for all threads"},
        {.name = "store", .kind = OPTION_CHOICE, .value = &a->store, .choices = store_names,
         .help = "answers as rows of light bits or as 32-bit words"},
        {.name = "hash", .kind = OPTION_CHOICE, .value = &a->hash, .choices = hash_names, .metavar = "H",
         .help = "hash family: split, lcg-pair or lcg-xorshift"},
        {.name = "compare", .kind = OPTION_FLAG, .value = &a->compare,
         .help = "render exactly as well and print times and errors"},
        {.name = "runs", .kind = OPTION_INT, .value = &a->runs, .min = 1, .max = RUNS_MAX, .shown = "1",
         .help = "pairs of timed frames with --compare (medians)"},
        {.name = "threads", .kind = OPTION_INT, .value = &s->threads, .min = 0, .max = PARALLEL_MAX_THREADS,
         .help = "threads, 0 for one per CPU"},
        {.name = "seed", .kind = OPTION_UINT64, .value = &s->seed, .help = "seed of all random numbers"},
        {.name = "output", .letter = 'o', .kind = OPTION_LIST, .value = &a->outputs, .metavar = "FILE",
         .help = "image to write: .exr with all layers, or .png (repeatable)"},
        {.name = "picture", .kind = OPTION_STRING, .value = &a->picture, .metavar = "FILE",
         .help = "with --compare: exact, chosen and 8 x error in one .png"},
        {.name = "reference", .kind = OPTION_STRING, .value = &a->reference, .metavar = "FILE",
         .help = "print the error against this .exr as well"},
        {.name = "half", .kind = OPTION_FLAG, .value = &a->half, .help = "16-bit floats in .exr"},
        {.name = "tiles", .kind = OPTION_FLAG, .value = &a->tiles, .help = "tiles instead of scan lines in .exr"},
        {.name = "json", .kind = OPTION_STRING, .value = &a->json, .metavar = "FILE",
         .help = "figures as JSON; - for standard output"},
        {.name = "quiet", .kind = OPTION_FLAG, .value = &a->quiet, .help = "no progress, no notices, no table"},
    };
    const option_program program = {
        .name = "whitted",
        .summary = "Whitted ray tracing with instant radiosity, shadows exact or by the visibility cache.",
        .positional = "[SCENE]",
        .positional_help = "a .glb, .gltf, .obj or .ply file, or atrium, cornell, shapes, dominoes, plant",
        .positional_value = &a->scene,
    };
    options_status status = options_parse(&program, table, sizeof table / sizeof *table, argc, argv, err);
    s->width = a->size.width;
    s->height = a->size.height;
    bool select = s->rays >= 0.0f;
    if (a->visibility < 0)
        a->visibility = select ? VISIBILITY_ESTIMATE : VISIBILITY_CACHE;
    s->visibility = (visibility_mode)a->visibility;
    if (select && s->visibility != VISIBILITY_ESTIMATE)
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
    return status;
}

/* Hours of rendering must not end in a folder that is not there. */
static bool check_target(const char *path, message *err)
{
    char copy[4096];
    struct stat info;
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode))
        return fail(err, "cannot write %s: %s", path, S_ISDIR(info.st_mode) ? "it is a folder" : "not a regular file");
    if (strlen(path) >= sizeof copy)
        return fail(err, "%.60s...: path too long", path);
    strcpy(copy, path);
    const char *folder = dirname(copy);
    if (access(folder, W_OK | X_OK) != 0)
        return fail(err, "%s: cannot write into folder %s", path, folder);
    return true;
}

/* What no scene and no folder could put right. */
static bool check_usage(const arguments *a, message *err)
{
    const char *targets[OPTION_LIST_MAX + 2];
    int count = 0;
    bool exr = false;
    for (int i = 0; i < a->outputs.count; i++) {
        const char *path = targets[count++] = a->outputs.items[i];
        exr = exr || has_extension(path, ".exr");
        if (!has_extension(path, ".exr") && !has_extension(path, ".png"))
            return fail(err, "%s: images are written as .exr or .png", path);
    }
    if (a->picture && !has_extension(a->picture, ".png"))
        return fail(err, "%s: the picture is written as .png", a->picture);
    if (a->picture)
        targets[count++] = a->picture;
    if (a->json)
        targets[count++] = a->json;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < i; k++)
            if (strcmp(targets[i], targets[k]) == 0)
                return fail(err, "%s: given twice as a file to write", targets[i]);
    if (a->picture && !a->compare)
        return fail(err, "--picture needs --compare");
    if (a->runs && !a->compare)
        return fail(err, "--runs needs --compare");
    if (a->settings.env_lights > 0 && a->settings.env_samples > 0)
        return fail(err, "--env-lights stand for the environment: --env-samples must be 0");
    const settings *s = &a->settings;
    if (estimates(s->visibility) && (s->words || s->ce_delta > 0.0f || s->ce_samples > 0.0f))
        return fail(err, "%s does without --store words, --ce-delta and --ce-samples",
                    s->visibility == VISIBILITY_ESTIMATE ? "--visibility estimate" : "--select");
    if ((a->half || a->tiles) && !exr)
        return fail(err, "%s needs an .exr file to write", a->half ? "--half" : "--tiles");
    const float *l = a->look;
    if (isnan(l[6]))
        return true;
    if (!(l[6] > 0.0f && l[6] < 180.0f))
        return fail(err, "--look: the field of view must be between 0 and 180 degrees, not %g", (double)l[6]);
    if (!(v3_length(v3_sub(v3(l[3], l[4], l[5]), v3(l[0], l[1], l[2]))) > 0.0f))
        return fail(err, "--look: the camera stands where it looks at");
    return true;
}

static bool check_targets(const arguments *a, message *err)
{
    for (int i = 0; i < a->outputs.count; i++)
        if (!check_target(a->outputs.items[i], err))
            return false;
    if (a->picture && !check_target(a->picture, err))
        return false;
    return !a->json || strcmp(a->json, "-") == 0 || check_target(a->json, err);
}

static bool check_memory(const arguments *a, message *err)
{
    double needed = (double)comparison_bytes(&a->settings, a->compare, a->runs);
    if (a->reference)
        needed += (double)a->size.width * a->size.height * (double)sizeof(rgb);
    double budget = (double)memory_budget();
    return needed <= budget ||
           fail(err, "--size %ux%u: the images need %.3g GiB, more than half of this machine's memory, %.3g GiB",
                a->size.width, a->size.height, needed * 0x1p-30, budget * 0x1p-30);
}

/* Before all that takes long. */
static bool load_reference(const arguments *a, image *out, message *err)
{
    if (!a->reference)
        return true;
    if (!image_load_exr(a->reference, out, err))
        return false;
    return (out->width == a->size.width && out->height == a->size.height) ||
           fail(err, "%s: the reference has %ux%u pixels, the image %ux%u", a->reference, out->width, out->height,
                a->size.width, a->size.height);
}

/* A word that is neither the name of a built-in scene nor looks like a file. */
static bool unknown_scene(const char *name, message *err)
{
    char names[128] = "";
    for (size_t i = 0, used = 0; scene_builtin_names[i] && used < sizeof names; i++)
        used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", i ? ", " : "", scene_builtin_names[i]);
    const char *best = options_suggest(name, scene_builtin_names);
    return fail(err, "%.100s: neither a file nor a built-in scene (%s)%s%s%s", name, names,
                best ? "; did you mean '" : "", best ? best : "", best ? "'?" : "");
}

static bool load_scene(const arguments *a, scene **out, message *err)
{
    if (!scene_builtin(a->scene, out)) {
        if (!strpbrk(a->scene, "./") && access(a->scene, F_OK) != 0)
            return unknown_scene(a->scene, err);
        if (!scene_load(a->scene, out, err))
            return false;
    }
    scene *s = *out;
    if (a->env) {
        environment_free(s->environment);
        s->environment = NULL;
        if (!environment_load(a->env, &s->environment, err))
            return false;
    }
    if (a->settings.env_lights > 0 && !s->environment)
        return fail(err, "--env-lights: the scene has no environment; --env gives it one");
    direct_environment_lights(s, a->settings.env_lights);
    return scene_finish(s, err);
}

static bool choose_camera(const arguments *a, const scene *s, camera *out, message *err)
{
    const float *l = a->look;
    if (!isnan(l[6])) {
        *out = camera_look(v3(l[0], l[1], l[2]), v3(l[3], l[4], l[5]), v3(0, 1, 0), l[6] * PI_F / 180.0f);
        return true;
    }
    if ((uint32_t)a->camera >= s->camera_count)
        return fail(err, "--camera %d: the scene has %u, from 0", a->camera, s->camera_count);
    *out = s->cameras[a->camera];
    return true;
}

/* Hard shadows show every cell that is larger than a pixel. Where there is nothing to share in one, or their rays do
 * not count beside the others, they are traced. */
static float hard_shadow_ce(const scene *s, const settings *f)
{
    bool few = (uint64_t)64 * s->light_count <= (uint64_t)f->vpls;
    return f->spp == 1 || few ? 0.0f : sqrtf((float)f->spp);
}

static bool write_files(const arguments *a, const comparison *c, message *err)
{
    exr_options exr = {.half = a->half, .tiles = a->tiles};
    for (int i = 0; i < a->outputs.count; i++)
        if (!comparison_save(c, a->outputs.items[i], exr, err))
            return false;
    if (a->picture && c->runs > 0 && !comparison_picture(c, a->picture, err))
        return false;
    return !a->json || comparison_json(c, a->json, err);
}

static bool run(const arguments *a, view *v, const image *reference, message *err)
{
    comparison c;
    int runs = a->runs ? a->runs : 1;
    bool ok = a->compare ? comparison_run(v, runs, a->quiet, &c, err) : comparison_single(v, a->quiet, &c, err);
    if (ok) {
        if (a->reference)
            comparison_reference(&c, a->reference, reference);
        if (!a->quiet)
            comparison_print(&c, a->json && strcmp(a->json, "-") == 0 ? stderr : stdout);
        if (a->compare && c.runs == 0)
            notice("interrupted: no pair of frames to compare; the image is a part of one");
        else if (a->compare && c.runs < runs)
            notice("interrupted: %d of %d pairs of frames", c.runs, runs);
        else if (!a->compare && !c.mode_frame.complete)
            notice("interrupted: image and figures are of a part of the frame");
        ok = write_files(a, &c, err);
    }
    comparison_free(&c);
    return ok;
}

/* Text that did not arrive, for instance on a full disk, is a failure. */
static bool flush_output(message *err)
{
    return fflush(stdout) == 0 && !ferror(stdout) ? true : fail(err, "standard output: cannot write");
}

int main(int argc, char *argv[])
{
    arguments a = defaults();
    message err = {0};
    switch (parse(&a, argc, argv, &err)) {
    case OPTIONS_HELP:
        if (flush_output(&err))
            return 0;
        fprintf(stderr, "whitted: %s\n", err.text);
        return 1;
    case OPTIONS_ERROR:
        fprintf(stderr, "%s\n", err.text);
        return 2;
    case OPTIONS_OK:
        if (check_usage(&a, &err))
            break;
        fprintf(stderr, "whitted: %s\n", err.text);
        return 2;
    }
    notice_enable(!a.quiet);
    interrupt_install();
    signal(SIGXFSZ, SIG_IGN); /* a limit on file sizes then fails like a full disk, without leaving a temporary file */
    view v = {.settings = a.settings};
    v.settings.threads = parallel_thread_count(a.settings.threads);
    scene *s = NULL;
    tracer *t = NULL;
    emitters *e = NULL;
    image reference = {0};
    bool ok = check_memory(&a, &err) && check_targets(&a, &err) && load_reference(&a, &reference, &err) &&
              load_scene(&a, &s, &err) && choose_camera(&a, s, &v.camera, &err) &&
              tracer_create(s, v.settings.threads, &t, &err);
    if (ok) {
        if (v.settings.ce_delta < 0.0f)
            v.settings.ce_delta = hard_shadow_ce(s, &v.settings);
        e = emitters_new(s);
        v.scene = s;
        v.tracer = t;
        v.emitters = e;
        const float low[3] = {s->bounds_min.x, s->bounds_min.y, s->bounds_min.z};
        const float high[3] = {s->bounds_max.x, s->bounds_max.y, s->bounds_max.z};
        memcpy(v.settings.cache.bounds_min, low, sizeof low);
        memcpy(v.settings.cache.bounds_max, high, sizeof high);
        if (a.outputs.count == 0 && !a.picture && !a.json && !a.compare && !a.reference)
            notice("no --output: the image will not be kept");
        ok = run(&a, &v, &reference, &err) && flush_output(&err);
    }
    if (!ok)
        fprintf(stderr, "whitted: %s\n", err.text);
    image_free(&reference);
    emitters_free(e);
    tracer_free(t);
    scene_free(s);
    return !ok ? 1 : interrupted() ? 128 + interrupt_signal() : 0;
}
