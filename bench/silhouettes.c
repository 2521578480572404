/* SPDX-License-Identifier: Apache-2.0 */
/* How much of an image lies at silhouettes, as coarse-to-fine evaluation meets them (Ben-Artzi et al. 2006, Sect. 6.2):
 * the share of pixels that see a surface and of whose informing pixels one does not see the same object (instance). All
 * their shadow rays are traced. The informing pixels are the paper's (Fig. 3): the four corners of a square, then the
 * four of a square that stands on its tip, each grid half as wide as the one before; at the image's edge those that
 * there are. Primary rays through the middle of the pixels, no lights.
 *
 *     silhouettes SCENE [CAMERA [WIDTH HEIGHT]]
 */
#include "renderers/whitted/whitted.h"

#include "renderers/common/camera.h"

#include <stdio.h>

enum { SPACING = 16 };
#define NOTHING UINT32_MAX

typedef struct view_of_objects {
    long width, height;
    uint32_t *object; /* of each pixel; NOTHING: the sky */
} view_of_objects;

static void see(const tracer *t, const camera *c, view_of_objects *out)
{
    const camera_frame f = camera_frame_of(c, (uint32_t)out->width, (uint32_t)out->height);
    surface hit;
    for (long y = 0; y < out->height; y++)
        for (long x = 0; x < out->width; x++) {
            float cosine;
            vec3 d = camera_direction(&f, (float)x + 0.5f, (float)y + 0.5f, &cosine);
            out->object[y * out->width + x] = tracer_closest(t, f.eye, d, &hit) ? hit.instance : NOTHING;
        }
}

/* Whether the pixel and all that inform it see one object. `step`: half of the grid that is there; `tip`: the square
 * stands on its tip. */
static bool agree(const view_of_objects *v, long x, long y, long step, bool tip)
{
    static const int corners[4][2] = {{-1, -1}, {1, -1}, {-1, 1}, {1, 1}},
                     tips[4][2] = {{0, -1}, {-1, 0}, {1, 0}, {0, 1}};
    for (int i = 0; i < 4; i++) {
        long u = x + step * (tip ? tips[i][0] : corners[i][0]), w = y + step * (tip ? tips[i][1] : corners[i][1]);
        if (u >= 0 && w >= 0 && u < v->width && w < v->height &&
            v->object[w * v->width + u] != v->object[y * v->width + x])
            return false;
    }
    return true;
}

static void print_shares(const view_of_objects *v)
{
    long pixels = v->width * v->height, surfaces = 0, edges = 0, coarsest = 0;
    for (long i = 0; i < pixels; i++)
        surfaces += v->object[i] != NOTHING;
    for (long step = SPACING / 2; step >= 1; step /= 2)
        for (long y = 0; y < v->height; y += step)
            for (long x = 0; x < v->width; x += step) {
                bool odd_x = x / step % 2, odd_y = y / step % 2;
                if (step == SPACING / 2 && !odd_x && !odd_y)
                    coarsest += v->object[y * v->width + x] != NOTHING;
                if ((odd_x || odd_y) && v->object[y * v->width + x] != NOTHING)
                    edges += !agree(v, x, y, step, !(odd_x && odd_y));
            }
    double all = surfaces > 0 ? (double)surfaces : 1.0;
    printf(
        "%ldx%ld: %.1f %% of the pixels see a surface; of these %.2f %% at silhouettes, %.2f %% of the coarsest grid\n",
        v->width, v->height, 100.0 * (double)surfaces / (double)pixels, 100.0 * (double)edges / all,
        100.0 * (double)coarsest / all);
}

int main(int argc, char *argv[])
{
    message err = {{0}};
    scene *s = NULL;
    tracer *t = NULL;
    long camera_index = argc > 2 ? strtol(argv[2], NULL, 10) : 0;
    view_of_objects v = {.width = 513, .height = 513};
    if (argc > 4)
        v.width = strtol(argv[3], NULL, 10), v.height = strtol(argv[4], NULL, 10);
    if (argc < 2 || argc == 4 || argc > 5 || v.width < 1 || v.height < 1 || v.width > 8192 || v.height > 8192) {
        fprintf(stderr, "usage: silhouettes SCENE [CAMERA [WIDTH HEIGHT]]\n");
        return 2;
    }
    bool ok = (scene_builtin(argv[1], &s) || scene_load(argv[1], &s, &err)) && scene_finish(s, &err) &&
              tracer_create(s, 1, &t, &err);
    if (ok && (camera_index < 0 || (uint32_t)camera_index >= s->camera_count))
        ok = fail(&err, "camera %ld: the scene has %u, from 0", camera_index, s->camera_count);
    if (ok) {
        v.object = xmalloc((size_t)v.width * (size_t)v.height * sizeof *v.object);
        tracer_thread_init();
        see(t, &s->cameras[camera_index], &v);
        printf("%s, camera %ld (%s), ", s->name, camera_index, s->cameras[camera_index].name);
        print_shares(&v);
        free(v.object);
    } else {
        fprintf(stderr, "silhouettes: %s\n", err.text);
    }
    tracer_free(t);
    scene_free(s);
    return ok ? 0 : 1;
}
