/* SPDX-License-Identifier: Apache-2.0 */
/* Angles without calls and branches, so that loops over them are vectorized. Good to about 2 ulp. */
#ifndef COMMON_ANGLES_H
#define COMMON_ANGLES_H

#include "vec.h"

/* atan2(y, x) for finite arguments; 0 at the origin. Polynomial: Cephes, atanf. */
static inline float angle_atan2(float y, float x)
{
    float ax = fabsf(x), ay = fabsf(y);
    float low = ax < ay ? ax : ay, high = ax < ay ? ay : ax;
    int upper = low > 0.41421356f * high; /* beyond tan(pi / 8): turned by pi / 4 */
    float above = upper ? low - high : low, below = upper ? low + high : high;
    float a = above / (below > 0.0f ? below : 1.0f), z = a * a;
    float p = ((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z - 3.33329491539e-1f;
    float r = p * z * a + a;
    r = upper ? r + 0.25f * PI_F : r;
    r = ax < ay ? 0.5f * PI_F - r : r;
    r = x < 0.0f ? PI_F - r : r;
    return copysignf(r, y);
}

/* Sine and cosine of 2 pi t, |t| <= 1/2. Polynomials: Cephes, sinf and cosf. */
static inline void angle_turn(double t, float *sine, float *cosine)
{
    int quarter = (int)(4.0 * t + 2.5) - 2;
    float f = (float)(4.0 * t - quarter) * (0.5f * PI_F), z = f * f;
    float s = ((-1.9515295891e-4f * z + 8.3321608736e-3f) * z - 1.6666654611e-1f) * z * f + f;
    float c =
        ((2.443315711809948e-5f * z - 1.388731625493765e-3f) * z + 4.166664568298827e-2f) * z * z - 0.5f * z + 1.0f;
    float s1 = quarter & 1 ? c : s, c1 = quarter & 1 ? s : c;
    *sine = quarter & 2 ? -s1 : s1;
    *cosine = (quarter + 1) & 2 ? -c1 : c1;
}

#endif
