/* SPDX-License-Identifier: Apache-2.0 */
/* FLIP against values of the authors' own tool. */
#include "flip.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after message.h, whose fail() is a macro there */

enum { WIDTH = 48, HEIGHT = 40 };

/* Colours, edges and flat squares, in [0, gain], by formula; `other`: some squares are brighter in it, unequally by
 * channel. */
static image pattern(float gain, bool other)
{
    image out = image_new(WIDTH, HEIGHT);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            float *c = &out.pixels[y * WIDTH + x].x;
            for (int k = 0; k < 3; k++) {
                float v = (float)((x * 7 + y * 13 + k * 29 + x * y % 11 * 5) % 64) / 63.0f;
                float more = other && (x / 8 + y / 8) % 3 == 0 ? 0.25f * (float)(k + 1) / 3.0f : 0.0f;
                c[k] = fminf(1.0f, v * v + more);
                if (gain != 1.0f)
                    c[k] = gain * c[k] * c[k];
            }
        }
    return out;
}

static void near(double value, double want, const char *what)
{
    if (!(fabs(value - want) <= 2e-5))
        fail_msg("%s: %.9g is not %.9g", what, value, want);
}

/* Means and pixels as the package flip-evaluator 1.7 of the method's authors gives them for the same pictures:
 * evaluate(reference, test, "LDR" or "HDR", inputsRGB=False, applyMagma=False). It computes in floats. */
static void authors_values(void **state)
{
    (void)state;
    static const double mean[2] = {0.2369167059659958, 0.3110625147819519};
    static const double at[2][3] = {{0.4199709892, 0.07299521565, 0.4766895175}, /* (0, 0), (24, 20), (47, 39) */
                                    {0.6635463238, 0.08555965126, 0.5981884599}};
    for (int hdr = 0; hdr < 2; hdr++) {
        image a = pattern(hdr ? 16.0f : 1.0f, true), b = pattern(hdr ? 16.0f : 1.0f, false);
        float map[WIDTH * HEIGHT];
        near(hdr ? flip_hdr(&a, &b, map) : flip_ldr(&a, &b, 1.0f, map), mean[hdr], "mean");
        near((double)map[0], at[hdr][0], "first pixel");
        near((double)map[20 * WIDTH + 24], at[hdr][1], "middle");
        near((double)map[WIDTH * HEIGHT - 1], at[hdr][2], "last pixel");
        image_free(&a);
        image_free(&b);
    }
}

static image flat(uint32_t width, uint32_t height, rgb colour)
{
    image out = image_new(width, height);
    for (size_t i = 0; i < (size_t)width * height; i++)
        out.pixels[i] = colour;
    return out;
}

/* Without edges what is left is the difference of two colours: Sect. 4.1.4 by hand for black and white, whose distance
 * is 100, and its end, green and blue. */
static void flat_pictures_by_hand(void **state)
{
    (void)state;
    image black = flat(5, 3, v3(0, 0, 0)), white = flat(5, 3, v3(1, 1, 1));
    image green = flat(5, 3, v3(0, 1, 0)), blue = flat(5, 3, v3(0, 0, 1));
    const double most = pow(203.3, 0.7); /* of green and blue, in CIELAB with the Hunt effect */
    double distance = pow(100.0, 0.7), d = flip_ldr(&white, &black, 1.0f, NULL);
    assert_true(distance > 0.4 * most);
    if (!(fabs(d - (0.95 + (distance - 0.4 * most) / (0.6 * most) * 0.05)) < 1e-3))
        fail_msg("black and white: %.6f", d);
    near(flip_ldr(&green, &blue, 1.0f, NULL), 1.0, "green and blue");
    near(flip_ldr(&white, &black, 0.0f, NULL), 0.0, "exposed to nothing");
    near(flip_ldr(&white, &white, 7.0f, NULL), 0.0, "equal");
    image_free(&black);
    image_free(&white);
    image_free(&green);
    image_free(&blue);
}

/* One pixel, none, and values that no picture has. */
static void odd_pictures(void **state)
{
    (void)state;
    image none = {0, 0, NULL}, one = flat(1, 1, v3(NAN, INFINITY, -1.0f)), other = flat(1, 1, v3(0.0f, 1.0f, 0.0f));
    assert_true(flip_ldr(&none, &none, 1.0f, NULL) == 0.0 && flip_hdr(&none, &none, NULL) == 0.0);
    near(flip_ldr(&one, &other, 1.0f, NULL), 0.0, "clamped");
    double d = flip_hdr(&one, &other, NULL), black = flip_hdr(&one, &one, NULL);
    assert_true(d > 0.0 && d <= 1.0 && black == 0.0);
    image_free(&one);
    image_free(&other);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(authors_values), cmocka_unit_test(flat_pictures_by_hand),
                                       cmocka_unit_test(odd_pictures)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
