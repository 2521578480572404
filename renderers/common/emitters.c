/* SPDX-License-Identifier: Apache-2.0 */
/* Emissive triangles as one area light. A triangle's side is drawn in proportion to area x luminance, so the density
 * per area depends on the material alone and a hit needs no look-up. Textures do not modulate emission. */
#include "emitters.h"

#include "triangle.h"

#include <stdlib.h>

/* One emitting side of a triangle. */
typedef struct emitter {
    uint32_t instance, primitive;
    bool inner; /* the side opposite to the triangle's own normal */
    double end; /* running sum of area x luminance, this one included */
} emitter;

struct emitters {
    const scene *scene;
    emitter *sides;
    size_t side_count;
    uint32_t triangle_count;
    double total; /* of area x luminance, over all sides */
};

static void add_triangle(emitters *e, uint32_t instance_index, uint32_t primitive, const material *m)
{
    vec3 p[3];
    float area;
    triangle_corners(e->scene, instance_index, primitive, p);
    triangle_normal(p, &area);
    if (!(area > 0.0f))
        return;
    e->triangle_count++;
    for (int side = 0; side < (m->two_sided ? 2 : 1); side++) {
        e->total += (double)area * luminance(m->emission);
        e->sides[e->side_count++] = (emitter){instance_index, primitive, side == 1, e->total};
    }
}

/* The material of an emitting instance, else NULL. */
static const material *emitting(const scene *s, uint32_t instance_index)
{
    const material *m = &s->materials[s->meshes[s->instances[instance_index].mesh].material];
    return luminance(m->emission) > 0.0f ? m : NULL;
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
    for (uint32_t i = 0; i < s->instance_count; i++) {
        const material *m = emitting(s, i);
        for (uint32_t k = 0; m && k < s->meshes[s->instances[i].mesh].triangle_count; k++)
            add_triangle(e, i, k, m);
    }
    if (e->total > 0.0)
        return e;
    emitters_free(e);
    return NULL;
}

void emitters_free(emitters *e)
{
    if (!e)
        return;
    free(e->sides);
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
    size_t low = 0, high = e->side_count - 1;
    while (low < high) { /* the first side whose end lies beyond `at` */
        size_t middle = low + (high - low) / 2;
        if (e->sides[middle].end > at)
            high = middle;
        else
            low = middle + 1;
    }

    const emitter *x = &e->sides[low];
    const instance *in = &e->scene->instances[x->instance];
    const material *m = &e->scene->materials[e->scene->meshes[in->mesh].material];
    emitter_sample out = {.radiance = m->emission, .pdf_area = (float)(luminance(m->emission) / e->total)};
    vec3 p[3];
    float area, r = sqrtf(u2), a = r * (1.0f - u3), b = r * u3; /* uniform over the triangle */
    triangle_corners(e->scene, x->instance, x->primitive, p);
    out.position = v3_add(p[0], v3_mad(v3_scale(v3_sub(p[1], p[0]), a), b, v3_sub(p[2], p[0])));
    out.normal = triangle_normal(p, &area);
    if (transform_mirrors(in->to_world) != x->inner)
        out.normal = v3_neg(out.normal);
    return out;
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
