/* SPDX-License-Identifier: Apache-2.0 */
/* Emissive triangles as one area light. A triangle's side is drawn in proportion to area x luminance, so the density
 * per area depends on the material alone and a hit needs no look-up. Textures do not modulate emission. */
#include "emitters.h"

#include "triangle.h"

#include <stdlib.h>

/* One emitting side of a triangle, in world space. */
typedef struct emitter {
    vec3 corner, ab, ac, normal;
    const material *material;
} emitter;

struct emitters {
    const scene *scene;
    emitter *sides;
    double *ends;     /* per side: running sum of area x luminance, it included */
    uint32_t *guides; /* per side: the side at that part of the sum, to start the search from */
    size_t side_count;
    uint32_t triangle_count;
    double total; /* of area x luminance, over all sides */
};

static void add_triangle(emitters *e, uint32_t instance_index, uint32_t primitive, const material *m)
{
    vec3 p[3];
    float area;
    triangle_corners(e->scene, instance_index, primitive, p);
    vec3 normal = triangle_normal(p, &area);
    if (transform_mirrors(e->scene->instances[instance_index].to_world))
        normal = v3_neg(normal);
    if (!(area > 0.0f))
        return;
    e->triangle_count++;
    for (int side = 0; side < (m->two_sided ? 2 : 1); side++) {
        e->total += (double)area * luminance(m->emission);
        e->ends[e->side_count] = e->total;
        e->sides[e->side_count++] =
            (emitter){p[0], v3_sub(p[1], p[0]), v3_sub(p[2], p[0]), side ? v3_neg(normal) : normal, m};
    }
}

/* The material of an emitting instance, else NULL. */
static const material *emitting(const scene *s, uint32_t instance_index)
{
    const material *m = &s->materials[s->meshes[s->instances[instance_index].mesh].material];
    return luminance(m->emission) > 0.0f ? m : NULL;
}

/* guides[k]: the first side whose end lies beyond k / side_count of the sum. */
static void build_guides(emitters *e)
{
    size_t side = 0;
    for (size_t k = 0; k < e->side_count; k++) {
        while (side + 1 < e->side_count && !(e->ends[side] > (double)k / (double)e->side_count * e->total))
            side++;
        e->guides[k] = (uint32_t)side;
    }
}

emitters *emitters_new(const scene *s)
{
    size_t room = 0;
    for (uint32_t i = 0; i < s->instance_count; i++)
        if (emitting(s, i))
            room += 2 * (size_t)s->meshes[s->instances[i].mesh].triangle_count;
    if (room == 0)
        return NULL;

    emitters *e = xcalloc(1, sizeof *e);
    e->scene = s;
    e->sides = xmalloc(room * sizeof *e->sides);
    e->ends = xmalloc(room * sizeof *e->ends);
    e->guides = xmalloc(room * sizeof *e->guides);
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const material *m = emitting(s, i);
        for (uint32_t k = 0; m && k < s->meshes[s->instances[i].mesh].triangle_count; k++)
            add_triangle(e, i, k, m);
    }
    if (!(e->total > 0.0)) {
        emitters_free(e);
        return NULL;
    }
    build_guides(e);
    return e;
}

void emitters_free(emitters *e)
{
    if (!e)
        return;
    free(e->sides);
    free(e->ends);
    free(e->guides);
    free(e);
}

uint32_t emitters_count(const emitters *e)
{
    return e ? e->triangle_count : 0;
}

float emitters_power(const emitters *e)
{
    return e ? (float)((double)PI_F * e->total) : 0.0f;
}

emitter_sample emitters_sample(const emitters *e, float u1, float u2, float u3)
{
    double at = u1 * e->total;
    size_t guess = (size_t)(u1 * (double)e->side_count), last = e->side_count - 1;
    /* The first side whose end lies beyond `at`. One guide earlier and later: products are rounded. */
    size_t low = e->guides[guess > 0 ? (guess <= last ? guess : last) - 1 : 0];
    size_t high = guess + 2 < e->side_count ? e->guides[guess + 2] : last;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if (e->ends[middle] > at)
            high = middle;
        else
            low = middle + 1;
    }

    const emitter *x = &e->sides[low];
    float r = sqrtf(u2), a = r * (1.0f - u3), b = r * u3; /* uniform over the triangle */
    return (emitter_sample){.position = v3_add(x->corner, v3_mad(v3_scale(x->ab, a), b, x->ac)),
                            .normal = x->normal,
                            .radiance = x->material->emission,
                            .pdf_area = (float)(luminance(x->material->emission) / e->total)};
}

float emitters_pdf_area(const emitters *e, const surface *hit)
{
    if (!e || (hit->back_side && !hit->material->two_sided))
        return 0.0f;
    return (float)(luminance(hit->material->emission) / e->total);
}

rgb surface_emission(const surface *hit)
{
    return hit->back_side && !hit->material->two_sided ? v3(0.0f, 0.0f, 0.0f) : hit->material->emission;
}
