/* SPDX-License-Identifier: Apache-2.0 */
/* Output files that appear under their name only once complete. */
#include "atomic_file.h"
#include "scene.h"

#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

/* Temporaries that an exit (for want of memory, say) would leave behind. Files are written by one thread. */
enum { OPEN_MAX_AT_A_TIME = 8 };
static const char *open_now[OPEN_MAX_AT_A_TIME];

static void remove_open(void)
{
    for (int i = 0; i < OPEN_MAX_AT_A_TIME; i++)
        if (open_now[i])
            unlink(open_now[i]);
}

/* Puts `to` into the place of `from`; one of them is NULL. */
static void note(const char *from, const char *to)
{
    static bool registered;
    if (!registered)
        registered = atexit(remove_open) == 0;
    for (int i = 0; i < OPEN_MAX_AT_A_TIME; i++)
        if (open_now[i] == from) {
            open_now[i] = to;
            return;
        }
}

static void release(atomic_file *f)
{
    if (f->temporary)
        note(f->temporary, NULL);
    free(f->path);
    free(f->target);
    free(f->temporary);
    *f = (atomic_file){0};
}

static char *copy_string(const char *s)
{
    size_t size = strlen(s) + 1;
    return memcpy(xmalloc(size), s, size);
}

/* A new file with the permissions the umask grants (mkstemp would make it private), or -1 with errno. */
static int create_beside(const char *target, char *name, size_t size)
{
    for (int attempt = 0; attempt < 100; ++attempt) {
        snprintf(name, size, "%s.%ld-%d.tmp", target, (long)getpid(), attempt);
        int fd = open(name, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
        if (fd >= 0 || errno != EEXIST)
            return fd;
    }
    return -1;
}

char *atomic_target(const char *path)
{
    char *real = realpath(path, NULL), *at = copy_string(path);
    for (int links = 0; !real && errno == ENOENT && links < 40; links++) {
        char to[PATH_MAX], *slash = strrchr(at, '/');
        ssize_t length = readlink(at, to, sizeof to - 1);
        if (length < 0)
            return at;
        to[length] = 0;
        size_t folder = to[0] != '/' && slash ? (size_t)(slash - at) + 1 : 0;
        char *next = xmalloc(folder + (size_t)length + 1);
        memcpy(next, at, folder);
        memcpy(next + folder, to, (size_t)length + 1);
        free(at);
        at = next;
        errno = ENOENT;
    }
    free(at);
    return real;
}

/* The folder without links, and the name in it. */
static char *full_name(const char *path)
{
    char *target = atomic_target(path);
    if (!target)
        return copy_string(path);
    char *at = copy_string(target), *folder = realpath(dirname(at), NULL), *slash = strrchr(target, '/');
    const char *name = slash ? slash + 1 : target;
    free(at);
    if (!folder)
        return target;
    char *full = xmalloc(strlen(folder) + strlen(name) + 2);
    sprintf(full, "%s/%s", folder, name);
    free(folder);
    free(target);
    return full;
}

bool atomic_same(const char *a, const char *b)
{
    char *first = full_name(a), *second = full_name(b);
    bool same = strcmp(first, second) == 0;
    free(first);
    free(second);
    return same;
}

bool atomic_open(atomic_file *f, const char *path, message *err)
{
    *f = (atomic_file){0};
    struct stat info;
    bool exists = stat(path, &info) == 0;
    /* Renaming over a device or a pipe would replace it by a file. */
    if (exists && !S_ISREG(info.st_mode))
        return fail(err, "cannot write %s: %s", path, S_ISDIR(info.st_mode) ? "it is a folder" : "not a regular file");

    f->path = copy_string(path);
    f->target = atomic_target(path);
    if (!f->target) {
        fail(err, "cannot write %s: %s", path, strerror(errno));
        release(f);
        return false;
    }
    size_t size = strlen(f->target) + 48;
    f->temporary = xmalloc(size);
    int fd = create_beside(f->target, f->temporary, size);
    if (fd >= 0) {
        note(NULL, f->temporary);
        f->stream = fdopen(fd, "wb");
        if (f->stream)
            return true;
        int error = errno;
        close(fd);
        unlink(f->temporary);
        errno = error;
    }
    fail(err, "cannot write %s: %s", path, strerror(errno));
    release(f);
    return false;
}

bool atomic_commit(atomic_file *f, message *err)
{
    bool good = !ferror(f->stream);
    int error = EIO;
    if (fclose(f->stream) != 0 && good) { /* what it could not flush counts */
        error = errno;
        good = false;
    }
    if (good && rename(f->temporary, f->target) != 0) {
        error = errno;
        good = false;
    }
    if (!good) {
        unlink(f->temporary);
        fail(err, "cannot write %s: %s", f->path, strerror(error));
    }
    release(f);
    return good;
}

void atomic_abort(atomic_file *f)
{
    fclose(f->stream);
    unlink(f->temporary);
    release(f);
}
