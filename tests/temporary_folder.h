/* SPDX-License-Identifier: Apache-2.0 */
/* Where tests write: a folder of their own. */
#ifndef TESTS_TEMPORARY_FOLDER_H
#define TESTS_TEMPORARY_FOLDER_H

#include <stdio.h>
#include <stdlib.h>

enum { TEMPORARY_FOLDER_MAX = 96 }; /* bytes of its path */

/* Makes it in `base`, or where that is NULL in TMPDIR or the system's place; whoever made it removes it. -1: it cannot
 * be made there. */
static inline int temporary_folder(const char *base, char out[TEMPORARY_FOLDER_MAX])
{
    const char *chosen = getenv("TMPDIR");
    if (!base)
        base = chosen && *chosen ? chosen : P_tmpdir;
    int length = snprintf(out, TEMPORARY_FOLDER_MAX, "%s/vcache-XXXXXX", base);
    return length < TEMPORARY_FOLDER_MAX && mkdtemp(out) ? 0 : -1;
}

#endif
