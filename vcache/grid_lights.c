/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Cells of the lights: the Voronoi diagram of their directions over the whole sphere (Sect. 3, Fig. 2).
 *
 * The paper draws it into a map of one resolution and takes what touches there for neighbours. Samples of a sun are a
 * thousand times nearer to each other than those of the sky, and no one resolution serves both: here the octahedral map
 * is a quadtree. A square keeps the lights that may be nearest somewhere in it, and is divided until it is small beside
 * the distance of its two nearest lights; there these two touch. So every border of cells that is longer than a few
 * hundredths of the distances around it is found, and none that is not there (the light that is second nearest anywhere
 * is a neighbour of the nearest).
 */
#include "grid_internal.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

enum { DEPTH_MAX = 26, TOP = 8 }; /* TOP: squares a side to begin with; edges of the octahedron's faces are on theirs */

/* Lights nearer than this (radians) are one. */
#define COINCIDENT 1e-5

static void octahedral_direction(double s, double t, double d[3])
{
    double x = 2.0 * s - 1.0, y = 2.0 * t - 1.0, z = 1.0 - fabs(x) - fabs(y);
    if (z < 0.0) {
        double fold_x = copysign(1.0 - fabs(y), x), fold_y = copysign(1.0 - fabs(x), y);
        x = fold_x;
        y = fold_y;
    }
    double length = sqrt(x * x + y * y + z * z);
    d[0] = x / length, d[1] = y / length, d[2] = z / length;
}

static double distance_of(const double p[3], const float q[3])
{
    double x = p[0] - (double)q[0], y = p[1] - (double)q[1], z = p[2] - (double)q[2];
    return sqrt(x * x + y * y + z * z);
}

static double apart(const float p[3], const float q[3])
{
    const double d[3] = {(double)p[0], (double)p[1], (double)p[2]};
    return distance_of(d, q);
}

static void join(vcache_grid_lights *l, uint32_t a, uint32_t b)
{
    l->neighbours[(size_t)a * l->words + b / 64] |= (uint64_t)1 << b % 64;
    l->neighbours[(size_t)b * l->words + a / 64] |= (uint64_t)1 << a % 64;
}

/* Depth first: `candidates` has room for those of the squares below. */
static void divide(vcache_grid_lights *l, double s, double t, double side, uint16_t *candidates, uint32_t count,
                   double *distance, int depth)
{
    double middle[3], corner[3], radius = 0.0, first = DBL_MAX, second = DBL_MAX;
    uint32_t nearest = 0, other = 0;
    octahedral_direction(s + 0.5 * side, t + 0.5 * side, middle);
    for (int i = 0; i < 4; i++) {
        octahedral_direction(s + side * (i & 1), t + side * (i >> 1), corner);
        double x = corner[0] - middle[0], y = corner[1] - middle[1], z = corner[2] - middle[2];
        double r = sqrt(x * x + y * y + z * z);
        radius = r > radius ? r : radius;
    }
    radius *= 1.01; /* sides are great circles, or bulge by less */
    for (uint32_t i = 0; i < count; i++) {
        uint32_t k = candidates[i];
        double d = distance[i] = distance_of(middle, l->direction + 3 * (size_t)k);
        if (d < first)
            second = first, other = nearest, first = d, nearest = k;
        else if (d < second)
            second = d, other = k;
    }
    uint32_t kept = 0;
    uint16_t *next = candidates + count;
    for (uint32_t i = 0; i < count; i++)
        if (distance[i] <= first + 2.0 * radius)
            next[kept++] = candidates[i];
    if (kept < 2)
        return;
    double scale = apart(l->direction + 3 * (size_t)nearest, l->direction + 3 * (size_t)other) + 0.1 * first;
    if (depth == DEPTH_MAX || radius < 0.04 * scale) {
        join(l, nearest, other);
        return;
    }
    for (int i = 0; i < 4; i++)
        divide(l, s + 0.5 * side * (i & 1), t + 0.5 * side * (i >> 1), 0.5 * side, next, kept, distance, depth + 1);
}

/* Lights that coincide share a cell: one stands for all in the diagram. `one`: [count] who. */
static uint32_t merge(const vcache_grid_lights *l, uint16_t *one, uint16_t *distinct)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < l->count; i++) {
        uint32_t k = 0;
        while (k < n && !(apart(l->direction + 3 * (size_t)i, l->direction + 3 * (size_t)distinct[k]) < COINCIDENT))
            k++;
        one[i] = k < n ? distinct[k] : (uint16_t)i;
        if (k == n)
            distinct[n++] = (uint16_t)i;
    }
    return n;
}

static void unmerge(vcache_grid_lights *l, const uint16_t *one)
{
    for (uint32_t i = 0; i < l->count; i++)
        for (uint32_t k = 0; k < i && one[i] != i; k++)
            if (one[k] == one[i])
                join(l, i, k);
    for (uint32_t i = 0; i < l->count; i++)
        for (uint32_t k = 0; k < l->count && one[i] != i; k++)
            if (k != i && l->neighbours[(size_t)one[i] * l->words + k / 64] >> k % 64 & 1u)
                join(l, i, k);
}

static uint32_t nearest_of_all(const vcache_grid_lights *l, const double d[3], const uint16_t *lights, uint32_t count)
{
    uint32_t best = lights[0];
    double least = DBL_MAX;
    for (uint32_t i = 0; i < count; i++) {
        double x = distance_of(d, l->direction + 3 * (size_t)lights[i]);
        if (x < least)
            least = x, best = lights[i];
    }
    return best;
}

/* From a light to the nearest one, from neighbour to neighbour. */
static uint32_t descend(const vcache_grid_lights *l, const double d[3], uint32_t from)
{
    double least = distance_of(d, l->direction + 3 * (size_t)from);
    for (uint32_t best = from;; from = best) {
        const uint64_t *beside = l->neighbours + (size_t)from * l->words;
        for (uint32_t w = 0; w < l->words; w++)
            for (uint64_t bits = beside[w]; bits; bits &= bits - 1) {
                uint32_t k = 64 * w + (uint32_t)count_trailing_zeros(bits);
                double x = distance_of(d, l->direction + 3 * (size_t)k);
                if (x < least)
                    least = x, best = k;
            }
        if (best == from)
            return best;
    }
}

/* Where a search for the nearest light begins. */
static void fill_map(vcache_grid_lights *l, const uint16_t *distinct, uint32_t count)
{
    for (uint32_t y = 0; y < l->side; y++)
        for (uint32_t x = 0; x < l->side; x++) {
            double d[3];
            octahedral_direction((x + 0.5) / l->side, (y + 0.5) / l->side, d);
            uint16_t *out = l->map + (size_t)y * l->side + x;
            *out = (uint16_t)(x > 0   ? descend(l, d, out[-1])
                              : y > 0 ? descend(l, d, *(out - l->side))
                                      : nearest_of_all(l, d, distinct, count));
        }
}

static void rank_by_energy(vcache_grid_lights *l, const float *energy)
{
    for (uint32_t i = 0; i < l->count; i++) { /* insertion: equal ones keep their order */
        uint32_t k = i;
        for (; energy && k > 0 && energy[l->ranked[k - 1]] < energy[i]; k--)
            l->ranked[k] = l->ranked[k - 1];
        l->ranked[k] = (uint16_t)i;
    }
}

static bool set_directions(vcache_grid_lights *l, const float *directions, char *message)
{
    for (uint32_t i = 0; i < l->count; i++) {
        const float *from = directions + 3 * (size_t)i;
        double x = (double)from[0], y = (double)from[1], z = (double)from[2], length = sqrt(x * x + y * y + z * z);
        if (!(length > 0.0 && length <= DBL_MAX)) {
            vcache_complain(message, VCACHE_ERROR_ARGUMENT, "directions[%u] is zero or not finite", i);
            return false;
        }
        float *to = l->direction + 3 * (size_t)i;
        to[0] = (float)(x / length), to[1] = (float)(y / length), to[2] = (float)(z / length);
    }
    return true;
}

/* NULL: only counts. */
static size_t lay_out(vcache_grid_lights *l, char *block)
{
    size_t at = 0;
    size_t n = l->count;
    vcache_grid_lights o = *l;
    grid_carve(block, &at, 1, sizeof o);
    o.direction = grid_carve(block, &at, 3 * n, sizeof(float));
    o.map = grid_carve(block, &at, (size_t)o.side * o.side, sizeof(uint16_t));
    o.neighbours = grid_carve(block, &at, n * o.words, sizeof(uint64_t));
    o.ranked = grid_carve(block, &at, n, sizeof(uint16_t));
    if (block)
        *l = o;
    return at;
}

typedef struct scratch {
    uint16_t *one, *distinct, *candidates;
    double *distance;
    size_t bytes;
} scratch;

static size_t lay_out_scratch(scratch *s, uint32_t count, char *block)
{
    size_t at = 0;
    size_t n = count;
    s->one = grid_carve(block, &at, n, sizeof(uint16_t));
    s->distinct = grid_carve(block, &at, n, sizeof(uint16_t));
    s->candidates = grid_carve(block, &at, n * (DEPTH_MAX + 3), sizeof(uint16_t));
    s->distance = grid_carve(block, &at, n, sizeof(double));
    return at;
}

static void build(vcache_grid_lights *l, scratch *s)
{
    uint32_t distinct = merge(l, s->one, s->distinct);
    memcpy(s->candidates, s->distinct, distinct * sizeof *s->candidates);
    for (int t = 0; t < TOP && distinct > 1; t++)
        for (int u = 0; u < TOP; u++)
            divide(l, (double)u / TOP, (double)t / TOP, 1.0 / TOP, s->candidates, distinct, s->distance, 0);
    fill_map(l, s->distinct, distinct);
    unmerge(l, s->one);
}

vcache_status vcache_grid_create_lights(const float *directions, const float *energy, uint32_t count,
                                        const vcache_allocator *allocator, vcache_grid_lights **out, char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!directions)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "directions is NULL");
    if (count < 1 || count > VCACHE_GRID_MAX_LIGHTS)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "%u lights: there must be 1 ... %d", count,
                               VCACHE_GRID_MAX_LIGHTS);
    vcache_allocator a = allocator ? *allocator : vcache_default_config().allocator;
    if (!a.allocate || !a.release)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "allocator: both functions must be set");
    vcache_grid_lights made = {.allocator = a, .count = count, .words = (count + 63) / 64, .side = 32};
    while (made.side * made.side < 16 * count)
        made.side *= 2;
    scratch s;
    made.bytes = lay_out(&made, NULL);
    s.bytes = lay_out_scratch(&s, count, NULL);
    char *block = a.allocate(a.context, made.bytes), *more = block ? a.allocate(a.context, s.bytes) : NULL;
    vcache_status status = VCACHE_OK;
    if (!more) {
        status = vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for the cells of %u lights", count);
    } else {
        vcache_grid_lights *l = (vcache_grid_lights *)(void *)block;
        lay_out(&made, block);
        *l = made;
        lay_out_scratch(&s, count, more);
        if (set_directions(l, directions, message)) {
            build(l, &s);
            rank_by_energy(l, energy);
            *out = l;
        } else {
            status = VCACHE_ERROR_ARGUMENT;
        }
    }
    if (more)
        a.release(a.context, more, s.bytes);
    if (block && status != VCACHE_OK)
        a.release(a.context, block, made.bytes);
    return status;
}

void vcache_grid_destroy_lights(vcache_grid_lights **lights)
{
    if (!lights || !*lights)
        return;
    vcache_allocator a = (*lights)->allocator;
    a.release(a.context, *lights, (*lights)->bytes);
    *lights = NULL;
}

const uint64_t *vcache_grid_neighbours(const vcache_grid_lights *lights, uint32_t light)
{
    return lights->neighbours + (size_t)light * lights->words;
}

uint32_t vcache_grid_words(const vcache_grid_lights *lights)
{
    return lights->words;
}

uint32_t vcache_grid_nearest(const vcache_grid_lights *lights, const float direction[3])
{
    double x = (double)direction[0], y = (double)direction[1], z = (double)direction[2];
    double length = sqrt(x * x + y * y + z * z), s, t, d[3] = {x / length, y / length, z / length};
    if (!(length > 0.0 && length <= DBL_MAX))
        return 0;
    quantize_octahedral(direction, &s, &t);
    uint32_t side = lights->side, i = (uint32_t)(s * side), j = (uint32_t)(t * side);
    i = i < side ? i : side - 1;
    j = j < side ? j : side - 1;
    return descend(lights, d, lights->map[(size_t)j * side + i]);
}
