/* SPDX-License-Identifier: Apache-2.0 */
/* Which way of saving shadow rays is best? Takes down once what every eye sample of a view sees of every virtual point
 * light and replays each policy of the table below against that: rays that it would trace and the error that it would
 * leave, exactly and without tracing.
 *
 *     policies SCENE [--env FILE] [--size WxH] [--spp N] [--vpls N] [--list] [--filter REGEX] [--csv FILE] [--states]
 */
#include "replay.h"

#include "renderers/common/options.h"

#include <errno.h>
#include <regex.h>
#include <stdio.h>
#include <string.h>

typedef struct policy {
    const char *name;
    bool estimates;
    grid_policy grid;
    estimator_policy estimator;
} policy;

#define GRID(text, ...)                                                                                                \
    {                                                                                                                  \
        .name = text, .grid = { __VA_ARGS__ }                                                                          \
    }
#define ESTIMATE(text, ...)                                                                                            \
    {                                                                                                                  \
        .name = text, .estimates = true, .estimator = { __VA_ARGS__ }                                                  \
    }

static const policy policies[] = {
    GRID("a ce 8", .ce = 8),
    GRID("a ce 16", .ce = 16),
    GRID("a ce 32", .ce = 32),
    GRID("a ce 64", .ce = 64),
    GRID("a ce 4, not refined", .ce = 4, .levels = 1),
    GRID("a ce 8, not refined", .ce = 8, .levels = 1),
    GRID("a ce 16, not refined", .ce = 16, .levels = 1),
    GRID("a ce 32, not refined", .ce = 32, .levels = 1),
    GRID("a ce 16, 2 levels", .ce = 16, .levels = 2),
    GRID("a ce 16, 3 levels", .ce = 16, .levels = 3),
    GRID("a ce 32, 2 levels", .ce = 32, .levels = 2),
    GRID("a ce 32, 3 levels", .ce = 32, .levels = 3),
    GRID("a ce 8, contacts by the eye cell alone", .ce = 8, .eye_contacts = true),
    GRID("a ce 16, contacts by the eye cell alone", .ce = 16, .eye_contacts = true),
    GRID("a ce 32, contacts by the eye cell alone", .ce = 32, .eye_contacts = true),

    GRID("b ce 16, refine above 0.25", .ce = 16, .refine_above = 0.25f),
    GRID("b ce 16, refine above 0.5", .ce = 16, .refine_above = 0.5f),
    GRID("b ce 16, refine above 1", .ce = 16, .refine_above = 1),
    GRID("b ce 16, refine above 2", .ce = 16, .refine_above = 2),
    GRID("b ce 32, refine above 0.25", .ce = 32, .refine_above = 0.25f),
    GRID("b ce 32, refine above 0.5", .ce = 32, .refine_above = 0.5f),
    GRID("b ce 32, refine above 1", .ce = 32, .refine_above = 1),
    GRID("b ce 32, refine above 2", .ce = 32, .refine_above = 2),
    GRID("b ce 16, finer above 8", .ce = 16, .finer_above = 8),
    GRID("b ce 16, refine above 1, finer above 8", .ce = 16, .refine_above = 1, .finer_above = 8),
    GRID("b ce 32, refine above 1, finer above 8", .ce = 32, .refine_above = 1, .finer_above = 8),
    GRID("b ce 16, as above, contacts by the eye cell alone", .ce = 16, .refine_above = 1, .finer_above = 8,
         .eye_contacts = true),
    GRID("b ce 32, as above, contacts by the eye cell alone", .ce = 32, .refine_above = 1, .finer_above = 8,
         .eye_contacts = true),
    GRID("b ce 8, side ~ c^-1/3", .ce = 8, .levels = 5, .power = 1 / 3.0f),
    GRID("b ce 16, side ~ c^-1/3", .ce = 16, .levels = 6, .power = 1 / 3.0f),
    GRID("b ce 8, side ~ c^-2/3", .ce = 8, .levels = 5, .power = 2 / 3.0f),
    GRID("b ce 16, side ~ c^-2/3", .ce = 16, .levels = 6, .power = 2 / 3.0f),
    GRID("b ce 8, side ~ c^-1/3, 1 deeper", .ce = 8, .levels = 5, .power = 1 / 3.0f, .deeper = 1),
    GRID("b ce 16, side ~ c^-1/3, 1 deeper", .ce = 16, .levels = 6, .power = 1 / 3.0f, .deeper = 1),
    GRID("b ce 32, side ~ c^-1/3, 1 deeper", .ce = 32, .levels = 7, .power = 1 / 3.0f, .deeper = 1),
    GRID("b ce 8, side ~ c^-2/3, 1 deeper", .ce = 8, .levels = 5, .power = 2 / 3.0f, .deeper = 1),
    GRID("b ce 16, side ~ c^-2/3, 1 deeper", .ce = 16, .levels = 6, .power = 2 / 3.0f, .deeper = 1),
    GRID("b ce 32, side ~ c^-2/3, 1 deeper", .ce = 32, .levels = 7, .power = 2 / 3.0f, .deeper = 1),
    GRID("b ce 16, side ~ c^-1/3, 2 deeper", .ce = 16, .levels = 6, .power = 1 / 3.0f, .deeper = 2),
    GRID("b ce 32, side ~ c^-1/3, 2 deeper", .ce = 32, .levels = 7, .power = 1 / 3.0f, .deeper = 2),
    GRID("b ce 32, side ~ c^-2/3, 2 deeper", .ce = 32, .levels = 7, .power = 2 / 3.0f, .deeper = 2),
    GRID("b ce 8, side ~ c^-1/3, 1 deeper, contacts by C_E", .ce = 8, .levels = 5, .power = 1 / 3.0f, .deeper = 1,
         .eye_contacts = true),
    GRID("b ce 16, side ~ c^-1/3, 1 deeper, contacts by C_E", .ce = 16, .levels = 6, .power = 1 / 3.0f, .deeper = 1,
         .eye_contacts = true),
    GRID("b ce 16, side ~ c^-1/3, 2 deeper, contacts by C_E", .ce = 16, .levels = 6, .power = 1 / 3.0f, .deeper = 2,
         .eye_contacts = true),
    GRID("b ce 32, side ~ c^-2/3, 2 deeper, contacts by C_E", .ce = 32, .levels = 7, .power = 2 / 3.0f, .deeper = 2,
         .eye_contacts = true),

    GRID("c ce 32, side <= 1 distance", .ce = 32, .distance = 1),
    GRID("c ce 32, side <= 0.5 distance", .ce = 32, .distance = 0.5f),
    GRID("c ce 32, side <= 0.25 distance", .ce = 32, .distance = 0.25f),
    GRID("c ce 32, side <= 0.125 distance", .ce = 32, .distance = 0.125f),
    GRID("c ce 64, side <= 0.25 distance", .ce = 64, .distance = 0.25f),

    GRID("d ce 32, cz 1", .ce = 32, .layers = 1),
    GRID("d ce 32, cz 2", .ce = 32, .layers = 2),
    GRID("d ce 32, cz 4", .ce = 32, .layers = 4),
    GRID("d ce 32, cz 8", .ce = 32, .layers = 8),
    GRID("d ce 32, cz 16", .ce = 32, .layers = 16),
    GRID("d ce 32, cn 4", .ce = 32, .normal_bins = 4),
    GRID("d ce 32, cn 16", .ce = 32, .normal_bins = 16),
    GRID("d ce 32, cr 2", .ce = 32, .step = 2),

    GRID("e finest ce 4, 1 agrees", .ce = 8, .levels = 2, .agree = 1),
    GRID("e finest ce 4, 2 agree", .ce = 16, .levels = 3, .agree = 2),
    GRID("e finest ce 8, 1 agrees", .ce = 16, .levels = 2, .agree = 1),
    GRID("e finest ce 8, 2 agree", .ce = 32, .levels = 3, .agree = 2),
    GRID("e finest ce 16, 2 agree", .ce = 64, .levels = 3, .agree = 2),

    GRID("e ce 16, floods to 6 nearest lights", .ce = 16, .flood = 6),
    GRID("e ce 32, floods to 6 nearest lights", .ce = 32, .flood = 6),
    GRID("e ce 64, floods to 6 nearest lights", .ce = 64, .flood = 6),
    GRID("e ce 64, 2 levels, floods to 6 nearest lights", .ce = 64, .levels = 2, .flood = 6),

    GRID("f ce 32, middle 0.5", .ce = 32, .middle = 0.5f),
    GRID("f ce 32, middle 0.7", .ce = 32, .middle = 0.7071f),
    GRID("f ce 32, middle 0.9", .ce = 32, .middle = 0.9f),

    GRID("g ce 32, scanline", .ce = 32, .order = ORDER_SCANLINE),
    GRID("g ce 32, morton", .ce = 32, .order = ORDER_MORTON),
    GRID("g ce 32, random", .ce = 32, .order = ORDER_RANDOM),

    GRID("h ce 16, lights share", .ce = 16, .share_lights = true),
    GRID("h ce 32, lights share", .ce = 32, .share_lights = true),

    GRID("i ce 16, jitter 1", .ce = 16, .jitter = 1),
    GRID("i ce 32, jitter 0.5", .ce = 32, .jitter = 0.5f),
    GRID("i ce 32, jitter 1", .ce = 32, .jitter = 1),

    ESTIMATE("j K 2", .rays = 2),
    ESTIMATE("j K 4", .rays = 4),
    ESTIMATE("j K 6", .rays = 6),
    ESTIMATE("j K 8", .rays = 8),
    ESTIMATE("j K 16", .rays = 16),
    ESTIMATE("j K 2, adaptive", .rays = 2, .adapt = 2 / 3.0f),
    ESTIMATE("j K 4, adaptive", .rays = 4, .adapt = 2 / 3.0f),
    ESTIMATE("j K 6, adaptive", .rays = 6, .adapt = 2 / 3.0f),
    ESTIMATE("j K 8, adaptive", .rays = 8, .adapt = 2 / 3.0f),
    ESTIMATE("j K 16, adaptive", .rays = 16, .adapt = 2 / 3.0f),
    ESTIMATE("j K 8, adaptive by power 1/2", .rays = 8, .adapt = 0.5f),
    ESTIMATE("j K 8, adaptive by power 1", .rays = 8, .adapt = 1),
    ESTIMATE("j K 4, independent", .rays = 4, .offsets = OFFSET_INDEPENDENT),
    ESTIMATE("j K 8, independent", .rays = 8, .offsets = OFFSET_INDEPENDENT),
    ESTIMATE("j K 8, adaptive, independent", .rays = 8, .adapt = 2 / 3.0f, .offsets = OFFSET_INDEPENDENT),
    ESTIMATE("j K 8, learns after 64", .rays = 8, .delay = 64),
    ESTIMATE("j K 8, learns after 256", .rays = 8, .delay = 256),
    ESTIMATE("j K 8, learns after 1024", .rays = 8, .delay = 1024),
    ESTIMATE("j K 8, adaptive, learns after 256", .rays = 8, .adapt = 2 / 3.0f, .delay = 256),
    ESTIMATE("j K 8, adaptive, 4 cells, ratio 2", .rays = 8, .adapt = 2 / 3.0f, .cells = 4, .ratio = 2),
    ESTIMATE("j K 8, adaptive, no cache", .rays = 8, .adapt = 2 / 3.0f, .alone = true),
    ESTIMATE("j K 8, fixed table", .rays = 8, .table = TABLE_FIXED),
    ESTIMATE("j K 4, adaptive, fixed table, learns after 64", .rays = 4, .adapt = 2 / 3.0f, .table = TABLE_FIXED,
             .delay = 64),
    ESTIMATE("j K 8, adaptive, fixed table, learns after 64", .rays = 8, .adapt = 2 / 3.0f, .table = TABLE_FIXED,
             .delay = 64),
    ESTIMATE("j K 8, 1 cell", .rays = 8, .cells = 1),
    ESTIMATE("j K 8, 2 cells", .rays = 8, .cells = 2),
    ESTIMATE("j K 8, 4 cells", .rays = 8, .cells = 4),
    ESTIMATE("j K 8, ratio 2", .rays = 8, .ratio = 2),
    ESTIMATE("j K 8, 4 cells, ratio 2", .rays = 8, .cells = 4, .ratio = 2),
    ESTIMATE("j K 8, ce 4", .rays = 8, .ce = 4),
    ESTIMATE("j K 8, ce 16", .rays = 8, .ce = 16),
    ESTIMATE("j K 8, cz 1", .rays = 8, .layers = 1),
    ESTIMATE("j K 8, cz 2", .rays = 8, .layers = 2),
    ESTIMATE("j K 8, jitter 0.5", .rays = 8, .jitter = 0.5f),
    ESTIMATE("j K 8, scanline", .rays = 8, .order = ORDER_SCANLINE),
    ESTIMATE("j K 8, random", .rays = 8, .order = ORDER_RANDOM),
    ESTIMATE("j K 8, no cache", .rays = 8, .alone = true),
    ESTIMATE("j K 16, no cache", .rays = 16, .alone = true),
    ESTIMATE("j K 32, no cache", .rays = 32, .alone = true),
    ESTIMATE("j K 64, no cache", .rays = 64, .alone = true),
};

enum { POLICIES = sizeof policies / sizeof *policies };

typedef struct arguments {
    const char *scene, *env, *filter, *csv;
    option_size size;
    int spp, vpls;
    bool list, states;
} arguments;

static options_status parse(arguments *a, int argc, char *argv[], message *err)
{
    const option list[] = {
        {.name = "env", .kind = OPTION_STRING, .value = &a->env, .metavar = "FILE", .help = "environment map"},
        {.name = "size", .kind = OPTION_SIZE, .value = &a->size, .min = 1, .max = 4096, .help = "size in pixels"},
        {.name = "spp", .kind = OPTION_INT, .value = &a->spp, .min = 1, .max = 1024, .help = "eye paths per pixel"},
        {.name = "vpls", .kind = OPTION_INT, .value = &a->vpls, .min = 1, .max = 65536, .help = "virtual lights"},
        {.name = "filter",
         .kind = OPTION_STRING,
         .value = &a->filter,
         .metavar = "REGEX",
         .help = "only policies whose name matches"},
        {.name = "list", .kind = OPTION_FLAG, .value = &a->list, .help = "names of the policies, nothing else"},
        {.name = "csv",
         .kind = OPTION_STRING,
         .value = &a->csv,
         .metavar = "FILE",
         .help = "appends the figures; a new file gets a header"},
        {.name = "states",
         .kind = OPTION_FLAG,
         .value = &a->states,
         .help = "also what was seen of each combination of states with K 8"},
    };
    const option_program program = {.name = "policies",
                                    .summary = "Replays caching policies against the exact visibility of a view.",
                                    .positional = "SCENE",
                                    .positional_help = "a .glb, .gltf, .obj or .ply file, or a built-in scene",
                                    .positional_value = &a->scene};
    options_status status = options_parse(&program, list, sizeof list / sizeof *list, argc, argv, err);
    if (status == OPTIONS_OK && !a->scene && !a->list) {
        fail(err, "policies: SCENE is missing");
        return OPTIONS_ERROR;
    }
    return status;
}

/* Which policies to replay; false: the expression is wrong or matches none. */
static bool choose(const char *filter, bool chosen[POLICIES], message *err)
{
    regex_t expression;
    int wrong = filter ? regcomp(&expression, filter, REG_EXTENDED | REG_NOSUB) : 0, count = 0;
    if (wrong) {
        char text[128];
        regerror(wrong, &expression, text, sizeof text);
        return fail(err, "--filter %s: %s", filter, text);
    }
    for (int i = 0; i < POLICIES; i++) {
        chosen[i] = !filter || regexec(&expression, policies[i].name, 0, NULL, 0) == 0;
        count += chosen[i];
    }
    if (filter)
        regfree(&expression);
    return count > 0 ? true : fail(err, "--filter %s: matches no policy (see --list)", filter);
}

/* Name of the scene's file without folder and extension. */
static const char *scene_name(const char *path, char out[64])
{
    const char *slash = strrchr(path, '/');
    snprintf(out, 64, "%s", slash ? slash + 1 : path);
    char *dot = strrchr(out, '.');
    if (dot)
        *dot = '\0';
    return out;
}

static void replay_all(const record *r, const char *name, const bool chosen[POLICIES], FILE *csv)
{
    printf("%-52s %9s %9s %9s %9s %10s\n", name, "rays, %", "per eye", "l_inf, %", "wrong, %", "cells");
    for (int i = 0; i < POLICIES; i++) {
        if (!chosen[i])
            continue;
        replay_result x = policies[i].estimates ? replay_estimator(r, &policies[i].estimator, NULL, NULL)
                                                : replay_grid(r, &policies[i].grid, NULL);
        double share = (double)x.rays / (double)r->pairs, per_eye = (double)x.rays / r->count;
        double wrong = (double)x.wrong / (double)r->pairs;
        printf("%-52s %9.3f %9.2f %9.3f ", policies[i].name, 100.0 * share, per_eye, 100.0 * x.l_inf);
        if (policies[i].estimates)
            printf("%9s %10u\n", "-", x.cells);
        else
            printf("%9.2f %10u\n", 100.0 * wrong, x.cells);
        fflush(stdout);
        if (csv) {
            const settings *f = &r->view.settings;
            fprintf(csv, "%s,%u,%u,%d,%u,\"%s\",%.6g,%.5g,%.6g,", name, f->width, f->height, f->spp, r->lights.count,
                    policies[i].name, share, per_eye, x.l_inf);
            if (!policies[i].estimates)
                fprintf(csv, "%.6g", wrong);
            fprintf(csv, ",%u\n", x.cells);
            fflush(csv);
        }
    }
}

static void print_states(const record *r)
{
    static state_tally tallies[MAX_STATES];
    const estimator_policy p = {.rays = 8};
    replay_estimator(r, &p, tallies, NULL);
    static const char *const names[] = {"-", "visible", "blocked", "both"};
    printf("%5s %-9s %-9s %-9s %12s %8s %14s %8s\n", "state", "ce 8", "ce 32", "ce 128", "traced", "visible", "asked",
           "visible");
    for (uint32_t i = 0; i < STATES; i++) {
        const state_tally *t = &tallies[i];
        printf("%5u %-9s %-9s %-9s %12llu %8.4f %14llu %8.4f\n", i, names[i & 3], names[i >> 2 & 3], names[i >> 4],
               (unsigned long long)t->picked, t->picked ? (double)t->picked_visible / (double)t->picked : 0.0,
               (unsigned long long)t->asked, t->asked ? (double)t->visible / (double)t->asked : 0.0);
    }
}

static FILE *open_csv(const char *path, message *err)
{
    FILE *f = fopen(path, "a");
    if (!f) {
        fail(err, "%s: %s", path, strerror(errno));
        return NULL;
    }
    if (fseek(f, 0, SEEK_END) == 0 && ftell(f) == 0)
        fprintf(f, "scene,width,height,spp,vpls,policy,rays_traced,rays_per_eye,l_inf,mispredicted,cells\n");
    return f;
}

static bool run(const arguments *a, const bool chosen[POLICIES], message *err)
{
    char name[64];
    record r;
    FILE *csv = a->csv ? open_csv(a->csv, err) : NULL;
    if (a->csv && !csv)
        return false;
    const record_options options = {.scene = a->scene,
                                    .env = a->env,
                                    .width = a->size.width,
                                    .height = a->size.height,
                                    .spp = a->spp,
                                    .vpls = a->vpls};
    bool ok = record_make(&options, &r, err);
    if (ok)
        replay_all(&r, scene_name(a->scene, name), chosen, csv);
    if (ok && a->states)
        print_states(&r);
    record_free(&r);
    if (csv && (ferror(csv) | fclose(csv)) && ok)
        return fail(err, "%s: cannot write", a->csv);
    return ok;
}

int main(int argc, char *argv[])
{
    arguments a = {.size = {320, 180}, .spp = 16, .vpls = 1024};
    message err = {{0}};
    bool chosen[POLICIES];
    switch (parse(&a, argc, argv, &err)) {
    case OPTIONS_HELP:
        return 0;
    case OPTIONS_ERROR:
        fprintf(stderr, "%s\n", err.text);
        return 2;
    case OPTIONS_OK:
        break;
    }
    if (!choose(a.filter, chosen, &err)) {
        fprintf(stderr, "policies: %s\n", err.text);
        return 2;
    }
    for (int i = 0; i < POLICIES && a.list; i++)
        if (chosen[i])
            puts(policies[i].name);
    if (a.list || run(&a, chosen, &err))
        return 0;
    fprintf(stderr, "policies: %s\n", err.text);
    return 1;
}
