/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Directional lights by the grid-coherence mode of vcache/grid.h; all others are traced.
 *
 * A block of tiles is decided as a whole by one thread. Its lattice is that of the eye samples: k x k places in each
 * pixel. Samples behind mirrors and glass lie outside of it and are traced, as are lights that are not directional.
 */
#include "whitted.h"

#include "../common/interrupt.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

struct grid_scene {
    const view *view;
    vcache_grid_lights *lights;
    vcache_grid_config config;
    uint32_t count, words; /* of directional lights */
    uint32_t *light;       /* [count] which of the scene's */
    bool first;            /* they are the scene's first: rows of bits are the same */
    punctual_set punctual; /* all of the scene's */
    uint32_t side;         /* tiles of a block */
    uint32_t across, down; /* blocks */
    uint32_t places;       /* k */
};

struct grid_station {
    const grid_scene *scene;
    vcache_grid *grid;
    grid_tile *tiles;
    uint32_t tile_count;
    uint32_t x, y, width, height; /* of the block, lattice pixels of the image */
    vec3 *origin;                 /* [lattice] of shadow rays */
    uint32_t *traced;             /* [lattice] */
    vcache_answer *answers;
    float *distances; /* NULL: nobody asks */
    float *cosines;
    vec3 normal, geometric_normal; /* of the sample that was asked for last */
    const uint64_t *like;          /* what it asked for; NULL: none in this block */
    uint64_t *kept;                /* [CHUNK][words of the scene's lights] */
    ray_packet packet;
    uint64_t asked;
    double rays_s;
};

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---------------------------------------------------------------------------------------------------- the scene */

bool grid_parse(const char *text, settings *f, message *err)
{
    char mode[64], why[VCACHE_MESSAGE_BYTES], *block, *end;
    f->grid = vcache_grid_default_config();
    f->grid_block = 64;
    if (!text)
        return true;
    snprintf(mode, sizeof mode, "%s", text);
    if (strlen(text) < sizeof mode && (block = strstr(mode, ",block="))) {
        unsigned long n = strtoul(block + 7, &end, 10);
        if (end == block + 7 || (*end && *end != ',') || n > 65535)
            return fail(err, "--visibility grid: block=N is a whole number of lattice pixels, 0 for the whole image");
        f->grid_block = (uint32_t)n;
        memmove(block, end, strlen(end) + 1);
    }
    if (!vcache_grid_parse_mode(mode, &f->grid, why))
        return fail(err, "--visibility grid: %s", why);
    return true;
}

bool grid_samples_fit(int spp)
{
    int k = (int)(sqrt((double)spp) + 0.5);
    return k * k == spp && spp <= PASS;
}

static void collect_lights(grid_scene *g, const scene *s)
{
    g->punctual = punctuals_new(s, s->light_count);
    g->light = xmalloc((s->light_count + 1) * sizeof *g->light);
    g->first = true;
    for (uint32_t i = 0; i < s->light_count; i++) {
        if (s->lights[i].kind != LIGHT_DIRECTIONAL)
            continue;
        g->first = g->first && i == g->count;
        g->light[g->count++] = i;
    }
    g->words = (g->count + 63) / 64;
}

static bool make_cells(grid_scene *g, const scene *s, message *err)
{
    float *directions = xmalloc((size_t)3 * g->count * sizeof *directions);
    float *energy = xmalloc(g->count * sizeof *energy);
    char why[VCACHE_MESSAGE_BYTES];
    for (uint32_t i = 0; i < g->count; i++) {
        const light *l = &s->lights[g->light[i]];
        vec3_store(directions + 3 * (size_t)i, v3_neg(l->direction));
        energy[i] = luminance(l->intensity);
    }
    bool ok = vcache_grid_create_lights(directions, energy, g->count, NULL, &g->lights, why) == VCACHE_OK;
    free(directions);
    free(energy);
    return ok || fail(err, "%s", why);
}

/* The last block of a row takes what is less than half of one. */
static uint32_t blocks_along(uint32_t pixels, uint32_t side)
{
    uint32_t n = (pixels + side * TILE / 2) / (side * TILE);
    return n > 0 ? n : 1;
}

bool grid_scene_new(const view *v, grid_scene **out, message *err)
{
    const settings *f = &v->settings;
    grid_scene *g = xcalloc(1, sizeof *g);
    *out = g;
    g->view = v;
    g->config = f->grid;
    g->places = (uint32_t)(sqrt((double)f->spp) + 0.5);
    collect_lights(g, v->scene);
    if (g->count == 0)
        return true;
    uint32_t tiles = ((f->width > f->height ? f->width : f->height) + TILE - 1) / TILE;
    g->side = f->grid_block / (TILE * g->places);
    if (f->grid_block == 0 || g->side > tiles)
        g->side = tiles;
    g->side = g->side > 0 ? g->side : 1;
    g->across = blocks_along(f->width, g->side);
    g->down = blocks_along(f->height, g->side);
    uint64_t longest = (uint64_t)g->side * TILE * 3 / 2 * g->places, most_x = (uint64_t)f->width * g->places;
    uint64_t most_y = (uint64_t)f->height * g->places;
    uint64_t pixels = (longest < most_x ? longest : most_x) * (longest < most_y ? longest : most_y);
    if (pixels > 1u << 24)
        return fail(err, "--visibility grid: a block of %llu lattice pixels is too large", (unsigned long long)pixels);
    g->config.pixels = (uint32_t)pixels;
    if (g->config.rays < g->count)
        g->config.rays = g->count;
    return make_cells(g, v->scene, err);
}

void grid_scene_free(grid_scene *g)
{
    if (!g)
        return;
    vcache_grid_destroy_lights(&g->lights);
    free(g->light);
    punctuals_free(&g->punctual);
    free(g);
}

uint32_t grid_blocks(const grid_scene *g)
{
    return g->across * g->down;
}

uint32_t grid_light_count(const grid_scene *g)
{
    return g->count;
}

/* ------------------------------------------------------------------------------------------------------ a station */

bool grid_station_new(const grid_scene *g, grid_station **out, message *err)
{
    grid_station *o = NULL;
    char why[VCACHE_MESSAGE_BYTES];
    if (posix_memalign((void **)&o, 64, sizeof *o))
        o = xmalloc(SIZE_MAX);
    memset(o, 0, sizeof *o);
    *out = o;
    o->scene = g;
    if (vcache_grid_create(&g->config, g->lights, &o->grid, why) != VCACHE_OK)
        return fail(err, "%s", why);
    uint32_t longest = (g->side * 3 + 1) / 2 + 1;
    o->tiles = xcalloc((size_t)longest * longest, sizeof *o->tiles);
    o->origin = xmalloc(g->config.pixels * sizeof *o->origin);
    o->traced = xmalloc(g->config.pixels * sizeof *o->traced);
    o->answers = xmalloc(g->config.rays * sizeof *o->answers);
    o->distances = g->config.warping ? xmalloc(g->config.rays * sizeof *o->distances) : NULL;
    o->cosines = floats_new(g->punctual.padded);
    o->kept = xmalloc(((size_t)CHUNK * ((g->view->scene->light_count + 63) / 64) + 1) * sizeof *o->kept);
    packet_init(&o->packet);
    return true;
}

void grid_station_free(grid_station *o)
{
    if (!o)
        return;
    vcache_grid_destroy(&o->grid);
    uint32_t longest = (o->scene->side * 3 + 1) / 2 + 1;
    for (uint32_t k = 0; o->tiles && k < longest * longest; k++) {
        free(o->tiles[k].samples.items);
        free(o->tiles[k].pixels);
    }
    free(o->tiles);
    free(o->origin);
    free(o->traced);
    free(o->answers);
    free(o->distances);
    free(o->cosines);
    free(o->kept);
    free(o);
}

/* ---------------------------------------------------------------------------------------------------------- a block */

/* Lattice pixel of an eye sample in the block; false: behind mirrors or glass. */
static bool lattice_pixel(const grid_station *o, const tile *t, const eye_sample *e, uint32_t *x, uint32_t *y)
{
    uint32_t k = o->scene->places;
    if (e->place == PLACE_NONE)
        return false;
    *x = (t->x + e->pixel % TILE) * k + e->place % k - o->x;
    *y = (t->y + e->pixel / TILE) * k + e->place / k - o->y;
    return true;
}

static bool same(vec3 a, vec3 b)
{
    return a.x == b.x && a.y == b.y && a.z == b.z;
}

/* Lights above the horizon: on a flat surface the same as at the sample before. */
static void ask(grid_station *o, const eye_sample *e, uint64_t *asked)
{
    const grid_scene *g = o->scene;
    const surface *s = &e->surface;
    if (!(material_reflectance(s) > 0.0f))
        return;
    if (o->like && same(s->normal, o->normal) && same(s->geometric_normal, o->geometric_normal)) {
        memcpy(asked, o->like, g->words * sizeof *asked);
        return;
    }
    o->normal = s->normal;
    o->geometric_normal = s->geometric_normal;
    o->like = asked;
    punctuals_cosines(&g->punctual, &e->surface, o->cosines);
    if (g->first) {
        shade_bits_above(o->cosines, 0.0f, g->words, asked);
        return;
    }
    for (uint32_t i = 0; i < g->count; i++)
        asked[i / 64] |= (uint64_t)(o->cosines[g->light[i]] > 0.0f) << i % 64;
}

static void place_samples(grid_station *o, const grid_tile *t)
{
    for (size_t i = 0; i < t->samples.count; i++) {
        const eye_sample *e = &t->samples.items[i];
        uint32_t x, y;
        if (!lattice_pixel(o, &t->tile, e, &x, &y))
            continue;
        float position[3];
        vec3_store(position, e->origin);
        ask(o, e, vcache_grid_pixel(o->grid, x, y, e->surface.instance, position));
        o->origin[(size_t)y * o->width + x] = e->origin;
    }
}

static void aim(ray_packet *p, uint32_t lane, vec3 origin, vec3 direction)
{
    p->org_x[lane] = origin.x, p->org_y[lane] = origin.y, p->org_z[lane] = origin.z;
    p->dir_x[lane] = direction.x, p->dir_y[lane] = direction.y, p->dir_z[lane] = direction.z;
    p->tfar[lane] = INFINITY;
}

static void trace(grid_station *o, const vcache_grid_ray *rays, uint32_t count)
{
    const grid_scene *g = o->scene;
    const light *lights = g->view->scene->lights;
    ray_packet *p = &o->packet;
    /* Where few rays are left they are the hard ones, and near each other they do not run together. */
    bool coherent = g->config.order == VCACHE_GRID_TRUE;
    for (uint32_t first = 0; first < count;) {
        uint32_t n = 0, same = rays[first].light;
        vec3 direction = v3_neg(lights[g->light[same]].direction);
        for (; n < GROUP && first + n < count && rays[first + n].light == same; n++) {
            uint32_t pixel = rays[first + n].pixel;
            aim(p, n, o->origin[pixel], direction);
            o->traced[pixel]++;
        }
        uint32_t blocked = tracer_occluded16(g->view->tracer, p, (1u << n) - 1u, coherent);
        for (uint32_t k = 0; k < n; k++)
            o->answers[first + k] = blocked >> k & 1u ? VCACHE_BLOCKED : VCACHE_VISIBLE;
        first += n;
    }
    /* How far blockers are only warping needs to know. */
    for (uint32_t i = 0; o->distances && i < count; i++) {
        surface hit;
        o->distances[i] = INFINITY;
        if (o->answers[i] == VCACHE_BLOCKED &&
            tracer_closest_opaque(g->view->tracer, o->origin[rays[i].pixel],
                                  v3_neg(lights[g->light[rays[i].light]].direction), &hit))
            o->distances[i] = hit.distance;
    }
}

static void decide(grid_station *o)
{
    vcache_grid_begin(o->grid, o->width, o->height);
    o->like = NULL;
    memset(o->traced, 0, (size_t)o->width * o->height * sizeof *o->traced);
    for (uint32_t k = 0; k < o->tile_count; k++)
        place_samples(o, &o->tiles[k]);
    uint32_t count;
    const vcache_grid_ray *rays;
    while (rays = vcache_grid_next(o->grid, &count), count > 0 && !interrupted()) {
        double start = now();
        trace(o, rays, count);
        o->rays_s += now() - start;
        vcache_grid_tell(o->grid, o->answers, o->distances);
    }
}

/* Of a block along one axis. */
static void extent(uint32_t index, uint32_t blocks, uint32_t side, uint32_t pixels, uint32_t *from, uint32_t *to)
{
    *from = index * side * TILE;
    *to = index + 1 == blocks ? pixels : (index + 1) * side * TILE;
}

uint32_t grid_block(grid_station *o, uint32_t index, grid_tile **tiles, double *seconds)
{
    const grid_scene *g = o->scene;
    const settings *f = &g->view->settings;
    uint32_t x0, x1, y0, y1, across = (f->width + TILE - 1) / TILE;
    extent(index % g->across, g->across, g->side, f->width, &x0, &x1);
    extent(index / g->across, g->down, g->side, f->height, &y0, &y1);
    o->x = x0 * g->places;
    o->y = y0 * g->places;
    o->width = (x1 - x0) * g->places;
    o->height = (y1 - y0) * g->places;
    o->tile_count = 0;
    for (uint32_t y = y0; y < y1; y += TILE)
        for (uint32_t x = x0; x < x1; x += TILE) {
            grid_tile *t = &o->tiles[o->tile_count++];
            t->tile = (tile){x, y, x1 - x < TILE ? x1 - x : TILE, y1 - y < TILE ? y1 - y : TILE,
                             y / TILE * across + x / TILE};
            t->pixels = t->pixels ? t->pixels : xmalloc(sizeof *t->pixels);
            memset(t->pixels, 0, sizeof *t->pixels);
            eye_paths(g->view, t->tile, 0, f->spp, &t->samples, t->pixels);
        }
    double start = now();
    decide(o);
    *seconds += now() - start;
    *tiles = o->tiles;
    return o->tile_count;
}

/* ---------------------------------------------------------------------------------------------------------- a chunk */

/* Bits of directional lights as bits of the scene's lights. */
static void add_visible(const grid_scene *g, const uint64_t *from, uint64_t *to)
{
    for (uint32_t w = 0; w < g->words; w++) {
        if (g->first) {
            to[w] |= from[w];
            continue;
        }
        for (uint64_t bits = from[w]; bits; bits &= bits - 1) {
            uint32_t i = g->light[64 * w + (uint32_t)__builtin_ctzll(bits)];
            to[i / 64] |= (uint64_t)1 << i % 64;
        }
    }
}

void grid_resolve(grid_station *o, visibility *others, const tile *t, chunk *c, tile_pixels *pixels)
{
    pair_bits *b = &c->bits[LIGHTS_PUNCTUAL];
    uint32_t x, y;
    for (uint32_t e = 0; e < c->count; e++) {
        uint64_t *asked = b->asked + (size_t)e * b->words, *kept = o->kept + (size_t)e * b->words;
        memcpy(kept, asked, b->words * sizeof *kept);
        if (lattice_pixel(o, t, c->eyes[e], &x, &y))
            for (uint32_t w = 0; w < b->words; w++)
                asked[w] &= ~o->scene->punctual.directional[w];
    }
    visibility_resolve(others, c, pixels);
    for (uint32_t e = 0; e < c->count; e++) {
        uint64_t *asked = b->asked + (size_t)e * b->words, *kept = o->kept + (size_t)e * b->words;
        uint64_t *visible = b->visible + (size_t)e * b->words;
        if (!lattice_pixel(o, t, c->eyes[e], &x, &y))
            continue;
        uint32_t n = 0;
        for (uint32_t w = 0; w < b->words; w++)
            n += (uint32_t)__builtin_popcountll(kept[w] & ~asked[w]);
        o->asked += n;
        pixels->asked[c->eyes[e]->pixel] += n;
        pixels->traced[c->eyes[e]->pixel] += o->traced[(size_t)y * o->width + x];
        add_visible(o->scene, vcache_grid_visible(o->grid, x, y), visible);
        for (uint32_t w = 0; w < b->words; w++)
            visible[w] &= kept[w];
        memcpy(asked, kept, b->words * sizeof *kept);
    }
}

ray_counts grid_counts(const grid_station *o, grid_figures *add)
{
    vcache_grid_statistics s = {.size = sizeof s};
    vcache_grid_statistics_of(o->grid, &s);
    add->rays_s += o->rays_s;
    add->coarse += s.coarse;
    add->silhouette += s.silhouette;
    add->uncertain += s.uncertain;
    add->flooded += s.flooded;
    add->surprises += s.surprises;
    add->batches += s.batches;
    add->bytes += vcache_grid_bytes(o->grid);
    return (ray_counts){o->asked, s.traced};
}
