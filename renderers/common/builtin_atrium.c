/* SPDX-License-Identifier: Apache-2.0 */
/* Generated scene "atrium": a courtyard with arcades on two storeys, seven by five bays. The walls, columns, floors,
 * ceilings, stair and light; builtin_garden.c puts the furniture in. Everything is laid out around the column line: a
 * bay's own frame has x along the wall, z outwards to the back wall and its origin below the arch's crown. */
#include "builtin.h"

#include <stddef.h>

#define BAY 3.0f
#define HALF_X (3.5f * BAY) /* column line */
#define HALF_Z (2.5f * BAY)
#define DEPTH 3.2f      /* column line to back wall */
#define WALL 0.5f       /* thickness of the outer wall */
#define COURT (-0.16f)  /* one step below the arcade's floor */
#define GALLERY 4.6f    /* floor of the upper storey */
#define SLAB 0.3f       /* its thickness */
#define ROOF 8.3f       /* underside of the roof */
#define LOW_COLUMN 2.7f /* heights of columns with base and capital */
#define HIGH_COLUMN 2.1f
#define OPENING 1.19f /* radius of the arches */
#define BORDER 0.42f  /* half width of the polished border under the columns */
#define STEPS 28
#define TREAD 0.29f
#define STAIR_HALF_WIDTH 1.35f

enum { BAYS = 24, BALUSTERS = 9 };

typedef struct atrium {
    scene *s;
    xform bays[BAYS]; /* on the ground floor */
    uint32_t stair_bay;
    uint32_t limestone, marble, plaster, dado, beam, coffer, polished, wood, bronze, grout, slabs[4], tiles[2], lamp;
} atrium;

static void define_materials(atrium *a)
{
    scene *s = a->s;
    a->limestone = material_add(s, MATERIAL_DIFFUSE, v3(0.78f, 0.71f, 0.60f), 0.0f);
    a->marble = material_add(s, MATERIAL_GLOSSY, v3(0.74f, 0.70f, 0.63f), 0.3f);
    a->plaster = material_add(s, MATERIAL_DIFFUSE, v3(0.80f, 0.56f, 0.36f), 0.0f);
    a->dado = material_add(s, MATERIAL_DIFFUSE, v3(0.24f, 0.30f, 0.31f), 0.0f);
    a->beam = material_add(s, MATERIAL_DIFFUSE, v3(0.46f, 0.30f, 0.18f), 0.0f);
    a->coffer = material_add(s, MATERIAL_DIFFUSE, v3(0.80f, 0.75f, 0.66f), 0.0f);
    a->polished = material_add(s, MATERIAL_GLOSSY, v3(0.055f, 0.07f, 0.075f), 0.12f);
    a->wood = material_add(s, MATERIAL_DIFFUSE, v3(0.13f, 0.24f, 0.26f), 0.0f);
    a->bronze = material_add(s, MATERIAL_CONDUCTOR, v3(0.62f, 0.42f, 0.22f), 0.35f);
    a->grout = material_add(s, MATERIAL_DIFFUSE, v3(0.23f, 0.20f, 0.17f), 0.0f);
    static const rgb slab_colors[4] = {
        {0.60f, 0.53f, 0.43f}, {0.55f, 0.49f, 0.41f}, {0.64f, 0.56f, 0.45f}, {0.52f, 0.45f, 0.37f}};
    for (int i = 0; i < 4; ++i)
        a->slabs[i] = material_add(s, MATERIAL_DIFFUSE, slab_colors[i], 0.0f);
    a->tiles[0] = material_add(s, MATERIAL_GLOSSY, v3(0.74f, 0.68f, 0.58f), 0.4f);
    a->tiles[1] = material_add(s, MATERIAL_GLOSSY, v3(0.45f, 0.22f, 0.14f), 0.4f);
    a->lamp = material_add(s, MATERIAL_DIFFUSE, v3(0.8f, 0.8f, 0.8f), 0.0f);
    s->materials[a->lamp].emission = v3(150.0f, 88.0f, 38.0f);
}

static void place_bays(atrium *a)
{
    const vec3 up = v3(0.0f, 1.0f, 0.0f);
    for (int side = 0, bay = 0; side < 4; ++side) {
        /* outward normals: -z, +x, +z, -x */
        vec3 out = v3(side == 1 ? 1.0f : side == 3 ? -1.0f : 0.0f, 0.0f, side == 0 ? -1.0f : side == 2 ? 1.0f : 0.0f);
        vec3 along = v3_cross(up, out);
        int count = side & 1 ? 5 : 7;
        for (int i = 0; i < count; ++i, ++bay) {
            vec3 middle = v3_scale(out, side & 1 ? HALF_X : HALF_Z);
            a->bays[bay] =
                xform_frame(v3_mad(middle, BAY * ((float)i - 0.5f * (float)(count - 1)), along), along, up, out);
            if (side == 1 && i == 2)
                a->stair_bay = (uint32_t)bay;
        }
    }
}

static xform lift(float x, float y, float z)
{
    return xform_place(v3(x, y, z), 0.0f, 1.0f);
}

/* An instance in each bay, at `at` of the bay's frame. */
static void place_in_bays(atrium *a, uint32_t mesh_index, xform at)
{
    for (uint32_t i = 0; i < BAYS; ++i)
        place(a->s, mesh_index, xform_mul(a->bays[i], at));
}

static void add_box(scene *s, uint32_t surface, vec3 lo, vec3 hi, float bevel)
{
    shape b = {0};
    shape_box(&b, lo, hi, bevel);
    place_shape(s, &b, surface, 0.0f);
}

/* Four boxes around the court between two distances from the column line. */
static void add_ring(atrium *a, uint32_t surface, float inner, float outer, float bottom, float top, float bevel)
{
    const float x0 = HALF_X + inner, x1 = HALF_X + outer, z0 = HALF_Z + inner, z1 = HALF_Z + outer;
    shape r = {0};
    shape_box(&r, v3(-x1, bottom, -z1), v3(x1, top, -z0), bevel);
    shape_box(&r, v3(-x1, bottom, z0), v3(x1, top, z1), bevel);
    shape_box(&r, v3(-x1, bottom, -z0), v3(-x0, top, z0), bevel);
    shape_box(&r, v3(x0, bottom, -z0), v3(x1, top, z0), bevel);
    place_shape(a->s, &r, surface, 0.0f);
}

/* Tuscan column with radius `r` at the shaft's foot: plinth, torus, shaft with entasis, capital. */
static uint32_t column_mesh(atrium *a, float height, float r)
{
    shape c = {0};
    profile p = {0};
    const float foot = 0.14f, top = height - 0.14f;
    shape_box(&c, v3(-1.42f * r, 0.0f, -1.42f * r), v3(1.42f * r, foot, 1.42f * r), 0.012f);
    profile_to(&p, 0.0f, foot - 0.01f);
    profile_to(&p, 1.1f * r, foot - 0.01f);
    profile_arc(&p, 1.12f * r, foot + 0.26f * r, 0.26f * r, -90.0f, 90.0f, 8);
    profile_to(&p, 1.12f * r, foot + 0.58f * r);
    profile_arc(&p, 1.22f * r, foot + 0.80f * r, 0.18f * r, 230.0f, 130.0f, 4);
    const float shaft_foot = foot + 1.0f * r, shaft_top = top - 1.05f * r;
    for (int i = 0; i <= 8; ++i) {
        float t = (float)i / 8.0f;
        profile_to(&p, r * (1.0f - 0.17f * t * t), shaft_foot + t * (shaft_top - shaft_foot));
    }
    profile_arc(&p, 0.87f * r, shaft_top + 0.1f * r, 0.09f * r, -80.0f, 80.0f, 5);
    profile_to(&p, 0.83f * r, shaft_top + 0.22f * r);
    profile_to(&p, 0.83f * r, shaft_top + 0.5f * r);
    profile_to(&p, 0.93f * r, shaft_top + 0.52f * r);
    profile_arc(&p, 0.93f * r, shaft_top + 1.0f * r, 0.42f * r, -75.0f, 0.0f, 6);
    profile_to(&p, 1.35f * r, top + 0.01f);
    profile_to(&p, 0.0f, top + 0.01f);
    shape_lathe(&c, &p, 20);
    shape_box(&c, v3(-1.45f * r, top, -1.45f * r), v3(1.45f * r, height, 1.45f * r), 0.01f);
    return shape_to_mesh(a->s, &c, a->limestone, 35.0f);
}

static void add_columns(atrium *a)
{
    const uint32_t low = column_mesh(a, LOW_COLUMN, 0.2f), high = column_mesh(a, HIGH_COLUMN, 0.165f);
    const xform corner[2] = {lift(-0.5f * BAY, 0.0f, 0.0f), lift(-0.5f * BAY, GALLERY, 0.0f)};
    /* walking round, each bay owns the column at its beginning: the sides close up at the corners */
    place_in_bays(a, low, corner[0]);
    place_in_bays(a, high, corner[1]);
}

static void add_arches(atrium *a)
{
    const float tops[2] = {GALLERY - SLAB, ROOF}, springs[2] = {LOW_COLUMN, GALLERY + HIGH_COLUMN};
    for (int storey = 0; storey < 2; ++storey) {
        shape wall = {0}, molding = {0}, corners = {0};
        shape_arch(&wall, OPENING, 0.5f * BAY, tops[storey] - springs[storey], 0.22f, 28);
        place_in_bays(a, shape_to_mesh(a->s, &wall, a->limestone, 20.0f), lift(0.0f, springs[storey], 0.0f));
        shape_half_ring(&molding, OPENING - 0.012f, OPENING + 0.13f, 0.25f, 28);
        shape_half_ring(&molding, OPENING + 0.13f, OPENING + 0.19f, 0.275f, 28);
        shape_box(&molding, v3(-0.1f, OPENING - 0.05f, -0.3f), v3(0.1f, OPENING + 0.26f, 0.3f), 0.015f);
        place_in_bays(a, shape_to_mesh(a->s, &molding, a->marble, 20.0f), lift(0.0f, springs[storey], 0.0f));
        for (int k = 0; k < 4; ++k) {
            float x = k & 1 ? HALF_X : -HALF_X, z = k & 2 ? HALF_Z : -HALF_Z;
            shape_box(&corners, v3(x - 0.225f, springs[storey], z - 0.225f), v3(x + 0.225f, tops[storey], z + 0.225f),
                      0.0f);
        }
        place_shape(a->s, &corners, a->limestone, 0.0f);
    }
}

static uint32_t baluster_mesh(atrium *a)
{
    shape b = {0};
    profile p = {0};
    shape_box(&b, v3(-0.062f, 0.0f, -0.062f), v3(0.062f, 0.06f, 0.062f), 0.0f);
    profile_to(&p, 0.0f, 0.055f);
    profile_to(&p, 0.05f, 0.055f);
    profile_arc(&p, 0.045f, 0.08f, 0.018f, -60.0f, 70.0f, 3);
    profile_to(&p, 0.033f, 0.115f);
    profile_arc(&p, 0.022f, 0.235f, 0.052f, -55.0f, 50.0f, 6);
    profile_to(&p, 0.033f, 0.36f);
    profile_to(&p, 0.027f, 0.46f);
    profile_to(&p, 0.03f, 0.52f);
    profile_arc(&p, 0.035f, 0.545f, 0.016f, -70.0f, 70.0f, 3);
    profile_to(&p, 0.034f, 0.575f);
    profile_to(&p, 0.052f, 0.615f);
    profile_to(&p, 0.0f, 0.615f);
    shape_lathe(&b, &p, 10);
    shape_box(&b, v3(-0.058f, 0.61f, -0.058f), v3(0.058f, 0.66f, 0.058f), 0.0f);
    return shape_to_mesh(a->s, &b, a->marble, 45.0f);
}

static void add_balustrade(atrium *a, uint32_t baluster)
{
    shape rails = {0};
    shape_box(&rails, v3(-1.3f, 0.0f, -0.1f), v3(1.3f, 0.12f, 0.1f), 0.01f);
    shape_box(&rails, v3(-1.36f, 0.78f, -0.12f), v3(1.36f, 0.9f, 0.12f), 0.02f);
    const uint32_t bars = shape_to_mesh(a->s, &rails, a->limestone, 0.0f);
    for (uint32_t i = 0; i < BAYS; ++i) {
        if (i == a->stair_bay)
            continue;
        place(a->s, bars, xform_mul(a->bays[i], lift(0.0f, GALLERY, 0.0f)));
        for (int k = 0; k < BALUSTERS; ++k) {
            float x = ((float)k - 0.5f * (BALUSTERS - 1)) * 0.27f;
            place(a->s, baluster, xform_mul(a->bays[i], lift(x, GALLERY + 0.12f, 0.0f)));
        }
    }
}

/* Straight flight up to the middle of the far side, solid below. */
static void add_stair(atrium *a, uint32_t baluster)
{
    const float rise = (GALLERY - COURT) / STEPS, end = HALF_X - 0.25f, start = end - STEPS * TREAD,
                w = STAIR_HALF_WIDTH;
    const float slope = rise / TREAD, rail = w - 0.14f;
    shape body = {0}, treads = {0}, rails = {0}, newels = {0};
    for (int i = 0; i < STEPS; ++i) {
        float x = start + (float)i * TREAD, top = COURT + (float)(i + 1) * rise;
        shape_box(&body, v3(x, COURT - 0.1f, -w), v3(x + TREAD, top - 0.045f, w), 0.0f);
        shape_box(&treads, v3(x - 0.035f, top - 0.05f, -w - 0.03f), v3(x + TREAD + 0.005f, top, w + 0.03f), 0.01f);
        for (int side = -1; side <= 1; side += 2)
            place(a->s, baluster, lift(x + 0.5f * TREAD, top, (float)side * rail));
    }
    place_shape(a->s, &body, a->limestone, 0.0f);
    place_shape(a->s, &treads, a->marble, 0.0f);
    shape bar = {0};
    shape_box(&bar, v3(-0.1f, 0.0f, -0.11f), v3(STEPS * TREAD - 0.05f, 0.13f, 0.11f), 0.02f);
    for (int side = -1; side <= 1; side += 2) {
        float z = (float)side * rail, foot = start - 0.08f;
        /* sheared, so that posts stay upright and the bar follows the steps */
        xform along = xform_frame(v3(start, COURT + 0.5f * rise + 0.655f, z), v3(1.0f, slope, 0.0f),
                                  v3(0.0f, 1.0f, 0.0f), v3(0.0f, 0.0f, 1.0f));
        shape_append(&rails, &bar, along);
        shape_box(&newels, v3(foot - 0.34f, COURT, z - 0.17f), v3(foot, COURT + 1.02f, z + 0.17f), 0.015f);
        shape_box(&newels, v3(foot - 0.38f, COURT + 1.02f, z - 0.21f), v3(foot + 0.04f, COURT + 1.12f, z + 0.21f),
                  0.02f);
        shape_sphere(&newels, v3(foot - 0.17f, COURT + 1.28f, z), 0.175f, 32);
    }
    shape_free(&bar);
    place_shape(a->s, &rails, a->marble, 0.0f);
    place_shape(a->s, &newels, a->marble, 30.0f);
}

/* Slabs with bevelled rims and slightly unequal heights on a bed of grout, in `tints` colours. */
static void add_slabs(atrium *a, const uint32_t *materials, uint32_t tints, vec3 lo, vec3 hi, float size, bool checker)
{
    const int nx = (int)((hi.x - lo.x) / size + 0.5f), nz = (int)((hi.z - lo.z) / size + 0.5f);
    const float dx = (hi.x - lo.x) / (float)nx, dz = (hi.z - lo.z) / (float)nz, gap = checker ? 0.0015f : 0.005f;
    rng r = rng_make(31, (uint64_t)(nx * 64 + nz));
    shape tint[4] = {{0}, {0}, {0}, {0}};
    for (int i = 0; i < nx; ++i)
        for (int k = 0; k < nz; ++k) {
            uint32_t which = checker ? (uint32_t)(i + k) % tints : rng_u32(&r) % tints;
            float x = lo.x + (float)i * dx, z = lo.z + (float)k * dz;
            float top = hi.y - (checker ? 0.0f : rng_range(&r, 0.0f, 0.006f));
            shape_box(&tint[which], v3(x + gap, lo.y, z + gap), v3(x + dx - gap, top, z + dz - gap),
                      checker ? 0.002f : 0.006f);
        }
    for (uint32_t i = 0; i < tints; ++i)
        place_shape(a->s, &tint[i], materials[i], 0.0f);
}

static void add_floors(atrium *a)
{
    const float x = HALF_X, z = HALF_Z, b = BORDER, d = DEPTH;
    add_box(a->s, a->grout, v3(-x - d - WALL, -0.6f, -z - d - WALL), v3(x + d + WALL, COURT - 0.015f, z + d + WALL),
            0.0f);
    add_ring(a, a->grout, -b + 0.02f, d, COURT - 0.02f, -0.006f, 0.0f);
    add_slabs(a, a->slabs, 4, v3(-x + b, COURT - 0.03f, -z + b), v3(x - b, COURT, z - b), 0.8f, false);
    add_ring(a, a->polished, -b, b, COURT - 0.03f, 0.0f, 0.004f);
    add_slabs(a, a->tiles, 2, v3(-x - d, -0.03f, -z - d), v3(x + d, 0.0f, -z - b), 0.56f, true);
    add_slabs(a, a->tiles, 2, v3(-x - d, -0.03f, z + b), v3(x + d, 0.0f, z + d), 0.56f, true);
    add_slabs(a, a->tiles, 2, v3(-x - d, -0.03f, -z - b), v3(-x - b, 0.0f, z + b), 0.56f, true);
    add_slabs(a, a->tiles, 2, v3(x + b, -0.03f, -z - b), v3(x + d, 0.0f, z + b), 0.56f, true);
    /* gallery and roof with their string courses */
    add_ring(a, a->coffer, -0.24f, DEPTH, GALLERY - SLAB, GALLERY, 0.0f);
    add_ring(a, a->limestone, -0.30f, -0.18f, GALLERY - SLAB - 0.08f, GALLERY - SLAB + 0.1f, 0.015f);
    add_ring(a, a->limestone, -0.38f, 0.3f, GALLERY - 0.14f, GALLERY + 0.012f, 0.03f);
    add_ring(a, a->coffer, -0.24f, DEPTH + WALL, ROOF, ROOF + 0.3f, 0.0f);
    add_ring(a, a->limestone, -0.34f, -0.18f, ROOF - 0.1f, ROOF + 0.12f, 0.02f);
    add_ring(a, a->limestone, -0.46f, -0.1f, ROOF + 0.12f, ROOF + 0.22f, 0.02f);
    add_ring(a, a->limestone, -0.58f, 0.3f, ROOF + 0.22f, ROOF + 0.36f, 0.03f);
    add_ring(a, a->limestone, -0.2f, 0.1f, ROOF + 0.3f, ROOF + 0.85f, 0.02f);
    add_ring(a, a->limestone, -0.26f, 0.16f, ROOF + 0.85f, ROOF + 0.95f, 0.02f);
}

/* Outer walls with dado and cornice; pilasters between the bays, doors in every other one. */
static void add_back_walls(atrium *a)
{
    const float d = DEPTH;
    shape pilaster = {0}, frame = {0}, door = {0}, knob = {0};
    add_ring(a, a->plaster, d, d + WALL, COURT - 0.3f, ROOF, 0.0f);
    for (int storey = 0; storey < 2; ++storey) {
        float floor = storey ? GALLERY : 0.0f, ceiling = storey ? ROOF : GALLERY - SLAB;
        add_ring(a, a->dado, d - 0.03f, d + 0.1f, floor - 0.01f, floor + 0.85f, 0.0f);
        add_ring(a, a->limestone, d - 0.05f, d + 0.1f, floor + 0.85f, floor + 0.93f, 0.015f);
        add_ring(a, a->limestone, d - 0.1f, d + 0.1f, ceiling - 0.3f, ceiling - 0.16f, 0.02f);
    }
    shape_box(&pilaster, v3(-0.2f, 0.0f, d - 0.12f), v3(0.2f, 3.98f, d + 0.1f), 0.012f);
    shape_box(&pilaster, v3(-0.24f, 0.0f, d - 0.16f), v3(0.24f, 0.2f, d + 0.1f), 0.015f);
    shape_box(&pilaster, v3(-0.24f, 3.8f, d - 0.16f), v3(0.24f, 3.92f, d + 0.1f), 0.015f);
    place_in_bays(a, shape_to_mesh(a->s, &pilaster, a->limestone, 0.0f), lift(-0.5f * BAY, 0.01f, 0.0f));

    for (int side = -1; side <= 1; side += 2)
        shape_box(&frame, v3((float)side * 0.69f - 0.11f, 0.0f, d - 0.1f),
                  v3((float)side * 0.69f + 0.11f, 2.25f, d + 0.1f), 0.015f);
    shape_box(&frame, v3(-0.86f, 2.25f, d - 0.12f), v3(0.86f, 2.37f, d + 0.1f), 0.02f);
    shape arch = {0};
    shape_half_ring(&arch, 0.58f, 0.8f, 0.1f, 20);
    shape_append(&frame, &arch, lift(0.0f, 2.37f, d));
    shape_free(&arch);
    for (int leaf = -1; leaf <= 1; leaf += 2)
        for (int row = 0; row < 3; ++row) {
            float x0 = leaf < 0 ? -0.58f : 0.004f, y0 = 0.02f + 0.74f * (float)row;
            shape_box(&door, v3(x0, y0, d - 0.05f), v3(x0 + 0.576f, y0 + 0.735f, d + 0.1f), 0.004f);
            shape_box(&door, v3(x0 + 0.09f, y0 + 0.1f, d - 0.075f), v3(x0 + 0.486f, y0 + 0.635f, d), 0.02f);
        }
    for (int side = -1; side <= 1; side += 2)
        shape_sphere(&knob, v3((float)side * 0.06f, 1.12f, d - 0.09f), 0.03f, 16);
    const uint32_t meshes[3] = {shape_to_mesh(a->s, &frame, a->limestone, 25.0f),
                                shape_to_mesh(a->s, &door, a->wood, 0.0f),
                                shape_to_mesh(a->s, &knob, a->bronze, 40.0f)};
    for (uint32_t i = 1; i < BAYS; i += 2)
        for (int k = 0; k < 6; ++k)
            place(a->s, meshes[k % 3], xform_mul(a->bays[i], lift(0.0f, k < 3 ? 0.01f : GALLERY, 0.0f)));
}

/* Beams across the arcade with joists between them, on both storeys and over the corners, and a lamp in each field. */
static void add_ceilings(atrium *a)
{
    shape beams = {0}, bulb = {0}, hanger = {0};
    shape_box(&beams, v3(-0.16f, -0.26f, 0.2f), v3(0.16f, 0.01f, DEPTH), 0.012f);
    for (int i = 1; i < 6; ++i) {
        float x = BAY * (float)i / 6.0f;
        shape_box(&beams, v3(x - 0.055f, -0.15f, 0.2f), v3(x + 0.055f, 0.01f, DEPTH), 0.006f);
    }
    for (int i = 1; i < 3; ++i) {
        float z = DEPTH * (float)i / 3.0f + 0.05f;
        shape_box(&beams, v3(0.16f, -0.19f, z - 0.07f), v3(BAY - 0.16f, 0.01f, z + 0.07f), 0.008f);
    }
    shape_sphere(&bulb, v3(0.0f, 0.0f, 0.0f), 0.085f, 12);
    profile p = {0};
    profile_to(&p, 0.0f, 0.07f);
    profile_to(&p, 0.09f, 0.075f);
    profile_to(&p, 0.115f, 0.06f);
    profile_to(&p, 0.12f, 0.067f);
    profile_to(&p, 0.05f, 0.15f);
    profile_to(&p, 0.012f, 0.2f);
    profile_to(&p, 0.009f, 1.4f);
    profile_to(&p, 0.0f, 1.4f);
    shape_lathe(&hanger, &p, 12);
    const uint32_t beam = shape_to_mesh(a->s, &beams, a->beam, 0.0f);
    const uint32_t globe = shape_to_mesh(a->s, &bulb, a->lamp, 40.0f),
                   rod = shape_to_mesh(a->s, &hanger, a->bronze, 40.0f);
    for (int storey = 0; storey < 2; ++storey) {
        float ceiling = storey ? ROOF : GALLERY - SLAB;
        place_in_bays(a, beam, lift(-0.5f * BAY, ceiling, 0.0f));
        for (uint32_t k = 0; k < 4; ++k) {
            /* the first bay of each side begins where the corner field ends */
            static const uint32_t first[4] = {0, 7, 12, 19};
            xform corner = lift(-0.5f * BAY - DEPTH, ceiling, 0.0f);
            corner.m[0] = DEPTH / BAY;
            place(a->s, beam, xform_mul(a->bays[first[k]], corner));
        }
        for (uint32_t i = 0; i < BAYS && !storey; ++i) {
            xform at = xform_mul(a->bays[i], lift(0.0f, ceiling - 1.4f, 0.55f * DEPTH));
            place(a->s, globe, at);
            place(a->s, rod, at);
        }
    }
}

/* Clear sky: blue above, bright and warmer at the horizon, dim ground below it. */
static void add_light(scene *s)
{
    image sky = image_new(64, 32);
    message err;
    for (uint32_t y = 0; y < sky.height; ++y) {
        float up = cosf(PI_F * ((float)y + 0.5f) / (float)sky.height), t = powf(fmaxf(up, 0.0f), 0.45f);
        rgb c = up > 0.0f ? v3(2.0f - 1.65f * t, 2.3f - 1.35f * t, 2.8f - 0.6f * t) : v3(0.35f, 0.31f, 0.27f);
        for (uint32_t x = 0; x < sky.width; ++x)
            sky.pixels[y * sky.width + x] = c;
    }
    if (!environment_from_image(&sky, &s->environment, &err))
        s->environment = environment_uniform(v3(0.6f, 0.8f, 1.2f));
    image_free(&sky);
    scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL,
                               .direction = v3_normalize(v3(0.66f, -1.50f, -0.78f)),
                               .intensity = v3(27.0f, 22.5f, 16.5f)});
}

void build_atrium(scene *s)
{
    atrium a = {.s = s};
    define_materials(&a);
    place_bays(&a);
    add_floors(&a);
    add_columns(&a);
    add_arches(&a);
    const uint32_t baluster = baluster_mesh(&a);
    add_balustrade(&a, baluster);
    add_stair(&a, baluster);
    add_back_walls(&a);
    add_ceilings(&a);
    build_atrium_garden(s, COURT);
    add_light(s);
    camera_add(s, "arcade", v3(-9.7f, 1.65f, -10.3f), v3(-2.0f, 1.9f, -1.4f), 60.0f);
    camera_add(s, "above", v3(-9.3f, 8.3f, 6.3f), v3(0.0f, 0.6f, -1.6f), 60.0f);
}
