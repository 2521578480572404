/* SPDX-License-Identifier: Apache-2.0 */
#include "lighting.h"

#include "renderers/common/environment_lights.h"
#include "renderers/common/interrupt.h"

#include <string.h>
#include <time.h>

/* ---------------------------------------------------------------------------------------------------------- stage */

stage stage_defaults(const char *program)
{
    stage s = {.arguments = program_defaults(program), .cache_mb = 16};
    s.arguments.threads = 1;
    s.settings.cache = vcache_default_config();
    s.settings.visibility = VISIBILITY_EXACT;
    s.settings.refine_above = 0.5f;
    s.settings.ce = 8.0f;
    return s;
}

static bool load(stage *s, message *err)
{
    settings *f = &s->settings;
    if (!program_load_scene(&s->arguments, &s->scene, err))
        return false;
    if (f->env_lights > 0 && !s->scene->environment)
        return fail(err, "--env-lights: the scene has no environment; --env gives it one");
    if (f->env_lights > 0)
        scene_add_environment_lights(s->scene, f->env_lights);
    if (!scene_finish(s->scene, err) || !program_choose_camera(&s->arguments, s->scene, &s->view.camera, err) ||
        !tracer_create(s->scene, 1, &s->tracer, err))
        return false;
    s->emitters = emitters_new(s->scene);
    vec3_store(f->cache.bounds_min, s->scene->bounds_min);
    vec3_store(f->cache.bounds_max, s->scene->bounds_max);
    s->view.scene = s->scene;
    s->view.tracer = s->tracer;
    s->view.emitters = s->emitters;
    s->view.settings = *f;
    tracer_thread_init();
    s->lights = vpls_new(&s->view);
    return s->lights.count + s->scene->light_count > 0 ? true : fail(err, "%s: no lights", s->arguments.scene);
}

bool stage_open(stage *s, const char *summary, const option *table, size_t count, int argc, char *argv[], int *code)
{
    message err = {{0}};
    program_arguments *a = &s->arguments;
    image none;
    options_status status = program_parse(a, summary, table, count, argc, argv, &err);
    a->threads = 1;
    s->settings.width = a->size.width;
    s->settings.height = a->size.height;
    s->settings.spp = a->spp;
    s->settings.seed = a->seed;
    s->settings.threads = 1;
    s->settings.cache.table_bytes = (uint64_t)s->cache_mb << 20;
    if (status != OPTIONS_OK || !program_check(a, &err)) {
        *code = program_stop(a, status, &err);
        return false;
    }
    a->quiet = true;
    if (program_begin(a, frame_bytes(&s->settings), &none, &err) && load(s, &err))
        return true;
    *code = program_end(a, false, &err);
    return false;
}

void stage_free(stage *s)
{
    vpls_free(&s->lights);
    emitters_free(s->emitters);
    tracer_free(s->tracer);
    scene_free(s->scene);
}

void stage_print(const stage *s, uint32_t eyes)
{
    printf("\"triangles\": %llu, \"width\": %u, \"height\": %u, \"spp\": %d, \"threads\": 1, \"eye_samples\": %u, "
           "\"lights\": %u, \"vpls\": %u, \"punctual_lights\": %u",
           (unsigned long long)s->scene->triangle_count, s->settings.width, s->settings.height, s->settings.spp, eyes,
           s->lights.count + s->scene->light_count, s->lights.count, s->scene->light_count);
}

/* ------------------------------------------------------------------------------------------------------- lighting */

double lighting_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void lighting_resolve(void *context, chunk *c, const uint32_t *eyes, tile_pixels *pixels)
{
    (void)eyes;
    visibility_resolve(context, c, pixels);
}

static void keep_bits(light_bits *bits, const chunk *c, const uint32_t *eyes)
{
    for (uint32_t e = 0; e < c->count; e++)
        for (int g = LIGHTS_VIRTUAL; g <= LIGHTS_PUNCTUAL; g++) {
            const pair_bits *b = &c->bits[g];
            size_t to = (size_t)eyes[e] * bits->words + (g == LIGHTS_PUNCTUAL ? bits->punctual : 0);
            memcpy(bits->asked + to, b->asked + (size_t)e * b->words, b->words * sizeof *b->asked);
            memcpy(bits->visible + to, b->visible + (size_t)e * b->words, b->words * sizeof *b->visible);
        }
}

lit lighting_render(const view *v, const vpl_set *lights, const eye_list *eyes, const uint32_t *order,
                    lighting_decide decide, void *context)
{
    static tile_pixels pixels; /* one for each eye sample of the chunk */
    double start = lighting_now();
    lit out = {.image = image_new(v->settings.width, v->settings.height)};
    eye_sample own[CHUNK];
    uint32_t which[CHUNK];
    chunk c;
    chunk_new(&c, v, lights, v->scene->light_count);
    out.bits.punctual = c.bits[LIGHTS_VIRTUAL].words;
    out.bits.words = out.bits.punctual + c.bits[LIGHTS_PUNCTUAL].words;
    out.bits.asked = xcalloc((size_t)eyes->count * out.bits.words + 1, sizeof(uint64_t));
    out.bits.visible = xcalloc((size_t)eyes->count * out.bits.words + 1, sizeof(uint64_t));
    for (uint32_t i = 0; i < eyes->count; i += CHUNK) {
        c.count = eyes->count - i < CHUNK ? eyes->count - i : CHUNK;
        for (uint32_t e = 0; e < c.count; e++) {
            which[e] = order ? order[i + e] : i + e;
            own[e] = eyes->items[which[e]];
            own[e].pixel = e;
            c.eyes[e] = &own[e];
            pixels.lit[e] = v3(0, 0, 0);
        }
        shade_unoccluded(v, lights, &c);
        double before = lighting_now();
        decide(context, &c, which, &pixels);
        out.decide_s += lighting_now() - before;
        shade_sum(lights, &c, &pixels);
        keep_bits(&out.bits, &c, which);
        for (uint32_t e = 0; e < c.count; e++) {
            rgb *to = &out.image.pixels[eyes->pixel[which[e]]];
            *to = v3_add(*to, pixels.lit[e]);
        }
    }
    chunk_free(&c);
    out.seconds = lighting_now() - start;
    return out;
}

lit lighting_exact(const view *v, const vpl_set *lights, const eye_list *eyes)
{
    visibility *all = visibility_new(v, lights, NULL);
    lit out = lighting_render(v, lights, eyes, NULL, lighting_resolve, all);
    visibility_free(all);
    return out;
}

void lit_free(lit *l)
{
    image_free(&l->image);
    free(l->bits.asked);
    free(l->bits.visible);
    memset(l, 0, sizeof *l);
}

double lit_mispredicted(const lit *l, const lit *exact, uint32_t count)
{
    uint64_t wrong = 0, asked = 0;
    for (size_t i = 0; i < (size_t)count * l->bits.words; i++) {
        wrong += (uint32_t)__builtin_popcountll((l->bits.visible[i] ^ exact->bits.visible[i]) & exact->bits.asked[i]);
        asked += (uint32_t)__builtin_popcountll(exact->bits.asked[i]);
    }
    return asked ? (double)wrong / (double)asked : 0.0;
}
