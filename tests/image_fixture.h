/* SPDX-License-Identifier: Apache-2.0 */
/* Files for the image tests: a folder of their own, and pictures in variants that the project itself never writes. */
#ifndef TESTS_IMAGE_FIXTURE_H
#define TESTS_IMAGE_FIXTURE_H

#include "image.h"
#include "temporary_folder.h"

#include <OpenEXR/openexr.h>

#include <dirent.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Everything below sits in the folder `image_folder`, which setup makes and teardown removes. */
static char image_folder[TEMPORARY_FOLDER_MAX];

static inline const char *in_folder(const char *name)
{
    static char path[512];
    snprintf(path, sizeof path, "%s/%s", image_folder, name);
    return path;
}

static inline int files_in_folder(void)
{
    int count = 0;
    DIR *d = opendir(image_folder);
    for (struct dirent *e = d ? readdir(d) : NULL; e; e = readdir(d))
        count += e->d_name[0] != '.';
    if (d)
        closedir(d);
    return count;
}

static inline void empty_folder(void)
{
    DIR *d = opendir(image_folder);
    for (struct dirent *e = d ? readdir(d) : NULL; e; e = readdir(d))
        if (e->d_name[0] != '.')
            unlink(in_folder(e->d_name));
    if (d)
        closedir(d);
}

static inline int folder_setup(void **state)
{
    (void)state;
    return temporary_folder(NULL, image_folder);
}

static inline int folder_teardown(void **state)
{
    (void)state;
    empty_folder();
    return rmdir(image_folder);
}

static inline unsigned char *file_bytes(const char *path, size_t *size)
{
    FILE *f = fopen(path, "rb");
    if (!f)
        return NULL;
    fseek(f, 0, SEEK_END);
    *size = (size_t)ftell(f);
    rewind(f);
    unsigned char *data = malloc(*size + 1);
    *size = fread(data, 1, *size, f);
    fclose(f);
    return data;
}

static inline void put_bytes(const char *path, const void *data, size_t size)
{
    FILE *f = fopen(path, "wb");
    if (f) {
        fwrite(data, 1, size, f);
        fclose(f);
    }
}

/* --- OpenEXR in all variants --- */

typedef struct exr_variant {
    exr_storage_t storage;
    exr_compression_t compression;
    exr_pixel_type_t type;
    const char *names; /* one character a channel */
    int32_t width, height, data_x, data_y, tile;
    int sampling;
    bool mipmap, header_only, second_part, multi_view;
    int32_t display[4]; /* min x, min y, max x, max y; the data window if all are 0 */
} exr_variant;

/* The value of a channel at data window pixel (x, y): smooth, exact in half, whole for uint. */
static inline float variant_value(char channel, int32_t x, int32_t y)
{
    return (float)((channel == 'R' ? 40 : channel == 'G' ? 20 : 10) + x + 2 * y);
}

static inline bool put_chunk(exr_context_t c, const exr_variant *v, const exr_chunk_info_t *chunk, int x0, int y0)
{
    exr_encode_pipeline_t p = EXR_ENCODE_PIPELINE_INITIALIZER;
    bool good = exr_encoding_initialize(c, 0, chunk, &p) == EXR_ERR_SUCCESS;
    size_t area = (size_t)chunk->width * (size_t)chunk->height;
    float *planes = calloc(area * strlen(v->names), sizeof *planes);
    uint32_t *whole = (uint32_t *)calloc(area * strlen(v->names), sizeof *whole);
    for (int i = 0; good && i < p.channel_count; ++i) {
        for (size_t k = 0; k < area; ++k) {
            float value = variant_value(p.channels[i].channel_name[0], x0 + (int)(k % (size_t)chunk->width),
                                        y0 + (int)(k / (size_t)chunk->width));
            planes[(size_t)i * area + k] = value;
            whole[(size_t)i * area + k] = (uint32_t)value;
        }
        bool is_uint = v->type == EXR_PIXEL_UINT;
        p.channels[i].user_data_type = is_uint ? EXR_PIXEL_UINT : EXR_PIXEL_FLOAT;
        p.channels[i].user_bytes_per_element = 4;
        p.channels[i].user_pixel_stride = 4;
        p.channels[i].user_line_stride = 4 * chunk->width;
        p.channels[i].encode_from_ptr =
            is_uint ? (const uint8_t *)(whole + (size_t)i * area) : (const uint8_t *)(planes + (size_t)i * area);
    }
    good = good && exr_encoding_choose_default_routines(c, 0, &p) == EXR_ERR_SUCCESS &&
           exr_encoding_run(c, 0, &p) == EXR_ERR_SUCCESS;
    exr_encoding_destroy(c, &p);
    free(planes);
    free(whole);
    return good;
}

static inline bool put_pixels(exr_context_t c, const exr_variant *v)
{
    exr_chunk_info_t chunk;
    int32_t lines = 1, levels_x = 1, levels_y = 1;
    if (v->storage == EXR_STORAGE_TILED) {
        exr_get_tile_levels(c, 0, &levels_x, &levels_y);
        for (int l = 0; l < levels_x; ++l) {
            int32_t w = 0, h = 0;
            exr_get_level_sizes(c, 0, l, l, &w, &h);
            for (int y = 0; y * v->tile < h; ++y)
                for (int x = 0; x * v->tile < w; ++x)
                    if (exr_write_tile_chunk_info(c, 0, x, y, l, l, &chunk) != EXR_ERR_SUCCESS ||
                        !put_chunk(c, v, &chunk, x * v->tile, y * v->tile))
                        return false;
        }
        return true;
    }
    exr_get_scanlines_per_chunk(c, 0, &lines);
    for (int32_t y = 0; y < v->height; y += lines)
        if (exr_write_scanline_chunk_info(c, 0, y + v->data_y, &chunk) != EXR_ERR_SUCCESS ||
            !put_chunk(c, v, &chunk, 0, y))
            return false;
    return true;
}

static inline bool put_part(exr_context_t c, const exr_variant *v, const char *name)
{
    int part = 0;
    exr_attr_box2i_t data, shown;
    exr_attr_v2f_t centre;
    memset(&centre, 0, sizeof centre);
    data.min.x = v->data_x;
    data.min.y = v->data_y;
    data.max.x = v->data_x + v->width - 1;
    data.max.y = v->data_y + v->height - 1;
    shown.min.x = v->display[0];
    shown.min.y = v->display[1];
    shown.max.x = v->display[2];
    shown.max.y = v->display[3];
    if (v->display[2] == 0 && v->display[3] == 0)
        shown = data;
    bool good = exr_add_part(c, name, v->storage, &part) == EXR_ERR_SUCCESS &&
                exr_initialize_required_attr(c, part, &shown, &data, 1.0f, &centre, 1.0f, EXR_LINEORDER_INCREASING_Y,
                                             v->compression) == EXR_ERR_SUCCESS;
    if (v->storage == EXR_STORAGE_TILED)
        good = good && exr_set_tile_descriptor(c, part, (uint32_t)v->tile, (uint32_t)v->tile,
                                               v->mipmap ? EXR_TILE_MIPMAP_LEVELS : EXR_TILE_ONE_LEVEL,
                                               EXR_TILE_ROUND_DOWN) == EXR_ERR_SUCCESS;
    for (const char *n = v->names; good && *n; ++n) {
        char channel[2] = {*n, '\0'};
        int s = v->sampling > 0 ? v->sampling : 1;
        good = exr_add_channel(c, part, channel, v->type, EXR_PERCEPTUALLY_LOGARITHMIC, s, s) == EXR_ERR_SUCCESS;
    }
    const char *views[2] = {"left", "right"};
    if (good && v->multi_view)
        good = exr_attr_set_string_vector(c, part, "multiView", 2, views) == EXR_ERR_SUCCESS;
    return good;
}

static inline int64_t put_at(exr_const_context_t c, void *file, const void *data, uint64_t size, uint64_t offset,
                             exr_stream_error_func_ptr_t error)
{
    (void)c;
    (void)error;
    fseek(file, (long)offset, SEEK_SET);
    return (int64_t)fwrite(data, 1, size, file);
}

static inline void ignore_error(exr_const_context_t c, exr_result_t code, const char *text)
{
    (void)c;
    (void)code;
    (void)text;
}

/* Through a stream of our own, because the library deletes files that it finds incomplete. */
static inline bool put_exr(const char *path, const exr_variant *v)
{
    FILE *f = fopen(path, "wb");
    exr_context_t c = NULL;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.user_data = f;
    init.write_fn = put_at;
    init.error_handler_fn = ignore_error;
    if (exr_start_write(&c, path, EXR_WRITE_FILE_DIRECTLY, &init) != EXR_ERR_SUCCESS)
        return false;
    bool good = put_part(c, v, v->second_part ? "one" : NULL) && (!v->second_part || put_part(c, v, "two")) &&
                exr_write_header(c) == EXR_ERR_SUCCESS && (v->header_only || put_pixels(c, v));
    good = exr_finish(&c) == EXR_ERR_SUCCESS && good;
    return fclose(f) == 0 && good;
}

/* --- Radiance pictures --- */

/* Component k of pixel (x, y): rows with runs and rows without. */
static inline unsigned char hdr_value(uint32_t x, uint32_t y, int k)
{
    if (k == 3)
        return (unsigned char)(y == 0 ? 0 : 126 + y);
    return (unsigned char)(y % 2 ? 7 * (int)x + 31 * k : x < 6 ? 200 : 90 + k);
}

static inline size_t hdr_bytes(unsigned char *to, uint32_t width, uint32_t height, bool coded)
{
    size_t n = (size_t)sprintf((char *)to, "#?RADIANCE\n# comment\nFORMAT=32-bit_rle_rgbe\n\n-Y %u +X %u\n",
                               (unsigned)height, (unsigned)width);
    for (uint32_t y = 0; y < height; ++y) {
        if (!coded) {
            for (uint32_t x = 0; x < width; ++x)
                for (int k = 0; k < 4; ++k)
                    to[n++] = hdr_value(x, y, k);
            continue;
        }
        to[n++] = 2;
        to[n++] = 2;
        to[n++] = (unsigned char)(width >> 8);
        to[n++] = (unsigned char)width;
        for (int k = 0; k < 4; ++k)
            for (uint32_t x = 0; x < width;) {
                uint32_t run = 1;
                while (x + run < width && run < 127 && hdr_value(x + run, y, k) == hdr_value(x, y, k))
                    ++run;
                to[n++] = (unsigned char)(run > 1 ? 128 + run : 1);
                to[n++] = hdr_value(x, y, k);
                x += run;
            }
    }
    return n;
}

#endif
