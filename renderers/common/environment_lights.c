/* SPDX-License-Identifier: Apache-2.0 */
/* Agarwal et al. 2003: the map is divided into strata of like brightness (Sect. 4.1); each gets lights by its light and
 * its extent (Sect. 3), which are placed as far from each other and from those of brighter strata as can be (Hochbaum
 * and Shmoys 1985); each light then takes the light of all directions that are nearest to it. */
#include "environment_lights.h"

#include "scene.h"

#include <float.h>
#include <stdlib.h>

enum {
    STRATA = 6,  /* the i-th begins at i standard deviations of the luminance; 0 here is the brightest */
    BLOCK = 128, /* nodes that are passed over together where all are nearer to another light */
    LANES = 16,
    NODES_A_LIGHT = 256,
    NODES_LEAST = 1 << 15,
    NODES_MOST = 1 << 19,
    NODES_IF_BLACK = 1 << 22
};

static const double pi = 3.14159265358979323846;

/* L^a omega^b with a = 1, b = 1/4: between by light alone, where a sun takes nearly all lights, and by extent alone. */
static double importance(double energy, double extent)
{
    return energy * sqrt(sqrt(extent));
}

/* A direction of the map with its share of the light. */
typedef struct node {
    vec3 direction;  /* not rotated */
    rgb irradiance;  /* radiance times solid angle */
    float luminance; /* of the radiance */
    float extent;    /* sr */
} node;

/* How the map is divided into nodes: `split` x `split` to a pixel, or `block` x `block` pixels each; one of them is 1.
 */
typedef struct division {
    uint32_t split, block;
    uint32_t width, height; /* of the map in split pixels */
    uint32_t columns, rows; /* of nodes */
} division;

/* What is not black, stratum by stratum from the brightest, in blocks that belong to one stratum each. */
typedef struct strata {
    uint32_t blocks, first[STRATA + 1]; /* first: block of each stratum */
    const node **nodes;                 /* [blocks * BLOCK]; NULL: filled up */
    float *x, *y, *z;
    float *away;                  /* squared distance to the nearest light; -1: no node */
    uint32_t *nearest;            /* that light */
    float *low, *high, *farthest; /* of each block: range of y, greatest `away` */
    uint32_t count[STRATA];
    double weight[STRATA]; /* importance */
} strata;

/* ---------------------------------------------------------------------------------------------------------- nodes */

static division division_of(const environment *e, double least, double most)
{
    uint32_t width, height;
    environment_map_size(e, &width, &height);
    double pixels = (double)width * height;
    division d = {.split = 1, .block = 1};
    if (pixels > most)
        d.block = (uint32_t)ceil(sqrt(pixels / most));
    else if (pixels < least)
        d.split = (uint32_t)ceil(sqrt(least / pixels));
    d.width = width * d.split, d.height = height * d.split;
    d.columns = (d.width - 1) / d.block + 1, d.rows = (d.height - 1) / d.block + 1;
    return d;
}

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

/* Mean radiance between two columns and two rows of split pixels. */
static rgb radiance_of(const environment *e, uint32_t split, uint32_t x0, uint32_t x1, uint32_t y0, uint32_t y1)
{
    double sum[3] = {0.0, 0.0, 0.0}, count = (double)(x1 - x0) * (y1 - y0);
    for (uint32_t y = y0; y < y1; y++)
        for (uint32_t x = x0; x < x1; x++) {
            rgb c = environment_map_radiance(e, (float)((x + 0.5) / split), (float)((y + 0.5) / split));
            sum[0] += c.x, sum[1] += c.y, sum[2] += c.z;
        }
    return v3((float)(sum[0] / count), (float)(sum[1] / count), (float)(sum[2] / count));
}

/* All that are not black; *deviation: of the luminance over the sphere. */
static node *nodes_new(const environment *e, const division *d, uint32_t *count, double *deviation)
{
    node *nodes = xmalloc((size_t)d->columns * d->rows * sizeof *nodes);
    double sum = 0.0, squares = 0.0;
    uint32_t n = 0;
    for (uint32_t j = 0; j < d->rows; j++) {
        uint32_t y0 = j * d->block, y1 = least(y0 + d->block, d->height);
        double above = cos(pi * y0 / d->height), below = cos(pi * y1 / d->height);
        double y = 0.5 * (above + below), radius = sqrt(fmax(0.0, 1.0 - y * y));
        for (uint32_t i = 0; i < d->columns; i++) {
            uint32_t x0 = i * d->block, x1 = least(x0 + d->block, d->width);
            double extent = 2.0 * pi * (x1 - x0) / d->width * (above - below);
            double phi = pi * ((double)x0 + x1) / d->width - pi; /* 0 looks at -z */
            rgb c = radiance_of(e, d->split, x0, x1, y0, y1);
            node at = {.direction = v3((float)(radius * sin(phi)), (float)y, (float)(-radius * cos(phi))),
                       .irradiance = v3_scale(c, (float)extent),
                       .luminance = luminance(c),
                       .extent = (float)extent};
            sum += (double)at.luminance * extent;
            squares += (double)at.luminance * (double)at.luminance * extent;
            nodes[n] = at;
            n += v3_max_component(at.irradiance) > 0.0f;
        }
    }
    double mean = sum / (4.0 * pi);
    *deviation = sqrt(fmax(0.0, squares / (4.0 * pi) - mean * mean));
    *count = n;
    return nodes;
}

/* --------------------------------------------------------------------------------------------------------- strata */

static uint32_t stratum_of(const node *n, double deviation)
{
    return STRATA - 1 - (n->luminance >= (STRATA - 1) * deviation ? STRATA - 1 : (uint32_t)(n->luminance / deviation));
}

static void put(strata *s, size_t at, const node *n)
{
    uint32_t b = (uint32_t)(at / BLOCK);
    s->nodes[at] = n;
    s->x[at] = n->direction.x, s->y[at] = n->direction.y, s->z[at] = n->direction.z;
    s->away[at] = s->farthest[b] = INFINITY;
    s->low[b] = float_min(s->low[b], n->direction.y);
    s->high[b] = float_max(s->high[b], n->direction.y);
}

static strata strata_new(const node *nodes, uint32_t count, double deviation)
{
    strata s = {0};
    double energy[STRATA] = {0}, extent[STRATA] = {0};
    for (uint32_t i = 0; i < count; i++) {
        uint32_t k = stratum_of(&nodes[i], deviation);
        s.count[k]++;
        energy[k] += (double)luminance(nodes[i].irradiance);
        extent[k] += (double)nodes[i].extent;
    }
    size_t next[STRATA];
    for (uint32_t k = 0; k < STRATA; k++) {
        s.weight[k] = importance(energy[k], extent[k]);
        next[k] = (size_t)s.first[k] * BLOCK;
        s.first[k + 1] = s.first[k] + (s.count[k] + BLOCK - 1) / BLOCK;
    }
    s.blocks = s.first[STRATA];
    size_t places = (size_t)s.blocks * BLOCK;
    s.nodes = xcalloc(places, sizeof *s.nodes);
    float *floats = xcalloc(4 * places + 3 * (size_t)s.blocks, sizeof *floats);
    s.x = floats, s.y = s.x + places, s.z = s.y + places, s.away = s.z + places;
    s.low = s.away + places, s.high = s.low + s.blocks, s.farthest = s.high + s.blocks;
    s.nearest = xcalloc(places, sizeof *s.nearest);
    for (size_t i = 0; i < places; i++)
        s.away[i] = -1.0f;
    for (uint32_t b = 0; b < s.blocks; b++)
        s.low[b] = 1.0f, s.high[b] = -1.0f;
    for (uint32_t i = 0; i < count; i++)
        put(&s, next[stratum_of(&nodes[i], deviation)]++, &nodes[i]);
    return s;
}

static void strata_free(strata *s)
{
    free(s->nodes);
    free(s->x);
    free(s->nearest);
}

/* Light `index` stands at `d`. */
static void block_nearest(strata *s, uint32_t b, vec3 d, uint32_t index)
{
    size_t start = (size_t)b * BLOCK;
    const float *x = s->x + start, *y = s->y + start, *z = s->z + start;
    float *away = s->away + start, farthest[LANES] = {0.0f}, most = 0.0f;
    uint32_t *nearest = s->nearest + start;
    for (int i = 0; i < BLOCK; i += LANES)
        for (int k = 0; k < LANES; k++) {
            float dx = x[i + k] - d.x, dy = y[i + k] - d.y, dz = z[i + k] - d.z;
            float square = dx * dx + dy * dy + dz * dz, old = away[i + k];
            nearest[i + k] = square < old ? index : nearest[i + k];
            away[i + k] = float_min(square, old);
            farthest[k] = float_max(farthest[k], away[i + k]);
        }
    for (int k = 0; k < LANES; k++)
        most = float_max(most, farthest[k]);
    s->farthest[b] = most;
}

static void add_light(strata *s, vec3 d, uint32_t index)
{
    for (uint32_t b = 0; b < s->blocks; b++) {
        float apart = float_max(0.0f, float_max(s->low[b] - d.y, d.y - s->high[b]));
        if (apart * apart < s->farthest[b])
            block_nearest(s, b, d, index);
    }
}

/* The node of some blocks that is farthest from all lights, the brightest where there are none. NULL: lights
 * everywhere. */
static const node *pick(const strata *s, uint32_t first, uint32_t end)
{
    uint32_t best = first;
    for (uint32_t b = first; b < end; b++)
        best = s->farthest[b] > s->farthest[best] ? b : best;
    if (first == end || !(s->farthest[best] > 0.0f))
        return NULL;
    size_t at = (size_t)best * BLOCK;
    while (s->away[at] != s->farthest[best])
        at++;
    const node *found = s->nodes[at];
    for (; at < (size_t)end * BLOCK && s->away[at] == INFINITY; at++)
        found = s->nodes[at]->luminance > found->luminance ? s->nodes[at] : found;
    return found;
}

/* Of `left` lights those of stratum k: at least one, so that what is bright but small is not taken for a part of what
 * is around it. */
static uint32_t share_of(const strata *s, uint32_t k, uint32_t left)
{
    double rest = 0.0;
    for (uint32_t i = k; i < STRATA; i++)
        rest += s->weight[i];
    double wanted = rest > 0.0 ? floor(left * s->weight[k] / rest + 0.5) : left;
    return least(least(left, s->count[k]), wanted > 1.0 ? (uint32_t)wanted : 1);
}

static uint32_t place_lights(strata *s, uint32_t count, environment_light *out)
{
    uint32_t n = 0;
    for (uint32_t k = 0; k <= STRATA; k++) { /* at last, what strata had no more nodes for, anywhere */
        uint32_t wanted = k < STRATA ? share_of(s, k, count - n) : count - n;
        uint32_t first = k < STRATA ? s->first[k] : 0, end = k < STRATA ? s->first[k + 1] : s->blocks;
        const node *found;
        for (uint32_t i = 0; i < wanted && (found = pick(s, first, end)); i++, n++) {
            out[n] = (environment_light){.direction = found->direction};
            add_light(s, found->direction, n);
        }
    }
    return n;
}

/* ---------------------------------------------------------------------------------------------------------- lights */

static void divide_light(const environment *e, const strata *s, uint32_t count, environment_light *out)
{
    double(*sums)[3] = xcalloc(count, sizeof *sums), total[3] = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < (size_t)s->blocks * BLOCK; i++) {
        const node *n = s->nodes[i];
        if (!n)
            continue;
        const double part[3] = {n->irradiance.x, n->irradiance.y, n->irradiance.z};
        for (int c = 0; c < 3; c++) {
            sums[s->nearest[i]][c] += part[c];
            total[c] += part[c];
        }
    }
    /* Nodes are a coarser sum than the map's own mean. */
    rgb mean = environment_mean(e);
    const double wanted[3] = {4.0 * pi * (double)mean.x, 4.0 * pi * (double)mean.y, 4.0 * pi * (double)mean.z};
    for (uint32_t l = 0; l < count; l++) {
        float irradiance[3];
        for (int c = 0; c < 3; c++)
            irradiance[c] = total[c] > 0.0 ? (float)fmin(sums[l][c] * (wanted[c] / total[c]), FLT_MAX) : 0.0f;
        out[l].irradiance = v3(irradiance[0], irradiance[1], irradiance[2]);
        out[l].direction = environment_rotated(e, out[l].direction);
    }
    free(sums);
}

uint32_t environment_lights(const environment *e, uint32_t count, environment_light *out)
{
    double wanted = fmin(fmax((double)NODES_A_LIGHT * count, NODES_LEAST), NODES_MOST), deviation;
    uint32_t node_count;
    division d = division_of(e, wanted, NODES_MOST);
    node *nodes = nodes_new(e, &d, &node_count, &deviation);
    for (double finer = 4.0 * wanted; node_count > 0 && node_count < count && finer <= NODES_IF_BLACK; finer *= 4.0) {
        free(nodes);
        d = division_of(e, finer, finer);
        nodes = nodes_new(e, &d, &node_count, &deviation);
    }
    strata s = strata_new(nodes, node_count, deviation);
    uint32_t placed = place_lights(&s, count, out);
    divide_light(e, &s, placed, out);
    strata_free(&s);
    free(nodes);
    return placed;
}

void scene_add_environment_lights(scene *s, int count)
{
    environment_light *lights = xmalloc((size_t)count * sizeof *lights);
    uint32_t n = environment_lights(s->environment, (uint32_t)count, lights);
    if (n < (uint32_t)count)
        notice("--env-lights %d: of so dark an environment only %u can be made", count, n);
    for (uint32_t i = 0; i < n; i++)
        scene_add_light(s, (light){.kind = LIGHT_DIRECTIONAL,
                                   .direction = v3_neg(lights[i].direction),
                                   .intensity = lights[i].irradiance});
    free(lights);
}
