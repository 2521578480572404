/* SPDX-License-Identifier: Apache-2.0 */
/* conference-lights: a conference room under 24 ceiling fixtures, after the test scene of G. J. Ward, "Adaptive Shadow
 * Testing for Ray Tracing" (1991). Metres; the floor lies at y = 0, the ceiling at y = 3. */
#include "builtin.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DEGREE (PI_F / 180.0f)

enum { FIXTURES_X = 6, FIXTURES_Z = 4, FIXTURES = FIXTURES_X * FIXTURES_Z, LIGHTS_MAX = 65536 };

static const float half_x = 6.0f, half_z = 4.0f, ceiling = 3.0f;

typedef struct room {
    scene *s;
    float lift; /* of the furniture, off the floor */
    uint32_t white, wood, dark, cloth, metal, paper, clay, green, accent;
} room;

static vec3 at(const room *r, float x, float y, float z)
{
    return v3(x, y + r->lift, z);
}

static void box(shape *s, float x0, float x1, float y0, float y1, float z0, float z1, float bevel)
{
    shape_box(s, v3(x0, y0, z0), v3(x1, y1, z1), bevel);
}

static void tube(shape *s, vec3 from, vec3 to, float radius)
{
    const vec3 path[2] = {from, to};
    const float radii[2] = {radius, radius};
    shape_tube(s, path, radii, 2, 10);
}

static void build_walls(const room *r, uint32_t wall, uint32_t carpet)
{
    const float x = half_x, z = half_z, h = ceiling, t = 0.1f;
    shape floor = {0}, walls = {0}, fixtures = {0};
    box(&floor, -x, x, -t, 0.0f, -z, z, 0.0f);
    place_shape(r->s, &floor, carpet, 0.0f);
    box(&walls, -x - t, x + t, h, h + t, -z - t, z + t, 0.0f);
    box(&walls, -x - t, -x, -t, h, -z - t, z + t, 0.0f);
    box(&walls, x, x + t, -t, h, -z - t, z + t, 0.0f);
    box(&walls, -x, x, -t, h, -z - t, -z, 0.0f);
    box(&walls, -x, x, -t, h, z, z + t, 0.0f);
    place_shape(r->s, &walls, wall, 0.0f);
    for (int i = 0; i < FIXTURES; i++) {
        float cx = -5.0f + 2.0f * (float)(i % FIXTURES_X), cz = -3.0f + 2.0f * (float)(i / FIXTURES_X);
        box(&fixtures, cx - 0.6f, cx + 0.6f, h - 0.03f, h - 0.001f, cz - 0.3f, cz + 0.3f, 0.0f);
    }
    place_shape(r->s, &fixtures, r->white, 0.0f);
}

/* Lights are spread evenly over the fixtures, those of one on a grid just below it; all fixtures are alike bright. */
static void build_lights(const room *r, uint32_t count, bool diffuse)
{
    for (uint32_t f = 0; f < FIXTURES; f++) {
        uint32_t first = (uint32_t)((uint64_t)count * f / FIXTURES),
                 end = (uint32_t)((uint64_t)count * (f + 1) / FIXTURES);
        uint32_t n = end - first, across = (uint32_t)ceilf(sqrtf(2.0f * (float)n)),
                 down = across ? (n + across - 1) / across : 1;
        float cx = -5.0f + 2.0f * (float)(f % FIXTURES_X), cz = -3.0f + 2.0f * (float)(f / FIXTURES_X);
        float power = (diffuse ? 12.0f : 30.0f) * (float)FIXTURES / (float)(count < FIXTURES ? count : FIXTURES * n);
        for (uint32_t i = 0; i < n; i++) {
            float u = ((float)(i % across) + 0.5f) / (float)across, w = ((float)(i / across) + 0.5f) / (float)down;
            light l = {.kind = LIGHT_SPOT,
                       .position = v3(cx + 1.2f * (u - 0.5f), ceiling - 0.04f, cz + 0.6f * (w - 0.5f)),
                       .direction = v3(0.0f, -1.0f, 0.0f),
                       .intensity = v3(power, 0.95f * power, 0.85f * power),
                       .cos_inner = 1.0f,
                       .cos_outer = diffuse ? 0.0f : cosf(80.0f * DEGREE),
                       .power = diffuse ? 1 : 8};
            scene_add_light(r->s, l);
        }
    }
}

static void build_table(const room *r)
{
    shape top = {0}, feet = {0};
    box(&top, -3.2f, 3.2f, 0.70f, 0.74f, -0.8f, 0.8f, 0.006f);
    for (int i = -1; i <= 1; i++) {
        float x = 2.4f * (float)i;
        box(&feet, x - 0.05f, x + 0.05f, 0.04f, 0.70f, -0.45f, 0.45f, 0.004f);
        box(&feet, x - 0.08f, x + 0.08f, 0.0f, 0.04f, -0.65f, 0.65f, 0.004f);
    }
    box(&feet, -2.4f, 2.4f, 0.30f, 0.38f, -0.02f, 0.02f, 0.0f);
    place(r->s, shape_to_mesh(r->s, &top, r->wood, 0.0f), xform_place(at(r, 0, 0, 0), 0.0f, 1.0f));
    place(r->s, shape_to_mesh(r->s, &feet, r->dark, 0.0f), xform_place(at(r, 0, 0, 0), 0.0f, 1.0f));
}

/* Faces +z. */
static void chair_meshes(const room *r, uint32_t *frame, uint32_t *cushions)
{
    shape f = {0}, c = {0};
    for (int i = 0; i < 2; i++) {
        float x = i ? 0.24f : -0.24f;
        tube(&f, v3(x, 0.0f, 0.22f), v3(x, 0.62f, 0.20f), 0.013f);   /* front leg, up to the arm */
        tube(&f, v3(x, 0.0f, -0.26f), v3(x, 0.95f, -0.28f), 0.013f); /* back leg and post */
        tube(&f, v3(x, 0.62f, 0.22f), v3(x, 0.62f, -0.28f), 0.016f); /* arm */
        tube(&f, v3(x, 0.40f, 0.21f), v3(x, 0.40f, -0.26f), 0.010f);
    }
    tube(&f, v3(-0.24f, 0.12f, -0.26f), v3(0.24f, 0.12f, -0.26f), 0.009f);
    tube(&f, v3(-0.24f, 0.93f, -0.28f), v3(0.24f, 0.93f, -0.28f), 0.014f);
    for (int i = -2; i <= 2; i++) /* slats of the back */
        tube(&f, v3(0.08f * (float)i, 0.60f, -0.275f), v3(0.08f * (float)i, 0.92f, -0.28f), 0.008f);
    tube(&f, v3(-0.24f, 0.60f, -0.275f), v3(0.24f, 0.60f, -0.275f), 0.010f);
    box(&c, -0.23f, 0.23f, 0.41f, 0.47f, -0.25f, 0.23f, 0.015f);
    *frame = shape_to_mesh(r->s, &f, r->metal, 40.0f);
    *cushions = shape_to_mesh(r->s, &c, r->cloth, 0.0f);
}

static void build_chairs(const room *r)
{
    uint32_t frame, cushions;
    rng g = rng_make(24, 0);
    chair_meshes(r, &frame, &cushions);
    for (int i = 0; i < 14; i++) {
        bool end = i >= 12;
        float side = i % 2 ? 1.0f : -1.0f, x = end ? 3.65f * side : -2.5f + (float)(i / 2),
              z = end ? 0.0f : 1.05f * side;
        float yaw = end ? (side > 0.0f ? -90.0f : 90.0f) : side > 0.0f ? 180.0f : 0.0f;
        vec3 where = at(r, x + rng_range(&g, -0.06f, 0.06f), 0.0f, z + rng_range(&g, -0.08f, 0.12f) * side);
        xform put = xform_place(where, (yaw + rng_range(&g, -14.0f, 14.0f)) * DEGREE, 1.0f);
        place(r->s, frame, put);
        place(r->s, cushions, put);
    }
}

static void lathe_cup(shape *s)
{
    profile p = {0};
    profile_to(&p, 0.0f, 0.0f);
    profile_to(&p, 0.028f, 0.0f);
    profile_to(&p, 0.040f, 0.09f);
    profile_to(&p, 0.036f, 0.09f);
    profile_to(&p, 0.026f, 0.012f);
    profile_to(&p, 0.0f, 0.012f);
    shape_lathe(s, &p, 24);
}

/* Cups, sheets of paper and open laptops on the table. */
static void build_table_ware(const room *r)
{
    shape cup = {0}, papers = {0}, laptop = {0};
    rng g = rng_make(25, 0);
    lathe_cup(&cup);
    box(&laptop, -0.16f, 0.16f, 0.0f, 0.015f, -0.11f, 0.11f, 0.0f);
    box(&laptop, -0.16f, 0.16f, 0.015f, 0.225f, 0.115f, 0.123f, 0.0f);
    uint32_t cup_mesh = shape_to_mesh(r->s, &cup, r->white, 40.0f);
    uint32_t laptop_mesh = shape_to_mesh(r->s, &laptop, r->dark, 0.0f);
    for (int i = 0; i < 12; i++) {
        float side = i % 2 ? 1.0f : -1.0f, x = -2.5f + (float)(i / 2);
        place(r->s, cup_mesh,
              xform_place(at(r, x + 0.28f, 0.74f, side * rng_range(&g, 0.45f, 0.6f)), rng_range(&g, 0, 6), 1.0f));
        if (i % 3 == 0)
            place(r->s, laptop_mesh, xform_place(at(r, x, 0.74f, side * 0.5f), side > 0.0f ? PI_F : 0.0f, 1.0f));
        else
            for (int k = 0; k < 3; k++) {
                float px = x + rng_range(&g, -0.1f, 0.05f), pz = side * rng_range(&g, 0.42f, 0.58f),
                      y = 0.741f + 0.003f * (float)k;
                box(&papers, px - 0.105f, px + 0.105f, y, y + 0.002f, pz - 0.15f, pz + 0.15f, 0.0f);
            }
    }
    place(r->s, shape_to_mesh(r->s, &papers, r->paper, 0.0f), xform_place(at(r, 0, 0, 0), 0.0f, 1.0f));
}

/* Cabinets along the wall behind, the upper half open shelves with books. */
static void build_cabinets(const room *r)
{
    shape wood = {0}, books = {0}, handles = {0};
    rng g = rng_make(26, 0);
    for (int i = 0; i < 5; i++) {
        float x = -2.75f + 1.1f * (float)i, back = -half_z + 0.02f, front = back + 0.42f;
        box(&wood, x - 0.54f, x + 0.54f, 0.0f, 0.80f, back, front, 0.004f);
        for (int door = -1; door <= 1; door += 2)
            tube(&handles, v3(x + 0.06f * (float)door, 0.45f, front + 0.02f),
                 v3(x + 0.06f * (float)door, 0.62f, front + 0.02f), 0.008f);
        for (int side = -1; side <= 1; side += 2)
            box(&wood, x + 0.525f * (float)side - 0.015f, x + 0.525f * (float)side + 0.015f, 0.80f, 2.0f, back,
                back + 0.32f, 0.0f);
        for (int shelf = 0; shelf < 4; shelf++) {
            float y = 0.82f + 0.39f * (float)shelf, at_x = x - 0.49f;
            box(&wood, x - 0.54f, x + 0.54f, y, y + 0.02f, back, back + 0.32f, 0.0f);
            while (shelf < 3 && at_x < x + 0.45f) {
                float width = rng_range(&g, 0.018f, 0.055f), height = rng_range(&g, 0.20f, 0.33f);
                if (rng_float(&g) < 0.8f)
                    box(&books, at_x, at_x + width - 0.002f, y + 0.021f, y + 0.021f + height, back + 0.04f,
                        back + rng_range(&g, 0.20f, 0.30f), 0.0f);
                at_x += width;
            }
        }
    }
    const xform put = xform_place(at(r, 0, 0, 0), 0.0f, 1.0f);
    place(r->s, shape_to_mesh(r->s, &wood, r->wood, 0.0f), put);
    place(r->s, shape_to_mesh(r->s, &books, r->accent, 0.0f), put);
    place(r->s, shape_to_mesh(r->s, &handles, r->metal, 40.0f), put);
}

static void build_plants(const room *r)
{
    static const float places[4][3] = {
        {-5.3f, -3.4f, 1.0f}, {5.3f, -3.4f, 1.1f}, {1.9f, 3.55f, 0.9f}, {4.4f, 2.6f, 1.0f}};
    const tree_style style = {.levels = 3,
                              .children = 5,
                              .sprigs = 4,
                              .length = 0.55f,
                              .radius = 0.02f,
                              .shrink = 0.65f,
                              .spread = 0.7f,
                              .rise = 0.5f,
                              .sprig_scale = 1.5f};
    profile p = {0};
    shape pot = {0};
    profile_to(&p, 0.0f, 0.0f);
    profile_to(&p, 0.16f, 0.0f);
    profile_to(&p, 0.21f, 0.38f);
    profile_to(&p, 0.19f, 0.38f);
    profile_to(&p, 0.18f, 0.33f);
    profile_to(&p, 0.0f, 0.34f);
    shape_lathe(&pot, &p, 40);
    uint32_t pot_mesh = shape_to_mesh(r->s, &pot, r->clay, 40.0f);
    sprig kind = sprig_add(r->s, 80, 12, 0.17f, 0.10f, 3, r->wood, r->green);
    for (int i = 0; i < 4; i++) {
        xform put = xform_place(at(r, places[i][0], 0.0f, places[i][1]), (float)i, places[i][2]);
        place(r->s, pot_mesh, put);
        tree_add(r->s, 90 + (uint64_t)i, style, xform_mul(put, xform_place(v3(0.0f, 0.33f, 0.0f), 0.0f, 1.0f)), r->wood,
                 &kind, 1);
    }
}

/* A screen on a stand, a side table, a waste bin. */
static void build_rest(const room *r)
{
    shape dark = {0}, wood = {0};
    box(&dark, 5.70f, 5.76f, 0.85f, 1.85f, -0.9f, 0.9f, 0.01f);
    tube(&dark, v3(5.73f, 0.03f, -0.5f), v3(5.73f, 0.85f, -0.5f), 0.03f);
    tube(&dark, v3(5.73f, 0.03f, 0.5f), v3(5.73f, 0.85f, 0.5f), 0.03f);
    box(&dark, 5.45f, 5.95f, 0.0f, 0.03f, -0.7f, 0.7f, 0.0f);
    box(&wood, -1.2f, 1.2f, 0.66f, 0.70f, 3.3f, 3.85f, 0.005f);
    for (int i = 0; i < 4; i++)
        tube(&wood, v3(i % 2 ? 1.1f : -1.1f, 0.0f, i / 2 ? 3.78f : 3.38f),
             v3(i % 2 ? 1.1f : -1.1f, 0.66f, i / 2 ? 3.78f : 3.38f), 0.025f);
    const xform put = xform_place(at(r, 0, 0, 0), 0.0f, 1.0f);
    place(r->s, shape_to_mesh(r->s, &dark, r->dark, 40.0f), put);
    place(r->s, shape_to_mesh(r->s, &wood, r->wood, 40.0f), put);
}

static void build_room(scene *s, uint32_t lights, bool floating, bool diffuse)
{
    room r = {.s = s, .lift = floating ? 0.3f : 0.0f};
    uint32_t wall = material_add(s, MATERIAL_DIFFUSE, v3(0.72f, 0.70f, 0.66f), 0.0f);
    uint32_t carpet = material_add(s, MATERIAL_DIFFUSE, v3(0.30f, 0.34f, 0.40f), 0.0f);
    r.white = material_add(s, MATERIAL_DIFFUSE, v3(0.82f, 0.82f, 0.80f), 0.0f);
    r.wood = material_add(s, MATERIAL_DIFFUSE, v3(0.48f, 0.30f, 0.17f), 0.0f);
    r.dark = material_add(s, MATERIAL_DIFFUSE, v3(0.12f, 0.12f, 0.13f), 0.0f);
    r.cloth = material_add(s, MATERIAL_DIFFUSE, v3(0.20f, 0.26f, 0.45f), 0.0f);
    r.metal = material_add(s, MATERIAL_DIFFUSE, v3(0.45f, 0.46f, 0.48f), 0.0f);
    r.paper = material_add(s, MATERIAL_DIFFUSE, v3(0.85f, 0.84f, 0.80f), 0.0f);
    r.clay = material_add(s, MATERIAL_DIFFUSE, v3(0.58f, 0.28f, 0.17f), 0.0f);
    r.green = material_add(s, MATERIAL_DIFFUSE, v3(0.14f, 0.32f, 0.08f), 0.0f);
    r.accent = material_add(s, MATERIAL_DIFFUSE, v3(0.50f, 0.20f, 0.16f), 0.0f);
    build_walls(&r, wall, carpet);
    build_lights(&r, lights, diffuse);
    build_table(&r);
    build_chairs(&r);
    build_table_ware(&r);
    build_cabinets(&r);
    build_plants(&r);
    build_rest(&r);
    camera_add(s, "door", v3(-5.4f, 2.3f, 3.5f), v3(0.3f, 0.3f, -0.6f), 50.0f);
    camera_add(s, "table", v3(2.2f, 1.5f, 2.6f), v3(0.0f, 0.55f, -0.6f), 50.0f);
}

bool build_conference(const char *name, scene **out)
{
    static const char prefix[] = "conference-lights";
    if (strncmp(name, prefix, sizeof prefix - 1) != 0)
        return false;
    const char *rest = name + sizeof prefix - 1;
    unsigned long lights = 0;
    if (rest[0] == '-' && rest[1] >= '1' && rest[1] <= '9') {
        char *end;
        lights = strtoul(rest + 1, &end, 10);
        rest = end;
        if (lights > LIGHTS_MAX)
            return false;
    }
    bool diffuse = strcmp(rest, "-diffuse") == 0, floating = diffuse || strcmp(rest, "-floating") == 0;
    if (*rest && !floating)
        return false;
    *out = scene_new(name);
    build_room(*out, lights ? (uint32_t)lights : diffuse ? 192 : FIXTURES, floating, diffuse);
    return true;
}
