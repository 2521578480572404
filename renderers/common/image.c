/* SPDX-License-Identifier: Apache-2.0 */
/* Images in memory, and reading of Radiance pictures (.hdr). stb_image is not used for these: it never returns from a
 * run-length coded picture that is cut off, and it shows damaged ones as if they were whole. */
#include "image.h"
#include "image_files.h"
#include "regular_file.h"
#include "scene.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

image image_new(uint32_t width, uint32_t height)
{
    return (image){width, height, xcalloc((size_t)width * height, sizeof(rgb))};
}

void image_free(image *i)
{
    free(i->pixels);
    *i = (image){0};
}

image image_cut(const image *from, uint32_t x, uint32_t y, uint32_t width, uint32_t height)
{
    image out = image_new(width, height);
    for (uint32_t row = 0; row < height; row++)
        memcpy(out.pixels + (size_t)row * width, from->pixels + (size_t)(y + row) * from->width + x,
               width * sizeof *out.pixels);
    return out;
}

bool image_new_checked(uint64_t width, uint64_t height, image *out, message *err)
{
    *out = (image){0};
    if (width == 0 || height == 0 || width > IMAGE_MAX_PIXELS || height > IMAGE_MAX_PIXELS / width)
        return fail(err, "%llu x %llu pixels are not a usable size", (unsigned long long)width,
                    (unsigned long long)height);
    rgb *pixels = calloc((size_t)(width * height), sizeof *pixels);
    if (!pixels)
        return fail(err, "no memory for %llu x %llu pixels", (unsigned long long)width, (unsigned long long)height);
    *out = (image){(uint32_t)width, (uint32_t)height, pixels};
    return true;
}

/* --- Radiance RGBE (Ward 1991, "Real pixels") --- */

typedef struct bytes {
    const unsigned char *at, *end;
} bytes;

static size_t left(const bytes *b)
{
    return (size_t)(b->end - b->at);
}

/* Copies the next line without its '\n', cut to `size`; false at the end of the data. */
static bool next_line(bytes *b, char *line, size_t size)
{
    const unsigned char *stop = memchr(b->at, '\n', left(b));
    if (!stop)
        return false;
    size_t length = (size_t)(stop - b->at);
    if (length >= size)
        length = size - 1;
    memcpy(line, b->at, length);
    line[length] = '\0';
    b->at = stop + 1;
    return true;
}

static bool hdr_header(bytes *b, uint64_t *width, uint64_t *height, message *err)
{
    char line[256];
    bool rgbe = false;
    do {
        if (!next_line(b, line, sizeof line))
            return fail(err, "the header is cut off");
        if (strncmp(line, "FORMAT=", 7) == 0) {
            rgbe = strcmp(line + 7, "32-bit_rle_rgbe") == 0;
            if (!rgbe)
                return fail(err, "only FORMAT=32-bit_rle_rgbe can be read");
        }
    } while (line[0] != '\0');
    if (!rgbe)
        return fail(err, "the header names no FORMAT");
    if (!next_line(b, line, sizeof line))
        return fail(err, "the header is cut off");
    unsigned long w, h;
    int used = 0;
    if (sscanf(line, "-Y %10lu +X %10lu%n", &h, &w, &used) != 2 || line[used] != '\0')
        return fail(err, "the picture size is not of the form '-Y height +X width'");
    *width = w;
    *height = h;
    return true;
}

/* One run-length coded component of a row into every fourth byte of `row`. */
static bool hdr_component(bytes *b, unsigned char *row, uint32_t width)
{
    for (uint32_t x = 0; x < width;) {
        if (left(b) < 2)
            return false;
        uint32_t count = *b->at++;
        bool run = count > 128;
        if (run)
            count -= 128;
        if (count > width - x || left(b) < (run ? 1 : count))
            return false;
        for (uint32_t i = 0; i < count; ++i, ++x)
            row[4 * x] = run ? b->at[0] : b->at[i];
        b->at += run ? 1 : count;
    }
    return true;
}

static bool hdr_row(bytes *b, unsigned char *row, uint32_t width)
{
    /* Rows of other widths are never run-length coded. */
    bool may_be_coded = width >= 8 && width < 32768;
    if (may_be_coded && left(b) >= 4 && b->at[0] == 2 && b->at[1] == 2 && b->at[2] < 128) {
        if ((uint32_t)(b->at[2] << 8 | b->at[3]) != width)
            return false;
        b->at += 4;
        for (int component = 0; component < 4; ++component)
            if (!hdr_component(b, row + component, width))
                return false;
        return true;
    }
    size_t size = 4 * (size_t)width;
    if (left(b) < size)
        return false;
    memcpy(row, b->at, size);
    b->at += size;
    return true;
}

static bool hdr_decode(const unsigned char *data, size_t size, image *out, message *err)
{
    bytes b = {data, data + size};
    uint64_t width = 0, height = 0;
    if (!hdr_header(&b, &width, &height, err))
        return false;
    /* A run of 127 pixels takes two bytes, so a short file cannot hold many: no absurd sizes are allocated. */
    if (height > 0 && width / 127 > left(&b) / height)
        return fail(err, "the file is too short for %llu x %llu pixels", (unsigned long long)width,
                    (unsigned long long)height);
    if (!image_new_checked(width, height, out, err))
        return false;
    unsigned char *row = xmalloc(4 * (size_t)width);
    bool good = true;
    for (uint32_t y = 0; y < out->height && good; ++y) {
        good = hdr_row(&b, row, out->width);
        rgb *to = out->pixels + (size_t)y * out->width;
        for (uint32_t x = 0; x < out->width && good; ++x) {
            const unsigned char *p = row + 4 * (size_t)x;
            float scale = p[3] ? ldexpf(1.0f, p[3] - (128 + 8)) : 0.0f;
            to[x] = v3(p[0] * scale, p[1] * scale, p[2] * scale);
        }
        if (!good)
            fail(err, "pixel row %u is damaged or cut off", (unsigned)y);
    }
    free(row);
    if (!good)
        image_free(out);
    return good;
}

/* --- any file --- */

static unsigned char *read_all(const char *path, size_t *size, message *err)
{
    message why;
    FILE *f = regular_open(path, size, &why);
    if (!f) {
        fail(err, "cannot read %s: %s", path, why.text);
        return NULL;
    }
    size_t wanted = *size;
    unsigned char *data = malloc(wanted + 1);
    if (!data) {
        fail(err, "cannot read %s: no memory for its %zu bytes", path, wanted);
    } else if ((*size = fread(data, 1, wanted, f)) != wanted) {
        fail(err, "cannot read %s: %s", path, ferror(f) ? strerror(errno) : "the file changed");
        free(data);
        data = NULL;
    }
    fclose(f);
    return data;
}

static bool load(const char *path, bool exr_alone, exr_text *texts, size_t count, image *out, message *err)
{
    *out = (image){0};
    size_t size = 0;
    unsigned char *data = read_all(path, &size, err);
    if (!data)
        return false;
    message why = {""};
    bool good;
    if (size >= 4 && memcmp(data, "\x76\x2f\x31\x01", 4) == 0)
        good = exr_decode(data, size, !exr_alone, texts, count, out, &why);
    else if (exr_alone)
        good = fail(&why, "not an OpenEXR file");
    else if (size >= 2 && memcmp(data, "#?", 2) == 0)
        good = hdr_decode(data, size, out, &why);
    else
        good = fail(&why, "neither a Radiance (.hdr) nor an OpenEXR file");
    free(data);
    return good ? true : fail(err, "cannot read %s: %.400s", path, why.text);
}

bool image_load(const char *path, image *out, message *err)
{
    return load(path, false, NULL, 0, out, err);
}

bool image_load_exr(const char *path, image *out, message *err)
{
    return load(path, true, NULL, 0, out, err);
}

bool image_load_exr_texts(const char *path, exr_text *texts, size_t count, image *out, message *err)
{
    return load(path, true, texts, count, out, err);
}
