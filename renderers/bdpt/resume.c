/* SPDX-License-Identifier: Apache-2.0 */
#include "resume.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const char *const modes[VISIBILITY_MODES] = {"exact", "cache", "estimate"};

static void vector(image_texts *t, const char *name, vec3 v)
{
    image_text(t, name, "%.9g %.9g %.9g", (double)v.x, (double)v.y, (double)v.z);
}

/* FNV-1a. */
static uint64_t mix(uint64_t h, const void *data, size_t bytes)
{
    const unsigned char *p = data;
    for (size_t i = 0; i < bytes; i++)
        h = (h ^ p[i]) * 0x100000001b3u;
    return h;
}

static uint64_t mix_sky(uint64_t h, const environment *sky)
{
    enum { DIRECTIONS = 256 };
    for (int i = 0; i < DIRECTIONS; i++) { /* on a spiral around y */
        float y = 1.0f - (2.0f * (float)i + 1.0f) / DIRECTIONS, r = sqrtf(1.0f - y * y), a = 2.4f * (float)i;
        rgb seen = environment_radiance(sky, v3(r * cosf(a), y, r * sinf(a)));
        h = mix(h, &seen, sizeof seen);
    }
    return h;
}

/* What counts and bounds do not tell: materials, where meshes stand, lights, the sky. Field by field: structs have
 * holes. */
static uint64_t fingerprint(const scene *s)
{
    uint64_t h = 0xcbf29ce484222325u;
    for (uint32_t i = 0; i < s->material_count; i++) {
        const material *m = &s->materials[i];
        const float numbers[] = {
            (float)m->kind,   m->color.x,    m->color.y,    m->color.z,    m->roughness,
            m->ior,           m->emission.x, m->emission.y, m->emission.z, m->two_sided ? 1.0f : 0.0f,
            (float)m->texture};
        h = mix(h, numbers, sizeof numbers);
    }
    for (uint32_t i = 0; i < s->instance_count; i++)
        h = mix(h, s->instances[i].to_world, sizeof s->instances[i].to_world);
    for (uint32_t i = 0; i < s->light_count; i++) {
        const light *l = &s->lights[i];
        const float angles[] = {(float)l->kind, l->cos_inner, l->cos_outer, (float)l->power};
        const vec3 vectors[] = {l->position, l->direction, l->intensity};
        h = mix(mix(h, angles, sizeof angles), vectors, sizeof vectors);
    }
    return s->environment ? mix_sky(h, s->environment) : h;
}

/* Anything that changes what a pass adds. Numbers are written so that no two floats look alike. */
static void add_identity(const view *v, const settings *s, image_texts *t)
{
    const scene *c = v->scene;
    const camera_frame *f = &v->camera;
    image_text(t, "triangles", "%llu", (unsigned long long)c->triangle_count);
    vector(t, "boundsMin", c->bounds_min);
    vector(t, "boundsMax", c->bounds_max);
    image_text(t, "surfacesAndLights", "%016llx", (unsigned long long)fingerprint(c));
    vector(t, "cameraEye", f->eye);
    vector(t, "cameraForward", f->forward);
    vector(t, "cameraUp", f->up);
    image_text(t, "cameraPixel", "%.9g", (double)f->pixel);
    image_text(t, "partners", "%d", s->partners);
    image_text(t, "heuristic", "%s", s->heuristic == HEURISTIC_POWER ? "power" : "balance");
    image_text(t, "edges", "%d", s->edges);
    image_text(t, "strategy", "%d", s->light_vertices);
    if (s->visibility == VISIBILITY_EXACT)
        return;
    if (s->visibility == VISIBILITY_ESTIMATE)
        image_text(t, "trace", "%.9g", (double)s->rays);
    image_text(t, "epoch", "%d", s->epoch);
    image_text(t, "ce", "%.9g", (double)s->ce);
    image_text(t, "normalBins", "%d", s->cache.normal_bins);
    image_text(t, "layers", "%d", s->cache.layers);
    image_text(t, "resolutionStep", "%.9g", (double)s->cache.resolution_step);
    image_text(t, "cacheMiB", "%llu", (unsigned long long)(s->cache.table_bytes >> 20));
}

/* What a user calls it: an option, or what a number that nobody typed stands for. */
static const char *known_as(const char *name)
{
    static const char *const options[][2] = {{"seed", "--seed"},
                                             {"visibility", "--visibility"},
                                             {"partners", "--partners"},
                                             {"heuristic", "--heuristic"},
                                             {"edges", "--edges"},
                                             {"strategy", "--strategy"},
                                             {"trace", "--trace"},
                                             {"epoch", "--epoch"},
                                             {"ce", "--ce"},
                                             {"normalBins", "--cn"},
                                             {"layers", "--cz"},
                                             {"resolutionStep", "--cr"},
                                             {"cacheMiB", "--cache-mb"}};
    for (size_t i = 0; i < sizeof options / sizeof *options; i++)
        if (strcmp(name, options[i][0]) == 0)
            return options[i][1];
    return NULL;
}

/* Text `name` of the file is `has`; now it would be `now`. */
static bool other(const char *path, const char *name, const char *has, const char *now, message *err)
{
    const char *typed = known_as(name);
    if (typed)
        return fail(err, "%s: was rendered with %s %s, not %s", path, typed, has, now);
    if (strncmp(name, "camera", 6) == 0)
        return fail(err, "%s: was rendered with another camera", path);
    if (strcmp(name, "surfacesAndLights") == 0)
        return fail(err, "%s: was rendered with other materials, instances, lights or another sky", path);
    return fail(err, "%s: was rendered from another scene (%s: %s, not %s)", path, name, has, now);
}

void resume_texts(const view *v, const settings *s, uint32_t done, image_texts *out)
{
    add_identity(v, s, out);
    image_text(out, "passes", "%u", done);
}

static bool read_passes(const char *path, const char *text, uint32_t *out, message *err)
{
    char *end;
    unsigned long n = strtoul(text, &end, 10);
    if (!*text || *end || n < 1 || n > (1u << 20))
        return fail(err, "%s: no pass of bdpt to go on from", path);
    *out = (uint32_t)n;
    return true;
}

bool resume_load(const char *path, const view *v, film *out, message *err)
{
    const settings *s = &v->settings;
    image_texts *wanted = xcalloc(1, sizeof *wanted);
    exr_text texts[TEXTS_MAX + 1];
    image_text(wanted, "scene", "%s", v->scene->name);
    image_text(wanted, "seed", "%llu", (unsigned long long)s->seed);
    image_text(wanted, "visibility", "%s", modes[s->visibility]);
    add_identity(v, s, wanted);
    size_t count = (size_t)wanted->count;
    for (size_t i = 0; i < count; i++)
        texts[i].name = wanted->items[i].name;
    texts[count].name = "passes";
    image read = {0};
    bool ok = image_load_exr_texts(path, texts, count + 1, &read, err);
    uint32_t done = 0;
    ok = ok && read_passes(path, texts[count].value, &done, err);
    if (ok && (read.width != s->width || read.height != s->height))
        ok = fail(err, "%s: has %ux%u pixels, not %ux%u", path, read.width, read.height, s->width, s->height);
    for (size_t i = 0; ok && i < count; i++)
        if (strcmp(texts[i].value, wanted->values[i]) != 0)
            ok = other(path, texts[i].name, texts[i].value, wanted->values[i], err);
    if (ok && done >= (uint32_t)s->spp)
        ok = fail(err, "%s: has %u passes already; --spp asks for %d", path, done, s->spp);
    free(wanted);
    if (!ok) {
        image_free(&read);
        return false;
    }
    *out = film_new(s->width, s->height);
    image_free(&out->mean);
    out->mean = read;
    out->passes = done;
    return true;
}
