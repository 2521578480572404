/* SPDX-License-Identifier: Apache-2.0 */
/* Output files that appear under their name only once complete: written beside the target under a temporary name, then
 * renamed. There is no fsync, so a power cut may still lose the file; a crash or a full disk does not leave half of
 * one. */
#ifndef COMMON_ATOMIC_FILE_H
#define COMMON_ATOMIC_FILE_H

#include "message.h"

#include <stdbool.h>
#include <stdio.h>

typedef struct atomic_file {
    FILE *stream;                    /* opened for writing; seekable */
    char *path, *target, *temporary; /* as given; behind symbolic links; beside `target` */
} atomic_file;

/* The file that `path` stands for behind symbolic links, also where it is not there yet; NULL with errno. free it. */
char *atomic_target(const char *path);
/* Whether two paths name one file to write, however they are spelled and through links. */
bool atomic_same(const char *a, const char *b);

/* Every atomic_open that returned true must be followed by exactly one atomic_commit or atomic_abort. */
bool atomic_open(atomic_file *f, const char *path, message *err);
/* Flushes, closes and renames. On failure the temporary is gone and the target unchanged. */
bool atomic_commit(atomic_file *f, message *err);
void atomic_abort(atomic_file *f);

#endif
