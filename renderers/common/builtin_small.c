/* SPDX-License-Identifier: Apache-2.0 */
/* Small generated scenes: cornell, shapes, dominoes, plant. */
#include "builtin.h"

static void box_at(scene *s, vec3 lo, vec3 hi, uint32_t surface)
{
    shape b = {0};
    shape_box(&b, lo, hi, 0.0f);
    place_shape(s, &b, surface, 0.0f);
}

/* The classic box (Goral et al. 1984, Cornell Program of Computer Graphics), brought to a room of 2 m; walls are solid.
 */
void build_cornell(scene *s)
{
    const uint32_t white = material_add(s, MATERIAL_DIFFUSE, v3(0.73f, 0.73f, 0.73f), 0.0f);
    const uint32_t red = material_add(s, MATERIAL_DIFFUSE, v3(0.65f, 0.05f, 0.05f), 0.0f);
    const uint32_t green = material_add(s, MATERIAL_DIFFUSE, v3(0.12f, 0.45f, 0.15f), 0.0f);
    const uint32_t lamp = material_add(s, MATERIAL_DIFFUSE, v3(0.78f, 0.78f, 0.78f), 0.0f);
    const float w = 0.1f;
    s->materials[lamp].emission = v3(17.0f, 12.0f, 4.0f);
    box_at(s, v3(-1.0f - w, -w, -1.0f - w), v3(1.0f + w, 0.0f, 1.0f), white);
    box_at(s, v3(-1.0f - w, 2.0f, -1.0f - w), v3(1.0f + w, 2.0f + w, 1.0f), white);
    box_at(s, v3(-1.0f - w, 0.0f, -1.0f - w), v3(1.0f + w, 2.0f, -1.0f), white);
    box_at(s, v3(-1.0f - w, 0.0f, -1.0f), v3(-1.0f, 2.0f, 1.0f), red);
    box_at(s, v3(1.0f, 0.0f, -1.0f), v3(1.0f + w, 2.0f, 1.0f), green);
    box_at(s, v3(-0.235f, 1.99f, -0.19f), v3(0.235f, 2.0f, 0.19f), lamp);

    shape cube = {0};
    shape_box(&cube, v3(-0.3f, 0.0f, -0.3f), v3(0.3f, 0.6f, 0.3f), 0.0f);
    const uint32_t block = shape_to_mesh(s, &cube, white, 0.0f);
    place(s, block, xform_place(v3(0.33f, 0.0f, 0.36f), -0.31f, 1.0f));
    xform tall = xform_place(v3(-0.33f, 0.0f, -0.27f), 0.31f, 1.0f);
    for (int row = 0; row < 3; ++row)
        tall.m[4 * row + 1] *= 2.0f;
    place(s, block, tall);
    camera_add(s, "front", v3(0.0f, 1.0f, 3.9f), v3(0.0f, 1.0f, 0.0f), 37.8f);
}

static void floor_disc(scene *s, float radius, rgb color)
{
    profile p = {0};
    shape disc = {0};
    profile_to(&p, 0.0f, -0.05f * radius);
    profile_to(&p, radius, -0.05f * radius);
    profile_to(&p, radius, 0.0f);
    profile_to(&p, 0.0f, 0.0f);
    shape_lathe(&disc, &p, 128);
    place_shape(s, &disc, material_add(s, MATERIAL_DIFFUSE, color, 0.0f), 30.0f);
}

/* Straight outline subdivided so that the surface is finely tessellated everywhere. */
static void profile_line(profile *p, float r, float y, uint32_t steps)
{
    const float r0 = p->r[p->count - 1], y0 = p->y[p->count - 1];
    for (uint32_t i = 1; i <= steps; ++i) {
        float t = (float)i / (float)steps;
        profile_to(p, i == steps ? r : r0 + t * (r - r0), i == steps ? y : y0 + t * (y - y0));
    }
}

void build_shapes(scene *s)
{
    const uint32_t white = material_add(s, MATERIAL_DIFFUSE, v3(0.75f, 0.74f, 0.72f), 0.0f);
    const uint32_t red = material_add(s, MATERIAL_DIFFUSE, v3(0.68f, 0.20f, 0.14f), 0.0f);
    const uint32_t blue = material_add(s, MATERIAL_DIFFUSE, v3(0.15f, 0.30f, 0.58f), 0.0f);
    const uint32_t yellow = material_add(s, MATERIAL_DIFFUSE, v3(0.80f, 0.58f, 0.16f), 0.0f);
    const uint32_t green = material_add(s, MATERIAL_DIFFUSE, v3(0.22f, 0.50f, 0.25f), 0.0f);
    shape sphere = {0}, cube = {0}, cylinder = {0}, cone = {0}, torus = {0};
    floor_disc(s, 8.0f, v3(0.62f, 0.60f, 0.57f));

    shape_sphere(&sphere, v3(0.0f, 1.0f, 0.0f), 1.0f, 160);
    place(s, shape_to_mesh(s, &sphere, white, 30.0f), xform_place(v3(0.0f, 0.0f, -0.4f), 0.0f, 1.0f));
    shape_box(&cube, v3(-0.65f, 0.0f, -0.65f), v3(0.65f, 1.3f, 0.65f), 0.03f);
    place(s, shape_to_mesh(s, &cube, red, 0.0f), xform_place(v3(-2.2f, 0.0f, 0.5f), 0.5f, 1.0f));

    profile p = {0};
    profile_to(&p, 0.0f, 0.0f);
    profile_line(&p, 0.6f, 0.0f, 8);
    profile_line(&p, 0.6f, 1.9f, 48);
    profile_line(&p, 0.0f, 1.9f, 8);
    shape_lathe(&cylinder, &p, 128);
    place(s, shape_to_mesh(s, &cylinder, blue, 30.0f), xform_place(v3(-1.5f, 0.0f, -2.4f), 0.0f, 1.0f));
    p.count = 0;
    profile_to(&p, 0.0f, 0.0f);
    profile_line(&p, 0.75f, 0.0f, 8);
    profile_line(&p, 0.0f, 1.8f, 48);
    shape_lathe(&cone, &p, 128);
    place(s, shape_to_mesh(s, &cone, yellow, 30.0f), xform_place(v3(2.1f, 0.0f, -1.3f), 0.0f, 1.0f));
    shape_torus(&torus, 0.62f, 0.24f, 144, 56); /* leans: its shadow is a ring */
    place(s, shape_to_mesh(s, &torus, green, 30.0f),
          xform_along(v3(1.5f, 0.68f, 1.3f), v3_normalize(v3(0.5f, 0.7f, -0.5f)), 0.0f, 1.0f));
    camera_add(s, "front", v3(0.6f, 2.6f, 7.6f), v3(0.0f, 0.75f, 0.0f), 36.0f);
    camera_add(s, "above", v3(-3.5f, 7.5f, 4.0f), v3(0.0f, 0.4f, -0.3f), 40.0f);
    camera_add(s, "square", v3(0.6f, 5.4f, 6.6f), v3(0.05f, 0.5f, 0.1f), 43.0f);
}

/* Dominoes of 24 x 48 x 7.5 mm along a spiral of equal steps. */
void build_dominoes(scene *s)
{
    static const rgb colors[5] = {{0.78f, 0.76f, 0.70f},
                                  {0.70f, 0.16f, 0.12f},
                                  {0.85f, 0.60f, 0.14f},
                                  {0.16f, 0.42f, 0.46f},
                                  {0.10f, 0.14f, 0.28f}};
    uint32_t kinds[5];
    floor_disc(s, 1.2f, v3(0.55f, 0.50f, 0.44f));
    for (int i = 0; i < 5; ++i) {
        shape domino = {0};
        shape_box(&domino, v3(-0.012f, 0.0f, -0.00375f), v3(0.012f, 0.048f, 0.00375f), 0.0008f);
        kinds[i] = shape_to_mesh(s, &domino, material_add(s, MATERIAL_GLOSSY, colors[i], 0.35f), 0.0f);
    }
    const float pitch = 0.05f / (2.0f * PI_F); /* the spiral's arms stand 5 cm apart */
    float angle = 4.5f * PI_F;
    rng r = rng_make(400, 0);
    for (uint32_t i = 0; i < 400; ++i) {
        float radius = pitch * angle, wobble = rng_range(&r, -0.05f, 0.05f);
        vec3 at = v3(radius * cosf(angle), 0.0f, -radius * sinf(angle));
        place(s, kinds[i / 16 % 5], xform_place(at, angle + atan2f(pitch, radius) + wobble, 1.0f));
        angle += 0.0225f / sqrtf(radius * radius + pitch * pitch);
    }
    camera_add(s, "low", v3(0.16f, 0.30f, 0.80f), v3(0.0f, 0.005f, 0.04f), 36.0f);
    camera_add(s, "above", v3(0.0f, 1.3f, 0.35f), v3(0.0f, 0.0f, 0.0f), 36.0f);
    camera_add(s, "square", v3(0.17f, 0.17f, 0.15f), v3(0.352f, 0.012f, 0.222f), 32.0f);
}

static void flower_pot(scene *s, uint32_t clay, uint32_t soil)
{
    profile p = {0};
    shape pot = {0}, earth = {0};
    profile_to(&p, 0.0f, 0.0f);
    profile_to(&p, 0.115f, 0.0f);
    profile_arc(&p, 0.115f, 0.008f, 0.008f, -80.0f, 0.0f, 3);
    profile_to(&p, 0.16f, 0.20f);
    profile_to(&p, 0.172f, 0.203f);
    profile_arc(&p, 0.172f, 0.253f, 0.012f, 0.0f, 180.0f, 8);
    profile_to(&p, 0.15f, 0.21f);
    profile_to(&p, 0.0f, 0.21f);
    shape_lathe(&pot, &p, 64);
    place_shape(s, &pot, clay, 40.0f);
    p.count = 0;
    profile_to(&p, 0.0f, 0.212f);
    profile_to(&p, 0.149f, 0.212f);
    profile_to(&p, 0.151f, 0.225f);
    profile_to(&p, 0.07f, 0.232f);
    profile_to(&p, 0.0f, 0.235f);
    shape_lathe(&earth, &p, 48);
    place_shape(s, &earth, soil, 40.0f);
}

void build_plant(scene *s)
{
    const uint32_t clay = material_add(s, MATERIAL_DIFFUSE, v3(0.56f, 0.25f, 0.14f), 0.0f);
    const uint32_t soil = material_add(s, MATERIAL_DIFFUSE, v3(0.07f, 0.05f, 0.035f), 0.0f);
    const uint32_t wood = material_add(s, MATERIAL_DIFFUSE, v3(0.24f, 0.17f, 0.10f), 0.0f);
    const rgb greens[3] = {{0.10f, 0.26f, 0.06f}, {0.16f, 0.34f, 0.08f}, {0.26f, 0.40f, 0.10f}};
    sprig kinds[3];
    floor_disc(s, 3.0f, v3(0.66f, 0.63f, 0.58f));
    flower_pot(s, clay, soil);
    for (uint32_t i = 0; i < 3; ++i) {
        uint32_t green = material_add(s, MATERIAL_DIFFUSE, greens[i], 0.0f);
        kinds[i] = sprig_add(s, 70 + i, 14, 0.17f, 0.085f, 4, wood, green);
    }
    const tree_style style = {.levels = 4,
                              .children = 4,
                              .sprigs = 4,
                              .length = 0.34f,
                              .radius = 0.017f,
                              .shrink = 0.68f,
                              .spread = 0.75f,
                              .rise = 0.5f,
                              .sprig_scale = 1.0f};
    tree_add(s, 7, style, xform_place(v3(0.0f, 0.225f, 0.0f), 0.0f, 1.0f), wood, kinds, 3);
    camera_add(s, "front", v3(0.5f, 1.0f, 2.7f), v3(0.0f, 0.58f, 0.0f), 32.0f);
    camera_add(s, "close", v3(-0.6f, 1.15f, 0.9f), v3(0.0f, 0.8f, 0.0f), 40.0f);
    camera_add(s, "square", v3(0.9f, 2.9f, 2.6f), v3(0.05f, 0.35f, 0.1f), 32.0f);
}
