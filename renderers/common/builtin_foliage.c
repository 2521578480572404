/* SPDX-License-Identifier: Apache-2.0 */
/* Leaves, twigs and branching stems of the generated scenes. */
#include "builtin.h"

#define GOLDEN_ANGLE 2.39996323f

void shape_leaf(shape *s, xform at, float length, float width, float curl, uint32_t rows)
{
    const float step = length / (float)rows;
    vec3 spine = v3(0.0f, 0.0f, 0.0f);
    uint32_t previous = shape_vertex(s, transform_point(at.m, spine));
    for (uint32_t i = 1; i <= rows; ++i) {
        float t = (float)i / (float)rows, bend = curl * (t - 0.35f);
        spine = v3_add(spine, v3(0.0f, -step * sinf(bend), step * cosf(bend)));
        uint32_t v = shape_vertex(s, transform_point(at.m, spine));
        if (i == rows) {
            shape_triangle(s, previous, previous + 1, v);
            shape_triangle(s, previous, v, previous + 2);
            break;
        }
        float half = 0.5f * width * sinf(PI_F * powf(t, 0.75f)), lift = 0.3f * half;
        for (int side = -1; side <= 1; side += 2) {
            vec3 edge = v3((float)-side * half, lift * cosf(bend), lift * sinf(bend));
            shape_vertex(s, transform_point(at.m, v3_add(spine, edge)));
        }
        if (i == 1) {
            shape_triangle(s, previous, v + 1, v);
            shape_triangle(s, previous, v, v + 2);
        } else {
            shape_quad(s, previous, previous + 1, v + 1, v);
            shape_quad(s, previous, v, v + 2, previous + 2);
        }
        previous = v;
    }
}

sprig sprig_add(scene *s, uint64_t seed, uint32_t leaf_count, float length, float leaf_length, uint32_t leaf_rows,
                uint32_t wood, uint32_t green)
{
    rng r = rng_make(seed, 0);
    shape twig = {0}, leaves = {0};
    vec3 path[4];
    const float radii[4] = {0.014f * length, 0.011f * length, 0.008f * length, 0.004f * length};
    for (int i = 0; i < 4; ++i) {
        float sway = i ? 0.05f * length : 0.0f;
        path[i] = v3(rng_range(&r, -sway, sway), length * (float)i / 3.0f, rng_range(&r, -sway, sway));
    }
    shape_tube(&twig, path, radii, 4, 4);
    for (uint32_t i = 0; i < leaf_count; ++i) {
        float t = 3.0f * (0.15f + 0.85f * (float)(i + 1) / (float)leaf_count);
        int k = t < 2.999f ? (int)t : 2;
        vec3 base = v3_mad(path[k], t - (float)k, v3_sub(path[k + 1], path[k]));
        float turn = GOLDEN_ANGLE * (float)i + rng_range(&r, -0.3f, 0.3f);
        float up = i + 1 == leaf_count ? 1.3f : rng_range(&r, 0.2f, 0.8f);
        vec3 out = v3(cosf(turn) * cosf(up), sinf(up), sinf(turn) * cosf(up));
        vec3 across = v3(-sinf(turn), 0.0f, cosf(turn)), face = v3_cross(out, across);
        face = face.y < 0.0f ? v3_neg(face) : face;
        float size = leaf_length * rng_range(&r, 0.7f, 1.1f);
        xform at = xform_frame(base, v3_cross(face, out), face, out);
        shape_leaf(&leaves, at, size, 0.42f * size, rng_range(&r, 0.5f, 1.4f), leaf_rows);
    }
    sprig result = {shape_to_mesh(s, &twig, wood, 60.0f), shape_to_mesh(s, &leaves, green, 80.0f)};
    return result;
}

typedef struct growth {
    scene *s;
    rng r;
    tree_style style;
    xform at;
    const sprig *kinds;
    uint32_t kind_count, sprig_count;
    shape wood;
} growth;

static vec3 random_unit(rng *r)
{
    float y = rng_range(r, -1.0f, 1.0f), angle = rng_range(r, 0.0f, 2.0f * PI_F), c = sqrtf(fmaxf(0.0f, 1.0f - y * y));
    return v3(c * cosf(angle), y, c * sinf(angle));
}

static void hang_sprig(growth *g, vec3 p, vec3 direction)
{
    const sprig *kind = &g->kinds[rng_u32(&g->r) % g->kind_count];
    float scale = g->style.sprig_scale * rng_range(&g->r, 0.75f, 1.2f);
    xform at = xform_mul(g->at, xform_along(p, direction, rng_range(&g->r, 0.0f, 2.0f * PI_F), scale));
    place(g->s, kind->twig, at);
    place(g->s, kind->leaves, at);
    ++g->sprig_count;
}

enum { BRANCH_POINTS = 6 };

static void grow(growth *g, vec3 base, vec3 direction, float length, float radius, uint32_t level)
{
    vec3 path[BRANCH_POINTS] = {base}, ways[BRANCH_POINTS] = {direction};
    float radii[BRANCH_POINTS];
    const bool outermost = level + 1 == g->style.levels;
    for (int i = 0; i < BRANCH_POINTS; ++i) {
        float t = (float)i / (BRANCH_POINTS - 1);
        radii[i] = radius * (1.0f - (outermost ? 0.7f : 0.35f) * t);
        if (i == 0)
            continue;
        vec3 pull = v3_mad(v3(0.0f, g->style.rise * 0.35f, 0.0f), 0.16f, random_unit(&g->r));
        ways[i] = v3_normalize(v3_add(ways[i - 1], pull));
        path[i] = v3_mad(path[i - 1], length / (BRANCH_POINTS - 1), ways[i]);
    }
    shape_tube(&g->wood, path, radii, BRANCH_POINTS, level == 0 ? 14 : level == 1 ? 9 : 6);
    uint32_t count = outermost ? g->style.sprigs : g->style.children;
    float turn = rng_range(&g->r, 0.0f, 2.0f * PI_F);
    for (uint32_t i = 0; i < count; ++i) {
        /* the last one goes on from the end, the others leave from the outer part */
        bool leader = i + 1 == count;
        float t = leader ? 1.0f : (outermost ? 0.25f : 0.55f) + (outermost ? 0.75f : 0.45f) * (float)i / (float)count;
        float along = t * (BRANCH_POINTS - 1);
        int k = (int)fminf(along, BRANCH_POINTS - 2.0f);
        vec3 from = v3_mad(path[k], along - (float)k, v3_sub(path[k + 1], path[k])), side, other;
        v3_basis(ways[k + 1], &side, &other);
        turn += GOLDEN_ANGLE + rng_range(&g->r, -0.4f, 0.4f);
        float angle = g->style.spread * (leader ? 0.35f : rng_range(&g->r, 0.75f, 1.2f));
        vec3 out = v3_mad(v3_scale(side, cosf(turn)), sinf(turn), other);
        vec3 way = v3_normalize(v3_mad(v3_scale(ways[k + 1], cosf(angle)), sinf(angle), out));
        if (outermost)
            hang_sprig(g, from, way);
        else
            grow(g, from, way, length * g->style.shrink * rng_range(&g->r, 0.8f, 1.15f),
                 radii[k + 1] * (leader ? 0.9f : 0.65f), level + 1);
    }
}

uint32_t tree_add(scene *s, uint64_t seed, tree_style style, xform at, uint32_t wood, const sprig *kinds,
                  uint32_t kind_count)
{
    growth g = {.s = s, .r = rng_make(seed, 1), .style = style, .at = at, .kinds = kinds, .kind_count = kind_count};
    grow(&g, v3(0.0f, 0.0f, 0.0f), v3(0.0f, 1.0f, 0.0f), style.length, style.radius, 0);
    place(s, shape_to_mesh(s, &g.wood, wood, 50.0f), at);
    return g.sprig_count;
}
