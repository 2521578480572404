/* SPDX-License-Identifier: Apache-2.0 */
/* Damaged, unsupported and unwritable image files: one clear line, no crash, nothing left behind. Meant to run with the
 * sanitizers as well. */
#include "image.h"
#include "image_fixture.h"
#include "rng.h"

#include <errno.h>
#include <fcntl.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <cmocka.h> /* after message.h, whose fail() is a macro there */

static message err;

/* True if the file loads; otherwise checks that the failure is a tidy one. */
static bool loads(const char *path)
{
    image i = {7, 7, NULL};
    err.text[0] = '\0';
    bool good = image_load(path, &i, &err);
    if (good) {
        assert_true(i.width > 0 && i.height > 0);
        assert_non_null(i.pixels);
    } else {
        assert_int_equal(i.width, 0);
        assert_null(i.pixels);
        assert_true(strlen(err.text) > 20);
        assert_null(strchr(err.text, '\n'));
        assert_non_null(strstr(err.text, path));
    }
    image_free(&i);
    return good;
}

static void expect_refusal(const char *path, const char *words)
{
    assert_false(loads(path));
    if (!strstr(err.text, words))
        fail_msg("'%s' does not say '%s'", err.text, words);
}

static void unsupported_exr_is_named(void **state)
{
    (void)state;
    const exr_variant plain = {.storage = EXR_STORAGE_SCANLINE,
                               .compression = EXR_COMPRESSION_NONE,
                               .type = EXR_PIXEL_HALF,
                               .names = "RGB",
                               .width = 8,
                               .height = 8,
                               .tile = 8};
    char file[512];
    strcpy(file, in_folder("u.exr"));
    exr_variant v = plain;
    v.names = "RG";
    assert_true(put_exr(file, &v));
    expect_refusal(file, "neither the channels R, G, B");
    v = plain;
    v.sampling = 2;
    v.header_only = true;
    put_exr(file, &v);
    expect_refusal(file, "subsampled");
    v = plain;
    v.storage = EXR_STORAGE_DEEP_SCANLINE;
    v.header_only = true;
    put_exr(file, &v);
    expect_refusal(file, "deep");
    v = plain;
    v.second_part = v.header_only = true;
    put_exr(file, &v);
    expect_refusal(file, "several parts");
    v = plain;
    v.multi_view = true;
    assert_true(put_exr(file, &v));
    expect_refusal(file, "several views");
    v = plain;
    v.header_only = true;
    put_exr(file, &v);
    expect_refusal(file, "rows from 0");
    v.storage = EXR_STORAGE_TILED;
    put_exr(file, &v);
    expect_refusal(file, "tile (0, 0)");

    /* DWAA, which the library does not write: set in the header by hand. */
    assert_true(put_exr(file, &plain));
    size_t size = 0;
    unsigned char *bytes = file_bytes(file, &size);
    unsigned char *at = memmem(bytes, size, "compression\0compression\0\1\0\0\0", 28);
    assert_non_null(at);
    at[28] = 8;
    put_bytes(file, bytes, size);
    expect_refusal(file, "DWAA");
    at[28] = 0;

    /* An absurd size. */
    at = memmem(bytes, size, "dataWindow\0box2i\0\20\0\0\0", 21);
    assert_non_null(at);
    memcpy(at + 21 + 8, "\377\377\0\1\377\377\0\1", 8);
    put_bytes(file, bytes, size);
    expect_refusal(file, "usable size");
    memcpy(at + 21, "\0\0\0\200\0\0\0\200\377\377\377\177\377\377\377\177", 16);
    put_bytes(file, bytes, size);
    assert_false(loads(file));
    free(bytes);
    empty_folder();
}

static void other_files_are_refused(void **state)
{
    (void)state;
    expect_refusal(in_folder("absent.exr"), "No such file");
    expect_refusal(image_folder, "not a regular file");
    char file[512];
    strcpy(file, in_folder("pipe.hdr"));
    assert_int_equal(mkfifo(file, 0600), 0);
    alarm(20); /* nobody writes to it */
    expect_refusal(file, "not a regular file");
    alarm(0);
    strcpy(file, in_folder("x.hdr"));
    static const struct {
        const char *text, *words;
    } cases[] = {{"", "neither"},
                 {"PNG or something", "neither"},
                 {"#?RADIANCE\n", "cut off"},
                 {"#?RADIANCE\n\n-Y 1 +X 1\nabcd", "FORMAT"},
                 {"#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nabcd", "FORMAT"},
                 {"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n+Y 1 +X 1\nabcd", "-Y height"},
                 {"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 0 +X 1\nabcd", "usable size"},
                 {"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y -3 +X 1\nabcd", "usable size"},
                 {"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1000000 +X 1000000\nabcd", "too short"},
                 {"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 9999999999 +X 1\nabcd", "usable size"},
                 {"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 1\nabcd", "row 1"}};
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; ++c) {
        put_bytes(file, cases[c].text, strlen(cases[c].text));
        expect_refusal(file, cases[c].words);
    }
    empty_folder();
}

/* --- cut off and flipped --- */

typedef bool (*visit)(const char *file, const unsigned char *bytes, size_t size);

static void every_file(visit each, int *counts)
{
    /* In memory: thousands of files are slow on a disk. */
    char file[64];
    int memory = memfd_create("image", 0);
    assert_true(memory >= 0);
    snprintf(file, sizeof file, "/proc/self/fd/%d", memory);
    size_t size = 0;
    static unsigned char hdr[1 << 14];
    for (int coded = 0; coded < 2; ++coded) {
        size = hdr_bytes(hdr, coded ? 40 : 6, 5, coded != 0);
        counts[0] += each(file, hdr, size);
    }
    for (int c = EXR_COMPRESSION_NONE; c <= EXR_COMPRESSION_B44A; ++c)
        for (int tiled = 0; tiled < 2; ++tiled) {
            exr_variant v = {.storage = tiled ? EXR_STORAGE_TILED : EXR_STORAGE_SCANLINE,
                             .compression = (exr_compression_t)c,
                             .type = c % 2 ? EXR_PIXEL_FLOAT : EXR_PIXEL_HALF,
                             .names = "RGB",
                             .width = 19,
                             .height = 9,
                             .tile = 12};
            if (c >= EXR_COMPRESSION_B44)
                v.type = EXR_PIXEL_HALF;
            assert_true(put_exr(file, &v));
            unsigned char *bytes = file_bytes(file, &size);
            counts[0] += each(file, bytes, size);
            free(bytes);
        }
    close(memory);
    counts[1] = 2 + 2 * (EXR_COMPRESSION_B44A + 1);
}

static bool every_cut_fails(const char *file, const unsigned char *bytes, size_t size)
{
    for (size_t n = 0; n < size; ++n) {
        put_bytes(file, bytes, n);
        if (loads(file))
            fail_msg("%s loads although cut to %zu of %zu bytes", file, n, size);
    }
    put_bytes(file, bytes, size);
    return loads(file);
}

static bool flips_do_no_harm(const char *file, const unsigned char *bytes, size_t size)
{
    rng r = rng_make(3, size);
    unsigned char *copy = malloc(size);
    int refused = 0;
    for (int f = 0; f < 500; ++f) {
        memcpy(copy, bytes, size);
        copy[rng_u32(&r) % size] ^= (unsigned char)(1u << rng_u32(&r) % 8);
        put_bytes(file, copy, size);
        refused += !loads(file);
    }
    free(copy);
    return refused > 0 && refused < 500;
}

static void cut_off_files_are_refused(void **state)
{
    (void)state;
    int counts[2] = {0, 0};
    every_file(every_cut_fails, counts);
    assert_int_equal(counts[0], counts[1]);
    empty_folder();
}

static void flipped_files_do_no_harm(void **state)
{
    (void)state;
    int counts[2] = {0, 0};
    every_file(flips_do_no_harm, counts);
    assert_int_equal(counts[0], counts[1]);
    empty_folder();
}

/* The same once more, for what the libraries underneath may print. */
static void damaged_files_print_nothing(void **state)
{
    (void)state;
    int counts[2] = {0, 0};
    char log[512];
    strcpy(log, in_folder("stderr.txt"));
    fflush(stderr);
    int saved = dup(2), to = open(log, O_WRONLY | O_CREAT | O_TRUNC, 0600);
    dup2(to, 2);
    close(to);
    every_file(flips_do_no_harm, counts);
    fflush(stderr);
    dup2(saved, 2);
    close(saved);
    size_t printed = 1;
    free(file_bytes(log, &printed));
    assert_int_equal(printed, 0);
    empty_folder();
}

/* --- writing --- */

static bool write_exr(const char *path, const image *i, bool tiles)
{
    const exr_channel channels[3] = {{"R", &i->pixels[0].x, 3}, {"G", &i->pixels[0].y, 3}, {"B", &i->pixels[0].z, 3}};
    return exr_save(path, i->width, i->height, channels, 3, NULL, 0, (exr_options){.tiles = tiles}, &err);
}

static bool write_image(int format, const char *path, const image *i)
{
    err.text[0] = '\0';
    bool good = format == 2 ? png_save(path, i, 1.0f, NULL, 0, &err) : write_exr(path, i, format == 1);
    if (!good) {
        assert_non_null(strstr(err.text, path));
        assert_null(strchr(err.text, '\n'));
    }
    return good;
}

static image noise(void)
{
    image i = image_new(200, 150);
    rng r = rng_make(5, 5);
    for (size_t p = 0; p < 200 * 150; ++p)
        i.pixels[p] = v3(rng_float(&r), rng_float(&r), rng_float(&r));
    return i;
}

static void unwritable_paths_are_named(void **state)
{
    (void)state;
    image i = noise();
    char file[512];
    for (int format = 0; format < 3; ++format) {
        strcpy(file, in_folder("no/such/folder/a.img"));
        assert_false(write_image(format, file, &i));
        assert_non_null(strstr(err.text, "No such file or directory"));
        assert_false(write_image(format, image_folder, &i));
        assert_non_null(strstr(err.text, "folder"));
        assert_false(write_image(format, "/dev/full", &i));
        assert_non_null(strstr(err.text, "not a regular file"));
    }
    struct stat info;
    assert_int_equal(stat("/dev/full", &info), 0);
    assert_true(S_ISCHR(info.st_mode));
    assert_int_equal(files_in_folder(), 0);
    image_free(&i);
}

/* A limit on the size of files stands in for a full disk. */
static void full_disk_leaves_nothing(void **state)
{
    (void)state;
    image i = noise();
    char file[512];
    strcpy(file, in_folder("full.img"));
    struct rlimit before, tight;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    signal(SIGXFSZ, SIG_IGN);
    static const rlim_t limits[] = {0, 100, 5000, 60000};
    for (int format = 0; format < 3; ++format)
        for (size_t l = 0; l < sizeof limits / sizeof limits[0]; ++l) {
            tight = before;
            tight.rlim_cur = limits[l];
            setrlimit(RLIMIT_FSIZE, &tight);
            bool good = write_image(format, file, &i);
            setrlimit(RLIMIT_FSIZE, &before);
            assert_false(good);
            assert_non_null(strstr(err.text, strerror(EFBIG)));
            assert_int_equal(files_in_folder(), 0);

            /* an older file stays as it was */
            put_bytes(file, "old", 3);
            setrlimit(RLIMIT_FSIZE, &tight);
            good = write_image(format, file, &i);
            setrlimit(RLIMIT_FSIZE, &before);
            assert_false(good);
            size_t size = 0;
            unsigned char *bytes = file_bytes(file, &size);
            assert_int_equal(size, 3);
            assert_memory_equal(bytes, "old", 3);
            free(bytes);
            assert_int_equal(files_in_folder(), 1);
            empty_folder();
        }
    image small = image_new(2, 2); /* it waits in the stream's buffer until the file is closed */
    for (int format = 0; format < 3; ++format) {
        tight.rlim_cur = 0;
        setrlimit(RLIMIT_FSIZE, &tight);
        bool good = write_image(format, file, &small);
        setrlimit(RLIMIT_FSIZE, &before);
        assert_true(!good && files_in_folder() == 0);
    }
    image_free(&small);
    for (int format = 0; format < 3; ++format) /* and without the limit all is well */
        assert_true(write_image(format, file, &i));
    signal(SIGXFSZ, SIG_DFL);
    image_free(&i);
    empty_folder();
}

static void links_are_followed(void **state)
{
    (void)state;
    image i = noise();
    char file[512], name[512];
    strcpy(file, in_folder("real.exr"));
    strcpy(name, in_folder("link.exr"));
    put_bytes(file, "old", 3);
    assert_int_equal(symlink("real.exr", name), 0);
    assert_true(write_exr(name, &i, false));
    struct stat info;
    assert_int_equal(lstat(name, &info), 0);
    assert_true(S_ISLNK(info.st_mode));
    assert_true(loads(file));
    mode_t mask = umask(0);
    umask(mask);
    assert_int_equal(stat(file, &info), 0);
    assert_int_equal(info.st_mode & 0777, 0666 & ~mask);

    /* whose end is not there yet: it is made, by one link and by two */
    char second[512];
    strcpy(second, in_folder("second.exr"));
    assert_int_equal(symlink(name, second), 0);
    for (int k = 0; k < 2; k++) {
        unlink(file);
        assert_true(write_exr(k ? second : name, &i, false));
        assert_true(lstat(name, &info) == 0 && S_ISLNK(info.st_mode));
        assert_true(lstat(second, &info) == 0 && S_ISLNK(info.st_mode));
        assert_true(lstat(file, &info) == 0 && S_ISREG(info.st_mode));
        assert_int_equal(files_in_folder(), 3);
    }
    unlink(name);
    assert_int_equal(symlink("second.exr", name), 0); /* in a circle */
    assert_false(write_exr(name, &i, false));
    assert_non_null(strstr(err.text, strerror(ELOOP)));
    unlink(name);
    assert_int_equal(symlink("nowhere/x.exr", name), 0);
    assert_false(write_exr(name, &i, false));
    assert_true(lstat(name, &info) == 0 && S_ISLNK(info.st_mode));
    image_free(&i);
    empty_folder();
}

static void bad_arguments_are_refused(void **state)
{
    (void)state;
    char file[512], longest[300];
    strcpy(file, in_folder("a.img"));
    memset(longest, 'x', sizeof longest);
    longest[sizeof longest - 1] = '\0';
    const float z[4] = {0, 0, 0, 0};
    const exr_channel good = {"Z", z, 1}, twice[2] = {{"Z", z, 1}, {"Z", z, 1}}, nameless = {"", z, 1},
                      too_long = {longest, z, 1};
    const exr_options o = {0};
    assert_false(exr_save(file, 0, 2, &good, 1, NULL, 0, o, &err));
    assert_false(exr_save(file, 1u << 20, 1u << 20, &good, 1, NULL, 0, o, &err));
    assert_false(exr_save(file, 2, 2, &good, 0, NULL, 0, o, &err));
    assert_false(exr_save(file, 2, 2, twice, 2, NULL, 0, o, &err));
    assert_non_null(strstr(err.text, "twice"));
    assert_false(exr_save(file, 2, 2, &nameless, 1, NULL, 0, o, &err));
    assert_false(exr_save(file, 2, 2, &too_long, 1, NULL, 0, o, &err));
    static const char *const names[] = {"", "type", "name", "version", "chunkCount", "dataWindow", "channels"};
    for (size_t n = 0; n < sizeof names / sizeof names[0]; ++n) {
        const exr_attribute a = {names[n], "text"};
        assert_false(exr_save(file, 2, 2, &good, 1, &a, 1, o, &err));
        assert_non_null(strstr(err.text, file));
    }
    image empty = {0, 0, NULL}, one = image_new(1, 1);
    const exr_attribute key = {longest, "text"};
    assert_false(png_save(file, &empty, 1.0f, NULL, 0, &err));
    assert_false(png_save(file, &one, 1.0f, &key, 1, &err));
    image wide = image_new(1000001, 1); /* libpng's own limit: an error through its longjmp */
    assert_false(png_save(file, &wide, 1.0f, NULL, 0, &err));
    assert_non_null(strstr(err.text, "IHDR"));
    assert_int_equal(files_in_folder(), 0);
    image_free(&one);
    image_free(&wide);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(unsupported_exr_is_named),    cmocka_unit_test(other_files_are_refused),
        cmocka_unit_test(cut_off_files_are_refused),   cmocka_unit_test(flipped_files_do_no_harm),
        cmocka_unit_test(damaged_files_print_nothing), cmocka_unit_test(unwritable_paths_are_named),
        cmocka_unit_test(full_disk_leaves_nothing),    cmocka_unit_test(links_are_followed),
        cmocka_unit_test(bad_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, folder_setup, folder_teardown);
}
