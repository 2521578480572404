/* SPDX-License-Identifier: Apache-2.0 */
#include "eyes.h"

#include "halton/halton.h"

#include <string.h>

static void append(eye_list *l, size_t *capacity, tile t, uint32_t width, const eye_samples *from)
{
    if (l->count + from->count > *capacity) {
        *capacity = 2 * (l->count + from->count);
        l->items = xrealloc(l->items, *capacity * sizeof *l->items);
        l->pixel = xrealloc(l->pixel, *capacity * sizeof *l->pixel);
    }
    for (size_t i = 0; i < from->count; i++) {
        const eye_sample *e = &from->items[i];
        l->pixel[l->count] = (t.y + e->pixel / TILE) * width + t.x + e->pixel % TILE;
        l->items[l->count++] = *e;
    }
}

eye_list eye_list_new(const view *v)
{
    static tile_pixels scratch;
    const settings *f = &v->settings;
    uint32_t across = (f->width + TILE - 1) / TILE, down = (f->height + TILE - 1) / TILE, n = 0;
    int passes = (f->spp + PASS - 1) / PASS;
    size_t capacity = 0;
    eye_samples samples = {0};
    eye_list out = {.passes = (size_t)across * down * (size_t)passes};
    size_t *start = out.starts = xcalloc(out.passes + 1, sizeof *out.starts);
    for (uint64_t code = 0; n < across * down; code++) {
        uint32_t x, y;
        halton_morton_decode(code, &x, &y);
        if (x >= across || y >= down)
            continue;
        tile t = {x * TILE, y * TILE, TILE, TILE, n++};
        t.width = f->width - t.x < TILE ? f->width - t.x : TILE;
        t.height = f->height - t.y < TILE ? f->height - t.y : TILE;
        for (int pass = 0; pass < passes; pass++) {
            eye_paths(v, t, pass * PASS, f->spp - pass * PASS < PASS ? f->spp - pass * PASS : PASS, &samples, &scratch);
            append(&out, &capacity, t, f->width, &samples);
            *++start = out.count;
        }
    }
    free(samples.items);
    return out;
}

void eye_list_free(eye_list *l)
{
    free(l->items);
    free(l->pixel);
    free(l->starts);
    memset(l, 0, sizeof *l);
}

typedef struct place_in_order {
    uint64_t key;
    uint32_t eye;
} place_in_order;

static int by_key(const void *a, const void *b)
{
    const place_in_order *x = a, *y = b;
    return x->key != y->key ? (x->key > y->key) - (x->key < y->key) : (x->eye > y->eye) - (x->eye < y->eye);
}

void eyes_sort(const uint32_t *pixel, uint32_t count, uint32_t width, eye_order order, double cell_pixels,
               uint32_t *out)
{
    uint32_t pixels[TILE * TILE], rank[TILE * TILE], starts[HALTON_MAX_SEGMENTS + 1], segments;
    halton_order(TILE, TILE, cell_pixels, pixels, starts, &segments);
    for (uint32_t i = 0; i < TILE * TILE; i++)
        rank[pixels[i]] = i;
    place_in_order *places = xmalloc((count + 1) * sizeof *places);
    for (uint32_t i = 0; i < count; i++) {
        uint32_t x = pixel[i] % width, y = pixel[i] / width;
        uint64_t key = order == ORDER_RANDOM     ? rng_mix(i + 1)
                       : order == ORDER_SCANLINE ? pixel[i]
                       : order == ORDER_MORTON
                           ? halton_morton(x, y)
                           : halton_morton(x / TILE, y / TILE) * TILE * TILE + rank[y % TILE * TILE + x % TILE];
        places[i] = (place_in_order){key, i};
    }
    qsort(places, count, sizeof *places, by_key);
    for (uint32_t i = 0; i < count; i++)
        out[i] = places[i].eye;
    free(places);
}
