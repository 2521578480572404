/* SPDX-License-Identifier: Apache-2.0 */
/* The light of all eye samples of a view, with order and visibility to be chosen: renderers/whitted/frame.c taken apart
 * for whom a frame of its own is not enough. One thread. What is shaded and summed is the renderer's; visibility never
 * steps aside, and one cache serves the whole image. */
#ifndef BENCH_LIGHTING_H
#define BENCH_LIGHTING_H

#include "eyes.h"

#include "renderers/common/program.h"

/* A scene, its tracer and its lights, from the command line. */
typedef struct stage {
    program_arguments arguments;
    settings settings; /* as the options say: for `view`, and to be changed there */
    int cache_mb;
    scene *scene;
    tracer *tracer;
    emitters *emitters;
    view view;
    vpl_set lights;
} stage;

/* Entries of an option table that set stage *s. */
#define STAGE_OPTIONS(s)                                                                                               \
    PROGRAM_OPTION_SIZE(&(s)->arguments),                                                                              \
        {.name = "spp",                                                                                                \
         .kind = OPTION_INT,                                                                                           \
         .value = &(s)->arguments.spp,                                                                                 \
         .min = 1,                                                                                                     \
         .max = PASS,                                                                                                  \
         .help = "eye paths per pixel"},                                                                               \
        {.name = "vpls",                                                                                               \
         .kind = OPTION_INT,                                                                                           \
         .value = &(s)->settings.vpls,                                                                                 \
         .min = 0,                                                                                                     \
         .max = 65536,                                                                                                 \
         .help = "virtual point lights, of the first camera"},                                                         \
        PROGRAM_OPTIONS_ENV(&(s)->arguments),                                                                          \
        {.name = "env-lights",                                                                                         \
         .kind = OPTION_INT,                                                                                           \
         .value = &(s)->settings.env_lights,                                                                           \
         .min = 0,                                                                                                     \
         .max = 4096,                                                                                                  \
         .help = "the environment as N directional lights"},                                                           \
        PROGRAM_OPTIONS_CAMERA(&(s)->arguments),                                                                       \
        {.name = "cache-mb",                                                                                           \
         .kind = OPTION_INT,                                                                                           \
         .value = &(s)->cache_mb,                                                                                      \
         .min = 1,                                                                                                     \
         .max = 16384,                                                                                                 \
         .help = "size of each cache in MiB"},                                                                         \
    {                                                                                                                  \
        .name = "seed", .kind = OPTION_UINT64, .value = &(s)->arguments.seed, .help = "seed of all random numbers"     \
    }

stage stage_defaults(const char *program);
/* Parses and loads; where there is nothing to do *code is the program's exit code. Free the stage in any case. The
 * environment and emitters shine as far as they are lights, not by samples of their own. */
bool stage_open(stage *s, const char *summary, const option *table, size_t count, int argc, char *argv[], int *code);
void stage_free(stage *s);
/* Names and sizes, as whitted prints them: the first members of a JSON object. */
void stage_print(const stage *s, uint32_t eyes);

/* Sets the visible bits of a chunk, whose eye samples are eyes[] of the list and have their place in it as pixel. */
typedef void (*lighting_decide)(void *context, chunk *c, const uint32_t *eyes, tile_pixels *pixels);
/* By the renderer's own means; `context` is a visibility. */
void lighting_resolve(void *context, chunk *c, const uint32_t *eyes, tile_pixels *pixels);

/* Visibility of all eye samples: rows of bits of virtual point lights, then of punctual lights. */
typedef struct light_bits {
    uint32_t words, punctual; /* of a row; where the punctual lights begin */
    uint64_t *asked, *visible;
} light_bits;

typedef struct lit {
    image image;
    light_bits bits;
    double seconds, decide_s; /* all of it, deciding visibility alone */
} lit;

/* `order`: NULL for that of the list. */
lit lighting_render(const view *v, const vpl_set *lights, const eye_list *eyes, const uint32_t *order,
                    lighting_decide decide, void *context);
/* The same with every pair traced. */
lit lighting_exact(const view *v, const vpl_set *lights, const eye_list *eyes);
void lit_free(lit *l);
/* Share of the pairs asked for that one of them sees wrongly. */
double lit_mispredicted(const lit *l, const lit *exact, uint32_t count);

double lighting_now(void); /* seconds */

#endif
