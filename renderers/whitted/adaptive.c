/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Adaptive shadow testing (Ward 1991; vcache/adaptive.h): of all lights of an eye sample those are tested that would
 * bring much, the rest is added in proportion to how visible it probably is. Lights are the punctual ones, the samples
 * of area lights and environment, and the virtual point lights: one sum, one order, one tolerance.
 *
 * The eye samples of a chunk go hand in hand: each says which lights it wants tested, those are traced together in
 * packets (visibility.c) or looked up in the cache, each hears the answers and goes on, until none wants any.
 */
#include "whitted.h"

#include "clones.h"

#include <string.h>

enum { STEP = 256 }; /* lights that an eye sample asks for at a time, at most */

/* Lights of an eye sample, one behind the other. */
typedef struct layout {
    uint32_t first[LIGHT_GROUPS], sources, stride;
} layout;

struct adaptive {
    const view *view;
    const vpl_set *vpls;
    vcache_adaptive *rates;
    layout lights;
    vcache_adaptive_worker *workers[CHUNK]; /* one for each eye sample, all beside the first */
    float *contribution, *weight;           /* [CHUNK][stride] */
    uint32_t given[CHUNK], *tests;          /* [CHUNK][STEP] */
    vcache_answer answers[STEP];
};

bool adapts(visibility_mode mode)
{
    return mode == VISIBILITY_ADAPTIVE || mode == VISIBILITY_ADAPTIVE_CACHE;
}

static layout layout_of(const view *v, const vpl_set *vpls)
{
    const uint32_t counts[LIGHT_GROUPS] = {
        [LIGHTS_VIRTUAL] = vpls->count,
        [LIGHTS_PUNCTUAL] = v->scene->light_count,
        [LIGHTS_SAMPLED] = direct_sample_count(v),
    };
    layout l = {.sources = 0};
    for (int g = 0; g < LIGHT_GROUPS; g++) {
        l.first[g] = l.sources;
        l.sources += counts[g];
    }
    l.stride = (l.sources + 127) / 64 * 64;
    return l;
}

bool adaptive_rates_new(const view *v, const vpl_set *vpls, vcache_adaptive **out, message *err)
{
    char text[VCACHE_MESSAGE_BYTES];
    vcache_adaptive_config config = vcache_adaptive_default_config();
    config.sources = layout_of(v, vpls).sources;
    config.tolerance = v->settings.tolerance;
    config.certainty = v->settings.certainty;
    config.free_running = v->settings.shared;
    *out = NULL;
    return config.sources == 0 || vcache_adaptive_create(&config, out, text) == VCACHE_OK ||
           fail(err, "adaptive shadow testing: %s", text);
}

adaptive *adaptive_new(const view *v, const vpl_set *vpls, vcache_adaptive *rates)
{
    if (!rates)
        return NULL;
    adaptive *o = xcalloc(1, sizeof *o);
    o->view = v;
    o->vpls = vpls;
    o->rates = rates;
    o->lights = layout_of(v, vpls);
    size_t size = (size_t)CHUNK * o->lights.stride;
    o->contribution = floats_new(size);
    o->weight = floats_new(size);
    o->tests = xmalloc((size_t)CHUNK * STEP * sizeof *o->tests);
    for (int e = 0; e < CHUNK; e++)
        if ((e ? vcache_adaptive_worker_create_beside(o->workers[0], &o->workers[e], NULL)
               : vcache_adaptive_worker_create(rates, &o->workers[0], NULL)) != VCACHE_OK)
            o->workers[e] = xmalloc(SIZE_MAX);
    return o;
}

void adaptive_free(adaptive *o)
{
    if (!o)
        return;
    for (int e = CHUNK; e-- > 0;)
        vcache_adaptive_worker_destroy(&o->workers[e]);
    free(o->contribution);
    free(o->weight);
    free(o->tests);
    free(o);
}

/* ------------------------------------------------------------------------------------------------- contributions */

CLONES static void diffuse_contributions(uint32_t count, rgb albedo, const float *restrict r, const float *restrict g,
                                         const float *restrict b, const float *restrict geometry, float *restrict out)
{
    for (uint32_t i = 0; i < count; i++)
        out[i] = geometry[i] * (albedo.x * r[i] + albedo.y * g[i] + albedo.z * b[i]);
}

/* Luminance in the pixel that each light of eye sample e would bring unoccluded. */
static void contributions(const adaptive *o, const chunk *c, uint32_t e, float *out)
{
    const eye_sample *s = c->eyes[e];
    const vpl_set *v = o->vpls;
    const punctual_set *p = &c->punctual;
    float *of_virtual = out + o->lights.first[LIGHTS_VIRTUAL], *of_punctual = out + o->lights.first[LIGHTS_PUNCTUAL];
    const float *virtual = c->geometry + (size_t)e * v->padded,
                *punctual = c->punctual_geometry + (size_t)e * p->padded;
    if (!c->reflects[e]) {
        memset(out, 0, o->lights.sources * sizeof *out);
        return;
    }
    if (s->surface.material->kind == MATERIAL_DIFFUSE) {
        rgb albedo = v3_scale(v3_mul(s->weight, s->surface.color), 1.0f / PI_F);
        /* for the luminance of what they reflect */
        albedo = v3(luminance(v3(albedo.x, 0, 0)), luminance(v3(0, albedo.y, 0)), luminance(v3(0, 0, albedo.z)));
        diffuse_contributions(v->count, albedo, v->r, v->g, v->b, virtual, of_virtual);
        diffuse_contributions(p->count, albedo, p->r, p->g, p->b, punctual, of_punctual);
    } else {
        for (uint32_t i = 0; i < v->count; i++)
            of_virtual[i] = virtual[i] > 0.0f ? virtual[i] * luminance(v3_mul(s->weight, shade_response(v, s, i)))
                                              : 0.0f;
        for (uint32_t i = 0; i < p->count; i++)
            of_punctual[i] =
                punctual[i] > 0.0f ? punctual[i] * luminance(v3_mul(s->weight, punctuals_response(p, s, i))) : 0.0f;
    }
    const pair_bits *b = &c->bits[LIGHTS_SAMPLED];
    for (uint32_t i = 0; i < b->lights; i++)
        out[o->lights.first[LIGHTS_SAMPLED] + i] = luminance(c->sampled[(size_t)e * b->lights + i].value);
}

/* --------------------------------------------------------------------------------------------------------- tests */

/* The word and bit of one of the lights in the rows of eye sample e. */
static inline uint64_t *row_word(const layout *l, const chunk *c, uint32_t e, uint32_t source, bool visible,
                                 uint32_t *bit)
{
    int g = LIGHT_GROUPS - 1;
    while (source < l->first[g])
        g--;
    const pair_bits *b = &c->bits[g];
    uint32_t i = source - l->first[g];
    *bit = i % 64;
    return (visible ? b->visible : b->asked) + (size_t)e * b->words + i / 64;
}

/* Asks for the next tests of all eye samples; returns how many that are. */
static uint32_t ask(adaptive *o, chunk *c)
{
    uint32_t all = 0, bit;
    for (uint32_t e = 0; e < c->count; e++) {
        const uint32_t *tests = o->tests + (size_t)e * STEP;
        uint32_t n = o->given[e] = vcache_adaptive_next(o->workers[e], o->tests + (size_t)e * STEP, STEP);
        for (uint32_t k = 0; k < n; k++) {
            uint64_t *word = row_word(&o->lights, c, e, tests[k], false, &bit);
            *word |= (uint64_t)1 << bit;
        }
        all += n;
    }
    return all;
}

static void hear(adaptive *o, chunk *c)
{
    for (uint32_t e = 0; e < c->count; e++) {
        const uint32_t *tests = o->tests + (size_t)e * STEP;
        uint32_t n = o->given[e], bit;
        if (n == 0)
            continue;
        for (uint32_t k = 0; k < n; k++) {
            const uint64_t *word = row_word(&o->lights, c, e, tests[k], true, &bit);
            o->answers[k] = *word >> bit & 1u ? VCACHE_VISIBLE : VCACHE_BLOCKED;
        }
        for (uint32_t k = 0; k < n; k++)
            *row_word(&o->lights, c, e, tests[k], true, &bit) = *row_word(&o->lights, c, e, tests[k], false, &bit) = 0;
        vcache_adaptive_tell(o->workers[e], o->answers);
    }
}

/* -------------------------------------------------------------------------------------------------------- chunk */

/* Tests what matters, or all there is, and writes the weights. */
static void choose(adaptive *o, visibility *by, chunk *c, tile_pixels *pixels, bool all)
{
    size_t stride = o->lights.stride;
    visibility_begin(by, c, pixels);
    for (uint32_t e = 0; e < c->count; e++) {
        contributions(o, c, e, o->contribution + e * stride);
        /* Sect. 5: what counts for less in its pixel may be less exact */
        float share = v3_max_component(c->eyes[e]->weight) * (float)o->view->settings.spp;
        vcache_adaptive_begin(o->workers[e], o->contribution + e * stride, o->weight + e * stride,
                              all ? 0.0f : 1.0f / share);
    }
    for (int g = 0; g < LIGHT_GROUPS; g++)
        memset(c->bits[g].asked, 0, (size_t)CHUNK * c->bits[g].words * sizeof(uint64_t));
    while (ask(o, c) > 0) {
        visibility_test(by, c, pixels);
        hear(o, c);
    }
    for (uint32_t e = 0; e < c->count; e++)
        vcache_adaptive_finish(o->workers[e]);
}

void adaptive_light(adaptive *o, visibility *by, chunk *c, tile_pixels *pixels)
{
    choose(o, by, c, pixels, false);
    for (uint32_t e = 0; e < c->count; e++) {
        const float *weight[LIGHT_GROUPS];
        for (int g = 0; g < LIGHT_GROUPS; g++)
            weight[g] = o->weight + e * o->lights.stride + o->lights.first[g];
        rgb *lit = &pixels->lit[c->eyes[e]->pixel];
        *lit = v3_add(*lit, shade_weighted(o->vpls, c, e, weight));
    }
}

/* ------------------------------------------------------------------------------------------------------ hit rates */

/* Rates that are learnt on the way from what is tested are too low: in the shadow more is tested. So they are learnt
 * from all lights of a few points, before all else, and stay: threads and the order of tiles make no difference. */
enum { PILOT_SIDE = 8 };

void adaptive_learn(adaptive *o, visibility *by, chunk *c)
{
    const settings *f = &o->view->settings;
    tile_pixels *unused = xcalloc(1, sizeof *unused);
    eye_samples all = {0}, one = {0};
    for (uint32_t i = 0; i < PILOT_SIDE * PILOT_SIDE; i++) {
        tile pixel = {.width = 1, .height = 1};
        pixel.x = (2 * (i % PILOT_SIDE) + 1) * f->width / (2 * PILOT_SIDE);
        pixel.y = (2 * (i / PILOT_SIDE) + 1) * f->height / (2 * PILOT_SIDE);
        eye_paths(o->view, pixel, 0, 1, &one, unused);
        all.items = xrealloc(all.items, (all.count + one.count + 1) * sizeof *all.items);
        if (one.count > 0)
            memcpy(all.items + all.count, one.items, one.count * sizeof *one.items);
        all.count += one.count;
    }
    for (size_t first = 0; first < all.count; first += CHUNK) {
        c->count = all.count - first < CHUNK ? (uint32_t)(all.count - first) : CHUNK;
        for (uint32_t e = 0; e < c->count; e++)
            c->eyes[e] = &all.items[first + e];
        shade_unoccluded(o->view, o->vpls, c);
        choose(o, by, c, unused, true);
    }
    vcache_adaptive_merge(o->rates, &o->workers[0], 1);
    free(all.items);
    free(one.items);
    free(unused);
}
