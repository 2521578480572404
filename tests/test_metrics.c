/* SPDX-License-Identifier: Apache-2.0 */
/* Image errors on examples small enough to work out by hand. */
#include "metrics.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after message.h, whose fail() is a macro there */

static void near(double value, double want)
{
    if (!(fabs(value - want) <= 1e-6 * (1e-3 + fabs(want))))
        fail_msg("%.12g is not %.12g", value, want);
}

static image grey(uint32_t width, uint32_t height, float value)
{
    image i = image_new(width, height);
    for (size_t p = 0; p < (size_t)width * height; ++p)
        i.pixels[p] = v3(value, value, value);
    return i;
}

static void equal_images_have_no_error(void **state)
{
    (void)state;
    image a = grey(5, 3, 0.7f);
    image_error e = image_compare(&a, &a);
    assert_true(e.l_inf == 0.0 && e.rel_mse == 0.0 && e.p999 == 0.0 && e.max == 0.0);
    image_free(&a);
}

static void two_pixels_by_hand(void **state)
{
    (void)state;
    image a = image_new(2, 1), b = image_new(2, 1);
    b.pixels[0] = v3(1.0f, 2.0f, 3.0f);
    b.pixels[1] = v3(0.0f, 0.5f, 1.5f);
    a.pixels[0] = v3(1.5f, 2.0f, 2.0f);
    a.pixels[1] = v3(0.25f, 0.5f, 1.5f);
    image_error e = image_compare(&a, &b);
    near(e.l_inf, 1.75 / 8.0);
    near(e.rel_mse, ((0.25 / 1.01 + 1.0 / 9.01) / 3 + (0.0625 / 0.01) / 3) / 2);
    double mean = (0.2126 + 2 * 0.7152 + 3 * 0.0722 + 0.5 * 0.7152 + 1.5 * 0.0722) / 2;
    near(e.max, 0.2126 * 0.25 / mean); /* the first pixel: |0.1063 - 0.0722| is less */
    near(e.p999, e.max);               /* of two pixels the percentile is the larger */
    image_free(&a);
    image_free(&b);
}

/* 2000 pixels: two outliers are trimmed from rel_mse, and the 1998th value is the percentile. */
static void outliers_are_trimmed(void **state)
{
    (void)state;
    image a = grey(50, 40, 1.1f), b = grey(50, 40, 1.0f);
    a.pixels[700] = v3(101, 101, 101);
    a.pixels[1300] = v3(51, 51, 51);
    image_error e = image_compare(&a, &b);
    double d = (double)1.1f - 1.0;
    near(e.rel_mse, d * d / 1.01);
    near(e.p999, d);
    near(e.max, 100.0);
    near(e.l_inf, (1998 * d + 150) / 2000);
    a.pixels[3] = v3(11, 11, 11); /* a third outlier stays in */
    e = image_compare(&a, &b);
    near(e.rel_mse, (1997 * d * d + 100) / 1.01 / 1998);
    near(e.p999, 10.0);
    image_free(&a);
    image_free(&b);
}

/* 1000 pixels: 0.999 * 1000 must not round up to the maximum. */
static void percentile_is_exact_at_1000(void **state)
{
    (void)state;
    image a = grey(40, 25, 1.0f), b = grey(40, 25, 1.0f);
    a.pixels[5] = v3(3, 3, 3);
    a.pixels[6] = v3(2, 2, 2);
    image_error e = image_compare(&a, &b);
    near(e.p999, 1.0);
    near(e.max, 2.0);
    image_free(&a);
    image_free(&b);
}

static void non_finite_pixels_are_seen(void **state)
{
    (void)state;
    static const float bad[3] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 3; ++k) {
        image a = grey(2, 2, 1.0f), b = grey(2, 2, 1.0f);
        b.pixels[0] = a.pixels[0] = v3(4.0f, 4.0f, 4.0f); /* the maximum */
        a.pixels[3] = v3(1.0f, bad[k], 1.0f);
        image_error e = image_compare(&a, &b);
        near(e.l_inf, 3 * 4.0 / (3 * 7.0));
        near(e.rel_mse, 16.0 / 1.01 / 4);
        near(e.max, 4.0 / (7.0 / 4));
        /* in the reference: its pixel counts as black in the sums */
        e = image_compare(&b, &a);
        near(e.l_inf, 3 * 4.0 / (3 * 6.0));
        near(e.rel_mse, 16.0 / 0.01 / 4);
        near(e.max, 4.0 / (6.0 / 4));
        image_free(&a);
        image_free(&b);
    }
}

static void black_reference(void **state)
{
    (void)state;
    image a = grey(3, 3, 0.0f), b = grey(3, 3, 0.0f);
    image_error e = image_compare(&a, &b);
    assert_true(e.l_inf == 0.0 && e.rel_mse == 0.0 && e.p999 == 0.0 && e.max == 0.0);
    a.pixels[4] = v3(0.1f, 0.1f, 0.1f);
    e = image_compare(&a, &b);
    assert_true(isinf(e.l_inf) && isinf(e.p999) && isinf(e.max));
    near(e.rel_mse, 0.01 / 0.01 / 9);
    a.pixels[4] = v3(NAN, 0, 0);
    e = image_compare(&a, &b);
    assert_true(isinf(e.l_inf) && isinf(e.rel_mse) && isinf(e.p999) && isinf(e.max));
    image_free(&a);
    image_free(&b);
}

static void other_sizes_are_infinitely_wrong(void **state)
{
    (void)state;
    image a = grey(3, 2, 1.0f), b = grey(2, 3, 1.0f), none = {0, 0, NULL};
    image_error e = image_compare(&a, &b);
    assert_true(isinf(e.l_inf) && isinf(e.rel_mse) && isinf(e.p999) && isinf(e.max));
    e = image_compare(&none, &none);
    assert_true(e.l_inf == 0.0 && e.max == 0.0);
    image_free(&a);
    image_free(&b);
}

static void difference_goes_from_grey_to_red(void **state)
{
    (void)state;
    image a = grey(4, 1, 1.0f), b = grey(4, 1, 1.0f);
    a.pixels[1] = v3(1.0f, 0.75f, 1.0f);
    a.pixels[2] = v3(9.0f, 1.0f, 1.0f);
    a.pixels[3] = v3(NAN, 1.0f, 1.0f);
    image d = image_difference(&a, &b, 2.0f);
    assert_int_equal(d.width, 4);
    assert_int_equal(d.height, 1);
    near(d.pixels[0].x, 0.05f);
    near(d.pixels[0].y, 0.05f);
    near(d.pixels[1].x, 0.525f);
    near(d.pixels[1].z, 0.025f);
    for (int p = 2; p < 4; ++p) {
        near(d.pixels[p].x, 1.0);
        near(d.pixels[p].y, 0.0);
        near(d.pixels[p].z, 0.0);
    }
    image_free(&a);
    image_free(&b);
    image_free(&d);
}

static void pictures_stand_side_by_side(void **state)
{
    (void)state;
    image a = grey(2, 3, 1.0f), b = grey(1, 3, 2.0f), c = grey(3, 3, 3.0f);
    const image *all[3] = {&a, &b, &c};
    image s = image_side_by_side(all, 3);
    assert_int_equal(s.width, 2 + 4 + 1 + 4 + 3);
    assert_int_equal(s.height, 3);
    static const float row[14] = {1, 1, 0, 0, 0, 0, 2, 0, 0, 0, 0, 3, 3, 3};
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < 14; ++x)
            assert_true(s.pixels[14 * y + x].y == row[x]);
    image_free(&s);
    s = image_side_by_side(all, 1);
    assert_int_equal(s.width, 2);
    image_free(&s);
    s = image_side_by_side(all, 0);
    assert_int_equal(s.width, 0);
    image_free(&s);
    image_free(&a);
    image_free(&b);
    image_free(&c);
}

static void exposure_maps_bright_to_09(void **state)
{
    (void)state;
    image a = image_new(100, 1); /* luminance 1 ... 100 */
    for (int x = 0; x < 100; ++x)
        a.pixels[x] = v3((float)(100 - x), (float)(100 - x), (float)(100 - x));
    near(image_exposure(&a), 0.9 / 99);
    a.pixels[50] = v3(NAN, 0, 0); /* left out: the 99th of 99 values */
    near(image_exposure(&a), 0.9 / 100);
    image_free(&a);

    a = grey(100, 10, 0.0f);
    near(image_exposure(&a), 1.0);
    a.pixels[0] = v3(5, 5, 5);
    near(image_exposure(&a), 0.9 / 5);
    image_free(&a);
    near(image_exposure(&a), 1.0); /* empty */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equal_images_have_no_error),
        cmocka_unit_test(two_pixels_by_hand),
        cmocka_unit_test(outliers_are_trimmed),
        cmocka_unit_test(percentile_is_exact_at_1000),
        cmocka_unit_test(non_finite_pixels_are_seen),
        cmocka_unit_test(black_reference),
        cmocka_unit_test(other_sizes_are_infinitely_wrong),
        cmocka_unit_test(difference_goes_from_grey_to_red),
        cmocka_unit_test(pictures_stand_side_by_side),
        cmocka_unit_test(exposure_maps_bright_to_09),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
