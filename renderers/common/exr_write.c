/* SPDX-License-Identifier: Apache-2.0 */
/* Writing of OpenEXR files through the C library OpenEXRCore: ZIP, half or float, scan lines or tiles. */
#include "atomic_file.h"
#include "image_files.h"
#include "scene.h"

#include <OpenEXR/openexr.h>

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { TILE_SIZE = 64, LONGEST_NAME = 255, LONGEST_SHORT_NAME = 31 };

typedef struct writer {
    atomic_file file;
    exr_context_t context;
    uint32_t width, height;
    const exr_channel *channels;
    size_t channel_count;
    exr_options options;
    float *scratch; /* planes of one chunk */
    size_t scratch_size;
    message first; /* the first complaint of the library or the file system */
} writer;

static void on_error(exr_const_context_t context, exr_result_t code, const char *text)
{
    void *user = NULL;
    (void)code;
    if (!context || exr_get_user_data(context, &user) != EXR_ERR_SUCCESS || !user)
        return;
    writer *w = user;
    if (w->first.text[0] == '\0')
        fail(&w->first, "%.300s", text);
}

static int64_t write_bytes(exr_const_context_t context, void *user, const void *buffer, uint64_t size, uint64_t offset,
                           exr_stream_error_func_ptr_t error)
{
    writer *w = user;
    const char *at = buffer;
    uint64_t done = 0;
    (void)context;
    (void)error;
    while (done < size) {
        ssize_t n = pwrite(fileno(w->file.stream), at + done, size - done, (off_t)(offset + done));
        if (n < 0 && errno == EINTR)
            continue;
        if (n <= 0) {
            if (w->first.text[0] == '\0')
                fail(&w->first, "%s", n < 0 ? strerror(errno) : "nothing could be written");
            return -1;
        }
        done += (uint64_t)n;
    }
    return (int64_t)size;
}

/* Attributes with a meaning of their own, which a free text would spoil. */
static bool reserved(const char *name)
{
    static const char *const names[] = {"chunkCount", "multiView", "name", "type", "version", "view"};
    for (size_t i = 0; i < sizeof names / sizeof names[0]; ++i)
        if (strcmp(name, names[i]) == 0)
            return true;
    return false;
}

static bool check_input(const writer *w, const exr_attribute *attributes, size_t attribute_count, message *err)
{
    if (w->width == 0 || w->height == 0 || w->width > IMAGE_MAX_PIXELS / w->height)
        return fail(err, "%u x %u pixels are not a usable size", (unsigned)w->width, (unsigned)w->height);
    if (w->channel_count == 0)
        return fail(err, "no channels");
    for (size_t c = 0; c < w->channel_count; ++c) {
        size_t length = strlen(w->channels[c].name);
        if (length == 0 || length > LONGEST_NAME)
            return fail(err, "channel names have 1 to %d characters", LONGEST_NAME);
        for (size_t d = 0; d < c; ++d)
            if (strcmp(w->channels[c].name, w->channels[d].name) == 0)
                return fail(err, "channel %s stands twice", w->channels[c].name);
    }
    for (size_t a = 0; a < attribute_count; ++a) {
        size_t length = strlen(attributes[a].name);
        if (length == 0 || length > LONGEST_NAME || reserved(attributes[a].name))
            return fail(err, "'%.64s' cannot name an attribute", attributes[a].name);
    }
    return true;
}

static bool write_header(writer *w, const exr_attribute *attributes, size_t attribute_count)
{
    bool long_names = false;
    for (size_t c = 0; c < w->channel_count; ++c)
        long_names = long_names || strlen(w->channels[c].name) > LONGEST_SHORT_NAME;
    for (size_t a = 0; a < attribute_count; ++a)
        long_names = long_names || strlen(attributes[a].name) > LONGEST_SHORT_NAME;

    int part = 0;
    bool good = exr_set_longname_support(w->context, long_names) == EXR_ERR_SUCCESS &&
                exr_add_part(w->context, NULL, w->options.tiles ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE, &part) ==
                    EXR_ERR_SUCCESS &&
                exr_initialize_required_attr_simple(w->context, part, (int32_t)w->width, (int32_t)w->height,
                                                    EXR_COMPRESSION_ZIP) == EXR_ERR_SUCCESS;
    if (good && w->options.tiles)
        good = exr_set_tile_descriptor(w->context, part, TILE_SIZE, TILE_SIZE, EXR_TILE_ONE_LEVEL,
                                       EXR_TILE_ROUND_DOWN) == EXR_ERR_SUCCESS;
    for (size_t c = 0; good && c < w->channel_count; ++c)
        good =
            exr_add_channel(w->context, part, w->channels[c].name, w->options.half ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT,
                            EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1) == EXR_ERR_SUCCESS;
    for (size_t a = 0; good && a < attribute_count; ++a)
        good = exr_attr_set_string(w->context, part, attributes[a].name, attributes[a].text) == EXR_ERR_SUCCESS;
    return good && exr_write_header(w->context) == EXR_ERR_SUCCESS;
}

static float clamp_half(float v)
{
    return v > 65504.0f ? 65504.0f : v < -65504.0f ? -65504.0f : v; /* NaN stays */
}

static const exr_channel *channel_named(const writer *w, const char *name)
{
    for (size_t c = 0; c < w->channel_count; ++c)
        if (strcmp(w->channels[c].name, name) == 0)
            return &w->channels[c];
    return NULL;
}

/* Copies one channel's pixels of a chunk into a plane of its own: one path for every stride, and room to clamp. */
static void gather(const writer *w, const exr_channel *c, uint32_t x0, uint32_t y0, uint32_t width, uint32_t height,
                   float *plane)
{
    for (uint32_t y = 0; y < height; ++y) {
        const float *from = c->data + ((size_t)(y0 + y) * w->width + x0) * c->stride;
        for (uint32_t x = 0; x < width; ++x) {
            float v = from[x * c->stride];
            *plane++ = w->options.half ? clamp_half(v) : v;
        }
    }
}

/* What the library would compress with. */
typedef struct compressor {
    exr_result_t (*run)(exr_encode_pipeline_t *pipeline);
} compressor;

/* Readers take a chunk as long as its pixels for one that is not compressed, but the library (3.1 to 3.4) writes
 * compressed bytes where both are of the same length. */
static exr_result_t compress(exr_encode_pipeline_t *p)
{
    const compressor *library = p->encoding_user_data;
    exr_result_t result = library->run(p);
    if (result == EXR_ERR_SUCCESS && p->compressed_bytes == p->packed_bytes)
        memcpy(p->compressed_buffer, p->packed_buffer, p->packed_bytes);
    return result;
}

static bool write_chunk(writer *w, const exr_chunk_info_t *chunk, uint32_t x0, uint32_t y0)
{
    uint32_t width = (uint32_t)chunk->width, height = (uint32_t)chunk->height;
    size_t area = (size_t)width * height;
    if (area * w->channel_count > w->scratch_size) {
        w->scratch_size = area * w->channel_count;
        w->scratch = xrealloc(w->scratch, w->scratch_size * sizeof *w->scratch);
    }
    exr_encode_pipeline_t pipeline = EXR_ENCODE_PIPELINE_INITIALIZER;
    compressor library;
    bool good = exr_encoding_initialize(w->context, 0, chunk, &pipeline) == EXR_ERR_SUCCESS;
    for (int i = 0; good && i < pipeline.channel_count; ++i) { /* in the file's order, which is sorted */
        exr_coding_channel_info_t *to = &pipeline.channels[i];
        float *plane = w->scratch + (size_t)i * area;
        gather(w, channel_named(w, to->channel_name), x0, y0, width, height, plane);
        to->user_data_type = EXR_PIXEL_FLOAT;
        to->user_bytes_per_element = sizeof(float);
        to->user_pixel_stride = sizeof(float);
        to->user_line_stride = (int32_t)(width * sizeof(float));
        to->encode_from_ptr = (const uint8_t *)plane;
    }
    good = good && exr_encoding_choose_default_routines(w->context, 0, &pipeline) == EXR_ERR_SUCCESS;
    library.run = pipeline.compress_fn;
    pipeline.encoding_user_data = &library;
    pipeline.compress_fn = library.run ? compress : NULL;
    good = good && exr_encoding_run(w->context, 0, &pipeline) == EXR_ERR_SUCCESS;
    exr_encoding_destroy(w->context, &pipeline);
    return good;
}

static bool write_pixels(writer *w)
{
    exr_chunk_info_t chunk;
    if (w->options.tiles) {
        for (uint32_t y = 0; y < w->height; y += TILE_SIZE)
            for (uint32_t x = 0; x < w->width; x += TILE_SIZE)
                if (exr_write_tile_chunk_info(w->context, 0, (int)(x / TILE_SIZE), (int)(y / TILE_SIZE), 0, 0,
                                              &chunk) != EXR_ERR_SUCCESS ||
                    !write_chunk(w, &chunk, x, y))
                    return false;
        return true;
    }
    int32_t lines = 0;
    if (exr_get_scanlines_per_chunk(w->context, 0, &lines) != EXR_ERR_SUCCESS || lines <= 0)
        return false;
    for (uint32_t y = 0; y < w->height; y += (uint32_t)lines)
        if (exr_write_scanline_chunk_info(w->context, 0, (int)y, &chunk) != EXR_ERR_SUCCESS ||
            !write_chunk(w, &chunk, 0, y))
            return false;
    return true;
}

bool exr_save(const char *path, uint32_t width, uint32_t height, const exr_channel *channels, size_t channel_count,
              const exr_attribute *attributes, size_t attribute_count, exr_options options, message *err)
{
    writer w = {
        .width = width, .height = height, .channels = channels, .channel_count = channel_count, .options = options};
    message why;
    if (!check_input(&w, attributes, attribute_count, &why))
        return fail(err, "cannot write %s: %.400s", path, why.text);
    if (!atomic_open(&w.file, path, err))
        return false;

    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    init.error_handler_fn = on_error;
    init.user_data = &w;
    init.write_fn = write_bytes;
    bool good = exr_start_write(&w.context, path, EXR_WRITE_FILE_DIRECTLY, &init) == EXR_ERR_SUCCESS;
    good = good && write_header(&w, attributes, attribute_count) && write_pixels(&w);
    /* Writes the table of chunks, so it can fail as well. */
    if (w.context && exr_finish(&w.context) != EXR_ERR_SUCCESS)
        good = false;
    free(w.scratch);
    if (!good) {
        atomic_abort(&w.file);
        return fail(err, "cannot write %s: %.300s", path, w.first.text[0] ? w.first.text : "OpenEXR gave no reason");
    }
    return atomic_commit(&w.file, err);
}
