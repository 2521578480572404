/* SPDX-License-Identifier: Apache-2.0 */
/* Structs whose first field is their size: what a host that was compiled with another version has of them. */
#ifndef VCACHE_SIZED_H
#define VCACHE_SIZED_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>

/* Where the last field of the first version ends: no struct of this soname is shorter. */
#define SIZED_FIRST(type, last) (offsetof(type, last) + sizeof(((type *)0)->last))

/* More than that a later version will not have added: other sizes are no sizes. */
enum { SIZED_GROWTH = 1024 };

/* The defaults, of `own` bytes, for a host whose struct has `bytes` of them: what only it knows is 0. */
static inline void sized_fill(void *out, size_t bytes, const void *defaults, size_t own)
{
    if (bytes < sizeof bytes)
        return;
    size_t known = bytes < own ? bytes : own;
    memcpy(out, defaults, known);
    memset((char *)out + known, 0, bytes - known);
    memcpy(out, &bytes, sizeof bytes);
}

/* Puts a host's struct over the defaults in `all`, of `own` bytes. NULL, or what is wrong with its size. */
static inline const char *sized_take(void *all, size_t own, size_t first, const void *given)
{
    size_t bytes;
    memcpy(&bytes, given, sizeof bytes);
    if (bytes < first || bytes > own + SIZED_GROWTH || bytes % sizeof bytes)
        return "config.size is none of this struct";
    for (size_t i = own; i < bytes; i++)
        if (((const unsigned char *)given)[i])
            return "config.size is that of a newer header, and something is set that this library does not know";
    memcpy(all, given, bytes < own ? bytes : own);
    memcpy(all, &own, sizeof own);
    return NULL;
}

#endif
