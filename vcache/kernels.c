/* SPDX-License-Identifier: Apache-2.0 */
/* The scalar kernels, and which ones to use. */
#include "kernels.h"

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* Loops are of forms that compilers make vectors of, NEON's too: bytes first, then bits. */
static uint64_t near_bits(const light_places *p, const float eye[3], float eye_side_squared, uint32_t first)
{
    const float *restrict x = p->x + first, *restrict y = p->y + first, *restrict z = p->z + first;
    const float *restrict side = p->side_squared + first, ex = eye[0], ey = eye[1], ez = eye[2];
    uint8_t near[64];
    uint64_t word = 0;
    for (uint32_t i = 0; i < 64; i++) {
        float dx = x[i] - ex, dy = y[i] - ey, dz = z[i] - ez, distance = dx * dx + dy * dy + dz * dz;
        /* negative: a direction, never near */
        float least = ((side[i] > eye_side_squared) | (side[i] < 0.0f)) ? side[i] : eye_side_squared;
        near[i] = !(distance >= least);
    }
    for (uint32_t i = 0; i < 64; i++)
        word |= (uint64_t)near[i] << i;
    return word;
}

static void near_scalar(const light_places *p, const float eye[3], float eye_side_squared, uint32_t words,
                        uint64_t *bits)
{
    for (uint32_t w = 0; w < words; w++)
        bits[w] = near_bits(p, eye, eye_side_squared, 64 * w);
}

enum { DECIDE_PIECE = 8 };

static void decide_scalar(uint32_t words, uint32_t cells, const uint64_t *const known[5], const uint64_t *const seen[5],
                          const uint64_t *rest, uint64_t *found, uint64_t *missing, uint64_t *differs)
{
    for (uint32_t first = 0; first < words; first += DECIDE_PIECE) {
        uint32_t count = words - first < DECIDE_PIECE ? words - first : DECIDE_PIECE;
        uint64_t other[DECIDE_PIECE] = {0};
        for (uint32_t k = 1; k < cells; k++)
            for (uint32_t w = 0; w < count; w++)
                other[w] |= known[k][first + w] & (seen[k][first + w] ^ seen[0][first + w]);
        for (uint32_t w = 0; w < count; w++) {
            uint64_t asked = rest[first + w], have = asked & known[0][first + w];
            missing[first + w] = asked & ~have;
            found[first + w] = have & ~other[w];
            differs[first + w] = have & other[w];
        }
    }
}

static void tally_scalar(const uint64_t *known, const uint64_t *visible, uint32_t words, uint32_t *asked,
                         uint32_t *seen)
{
    tally_bits(known, visible, words, asked, seen);
}

static float predict_scalar(const predict_input *in, const predict_output *out)
{
    float expected[LANES] = {0};
    for (uint32_t w = 0; w < in->words; w++) {
        float *sums = out->sums + LANES * w;
        memset(sums, 0, LANES * sizeof *sums);
        for (uint32_t i = 0; i < 64; i++) {
            uint32_t at = 64 * w + i, state = 0;
            for (int c = VCACHE_CELLS - 1; c >= 0; c--)
                state =
                    state << 2 | (uint32_t)(in->visible[c][w] >> i & 1u) << 1 | (uint32_t)(in->known[c][w] >> i & 1u);
            float mean = in->table[state];
            out->mean[at] = mean;
            expected[i % LANES] += in->contribution[at] * mean;
            sums[i % LANES] += in->contribution[at] * deviation_of(mean);
        }
        lanes_scan(sums);
    }
    return lanes_sum(expected);
}

const kernels kernels_scalar = {"scalar", near_scalar, decide_scalar, tally_scalar, predict_scalar};

const kernels *kernels_choose(uint32_t isa)
{
#if defined(KERNELS_X86)
    __builtin_cpu_init();
    if (isa & VCACHE_ISA_AVX512 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("popcnt"))
        return &kernels_avx512;
    if (isa & VCACHE_ISA_AVX2 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("popcnt"))
        return &kernels_avx2;
#endif
    (void)isa;
    return &kernels_scalar;
}
