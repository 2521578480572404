/* SPDX-License-Identifier: Apache-2.0 */
#include "scene_io.h"

#include "regular_file.h"
#include "scene.h"

#include <stdlib.h>

typedef struct open_file {
    struct aiFile face; /* first: assimp knows this alone */
    FILE *stream;
    size_t size;
} open_file;

static FILE *stream_of(struct aiFile *f)
{
    return ((open_file *)f)->stream;
}

static size_t read_file(struct aiFile *f, char *to, size_t size, size_t count)
{
    return fread(to, size, count, stream_of(f));
}

static size_t write_file(struct aiFile *f, const char *from, size_t size, size_t count)
{
    (void)f, (void)from, (void)size, (void)count;
    return 0;
}

static size_t tell(struct aiFile *f)
{
    return (size_t)ftell(stream_of(f));
}

static size_t size_of(struct aiFile *f)
{
    return ((open_file *)f)->size;
}

static enum aiReturn seek(struct aiFile *f, size_t offset, enum aiOrigin origin)
{
    static const int from[] = {[aiOrigin_SET] = SEEK_SET, [aiOrigin_CUR] = SEEK_CUR, [aiOrigin_END] = SEEK_END};
    return fseek(stream_of(f), (long)offset, from[origin]) == 0 ? aiReturn_SUCCESS : aiReturn_FAILURE;
}

static void flush(struct aiFile *f)
{
    (void)f;
}

static struct aiFile *open_for_assimp(struct aiFileIO *io, const char *path, const char *mode)
{
    scene_io *reader = (scene_io *)(void *)io->UserData;
    size_t size;
    message why;
    (void)mode; /* it never writes */
    FILE *stream = regular_open(path, &size, &why);
    if (!stream) {
        if (!*reader->missing.text)
            fail(&reader->missing, "%s: %.200s", path, why.text);
        return NULL;
    }
    open_file *f = xmalloc(sizeof *f);
    *f = (open_file){{read_file, write_file, tell, size_of, seek, flush, NULL}, stream, size};
    return &f->face;
}

static void close_for_assimp(struct aiFileIO *io, struct aiFile *f)
{
    (void)io;
    fclose(stream_of(f));
    free(f);
}

void scene_io_init(scene_io *f)
{
    *f = (scene_io){.io = {open_for_assimp, close_for_assimp, (aiUserData)(void *)f}};
}
