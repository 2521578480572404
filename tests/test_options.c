/* SPDX-License-Identifier: Apache-2.0 */
/* Command-line parser: values, messages, help. */
#include "options.h" /* before cmocka.h, which makes a macro of fail */

#include <locale.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const char *const modes[] = {"exact", "cached", "grid[=NAME]", NULL};

typedef struct settings {
    bool quiet, stats;
    int spp, threads, mode;
    uint64_t seed;
    float ce, exposure, eye[3];
    option_size size;
    option_list outputs;
    const char *grid, *stats_file, *camera, *scene;
} settings;

static const settings defaults = {
    .spp = 4, .mode = 1, .ce = 8.0f, .eye = {1, 2, 3}, .size = {640, 360}, .scene = "kitchen"};

enum { table_size = 11 };

static void fill_table(settings *s, option table[table_size])
{
    const option t[table_size] = {
        {.name = "output",
         .letter = 'o',
         .kind = OPTION_LIST,
         .value = &s->outputs,
         .metavar = "FILE",
         .help = "image"},
        {.name = "size", .kind = OPTION_SIZE, .value = &s->size, .help = "pixels of the image", .min = 1, .max = 16384},
        {.name = "spp", .kind = OPTION_INT, .value = &s->spp, .help = "eye samples per pixel", .min = 1, .max = 65536},
        {.name = "threads", .kind = OPTION_INT, .value = &s->threads, .help = "0: all CPUs"},
        {.name = "seed", .kind = OPTION_UINT64, .value = &s->seed, .help = "of the random numbers"},
        {.name = "ce", .kind = OPTION_FLOAT, .value = &s->ce, .help = "cell size in pixels", .min = 0.5, .max = 1000},
        {.name = "exposure",
         .kind = OPTION_FLOAT,
         .value = &s->exposure,
         .shown = "by brightness",
         .help = "of PNG files, in stops"},
        {.name = "eye",
         .kind = OPTION_FLOATS,
         .count = 3,
         .value = s->eye,
         .metavar = "X,Y,Z",
         .help = "camera position"},
        {.name = "visibility",
         .kind = OPTION_CHOICE,
         .value = &s->mode,
         .choices = modes,
         .detail = &s->grid,
         .help =
             "how shadow rays are answered: a text so long that it has to be broken into several lines of help, each "
             "of which stays inside of the terminal"},
        {.name = "stats",
         .kind = OPTION_FLAG,
         .value = &s->stats,
         .detail = &s->stats_file,
         .metavar = "FILE",
         .help = "counts"},
        {.name = "quiet", .letter = 'q', .kind = OPTION_FLAG, .value = &s->quiet, .help = "print errors only"},
    };
    memcpy(table, t, sizeof t);
}

static option_program make_program(settings *s)
{
    return (option_program){.name = "whitted",
                            .summary = "Whitted-style ray tracing with instant radiosity.",
                            .positional = "[SCENE]",
                            .positional_help = "file or built-in scene",
                            .positional_value = &s->scene};
}

static message text;

static options_status parse(settings *s, char *const argv[])
{
    option table[table_size];
    int argc = 0;
    while (argv[argc])
        argc++;
    *s = defaults;
    fill_table(s, table);
    option_program program = make_program(s);
    text.text[0] = '\0';
    return options_parse(&program, table, table_size, argc, argv, &text);
}

#define PARSE(s, ...) parse((s), (char *[]){"whitted", __VA_ARGS__, NULL})

/* The message must be exactly this one, and no value may have changed. */
static void refused(char *const argv[], const char *expected)
{
    settings s;
    assert_int_equal(parse(&s, argv), OPTIONS_ERROR);
    assert_string_equal(text.text, expected);
    assert_memory_equal(&s, &defaults, sizeof s);
}

#define REFUSED(expected, ...) refused((char *[]){"whitted", __VA_ARGS__, NULL}, expected)

static void no_arguments_keep_defaults(void **state)
{
    (void)state;
    settings s;
    assert_int_equal(parse(&s, (char *[]){"whitted", NULL}), OPTIONS_OK);
    assert_memory_equal(&s, &defaults, sizeof s);
    assert_int_equal(parse(&s, (char *[]){NULL}), OPTIONS_OK);
}

static void both_ways_of_writing(void **state)
{
    (void)state;
    settings s;
    assert_int_equal(PARSE(&s, "--spp", "16", "--seed=18446744073709551615", "room.glb", "-o", "a.exr",
                           "--output=b.png", "--size", "16384x1", "-q", "--output", "-"),
                     OPTIONS_OK);
    assert_int_equal(s.spp, 16);
    assert_true(s.seed == UINT64_MAX);
    assert_string_equal(s.scene, "room.glb");
    assert_int_equal(s.outputs.count, 3);
    assert_string_equal(s.outputs.items[0], "a.exr");
    assert_string_equal(s.outputs.items[1], "b.png");
    assert_string_equal(s.outputs.items[2], "-");
    assert_int_equal(s.size.width, 16384);
    assert_int_equal(s.size.height, 1);
    assert_true(s.quiet);
    assert_false(s.stats);
    assert_int_equal(PARSE(&s, "--spp=1", "--spp=2"), OPTIONS_OK);
    assert_int_equal(s.spp, 2);
}

static void numbers(void **state)
{
    (void)state;
    settings s;
    assert_int_equal(PARSE(&s, "--ce", ".5", "--exposure", "-1.5e-1", "--eye=-1,+2.,3e2", "--threads", "-3"),
                     OPTIONS_OK);
    assert_true(s.ce == 0.5f && s.exposure == -0.15f);
    assert_true(s.eye[0] == -1.0f && s.eye[1] == 2.0f && s.eye[2] == 300.0f);
    assert_int_equal(s.threads, -3);
    assert_int_equal(PARSE(&s, "--threads=-2147483648", "--exposure=1e-400", "--ce=1000"), OPTIONS_OK);
    assert_true(s.threads == INT32_MIN && s.exposure == 0.0f && s.ce == 1000.0f);
    assert_int_equal(PARSE(&s, "--threads=2147483647", "--exposure=3.4e38"), OPTIONS_OK);
    assert_int_equal(s.threads, INT32_MAX);
}

static void bad_values_are_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "--spp=12abc",
        "--spp=",
        "--spp=0",
        "--spp=65537",
        "--spp=1.5",
        "--spp= 1",
        "--spp=+1",
        "--spp=0x10",
        "--spp=-",
        "--threads=2147483648",
        "--threads=-2147483649",
        "--seed=-1",
        "--seed=",
        "--seed=18446744073709551616",
        "--seed=99999999999999999999999",
        "--ce=nan",
        "--ce=inf",
        "--ce=0.49",
        "--ce=1000.1",
        "--ce=1e999",
        "--ce=0x1p3",
        "--ce=1,5",
        "--ce=8x",
        "--ce= 8",
        "--ce=",
        "--ce=.",
        "--ce=1e",
        "--ce=1e+",
        "--exposure=1e39",
        "--exposure=infinity",
        "--exposure=-",
        "--size=640",
        "--size=640x",
        "--size=x360",
        "--size=640x360x",
        "--size=0x360",
        "--size=640x16385",
        "--size=16385x360",
        "--size=640X360",
        "--size=-1x5",
        "--size=",
        "--size=99999999999999999999x1",
        "--eye=1,2",
        "--eye=1,2,3,4",
        "--eye=1,,3",
        "--eye=1,2,3,",
        "--eye=",
        "--eye=1 2 3",
        "--visibility=",
        "--visibility=gri",
        "--visibility=grid=",
        "--visibility=exact=x",
        "--visibility=grid[=NAME]",
        "--stats=",
        "--output=",
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        settings s;
        assert_int_equal(PARSE(&s, "--spp=9", (char *)bad[i]), OPTIONS_ERROR);
        assert_non_null(strstr(text.text, "whitted: bad value '"));
        assert_null(strchr(text.text, '\n'));
        assert_memory_equal(&s, &defaults, sizeof s); /* --spp=9 was not written either */
    }
}

static void messages(void **state)
{
    (void)state;
    REFUSED("whitted: unknown option '--sp'; did you mean '--spp'?", "--sp", "3");
    REFUSED("whitted: unknown option '--visiblity'; did you mean '--visibility'?", "--visiblity=grid");
    REFUSED("whitted: unknown option '--szie'; did you mean '--size'?", "--szie=3x3");
    REFUSED("whitted: unknown option '--ec'; did you mean '--ce'?", "--ec", "8");
    REFUSED("whitted: unknown option '-size'; did you mean '--size'?", "-size");
    REFUSED("whitted: unknown option '--hlep'; did you mean '--help'?", "--hlep");
    REFUSED("whitted: unknown option '--wavelength'; --help lists all", "--wavelength");
    REFUSED("whitted: unknown option '-x'; --help lists all", "-x");
    REFUSED("whitted: bad value '0' for '--spp'; allowed: a whole number from 1 to 65536", "--spp", "0");
    REFUSED("whitted: bad value 'x' for '--threads'; allowed: a whole number", "--threads", "x");
    REFUSED("whitted: bad value '5' for '--size'; allowed: WIDTHxHEIGHT, each from 1 to 16384", "--size", "5");
    REFUSED("whitted: bad value '1' for '--eye'; allowed: 3 finite numbers, separated by commas", "--eye", "1");
    REFUSED("whitted: bad value 'x' for '--ce'; allowed: a finite number from 0.5 to 1000", "--ce", "x");
    REFUSED("whitted: bad value 'x' for '--visibility'; allowed: exact, cached, grid[=NAME]", "--visibility", "x");
    REFUSED("whitted: bad value '' for '-o'; allowed: a text that is not empty", "-o", "");
    REFUSED("whitted: bad value 'a?b' for '--seed'; allowed: a whole number from 0 to 2^64 - 1", "--seed", "a\nb");
    REFUSED("whitted: option '--spp' needs a value", "--spp");
    REFUSED("whitted: option '-o' needs a value", "-o", "--quiet");
    REFUSED("whitted: option '--quiet' takes no value", "--quiet=1");
    REFUSED("whitted: unexpected argument 'b'", "a", "b");
    REFUSED("whitted: empty argument where [SCENE] should stand", "");
    REFUSED("whitted: unknown option '--'; --help lists all", "--=3");
}

static void suggestions(void **state)
{
    (void)state;
    static const char *const names[] = {"atrium", "cornell", "shapes", NULL};
    assert_string_equal(options_suggest("cornel", names), "cornell");
    assert_string_equal(options_suggest("artium", names), "atrium");
    assert_null(options_suggest("kitchen", names));
    assert_null(options_suggest("cornell", names + 3));
}

/* Whatever stands in file names, a message is one line. */
static void one_line(void **state)
{
    (void)state;
    message m;
    assert_false((fail)(&m, "%s: a\tb", "x\ny\r\033[1m\177z\303\244"));
    assert_string_equal(m.text, "x?y??[1m?z\303\244: a?b");
}

static void texts_behind_flags_and_choices(void **state)
{
    (void)state;
    settings s;
    assert_int_equal(PARSE(&s, "--visibility", "grid", "--stats", "scene.ply"), OPTIONS_OK);
    assert_int_equal(s.mode, 2);
    assert_null(s.grid);
    assert_true(s.stats);
    assert_null(s.stats_file);
    assert_string_equal(s.scene, "scene.ply");
    assert_int_equal(PARSE(&s, "--visibility=grid=a=b", "--stats=s.json"), OPTIONS_OK);
    assert_int_equal(s.mode, 2);
    assert_string_equal(s.grid, "a=b");
    assert_string_equal(s.stats_file, "s.json");
    assert_int_equal(PARSE(&s, "--visibility=grid=a", "--visibility", "exact"), OPTIONS_OK);
    assert_int_equal(s.mode, 0);
    assert_null(s.grid);
}

static void end_of_options(void **state)
{
    (void)state;
    settings s;
    assert_int_equal(PARSE(&s, "-q", "--", "--help"), OPTIONS_OK);
    assert_string_equal(s.scene, "--help");
    REFUSED("whitted: unexpected argument '--quiet'", "--", "a", "--quiet");
    assert_int_equal(PARSE(&s, "--output=--x"), OPTIONS_OK);
    assert_string_equal(s.outputs.items[0], "--x");
}

static void repeatable_options_have_a_limit(void **state)
{
    (void)state;
    char *argv[2 * (OPTION_LIST_MAX + 1) + 2] = {"whitted"};
    settings s;
    for (int i = 0; i < OPTION_LIST_MAX; i++) {
        argv[2 * i + 1] = "-o";
        argv[2 * i + 2] = "x";
    }
    assert_int_equal(parse(&s, argv), OPTIONS_OK);
    assert_int_equal(s.outputs.count, OPTION_LIST_MAX);
    argv[2 * OPTION_LIST_MAX + 1] = "-o";
    argv[2 * OPTION_LIST_MAX + 2] = "y";
    refused(argv, "whitted: option '-o' is given too often; at most 16 are taken");
}

static void no_positional(void **state)
{
    (void)state;
    option_program program = {.name = "bench", .summary = "Measures."};
    bool fast = false;
    const option table[] = {{.name = "fast", .kind = OPTION_FLAG, .value = &fast, .help = "fewer runs"}};
    char *argv[] = {"bench", "--fast", "scene", NULL};
    assert_int_equal(options_parse(&program, table, 1, 3, argv, &text), OPTIONS_ERROR);
    assert_string_equal(text.text, "bench: unexpected argument 'scene'");
    assert_false(fast);
    assert_int_equal(options_parse(&program, table, 1, 3, argv, NULL), OPTIONS_ERROR);
    assert_int_equal(options_parse(&program, table, 1, 2, argv, NULL), OPTIONS_OK);
    assert_true(fast);
}

static void help_is_one_screen(void **state)
{
    (void)state;
    settings s = defaults;
    option table[table_size];
    option_program program = make_program(&s);
    fill_table(&s, table);
    char *out = NULL;
    size_t bytes;
    FILE *stream = open_memstream(&out, &bytes);
    assert_non_null(stream);
    options_print_help(stream, &program, table, table_size);
    fclose(stream);

    assert_int_equal(strncmp(out, "Usage: whitted [options] [SCENE]\n", 33), 0);
    static const char *const lines[] = {
        "\n  [SCENE]   ",
        "file or built-in scene [kitchen]\n",
        "\n  -o, --output FILE ",
        "\n      --spp N ",
        "eye samples per pixel [4]\n",
        "\n      --size WxH ",
        "[640x360]\n",
        "[1,2,3]\n",
        "of PNG files, in stops [by brightness]\n",
        "cell size in pixels [8]\n",
        "\n  -q, --quiet ",
        "\n      --stats[=FILE] ",
        "[0]\n",
        "\n      --visibility exact|cached|grid[=NAME]\n",
        "\n  -h, --help ",
        "[cached]\n",
    };
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        assert_non_null(strstr(out, lines[i]));
    int line_count = 0;
    size_t widest = 0;
    for (char *line = out; *line; line_count++) {
        size_t length = strcspn(line, "\n");
        assert_in_range(length, 0, 100);
        widest = length > widest ? length : widest;
        line += length + 1;
    }
    assert_in_range(line_count, 16, 20);
    assert_in_range(widest, 85, 100); /* long texts are broken no earlier than needed */
    free(out);
}

static void help_wins_and_shows_defaults(void **state)
{
    (void)state;
    settings s;
    assert_int_equal(PARSE(&s, "--spp=16", "--help"), OPTIONS_HELP);
    assert_int_equal(s.spp, 4);
    assert_int_equal(PARSE(&s, "-h"), OPTIONS_HELP);
}

static void numbers_ignore_the_locale(void **state)
{
    (void)state;
    static const char *const names[] = {"de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "fr_FR"};
    bool comma = false;
    for (size_t i = 0; i < sizeof names / sizeof *names && !comma; i++)
        comma = setlocale(LC_ALL, names[i]) && localeconv()->decimal_point[0] == ',';
    if (!comma)
        skip(); /* no such locale is installed */
    settings s;
    options_status comma_status = PARSE(&s, "--ce=1,5"), point_status = PARSE(&s, "--ce", "1.5");
    setlocale(LC_ALL, "C");
    assert_int_equal(comma_status, OPTIONS_ERROR);
    assert_int_equal(point_status, OPTIONS_OK);
    assert_true(s.ce == 1.5f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_arguments_keep_defaults),
        cmocka_unit_test(both_ways_of_writing),
        cmocka_unit_test(numbers),
        cmocka_unit_test(bad_values_are_refused),
        cmocka_unit_test(messages),
        cmocka_unit_test(suggestions),
        cmocka_unit_test(one_line),
        cmocka_unit_test(texts_behind_flags_and_choices),
        cmocka_unit_test(end_of_options),
        cmocka_unit_test(repeatable_options_have_a_limit),
        cmocka_unit_test(no_positional),
        cmocka_unit_test(help_is_one_screen),
        cmocka_unit_test(help_wins_and_shows_defaults),
        cmocka_unit_test(numbers_ignore_the_locale),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
