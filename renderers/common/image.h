/* SPDX-License-Identifier: Apache-2.0 */
/* Float images and their files. */
#ifndef COMMON_IMAGE_H
#define COMMON_IMAGE_H

#include "message.h"
#include "vec.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct image {
    uint32_t width, height;
    rgb *pixels; /* width * height, row 0 on top, linear */
} image;

image image_new(uint32_t width, uint32_t height); /* black */
void image_free(image *i);
/* The part that begins at (x, y) and lies within. */
image image_cut(const image *from, uint32_t x, uint32_t y, uint32_t width, uint32_t height);

/* Reads .hdr (Radiance RGBE) or .exr (scan lines or tiles, none/RLE/ZIP/ZIPS/PIZ/PXR24/B44; half, float or uint R, G, B
 * or luminance Y). On failure *out is empty and err says in one line what is wrong. */
bool image_load(const char *path, image *out, message *err);
/* The same for OpenEXR files with R, G, B alone: what other images are measured against must not be grey by mistake. */
bool image_load_exr(const char *path, image *out, message *err);
/* The same of files with 32-bit floats, as exr_save writes them, with the texts of attributes ("" where there is none).
 */
typedef struct exr_text {
    const char *name;
    char value[256];
} exr_text;
bool image_load_exr_texts(const char *path, exr_text *texts, size_t count, image *out, message *err);

/* --- EXR out: named layers of float channels, metadata as string/float/int attributes --- */
typedef struct exr_channel {
    const char *name;  /* "R", "depth.Z", "normal.X" ... */
    const float *data; /* first pixel */
    size_t stride;     /* in floats, from pixel to pixel */
} exr_channel;

typedef struct exr_attribute {
    const char *name, *text;
} exr_attribute;

typedef struct exr_options {
    bool half;  /* 16-bit instead of 32-bit floats; values beyond 65504 are clamped */
    bool tiles; /* 64 x 64 tiles instead of scan lines */
} exr_options;

/* All writers write beside the target and rename: no half file ever stands under `path`. */
bool exr_save(const char *path, uint32_t width, uint32_t height, const exr_channel *channels, size_t channel_count,
              const exr_attribute *attributes, size_t attribute_count, exr_options options, message *err);
/* 8-bit sRGB of exposure * pixel; `texts` become tEXt chunks. */
bool png_save(const char *path, const image *i, float exposure, const exr_attribute *texts, size_t text_count,
              message *err);

#endif
