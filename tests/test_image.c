/* SPDX-License-Identifier: Apache-2.0 */
/* Images written and read back: OpenEXR, Radiance, PNG. */
#include "image.h"
#include "image_fixture.h"
#include "rng.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h> /* after message.h, whose fail() is a macro there */

#include <math.h>
#include <png.h>
#include <stb/stb_image.h>
#include <sys/stat.h>

static message err;

static image noise(uint32_t width, uint32_t height)
{
    image i = image_new(width, height);
    rng r = rng_make(1, width);
    for (size_t p = 0; p < (size_t)width * height; ++p)
        i.pixels[p] = v3(ldexpf(rng_float(&r), (int)(rng_u32(&r) % 40) - 24), -rng_float(&r), 1e4f * rng_float(&r));
    return i;
}

static bool save_rgb(const char *path, const image *i, exr_options options)
{
    const exr_channel channels[3] = {{"R", &i->pixels[0].x, 3}, {"G", &i->pixels[0].y, 3}, {"B", &i->pixels[0].z, 3}};
    return exr_save(path, i->width, i->height, channels, 3, NULL, 0, options, &err);
}

static void new_image_is_black(void **state)
{
    (void)state;
    image i = image_new(3, 2);
    assert_int_equal(i.width, 3);
    assert_int_equal(i.height, 2);
    for (int p = 0; p < 6; ++p)
        assert_true(i.pixels[p].x == 0.0f && i.pixels[p].y == 0.0f && i.pixels[p].z == 0.0f);
    image_free(&i);
    assert_null(i.pixels);
    assert_int_equal(i.width, 0);
}

static void float_exr_is_exact(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {100, 70}, {64, 64}, {65, 129}, {7, 33}};
    for (size_t s = 0; s < 5; ++s)
        for (int tiles = 0; tiles < 2; ++tiles) {
            image a = noise(sizes[s][0], sizes[s][1]), b;
            a.pixels[0] = v3(INFINITY, -INFINITY, NAN);
            a.pixels[(size_t)a.width * a.height - 1].y = -0.0f;
            assert_true(save_rgb(in_folder("a.exr"), &a, (exr_options){.tiles = tiles != 0}));
            assert_true(image_load(in_folder("a.exr"), &b, &err));
            assert_int_equal(b.width, a.width);
            assert_int_equal(b.height, a.height);
            assert_memory_equal(a.pixels, b.pixels, (size_t)a.width * a.height * sizeof(rgb));
            image_free(&a);
            image_free(&b);
        }
    assert_int_equal(files_in_folder(), 1); /* no temporary is left */
    empty_folder();
}

/* Of random bytes with more and more zeros, some compress to as many bytes as there are. */
static void incompressible_exr_is_exact(void **state)
{
    (void)state;
    image a = image_new(4, 3), b;
    size_t bytes = (size_t)a.width * a.height * sizeof(rgb);
    rng r = rng_make(1, 0);
    for (size_t round = 0; round < 1000; ++round) {
        uint8_t *to = (uint8_t *)a.pixels;
        for (size_t k = 0; k < bytes; ++k)
            to[k] = (uint8_t)(k < round % 60 ? 0 : rng_u32(&r));
        assert_true(save_rgb(in_folder("a.exr"), &a, (exr_options){0}));
        assert_true(image_load(in_folder("a.exr"), &b, &err));
        assert_memory_equal(a.pixels, b.pixels, bytes);
        image_free(&b);
    }
    image_free(&a);
    empty_folder();
}

static void half_exr_is_rounded_and_clamped(void **state)
{
    (void)state;
    for (int tiles = 0; tiles < 2; ++tiles) {
        image a = noise(80, 40), b;
        a.pixels[0] = v3(INFINITY, -INFINITY, NAN);
        a.pixels[1] = v3(1e30f, -7e4f, 65519.0f);
        a.pixels[2] = v3(65504.0f, 0.0f, 1.0f);
        assert_true(save_rgb(in_folder("a.exr"), &a, (exr_options){.half = true, .tiles = tiles != 0}));
        assert_true(image_load(in_folder("a.exr"), &b, &err));
        assert_true(b.pixels[0].x == 65504.0f && b.pixels[0].y == -65504.0f && isnan(b.pixels[0].z));
        assert_true(b.pixels[1].x == 65504.0f && b.pixels[1].y == -65504.0f && b.pixels[1].z == 65504.0f);
        assert_true(b.pixels[2].x == 65504.0f && b.pixels[2].y == 0.0f && b.pixels[2].z == 1.0f);
        for (size_t p = 3; p < (size_t)a.width * a.height; ++p) {
            const float *x = &a.pixels[p].x, *y = &b.pixels[p].x;
            for (int k = 0; k < 3; ++k) /* below 2^-14 halves are spaced by 2^-24 */
                assert_true(fabsf(x[k] - y[k]) <= fmaxf(fabsf(x[k]) * 0x1p-11f, 0x1p-25f));
        }
        image_free(&a);
        image_free(&b);
    }
    empty_folder();
}

static void exr_holds_layers_and_attributes(void **state)
{
    (void)state;
    const float z[6] = {1, 2, 3, 4, 5, 6}, xy[12] = {0, 10, 1, 11, 2, 12, 3, 13, 4, 14, 5, 15};
    const char *const long_name = "a-channel-with-a-name-of-more-than-31-characters";
    const exr_channel channels[4] = {
        {"normal.Y", xy + 1, 2}, {"depth.Z", z, 1}, {"normal.X", xy, 2}, {long_name, z, 1}};
    const exr_attribute attributes[2] = {{"scene", "bunny"}, {"empty", ""}};
    assert_true(exr_save(in_folder("a.exr"), 3, 2, channels, 4, attributes, 2, (exr_options){0}, &err));

    exr_context_t c = NULL;
    exr_context_initializer_t init = EXR_DEFAULT_CONTEXT_INITIALIZER;
    assert_int_equal(exr_start_read(&c, in_folder("a.exr"), &init), EXR_ERR_SUCCESS);
    const exr_attr_chlist_t *list = NULL;
    assert_int_equal(exr_get_channels(c, 0, &list), EXR_ERR_SUCCESS);
    const char *const sorted[4] = {long_name, "depth.Z", "normal.X", "normal.Y"};
    assert_int_equal(list->num_channels, 4);
    for (int i = 0; i < 4; ++i)
        assert_string_equal(list->entries[i].name.str, sorted[i]);
    int32_t length = 0;
    const char *text = NULL;
    assert_int_equal(exr_attr_get_string(c, 0, "scene", &length, &text), EXR_ERR_SUCCESS);
    assert_string_equal(text, "bunny");

    exr_chunk_info_t chunk;
    exr_decode_pipeline_t p = EXR_DECODE_PIPELINE_INITIALIZER;
    float planes[4][6];
    assert_int_equal(exr_read_scanline_chunk_info(c, 0, 0, &chunk), EXR_ERR_SUCCESS);
    assert_int_equal(exr_decoding_initialize(c, 0, &chunk, &p), EXR_ERR_SUCCESS);
    for (int i = 0; i < 4; ++i) {
        p.channels[i].decode_to_ptr = (uint8_t *)planes[i];
        p.channels[i].user_pixel_stride = 4;
        p.channels[i].user_line_stride = 12;
    }
    assert_int_equal(exr_decoding_choose_default_routines(c, 0, &p), EXR_ERR_SUCCESS);
    assert_int_equal(exr_decoding_run(c, 0, &p), EXR_ERR_SUCCESS);
    for (int i = 0; i < 6; ++i)
        assert_true(planes[1][i] == z[i] && planes[2][i] == xy[2 * i] && planes[3][i] == xy[2 * i + 1]);
    exr_decoding_destroy(c, &p);
    exr_finish(&c);
    empty_folder();
}

/* What the picture of a variant must show, within `tolerance` relative. */
static void check_variant(const exr_variant *v, float tolerance)
{
    image i;
    assert_true(put_exr(in_folder("v.exr"), v));
    if (!image_load(in_folder("v.exr"), &i, &err))
        fail_msg("%s", err.text);
    int32_t x0 = v->data_x, y0 = v->data_y;
    bool whole = v->display[2] == 0 && v->display[3] == 0;
    if (!whole) {
        x0 = v->display[0];
        y0 = v->display[1];
    }
    assert_int_equal(i.width, whole ? v->width : v->display[2] - x0 + 1);
    assert_int_equal(i.height, whole ? v->height : v->display[3] - y0 + 1);
    bool grey = strchr(v->names, 'R') == NULL;
    for (uint32_t y = 0; y < i.height; ++y)
        for (uint32_t x = 0; x < i.width; ++x) {
            int32_t dx = (int32_t)x + x0 - v->data_x, dy = (int32_t)y + y0 - v->data_y;
            bool inside = dx >= 0 && dy >= 0 && dx < v->width && dy < v->height;
            const float *p = &i.pixels[(size_t)y * i.width + x].x;
            for (int k = 0; k < 3; ++k) {
                float want = inside ? variant_value(grey ? 'Y' : "RGB"[k], dx, dy) : 0.0f;
                if (!(fabsf(p[k] - want) <= tolerance * want))
                    fail_msg("compression %d type %d storage %d: pixel (%u, %u) channel %d is %g, not %g",
                             v->compression, v->type, v->storage, x, y, k, (double)p[k], (double)want);
            }
        }
    image_free(&i);
    empty_folder();
}

static void exr_variants_are_read(void **state)
{
    (void)state;
    for (int c = EXR_COMPRESSION_NONE; c <= EXR_COMPRESSION_B44A; ++c)
        for (int t = EXR_PIXEL_UINT; t < EXR_PIXEL_LAST_TYPE; ++t)
            for (int tiled = 0; tiled < 3; ++tiled) {
                exr_variant v = {.storage = tiled ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE,
                                 .compression = (exr_compression_t)c,
                                 .type = (exr_pixel_type_t)t,
                                 .names = t == EXR_PIXEL_HALF ? "AGRBZ" : "BGR",
                                 .width = 45,
                                 .height = 37,
                                 .tile = 16,
                                 .mipmap = tiled == 2};
                bool lossy = c >= EXR_COMPRESSION_B44 && t == EXR_PIXEL_HALF;
                check_variant(&v, lossy ? 0.02f : 0.0f);
                v.names = "Y";
                check_variant(&v, lossy ? 0.02f : 0.0f);
            }
}

static void exr_windows_are_honoured(void **state)
{
    (void)state;
    for (int tiled = 0; tiled < 2; ++tiled) {
        exr_variant v = {.storage = tiled ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE,
                         .compression = EXR_COMPRESSION_ZIP,
                         .type = EXR_PIXEL_HALF,
                         .names = "RGB",
                         .width = 20,
                         .height = 35,
                         .data_x = -7,
                         .data_y = 11,
                         .tile = 8};
        check_variant(&v, 0.0f);
        memcpy(v.display, (int32_t[]){0, 0, 29, 39}, sizeof v.display); /* sticks out at left and below */
        check_variant(&v, 0.0f);
        v.data_y = -20; /* and above */
        check_variant(&v, 0.0f);
    }
}

static void hdr_is_read(void **state)
{
    (void)state;
    static unsigned char bytes[1 << 16];
    static const uint32_t widths[4] = {3, 8, 16, 300};
    for (int w = 0; w < 4; ++w)
        for (int coded = 0; coded < 2; ++coded) {
            if (coded && widths[w] < 8)
                continue;
            put_bytes(in_folder("a.hdr"), bytes, hdr_bytes(bytes, widths[w], 5, coded != 0));
            image i;
            if (!image_load(in_folder("a.hdr"), &i, &err))
                fail_msg("%s", err.text);
            assert_int_equal(i.width, widths[w]);
            assert_int_equal(i.height, 5);
            for (uint32_t y = 0; y < 5; ++y)
                for (uint32_t x = 0; x < i.width; ++x) {
                    const float *p = &i.pixels[(size_t)y * i.width + x].x;
                    for (int k = 0; k < 3; ++k)
                        assert_true(p[k] == (y ? ldexpf(hdr_value(x, y, k), hdr_value(x, y, 3) - 136) : 0.0f));
                }
            image_free(&i);
        }
    empty_folder();
}

static void references_have_three_colours(void **state)
{
    (void)state;
    image a = noise(5, 4), b;
    assert_true(save_rgb(in_folder("a.exr"), &a, (exr_options){0}));
    assert_true(image_load_exr(in_folder("a.exr"), &b, &err));
    assert_memory_equal(a.pixels, b.pixels, 20 * sizeof(rgb));
    image_free(&b);
    const exr_channel two[] = {{"R", &a.pixels[0].x, 3}, {"G", &a.pixels[0].y, 3}, {"Y", &a.pixels[0].z, 3}};
    assert_true(exr_save(in_folder("a.exr"), 5, 4, two, 3, NULL, 0, (exr_options){0}, &err));
    assert_true(image_load(in_folder("a.exr"), &b, &err));
    image_free(&b);
    assert_false(image_load_exr(in_folder("a.exr"), &b, &err));
    assert_non_null(strstr(err.text, "a.exr: it lacks one of the channels R, G, B"));
    assert_null(b.pixels);
    static const char hdr[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\nabcd";
    put_bytes(in_folder("a.hdr"), hdr, sizeof hdr - 1);
    assert_true(image_load(in_folder("a.hdr"), &b, &err));
    image_free(&b);
    assert_false(image_load_exr(in_folder("a.hdr"), &b, &err));
    assert_non_null(strstr(err.text, "not an OpenEXR file"));
    image_free(&a);
    empty_folder();
}

/* stb_image as a second opinion on whole files. */
static void sample_maps_agree_with_stb(void **state)
{
    (void)state;
    const char *root = getenv("VCACHE_SCENES");
    char folder[400], path[700];
    snprintf(folder, sizeof folder, "%s/hdri", root ? root : "../shared/scenes");
    DIR *d = opendir(folder);
    if (!d) {
        print_message("SKIPPED: no %s\n", folder);
        skip();
    }
    for (struct dirent *e = readdir(d); e; e = readdir(d)) {
        size_t length = strlen(e->d_name);
        bool hdr = length > 4 && strcmp(e->d_name + length - 4, ".hdr") == 0;
        if (!hdr && (length < 4 || strcmp(e->d_name + length - 4, ".exr") != 0))
            continue;
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        image i;
        if (!image_load(path, &i, &err))
            fail_msg("%s", err.text);
        assert_int_equal(i.width, 2 * i.height);
        int w = 0, h = 0, n = 0;
        float *stb = hdr ? stbi_loadf(path, &w, &h, &n, 3) : NULL;
        assert_true(!hdr || stb);
        if (stb) {
            assert_int_equal(w, i.width);
            assert_int_equal(h, i.height);
            assert_memory_equal(stb, i.pixels, (size_t)w * (size_t)h * sizeof(rgb));
        }
        stbi_image_free(stb);
        image_free(&i);
    }
    closedir(d);
}

static void png_is_srgb(void **state)
{
    (void)state;
    /* linear values and what IEC 61966-2-1 makes of them in 8 bits */
    static const struct {
        float linear;
        int coded;
    } table[] = {{0.0f, 0},         {1.0f, 255},       {0.5f, 188},    {0.18f, 118},  {0.0031308f, 10}, {0.001f, 3},
                 {0.2122308f, 127}, {0.7304608f, 222}, {-1.0f, 0},     {2.0f, 255},   {INFINITY, 255},  {-INFINITY, 0},
                 {NAN, 0},          {1e-20f, 0},       {0.9999f, 255}, {0.00015f, 0}, {0.00016f, 1}};
    enum { COUNT = sizeof table / sizeof table[0] };
    image i = image_new(COUNT, 3);
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < COUNT; ++x) {
            float v = 0.25f * table[x].linear;
            i.pixels[y * COUNT + x] = y == 0 ? v3(v, 0, 0) : y == 1 ? v3(0, v, 0) : v3(0, 0, v);
        }
    const exr_attribute texts[2] = {{"Software", "vcache"}, {"scene", "cornell"}};
    assert_true(png_save(in_folder("a.png"), &i, 4.0f, texts, 2, &err));
    assert_int_equal(files_in_folder(), 1);

    png_image in = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&in, in_folder("a.png")));
    assert_int_equal(in.width, COUNT);
    assert_int_equal(in.height, 3);
    in.format = PNG_FORMAT_RGB;
    unsigned char pixels[3 * 3 * COUNT];
    assert_true(png_image_finish_read(&in, NULL, pixels, 0, NULL));
    for (int y = 0; y < 3; ++y)
        for (int x = 0; x < COUNT; ++x)
            for (int k = 0; k < 3; ++k)
                assert_int_equal(pixels[3 * (y * COUNT + x) + k], k == y ? table[x].coded : 0);

    size_t size = 0;
    unsigned char *bytes = file_bytes(in_folder("a.png"), &size);
    assert_non_null(memmem(bytes, size, "tEXtSoftware\0vcache", 19));
    assert_non_null(memmem(bytes, size, "tEXtscene\0cornell", 17));
    assert_non_null(memmem(bytes, size, "sRGB", 4));
    free(bytes);
    image_free(&i);
    empty_folder();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(new_image_is_black),
        cmocka_unit_test(float_exr_is_exact),
        cmocka_unit_test(incompressible_exr_is_exact),
        cmocka_unit_test(half_exr_is_rounded_and_clamped),
        cmocka_unit_test(exr_holds_layers_and_attributes),
        cmocka_unit_test(exr_variants_are_read),
        cmocka_unit_test(exr_windows_are_honoured),
        cmocka_unit_test(hdr_is_read),
        cmocka_unit_test(references_have_three_colours),
        cmocka_unit_test(sample_maps_agree_with_stb),
        cmocka_unit_test(png_is_srgb),
    };
    return cmocka_run_group_tests(tests, folder_setup, folder_teardown);
}
