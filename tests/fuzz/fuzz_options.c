/* SPDX-License-Identifier: Apache-2.0 */
/* Command lines, an argument a line. Options keep their ranges, or nothing is written and one line says why. */
#include "fuzz.h"

#include "../../renderers/common/options.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    enum { MOST = 32 };
    char *text = malloc(size + 1), *argv[MOST + 1];
    if (!text)
        abort();
    memcpy(text, data, size);
    text[size] = 0;
    int argc = 0;
    argv[argc++] = (char *)"program";
    for (char *line = text; line && argc < MOST; argc++) {
        char *end = strchr(line, '\n');
        argv[argc] = line;
        if (end)
            *end++ = 0;
        line = end;
    }
    argv[argc] = NULL;
    static const char *const modes[] = {"exact", "cache[=TEXT]", "estimate", NULL};
    bool flag = false, wide = false;
    int number = 5, mode = 1;
    uint64_t seed = 7;
    float real = 1.0f, look[7] = {0};
    option_size image = {3, 4};
    const char *name = "none", *detail = NULL, *positional = "scene", *flag_text = NULL;
    option_list files = {.count = 0};
    const option table[] = {
        {.name = "flag", .letter = 'f', .kind = OPTION_FLAG, .value = &flag, .help = "a flag"},
        {.name = "wide", .kind = OPTION_FLAG, .value = &wide, .detail = &flag_text, .help = "a flag with a text"},
        {.name = "number",
         .letter = 'n',
         .kind = OPTION_INT,
         .value = &number,
         .min = -3,
         .max = 100,
         .help = "a number"},
        {.name = "seed", .kind = OPTION_UINT64, .value = &seed, .help = "a large number"},
        {.name = "real", .kind = OPTION_FLOAT, .value = &real, .min = 0.01, .max = 1e4, .help = "a real number"},
        {.name = "look", .kind = OPTION_FLOATS, .value = look, .count = 7, .min = -1e9, .max = 1e9, .help = "seven"},
        {.name = "size", .kind = OPTION_SIZE, .value = &image, .help = "a size"},
        {.name = "mode",
         .kind = OPTION_CHOICE,
         .value = &mode,
         .choices = modes,
         .detail = &detail,
         .help = "a choice"},
        {.name = "name", .kind = OPTION_STRING, .value = &name, .help = "a text"},
        {.name = "output", .letter = 'o', .kind = OPTION_LIST, .value = &files, .help = "texts"},
    };
    const option_program program = {"program", "Fuzz.", "[SCENE]", "a scene", &positional};
    message err = {""};
    bool help = false;
    for (int i = 1; i < argc; i++)
        help |= strstr(argv[i], "-h") != NULL; /* would be printed */
    if (!help) {
        options_status s = options_parse(&program, table, sizeof table / sizeof *table, argc, argv, &err);
        ENSURE(s != OPTIONS_HELP);
        if (s == OPTIONS_ERROR) {
            ENSURE(err.text[0] && !strchr(err.text, '\n') && !strncmp(err.text, "program: ", 9));
            ENSURE(!flag && !wide && number == 5 && seed == 7 && real == 1.0f && files.count == 0 && mode == 1);
        } else {
            ENSURE(number >= -3 && number <= 100 && real >= 0.01f && real <= 1e4f && mode >= 0 && mode < 3);
            ENSURE(image.width >= 1 && image.width <= 65535 && image.height >= 1 && image.height <= 65535);
            ENSURE(files.count >= 0 && files.count <= OPTION_LIST_MAX && name && *name);
            for (int i = 0; i < 7; i++)
                ENSURE(fabsf(look[i]) <= 1e9f);
        }
    }
    free(text);
    return 0;
}
