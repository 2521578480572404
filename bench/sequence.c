/* SPDX-License-Identifier: Apache-2.0 */
/* Does it flicker? Renders a sequence of frames exactly and in other ways, and says how much the difference changes
 * from frame to frame (temporal.h).
 *
 *     sequence SCENE --motion camera|light [--frames N] --ways WAY:VALUE,... [--size WxH] [--env-lights N] ...
 *
 * Ways: cache:C_E is emptied for each frame; kept:C_E is not, it forgets what it knew of lights that moved;
 * unrefined:C_E is emptied, and has one level; estimate:K, selection:K (no cache) and grid:MODE are frames of
 * whitted's. The camera goes forward by a thousandth of the scene's diagonal and turns by a quarter of a degree a
 * frame; directional lights (the environment's too) turn by a degree, all others stand. Virtual point lights stand as
 * well: those of the first frame. Prints JSON; `rays`: share of exact's. Grid modes are compared with exact frames of
 * their own eye paths.
 */
#include "lighting.h"
#include "temporal.h"

#include <stdio.h>
#include <string.h>

enum { WAYS_MAX = 24 };

static const char *const way_names[] = {"cache", "kept", "unrefined", "estimate", "selection", "grid", NULL};
typedef enum way_kind { WAY_CACHE, WAY_KEPT, WAY_UNREFINED, WAY_ESTIMATE, WAY_SELECTION, WAY_GRID } way_kind;

typedef struct way {
    way_kind kind;
    char value[64];
    view view;
    caches caches;
    visibility *visibility;
    ray_counts rays; /* of the frames before; exact's where it is a frame of whitted's */
    temporal sums;
} way;

typedef struct sequence {
    stage stage;
    const char *words;
    int motion, frames;
    way ways[WAYS_MAX];
    int count;
    bool lattice; /* a way needs exact frames of its eye paths */
} sequence;

static bool read_value(sequence *s, way *w, message *err)
{
    settings *f = &w->view.settings;
    char *end;
    float value = strtof(w->value, &end);
    if (w->kind == WAY_GRID) {
        f->visibility = VISIBILITY_GRID;
        s->lattice = f->lattice = true;
        if (!grid_samples_fit(f->spp))
            return fail(err, "grid: --spp must be a square, at most %d", PASS);
        return grid_parse(w->value, f, err);
    }
    if (end == w->value || *end || !(value > 0.0f && value <= 10000.0f))
        return fail(err, "--ways: %s:%s is no number above 0 and up to 10000", way_names[w->kind], w->value);
    if (w->kind == WAY_ESTIMATE || w->kind == WAY_SELECTION) {
        f->visibility = w->kind == WAY_ESTIMATE ? VISIBILITY_ESTIMATE : VISIBILITY_SELECT;
        f->rays = value;
        f->ce = 12.0f;
        return true;
    }
    f->visibility = VISIBILITY_CACHE;
    f->ce = f->ce_delta = value;
    if (w->kind == WAY_UNREFINED)
        f->cache.levels = 1;
    return true;
}

static bool read_ways(sequence *s, message *err)
{
    const char *at = s->words ? s->words : "cache:8,kept:8";
    while (*at) {
        size_t length = strcspn(at, ","), name = strcspn(at, ":,");
        way *w = &s->ways[s->count];
        int kind = 0;
        while (way_names[kind] && (strncmp(way_names[kind], at, name) != 0 || way_names[kind][name]))
            kind++;
        if (s->count == WAYS_MAX || !way_names[kind] || name == length || length - name - 1 >= sizeof w->value)
            return fail(err,
                        "--ways takes at most %d of cache:C_E, kept:C_E, unrefined:C_E, estimate:K, selection:K, "
                        "grid:MODE",
                        WAYS_MAX);
        w->kind = (way_kind)kind;
        memcpy(w->value, at + name + 1, length - name - 1);
        w->view = s->stage.view;
        w->view.vpls = &s->stage.lights;
        if (!read_value(s, w, err))
            return false;
        s->count++;
        at += length + (at[length] == ',');
    }
    return s->count > 0 ? true : fail(err, "--ways: none");
}

/* ------------------------------------------------------------------------------------------------------- movement */

static vec3 turned(vec3 v, double degrees)
{
    double a = degrees * (double)PI_F / 180.0;
    float c = (float)cos(a), s = (float)sin(a);
    return v3(c * v.x + s * v.z, v.y, c * v.z - s * v.x);
}

static void move_camera(sequence *s)
{
    camera *c = &s->stage.view.camera;
    float diagonal = v3_length(v3_sub(s->stage.scene->bounds_max, s->stage.scene->bounds_min));
    c->eye = v3_mad(c->eye, 1e-3f * diagonal, c->forward);
    c->forward = v3_normalize(turned(c->forward, 0.25));
    c->up = v3_normalize(turned(c->up, 0.25));
}

static void move_lights(sequence *s)
{
    scene *of = s->stage.scene;
    vcache_light *end = xmalloc(vcache_light_size());
    for (uint32_t i = 0; i < of->light_count; i++) {
        light *l = &of->lights[i];
        if (l->kind != LIGHT_DIRECTIONAL)
            continue;
        l->direction = v3_normalize(turned(l->direction, 1.0));
        float to[3];
        vec3_store(to, v3_neg(l->direction));
        for (int k = 0; k < s->count; k++) {
            way *w = &s->ways[k];
            if (w->kind != WAY_KEPT || !w->visibility)
                continue;
            vcache_prepare_direction(w->caches.table, to, i, end);
            vcache_light_set_replace(w->caches.punctual_set, i, end);
        }
    }
    free(end);
}

/* ---------------------------------------------------------------------------------------------------------- frames */

static void forget(way *w)
{
    if (w->visibility) {
        ray_counts r = visibility_counts(w->visibility);
        w->rays.asked += r.asked;
        w->rays.traced += r.traced;
    }
    visibility_free(w->visibility);
    caches_free(&w->caches);
    w->visibility = NULL;
}

static bool render_cached(const stage *s, way *w, const eye_list *eyes, const image *exact, message *err)
{
    const settings *f = &w->view.settings;
    if (w->kind != WAY_KEPT)
        forget(w);
    if (!w->visibility) {
        if (!caches_new(&w->view, &s->lights, &w->caches, err))
            return false;
        w->visibility = visibility_new(&w->view, &s->lights, &w->caches);
    }
    uint32_t *order = xmalloc(((size_t)eyes->count + 1) * sizeof *order);
    eyes_sort(eyes->pixel, eyes->count, f->width, ORDER_HALTON, (double)f->ce / sqrt((double)f->spp), order);
    lit l = lighting_render(&w->view, &s->lights, eyes, order, lighting_resolve, w->visibility);
    temporal_add(&w->sums, exact, &l.image);
    lit_free(&l);
    free(order);
    return true;
}

/* A frame of whitted's; `lattice`: the exact one of the same eye paths, for the grid. */
static bool render_whitted(way *w, const image *exact, const image *lattice, message *err)
{
    frame f;
    if (!frame_render(&w->view, "", true, NULL, NULL, &f, err)) {
        frame_free(&f);
        return false;
    }
    w->rays.asked += f.rays.asked;
    w->rays.traced += f.rays.traced;
    temporal_add(&w->sums, w->kind == WAY_GRID ? lattice : exact, &f.lit);
    frame_free(&f);
    return true;
}

static bool render_frame(sequence *s, uint32_t frame_index, uint32_t *eye_count, message *err)
{
    stage *of = &s->stage;
    eye_list eyes = eye_list_new(&of->view);
    lit exact = lighting_exact(&of->view, &of->lights, &eyes);
    frame lattice = {.complete = true};
    bool ok = true;
    *eye_count = eyes.count;
    if (s->lattice) {
        view v = of->view;
        v.vpls = &of->lights;
        v.settings.lattice = true;
        ok = frame_render(&v, "", true, NULL, NULL, &lattice, err);
    }
    for (int i = 0; i < s->count && ok; i++) {
        way *w = &s->ways[i];
        w->view.camera = of->view.camera;
        w->view.settings.frame = frame_index;
        ok = w->kind < WAY_ESTIMATE ? render_cached(of, w, &eyes, &exact.image, err)
                                    : render_whitted(w, &exact.image, &lattice.lit, err);
    }
    frame_free(&lattice);
    lit_free(&exact);
    eye_list_free(&eyes);
    return ok;
}

static void print(sequence *s, uint32_t eye_count)
{
    printf("{");
    stage_print(&s->stage, eye_count);
    printf(", \"frames\": %d, \"light\": %.9g, \"ways\": [", s->frames, s->ways[0].sums.light / (s->frames - 1));
    for (int i = 0; i < s->count; i++) {
        way *w = &s->ways[i];
        forget(w);
        printf("%s{\"name\": \"%s\", \"value\": \"%s\", \"rays\": %.9g, ", i ? ", " : "", way_names[w->kind], w->value,
               w->rays.asked ? (double)w->rays.traced / (double)w->rays.asked : 0.0);
        temporal_print(&w->sums);
        printf("}");
    }
    printf("]}\n");
}

static bool render(sequence *s, message *err)
{
    uint32_t eye_count = 0;
    bool ok = read_ways(s, err);
    for (int i = 0; i < s->frames && ok; i++) {
        if (i > 0)
            (s->motion == 0 ? move_camera : move_lights)(s);
        ok = render_frame(s, (uint32_t)i, &eye_count, err);
    }
    if (ok)
        print(s, eye_count);
    for (int i = 0; i < s->count; i++) {
        forget(&s->ways[i]);
        temporal_free(&s->ways[i].sums);
    }
    return ok;
}

int main(int argc, char *argv[])
{
    static sequence s;
    static const char *const motions[] = {"camera", "light", NULL};
    int code = 0;
    message err = {{0}};
    s = (sequence){.stage = stage_defaults("sequence"), .frames = 8};
    const option table[] = {
        STAGE_OPTIONS(&s.stage),
        {.name = "motion", .kind = OPTION_CHOICE, .value = &s.motion, .choices = motions, .help = "what moves"},
        {.name = "frames", .kind = OPTION_INT, .value = &s.frames, .min = 2, .max = 10000, .help = "how many"},
        {.name = "ways",
         .kind = OPTION_STRING,
         .value = &s.words,
         .metavar = "WAY:VALUE,...",
         .help = "cache, kept, unrefined :C_E; estimate, selection :K; grid:MODE"},
    };
    if (stage_open(&s.stage, "How the error changes from frame to frame, as JSON.", table, sizeof table / sizeof *table,
                   argc, argv, &code))
        code = program_end(&s.stage.arguments, render(&s, &err), &err);
    stage_free(&s.stage);
    return code;
}
