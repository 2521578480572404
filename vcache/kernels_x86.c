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
            __m512 d =
                _mm512_add_ps(_mm512_add_ps(_mm512_mul_ps(dx, dx), _mm512_mul_ps(dy, dy)), _mm512_mul_ps(dz, dz));
            __mmask16 theirs =
                (__mmask16)(_mm512_cmp_ps_mask(side, own, _CMP_GT_OQ) | _mm512_cmp_ps_mask(side, zero, _CMP_LT_OQ));
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
            __m512i there = _mm512_maskz_loadu_epi64(m, known[k] + w),
                    theirs = _mm512_maskz_loadu_epi64(m, seen[k] + w);
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

AVX512 static inline __m512 scan_avx512(__m512 v)
{
    const __m512i zero = _mm512_setzero_si512();
    v = _mm512_add_ps(v, _mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512(v), zero, 15)));
    v = _mm512_add_ps(v, _mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512(v), zero, 14)));
    v = _mm512_add_ps(v, _mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512(v), zero, 12)));
    return _mm512_add_ps(v, _mm512_castsi512_ps(_mm512_alignr_epi32(_mm512_castps_si512(v), zero, 8)));
}

__attribute__((target("popcnt"))) static void tally_x86(const uint64_t *known, const uint64_t *visible, uint32_t words,
                                                        uint32_t *asked, uint32_t *seen)
{
    tally_bits(known, visible, words, asked, seen);
}

/* States of 64 lights, a byte each. */
AVX512 static inline __m512i states_avx512(const predict_input *in, uint32_t w)
{
    __m512i state = _mm512_maskz_set1_epi8(in->known[0][w], 1);
    for (int bit = 1; bit < 2 * VCACHE_CELLS; bit++) {
        uint64_t on = bit % 2 ? in->visible[bit / 2][w] : in->known[bit / 2][w];
        state = _mm512_mask_add_epi8(state, on, state, _mm512_set1_epi8((char)(1 << bit)));
    }
    return state;
}

/* The 64 entries lie in 4 registers; the state's upper bit chooses between two permutations of 32. */
AVX512 static float predict_avx512(const predict_input *in, const predict_output *out)
{
    const __m512i t0 = _mm512_loadu_si512(in->table), t1 = _mm512_loadu_si512(in->table + 16);
    const __m512i t2 = _mm512_loadu_si512(in->table + 32), t3 = _mm512_loadu_si512(in->table + 48);
    const __m512i upper = _mm512_set1_epi32(STATES / 2);
    __m512 expected = _mm512_setzero_ps();
    for (uint32_t w = 0; w < in->words; w++) {
        const __m512i bytes = states_avx512(in, w);
        const __m128i part[4] = {_mm512_castsi512_si128(bytes), _mm512_extracti32x4_epi32(bytes, 1),
                                 _mm512_extracti32x4_epi32(bytes, 2), _mm512_extracti32x4_epi32(bytes, 3)};
        __m512 lane = _mm512_setzero_ps();
        for (uint32_t i = 0; i < 4; i++) {
            uint32_t at = 64 * w + LANES * i;
            __m512i state = _mm512_cvtepu8_epi32(part[i]);
            __m512i low = _mm512_permutex2var_epi32(t0, state, t1), high = _mm512_permutex2var_epi32(t2, state, t3);
            __m512i entry = _mm512_mask_blend_epi32(_mm512_test_epi32_mask(state, upper), low, high);
            __m512 mean = _mm512_castsi512_ps(entry), deviation = _mm512_castsi512_ps(_mm512_slli_epi32(entry, 16));
            __m512 c = _mm512_loadu_ps(in->contribution + at);
            _mm512_storeu_ps(out->mean + at, mean);
            expected = _mm512_add_ps(expected, _mm512_mul_ps(c, mean));
            lane = _mm512_add_ps(lane, _mm512_mul_ps(c, deviation));
        }
        _mm512_storeu_ps(out->sums + LANES * w, scan_avx512(lane));
    }
    return sum_avx512(expected);
}

const kernels kernels_avx512 = {"avx512", near_avx512, decide_avx512, tally_x86, predict_avx512};

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
            __m256 d =
                _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(dx, dx), _mm256_mul_ps(dy, dy)), _mm256_mul_ps(dz, dz));
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
            __m256 mean = _mm256_i32gather_ps(in->table, state, 4);
            __m256 deviation = _mm256_castsi256_ps(_mm256_slli_epi32(_mm256_castps_si256(mean), 16));
            __m256 c = _mm256_loadu_ps(in->contribution + at);
            _mm256_storeu_ps(out->mean + at, mean);
            expected[half] = _mm256_add_ps(expected[half], _mm256_mul_ps(c, mean));
            lane[half] = _mm256_add_ps(lane[half], _mm256_mul_ps(c, deviation));
        }
        _mm256_storeu_ps(out->sums + LANES * w, lane[0]);
        _mm256_storeu_ps(out->sums + LANES * w + 8, lane[1]);
        lanes_scan(out->sums + LANES * w);
    }
    _mm256_storeu_ps(sum, expected[0]);
    _mm256_storeu_ps(sum + 8, expected[1]);
    return lanes_sum(sum);
}

const kernels kernels_avx2 = {"avx2", near_avx2, decide_avx2, tally_x86, predict_avx2};
#endif
