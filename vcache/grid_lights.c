/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Cells of the lights: the Voronoi diagram of their directions over the whole sphere (Sect. 3, Fig. 2).
 *
 * The paper draws it into a map and takes what touches there for neighbours. Samples of a sun are a thousand times
 * nearer to each other than those of the sky, so that no one resolution serves both. Here neighbours are exact: cells
 * touch where the convex hull of the directions has an edge (Brown 1979). The octahedral map only says where to begin:
 * from there one goes from neighbour to neighbour to the nearest light, which needs no resolution either.
 */
#include "grid_internal.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

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

/* ------------------------------------------------------------------------------------------------------- the hull */

typedef struct face {
    double normal[3], offset; /* outside: normal . p > offset */
    uint16_t corner[3];       /* counter-clockwise from outside */
} face;

typedef struct hull {
    const vcache_grid_lights *lights;
    double (*point)[3]; /* by light */
    face *faces;
    uint32_t count;
    uint64_t *edges; /* [lights][words]: bit b of row a where a face that goes has the edge from a to b */
    uint16_t *open;  /* those left open, two lights each */
} hull;

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void add_face(hull *h, uint32_t a, uint32_t b, uint32_t c)
{
    const double *p = h->point[a], *q = h->point[b], *r = h->point[c];
    double u[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]}, v[3] = {r[0] - p[0], r[1] - p[1], r[2] - p[2]};
    face f = {.normal = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]},
              .corner = {(uint16_t)a, (uint16_t)b, (uint16_t)c}};
    f.offset = dot(f.normal, p);
    h->faces[h->count++] = f;
}

static bool sees(const double p[3], const double from[3], const face *f)
{
    /* differences first: lights of a sun lie close together, and far from the centre */
    const double d[3] = {p[0] - from[0], p[1] - from[1], p[2] - from[2]};
    return dot(f->normal, d) > 0.0;
}

static uint64_t *edge_word(const hull *h, uint32_t a, uint32_t b)
{
    return h->edges + (size_t)a * h->lights->words + b / 64;
}

/* Faces that see the point give way to those from their rim to it. */
static void add_point(hull *h, uint32_t light)
{
    const double *p = h->point[light];
    uint32_t visible = 0, open = 0;
    for (uint32_t i = 0; i < h->count; i++)
        if (sees(p, h->point[h->faces[i].corner[0]], &h->faces[i])) {
            face f = h->faces[i];
            h->faces[i] = h->faces[visible];
            h->faces[visible++] = f;
        }
    for (uint32_t i = 0; i < visible; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t a = h->faces[i].corner[k], b = h->faces[i].corner[(k + 1) % 3];
            *edge_word(h, a, b) |= (uint64_t)1 << b % 64;
        }
    for (uint32_t i = 0; i < visible; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t a = h->faces[i].corner[k], b = h->faces[i].corner[(k + 1) % 3];
            if (*edge_word(h, b, a) >> a % 64 & 1u)
                continue;
            h->open[2 * open] = (uint16_t)a;
            h->open[2 * open++ + 1] = (uint16_t)b;
        }
    for (uint32_t i = 0; i < visible; i++)
        for (int k = 0; k < 3; k++) {
            uint32_t a = h->faces[i].corner[k], b = h->faces[i].corner[(k + 1) % 3];
            *edge_word(h, a, b) &= ~((uint64_t)1 << b % 64);
        }
    for (uint32_t i = visible; i > 0; i--)
        h->faces[i - 1] = h->faces[--h->count];
    for (uint32_t i = 0; i < open; i++)
        add_face(h, h->open[2 * i], h->open[2 * i + 1], light);
}

/* Four lights whose tetrahedron is not flat, to the front of `order`. */
static void begin_hull(hull *h, uint16_t *order, uint32_t count)
{
    const double *o = h->point[order[0]];
    double best = -1.0, u[3] = {0}, n[3] = {0};
    for (int step = 1; step < 4; step++, best = -1.0) {
        uint32_t chosen = (uint32_t)step;
        for (uint32_t i = (uint32_t)step; i < count; i++) {
            const double *p = h->point[order[i]];
            double d[3] = {p[0] - o[0], p[1] - o[1], p[2] - o[2]}, size;
            double c[3] = {u[1] * d[2] - u[2] * d[1], u[2] * d[0] - u[0] * d[2], u[0] * d[1] - u[1] * d[0]};
            size = step == 1 ? dot(d, d) : step == 2 ? dot(c, c) : fabs(dot(n, d));
            if (size > best)
                best = size, chosen = i;
        }
        uint16_t k = order[chosen];
        order[chosen] = order[step];
        order[step] = k;
        const double *p = h->point[k];
        double d[3] = {p[0] - o[0], p[1] - o[1], p[2] - o[2]};
        if (step == 1)
            memcpy(u, d, sizeof u);
        double c[3] = {u[1] * d[2] - u[2] * d[1], u[2] * d[0] - u[0] * d[2], u[0] * d[1] - u[1] * d[0]};
        if (step == 2)
            memcpy(n, c, sizeof n);
        if (step == 3 && dot(n, d) > 0.0) { /* the fourth must lie below the first three */
            k = order[1];
            order[1] = order[2];
            order[2] = k;
        }
    }
    uint32_t a = order[0], b = order[1], c = order[2], d = order[3];
    add_face(h, a, b, c);
    add_face(h, a, d, b);
    add_face(h, b, d, c);
    add_face(h, c, d, a);
}

/* Points on a common circle have no one hull: each is moved by some 1e-9, always the same way. */
static void set_points(hull *h)
{
    uint64_t state = 1;
    for (uint32_t i = 0; i < h->lights->count; i++) {
        double *p = h->point[i];
        for (int k = 0; k < 3; k++) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            p[k] = (double)h->lights->direction[3 * (size_t)i + (size_t)k] + 1e-9 * ((double)(state >> 40) * 0x1p-24);
        }
        double length = sqrt(dot(p, p));
        p[0] /= length, p[1] /= length, p[2] /= length;
    }
}

/* In any order but a mixed one new points see few faces. */
static void mix(uint16_t *order, uint32_t count)
{
    uint64_t state = 2;
    for (uint32_t i = count; i > 1; i--) {
        state = state * 6364136223846793005u + 1442695040888963407u;
        uint32_t k = (uint32_t)((state >> 32) * i >> 32);
        uint16_t last = order[i - 1];
        order[i - 1] = order[k];
        order[k] = last;
    }
}

static void join_by_hull(vcache_grid_lights *l, hull *h, uint16_t *order, uint32_t count)
{
    for (uint32_t i = 0; i < count && count < 4; i++)
        for (uint32_t k = 0; k < i; k++)
            join(l, order[i], order[k]);
    if (count < 4)
        return;
    mix(order, count);
    begin_hull(h, order, count);
    for (uint32_t i = 4; i < count; i++)
        add_point(h, order[i]);
    for (uint32_t i = 0; i < h->count; i++)
        for (int k = 0; k < 3; k++)
            join(l, h->faces[i].corner[k], h->faces[i].corner[(k + 1) % 3]);
}

/* ------------------------------------------------------------------------------------------------------ the lights */

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
    uint16_t *one, *distinct;
    hull hull;
    size_t bytes;
} scratch;

static size_t lay_out_scratch(scratch *s, const vcache_grid_lights *l, char *block)
{
    size_t at = 0, n = l->count;
    s->one = grid_carve(block, &at, n, sizeof *s->one);
    s->distinct = grid_carve(block, &at, n, sizeof *s->distinct);
    s->hull = (hull){.lights = l};
    s->hull.point = grid_carve(block, &at, n, sizeof *s->hull.point);
    s->hull.faces = grid_carve(block, &at, 4 * n + 4, sizeof *s->hull.faces);
    s->hull.open = grid_carve(block, &at, 12 * n + 12, sizeof *s->hull.open);
    s->hull.edges = grid_carve(block, &at, n * l->words, sizeof *s->hull.edges);
    return at;
}

static void build(vcache_grid_lights *l, scratch *s)
{
    uint32_t distinct = merge(l, s->one, s->distinct);
    set_points(&s->hull);
    join_by_hull(l, &s->hull, s->distinct, distinct);
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
    s.bytes = lay_out_scratch(&s, &made, NULL);
    char *block = a.allocate(a.context, made.bytes), *more = block ? a.allocate(a.context, s.bytes) : NULL;
    vcache_status status = VCACHE_OK;
    if (!more) {
        status = vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for the cells of %u lights", count);
    } else {
        vcache_grid_lights *l = (vcache_grid_lights *)(void *)block;
        lay_out(&made, block);
        *l = made;
        lay_out_scratch(&s, l, more);
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
