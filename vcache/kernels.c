/* SPDX-License-Identifier: Apache-2.0 */
/* The scalar kernels, and which ones to use. */
#include "kernels.h"

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

static void near_scalar(const light_places *p, const float eye[3], float eye_side_squared, uint32_t words,
                        uint64_t *bits)
{
    for (uint32_t w = 0; w < words; w++) {
        uint64_t word = 0;
        for (uint32_t i = 0; i < 64; i++) {
            uint32_t at = 64 * w + i;
            float dx = p->x[at] - eye[0], dy = p->y[at] - eye[1], dz = p->z[at] - eye[2], side = p->side_squared[at];
            float distance = dx * dx + dy * dy + dz * dz;
            /* negative: a direction, never near */
            float least = side > eye_side_squared || side < 0.0f ? side : eye_side_squared;
            word |= (uint64_t) !(distance >= least) << i;
        }
        bits[w] = word;
    }
}

static void decide_scalar(uint32_t words, uint32_t cells, const uint64_t *const known[5], const uint64_t *const seen[5],
                          const uint64_t *rest, uint64_t *found, uint64_t *missing, uint64_t *differs)
{
    for (uint32_t w = 0; w < words; w++) {
        uint64_t other = 0;
        for (uint32_t k = 1; k < cells; k++)
            other |= known[k][w] & (seen[k][w] ^ seen[0][w]);
        uint64_t have = rest[w] & known[0][w];
        missing[w] = rest[w] & ~known[0][w];
        found[w] = have & ~other;
        differs[w] = have & other;
    }
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

const kernels kernels_scalar = {"scalar", near_scalar, decide_scalar, predict_scalar};

const kernels *kernels_choose(uint32_t isa)
{
#if defined(KERNELS_X86)
    __builtin_cpu_init();
    if (isa & VCACHE_ISA_AVX512 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") &&
        __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
        return &kernels_avx512;
    if (isa & VCACHE_ISA_AVX2 && __builtin_cpu_supports("avx2"))
        return &kernels_avx2;
#endif
    (void)isa;
    return &kernels_scalar;
}
