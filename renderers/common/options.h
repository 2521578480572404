/* SPDX-License-Identifier: Apache-2.0 */
/* Command-line options from a table. A renderer lists its options once; parsing, range checks, messages and --help
 * follow.
 *
 * Syntax: --name VALUE, --name=VALUE, -x VALUE, flags, at most one positional argument; `--` ends the options. A value
 * that starts with `--` must be given as --name=VALUE. Of an option given twice the last one counts. Numbers are
 * decimal and independent of the locale; infinities, NaN, hexadecimal, trailing characters and empty values are
 * refused. */
#ifndef COMMON_OPTIONS_H
#define COMMON_OPTIONS_H

#include "message.h"

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#define OPTION_LIST_MAX 16

typedef struct option_size {
    uint32_t width, height;
} option_size;

/* Of an option that may be given several times. Empty before parsing; all such options together take at most
 * OPTION_LIST_MAX values. */
typedef struct option_list {
    const char *items[OPTION_LIST_MAX]; /* point into argv */
    int count;
} option_list;

/* What `value` of an option points to. It holds the default before parsing, which --help shows. */
typedef enum option_kind {
    OPTION_FLAG,   /* bool, set to true */
    OPTION_INT,    /* int in [min, max] */
    OPTION_UINT64, /* uint64_t */
    OPTION_FLOAT,  /* float in [min, max] */
    OPTION_FLOATS, /* float[count], each in [min, max], separated by commas */
    OPTION_SIZE,   /* option_size as WxH, each side in [min, max] */
    OPTION_CHOICE, /* int, index into `choices` */
    OPTION_STRING, /* const char *, not empty; points into argv */
    OPTION_LIST    /* option_list of such strings */
} option_kind;

typedef struct option {
    const char *name; /* without the dashes */
    char letter;      /* short form, or 0 */
    option_kind kind;
    void *value;
    const char
        *metavar;     /* how --help calls the value; NULL: a word that fits the kind, for OPTION_CHOICE all choices */
    const char *help; /* one short line */
    double min, max;  /* both 0: whatever the type holds (OPTION_SIZE: 1 ... 65535) */
    int count;        /* OPTION_FLOATS */
    const char *shown; /* what --help calls the default where the value says nothing to a reader; NULL: the value */
    /* OPTION_CHOICE: names, NULL-terminated. One that reads "name[=TEXT]" may be given with a text behind it. */
    const char *const *choices;
    /* OPTION_FLAG: non-NULL lets the flag take a text, --name=TEXT. OPTION_CHOICE: where the text of a choice goes.
     * Set to NULL where the option is given without a text. */
    const char **detail;
} option;

typedef struct option_program {
    const char *name;       /* as messages and the usage line call it */
    const char *summary;    /* one line */
    const char *positional; /* how the usage line calls the positional argument, "[SCENE]"; NULL: none is taken */
    const char *positional_help;
    const char **positional_value; /* holds the default, which may be NULL */
} option_program;

typedef enum options_status {
    OPTIONS_OK,
    OPTIONS_HELP, /* --help or -h was given: help went to stdout */
    OPTIONS_ERROR /* err holds "PROGRAM: ..." in one line */
} options_status;

/* Nothing is written to the values unless OPTIONS_OK is returned. */
options_status options_parse(const option_program *program, const option *table, size_t count, int argc,
                             char *const argv[], message *err);

/* The one of `names` (NULL-terminated) that `word` is most probably a misspelling of; NULL: none. */
const char *options_suggest(const char *word, const char *const *names);

/* At most 100 columns; a line per option as long as its help text is short. */
void options_print_help(FILE *out, const option_program *program, const option *table, size_t count);

#endif
