/* SPDX-License-Identifier: Apache-2.0 */
/* Which packets of shadow rays are fastest? 16 neighbouring eye samples and one light, or one eye sample and 16 lights,
 * each with Embree's coherent flag and without, on the same pairs of a scene. Prints ns per pair, medians of 5 runs.
 *
 *     packets SCENE [SPP]
 */
#include "renderers/whitted/whitted.h"

#include <stdio.h>
#include <time.h>

enum { LIGHTS = 256, RUNS = 5 };

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool faces(const eye_sample *e, const vpl_set *l, uint32_t i)
{
    vec3 d = v3_sub(v3(l->x[i], l->y[i], l->z[i]), e->origin);
    return v3_dot(d, e->surface.normal) > 0.0f && v3_dot(d, v3(l->nx[i], l->ny[i], l->nz[i])) < 0.0f;
}

static void aim(ray_packet *p, uint32_t lane, const eye_sample *e, const vpl_set *l, uint32_t i)
{
    p->org_x[lane] = e->origin.x, p->org_y[lane] = e->origin.y, p->org_z[lane] = e->origin.z;
    p->dir_x[lane] = l->x[i] - e->origin.x, p->dir_y[lane] = l->y[i] - e->origin.y;
    p->dir_z[lane] = l->z[i] - e->origin.z;
    p->tfar[lane] = 1.0f - 0x1p-16f;
}

/* Traces all pairs of one tile; returns how many face each other. */
static uint64_t trace(const tracer *t, const eye_samples *s, const vpl_set *l, bool by_eyes, bool coherent)
{
    static _Alignas(64) ray_packet p;
    packet_init(&p);
    uint64_t pairs = 0;
    for (size_t first = 0; first + GROUP <= s->count; first += GROUP)
        for (uint32_t block = 0; block + GROUP <= LIGHTS; block += GROUP)
            for (uint32_t one = 0; one < GROUP; one++) {
                uint32_t active = 0;
                for (uint32_t k = 0; k < GROUP; k++) {
                    const eye_sample *e = &s->items[first + (by_eyes ? k : one)];
                    uint32_t i = block + (by_eyes ? one : k);
                    aim(&p, k, e, l, i);
                    active |= (uint32_t)faces(e, l, i) << k;
                }
                pairs += (uint32_t)__builtin_popcount(active);
                if (active)
                    tracer_occluded16(t, &p, active, coherent);
            }
    return pairs;
}

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void measure(const view *v, const vpl_set *l, bool by_eyes, bool coherent)
{
    static tile_pixels pixels;
    double ns[RUNS];
    for (int run = -1; run < RUNS; run++) {
        eye_samples s = {0};
        double seconds = 0.0;
        uint64_t pairs = 0;
        /* every third tile, all over the image */
        for (uint32_t y = 0; y < v->settings.height; y += 3 * TILE)
            for (uint32_t x = 0; x < v->settings.width; x += 3 * TILE) {
                eye_paths(v, (tile){x, y, TILE, TILE, 0}, 0, v->settings.spp, &s, &pixels);
                double start = now();
                pairs += trace(v->tracer, &s, l, by_eyes, coherent);
                seconds += now() - start;
            }
        free(s.items);
        if (run >= 0)
            ns[run] = pairs ? 1e9 * seconds / (double)pairs : 0.0;
    }
    qsort(ns, RUNS, sizeof *ns, by_size);
    printf("%-32s %-10s %6.1f ns per pair (%.1f ... %.1f)\n",
           by_eyes ? "16 eye samples, one light" : "one eye sample, 16 lights", coherent ? "coherent" : "incoherent",
           ns[RUNS / 2], ns[0], ns[RUNS - 1]);
}

int main(int argc, char *argv[])
{
    message err = {{0}};
    scene *s = NULL;
    tracer *t = NULL;
    if (argc < 2) {
        fprintf(stderr, "usage: packets SCENE [SPP]\n");
        return 2;
    }
    int spp = argc > 2 ? atoi(argv[2]) : 1;
    if (spp < 1 || spp > 64 || (!scene_builtin(argv[1], &s) && !scene_load(argv[1], &s, &err)) ||
        !scene_finish(s, &err) || !tracer_create(s, 1, &t, &err)) {
        fprintf(stderr, "packets: %s\n", err.text[0] ? err.text : "SPP must be 1 ... 64");
        return 1;
    }
    tracer_thread_init();
    emitters *e = emitters_new(s);
    view v = {.scene = s, .tracer = t, .emitters = e, .camera = s->cameras[0]};
    v.settings = (settings){
        .width = spp > 1 ? 320 : 640, .height = spp > 1 ? 192 : 384, .spp = spp, .vpls = LIGHTS, .threads = 1};
    vpl_set l = vpls_new(&v);
    if (l.count == LIGHTS)
        for (int i = 0; i < 4; i++)
            measure(&v, &l, i < 2, i % 2 == 0);
    else
        fprintf(stderr, "packets: %u virtual point lights instead of %d\n", l.count, LIGHTS);
    vpls_free(&l);
    emitters_free(e);
    tracer_free(t);
    scene_free(s);
    return 0;
}
