/* SPDX-License-Identifier: Apache-2.0 */
/* What the programs share: options, their checks, scene and camera, exit codes. A program's main calls, in this order,
 * program_defaults, program_parse, program_check, program_begin, program_load_scene, scene_finish,
 * program_choose_camera, and program_stop or program_end for its exit code. */
#ifndef COMMON_PROGRAM_H
#define COMMON_PROGRAM_H

#include "image.h"
#include "options.h"
#include "parallel.h"
#include "scene.h"

enum { RUNS_MAX = 99 };

typedef struct program_arguments {
    const char *program;                                  /* its name, for messages */
    const char *scene, *env, *json, *picture, *reference; /* but for the scene NULL where not given */
    option_size size;
    option_list outputs;
    float env_rotate; /* degrees */
    float look[7];    /* the last is NaN where it is not given */
    int camera, spp;
    int runs;    /* 0: not given */
    int threads; /* parsed: as many as there will be */
    uint64_t seed;
    bool compare, half, tiles, quiet;
} program_arguments;

/* Entries of an option table that set program_arguments *a. What --spp counts is the program's to say. */
#define PROGRAM_OPTION_SIZE(a)                                                                                         \
    {.name = "size", .kind = OPTION_SIZE, .value = &(a)->size, .help = "image size in pixels"}
#define PROGRAM_OPTIONS_ENV(a)                                                                                         \
    {.name = "env", .kind = OPTION_STRING, .value = &(a)->env, .metavar = "FILE",                                      \
     .help = "environment map (.hdr, .exr) in place of the scene's"},                                                  \
    {.name = "env-rotate", .kind = OPTION_FLOAT, .value = &(a)->env_rotate, .min = -36000, .max = 36000,               \
     .metavar = "DEGREES", .help = "turns it, counter-clockwise seen from above"}
#define PROGRAM_OPTIONS_CAMERA(a)                                                                                      \
    {.name = "camera", .kind = OPTION_INT, .value = &(a)->camera, .min = 0, .max = 65535, .metavar = "I",              \
     .help = "camera of the scene, from 0"},                                                                           \
    {.name = "look", .kind = OPTION_FLOATS, .value = (a)->look, .count = 7, .min = -3e38, .max = 3e38,                 \
     .shown = "", .metavar = "EX,EY,EZ,AX,AY,AZ,FOV",                                                                  \
     .help = "camera at E that looks at A, vertical FOV in degrees"}
#define PROGRAM_OPTIONS_RUN(a)                                                                                         \
    {.name = "compare", .kind = OPTION_FLAG, .value = &(a)->compare,                                                   \
     .help = "render exactly as well and print times and errors"},                                                     \
    {.name = "runs", .kind = OPTION_INT, .value = &(a)->runs, .min = 1, .max = RUNS_MAX, .shown = "1",                 \
     .help = "pairs of timed frames with --compare (medians)"},                                                        \
    {.name = "threads", .kind = OPTION_INT, .value = &(a)->threads, .min = 0, .max = PARALLEL_MAX_THREADS,             \
     .help = "threads, 0 for one per CPU"},                                                                            \
    {.name = "seed", .kind = OPTION_UINT64, .value = &(a)->seed, .help = "seed of all random numbers"},                \
    {.name = "output", .letter = 'o', .kind = OPTION_LIST, .value = &(a)->outputs, .metavar = "FILE",                  \
     .help = "image to write: .exr with all layers, or .png (repeatable)"},                                            \
    {.name = "picture", .kind = OPTION_STRING, .value = &(a)->picture, .metavar = "FILE",                              \
     .help = "with --compare: exact, chosen and 8 x error in one .png"},                                               \
    {.name = "reference", .kind = OPTION_STRING, .value = &(a)->reference, .metavar = "FILE",                          \
     .help = "print the error against this .exr as well"},                                                             \
    {.name = "half", .kind = OPTION_FLAG, .value = &(a)->half, .help = "16-bit floats in .exr"},                       \
    {.name = "tiles", .kind = OPTION_FLAG, .value = &(a)->tiles, .help = "tiles instead of scan lines in .exr"},       \
    {.name = "json", .kind = OPTION_STRING, .value = &(a)->json, .metavar = "FILE",                                    \
     .help = "figures as JSON; - for standard output"},                                                                \
    {.name = "quiet", .kind = OPTION_FLAG, .value = &(a)->quiet, .help = "no progress, no notices, no table"}

program_arguments program_defaults(const char *program);
/* options_parse with the scene as positional argument; `summary` is the help's. */
options_status program_parse(program_arguments *a, const char *summary, const option *table, size_t count, int argc,
                             char *const argv[], message *err);
/* What no scene and no folder could put right. */
bool program_check(const program_arguments *a, message *err);
/* Where there is nothing to render: says why on stderr and returns the exit code. `status` is program_parse's;
 * OPTIONS_OK: a check failed. */
int program_stop(const program_arguments *a, options_status status, message *err);

/* Takes charge of notices and signals, then refuses what can be refused before the scene is read: too little memory for
 * frames of `frame_bytes`, files that cannot be written, a reference that cannot be read or has another size. Free
 * `reference` (empty where none is given) in any case. */
bool program_begin(const program_arguments *a, uint64_t frame_bytes, image *reference, message *err);
/* Half of the machine's memory: what images and records may plan to take. */
uint64_t memory_budget(void);
/* The scene with its environment, for scene_finish. Free *out in any case. */
bool program_load_scene(const program_arguments *a, scene **out, message *err);
bool program_choose_camera(const program_arguments *a, const scene *s, camera *out, message *err);
/* Exit code of a program that has begun; says on stderr what went wrong. */
int program_end(const program_arguments *a, bool ok, message *err);

bool has_extension(const char *path, const char *extension); /* in capitals or not */

#endif
