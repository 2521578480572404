/* SPDX-License-Identifier: Apache-2.0 */
/* The pinhole camera: directions and projections undo each other, and pixels fill the image. */
#include "camera.h"
#include "scene_support.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h> /* after ours: it defines a macro fail() */

static const uint32_t sizes[][2] = {{1, 1}, {7, 3}, {3, 7}, {640, 480}, {1921, 1081}, {1, 100}, {33, 32}};
static const float yfovs[] = {0.01f, 0.7f, 2.6f};
enum { SIZES = sizeof sizes / sizeof *sizes, YFOVS = sizeof yfovs / sizeof *yfovs };

static camera_frame frame_of(int size, int yfov)
{
    camera c = camera_look(v3(1, -2, 0.5f), v3(3, 1, 2), v3(0.1f, 1, 0), yfovs[yfov]);
    return camera_frame_of(&c, sizes[size][0], sizes[size][1]);
}

static void projection_undoes_direction(void **state)
{
    (void)state;
    rng r = rng_make(1, 1);
    for (int k = 0; k < SIZES * YFOVS; k++) {
        camera_frame f = frame_of(k % SIZES, k / SIZES);
        for (int i = 0; i < 2000; i++) {
            float cosine, again = 0, px = 0, py = 0, far = 0.5f + 100.0f * rng_float(&r);
            float x = (0.001f + 0.998f * rng_float(&r)) * (float)f.width;
            float y = (0.001f + 0.998f * rng_float(&r)) * (float)f.height;
            vec3 d = camera_direction(&f, x, y, &cosine);
            assert_true(fabsf(v3_length(d) - 1.0f) < 1e-6f);
            assert_true(fabsf(v3_dot(d, f.forward) - cosine) < 1e-6f);
            assert_true(camera_project(&f, v3_mad(f.eye, far, d), &px, &py, &again));
            /* the point is rounded to ulps of the eye's coordinates, the pixel to those of the image's size */
            float pixels = (1e-6f + 5e-7f / far) / (cosine * cosine * f.pixel) + 1e-6f * (float)(f.width + f.height);
            assert_true(fabsf(px - x) < pixels && fabsf(py - y) < pixels);
            assert_true(fabsf(again - cosine) < 1e-5f * cosine + 1e-6f);
        }
    }
}

static void corners_and_middle(void **state)
{
    (void)state;
    for (int k = 0; k < SIZES * YFOVS; k++) {
        camera_frame f = frame_of(k % SIZES, k / SIZES);
        float w = (float)f.width, h = (float)f.height, cosine;
        vec3 middle = camera_direction(&f, 0.5f * w, 0.5f * h, &cosine);
        assert_true(v3_dot(middle, f.forward) > 0.999999f && fabsf(cosine - 1.0f) < 1e-6f);
        vec3 left = camera_direction(&f, 0.0f, 0.0f, &cosine), right = camera_direction(&f, w, h, &cosine);
        assert_true(v3_dot(left, f.right) < 0.0f && v3_dot(left, f.up) > 0.0f);
        assert_true(v3_dot(right, f.right) > 0.0f && v3_dot(right, f.up) < 0.0f);
        vec3 top = camera_direction(&f, 0.5f * w, 0.0f, &cosine); /* half of the vertical angle */
        assert_true(fabsf(v3_dot(top, f.up) - sinf(0.5f * yfovs[k / SIZES])) < 1e-5f);
        vec3 side = camera_direction(&f, w, 0.5f * h, &cosine);
        assert_true(fabsf(v3_dot(side, f.right) / cosine - w / h * tanf(0.5f * yfovs[k / SIZES])) < 1e-5f * w);
        assert_true(fabsf(f.plane_height - h * f.pixel) < 1e-5f * f.plane_height);
        assert_true(fabsf(f.plane_width - w * f.pixel) < 1e-5f * f.plane_width);
    }
}

static void what_is_outside_is_not_seen(void **state)
{
    (void)state;
    for (int k = 0; k < SIZES * YFOVS; k++) {
        camera_frame f = frame_of(k % SIZES, k / SIZES);
        float w = (float)f.width, h = (float)f.height, x, y, cosine, off = 0.01f;
        const float outside[][2] = {
            {-off * w, 0.5f * h}, {w + off * w, 0.5f * h}, {0.5f * w, -off * h}, {0.5f * w, h + off * h}};
        for (int i = 0; i < 4; i++) {
            vec3 d = camera_direction(&f, outside[i][0], outside[i][1], &cosine);
            assert_false(camera_project(&f, v3_mad(f.eye, 10.0f, d), &x, &y, &cosine));
        }
        vec3 d = camera_direction(&f, 0.3f * w, 0.6f * h, &cosine);
        assert_true(camera_project(&f, v3_mad(f.eye, 10.0f, d), &x, &y, &cosine));
        assert_false(camera_project(&f, v3_mad(f.eye, -10.0f, d), &x, &y, &cosine));
        assert_false(camera_project(&f, f.eye, &x, &y, &cosine));
    }
}

/* Of a rectangular pyramid: by half the sides of its base at distance 1. */
static double solid_angle(double a, double b)
{
    return 4.0 * atan2(a * b, sqrt(1.0 + a * a + b * b));
}

/* Mean of 1 / density over random points of a pixel is its solid angle: taken at many points of each, they fill the
 * image's. */
static void pixels_fill_the_image(void **state)
{
    (void)state;
    for (int k = 0; k < SIZES * YFOVS; k++) {
        camera_frame f = frame_of(k % SIZES, k / SIZES);
        int across = 1 + 600 / (int)f.width, along = 1 + 600 / (int)f.height;
        double sum = 0.0, half = tan(0.5 * (double)yfovs[k / SIZES]), wide = half * f.width / f.height;
        for (int y = 0; y < (int)f.height * along; y++)
            for (int x = 0; x < (int)f.width * across; x++) {
                float cosine;
                camera_direction(&f, ((float)x + 0.5f) / (float)across, ((float)y + 0.5f) / (float)along, &cosine);
                sum += 1.0 / ((double)camera_pixel_pdf(&f, cosine) * across * along);
            }
        assert_true(fabs(sum / solid_angle(wide, half) - 1.0) < 1e-3);
    }
}

static void cones_have_the_solid_angle_of_pixels(void **state)
{
    (void)state;
    rng r = rng_make(2, 1);
    for (int k = 0; k < SIZES * YFOVS; k++) {
        camera_frame f = frame_of(k % SIZES, k / SIZES);
        for (int i = 0; i < 100; i++) {
            float distance, x = (rng_float(&r) - 0.5f) * f.plane_width, y = (rng_float(&r) - 0.5f) * f.plane_height;
            vec3 d = camera_plane_direction(&f, x, y, &distance);
            float spread = camera_spread(&f, distance), pdf = camera_pixel_pdf(&f, 1.0f / distance);
            assert_true(fabsf(spread * spread * pdf - 1.0f) < 1e-5f);
            assert_true(fabsf(v3_dot(d, f.right) * distance - x) < 1e-6f * (f.plane_width + 1.0f));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(projection_undoes_direction),          cmocka_unit_test(corners_and_middle),
        cmocka_unit_test(what_is_outside_is_not_seen),          cmocka_unit_test(pixels_fill_the_image),
        cmocka_unit_test(cones_have_the_solid_angle_of_pixels),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
