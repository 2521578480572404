/* SPDX-License-Identifier: Apache-2.0 */
/* Command line and exit; see program.h. */
#include "program.h"

#include "atomic_file.h"
#include "interrupt.h"

#include <errno.h>
#include <libgen.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>
#include <unistd.h>

program_arguments program_defaults(const char *program)
{
    program_arguments a = {.program = program, .scene = "atrium", .size = {640, 360}, .spp = 1};
    a.look[6] = NAN;
    return a;
}

options_status program_parse(program_arguments *a, const char *summary, const option *table, size_t count, int argc,
                             char *const argv[], message *err)
{
    const option_program program = {
        .name = a->program,
        .summary = summary,
        .positional = "[SCENE]",
        .positional_help = "a .glb, .gltf, .obj or .ply file, or a built-in scene",
        .positional_value = &a->scene,
    };
    options_status status = options_parse(&program, table, count, argc, argv, err);
    a->threads = parallel_thread_count(a->threads);
    return status;
}

/* ------------------------------------------------------------------------------------------------------- checks */

bool has_extension(const char *path, const char *extension)
{
    size_t n = strlen(path), m = strlen(extension);
    return n > m && strcasecmp(path + n - m, extension) == 0;
}

static bool check_look(const float l[7], message *err)
{
    if (isnan(l[6]))
        return true;
    if (!(l[6] > 0.0f && l[6] < 180.0f))
        return fail(err, "--look: the field of view must be between 0 and 180 degrees, not %g", (double)l[6]);
    for (int i = 0; i < 6; i++)
        if (!(fabsf(l[i]) <= SCENE_MAX_DISTANCE))
            return fail(err, "--look: %g lies beyond %g units", (double)l[i], (double)SCENE_MAX_DISTANCE);
    if (!(v3_length(v3_sub(v3(l[3], l[4], l[5]), v3(l[0], l[1], l[2]))) > 0.0f))
        return fail(err, "--look: the camera stands where it looks at");
    return true;
}

bool program_check(const program_arguments *a, message *err)
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
            if (atomic_same(targets[i], targets[k]))
                return fail(err, "%s: given twice as a file to write", targets[i]);
    if (a->picture && !a->compare)
        return fail(err, "--picture needs --compare");
    if (a->runs && !a->compare)
        return fail(err, "--runs needs --compare");
    if ((a->half || a->tiles) && !exr)
        return fail(err, "%s needs an .exr file to write", a->half ? "--half" : "--tiles");
    return check_look(a->look, err);
}

/* Hours of rendering must not end in a folder that is not there. */
static bool check_target(const char *path, message *err)
{
    struct stat info;
    if (stat(path, &info) == 0 && !S_ISREG(info.st_mode))
        return fail(err, "cannot write %s: %s", path, S_ISDIR(info.st_mode) ? "it is a folder" : "not a regular file");
    char *target = atomic_target(path);
    if (!target)
        return fail(err, "cannot write %.400s: %s", path, strerror(errno));
    const char *folder = dirname(target);
    bool ok = access(folder, W_OK | X_OK) == 0 || fail(err, "%s: cannot write into folder %s", path, folder);
    free(target);
    return ok;
}

static bool check_targets(const program_arguments *a, message *err)
{
    for (int i = 0; i < a->outputs.count; i++)
        if (!check_target(a->outputs.items[i], err))
            return false;
    if (a->picture && !check_target(a->picture, err))
        return false;
    return !a->json || strcmp(a->json, "-") == 0 || check_target(a->json, err);
}

uint64_t memory_budget(void)
{
    return (uint64_t)sysconf(_SC_PHYS_PAGES) / 2 * (uint64_t)sysconf(_SC_PAGESIZE);
}

/* Of several pairs one is kept while the next is rendered. */
static bool check_memory(const program_arguments *a, uint64_t frame_bytes, message *err)
{
    double needed = (double)(frame_bytes * (!a->compare ? 1 : a->runs > 1 ? 4 : 2));
    if (a->reference)
        needed += (double)a->size.width * a->size.height * (double)sizeof(rgb);
    double budget = (double)memory_budget();
    return needed <= budget ||
           fail(err, "--size %ux%u: the images need %.3g GiB, more than half of this machine's memory, %.3g GiB",
                a->size.width, a->size.height, needed * 0x1p-30, budget * 0x1p-30);
}

static bool load_reference(const program_arguments *a, image *out, message *err)
{
    if (!a->reference)
        return true;
    if (!image_load_exr(a->reference, out, err))
        return false;
    return (out->width == a->size.width && out->height == a->size.height) ||
           fail(err, "%s: the reference has %ux%u pixels, the image %ux%u", a->reference, out->width, out->height,
                a->size.width, a->size.height);
}

bool program_begin(const program_arguments *a, uint64_t frame_bytes, image *reference, message *err)
{
    *reference = (image){0};
    notice_enable(!a->quiet);
    interrupt_install();
    signal(SIGXFSZ, SIG_IGN); /* a limit on file sizes then fails like a full disk, without leaving a temporary file */
    return check_memory(a, frame_bytes, err) && check_targets(a, err) && load_reference(a, reference, err);
}

/* -------------------------------------------------------------------------------------------------------- scene */

/* A word that is neither the name of a built-in scene nor looks like a file. */
static bool unknown_scene(const char *name, message *err)
{
    char names[256] = "";
    for (size_t i = 0, used = 0; scene_builtin_names[i] && used < sizeof names; i++)
        used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", i ? ", " : "", scene_builtin_names[i]);
    const char *best = options_suggest(name, scene_builtin_names);
    return fail(err, "%.100s: neither a file nor a built-in scene (%s)%s%s%s", name, names,
                best ? "; did you mean '" : "", best ? best : "", best ? "'?" : "");
}

bool program_load_scene(const program_arguments *a, scene **out, message *err)
{
    *out = NULL;
    if (!scene_builtin(a->scene, out)) {
        if (!strpbrk(a->scene, "./") && access(a->scene, F_OK) != 0)
            return unknown_scene(a->scene, err);
        if (!scene_load(a->scene, out, err))
            return false;
    }
    if (a->env) {
        environment_free((*out)->environment);
        (*out)->environment = NULL;
        if (!environment_load(a->env, &(*out)->environment, err))
            return false;
    }
    if (a->env_rotate != 0.0f && !(*out)->environment)
        return fail(err, "--env-rotate: the scene has no environment; --env gives it one");
    if ((*out)->environment)
        environment_rotate((*out)->environment, (double)a->env_rotate);
    return true;
}

bool program_choose_camera(const program_arguments *a, const scene *s, camera *out, message *err)
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

/* --------------------------------------------------------------------------------------------------------- exit */

/* Text that did not arrive, for instance on a full disk, is a failure. */
static bool flush_output(message *err)
{
    return fflush(stdout) == 0 && !ferror(stdout) ? true : fail(err, "standard output: cannot write");
}

int program_stop(const program_arguments *a, options_status status, message *err)
{
    if (status == OPTIONS_HELP)
        return program_end(a, true, err);
    if (status == OPTIONS_ERROR) /* which names the program */
        fprintf(stderr, "%s\n", err->text);
    else
        fprintf(stderr, "%s: %s\n", a->program, err->text);
    return 2;
}

int program_end(const program_arguments *a, bool ok, message *err)
{
    if (ok && flush_output(err))
        return interrupted() ? 128 + interrupt_signal() : 0;
    fprintf(stderr, "%s: %s\n", a->program, err->text);
    return interrupted() ? 128 + interrupt_signal() : 1;
}
