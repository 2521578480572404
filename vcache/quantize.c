/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Quantization of positions and directions (Sect. 3.3 to 3.5). Keys must be the same with every compiler and machine:
 * double arithmetic of +, -, *, / and sqrt alone (IEEE 754 rounds these correctly), no contraction, no libm.
 */
#include "cells.h"

#include <math.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* Steeper planes split into layers; they come with C_N <= 2 alone. */
static const double slope_limit = 2.0;

/* Points farther from the scene's centre than this many diameters are answered exactly: cell numbers stay in 32 bits.
 */
static const double reach = 32.0;

bool finite3(const float p[3])
{
    return isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]);
}

int quantize_power(const vcache *c, double squared, int limit)
{
    uint64_t bits;
    memcpy(&bits, &squared, sizeof bits);
    int step = c->first_step[(bits >> 52) - 1023];
    while (step < limit && squared >= c->power[2 * step + 1])
        step++;
    return step < limit ? step : limit;
}

/* Eq. 8 from R^2. */
int quantize_step(const vcache *c, double squared_resolution, int limit)
{
    if (!(squared_resolution > 1.0))
        return 0;
    if (squared_resolution >= 0x1p64)
        return c->canonical[limit];
    return c->canonical[quantize_power(c, squared_resolution, limit)];
}

cell_size quantize_size(const vcache *c, int step)
{
    double r = c->resolution[step];
    return (cell_size){step, r, (float)(c->diameter / r)};
}

/* Eq. 4, rounded to the nearest of 2 s + 1 bins per axis, s = floor(C_N / 2): axis-aligned normals lie in the middle of
 * their bin, and the zero vector cannot come out, for the largest component of a unit vector is at least 0.577. */
static uint32_t quantize_normal(int bins, const double n[3], double axis[3])
{
    int s = bins / 2;
    if (s == 0) { /* one orientation for all: any fixed one off the axes */
        axis[0] = 0.36, axis[1] = 0.48, axis[2] = 0.8;
        return 0;
    }
    uint32_t packed = 0;
    for (int i = 0; i < 3; i++) {
        int bin = (int)(n[i] * s + (s + 0.5)); /* positive: truncation is floor */
        packed = packed << 7 | (uint32_t)bin;
        axis[i] = bin - s;
    }
    double inverse = 1.0 / sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    for (int i = 0; i < 3; i++)
        axis[i] *= inverse;
    return packed;
}

bool quantize_point(const vcache *c, const float position[3], const float normal[3], grid_point *out)
{
    if (!finite3(position) || !finite3(normal))
        return false;
    double n[3] = {normal[0], normal[1], normal[2]}, z[3];
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    if (!(length > 0.0))
        return false;
    double inverse = 1.0 / length;
    for (int i = 0; i < 3; i++)
        n[i] *= inverse;
    double p[3];
    for (int i = 0; i < 3; i++) {
        p[i] = (position[i] - c->center[i]) * c->inverse_diameter;
        if (!(fabs(p[i]) < reach))
            return false;
    }
    out->orientation = quantize_normal(c->config.normal_bins, n, z);

    /* Axes u, v around z without a branch on nearly equal components (Duff et al. 2017). */
    double s = z[2] < 0.0 ? -1.0 : 1.0, a = -1.0 / (s + z[2]), b = z[0] * z[1] * a;
    double x[3] = {1.0 + s * z[0] * z[0] * a, s * b, -s * z[0]};
    double y[3] = {b, s + z[1] * z[1] * a, -z[1]};

    out->u = p[0] * x[0] + p[1] * x[1] + p[2] * x[2];
    out->v = p[0] * y[0] + p[1] * y[1] + p[2] * y[2];
    out->w = p[0] * z[0] + p[1] * z[1] + p[2] * z[2];

    double nx = n[0] * x[0] + n[1] * x[1] + n[2] * x[2], ny = n[0] * y[0] + n[1] * y[1] + n[2] * y[2];
    double nz = n[0] * z[0] + n[1] * z[1] + n[2] * z[2];
    if (fabs(nz) < 1e-3)
        nz = nz < 0.0 ? -1e-3 : 1e-3;
    double inverse_nz = 1.0 / nz, su = nx * inverse_nz, sv = ny * inverse_nz;
    out->slope_u = su > slope_limit ? slope_limit : su < -slope_limit ? -slope_limit : su;
    out->slope_v = sv > slope_limit ? slope_limit : sv < -slope_limit ? -slope_limit : sv;
    return true;
}

cell quantize_cell(const vcache *c, const grid_point *p, cell_size size, cell neighbours[4])
{
    double height, layers = c->config.layers;
    cell q = cell_at(c, p, size.resolution, &height);
    if (neighbours) {
        neighbours[0] = (cell){q.i + 1, q.j, floor_int((height - p->slope_u) * layers + SHIFT_LAYER)};
        neighbours[1] = (cell){q.i, q.j + 1, floor_int((height - p->slope_v) * layers + SHIFT_LAYER)};
        neighbours[2] = (cell){q.i - 1, q.j, floor_int((height + p->slope_u) * layers + SHIFT_LAYER)};
        neighbours[3] = (cell){q.i, q.j - 1, floor_int((height + p->slope_v) * layers + SHIFT_LAYER)};
    }
    return q;
}

/* Octahedral map of the sphere onto the unit square (Engelhardt and Dachsbacher 2008). */
void quantize_octahedral(const float direction[3], double *s, double *t)
{
    double x = direction[0], y = direction[1], z = direction[2];
    double norm = fabs(x) + fabs(y) + fabs(z);
    x /= norm, y /= norm;
    if (z < 0.0) {
        double fx = (1.0 - fabs(y)) * (x < 0.0 ? -1.0 : 1.0), fy = (1.0 - fabs(x)) * (y < 0.0 ? -1.0 : 1.0);
        x = fx, y = fy;
    }
    *s = 0.5 * x + 0.5;
    *t = 0.5 * y + 0.5;
}
