/* SPDX-License-Identifier: Apache-2.0 */
/* An input as a file of its own, in memory where the system has a place for that. */
#ifndef FUZZ_FILE_H
#define FUZZ_FILE_H

#include "../temporary_folder.h"
#include "fuzz.h"

#include <unistd.h>

static char fuzz_folder[TEMPORARY_FOLDER_MAX];

static void fuzz_remove_folder(void)
{
    rmdir(fuzz_folder);
}

static inline void fuzz_write(const uint8_t *data, size_t size, const char *extension, char path[128])
{
    if (!*fuzz_folder) {
        const char *memory = "/dev/shm";
        if (temporary_folder(access(memory, W_OK) == 0 ? memory : NULL, fuzz_folder) || atexit(fuzz_remove_folder))
            exit(2);
    }
    snprintf(path, 128, "%s/x.%s", fuzz_folder, extension);
    FILE *f = fopen(path, "wb");
    if (!f || fwrite(data, 1, size, f) != size || fclose(f))
        exit(2);
}

/* Exactly one line on failure. */
#define ENSURE_MESSAGE(ok, err) ENSURE((ok) || ((err)->text[0] && !strchr((err)->text, '\n')))

#endif
