/* SPDX-License-Identifier: Apache-2.0 */
/* What is registered with the visibility cache once a frame: the ends of all lights that are known in advance. */
#include "whitted.h"

#include <string.h>

/* With room for the punctual lights behind them. */
static vcache_light *virtual_ends(const view *v, const vpl_set *vpls, const vcache *cache)
{
    vcache_light *ends = xmalloc((vpls->padded + v->scene->light_count + 1) * vcache_light_size());
    for (uint32_t i = 0; i < vpls->count; i++) {
        vcache_surface s = {.position = {vpls->x[i], vpls->y[i], vpls->z[i]},
                            .normal = {vpls->gx[i], vpls->gy[i], vpls->gz[i]},
                            .density = vpls->density[i],
                            .user = i};
        vcache_prepare_patch(cache, &s, vcache_light_at(ends, i));
    }
    return ends;
}

static void prepare_punctual(const scene *s, const vcache *cache, vcache_light *ends)
{
    for (uint32_t i = 0; i < s->light_count; i++) {
        const light *l = &s->lights[i];
        float at[3];
        vec3_store(at, l->kind == LIGHT_DIRECTIONAL ? v3_neg(l->direction) : l->position);
        if (l->kind == LIGHT_DIRECTIONAL)
            vcache_prepare_direction(cache, at, i, vcache_light_at(ends, i));
        else
            vcache_prepare_point(cache, at, i, vcache_light_at(ends, i));
    }
}

static vcache_light *punctual_ends(const scene *s, const vcache *cache)
{
    vcache_light *ends = xmalloc((s->light_count + 1) * vcache_light_size());
    prepare_punctual(s, cache, ends);
    return ends;
}

/* All lights in one set: the estimator draws from them together. */
static vcache_status all_new(const view *v, const vpl_set *vpls, uint64_t bytes, caches *out, char *text)
{
    vcache_light *ends = virtual_ends(v, vpls, out->table);
    const float nowhere[3] = {NAN, NAN, NAN};
    for (uint32_t i = vpls->count; i < vpls->padded; i++)
        vcache_prepare_point(out->table, nowhere, 0, vcache_light_at(ends, i));
    uint32_t count = vpls->padded + estimator_punctual(v);
    if (count > vpls->padded)
        prepare_punctual(v->scene, out->table, vcache_light_at(ends, vpls->padded));
    vcache_status status =
        count ? vcache_light_set_create(out->table, ends, count, bytes, &out->all_set, text) : VCACHE_OK;
    free(ends);
    return status;
}

/* Rows for one kind of lights, or its words of the table in bundles. */
static vcache_status set_new(vcache *table, bool words, vcache_light *ends, uint32_t count, uint64_t bytes,
                             vcache_light_set **out, char *text)
{
    if (words || count == 0) {
        vcache_bundle_lights(table, ends, count);
        return VCACHE_OK;
    }
    return vcache_light_set_create(table, ends, count, bytes, out, text);
}

bool caches_new(const view *v, const vpl_set *vpls, caches *out, message *err)
{
    const settings *f = &v->settings;
    /* The budget goes to who needs it: most to the virtual point lights, the table only where it is asked. */
    bool estimate = f->visibility == VISIBILITY_ESTIMATE;
    bool punctual = f->ce_delta > 0.0f && v->scene->light_count > 0,
         sampled = estimate ? roulette_serves(v) : f->ce_samples > 0.0f;
    uint64_t budget = f->cache.table_bytes, part = f->words ? 0 : budget / 8;
    vcache_config config = f->cache;
    if (!f->words || estimate)
        config.table_bytes = sampled ? part * 2 : 4;
    if (estimate)
        config.levels = 1; /* no more is looked at */
    char text[VCACHE_MESSAGE_BYTES];
    memset(out, 0, sizeof *out);
    vcache_status status = vcache_create(&config, &out->table, text);
    if (status == VCACHE_OK && estimate) {
        if (estimator_pays(v, vpls))
            status = all_new(v, vpls, budget - (sampled ? part * 2 : 0), out, text);
    } else if (status == VCACHE_OK) {
        out->virtual_ends = virtual_ends(v, vpls, out->table);
        out->punctual_ends = punctual_ends(v->scene, out->table);
        uint64_t rest = budget - (sampled ? part * 2 : 0) - (punctual ? part : 0);
        status = set_new(out->table, f->words, out->virtual_ends, vpls->count, rest, &out->virtual_set, text);
        if (status == VCACHE_OK && punctual)
            status = set_new(out->table, f->words, out->punctual_ends, v->scene->light_count, part, &out->punctual_set,
                             text);
    }
    if (status != VCACHE_OK)
        return fail(err, "visibility cache: %s", text);
    out->bytes = budget;
    return true;
}

void caches_free(caches *c)
{
    vcache_light_set_destroy(&c->all_set);
    vcache_light_set_destroy(&c->virtual_set);
    vcache_light_set_destroy(&c->punctual_set);
    vcache_destroy(&c->table);
    free(c->virtual_ends);
    free(c->punctual_ends);
    memset(c, 0, sizeof *c);
}
