/* SPDX-License-Identifier: Apache-2.0 */
/* Reading what a user names: regular files alone. */
#ifndef COMMON_REGULAR_FILE_H
#define COMMON_REGULAR_FILE_H

#include "message.h"

#include <stddef.h>
#include <stdio.h>

/* Opens a file for reading, from its start, and tells its size in bytes. NULL and in `why`, which does not name the
 * path, what is wrong where there is none or it is a folder, a device, or a named pipe, whose writer fopen would wait
 * for, through signals too. */
FILE *regular_open(const char *path, size_t *size, message *why);

#endif
