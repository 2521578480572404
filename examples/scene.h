/* SPDX-License-Identifier: Apache-2.0 */
/* What the examples render: balls on a square floor under many small lamps. Nothing here knows of the cache. */
#ifndef EXAMPLES_SCENE_H
#define EXAMPLES_SCENE_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { WIDTH = 160, HEIGHT = 90, PIXELS = WIDTH * HEIGHT, SAMPLES = 4, BALLS = 25, LAMPS = 128 };
static const float bounds_min[3] = {-8, -8, 0}, bounds_max[3] = {8, 8, 6};

typedef struct vec {
    float x, y, z;
} vec;

/* clang-format off */
static inline vec v(float x, float y, float z) { vec r = {x, y, z}; return r; }
static inline vec add(vec a, vec b) { return v(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline vec sub(vec a, vec b) { return v(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline vec scale(vec a, float s) { return v(a.x * s, a.y * s, a.z * s); }
static inline float dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline vec unit(vec a) { return scale(a, 1.0f / sqrtf(dot(a, a))); }
static inline vec at(const float p[3]) { return v(p[0], p[1], p[2]); }
/* clang-format on */

typedef struct ball {
    vec center;
    float radius;
} ball;

static ball balls[BALLS];

/* `moved`: how far the balls have rolled. */
static inline void make_scene(float moved)
{
    for (int i = 0; i < BALLS; i++) {
        balls[i].radius = 0.5f + 0.06f * (float)(i * 7 % 10);
        balls[i].center = v((float)(i % 5) * 2.6f - 5.2f + moved, (float)(i / 5) * 2.6f - 5.2f,
                            balls[i].radius + 0.3f * (float)(i * 3 % 4));
    }
}

/* Hung in rows, with some disorder. */
static inline vec lamp_at(int i)
{
    return v((float)(i % 16) * 0.9f - 6.7f + 0.03f * (float)(i * 11 % 13),
             (float)(i / 16) * 1.8f - 6.3f + 0.03f * (float)(i * 5 % 17), 4.5f + 0.1f * (float)(i * 7 % 11));
}

/* Where o + t d meets ball b at a distance above `from`; infinity where it does not. */
static inline float meet(const ball *b, vec o, vec d, float from)
{
    vec to = sub(o, b->center);
    float dd = dot(d, d), bd = dot(to, d), root = bd * bd - dd * (dot(to, to) - b->radius * b->radius);
    if (root < 0.0f)
        return INFINITY;
    root = sqrtf(root);
    float near = (-bd - root) / dd, far = (-bd + root) / dd;
    return near > from ? near : far > from ? far : INFINITY;
}

typedef struct hit {
    vec position, normal;
    float distance, cosine; /* of the arriving ray with the normal */
} hit;

static inline bool trace_ray(vec o, vec d, hit *h)
{
    const ball *nearest = NULL;
    float t = d.z < 0.0f ? -o.z / d.z : INFINITY;
    vec p = add(o, scale(d, t));
    if (!(t > 1e-3f && fabsf(p.x) < 8.0f && fabsf(p.y) < 8.0f))
        t = INFINITY;
    for (int i = 0; i < BALLS; i++) {
        float u = meet(&balls[i], o, d, 1e-3f);
        if (u < t)
            t = u, nearest = &balls[i];
    }
    if (!(t < INFINITY))
        return false;
    h->position = add(o, scale(d, t));
    h->normal = nearest ? unit(sub(h->position, nearest->center)) : v(0, 0, 1);
    h->distance = t;
    h->cosine = fabsf(dot(h->normal, d));
    return true;
}

/* The question that the cache answers. */
static inline bool occluded(vec a, vec b)
{
    for (int i = 0; i < BALLS; i++)
        if (meet(&balls[i], a, sub(b, a), 1e-3f) < 1.0f)
            return true;
    return false;
}

/* What lamp `i` brings to a grey surface if nothing is in the way. */
static inline float light_of(const hit *h, int i)
{
    vec to = sub(lamp_at(i), h->position);
    float square = dot(to, to), cosine = dot(to, h->normal) / sqrtf(square);
    return cosine > 0.0f ? 0.3f * cosine / square : 0.0f;
}

/* The width of a pixel at a distance of 1. */
static const float pixel_width = 2.0f * 0.42f / HEIGHT;

/* The ray through sample `k` of a pixel, from a camera that can move sideways; what it meets first. */
static inline bool see(int pixel, int k, float aside, hit *h)
{
    const vec forward = {0.22f, 0.83f, -0.51f}, right = {0.967f, -0.256f, 0.0f}, up = {0.131f, 0.493f, 0.859f};
    float x = (float)(pixel % WIDTH) + 0.25f + 0.5f * (float)(k % 2);
    float y = (float)(pixel / WIDTH) + 0.25f + 0.5f * (float)(k / 2);
    vec across = scale(right, (x - 0.5f * WIDTH) * pixel_width), rise = scale(up, (0.5f * HEIGHT - y) * pixel_width);
    return trace_ray(v(-2.5f + aside, -10.0f, 6.5f), unit(add(forward, add(across, rise))), h);
}

/* Sum of differences over the sum of the exact image. */
static inline double image_error(const float *image, const float *exact, size_t count)
{
    double difference = 0.0, sum = 0.0;
    for (size_t i = 0; i < count; i++)
        difference += fabs((double)image[i] - (double)exact[i]), sum += (double)exact[i];
    return difference / sum;
}

static inline bool write_ppm(const char *path, const float *grey)
{
    FILE *f = fopen(path, "wb");
    if (!f) {
        perror(path);
        return false;
    }
    fprintf(f, "P6\n%d %d\n255\n", WIDTH, HEIGHT);
    for (int i = 0; i < PIXELS; i++) {
        float g = grey[i] < 1.0f ? sqrtf(grey[i]) : 1.0f;
        for (int k = 0; k < 3; k++)
            fputc((int)(255.0f * g), f);
    }
    bool fine = !ferror(f);
    if (fclose(f) == 0 && fine)
        return true;
    perror(path);
    return false;
}

#endif
