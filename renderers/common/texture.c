/* SPDX-License-Identifier: Apache-2.0 */
/* Decoding of texture images. */
#include "scene_import.h"

#include <limits.h>
#include <stb/stb_image.h>
#include <string.h>

/* 16384 x 16384: a small file must not claim all memory. */
#define MAX_PIXELS 0x10000000

bool texture_decode(const void *bytes, size_t size, texture *out, message *err)
{
    int width = 0, height = 0, channels = 0;
    if (size > INT_MAX || !stbi_info_from_memory(bytes, (int)size, &width, &height, &channels))
        return fail(err, "unknown image format");
    if (width <= 0 || height <= 0 || height > MAX_PIXELS / width)
        return fail(err, "image too large");
    stbi_uc *pixels = stbi_load_from_memory(bytes, (int)size, &width, &height, &channels, 4);
    if (!pixels)
        return fail(err, "damaged image");
    size_t total = 4 * (size_t)width * (size_t)height;
    *out = (texture){.width = (uint32_t)width, .height = (uint32_t)height, .rgba = xmalloc(total)};
    memcpy(out->rgba, pixels, total);
    stbi_image_free(pixels);
    return true;
}
