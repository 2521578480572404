/* SPDX-License-Identifier: Apache-2.0 */
#include "density.h"

#include "../common/scene.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

enum {
    FEW = 16,       /* smaller: noise in the sizes of cells; larger: they follow the density too slowly */
    MANY = 256,     /* below TOP: smaller cells cost more rays than they save error */
    DEPTH_MAX = 20, /* many vertices at one point */
    NONE = -1,
    TOP = 6, /* levels that one look-up stands for */
    TOP_EDGE = 1 << TOP
};

/* A cube with more than a few vertices. What has less goes by the density of the cube around it. */
typedef struct node {
    int32_t children[8];
    float density;
} node;

struct density_map {
    node *nodes;
    uint32_t count, capacity;
    vec3 low;
    float radius, scale;                     /* scale: cells of `top` per unit of length */
    float top[TOP_EDGE][TOP_EDGE][TOP_EDGE]; /* density by z, y, x; below 0: -1 - the node that goes on there */
};

static int octant(vec3 p, vec3 center)
{
    return (p.x >= center.x) | (p.y >= center.y) << 1 | (p.z >= center.z) << 2;
}

static vec3 child_center(vec3 center, float half, int k)
{
    return v3(center.x + (k & 1 ? half : -half), center.y + (k & 2 ? half : -half), center.z + (k & 4 ? half : -half));
}

/* Sorted by octant; start[k]: where octant k begins. */
static void sort(vec3 *vertices, uint32_t count, vec3 center, uint32_t start[9])
{
    uint32_t next[8];
    vec3 *sorted = xmalloc((count + 1) * sizeof *sorted);
    memset(start, 0, 9 * sizeof *start);
    for (uint32_t i = 0; i < count; i++)
        start[octant(vertices[i], center) + 1]++;
    for (int k = 0; k < 8; k++)
        start[k + 1] += start[k];
    memcpy(next, start, sizeof next);
    for (uint32_t i = 0; i < count; i++)
        sorted[next[octant(vertices[i], center)]++] = vertices[i];
    memcpy(vertices, sorted, count * sizeof *sorted);
    free(sorted);
}

static int32_t build(density_map *m, vec3 *vertices, uint32_t count, float paths, vec3 center, float radius, int depth)
{
    if (m->count == m->capacity) {
        m->capacity = m->capacity ? 2 * m->capacity : 1024;
        m->nodes = xrealloc(m->nodes, m->capacity * sizeof *m->nodes);
    }
    int32_t at = (int32_t)m->count++;
    uint32_t start[9];
    float edge = 2.0f * radius; /* a surface cuts about its square out of the cube */
    m->nodes[at].density = (float)(count > 0 ? count : 1) / (paths * edge * edge);
    sort(vertices, count, center, start);
    for (int k = 0; k < 8; k++) {
        uint32_t n = start[k + 1] - start[k];
        int32_t child = NONE;
        if (n > (depth < TOP ? FEW : MANY) && depth < DEPTH_MAX)
            child = build(m, vertices + start[k], n, paths, child_center(center, 0.5f * radius, k), 0.5f * radius,
                          depth + 1);
        m->nodes[at].children[k] = child;
    }
    return at;
}

static void fill_top(density_map *m)
{
    for (int z = 0; z < TOP_EDGE; z++)
        for (int y = 0; y < TOP_EDGE; y++)
            for (int x = 0; x < TOP_EDGE; x++) {
                int32_t at = 0, next = 0;
                for (int bit = TOP - 1; bit >= 0 && next != NONE; bit--) {
                    next = m->nodes[at].children[(x >> bit & 1) | (y >> bit & 1) << 1 | (z >> bit & 1) << 2];
                    at = next != NONE ? next : at;
                }
                bool leaf = next == NONE;
                for (int k = 0; k < 8 && !leaf && m->nodes[at].children[k] == NONE; k++)
                    leaf = k == 7;
                m->top[z][y][x] = leaf ? m->nodes[at].density : -1.0f - (float)at;
            }
}

/* Walls lie at round parts of the bounds, and noise in their last bits must not throw their vertices from one cube into
 * the next: so the outermost cube is shifted by parts that no round number meets, and as much larger. */
static const vec3 shift = {0.1180340f, 0.0901699f, 0.1458980f};
static const float enlarged = 1.1458981f;

density_map *density_map_new(const vec3 *vertices, uint32_t count, uint32_t paths, vec3 center, float radius)
{
    center = v3_mad(center, radius, shift);
    radius *= enlarged;
    density_map *m = xcalloc(1, sizeof *m);
    vec3 *copy = xmalloc((count + 1) * sizeof *copy);
    memcpy(copy, vertices, count * sizeof *copy);
    m->low = v3(center.x - radius, center.y - radius, center.z - radius);
    m->radius = radius;
    m->scale = 0.5f * TOP_EDGE / radius;
    build(m, copy, count, (float)paths, center, radius, 0);
    fill_top(m);
    free(copy);
    return m;
}

void density_map_free(density_map *m)
{
    if (m)
        free(m->nodes);
    free(m);
}

static int clamp(float x)
{
    return x > 0.0f ? x < TOP_EDGE - 1 ? (int)x : TOP_EDGE - 1 : 0;
}

typedef struct top_cell {
    int x, y, z;
} top_cell;

static inline top_cell top_at(const density_map *m, vec3 position)
{
    vec3 at = v3_scale(v3_sub(position, m->low), m->scale);
    return (top_cell){clamp(at.x), clamp(at.y), clamp(at.z)};
}

void density_prefetch(const density_map *m, vec3 position)
{
    top_cell t = top_at(m, position);
    __builtin_prefetch(&m->top[t.z][t.y][t.x]);
}

float density_at(const density_map *m, vec3 position)
{
    top_cell t = top_at(m, position);
    float density = m->top[t.z][t.y][t.x];
    if (density > 0.0f)
        return density;
    int32_t at = (int32_t)(-1.0f - density), next;
    float half = m->radius / TOP_EDGE;
    vec3 center = v3_add(m->low, v3_scale(v3((float)t.x + 0.5f, (float)t.y + 0.5f, (float)t.z + 0.5f), 2.0f * half));
    while ((next = m->nodes[at].children[octant(position, center)]) != NONE) {
        half *= 0.5f;
        center = child_center(center, half, octant(position, center));
        at = next;
    }
    return m->nodes[at].density;
}
