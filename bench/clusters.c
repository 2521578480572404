/* SPDX-License-Identifier: Apache-2.0 */
/* How wrong are the clusters of a view, and where? Records what each eye sample sees of each virtual point light,
 * replays Algorithm 2 with one policy against it and prints JSON; clusters.h says what its members are.
 *
 *     clusters SCENE [--ce X] [--refine N] [--cn N] [--cz N] [--cr X] [--around 4|8|64|72] [--share] [--hash H] ...
 */
#include "clusters.h"

#include "renderers/common/options.h"

#include <stdio.h>
#include <string.h>

typedef struct arguments {
    record_options view;
    option_size size;
    grid_policy policy;
    int around, hash, cache_mb;
} arguments;

static const char *const around_names[] = {"4", "8", "64", "72", NULL};
static const char *const hash_names[] = {"none", "split", "lcg-pair", "lcg-xorshift", NULL};

static options_status parse(arguments *a, int argc, char *argv[], message *err)
{
    record_options *v = &a->view;
    grid_policy *p = &a->policy;
    const option list[] = {
        {.name = "env", .kind = OPTION_STRING, .value = &v->env, .metavar = "FILE", .help = "environment map"},
        {.name = "camera",
         .kind = OPTION_INT,
         .value = &v->camera,
         .min = 0,
         .max = 1000,
         .help = "camera of the scene"},
        {.name = "size", .kind = OPTION_SIZE, .value = &a->size, .min = 1, .max = 4096, .help = "size in pixels"},
        {.name = "spp", .kind = OPTION_INT, .value = &v->spp, .min = 1, .max = 1024, .help = "eye paths per pixel"},
        {.name = "vpls", .kind = OPTION_INT, .value = &v->vpls, .min = 1, .max = 65536, .help = "virtual lights"},
        {.name = "threads", .kind = OPTION_INT, .value = &v->threads, .min = 0, .max = 1024, .help = "of the record"},
        {.name = "ce", .kind = OPTION_FLOAT, .value = &p->ce, .min = 0.01, .max = 10000, .metavar = "X", .help = "C_E"},
        {.name = "refine",
         .kind = OPTION_INT,
         .value = &p->levels,
         .min = 0,
         .max = VCACHE_MAX_LEVELS,
         .help = "levels, 1 for no refinement, 0 for log2 C_E"},
        {.name = "cn", .kind = OPTION_INT, .value = &p->normal_bins, .min = 1, .max = 64, .help = "C_N"},
        {.name = "cz", .kind = OPTION_INT, .value = &p->layers, .min = 1, .max = 64, .help = "C_Z"},
        {.name = "cr", .kind = OPTION_FLOAT, .value = &p->step, .min = 1.05, .max = 16, .metavar = "X", .help = "C_R"},
        {.name = "around",
         .kind = OPTION_CHOICE,
         .value = &a->around,
         .choices = around_names,
         .help = "clusters that must agree"},
        {.name = "share", .kind = OPTION_FLAG, .value = &p->share_lights, .help = "lights of a light cell share"},
        {.name = "hash",
         .kind = OPTION_CHOICE,
         .value = &a->hash,
         .choices = hash_names,
         .metavar = "H",
         .help = "also what a hash makes of the pairs' keys"},
        {.name = "cache-mb",
         .kind = OPTION_INT,
         .value = &a->cache_mb,
         .min = 1,
         .max = 16384,
         .help = "the table that --hash fills, MiB"},
    };
    const option_program program = {.name = "clusters",
                                    .summary = "How wrong clusters are, and where, against exact visibility.",
                                    .positional = "SCENE",
                                    .positional_help = "a .glb, .gltf, .obj or .ply file, or a built-in scene",
                                    .positional_value = &v->scene};
    options_status status = options_parse(&program, list, sizeof list / sizeof *list, argc, argv, err);
    if (status == OPTIONS_OK && !v->scene) {
        fail(err, "clusters: SCENE is missing");
        return OPTIONS_ERROR;
    }
    v->width = a->size.width, v->height = a->size.height;
    p->around = (around_cells)a->around;
    return status;
}

static void print_policy(const arguments *a, const record *r)
{
    const vcache_config config = clusters_config(&a->policy);
    const grid_policy *p = &a->policy;
    printf("\"scene\": \"%s\", \"triangles\": %llu, \"width\": %u, \"height\": %u, \"spp\": %d, \"lights\": %u, "
           "\"threads\": %d, \"ce\": %g, \"refine\": %d, \"cn\": %d, \"cz\": %d, \"cr\": %.7g, \"around\": %s, "
           "\"lights_share\": %s, ",
           r->scene->name, (unsigned long long)r->scene->triangle_count, a->view.width, a->view.height, a->view.spp,
           r->lights.count, a->view.threads, (double)p->ce, p->levels, config.normal_bins, config.layers,
           (double)config.resolution_step, around_names[a->around], p->share_lights ? "true" : "false");
}

static void run(const arguments *a, const record *r)
{
    size_t words = (size_t)r->count * r->words;
    replay_bits bits = {xcalloc(words, sizeof *bits.clustered), xcalloc(words, sizeof *bits.wrong)};
    replay_result x = replay_grid(r, &a->policy, &bits);
    double pairs = (double)r->pairs;
    printf("{");
    print_policy(a, r);
    printf("\"pairs\": %.0f, \"rays\": %.0f, \"share\": %.6g, \"reduction\": %.6g, \"mispredicted\": %.6g, \"l_inf\": "
           "%.6g, \"cells\": %u, ",
           pairs, (double)x.rays, (double)x.rays / pairs, pairs / fmax(1.0, (double)x.rays), (double)x.wrong / pairs,
           x.l_inf, x.cells);
    print_visibility(r, &a->policy, &bits);
    print_distances(r, &a->policy, &bits);
    if (a->hash)
        print_hash(r, &a->policy, &bits, (vcache_hash)(a->hash - 1), (uint64_t)a->cache_mb << 18);
    printf("}\n");
    free(bits.clustered);
    free(bits.wrong);
}

int main(int argc, char *argv[])
{
    arguments a = {.view = {.spp = 16, .vpls = 1024},
                   .size = {320, 180},
                   .policy = {.ce = 8, .normal_bins = 8, .layers = 8, .step = 1.2f},
                   .cache_mb = 4};
    message err = {{0}};
    options_status status = parse(&a, argc, argv, &err);
    if (status != OPTIONS_OK) {
        if (status == OPTIONS_ERROR)
            fprintf(stderr, "%s\n", err.text);
        return status == OPTIONS_HELP ? 0 : 2;
    }
    record r;
    bool ok = record_make(&a.view, &r, &err);
    if (ok)
        run(&a, &r);
    else
        fprintf(stderr, "clusters: %s\n", err.text);
    record_free(&r);
    return !ok;
}
