/* SPDX-License-Identifier: Apache-2.0 */
/* What do the rays that a cache cannot save cost, and what makes them cheaper? On the pairs that the estimator of
 * replay_estimator.c traces with K = 8: single rays and packets, unsorted and sorted in batches by light or by eye
 * sample; and a test of the triangle that blocked last before tracing. One thread; medians of 5 runs, which take turns.
 *
 *     misses SCENE [--env FILE] [--size WxH] [--spp N] [--vpls N]
 */
#include "occluders.h"
#include "replay.h"

#include "renderers/common/options.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

enum { RUNS = 5, RAYS_MAX = 1 << 19, DIGIT = 1 << 10 };

static const float ray_end = 1.0f - 0x1p-16f; /* as renderers/whitted/visibility.c */

typedef uint32_t pick[2]; /* eye sample, light */

typedef enum arrangement { SINGLE, INCOHERENT, COHERENT } arrangement;
typedef enum sorting { UNSORTED, BY_LIGHT, BY_EYE } sorting;
typedef enum memory_kind { BY_NOTHING, OF_LIGHT, OF_LIGHT_AND_CELL } memory_kind;

/* One line of the tables. */
typedef struct trial {
    arrangement arrangement;
    sorting sorting;
    uint32_t batch;
    /* with `last`: the scene that reports blockers */
    bool last, reporting;
    memory_kind memory;
    float ce; /* of the eye cell */
    double trace_ns[RUNS], sort_ns[RUNS];
    uint64_t saved, wrong, blocked;
} trial;

typedef struct bench {
    const record *r;
    vec3 *origins; /* of the eye samples, close together */
    pick *picks, *sorted, *scratch;
    size_t count;
    occluders *plain, *reporting;
    remembered *memory;
    uint32_t *slot; /* of each pick in the memory */
} bench;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static vec3 light_at(const bench *b, uint32_t i)
{
    const vpl_set *l = &b->r->lights;
    return v3(l->x[i], l->y[i], l->z[i]);
}

/* Radix sort of a batch by eye sample or light. */
static void sort(pick *picks, pick *scratch, size_t count, int by, uint32_t range)
{
    for (uint32_t shift = 0; shift < 32 && range >> shift; shift += 10) {
        uint32_t start[DIGIT + 1] = {0};
        for (size_t i = 0; i < count; i++)
            start[(picks[i][by] >> shift & (DIGIT - 1)) + 1]++;
        for (uint32_t d = 0; d < DIGIT; d++)
            start[d + 1] += start[d];
        for (size_t i = 0; i < count; i++)
            memcpy(scratch[start[picks[i][by] >> shift & (DIGIT - 1)]++], picks[i], sizeof *picks);
        memcpy(picks, scratch, count * sizeof *picks);
    }
}

static void set_lane(ray_packet *p, uint32_t lane, vec3 origin, vec3 direction)
{
    p->org_x[lane] = origin.x, p->org_y[lane] = origin.y, p->org_z[lane] = origin.z;
    p->dir_x[lane] = direction.x, p->dir_y[lane] = direction.y, p->dir_z[lane] = direction.z;
    p->tfar[lane] = ray_end;
}

static uint64_t trace_singles(const bench *b)
{
    uint64_t blocked = 0;
    for (size_t i = 0; i < b->count; i++) {
        vec3 origin = b->origins[b->sorted[i][0]];
        blocked += tracer_occluded(b->r->tracer, origin, v3_sub(light_at(b, b->sorted[i][1]), origin), ray_end);
    }
    return blocked;
}

static uint64_t trace_packets(const bench *b, bool coherent)
{
    static ray_packet p;
    uint64_t blocked = 0;
    packet_init(&p);
    for (size_t first = 0; first < b->count; first += TRACER_PACKET) {
        uint32_t n = b->count - first < TRACER_PACKET ? (uint32_t)(b->count - first) : TRACER_PACKET;
        for (uint32_t k = 0; k < n; k++) {
            vec3 origin = b->origins[b->sorted[first + k][0]];
            set_lane(&p, k, origin, v3_sub(light_at(b, b->sorted[first + k][1]), origin));
        }
        uint32_t mask = tracer_occluded16(b->r->tracer, &p, (1u << n) - 1, coherent);
        blocked += (uint32_t)__builtin_popcount(mask);
    }
    return blocked;
}

static bool truth_of(const bench *b, const pick p)
{
    return b->r->visible[(size_t)p[0] * b->r->words + p[1] / 64] >> p[1] % 64 & 1u;
}

static void remember(const bench *b, const occluders *o, uint32_t lane, size_t i)
{
    occluders_remember(o, occluders_blocker(o, lane), &b->memory[b->slot[i]]);
}

/* The remembered triangle first, then a single ray. */
static void last_singles(const bench *b, trial *t)
{
    occluders *o = t->reporting ? b->reporting : b->plain;
    for (size_t i = 0; i < b->count; i++) {
        vec3 origin = b->origins[b->picks[i][0]], direction = v3_sub(light_at(b, b->picks[i][1]), origin);
        if (t->memory && remembered_blocks(&b->memory[b->slot[i]], origin, direction, ray_end)) {
            t->saved++;
            t->wrong += truth_of(b, b->picks[i]);
        } else if (occluders_ray(o, origin, direction, ray_end)) {
            t->blocked++;
            if (t->memory)
                remember(b, o, 0, i);
        }
    }
}

/* The same with packets of what remains. */
static void last_packets(const bench *b, trial *t)
{
    static ray_packet p;
    occluders *o = t->reporting ? b->reporting : b->plain;
    size_t lanes[TRACER_PACKET];
    uint32_t n = 0;
    packet_init(&p);
    for (uint32_t k = 0; k < TRACER_PACKET; k++)
        p.id[k] = k;
    for (size_t i = 0; i < b->count; i++) {
        vec3 origin = b->origins[b->picks[i][0]], direction = v3_sub(light_at(b, b->picks[i][1]), origin);
        if (t->memory && remembered_blocks(&b->memory[b->slot[i]], origin, direction, ray_end)) {
            t->saved++;
            t->wrong += truth_of(b, b->picks[i]);
        } else {
            set_lane(&p, n, origin, direction);
            lanes[n++] = i;
        }
        if (n < TRACER_PACKET && i + 1 < b->count)
            continue;
        uint32_t blocked = n ? occluders_packet(o, &p, (1u << n) - 1) : 0;
        t->blocked += (uint32_t)__builtin_popcount(blocked);
        for (n = 0; t->memory && blocked; blocked &= blocked - 1)
            remember(b, o, (uint32_t)__builtin_ctz(blocked), lanes[__builtin_ctz(blocked)]);
        n = 0;
    }
}

/* Slots of the memory: one a light, or one for each light and eye cell that occur. */
static void prepare_memory(bench *b, const trial *t)
{
    const record *r = b->r;
    uint32_t lights = r->lights.count, used = lights;
    if (t->memory == OF_LIGHT) {
        for (size_t i = 0; i < b->count; i++)
            b->slot[i] = b->picks[i][1];
    } else if (t->memory == OF_LIGHT_AND_CELL) {
        vcache_config config = vcache_default_config();
        config.levels = 1;
        vcache *cache = record_cache(r, config);
        cells pairs;
        cells_new(&pairs, 1);
        for (size_t i = 0; i < b->count; i++) {
            _Alignas(8) char memory[VCACHE_EYE_BYTES];
            vcache_eye *end = (vcache_eye *)(void *)memory;
            vcache_surface at = record_surface(r, b->picks[i][0]);
            vcache_prepare_eye(cache, &at, t->ce, 0, end);
            b->slot[i] = cells_add(&pairs, hash_words(vcache_eye_cell(end, 0), b->picks[i][1], 1));
        }
        used = pairs.count > used ? pairs.count : used;
        cells_free(&pairs);
        vcache_destroy(&cache);
    }
    b->memory = xrealloc(b->memory, used * sizeof *b->memory);
    memset(b->memory, 0, used * sizeof *b->memory);
}

static void measure(bench *b, trial *t, int run)
{
    memcpy(b->sorted, b->picks, b->count * sizeof *b->picks);
    double start = now();
    for (size_t i = 0; t->sorting != UNSORTED && i < b->count; i += t->batch)
        sort(b->sorted + i, b->scratch, b->count - i < t->batch ? b->count - i : t->batch, t->sorting == BY_LIGHT,
             t->sorting == BY_LIGHT ? b->r->padded : b->r->count);
    double middle = now();
    t->saved = t->wrong = t->blocked = 0;
    if (t->last) {
        prepare_memory(b, t);
        middle = now();
    }
    if (t->last && t->arrangement == SINGLE)
        last_singles(b, t);
    else if (t->last)
        last_packets(b, t);
    else
        t->blocked = t->arrangement == SINGLE ? trace_singles(b) : trace_packets(b, t->arrangement == COHERENT);
    double end = now();
    t->sort_ns[run] = t->last ? 0.0 : 1e9 * (middle - start) / (double)b->count;
    t->trace_ns[run] = 1e9 * (end - middle) / (double)b->count;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print(const bench *b, trial *t)
{
    static const char *const arrangements[] = {"single rays", "16, incoherent", "16, coherent"};
    static const char *const sortings[] = {"as they come", "by light", "by eye sample"};
    char how[64];
    qsort(t->trace_ns, RUNS, sizeof *t->trace_ns, by_size);
    qsort(t->sort_ns, RUNS, sizeof *t->sort_ns, by_size);
    if (!t->last && t->sorting)
        snprintf(how, sizeof how, "%s in %u", sortings[t->sorting], t->batch);
    else if (!t->last)
        snprintf(how, sizeof how, "%s", sortings[t->sorting]);
    else if (t->memory == OF_LIGHT_AND_CELL)
        snprintf(how, sizeof how, "last of light and cell, ce %g", (double)t->ce);
    else
        snprintf(how, sizeof how, "%s", t->memory ? "last of light" : t->reporting ? "reports blockers" : "own scene");
    double rays = (double)b->count;
    printf("%-16s %-30s %8.1f %8.1f %8.1f %8.1f", arrangements[t->arrangement], how, t->trace_ns[RUNS / 2],
           t->trace_ns[0], t->trace_ns[RUNS - 1], t->sort_ns[RUNS / 2]);
    printf(" %8.2f %8.2f %9.4f\n", 100.0 * (double)(t->blocked + t->saved) / rays, 100.0 * (double)t->saved / rays,
           100.0 * (double)t->wrong / rays);
}

static uint32_t list_trials(trial *out)
{
    static const uint32_t batches[] = {512, 4096, 32768};
    uint32_t n = 0;
    for (int a = SINGLE; a <= COHERENT; a++) {
        out[n++] = (trial){.arrangement = (arrangement)a};
        for (int s = BY_LIGHT; s <= BY_EYE; s++)
            for (int k = 0; k < 3; k++)
                out[n++] = (trial){.arrangement = (arrangement)a, .sorting = (sorting)s, .batch = batches[k]};
    }
    for (int a = SINGLE; a <= INCOHERENT; a++) {
        const trial t = {.arrangement = (arrangement)a, .last = true};
        for (int k = 0; k < 5; k++) {
            out[n] = t;
            out[n].reporting = k > 0;
            out[n].memory = k < 2 ? BY_NOTHING : k == 2 ? OF_LIGHT : OF_LIGHT_AND_CELL;
            out[n++].ce = k == 3 ? 128.0f : 32.0f;
        }
    }
    return n;
}

static bool run(const record *r, message *err)
{
    static trial trials[64];
    const estimator_policy p = {.rays = 8};
    bench b = {.r = r};
    b.picks = xmalloc((size_t)r->count * 32 * sizeof *b.picks);
    b.count = replay_estimator(r, &p, NULL, b.picks).rays;
    pick *all = b.picks;
    if (b.count > RAYS_MAX) { /* from the middle of the frame, where the cells hold something */
        b.picks += (b.count - RAYS_MAX) / 2;
        b.count = RAYS_MAX;
    }
    b.sorted = xmalloc(b.count * sizeof *b.sorted);
    b.scratch = xmalloc(b.count * sizeof *b.scratch);
    b.slot = xcalloc(b.count, sizeof *b.slot);
    b.origins = xmalloc(r->count * sizeof *b.origins);
    for (uint32_t i = 0; i < r->count; i++)
        b.origins[i] = r->eyes[i].origin;
    bool ok = occluders_new(r->scene, false, &b.plain, err) && occluders_new(r->scene, true, &b.reporting, err);
    uint32_t count = list_trials(trials);
    for (int k = -1; ok && k < RUNS; k++) /* the first warms up */
        for (uint32_t i = 0; i < count; i++)
            measure(&b, &trials[i], k < 0 ? 0 : k);
    if (ok)
        printf("%zu rays; ns per ray (median, smallest, largest), sorting beside it; shares in %%\n%-16s %-30s %8s %8s "
               "%8s "
               "%8s %8s %8s %9s\n",
               b.count, "", "", "ns", "from", "to", "sort", "blocked", "saved", "wrong");
    for (uint32_t i = 0; ok && i < count; i++)
        print(&b, &trials[i]);
    occluders_free(b.plain);
    occluders_free(b.reporting);
    free(all);
    free(b.sorted);
    free(b.scratch);
    free(b.slot);
    free(b.origins);
    free(b.memory);
    return ok;
}

int main(int argc, char *argv[])
{
    record_options o = {.spp = 16, .vpls = 1024};
    option_size size = {320, 180};
    message err = {{0}};
    const option list[] = {
        {.name = "env", .kind = OPTION_STRING, .value = &o.env, .metavar = "FILE", .help = "environment map"},
        {.name = "size", .kind = OPTION_SIZE, .value = &size, .min = 1, .max = 4096, .help = "size in pixels"},
        {.name = "spp", .kind = OPTION_INT, .value = &o.spp, .min = 1, .max = 1024, .help = "eye paths per pixel"},
        {.name = "vpls", .kind = OPTION_INT, .value = &o.vpls, .min = 1, .max = 65536, .help = "virtual lights"},
    };
    const option_program program = {.name = "misses",
                                    .summary = "What the rays that a cache cannot save cost.",
                                    .positional = "SCENE",
                                    .positional_help = "a .glb, .gltf, .obj or .ply file, or a built-in scene",
                                    .positional_value = &o.scene};
    options_status status = options_parse(&program, list, sizeof list / sizeof *list, argc, argv, &err);
    if (status == OPTIONS_OK && !o.scene) {
        fail(&err, "misses: SCENE is missing");
        status = OPTIONS_ERROR;
    }
    if (status != OPTIONS_OK) {
        if (status == OPTIONS_ERROR)
            fprintf(stderr, "%s\n", err.text);
        return status == OPTIONS_HELP ? 0 : 2;
    }
    o.width = size.width, o.height = size.height;
    record r;
    bool ok = record_make(&o, &r, &err) && run(&r, &err);
    record_free(&r);
    if (!ok)
        fprintf(stderr, "misses: %s\n", err.text);
    return ok ? 0 : 1;
}
