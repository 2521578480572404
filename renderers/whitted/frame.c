/* SPDX-License-Identifier: Apache-2.0 */
/* One frame: virtual point lights, then tiles on all cores. */
#include "whitted.h"

#include "../common/interrupt.h"
#include "../common/parallel.h"
#include "../common/progress.h"
#include "../../halton/halton.h"

#include <stdatomic.h>
#include <string.h>
#include <time.h>

/* Tiles of a region, 128 x 128 pixels, the task of a thread. What is learnt in one is not known in the others, so that
 * neither the number of threads nor their turns change the image. With 8 the estimate's squared error grows by 5 %,
 * with more than 16 it does not shrink; fewer regions than threads leave some without work. */
enum { REGION = 16 };

/* What one thread needs. */
typedef struct station {
    eye_samples samples;
    const vpl_set *lights; /* of the chunk */
    chunk chunk;
    caches caches; /* unless shared */
    uint64_t cache_bytes;
    visibility *visibility;
    estimator *estimator; /* NULL: visibility decides all */
    adaptive *adaptive;   /* NULL: all lights are tested */
    grid_station *grid;   /* NULL: no lights by the grid */
    const tile *tile;     /* of the grid's block */
    ray_counts rays;      /* of the regions before */
    tile_pixels pixels;
    uint32_t *order; /* of eye samples */
    size_t order_capacity;
    bool aside; /* this pass is exact */
    double shade_s, visibility_s;
    uint64_t mispredicted, sample_count;
    bool ready;
} station;

typedef struct job {
    const view *v;
    visibility_mode mode; /* that serves this frame: exact where the chosen one cannot pay */
    const vpl_set *vpls;
    caches shared;
    vcache_adaptive *rates; /* NULL: not adaptive */
    grid_scene *grid;
    uint32_t *tile_order; /* of the grid: tile by row and column */
    station *stations;
    tile *tiles;
    size_t tile_count, stretch; /* tiles a task */
    int passes;                 /* of a tile */
    uint32_t rank[TILE * TILE]; /* of a pixel in Halton order */
    truth *record;
    const truth *check;
    progress *progress;
    frame *out;
    atomic_bool failed; /* no memory for a cache: the first says why */
    message *err;
} job;

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Tiles along a Morton curve: neighbours in time are neighbours in the image and share cells. */
static tile *tiles_new(const settings *f, size_t *count)
{
    uint32_t across = (f->width + TILE - 1) / TILE, down = (f->height + TILE - 1) / TILE;
    tile *tiles = xmalloc((size_t)across * down * sizeof *tiles);
    size_t n = 0;
    for (uint64_t code = 0; n < (size_t)across * down; code++) {
        uint32_t x, y;
        halton_morton_decode(code, &x, &y);
        if (x >= across || y >= down)
            continue;
        tile t = {x * TILE, y * TILE, TILE, TILE, (uint32_t)n};
        t.width = f->width - t.x < TILE ? f->width - t.x : TILE;
        t.height = f->height - t.y < TILE ? f->height - t.y : TILE;
        tiles[n++] = t;
    }
    *count = n;
    return tiles;
}

static bool asks_cache(visibility_mode mode)
{
    return mode != VISIBILITY_EXACT && mode != VISIBILITY_ADAPTIVE && mode != VISIBILITY_GRID;
}

/* Eye samples in the order they are lit: for the cache by the Halton order of their pixels (Sect. 4.3), which decides
 * who speaks for a cell; for packets as they are. */
static void sort_samples(const job *j, station *s)
{
    size_t n = s->samples.count;
    if (n > s->order_capacity) {
        s->order_capacity = 2 * n;
        s->order = xrealloc(s->order, s->order_capacity * sizeof *s->order);
    }
    if (!asks_cache(j->mode) || s->aside) {
        for (size_t i = 0; i < n; i++)
            s->order[i] = (uint32_t)i;
        return;
    }
    uint32_t start[TILE * TILE + 1] = {0};
    for (size_t i = 0; i < n; i++)
        start[j->rank[s->samples.items[i].pixel] + 1]++;
    for (uint32_t r = 0; r < TILE * TILE; r++)
        start[r + 1] += start[r];
    for (size_t i = 0; i < n; i++)
        s->order[start[j->rank[s->samples.items[i].pixel]]++] = (uint32_t)i;
}

/* Rows of bits of one eye sample, all groups one behind the other. */
static uint32_t row_words(const chunk *c)
{
    return c->bits[0].words + c->bits[1].words + c->bits[2].words;
}

static void record_truth(const station *s, size_t first, uint64_t *rows)
{
    const chunk *c = &s->chunk;
    uint32_t words = row_words(c);
    for (uint32_t e = 0; e < c->count; e++) {
        uint64_t *row = rows + (size_t)s->order[first + e] * words;
        for (int g = 0; g < LIGHT_GROUPS; g++) {
            memcpy(row, c->bits[g].visible + (size_t)e * c->bits[g].words, c->bits[g].words * sizeof *row);
            row += c->bits[g].words;
        }
    }
}

static void check_truth(station *s, size_t first, const uint64_t *rows)
{
    const chunk *c = &s->chunk;
    uint32_t words = row_words(c);
    for (uint32_t e = 0; e < c->count; e++) {
        const uint64_t *row = rows + (size_t)s->order[first + e] * words;
        for (int g = 0; g < LIGHT_GROUPS; g++)
            for (uint32_t w = 0; w < c->bits[g].words; w++) {
                size_t at = (size_t)e * c->bits[g].words + w;
                s->mispredicted +=
                    (uint32_t)__builtin_popcountll((*row++ ^ c->bits[g].visible[at]) & c->bits[g].asked[at]);
            }
    }
}

static rgb false_colour(uint64_t id)
{
    if (!id)
        return v3(0, 0, 0);
    uint64_t h = rng_mix(id);
    return v3((float)(h & 255) / 255.0f, (float)(h >> 8 & 255) / 255.0f, (float)(h >> 16 & 255) / 255.0f);
}

static void copy_out(const job *j, tile t, const tile_pixels *p)
{
    for (uint32_t y = 0; y < t.height; y++)
        for (uint32_t x = 0; x < t.width; x++) {
            size_t from = (size_t)y * TILE + x, to = (size_t)(t.y + y) * j->v->settings.width + t.x + x;
            j->out->seen.pixels[to] = p->seen[from];
            j->out->lit.pixels[to] = p->lit[from];
            j->out->image.pixels[to] = v3_add(p->seen[from], p->lit[from]);
            j->out->normal.pixels[to] = p->normal[from];
            if (j->out->cells.pixels)
                j->out->cells.pixels[to] = false_colour(p->cell[from]);
            j->out->depth[to] = p->depth[from];
            j->out->traced_share[to] =
                p->asked[from] ? fminf(1.0f, (float)p->traced[from] / (float)p->asked[from]) : 0.0f;
        }
}

/* Whoever begins a region knows nothing of the others. False where there is no memory. */
static bool begin_region(job *j, station *s)
{
    bool shared = j->v->settings.shared;
    message err;
    if (!shared && asks_cache(j->mode) && !caches_new(j->v, j->vpls, &s->caches, &err)) {
        caches_free(&s->caches);
        if (!atomic_exchange(&j->failed, true) && j->err)
            *j->err = err;
        return false;
    }
    s->cache_bytes = s->caches.bytes;
    const caches *c = shared ? &j->shared : &s->caches;
    if (estimates(j->mode))
        s->estimator = estimator_new(j->v, j->vpls, c->all_set);
    s->lights = s->estimator ? &vpls_none : j->vpls; /* what is left to the chunk is exact then */
    bool cached = j->mode == VISIBILITY_CACHE || j->mode == VISIBILITY_ADAPTIVE_CACHE;
    s->visibility = visibility_new(j->v, s->lights, cached ? c : NULL);
    if (!s->ready) {
        tracer_thread_init();
        chunk_new(&s->chunk, j->v, s->lights, s->estimator && estimator_punctual(j->v) ? 0 : j->v->scene->light_count);
        s->adaptive = adaptive_new(j->v, s->lights, j->rates);
        s->ready = true;
    }
    return true;
}

static void end_region(station *s)
{
    ray_counts r = visibility_counts(s->visibility);
    s->rays.asked += r.asked;
    s->rays.traced += r.traced;
    if (s->estimator) {
        r = estimator_counts(s->estimator);
        s->rays.asked += r.asked;
        s->rays.traced += r.traced;
    }
    estimator_free(s->estimator);
    visibility_free(s->visibility);
    caches_free(&s->caches);
    s->estimator = NULL;
    s->visibility = NULL;
}

/* Lights the eye samples of one pass over a tile. */
static void light_samples(job *j, station *s, size_t pass)
{
    double start = now();
    s->aside = visibility_steps_aside(s->visibility);
    sort_samples(j, s);
    if (j->record)
        j->record->passes[pass] = xcalloc(s->samples.count * row_words(&s->chunk) + 1, sizeof(uint64_t));
    for (size_t i = 0; i < s->samples.count && !interrupted(); i += CHUNK) {
        chunk *c = &s->chunk;
        c->count = s->samples.count - i < CHUNK ? (uint32_t)(s->samples.count - i) : CHUNK;
        for (uint32_t e = 0; e < c->count; e++)
            c->eyes[e] = &s->samples.items[s->order[i + e]];
        shade_unoccluded(j->v, s->lights, c);
        double before = now();
        if (s->grid)
            grid_resolve(s->grid, s->visibility, s->tile, c, &s->pixels);
        else if (!s->adaptive)
            visibility_resolve(s->visibility, c, &s->pixels);
        s->visibility_s += now() - before;
        if (s->adaptive)
            adaptive_light(s->adaptive, s->visibility, c, &s->pixels);
        else
            shade_sum(s->lights, c, &s->pixels);
        if (s->estimator)
            estimator_light(s->estimator, c->eyes, c->count, &s->pixels);
        if (j->record)
            record_truth(s, i, j->record->passes[pass]);
        if (j->check && j->check->passes[pass])
            check_truth(s, i, j->check->passes[pass]);
    }
    s->shade_s += now() - start;
    s->sample_count += s->samples.count;
}

static void render_tile(job *j, station *s, tile t)
{
    int spp = j->v->settings.spp;
    memset(&s->pixels, 0, sizeof s->pixels);
    for (int pass = 0; pass < j->passes && !interrupted(); pass++) {
        int first = pass * PASS, count = spp - first < PASS ? spp - first : PASS;
        eye_paths(j->v, t, first, count, &s->samples, &s->pixels);
        light_samples(j, s, (size_t)t.index * (size_t)j->passes + (size_t)pass);
    }
    copy_out(j, t, &s->pixels);
    progress_add(j->progress, (uint64_t)t.width * t.height);
}

static void render_block(void *context, int thread, size_t index)
{
    job *j = context;
    station *s = &j->stations[thread];
    if (!begin_region(j, s))
        return;
    grid_tile *tiles;
    double seconds = 0.0;
    uint32_t count = grid_block(s->grid, (uint32_t)index, &tiles, &seconds);
    s->shade_s += seconds;
    s->visibility_s += seconds;
    eye_samples own = s->samples;
    for (uint32_t k = 0; k < count; k++) {
        s->tile = &tiles[k].tile;
        s->samples = tiles[k].samples;
        s->pixels = *tiles[k].pixels;
        light_samples(j, s, j->tile_order[s->tile->index]);
        copy_out(j, *s->tile, &s->pixels);
        progress_add(j->progress, (uint64_t)s->tile->width * s->tile->height);
    }
    s->samples = own;
    end_region(s);
}

static void render_region(void *context, int thread, size_t index)
{
    job *j = context;
    station *s = &j->stations[thread];
    size_t end = (index + 1) * j->stretch < j->tile_count ? (index + 1) * j->stretch : j->tile_count;
    if (!begin_region(j, s))
        return;
    for (size_t i = index * j->stretch; i < end && !interrupted(); i++)
        render_tile(j, s, j->tiles[i]);
    end_region(s);
}

/* Hit rates of all lights, before the first region. */
static bool learn_rates(job *j, station *s)
{
    if (!begin_region(j, s))
        return false;
    adaptive_learn(s->adaptive, s->visibility, &s->chunk);
    end_region(s);
    return true;
}

/* Without directional lights there is nothing for the grid to decide. */
static bool make_grid(job *j, int threads, message *err)
{
    if (!grid_scene_new(j->v, &j->grid, err))
        return false;
    if (grid_light_count(j->grid) == 0)
        j->mode = VISIBILITY_EXACT;
    uint32_t across = (j->v->settings.width + TILE - 1) / TILE;
    j->tile_order = xmalloc(j->tile_count * sizeof *j->tile_order);
    for (uint32_t i = 0; i < j->tile_count; i++)
        j->tile_order[j->tiles[i].y / TILE * across + j->tiles[i].x / TILE] = i;
    for (int i = 0; i < threads && j->mode == VISIBILITY_GRID; i++)
        if (!grid_station_new(j->grid, &j->stations[i].grid, err))
            return false;
    return true;
}

bool uses_cache(visibility_mode mode)
{
    return asks_cache(mode) && mode != VISIBILITY_SELECT;
}

static void allocate(const settings *f, frame *out)
{
    image *images[] = {&out->seen, &out->lit, &out->image, &out->normal};
    for (size_t i = 0; i < sizeof images / sizeof *images; i++)
        *images[i] = image_new(f->width, f->height);
    if (uses_cache(f->visibility))
        out->cells = image_new(f->width, f->height);
    out->depth = xcalloc((size_t)f->width * f->height, sizeof *out->depth);
    out->traced_share = xcalloc((size_t)f->width * f->height, sizeof *out->traced_share);
}

uint64_t frame_bytes(const settings *f)
{
    return (uint64_t)f->width * f->height * (5 * sizeof(rgb) + 2 * sizeof(float));
}

bool frame_render(const view *v, const char *title, bool quiet, truth *record, const truth *check, frame *out,
                  message *err)
{
    const settings *f = &v->settings;
    memset(out, 0, sizeof *out);
    if (adapts(f->visibility) && f->tolerance == 0.0f) {
        view all = *v;
        all.settings.visibility = f->visibility == VISIBILITY_ADAPTIVE ? VISIBILITY_EXACT : VISIBILITY_CACHE;
        return frame_render(&all, title, quiet, record, check, out, err);
    }
    job j = {.v = v, .record = record, .check = check, .out = out, .err = err};
    allocate(f, out);
    double start = now();
    vpl_set own = v->vpls ? vpls_none : vpls_new(v);
    const vpl_set *vpls = v->vpls ? v->vpls : &own;
    out->lights_s = now() - start;
    j.vpls = vpls;
    frame_lights *lights = out->extra = xmalloc(sizeof *lights);
    *lights = (frame_lights){.vpls = vpls->count, .punctual = v->scene->light_count, .samples = direct_sample_count(v)};

    int threads = parallel_thread_count(f->threads);
    j.stations = xcalloc((size_t)threads, sizeof *j.stations);
    j.tiles = tiles_new(f, &j.tile_count);
    j.passes = (f->spp + PASS - 1) / PASS;
    if (record) {
        record->pass_count = j.tile_count * (size_t)j.passes;
        record->passes = xcalloc(record->pass_count, sizeof *record->passes);
    }
    uint32_t order[TILE * TILE], starts[HALTON_MAX_SEGMENTS + 1], segments;
    j.mode = estimates(f->visibility) && !estimator_pays(v, vpls) ? VISIBILITY_EXACT : f->visibility;
    double ce = !asks_cache(j.mode) ? 1.0 : (double)f->ce / sqrt(f->spp);
    halton_order(TILE, TILE, ce, order, starts, &segments);
    for (uint32_t i = 0; i < TILE * TILE; i++)
        j.rank[order[i]] = i;

    bool ok = (j.mode != VISIBILITY_GRID || make_grid(&j, threads, err)) &&
              (!asks_cache(j.mode) || !f->shared || caches_new(v, vpls, &j.shared, err)) &&
              (!adapts(j.mode) || adaptive_rates_new(v, vpls, &j.rates, err)) &&
              (!j.rates || f->shared || learn_rates(&j, &j.stations[0]));
    lights->served = j.mode;
    if (ok) {
        j.progress = progress_new(title, (uint64_t)f->width * f->height, quiet);
        j.stretch = asks_cache(j.mode) ? REGION : 1; /* single tiles where nothing is learnt */
        bool by_grid = j.mode == VISIBILITY_GRID;
        size_t regions = by_grid ? grid_blocks(j.grid) : (j.tile_count + j.stretch - 1) / j.stretch;
        parallel_for_until(f->threads, regions, by_grid ? render_block : render_region, &j, &j.failed);
        ok = !atomic_load(&j.failed);
        out->frame_s = now() - start;
        out->cache_bytes = j.shared.bytes;
        for (int i = 0; i < threads; i++) /* a region comes to each thread, if there are so many */
            if (j.stations[i].cache_bytes)
                out->cache_bytes = j.stations[i].cache_bytes * ((size_t)threads < regions ? (size_t)threads : regions);
        out->complete = !interrupted();
        progress_free(j.progress);
    }
    for (int i = 0; i < threads; i++) {
        station *s = &j.stations[i];
        out->shade_s += s->shade_s / threads;
        lights->visibility_s += s->visibility_s / threads;
        out->mispredicted += s->mispredicted;
        out->eye_samples += s->sample_count;
        out->rays.asked += s->rays.asked;
        out->rays.traced += s->rays.traced;
        if (s->grid) {
            ray_counts r = grid_counts(s->grid, &lights->grid);
            out->cache_bytes = lights->grid.bytes;
            out->rays.asked += r.asked;
            out->rays.traced += r.traced;
        }
        if (s->ready) {
            adaptive_free(s->adaptive);
            chunk_free(&s->chunk);
        }
        free(s->samples.items);
        free(s->order);
        grid_station_free(s->grid);
    }
    grid_scene_free(j.grid);
    free(j.tile_order);
    caches_free(&j.shared);
    vcache_adaptive_destroy(&j.rates);
    free(j.stations);
    free(j.tiles);
    vpls_free(&own);
    return ok;
}

void truth_free(truth *t)
{
    for (size_t i = 0; i < t->pass_count; i++)
        free(t->passes[i]);
    free(t->passes);
    memset(t, 0, sizeof *t);
}
