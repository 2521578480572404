/* SPDX-License-Identifier: Apache-2.0 */
/* Rays of a pinhole camera, and where points are seen. */
#ifndef COMMON_CAMERA_H
#define COMMON_CAMERA_H

#include "scene.h"

/* Pinhole camera of one image. Image plane at distance 1; pixels are squares of side `pixel` on it. */
typedef struct camera_frame {
    vec3 eye, forward, right, up; /* the last three unit and perpendicular */
    float pixel;
    uint32_t width, height;          /* of the image, pixels */
    float plane_width, plane_height; /* of the image on its plane */
} camera_frame;

static inline camera_frame camera_frame_of(const camera *c, uint32_t width, uint32_t height)
{
    float h = 2.0f * tanf(0.5f * c->yfov);
    return (camera_frame){.eye = c->eye,
                          .forward = c->forward,
                          .right = v3_cross(c->forward, c->up),
                          .up = c->up,
                          .pixel = h / (float)height,
                          .width = width,
                          .height = height,
                          .plane_width = h * (float)width / (float)height,
                          .plane_height = h};
}

/* Unit direction through the point of the image plane `right` and `up` of its centre. *distance: of the point, 1 over
 * the direction's cosine with forward. */
static inline vec3 camera_plane_direction(const camera_frame *f, float right, float up, float *distance)
{
    vec3 d = v3_mad(v3_mad(f->forward, right, f->right), up, f->up);
    *distance = v3_length(d);
    return v3_scale(d, 1.0f / *distance);
}

/* Unit direction through (x, y) in pixels, (0, 0) the upper left corner; *cosine with forward. */
static inline vec3 camera_direction(const camera_frame *f, float x, float y, float *cosine)
{
    float distance;
    vec3 d = camera_plane_direction(f, (x - 0.5f * (float)f->width) * f->pixel,
                                    (0.5f * (float)f->height - y) * f->pixel, &distance);
    *cosine = 1.0f / distance;
    return d;
}

/* Where a point is seen, in pixels: 0 <= x < width, 0 <= y < height; false outside of the image or behind the camera.
 * *cosine of the direction with forward. */
static inline bool camera_project(const camera_frame *f, vec3 point, float *x, float *y, float *cosine)
{
    vec3 d = v3_sub(point, f->eye);
    float depth = v3_dot(d, f->forward);
    if (!(depth > 0.0f))
        return false;
    *cosine = depth / v3_length(d);
    *x = 0.5f * (float)f->width + v3_dot(d, f->right) / (depth * f->pixel);
    *y = 0.5f * (float)f->height - v3_dot(d, f->up) / (depth * f->pixel);
    return *x >= 0.0f && *x < (float)f->width && *y >= 0.0f && *y < (float)f->height;
}

/* Density per steradian of a direction through a random point of one pixel: a pixel subtends pixel^2 cosine^3
 * steradians. */
static inline float camera_pixel_pdf(const camera_frame *f, float cosine)
{
    return 1.0f / (f->pixel * f->pixel * cosine * cosine * cosine);
}

/* Width of the cone of a pixel per unit of distance: the root of its solid angle. `distance` is
 * camera_plane_direction's: 1 / cosine. */
static inline float camera_spread(const camera_frame *f, float distance)
{
    return f->pixel / (distance * sqrtf(distance));
}

#endif
