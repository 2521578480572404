/* SPDX-License-Identifier: Apache-2.0 */
/* Pixel order of halton/ against a plain implementation and against its promised properties. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "../halton/halton.h"

typedef struct listing {
    uint32_t *order, starts[HALTON_MAX_SEGMENTS + 1], segments, pixels;
} listing;

static listing list_pixels(uint32_t width, uint32_t height, double ce)
{
    listing l = {.pixels = width * height};
    l.order = malloc(sizeof *l.order * l.pixels);
    assert_non_null(l.order);
    memset(l.order, 0xff, sizeof *l.order * l.pixels);
    assert_int_equal(halton_order(width, height, ce, l.order, l.starts, &l.segments), HALTON_OK);
    return l;
}

static uint64_t plain_morton(uint32_t x, uint32_t y)
{
    uint64_t code = 0;
    for (unsigned k = 0; k < 32; k++)
        code |= (uint64_t)(x >> k & 1) << 2 * k | (uint64_t)(y >> k & 1) << (2 * k + 1);
    return code;
}

/* floor(radical inverse of i * size), where size is a power of base */
static uint64_t plain_cell(uint64_t i, uint64_t base, uint64_t size)
{
    uint64_t cell = 0;
    while (size > 1) {
        size /= base;
        cell += i % base * size;
        i /= base;
    }
    return cell;
}

typedef struct coded {
    uint64_t code;
    uint32_t pixel;
} coded;

static int by_code(const void *a, const void *b)
{
    const coded *p = a, *q = b;
    return p->code < q->code ? -1 : p->code > q->code;
}

/* Sect. 4.3 word by word: walk the sequence, cut, sort. */
static void plain_order(uint32_t width, uint32_t height, double ce, uint32_t *order)
{
    uint64_t pixels = (uint64_t)width * height, columns = 1, rows = 1;
    while (columns < width)
        columns *= 2;
    while (rows < height)
        rows *= 3;
    coded *list = malloc(sizeof *list * pixels);
    assert_non_null(list);
    uint64_t n = 0;
    for (uint64_t i = 0; n < pixels; i++) {
        uint64_t x = plain_cell(i, 2, columns), y = plain_cell(i, 3, rows);
        if (x < width && y < height)
            list[n++] = (coded){plain_morton((uint32_t)x, (uint32_t)y), (uint32_t)(y * width + x)};
    }
    double c = fmax(1.0, (double)pixels / (ce * ce));
    for (uint64_t begin = 0; begin < pixels; c *= 3.7) {
        uint64_t end = c < (double)pixels ? (uint64_t)c : pixels;
        qsort(list + begin, end - begin, sizeof *list, by_code);
        begin = end;
    }
    for (uint64_t i = 0; i < pixels; i++)
        order[i] = list[i].pixel;
    free(list);
}

static const uint32_t sizes[][2] = {{1, 1},    {2, 1},    {1, 2},    {7, 1},     {1, 97},     {97, 1},  {3, 3},
                                    {9, 8},    {31, 37},  {32, 32},  {33, 27},   {64, 81},    {65, 82}, {8191, 3},
                                    {3, 8191}, {1, 6561}, {1, 6562}, {640, 360}, {1024, 1024}};
static const double errors[] = {0.5, 1.0, 4.0, 8.0, 33.3, 1e9, 1e300};

#define COUNT(a) (sizeof(a) / sizeof *(a))

static void each_pixel_once(void **state)
{
    (void)state;
    for (size_t s = 0; s < COUNT(sizes); s++)
        for (size_t e = 0; e < COUNT(errors); e++) {
            listing l = list_pixels(sizes[s][0], sizes[s][1], errors[e]);
            bool *seen = calloc(l.pixels, sizeof *seen);
            assert_non_null(seen);
            for (uint32_t i = 0; i < l.pixels; i++) {
                assert_true(l.order[i] < l.pixels);
                assert_false(seen[l.order[i]]);
                seen[l.order[i]] = true;
            }
            free(seen);
            free(l.order);
        }
}

static void equals_the_plain_way(void **state)
{
    (void)state;
    for (size_t s = 0; s < COUNT(sizes); s++) {
        double ce = s % 2 ? 8.0 : 1e9;
        listing l = list_pixels(sizes[s][0], sizes[s][1], ce);
        uint32_t *expected = malloc(sizeof *expected * l.pixels);
        assert_non_null(expected);
        plain_order(sizes[s][0], sizes[s][1], ce, expected);
        assert_memory_equal(l.order, expected, sizeof *expected * l.pixels);
        free(expected);
        free(l.order);
    }
}

static void sorted_inside_segments(void **state)
{
    (void)state;
    listing l = list_pixels(640, 360, 8.0);
    for (uint32_t s = 0; s < l.segments; s++)
        for (uint32_t i = l.starts[s] + 1; i < l.starts[s + 1]; i++)
            assert_true(halton_morton(l.order[i - 1] % 640, l.order[i - 1] / 640) <
                        halton_morton(l.order[i] % 640, l.order[i] / 640));
    free(l.order);
}

static void segment_boundaries(void **state)
{
    (void)state;
    /* 65536 / 64 = 1024; 1024 * 3.7 = 3788.8; * 3.7 = 14018.56; * 3.7 = 51868.67 */
    static const uint32_t expected[] = {0, 1024, 3788, 14018, 51868, 65536};
    listing l = list_pixels(256, 256, 8.0);
    assert_int_equal(l.segments, 5);
    for (size_t i = 0; i < COUNT(expected); i++)
        assert_int_equal(l.starts[i], expected[i]);
    free(l.order);

    static const double single[] = {1e-300, 0.5, 1.0}; /* the first boundary is at or behind the end */
    uint32_t starts[HALTON_MAX_SEGMENTS + 1], segments;
    for (size_t i = 0; i < COUNT(single); i++) {
        assert_int_equal(halton_segments(100, single[i], starts, &segments), HALTON_OK);
        assert_int_equal(segments, 1);
        assert_int_equal(starts[0], 0);
        assert_int_equal(starts[1], 100);
    }
    static const double huge[] = {1e9, 1e300}; /* from one pixel: 0 1 3 13 50 100 */
    for (size_t i = 0; i < COUNT(huge); i++) {
        assert_int_equal(halton_segments(100, huge[i], starts, &segments), HALTON_OK);
        assert_int_equal(segments, 5);
        assert_int_equal(starts[1], 1);
        assert_int_equal(starts[2], 3);
        assert_int_equal(starts[4], 50);
    }
}

static void segment_count_is_bounded(void **state)
{
    (void)state;
    uint32_t guarded[HALTON_MAX_SEGMENTS + 2], segments, most = 0;
    for (double ce = 0.25; ce < 1e12; ce *= 1.3) {
        guarded[HALTON_MAX_SEGMENTS + 1] = 0xabcdef;
        assert_int_equal(halton_segments(UINT32_MAX, ce, guarded, &segments), HALTON_OK);
        assert_int_equal(guarded[HALTON_MAX_SEGMENTS + 1], 0xabcdef);
        assert_int_equal(guarded[segments], UINT32_MAX);
        for (uint32_t s = 0; s < segments; s++)
            assert_true(guarded[s] < guarded[s + 1]);
        most = segments > most ? segments : most;
    }
    assert_int_equal(most, HALTON_MAX_SEGMENTS);
}

/* Whether each 32 x 32 block of a 256 x 256 image holds half to twice its share of the first n pixels of the list. */
static bool well_spread(const uint32_t *order, uint32_t n)
{
    uint32_t blocks[64] = {0};
    for (uint32_t i = 0; i < n; i++)
        blocks[order[i] / 256 / 32 * 8 + order[i] % 256 / 32]++;
    for (size_t b = 0; b < COUNT(blocks); b++)
        if (2 * 64 * blocks[b] < n || 64 * blocks[b] > 2 * n)
            return false;
    return true;
}

static void segments_are_well_spread(void **state)
{
    (void)state;
    listing l = list_pixels(256, 256, 8.0);
    for (uint32_t s = 0; s < l.segments; s++)
        assert_true(well_spread(l.order + l.starts[s], l.starts[s + 1] - l.starts[s]));
    uint32_t n = l.starts[1];
    for (uint32_t i = 0; i < l.pixels; i++)
        l.order[i] = i;
    assert_false(well_spread(l.order, n)); /* scan lines */
    free(l.order);
}

static void tiles_cover_the_image(void **state)
{
    (void)state;
    enum { width = 70, height = 45, side = 32 };
    uint32_t local[side * side], placed[side * side], starts[HALTON_MAX_SEGMENTS + 1], segments,
        seen[width * height] = {0};
    for (uint32_t y = 0; y < height; y += side)
        for (uint32_t x = 0; x < width; x += side) {
            halton_tile t = {x, y, width - x < side ? width - x : side, height - y < side ? height - y : side};
            assert_int_equal(halton_order(t.width, t.height, 8.0, local, starts, &segments), HALTON_OK);
            assert_int_equal(halton_tile_order(width, height, t, local, placed), HALTON_OK);
            for (uint32_t i = 0; i < t.width * t.height; i++) {
                assert_int_equal(placed[i], (y + local[i] / t.width) * width + x + local[i] % t.width);
                seen[placed[i]]++;
            }
            assert_int_equal(halton_tile_order(width, height, t, local, local), HALTON_OK); /* in place */
            assert_memory_equal(local, placed, sizeof *local * t.width * t.height);
        }
    for (size_t i = 0; i < COUNT(seen); i++)
        assert_int_equal(seen[i], 1);
}

static void bad_arguments(void **state)
{
    (void)state;
    uint32_t order[16], starts[HALTON_MAX_SEGMENTS + 1], n = 77;
    memset(starts, 0x11, sizeof starts);
    assert_int_equal(halton_order(0, 4, 8.0, order, starts, &n), HALTON_ERROR_SIZE);
    assert_int_equal(halton_order(4, 0, 8.0, order, starts, &n), HALTON_ERROR_SIZE);
    assert_int_equal(halton_order(65536, 65536, 8.0, order, starts, &n), HALTON_ERROR_SIZE);
    assert_int_equal(halton_order(UINT32_MAX, UINT32_MAX, 8.0, order, starts, &n), HALTON_ERROR_SIZE);
    static const double bad[] = {0.0, -0.0, -1.0, NAN, INFINITY, -INFINITY};
    for (size_t i = 0; i < COUNT(bad); i++)
        assert_int_equal(halton_order(4, 4, bad[i], order, starts, &n), HALTON_ERROR_CE);
    assert_int_equal(halton_order(4, 4, 8.0, NULL, starts, &n), HALTON_ERROR_NULL);
    assert_int_equal(halton_order(4, 4, 8.0, order, NULL, &n), HALTON_ERROR_NULL);
    assert_int_equal(halton_order(4, 4, 8.0, order, starts, NULL), HALTON_ERROR_NULL);
    assert_int_equal(halton_segments(0, 8.0, starts, &n), HALTON_ERROR_SIZE);
    assert_int_equal(n, 77);
    assert_int_equal(starts[0], 0x11111111);

    halton_tile outside[] = {{1, 0, 4, 4},          {0, 1, 4, 4}, {UINT32_MAX, 0, 4, 4},
                             {0, UINT32_MAX, 4, 4}, {0, 0, 0, 4}, {0, 0, 4, 0}};
    for (size_t i = 0; i < COUNT(outside); i++)
        assert_int_equal(halton_tile_order(4, 4, outside[i], order, order), HALTON_ERROR_SIZE);
    halton_tile whole = {0, 0, 4, 4};
    assert_int_equal(halton_tile_order(65536, 65536, whole, order, order), HALTON_ERROR_SIZE);
    assert_int_equal(halton_tile_order(4, 4, whole, NULL, order), HALTON_ERROR_NULL);
    assert_int_equal(halton_tile_order(4, 4, whole, order, NULL), HALTON_ERROR_NULL);

    assert_string_not_equal(halton_status_text(HALTON_ERROR_SIZE), halton_status_text(HALTON_ERROR_CE));
    assert_string_equal(halton_status_text((halton_status)99), "unknown status");
}

static void morton_codes(void **state)
{
    (void)state;
    assert_true(halton_morton(1, 0) == 1);
    assert_true(halton_morton(0, 1) == 2);
    assert_true(halton_morton(5, 3) == 27); /* 101, 011 -> 011011 */
    assert_true(halton_morton(UINT32_MAX, 0) == 0x5555555555555555u);
    assert_true(halton_morton(0, UINT32_MAX) == 0xaaaaaaaaaaaaaaaau);
    for (uint32_t i = 0; i < 100000; i++) {
        uint32_t x = i * 2654435761u, y = ~i * 2246822519u, rx, ry;
        uint64_t code = halton_morton(x, y);
        assert_true(code == plain_morton(x, y));
        halton_morton_decode(code, &rx, &ry);
        assert_true(rx == x && ry == y);
    }
}

static void radical_inverses(void **state)
{
    (void)state;
    static const double two[] = {0, 1.0 / 2, 1.0 / 4, 3.0 / 4, 1.0 / 8, 5.0 / 8, 3.0 / 8, 7.0 / 8, 1.0 / 16};
    static const double three[] = {0, 1.0 / 3, 2.0 / 3, 1.0 / 9, 4.0 / 9, 7.0 / 9, 2.0 / 9, 5.0 / 9, 8.0 / 9, 1.0 / 27};
    for (uint64_t i = 0; i < COUNT(two); i++)
        assert_true(halton_radical_inverse2(i) == two[i]);
    for (uint64_t i = 0; i < COUNT(three); i++)
        assert_true(halton_radical_inverse3(i) == three[i]);
    assert_true(halton_radical_inverse2(UINT64_MAX) == 1.0 - 0x1p-53);
    assert_true(halton_radical_inverse2(1ull << 63) == 0.0);
    assert_true(halton_radical_inverse3(UINT64_MAX) < 1.0);
    assert_true(halton_radical_inverse3(5559060566555522u) < 1.0); /* 3^33 - 1: all digits are 2 */
    assert_true(halton_radical_inverse3(5559060566555522u) > 0.9999999999999996);

    assert_true(halton_reverse2(6, 3) == 3 && halton_reverse2(6, 4) == 6 && halton_reverse2(6, 0) == 0);
    assert_true(halton_reverse2(1, 64) == 1ull << 63 && halton_reverse2(1, 99) == 1ull << 63);
    assert_true(halton_reverse3(5, 2) == 7 && halton_reverse3(5, 3) == 21 && halton_reverse3(5, 0) == 0);
    assert_true(halton_reverse3(1, 40) == 4052555153018976267u); /* 3^39 */
    assert_true(halton_reverse3(1, 64) == 4052555153018976267u);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_pixel_once),
        cmocka_unit_test(equals_the_plain_way),
        cmocka_unit_test(sorted_inside_segments),
        cmocka_unit_test(segment_boundaries),
        cmocka_unit_test(segment_count_is_bounded),
        cmocka_unit_test(segments_are_well_spread),
        cmocka_unit_test(tiles_cover_the_image),
        cmocka_unit_test(bad_arguments),
        cmocka_unit_test(morton_codes),
        cmocka_unit_test(radical_inverses),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
