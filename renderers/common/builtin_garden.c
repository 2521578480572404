/* SPDX-License-Identifier: Apache-2.0 */
/* What stands in the court of "atrium": fountain, trees, potted plants, benches, mirror and glass spheres. */
#include "builtin.h"

typedef struct garden {
    scene *s;
    float floor;
    uint32_t stone, clay, soil, bark, teak, water, mirror, glass, pot, earth, agave, bench_seat, bench_feet, pedestal;
    sprig leaves[3], broad[2];
} garden;

static xform at_floor(const garden *g, float x, float z, float yaw, float scale)
{
    return xform_place(v3(x, g->floor, z), yaw, scale);
}

/* Round basin with a raised bowl on a turned stem; two sheets of water. */
static void add_fountain(const garden *g, float x, float z)
{
    profile p = {0};
    shape basin = {0}, bowl = {0}, water = {0};
    profile_to(&p, 0.0f, 0.0f);
    profile_to(&p, 1.75f, 0.0f);
    profile_to(&p, 1.75f, 0.14f);
    profile_to(&p, 1.6f, 0.16f);
    profile_arc(&p, 1.6f, 0.34f, 0.1f, 240.0f, 130.0f, 6);
    profile_arc(&p, 1.6f, 0.50f, 0.07f, -90.0f, 90.0f, 8);
    profile_arc(&p, 1.42f, 0.54f, 0.03f, 90.0f, 180.0f, 4);
    profile_to(&p, 1.36f, 0.12f);
    profile_to(&p, 0.0f, 0.12f);
    shape_lathe(&basin, &p, 96);
    place(g->s, shape_to_mesh(g->s, &basin, g->stone, 35.0f), at_floor(g, x, z, 0.0f, 1.0f));

    p.count = 0;
    profile_to(&p, 0.0f, 0.1f);
    profile_to(&p, 0.30f, 0.1f);
    profile_to(&p, 0.30f, 0.2f);
    profile_arc(&p, 0.22f, 0.28f, 0.07f, -80.0f, 80.0f, 6);
    profile_to(&p, 0.15f, 0.42f);
    profile_to(&p, 0.11f, 0.62f);
    profile_arc(&p, 0.10f, 0.70f, 0.06f, -70.0f, 70.0f, 6);
    profile_to(&p, 0.10f, 0.82f);
    profile_to(&p, 0.16f, 0.90f);
    profile_arc(&p, 0.16f, 1.42f, 0.52f, -85.0f, -14.0f, 12);
    profile_arc(&p, 0.68f, 1.315f, 0.035f, -60.0f, 120.0f, 7);
    profile_arc(&p, 0.14f, 1.42f, 0.49f, -16.0f, -88.0f, 10);
    profile_to(&p, 0.07f, 0.94f);
    profile_to(&p, 0.05f, 1.24f);
    profile_arc(&p, 0.0f, 1.40f, 0.13f, -65.0f, 20.0f, 6);
    profile_to(&p, 0.05f, 1.54f);
    profile_to(&p, 0.0f, 1.66f);
    shape_lathe(&bowl, &p, 72);
    place(g->s, shape_to_mesh(g->s, &bowl, g->stone, 35.0f), at_floor(g, x, z, 0.0f, 1.0f));

    const float discs[2][2] = {{1.385f, 0.40f}, {0.62f, 1.25f}};
    for (int i = 0; i < 2; ++i) {
        shape disc = {0};
        p.count = 0;
        profile_to(&p, 0.0f, discs[i][1] - 0.01f);
        profile_to(&p, discs[i][0], discs[i][1] - 0.01f);
        profile_to(&p, discs[i][0], discs[i][1]);
        profile_to(&p, 0.0f, discs[i][1]);
        shape_lathe(&disc, &p, 64);
        shape_append(&water, &disc, at_floor(g, x, z, 0.0f, 1.0f));
        shape_free(&disc);
    }
    place_shape(g->s, &water, g->water, 30.0f);
}

static void define_pots(garden *g)
{
    profile p = {0};
    shape pot = {0}, earth = {0};
    profile_to(&p, 0.0f, 0.0f);
    profile_to(&p, 0.22f, 0.0f);
    profile_to(&p, 0.24f, 0.05f);
    profile_to(&p, 0.21f, 0.08f);
    profile_arc(&p, 0.06f, 0.36f, 0.30f, -48.0f, 30.0f, 12);
    profile_to(&p, 0.30f, 0.55f);
    profile_arc(&p, 0.345f, 0.60f, 0.035f, -100.0f, 100.0f, 8);
    profile_to(&p, 0.30f, 0.62f);
    profile_to(&p, 0.28f, 0.54f);
    profile_to(&p, 0.0f, 0.54f);
    shape_lathe(&pot, &p, 40);
    g->pot = shape_to_mesh(g->s, &pot, g->clay, 40.0f);
    p.count = 0;
    profile_to(&p, 0.0f, 0.545f);
    profile_to(&p, 0.27f, 0.545f);
    profile_to(&p, 0.282f, 0.57f);
    profile_to(&p, 0.12f, 0.585f);
    profile_to(&p, 0.0f, 0.59f);
    shape_lathe(&earth, &p, 28);
    g->earth = shape_to_mesh(g->s, &earth, g->soil, 40.0f);
}

static void place_pot(const garden *g, xform at)
{
    place(g->s, g->pot, at);
    place(g->s, g->earth, at);
}

/* Rosette of long bent blades. */
static void define_agave(garden *g, uint32_t green)
{
    shape blades = {0};
    rng r = rng_make(12, 0);
    for (int i = 0; i < 70; ++i) {
        float age = (float)i / 70.0f, yaw = 2.39996323f * (float)i, up = 1.45f - 1.15f * (1.0f - age);
        vec3 out = v3(cosf(yaw) * cosf(up), sinf(up), sinf(yaw) * cosf(up)), across = v3(-sinf(yaw), 0.0f, cosf(yaw));
        vec3 face = v3_cross(out, across);
        face = face.y < 0.0f ? v3_neg(face) : face;
        vec3 base = v3(0.05f * cosf(yaw), 0.57f + 0.06f * age, 0.05f * sinf(yaw));
        shape_leaf(&blades, xform_frame(base, v3_cross(face, out), face, out), rng_range(&r, 0.65f, 0.95f), 0.085f,
                   rng_range(&r, 1.0f, 1.9f) * (1.15f - 0.7f * age), 12);
    }
    g->agave = shape_to_mesh(g->s, &blades, green, 80.0f);
}

static void add_agave(const garden *g, float x, float y, float z, float yaw, float scale)
{
    xform at = xform_place(v3(x, y, z), yaw, scale);
    place_pot(g, at);
    place(g->s, g->agave, at);
}

static void add_shrub(const garden *g, uint64_t seed, float x, float y, float z, float scale)
{
    static const tree_style style = {.levels = 3,
                                     .children = 5,
                                     .sprigs = 5,
                                     .length = 0.45f,
                                     .radius = 0.028f,
                                     .shrink = 0.72f,
                                     .spread = 0.8f,
                                     .rise = 0.5f,
                                     .sprig_scale = 1.0f};
    xform at = xform_place(v3(x, y, z), (float)seed, scale);
    place_pot(g, at);
    tree_add(g->s, seed, style, xform_mul(at, xform_place(v3(0.0f, 0.57f, 0.0f), 0.0f, 1.0f)), g->bark, g->broad, 2);
}

/* Tree in a square stone planter. */
static void add_tree(const garden *g, uint64_t seed, float x, float z, float scale)
{
    static const tree_style style = {.levels = 4,
                                     .children = 4,
                                     .sprigs = 4,
                                     .length = 1.35f,
                                     .radius = 0.085f,
                                     .shrink = 0.62f,
                                     .spread = 0.78f,
                                     .rise = 0.45f,
                                     .sprig_scale = 1.0f};
    shape planter = {0}, earth = {0};
    for (int i = 0; i < 4; ++i) {
        shape wall = {0}, rim = {0};
        xform turn = xform_place(v3(x, g->floor, z), 0.5f * PI_F * (float)i, 1.0f);
        shape_box(&wall, v3(-0.72f, 0.0f, 0.58f), v3(0.58f, 0.5f, 0.72f), 0.01f);
        shape_box(&rim, v3(-0.77f, 0.5f, 0.54f), v3(0.54f, 0.58f, 0.77f), 0.015f);
        shape_append(&planter, &wall, turn);
        shape_append(&planter, &rim, turn);
        shape_free(&wall);
        shape_free(&rim);
    }
    place_shape(g->s, &planter, g->stone, 0.0f);
    shape_box(&earth, v3(x - 0.59f, g->floor, z - 0.59f), v3(x + 0.59f, g->floor + 0.47f, z + 0.59f), 0.02f);
    place_shape(g->s, &earth, g->soil, 0.0f);
    tree_add(g->s, seed, style, xform_place(v3(x, g->floor + 0.45f, z), (float)seed, scale), g->bark, g->leaves, 3);
}

static void define_furniture(garden *g)
{
    shape seat = {0}, feet = {0}, stand = {0};
    for (int i = 0; i < 5; ++i) {
        float z = -0.21f + 0.094f * (float)i;
        shape_box(&seat, v3(-0.8f, 0.42f, z), v3(0.8f, 0.455f, z + 0.08f), 0.006f);
    }
    for (int side = -1; side <= 1; side += 2) {
        float x = 0.58f * (float)side;
        shape_box(&feet, v3(x - 0.08f, 0.0f, -0.2f), v3(x + 0.08f, 0.42f, 0.25f), 0.02f);
    }
    g->bench_seat = shape_to_mesh(g->s, &seat, g->teak, 0.0f);
    g->bench_feet = shape_to_mesh(g->s, &feet, g->stone, 0.0f);
    shape_box(&stand, v3(-0.24f, 0.0f, -0.24f), v3(0.24f, 0.1f, 0.24f), 0.012f);
    shape_box(&stand, v3(-0.19f, 0.1f, -0.19f), v3(0.19f, 0.82f, 0.19f), 0.012f);
    shape_box(&stand, v3(-0.24f, 0.82f, -0.24f), v3(0.24f, 0.9f, 0.24f), 0.015f);
    g->pedestal = shape_to_mesh(g->s, &stand, g->stone, 0.0f);
}

static void add_bench(const garden *g, xform at)
{
    place(g->s, g->bench_seat, at);
    place(g->s, g->bench_feet, at);
}

static void add_ball(const garden *g, xform at, uint32_t surface, float radius, uint32_t segments)
{
    shape ball = {0};
    shape_sphere(&ball, v3(0.0f, 0.9f + radius, 0.0f), radius, segments);
    place(g->s, g->pedestal, at);
    place(g->s, shape_to_mesh(g->s, &ball, surface, 30.0f), at);
}

void build_atrium_garden(scene *s, float floor)
{
    garden g = {.s = s, .floor = floor};
    g.stone = material_add(s, MATERIAL_GLOSSY, v3(0.66f, 0.60f, 0.51f), 0.25f);
    g.clay = material_add(s, MATERIAL_DIFFUSE, v3(0.56f, 0.26f, 0.15f), 0.0f);
    g.soil = material_add(s, MATERIAL_DIFFUSE, v3(0.07f, 0.05f, 0.035f), 0.0f);
    g.bark = material_add(s, MATERIAL_DIFFUSE, v3(0.22f, 0.16f, 0.11f), 0.0f);
    g.teak = material_add(s, MATERIAL_DIFFUSE, v3(0.38f, 0.22f, 0.11f), 0.0f);
    g.water = material_add(s, MATERIAL_GLOSSY, v3(0.03f, 0.10f, 0.11f), 0.08f);
    g.mirror = material_add(s, MATERIAL_CONDUCTOR, v3(0.93f, 0.92f, 0.90f), 0.0f);
    g.glass = material_add(s, MATERIAL_DIELECTRIC, v3(0.97f, 0.99f, 0.98f), 0.0f);
    const rgb greens[5] = {{0.12f, 0.27f, 0.06f},
                           {0.19f, 0.36f, 0.08f},
                           {0.27f, 0.40f, 0.10f},
                           {0.07f, 0.22f, 0.08f},
                           {0.11f, 0.29f, 0.10f}};
    for (uint32_t i = 0; i < 3; ++i)
        g.leaves[i] =
            sprig_add(s, 20 + i, 16, 0.42f, 0.155f, 3, g.bark, material_add(s, MATERIAL_DIFFUSE, greens[i], 0.0f));
    for (uint32_t i = 0; i < 2; ++i)
        g.broad[i] =
            sprig_add(s, 40 + i, 9, 0.26f, 0.17f, 3, g.bark, material_add(s, MATERIAL_DIFFUSE, greens[3 + i], 0.0f));
    define_pots(&g);
    define_agave(&g, material_add(s, MATERIAL_DIFFUSE, v3(0.20f, 0.34f, 0.20f), 0.0f));
    define_furniture(&g);

    add_fountain(&g, -2.6f, 0.4f);
    add_tree(&g, 3, -7.2f, -0.6f, 1.1f);
    add_tree(&g, 5, -0.6f, 5.0f, 1.1f);
    add_tree(&g, 8, 2.6f, -5.0f, 0.9f);
    add_agave(&g, 1.2f, floor, -1.95f, 0.4f, 1.1f);
    add_agave(&g, 1.2f, floor, 1.95f, 2.1f, 1.1f);
    add_agave(&g, -9.3f, floor, -2.4f, 1.0f, 0.95f);
    add_shrub(&g, 11, -3.0f, 0.0f, -8.5f, 0.9f);
    add_shrub(&g, 12, -9.3f, floor, 6.2f, 1.1f);
    add_shrub(&g, 13, 9.3f, floor, -6.3f, 1.1f);
    add_ball(&g, at_floor(&g, -8.8f, -5.0f, 0.3f, 1.0f), g.glass, 0.28f, 56);
    add_ball(&g, at_floor(&g, -4.8f, 3.2f, 0.0f, 1.0f), g.mirror, 0.34f, 56);
    add_bench(&g, at_floor(&g, -1.6f, -4.6f, 0.0f, 1.0f));
    add_bench(&g, at_floor(&g, -2.6f, 4.2f, PI_F, 1.0f));
    add_bench(&g, xform_place(v3(3.0f, 0.01f, -10.25f), 0.0f, 1.0f));
}
