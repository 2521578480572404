/* SPDX-License-Identifier: Apache-2.0 */
/* Writing of 8-bit sRGB pictures with libpng. */
#include "atomic_file.h"
#include "image.h"
#include "scene.h"

#include <errno.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

enum { LONGEST_KEYWORD = 79 };

typedef struct writer {
    FILE *stream;
    const image *picture;
    float exposure;
    const exr_attribute *texts;
    size_t text_count;
    png_bytep row;
    png_textp chunks;
    message why;
} writer;

/* libpng must not return from these errors: it jumps back into write_png. */
static void on_error(png_structp png, png_const_charp text)
{
    writer *w = png_get_error_ptr(png);
    if (w->why.text[0] == '\0')
        fail(&w->why, "%.300s", text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png;
    (void)text;
}

static void write_bytes(png_structp png, png_bytep data, size_t size)
{
    writer *w = png_get_io_ptr(png);
    if (fwrite(data, 1, size, w->stream) != size) {
        fail(&w->why, "%s", strerror(errno));
        png_error(png, "write error");
    }
}

static void flush_bytes(png_structp png)
{
    (void)png; /* atomic_commit flushes and checks */
}

/* IEC 61966-2-1, rounded to the nearest of 255 steps; NaN becomes black. */
static png_byte srgb8(double linear)
{
    if (!(linear > 0.0))
        return 0;
    if (linear >= 1.0)
        return 255;
    double c = linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1.0 / 2.4) - 0.055;
    return (png_byte)(255.0 * c + 0.5);
}

/* Holds the setjmp: everything that changes after it lives behind `w`, so no local is clobbered by the jump. */
static bool write_png(png_structp png, png_infop info, writer *w)
{
    if (setjmp(png_jmpbuf(png)))
        return false;
    uint32_t width = w->picture->width, height = w->picture->height;
    png_set_write_fn(png, w, write_bytes, flush_bytes);
    png_set_IHDR(png, info, width, height, 8, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
                 PNG_FILTER_TYPE_DEFAULT);
    png_set_sRGB_gAMA_and_cHRM(png, info, PNG_sRGB_INTENT_RELATIVE);
    if (w->text_count > 0)
        png_set_text(png, info, w->chunks, (int)w->text_count);
    png_write_info(png, info);
    for (uint32_t y = 0; y < height; ++y) {
        const rgb *from = w->picture->pixels + (size_t)y * width;
        for (uint32_t x = 0; x < width; ++x) {
            w->row[3 * (size_t)x] = srgb8((double)w->exposure * from[x].x);
            w->row[3 * (size_t)x + 1] = srgb8((double)w->exposure * from[x].y);
            w->row[3 * (size_t)x + 2] = srgb8((double)w->exposure * from[x].z);
        }
        png_write_row(png, w->row);
    }
    png_write_end(png, info);
    return true;
}

static bool check_input(const writer *w, message *err)
{
    if (w->picture->width == 0 || w->picture->height == 0 || !w->picture->pixels)
        return fail(err, "the picture is empty");
    for (size_t t = 0; t < w->text_count; ++t) {
        size_t length = strlen(w->texts[t].name);
        if (length == 0 || length > LONGEST_KEYWORD)
            return fail(err, "names of PNG texts have 1 to %d characters", LONGEST_KEYWORD);
    }
    return true;
}

bool png_save(const char *path, const image *i, float exposure, const exr_attribute *texts, size_t text_count,
              message *err)
{
    writer w = {.picture = i, .exposure = exposure, .texts = texts, .text_count = text_count};
    if (!check_input(&w, &w.why))
        return fail(err, "cannot write %s: %.300s", path, w.why.text);
    atomic_file file;
    if (!atomic_open(&file, path, err))
        return false;
    w.stream = file.stream;
    w.row = xmalloc(3 * (size_t)i->width);
    w.chunks = xcalloc(text_count + 1, sizeof *w.chunks);
    for (size_t t = 0; t < text_count; ++t) {
        w.chunks[t].compression = PNG_TEXT_COMPRESSION_NONE;
        /* libpng's struct is not const-correct; it copies both strings. */
        memcpy(&w.chunks[t].key, &texts[t].name, sizeof w.chunks[t].key);
        memcpy(&w.chunks[t].text, &texts[t].text, sizeof w.chunks[t].text);
        w.chunks[t].text_length = strlen(texts[t].text);
    }

    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &w, on_error, on_warning);
    png_infop info = png ? png_create_info_struct(png) : NULL;
    bool good = info && write_png(png, info, &w);
    png_destroy_write_struct(&png, &info);
    free(w.row);
    free(w.chunks);
    if (!good) {
        atomic_abort(&file);
        return fail(err, "cannot write %s: %.300s", path, w.why.text[0] ? w.why.text : "libpng gave no reason");
    }
    return atomic_commit(&file, err);
}
