/* SPDX-License-Identifier: Apache-2.0 */
#include "regular_file.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

FILE *regular_open(const char *path, size_t *size, message *why)
{
    struct stat info;
    FILE *f = NULL;
    int fd = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (fd < 0 || fstat(fd, &info) != 0)
        fail(why, "%s", strerror(errno));
    else if (!S_ISREG(info.st_mode))
        fail(why, "not a regular file");
    else if (!(f = fdopen(fd, "rb")))
        fail(why, "%s", strerror(errno));
    else
        *size = (size_t)info.st_size;
    if (!f && fd >= 0)
        close(fd);
    return f;
}
