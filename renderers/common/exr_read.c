/* SPDX-License-Identifier: Apache-2.0 */
/* Reading of OpenEXR pictures through the C library OpenEXRCore, from memory. */
#include "image_files.h"

#include <OpenEXR/openexr.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* What the callbacks see of the file. */
typedef struct source {
    const unsigned char *bytes;
    size_t size;
    message first; /* the first complaint is the one nearest to the cause */
} source;

typedef struct reader {
    exr_context_t context;
    exr_attr_box2i_t data, display;
    int plane[3]; /* channel index of R, G, B; three times that of Y in a grey picture */
    int channel_count;
    bool grey; /* may be */
    exr_compression_t compression;
    float *scratch; /* decoded planes of one chunk */
    size_t scratch_size;
    image *out;
} reader;

static void on_error(exr_const_context_t context, exr_result_t code, const char *text)
{
    void *user = NULL;
    (void)code;
    if (!context || exr_get_user_data(context, &user) != EXR_ERR_SUCCESS || !user)
        return;
    source *s = user;
    if (s->first.text[0] != '\0')
        return;
    fail(&s->first, "%.300s", text);
    /* Names from a damaged file may hold anything; the message stays one printable line. */
    for (char *c = s->first.text; *c; ++c)
        if ((unsigned char)*c < ' ' || (unsigned char)*c > '~')
            *c = '?';
}

static int64_t read_bytes(exr_const_context_t context, void *user, void *buffer, uint64_t size, uint64_t offset,
                          exr_stream_error_func_ptr_t error)
{
    const source *s = user;
    if (offset >= s->size) {
        error(context, EXR_ERR_READ_IO, "the file is cut off");
        return -1;
    }
    uint64_t left = s->size - offset;
    if (size > left)
        size = left;
    memcpy(buffer, s->bytes + offset, size);
    return (int64_t)size;
}

static int64_t file_size(exr_const_context_t context, void *user)
{
    (void)context;
    return (int64_t)((const source *)user)->size;
}

static bool usable_box(const exr_attr_box2i_t *b)
{
    const int32_t limit = 1 << 28; /* keeps sums and differences of coordinates within an int */
    return b->min.x >= -limit && b->min.y >= -limit && b->max.x <= limit && b->max.y <= limit && b->min.x <= b->max.x &&
           b->min.y <= b->max.y;
}

static bool find_channels(reader *r, message *err)
{
    const exr_attr_chlist_t *list = NULL;
    if (exr_get_channels(r->context, 0, &list) != EXR_ERR_SUCCESS || !list || list->num_channels <= 0)
        return fail(err, "it has no channels");
    int grey = -1;
    bool chroma = false;
    r->channel_count = list->num_channels;
    r->plane[0] = r->plane[1] = r->plane[2] = -1;
    for (int c = 0; c < list->num_channels; ++c) {
        const exr_attr_chlist_entry_t *e = &list->entries[c];
        if (e->x_sampling != 1 || e->y_sampling != 1)
            return fail(err, "subsampled channels are not supported");
        static const char *const names[3] = {"R", "G", "B"};
        for (int i = 0; i < 3; ++i)
            if (strcmp(e->name.str, names[i]) == 0)
                r->plane[i] = c;
        if (strcmp(e->name.str, "Y") == 0)
            grey = c;
        if (strcmp(e->name.str, "RY") == 0 || strcmp(e->name.str, "BY") == 0)
            chroma = true;
    }
    if (r->plane[0] >= 0 && r->plane[1] >= 0 && r->plane[2] >= 0)
        return true;
    if (!r->grey)
        return fail(err, "it lacks one of the channels R, G, B");
    if (grey < 0 || chroma)
        return fail(err, "it has neither the channels R, G, B nor a luminance Y alone");
    r->plane[0] = r->plane[1] = r->plane[2] = grey;
    return true;
}

/* Refuses what is valid OpenEXR, but no plain picture. */
static bool check_kind(reader *r, exr_storage_t *storage, message *err)
{
    int parts = 0;
    const exr_attribute_t *views = NULL;
    if (exr_get_count(r->context, &parts) != EXR_ERR_SUCCESS || parts != 1)
        return fail(err, "files of several parts are not supported");
    if (exr_get_storage(r->context, 0, storage) != EXR_ERR_SUCCESS ||
        (*storage != EXR_STORAGE_SCANLINE && *storage != EXR_STORAGE_TILED))
        return fail(err, "deep pictures are not supported");
    if (exr_get_attribute_by_name(r->context, 0, "multiView", &views) == EXR_ERR_SUCCESS)
        return fail(err, "pictures of several views are not supported");
    if (exr_get_compression(r->context, 0, &r->compression) != EXR_ERR_SUCCESS ||
        r->compression < EXR_COMPRESSION_NONE || r->compression > EXR_COMPRESSION_B44A)
        return fail(err, "its compression is not supported (DWAA, DWAB or unknown)");
    if (exr_get_data_window(r->context, 0, &r->data) != EXR_ERR_SUCCESS || !usable_box(&r->data) ||
        exr_get_display_window(r->context, 0, &r->display) != EXR_ERR_SUCCESS || !usable_box(&r->display))
        return fail(err, "its data or display window is empty or absurd");
    return true;
}

/* Copies decoded planes, whose first pixel is (x0, y0) of the picture's coordinates, to where they are displayed. */
static void place(const reader *r, int32_t x0, int32_t y0, int32_t width, int32_t height)
{
    size_t area = (size_t)width * (size_t)height;
    const float *red = r->scratch;
    bool grey = r->plane[0] == r->plane[1];
    const float *green = grey ? red : red + area, *blue = grey ? red : red + 2 * area;
    for (int32_t y = 0; y < height; ++y) {
        if (y0 + y < r->display.min.y || y0 + y > r->display.max.y)
            continue;
        rgb *row = r->out->pixels + (size_t)(y0 + y - r->display.min.y) * r->out->width;
        for (int32_t x = 0; x < width; ++x) {
            size_t i = (size_t)y * (size_t)width + (size_t)x;
            if (x0 + x >= r->display.min.x && x0 + x <= r->display.max.x)
                row[x0 + x - r->display.min.x] = v3(red[i], green[i], blue[i]);
        }
    }
}

/* Decodes one chunk of at most width x height pixels, which starts at (x0, y0). */
static bool decode_chunk(reader *r, const exr_chunk_info_t *chunk, int32_t x0, int32_t y0, int32_t width,
                         int32_t height, message *err)
{
    if (chunk->width != width || chunk->height != height ||
        (r->compression == EXR_COMPRESSION_NONE && chunk->packed_size != chunk->unpacked_size))
        return fail(err, "the block at (%d, %d) is damaged", (int)x0, (int)y0);
    size_t area = (size_t)width * (size_t)height;
    if (3 * area > r->scratch_size) {
        free(r->scratch);
        r->scratch = malloc(3 * area * sizeof *r->scratch);
        r->scratch_size = r->scratch ? 3 * area : 0;
        if (!r->scratch)
            return fail(err, "no memory for a block of %d x %d pixels", (int)width, (int)height);
    }

    exr_decode_pipeline_t pipeline = EXR_DECODE_PIPELINE_INITIALIZER;
    bool good = exr_decoding_initialize(r->context, 0, chunk, &pipeline) == EXR_ERR_SUCCESS &&
                pipeline.channel_count == r->channel_count;
    for (int i = 0; good && i < 3; ++i) {
        exr_coding_channel_info_t *c = &pipeline.channels[r->plane[i]];
        if (c->decode_to_ptr)
            continue; /* grey: decoded once */
        c->user_data_type = EXR_PIXEL_FLOAT;
        c->user_bytes_per_element = sizeof(float);
        c->user_pixel_stride = sizeof(float);
        c->user_line_stride = width * (int32_t)sizeof(float);
        c->decode_to_ptr = (uint8_t *)(r->scratch + (size_t)i * area);
    }
    good = good && exr_decoding_choose_default_routines(r->context, 0, &pipeline) == EXR_ERR_SUCCESS &&
           exr_decoding_run(r->context, 0, &pipeline) == EXR_ERR_SUCCESS;
    exr_decoding_destroy(r->context, &pipeline);
    if (!good)
        return fail(err, "the block at (%d, %d) is damaged or cut off", (int)x0, (int)y0);
    place(r, x0, y0, width, height);
    return true;
}

static bool decode_scanlines(reader *r, message *err)
{
    int32_t lines = 0;
    if (exr_get_scanlines_per_chunk(r->context, 0, &lines) != EXR_ERR_SUCCESS || lines <= 0)
        return fail(err, "its row blocks have no height");
    for (int32_t y = r->data.min.y; y <= r->data.max.y; y += lines) {
        exr_chunk_info_t chunk;
        int32_t height = r->data.max.y - y + 1;
        if (exr_read_scanline_chunk_info(r->context, 0, y, &chunk) != EXR_ERR_SUCCESS)
            return fail(err, "the rows from %d are missing or damaged", (int)y);
        if (!decode_chunk(r, &chunk, r->data.min.x, y, r->data.max.x - r->data.min.x + 1,
                          height < lines ? height : lines, err))
            return false;
    }
    return true;
}

static bool decode_tiles(reader *r, message *err)
{
    int32_t tile_width = 0, tile_height = 0;
    if (exr_get_tile_sizes(r->context, 0, 0, 0, &tile_width, &tile_height) != EXR_ERR_SUCCESS || tile_width <= 0 ||
        tile_height <= 0)
        return fail(err, "its tiles have no size");
    int32_t width = r->data.max.x - r->data.min.x + 1, height = r->data.max.y - r->data.min.y + 1;
    for (int32_t y = 0, row = 0; y < height; ++row) {
        int32_t h = height - y < tile_height ? height - y : tile_height;
        for (int32_t x = 0, column = 0; x < width; ++column) {
            int32_t w = width - x < tile_width ? width - x : tile_width;
            exr_chunk_info_t chunk;
            if (exr_read_tile_chunk_info(r->context, 0, column, row, 0, 0, &chunk) != EXR_ERR_SUCCESS)
                return fail(err, "tile (%d, %d) is missing or damaged", (int)column, (int)row);
            if (!decode_chunk(r, &chunk, r->data.min.x + x, r->data.min.y + y, w, h, err))
                return false;
            x += w;
        }
        y += h;
    }
    return true;
}

static bool decode_picture(reader *r, message *err)
{
    exr_storage_t storage;
    if (!check_kind(r, &storage, err) || !find_channels(r, err))
        return false;
    uint64_t width = (uint64_t)(r->data.max.x - r->data.min.x + 1);
    uint64_t height = (uint64_t)(r->data.max.y - r->data.min.y + 1);
    if (width > IMAGE_MAX_PIXELS / height)
        return fail(err, "%llu x %llu pixels are not a usable size", (unsigned long long)width,
                    (unsigned long long)height);
    if (!image_new_checked((uint64_t)(r->display.max.x - r->display.min.x + 1),
                           (uint64_t)(r->display.max.y - r->display.min.y + 1), r->out, err))
        return false;
    return storage == EXR_STORAGE_TILED ? decode_tiles(r, err) : decode_scanlines(r, err);
}

/* Values of string attributes; empty where there is none of that name. */
static bool find_texts(const reader *r, exr_text *texts, size_t count, message *err)
{
    const exr_attr_chlist_t *list = NULL;
    exr_get_channels(r->context, 0, &list);
    for (int i = 0; i < 3; ++i)
        if (list->entries[r->plane[i]].pixel_type != EXR_PIXEL_FLOAT)
            return fail(err, "its pixels are not 32-bit floats");
    for (size_t i = 0; i < count; ++i) {
        const exr_attribute_t *a = NULL;
        texts[i].value[0] = '\0';
        if (exr_get_attribute_by_name(r->context, 0, texts[i].name, &a) == EXR_ERR_SUCCESS &&
            a->type == EXR_ATTR_STRING && a->string->str)
            snprintf(texts[i].value, sizeof texts[i].value, "%s", a->string->str);
    }
    return true;
}

bool exr_decode(const unsigned char *bytes, size_t size, bool grey, exr_text *texts, size_t text_count, image *out,
                message *err)
{
    source s = {.bytes = bytes, .size = size};
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = on_error;
    init.user_data = &s;
    init.read_fn = read_bytes;
    init.size_fn = file_size;
    init.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION;

    *out = (image){0};
    reader r = {.grey = grey, .out = out};
    if (exr_start_read(&r.context, "memory", &init) != EXR_ERR_SUCCESS)
        return fail(err, "the OpenEXR header is damaged (%s)", s.first.text[0] ? s.first.text : "no reason given");
    s.first.text[0] = '\0';
    message why = {""};
    bool good = decode_picture(&r, &why) && (!texts || find_texts(&r, texts, text_count, &why));
    if (!good && s.first.text[0])
        fail(err, "%.160s (%.300s)", why.text, s.first.text);
    else if (!good)
        fail(err, "%s", why.text);
    exr_finish(&r.context);
    free(r.scratch);
    if (!good)
        image_free(out);
    return good;
}
