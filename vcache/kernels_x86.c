/* SPDX-License-Identifier: Apache-2.0 */
/* Kernels for AVX2 and AVX-512. No multiply-add: the scalar reference has none. */
#include "kernels.h"

#if defined(KERNELS_X86)
#include <immintrin.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* -------------------------------------------------------------------------------------------------------- AVX-512 */

#define AVX512 __attribute__((target("avx512f,avx512bw,avx512dq,avx512vl")))

AVX512 static void near_avx512(const light_places *p, const float eye[3], float eye_side_squared, uint32_t words,
                               uint64_t *bits)
{
    const __m512 ex = _mm512_set1_ps(eye[0]), ey = _mm512_set1_ps(eye[1]), ez = _mm512_set1_ps(eye[2]);
    const __m512 own = _mm512_set1_ps(eye_side_squared), zero = _mm512_setzero_ps();
    for (uint32_t w = 0; w < words; w++) {
        uint64_t word = 0;
        for (uint32_t i = 0; i < 64; i += LANES) {
            uint32_t at = 64 * w + i;
            __m512 dx = _mm512_sub_ps(_mm512_loadu_ps(p->x + at), ex);
            __m512 dy = _mm512_sub_ps(_mm512_loadu_ps(p->y + at), ey);
            __m512 dz = _mm512_sub_ps(_mm512_loadu_ps(p->z + at), ez);
            __m512 side = _mm512_loadu_ps(p->side_squared + at);
            __m512 d = _mm512_add_ps(_mm512_add_ps(_mm512_mul_ps(dx, dx), _mm512_mul_ps(dy, dy)), _mm512_mul_ps(dz, dz));
            __mmask16 theirs = (__mmask16)(_mm512_cmp_ps_mask(side, own, _CMP_GT_OQ) |
                                           _mm512_cmp_ps_mask(side, zero, _CMP_LT_OQ));
            __m512 least = _mm512_mask_blend_ps(theirs, own, side);
            word |= (uint64_t)_mm512_cmp_ps_mask(d, least, _CMP_NGE_UQ) << i;
        }
        bits[w] = word;
    }
}

AVX512 static void decide_avx512(uint32_t words, uint32_t cells, const uint64_t *const known[5],
                                 const uint64_t *const seen[5], const uint64_t *rest, uint64_t *found,
                                 uint64_t *missing, uint64_t *differs)
{
    for (uint32_t w = 0; w < words; w += 8) {
        __mmask8 m = (__mmask8)(words - w < 8 ? (1u << (words - w)) - 1u : 0xffu);
        __m512i have = _mm512_maskz_loadu_epi64(m, known[0] + w), mine = _mm512_maskz_loadu_epi64(m, seen[0] + w);
        __m512i asked = _mm512_maskz_loadu_epi64(m, rest + w), other = _mm512_setzero_si512();
        for (uint32_t k = 1; k < cells; k++) {
            __m512i there = _mm512_maskz_loadu_epi64(m, known[k] + w), theirs = _mm512_maskz_loadu_epi64(m, seen[k] + w);
            other = _mm512_or_si512(other, _mm512_and_si512(there, _mm512_xor_si512(theirs, mine)));
        }
        _mm512_mask_storeu_epi64(missing + w, m, _mm512_andnot_si512(have, asked));
        have = _mm512_and_si512(have, asked);
        _mm512_mask_storeu_epi64(found + w, m, _mm512_andnot_si512(other, have));
        _mm512_mask_storeu_epi64(differs + w, m, _mm512_and_si512(other, have));
    }
}

AVX512 static inline float sum_avx512(__m512 v)
{
    __m256 a = _mm256_add_ps(_mm512_castps512_ps256(v), _mm512_extractf32x8_ps(v, 1));
    __m128 b = _mm_add_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    __m128 c = _mm_add_ps(b, _mm_movehl_ps(b, b));
    return _mm_cvtss_f32(_mm_add_ss(c, _mm_movehdup_ps(c)));
}

/* The 64 entries lie in 4 registers; the state's upper bit chooses between two permutations of 32. */
AVX512 static float predict_avx512(const predict_input *in, const predict_output *out)
{
    const __m512i t0 = _mm512_loadu_si512(in->table), t1 = _mm512_loadu_si512(in->table + 16);
    const __m512i t2 = _mm512_loadu_si512(in->table + 32), t3 = _mm512_loadu_si512(in->table + 48);
    const __m512i bit[5] = {_mm512_set1_epi32(1), _mm512_set1_epi32(2), _mm512_set1_epi32(4), _mm512_set1_epi32(8),
                            _mm512_set1_epi32(16)};
    const __m512i upper = _mm512_set1_epi32((int)0xffff0000u);
    __m512 expected = _mm512_setzero_ps();
    for (uint32_t w = 0; w < in->words; w++) {
        uint64_t k0 = in->known[0][w], v0 = in->visible[0][w], k1 = in->known[1][w], v1 = in->visible[1][w];
        uint64_t k2 = in->known[2][w], v2 = in->visible[2][w];
        __m512 lane = _mm512_setzero_ps();
        for (uint32_t i = 0; i < 64; i += LANES) {
            uint32_t at = 64 * w + i;
            __m512i state = _mm512_maskz_mov_epi32((__mmask16)(k0 >> i), bit[0]);
            state = _mm512_mask_or_epi32(state, (__mmask16)(v0 >> i), state, bit[1]);
            state = _mm512_mask_or_epi32(state, (__mmask16)(k1 >> i), state, bit[2]);
            state = _mm512_mask_or_epi32(state, (__mmask16)(v1 >> i), state, bit[3]);
            state = _mm512_mask_or_epi32(state, (__mmask16)(k2 >> i), state, bit[4]);
            __m512i low = _mm512_permutex2var_epi32(t0, state, t1), high = _mm512_permutex2var_epi32(t2, state, t3);
            __m512i entry = _mm512_mask_blend_epi32((__mmask16)(v2 >> i), low, high);
            __m512 mean = _mm512_castsi512_ps(_mm512_and_si512(entry, upper));
            __m512 deviation = _mm512_castsi512_ps(_mm512_slli_epi32(entry, 16));
            __m512 c = _mm512_loadu_ps(in->contribution + at), weight = _mm512_mul_ps(c, deviation);
            _mm512_storeu_ps(out->mean + at, mean);
            _mm512_storeu_ps(out->weight + at, weight);
            expected = _mm512_add_ps(expected, _mm512_mul_ps(c, mean));
            lane = _mm512_add_ps(lane, weight);
        }
        _mm512_storeu_ps(out->lane + LANES * w, lane);
        out->word[w] = sum_avx512(lane);
    }
    return sum_avx512(expected);
}

const kernels kernels_avx512 = {"avx512", near_avx512, decide_avx512, predict_avx512};

/* ----------------------------------------------------------------------------------------------------------- AVX2 */

#define AVX2 __attribute__((target("avx2")))

AVX2 static void near_avx2(const light_places *p, const float eye[3], float eye_side_squared, uint32_t words,
                           uint64_t *bits)
{
    const __m256 ex = _mm256_set1_ps(eye[0]), ey = _mm256_set1_ps(eye[1]), ez = _mm256_set1_ps(eye[2]);
    const __m256 own = _mm256_set1_ps(eye_side_squared), zero = _mm256_setzero_ps();
    for (uint32_t w = 0; w < words; w++) {
        uint64_t word = 0;
        for (uint32_t i = 0; i < 64; i += 8) {
            uint32_t at = 64 * w + i;
            __m256 dx = _mm256_sub_ps(_mm256_loadu_ps(p->x + at), ex);
            __m256 dy = _mm256_sub_ps(_mm256_loadu_ps(p->y + at), ey);
            __m256 dz = _mm256_sub_ps(_mm256_loadu_ps(p->z + at), ez);
            __m256 side = _mm256_loadu_ps(p->side_squared + at);
            __m256 d = _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(dx, dx), _mm256_mul_ps(dy, dy)), _mm256_mul_ps(dz, dz));
            __m256 theirs = _mm256_or_ps(_mm256_cmp_ps(side, own, _CMP_GT_OQ), _mm256_cmp_ps(side, zero, _CMP_LT_OQ));
            __m256 least = _mm256_blendv_ps(own, side, theirs);
            word |= (uint64_t)(uint32_t)_mm256_movemask_ps(_mm256_cmp_ps(d, least, _CMP_NGE_UQ)) << i;
        }
        bits[w] = word;
    }
}

AVX2 static void decide_avx2(uint32_t words, uint32_t cells, const uint64_t *const known[5],
                             const uint64_t *const seen[5], const uint64_t *rest, uint64_t *found, uint64_t *missing,
                             uint64_t *differs)
{
    uint32_t w = 0;
    for (; w + 4 <= words; w += 4) {
        __m256i have = _mm256_loadu_si256((const __m256i *)(const void *)(known[0] + w));
        __m256i mine = _mm256_loadu_si256((const __m256i *)(const void *)(seen[0] + w));
        __m256i asked = _mm256_loadu_si256((const __m256i *)(const void *)(rest + w)), other = _mm256_setzero_si256();
        for (uint32_t k = 1; k < cells; k++) {
            __m256i there = _mm256_loadu_si256((const __m256i *)(const void *)(known[k] + w));
            __m256i theirs = _mm256_loadu_si256((const __m256i *)(const void *)(seen[k] + w));
            other = _mm256_or_si256(other, _mm256_and_si256(there, _mm256_xor_si256(theirs, mine)));
        }
        _mm256_storeu_si256((__m256i *)(void *)(missing + w), _mm256_andnot_si256(have, asked));
        have = _mm256_and_si256(have, asked);
        _mm256_storeu_si256((__m256i *)(void *)(found + w), _mm256_andnot_si256(other, have));
        _mm256_storeu_si256((__m256i *)(void *)(differs + w), _mm256_and_si256(other, have));
    }
    if (w < words) {
        const uint64_t *k[5], *s[5];
        for (uint32_t i = 0; i < cells; i++)
            k[i] = known[i] + w, s[i] = seen[i] + w;
        kernels_scalar.decide(words - w, cells, k, s, rest + w, found + w, missing + w, differs + w);
    }
}

/* Each bit of `eight` becomes `value` in its lane. */
AVX2 static inline __m256i spread_avx2(uint64_t eight, int value)
{
    const __m256i bit = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    __m256i all = _mm256_and_si256(_mm256_set1_epi32((int)(eight & 255u)), bit);
    return _mm256_and_si256(_mm256_cmpeq_epi32(all, bit), _mm256_set1_epi32(value));
}

AVX2 static float predict_avx2(const predict_input *in, const predict_output *out)
{
    const __m256i upper = _mm256_set1_epi32((int)0xffff0000u);
    __m256 expected[2] = {_mm256_setzero_ps(), _mm256_setzero_ps()};
    float sum[LANES];
    for (uint32_t w = 0; w < in->words; w++) {
        __m256 lane[2] = {_mm256_setzero_ps(), _mm256_setzero_ps()};
        for (uint32_t i = 0; i < 64; i += 8) {
            uint32_t at = 64 * w + i, half = i / 8 % 2;
            __m256i state = _mm256_setzero_si256();
            for (int c = 0; c < VCACHE_CELLS; c++) {
                state = _mm256_or_si256(state, spread_avx2(in->known[c][w] >> i, 1 << 2 * c));
                state = _mm256_or_si256(state, spread_avx2(in->visible[c][w] >> i, 2 << 2 * c));
            }
            __m256i entry = _mm256_i32gather_epi32((const int *)(const void *)in->table, state, 4);
            __m256 mean = _mm256_castsi256_ps(_mm256_and_si256(entry, upper));
            __m256 deviation = _mm256_castsi256_ps(_mm256_slli_epi32(entry, 16));
            __m256 c = _mm256_loadu_ps(in->contribution + at), weight = _mm256_mul_ps(c, deviation);
            _mm256_storeu_ps(out->mean + at, mean);
            _mm256_storeu_ps(out->weight + at, weight);
            expected[half] = _mm256_add_ps(expected[half], _mm256_mul_ps(c, mean));
            lane[half] = _mm256_add_ps(lane[half], weight);
        }
        _mm256_storeu_ps(out->lane + LANES * w, lane[0]);
        _mm256_storeu_ps(out->lane + LANES * w + 8, lane[1]);
        out->word[w] = lanes_sum(out->lane + LANES * w);
    }
    _mm256_storeu_ps(sum, expected[0]);
    _mm256_storeu_ps(sum + 8, expected[1]);
    return lanes_sum(sum);
}

const kernels kernels_avx2 = {"avx2", near_avx2, decide_avx2, predict_avx2};
#endif
