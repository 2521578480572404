/* SPDX-License-Identifier: Apache-2.0 */
/* Three-component vectors for positions, directions and linear RGB. */
#ifndef COMMON_VEC_H
#define COMMON_VEC_H

#include <math.h>

typedef struct vec3 {
    float x, y, z;
} vec3;

typedef vec3 rgb; /* linear, Rec. 709 primaries */

#define PI_F 3.14159265358979323846f

/* Plain comparisons: fminf and fmaxf are calls, for the sake of NaN. Where one is NaN the second is returned. */
static inline float float_min(float a, float b)
{
    return a < b ? a : b;
}

static inline float float_max(float a, float b)
{
    return a > b ? a : b;
}

static inline vec3 v3(float x, float y, float z)
{
    return (vec3){x, y, z};
}

static inline vec3 v3_add(vec3 a, vec3 b)
{
    return v3(a.x + b.x, a.y + b.y, a.z + b.z);
}

static inline vec3 v3_sub(vec3 a, vec3 b)
{
    return v3(a.x - b.x, a.y - b.y, a.z - b.z);
}

static inline vec3 v3_mul(vec3 a, vec3 b)
{
    return v3(a.x * b.x, a.y * b.y, a.z * b.z);
}

static inline vec3 v3_scale(vec3 a, float s)
{
    return v3(a.x * s, a.y * s, a.z * s);
}

/* a + s b */
static inline vec3 v3_mad(vec3 a, float s, vec3 b)
{
    return v3(a.x + s * b.x, a.y + s * b.y, a.z + s * b.z);
}

static inline vec3 v3_neg(vec3 a)
{
    return v3(-a.x, -a.y, -a.z);
}

static inline float v3_dot(vec3 a, vec3 b)
{
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

static inline vec3 v3_cross(vec3 a, vec3 b)
{
    return v3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

static inline float v3_length(vec3 a)
{
    return sqrtf(v3_dot(a, a));
}

/* Zero stays zero. */
static inline vec3 v3_normalize(vec3 a)
{
    float l = v3_length(a);
    return l > 0.0f ? v3_scale(a, 1.0f / l) : a;
}

static inline vec3 v3_min(vec3 a, vec3 b)
{
    return v3(float_min(a.x, b.x), float_min(a.y, b.y), float_min(a.z, b.z));
}

static inline vec3 v3_max(vec3 a, vec3 b)
{
    return v3(float_max(a.x, b.x), float_max(a.y, b.y), float_max(a.z, b.z));
}

static inline float v3_max_component(vec3 a)
{
    return float_max(a.x, float_max(a.y, a.z));
}

static inline float luminance(rgb c)
{
    return 0.2126f * c.x + 0.7152f * c.y + 0.0722f * c.z;
}

/* Orthonormal basis around unit n: t, b, n right-handed (Duff et al. 2017). */
static inline void v3_basis(vec3 n, vec3 *t, vec3 *b)
{
    float s = copysignf(1.0f, n.z);
    float a = -1.0f / (s + n.z), c = n.x * n.y * a;
    *t = v3(1.0f + s * n.x * n.x * a, s * c, -s * n.x);
    *b = v3(c, s + n.y * n.y * a, -n.y);
}

#endif
