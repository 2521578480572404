/* SPDX-License-Identifier: Apache-2.0 */
/* How assimp reads a scene's file and those that it names. */
#ifndef COMMON_SCENE_IO_H
#define COMMON_SCENE_IO_H

#include "message.h"

#include <assimp/cfileio.h>

typedef struct scene_io {
    struct aiFileIO io; /* for one aiImportFileEx */
    message missing;    /* the first file that could not be opened, and why; "" where all could */
} scene_io;

/* Regular files alone: assimp itself would wait for the writers of named pipes. In place: `io` points to `f`. */
void scene_io_init(scene_io *f);

#endif
