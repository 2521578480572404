/* SPDX-License-Identifier: Apache-2.0 */
/* Command-line parsing; see options.h. Arguments are read twice: the first reading checks them all, the second one
 * writes, so that --help shows the defaults wherever it stands and an error leaves the values alone. */
#include "options_value.h"

#include <string.h>

#define NAME_MAX_LENGTH 40 /* longer names get no suggestion */
#define HELP_COLUMNS 100
#define LEFT_MAX 34 /* longer option names put their help on a line of its own */

typedef struct parser {
    const option_program *program;
    const option *table;
    size_t count;
    message *err;
    bool commit; /* second reading: write the values */
    int listed;  /* values of repeatable options so far */
    bool positional_given;
} parser;

/* --- messages --- */

static bool bad_value(const parser *p, const char *given, const option *o, const char *text)
{
    char allowed[256];
    option_allowed(o, allowed, sizeof allowed);
    return fail(p->err, "%s: bad value '%.100s' for '%s'; allowed: %s", p->program->name, text, given, allowed);
}

static size_t min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* Damerau-Levenshtein distance (optimal string alignment): insert, delete, replace, swap neighbours. */
static size_t edit_distance(const char *a, const char *b)
{
    size_t n = strlen(a), m = strlen(b), d[NAME_MAX_LENGTH + 1][NAME_MAX_LENGTH + 1];
    if (n > NAME_MAX_LENGTH || m > NAME_MAX_LENGTH)
        return SIZE_MAX;
    for (size_t i = 0; i <= n; i++)
        for (size_t j = 0; j <= m; j++) {
            if (i == 0 || j == 0) {
                d[i][j] = i + j;
                continue;
            }
            d[i][j] = min_size(d[i - 1][j - 1] + (a[i - 1] != b[j - 1]), min_size(d[i - 1][j], d[i][j - 1]) + 1);
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                d[i][j] = min_size(d[i][j], d[i - 2][j - 2] + 1);
        }
    return d[n][m];
}

typedef struct guess {
    const char *name;
    size_t distance; /* only what is nearer is taken */
} guess;

static guess no_guess(const char *word)
{
    return (guess){NULL, strlen(word) / 3 + 2}; /* beyond, the names have nothing in common */
}

static void consider(guess *g, const char *word, const char *name)
{
    size_t distance = edit_distance(word, name);
    if (distance < g->distance)
        *g = (guess){name, distance};
}

const char *options_suggest(const char *word, const char *const *names)
{
    guess g = no_guess(word);
    for (; *names; names++)
        consider(&g, word, *names);
    return g.name;
}

static bool unknown_option(const parser *p, const char *given, const char *name)
{
    guess g = no_guess(name);
    for (size_t i = 0; i < p->count; i++)
        consider(&g, name, p->table[i].name);
    consider(&g, name, "help");
    if (g.name)
        return fail(p->err, "%s: unknown option '%.100s'; did you mean '--%s'?", p->program->name, given, g.name);
    return fail(p->err, "%s: unknown option '%.100s'; --help lists all", p->program->name, given);
}

/* --- arguments --- */

static const option *find_option(const parser *p, const char *name, size_t length)
{
    for (size_t i = 0; i < p->count; i++)
        if (strlen(p->table[i].name) == length && memcmp(p->table[i].name, name, length) == 0)
            return &p->table[i];
    return NULL;
}

static const option *find_letter(const parser *p, char letter)
{
    for (size_t i = 0; i < p->count; i++)
        if (p->table[i].letter == letter)
            return &p->table[i];
    return NULL;
}

static bool take_positional(parser *p, const char *text)
{
    if (!p->program->positional || p->positional_given)
        return fail(p->err, "%s: unexpected argument '%.100s'", p->program->name, text);
    if (!*text)
        return fail(p->err, "%s: empty argument where %s should stand", p->program->name, p->program->positional);
    p->positional_given = true;
    if (p->commit)
        *p->program->positional_value = text;
    return true;
}

/* Takes the option in argv[*at] with its value and moves *at to the last argument used. */
static bool take_option(parser *p, int argc, char *const argv[], int *at)
{
    const char *arg = argv[*at], *value = NULL;
    const option *o;
    char given[NAME_MAX_LENGTH + 3]; /* as the user wrote it, without the value */
    if (arg[1] == '-') {
        size_t length = strcspn(arg, "=");
        value = arg[length] ? arg + length + 1 : NULL;
        snprintf(given, sizeof given, "%.*s", (int)min_size(length, sizeof given), arg);
        o = find_option(p, arg + 2, length - 2);
    } else {
        snprintf(given, sizeof given, "%s", arg);
        o = arg[2] ? NULL : find_letter(p, arg[1]);
    }
    if (!o)
        return unknown_option(p, given, given + 1 + (given[1] == '-'));
    if (o->kind == OPTION_FLAG && value && !o->detail)
        return fail(p->err, "%s: option '%s' takes no value", p->program->name, given);
    if (o->kind != OPTION_FLAG && !value) {
        if (*at + 1 == argc || strncmp(argv[*at + 1], "--", 2) == 0)
            return fail(p->err, "%s: option '%s' needs a value", p->program->name, given);
        value = argv[++*at];
    }
    if (o->kind == OPTION_LIST && ++p->listed > OPTION_LIST_MAX)
        return fail(p->err, "%s: option '%s' is given too often; at most %d are taken", p->program->name, given,
                    OPTION_LIST_MAX);
    return option_read(o, value, p->commit) || bad_value(p, given, o, value);
}

static options_status read_arguments(parser *p, int argc, char *const argv[])
{
    bool options_end = false;
    for (int i = 1; i < argc; i++) {
        const char *arg = argv[i];
        bool ok;
        if (options_end || arg[0] != '-' || arg[1] == '\0') {
            ok = take_positional(p, arg);
        } else if (strcmp(arg, "--") == 0) {
            ok = options_end = true;
        } else if (strcmp(arg, "--help") == 0 || strcmp(arg, "-h") == 0) {
            return OPTIONS_HELP;
        } else {
            ok = take_option(p, argc, argv, &i);
        }
        if (!ok)
            return OPTIONS_ERROR;
    }
    return OPTIONS_OK;
}

options_status options_parse(const option_program *program, const option *table, size_t count, int argc,
                             char *const argv[], message *err)
{
    parser check = {.program = program, .table = table, .count = count, .err = err};
    parser write = check;
    write.commit = true;
    options_status status = read_arguments(&check, argc, argv);
    if (status == OPTIONS_OK)
        return read_arguments(&write, argc, argv);
    if (status == OPTIONS_HELP)
        options_print_help(stdout, program, table, count);
    return status;
}

/* --- help --- */

/* What stands left of the help text. */
static void option_usage(const option *o, char *out, size_t size)
{
    static const char *const words[] = {
        [OPTION_FLAG] = "TEXT",    [OPTION_INT] = "N",    [OPTION_UINT64] = "N",    [OPTION_FLOAT] = "X",
        [OPTION_FLOATS] = "X,...", [OPTION_SIZE] = "WxH", [OPTION_STRING] = "TEXT", [OPTION_LIST] = "TEXT",
    };
    char choices[256], letter[8] = "    ";
    const char *word = o->metavar ? o->metavar : words[o->kind];
    if (o->letter)
        snprintf(letter, sizeof letter, "-%c, ", o->letter);
    if (o->kind == OPTION_CHOICE && !o->metavar) {
        option_choices(o, "|", choices, sizeof choices);
        word = choices;
    }
    if (o->kind != OPTION_FLAG)
        snprintf(out, size, "%s--%s %s", letter, o->name, word);
    else if (o->detail)
        snprintf(out, size, "%s--%s[=%s]", letter, o->name, word);
    else
        snprintf(out, size, "%s--%s", letter, o->name);
}

/* Prints `left` and beside it the help text, broken between words into the columns from `indent` on. */
static void print_entry(FILE *out, size_t indent, const char *left, const char *help, const char *initial)
{
    char text[512];
    if (initial && *initial)
        snprintf(text, sizeof text, "%s [%s]", help, initial);
    else
        snprintf(text, sizeof text, "%s", help);
    size_t column = strlen(left) + 2;
    fprintf(out, "  %s", left);
    if (column + 2 > indent) {
        fputc('\n', out);
        column = 0;
    }
    for (const char *word = text; *word;) {
        size_t length = strcspn(word, " ");
        if (column > indent && column + 1 + length > HELP_COLUMNS) {
            fputc('\n', out);
            column = 0;
        }
        int gap = column < indent ? (int)(indent - column) : 1;
        fprintf(out, "%*s%.*s", gap, "", (int)length, word);
        column += (size_t)gap + length;
        word += length + strspn(word + length, " ");
    }
    fputc('\n', out);
}

void options_print_help(FILE *out, const option_program *program, const option *table, size_t count)
{
    char left[320], initial[128];
    size_t widest = strlen("-h, --help");
    for (size_t i = 0; i < count; i++) {
        option_usage(&table[i], left, sizeof left);
        size_t length = strlen(left);
        if (length > widest && length <= LEFT_MAX)
            widest = length;
    }
    size_t indent = widest + 4;

    fprintf(out, "Usage: %s [options]", program->name);
    if (program->positional)
        fprintf(out, " %s", program->positional);
    fprintf(out, "\n%s\n", program->summary);
    if (program->positional)
        print_entry(out, indent, program->positional, program->positional_help, *program->positional_value);
    for (size_t i = 0; i < count; i++) {
        option_usage(&table[i], left, sizeof left);
        option_default(&table[i], initial, sizeof initial);
        print_entry(out, indent, left, table[i].help, initial);
    }
    print_entry(out, indent, "-h, --help", "show this help", NULL);
}
