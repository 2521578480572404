/* SPDX-License-Identifier: Apache-2.0 */
/* Records a view by rendering it exactly once. */
#include "record.h"

#include "renderers/common/parallel.h"

#include <float.h>
#include <stdio.h>
#include <string.h>

static bool load(const record_options *o, record *r, message *err)
{
    if (!scene_builtin(o->scene, &r->scene) && !scene_load(o->scene, &r->scene, err))
        return false;
    if (o->env) {
        environment_free(r->scene->environment);
        r->scene->environment = NULL;
        if (!environment_load(o->env, &r->scene->environment, err))
            return false;
    }
    int threads = parallel_thread_count(o->threads);
    if (!scene_finish(r->scene, err) || !tracer_create(r->scene, threads, &r->tracer, err))
        return false;
    if (o->camera < 0 || (uint32_t)o->camera >= r->scene->camera_count)
        return fail(err, "%s: no camera %d", o->scene, o->camera);
    r->emitters = emitters_new(r->scene);
    int samples = (int)ceilf(8.0f / sqrtf((float)o->spp)); /* as whitted does by default */
    r->view =
        (view){.scene = r->scene, .tracer = r->tracer, .emitters = r->emitters, .camera = r->scene->cameras[o->camera]};
    r->view.settings = (settings){.width = o->width,
                                  .height = o->height,
                                  .spp = o->spp,
                                  .vpls = o->vpls,
                                  .env_samples = samples,
                                  .light_samples = samples,
                                  .threads = threads,
                                  .visibility = VISIBILITY_EXACT,
                                  .cache = vcache_default_config()};
    return true;
}

/* Joins the eye samples with what the frame took down of them. */
static void collect(record *r, const truth *known)
{
    uint32_t stride = r->words + (r->scene->light_count + 63) / 64 + (direct_sample_count(&r->view) + 63) / 64;
    eye_list list = eye_list_new(&r->view);
    r->eyes = list.items;
    r->pixel = list.pixel;
    r->count = list.count;
    r->visible = xmalloc(((size_t)r->count * r->words + 1) * sizeof *r->visible);
    r->asked = xmalloc(((size_t)r->count * r->words + 1) * sizeof *r->asked);
    for (size_t pass = 0; pass < list.passes; pass++)
        for (size_t i = list.starts[pass]; i < list.starts[pass + 1]; i++)
            memcpy(r->visible + i * r->words, known->passes[pass] + (i - list.starts[pass]) * stride,
                   r->words * sizeof *r->visible);
    free(list.starts);
}

static void ask(record *r)
{
    record_row row = record_row_new(r);
    for (uint32_t i = 0; i < r->count; i++) {
        uint64_t *asked = r->asked + (size_t)i * r->words;
        record_contributions(r, i, &row);
        shade_bits_above(row.luminance, 0.0f, r->words, asked);
        for (uint32_t w = 0; w < r->words; w++)
            r->pairs += (uint32_t)__builtin_popcountll(asked[w]);
    }
    record_row_free(&row);
}

bool record_make(const record_options *o, record *r, message *err)
{
    memset(r, 0, sizeof *r);
    truth known = {0};
    frame exact;
    if (!load(o, r, err))
        return false;
    if (!frame_render(&r->view, "exact", true, &known, NULL, &exact, err))
        return false;
    for (size_t i = 0; i < (size_t)o->width * o->height; i++) {
        rgb c = exact.lit.pixels[i];
        r->energy += (double)c.x + (double)c.y + (double)c.z;
    }
    frame_free(&exact);
    tracer_thread_init();
    r->lights = vpls_new(&r->view);
    r->padded = r->lights.padded;
    r->words = r->padded / 64;
    r->power = xmalloc((r->padded + 1) * sizeof *r->power);
    for (uint32_t i = 0; i < r->padded; i++)
        r->power[i] = luminance(v3(r->lights.r[i], r->lights.g[i], r->lights.b[i]));
    if (r->lights.count == 0) {
        truth_free(&known);
        return fail(err, "%s: no virtual point lights", o->scene);
    }
    collect(r, &known);
    truth_free(&known);
    ask(r);
    return r->pairs > 0 ? true : fail(err, "%s: the camera sees nothing that a light faces", o->scene);
}

void record_free(record *r)
{
    vpls_free(&r->lights);
    free(r->power);
    free(r->eyes);
    free(r->pixel);
    free(r->asked);
    free(r->visible);
    emitters_free(r->emitters);
    tracer_free(r->tracer);
    scene_free(r->scene);
}

/* ---- contributions */

record_row record_row_new(const record *r)
{
    record_row row;
    float **arrays[] = {&row.r, &row.g, &row.b, &row.luminance};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        *arrays[i] = xcalloc(r->padded, sizeof(float));
    return row;
}

void record_row_free(record_row *row)
{
    free(row->r);
    free(row->g);
    free(row->b);
    free(row->luminance);
}

/* As geometry_row of renderers/whitted/shade.c, times the powers and `scale`. */
CLONES static void diffuse(const vpl_set *l, const eye_sample *e, rgb scale, float *restrict out_r,
                           float *restrict out_g, float *restrict out_b, float *restrict out)
{
    const float *restrict x = l->x, *restrict y = l->y, *restrict z = l->z;
    const float *restrict nx = l->nx, *restrict ny = l->ny, *restrict nz = l->nz;
    const float *restrict lr = l->r, *restrict lg = l->g, *restrict lb = l->b;
    const vec3 p = e->origin, n = e->surface.normal, s = e->surface.geometric_normal;
    const float clamp = l->clamp;
    for (uint32_t i = 0; i < l->padded; i++) {
        float dx = x[i] - p.x, dy = y[i] - p.y, dz = z[i] - p.z;
        float r2 = dx * dx + dy * dy + dz * dz;
        float eye = n.x * dx + n.y * dy + n.z * dz;
        float side = s.x * dx + s.y * dy + s.z * dz;
        float away = -(nx[i] * dx + ny[i] * dy + nz[i] * dz);
        float clamped = r2 > clamp ? r2 : clamp;
        float value = eye * away / (r2 * clamped);
        int lit = (eye > 0.0f) & (side > 0.0f) & (away > 0.0f);
        value = lit ? value : 0.0f;
        float r = scale.x * value * lr[i], g = scale.y * value * lg[i], b = scale.z * value * lb[i];
        out_r[i] = r, out_g[i] = g, out_b[i] = b;
        out[i] = 0.2126f * r + 0.7152f * g + 0.0722f * b;
    }
}

static rgb reflected(const eye_sample *e, const vpl_set *l, uint32_t i)
{
    if (e->surface.material->kind == MATERIAL_DIFFUSE)
        return v3_mul(v3_scale(e->surface.color, 1.0f / PI_F), e->weight);
    vec3 wi = v3_normalize(v3_sub(v3(l->x[i], l->y[i], l->z[i]), e->origin));
    return v3_mul(material_eval(&e->surface, wi), e->weight);
}

rgb record_contribution(const record *r, uint32_t eye, uint32_t i)
{
    const eye_sample *e = &r->eyes[eye];
    const vpl_set *l = &r->lights;
    vec3 d = v3_sub(v3(l->x[i], l->y[i], l->z[i]), e->origin);
    float r2 = v3_dot(d, d), cosines = -v3_dot(e->surface.normal, d) * v3_dot(v3(l->nx[i], l->ny[i], l->nz[i]), d);
    float geometry = cosines / (r2 * fmaxf(r2, l->clamp));
    return v3_scale(v3_mul(reflected(e, l, i), v3(l->r[i], l->g[i], l->b[i])), geometry);
}

void record_contributions(const record *r, uint32_t eye, record_row *row)
{
    const eye_sample *e = &r->eyes[eye];
    const vpl_set *l = &r->lights;
    if (!(material_reflectance(&e->surface) > 0.0f)) {
        diffuse(l, e, v3(0, 0, 0), row->r, row->g, row->b, row->luminance);
        return;
    }
    bool plain = e->surface.material->kind == MATERIAL_DIFFUSE;
    diffuse(l, e, plain ? reflected(e, l, 0) : v3(1, 1, 1), row->r, row->g, row->b, row->luminance);
    for (uint32_t i = 0; !plain && i < l->count; i++)
        if (row->luminance[i] > 0.0f) {
            rgb c = v3_mul(reflected(e, l, i), v3(row->r[i], row->g[i], row->b[i]));
            row->r[i] = c.x, row->g[i] = c.y, row->b[i] = c.z;
            row->luminance[i] = luminance(c);
        }
}

/* ---- ends and their cells */

vcache *record_cache(const record *r, vcache_config config)
{
    vcache *cache;
    char text[VCACHE_MESSAGE_BYTES];
    vec3 low = r->scene->bounds_min, high = r->scene->bounds_max;
    memcpy(config.bounds_min, (float[]){low.x, low.y, low.z}, sizeof config.bounds_min);
    memcpy(config.bounds_max, (float[]){high.x, high.y, high.z}, sizeof config.bounds_max);
    config.table_bytes = 4;
    if (vcache_create(&config, &cache, text) != VCACHE_OK) {
        fprintf(stderr, "%s\n", text);
        exit(1);
    }
    return cache;
}

vcache_surface record_surface(const record *r, uint32_t eye)
{
    const surface *s = &r->eyes[eye].surface;
    return (vcache_surface){.position = {s->position.x, s->position.y, s->position.z},
                            .normal = {s->geometric_normal.x, s->geometric_normal.y, s->geometric_normal.z},
                            .density = r->eyes[eye].density,
                            .user = eye};
}

void cells_new(cells *c, uint32_t words)
{
    memset(c, 0, sizeof *c);
    c->words = words;
    c->mask = (1u << 16) - 1;
    c->keys = xcalloc(c->mask + 1, sizeof *c->keys);
    c->index = xcalloc(c->mask + 1, sizeof *c->index);
}

void cells_free(cells *c)
{
    free(c->keys);
    free(c->index);
    free(c->bits);
}

/* Slot of the key, or the free one where it would go. */
static uint64_t slot(const cells *c, uint64_t key)
{
    uint64_t i = rng_mix(key) & c->mask;
    while (c->keys[i] && c->keys[i] != key)
        i = (i + 1) & c->mask;
    return i;
}

uint32_t cells_find(const cells *c, uint64_t key)
{
    uint64_t i = slot(c, key ? key : 1);
    return c->keys[i] ? c->index[i] : NO_CELL;
}

static void rehash(cells *c)
{
    cells old = *c;
    c->mask = 4 * old.mask + 3;
    c->keys = xcalloc(c->mask + 1, sizeof *c->keys);
    c->index = xcalloc(c->mask + 1, sizeof *c->index);
    for (uint64_t i = 0; i <= old.mask; i++)
        if (old.keys[i]) {
            uint64_t to = slot(c, old.keys[i]);
            c->keys[to] = old.keys[i];
            c->index[to] = old.index[i];
        }
    free(old.keys);
    free(old.index);
}

uint32_t cells_add(cells *c, uint64_t key)
{
    key = key ? key : 1;
    uint64_t i = slot(c, key);
    if (c->keys[i])
        return c->index[i];
    if (2 * (uint64_t)c->count > c->mask) {
        rehash(c);
        i = slot(c, key);
    }
    if (c->count == c->capacity) {
        c->capacity = c->capacity ? 2 * c->capacity : 4096;
        c->bits = xrealloc(c->bits, (size_t)c->capacity * 2 * c->words * sizeof *c->bits);
    }
    memset(cells_row(c, c->count), 0, 2 * c->words * sizeof *c->bits);
    c->keys[i] = key;
    c->index[i] = c->count;
    return c->count++;
}
