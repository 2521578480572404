/* SPDX-License-Identifier: Apache-2.0 */
/*
 * vcache/save.h - what a cache has learnt, kept in a file.
 *
 * What was learnt can be kept in a file and go on elsewhere: the next frame, another machine of a farm, the same scene
 * with other materials or lights' powers. Files are the same with every compiler and machine. `scene`: a number of the
 * host's own that changes whenever visibility may (a hash of geometry and transforms, say); a file that was saved with
 * another number, or by a cache of another config (bounds, C_N, C_Z, C_R, levels, table size, hash), is refused, and so
 * are damaged ones: a checksum covers each bit. Several may follow each other in one file (the cache, then its sets).
 *
 * Threads, errors: as in vcache.h. The library itself opens no file: it reads and writes by two callbacks.
 */
#ifndef VCACHE_SAVE_H
#define VCACHE_SAVE_H

#include "vcache.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Takes `bytes` bytes; false: cannot, and saving fails. As fwrite(data, 1, bytes, file) == bytes. */
typedef bool (*vcache_write)(void *context, const void *data, size_t bytes);
/* Gives the next `bytes` bytes; false: cannot, the file has ended, and loading fails. */
typedef bool (*vcache_read)(void *context, void *data, size_t bytes);

/* Writes table_bytes + 128 bytes at the most. Other threads may go on using the cache: each word is saved as it was
 * before or after. */
VCACHE_API vcache_status vcache_save(const vcache *cache, uint64_t scene, vcache_write write, void *context,
                                     char *message);
/* vcache_create with what was saved. On failure *out is NULL and the message says what does not fit. */
VCACHE_API vcache_status vcache_load(const vcache_config *config, uint64_t scene, vcache_read read, void *context,
                                     vcache **out, char *message);

/* The rows of a set, and as vcache_light_set_create. Lights must be the same ends in the same order. The cache must be
 * the one that was saved with it, loaded again (or both were never cleared). */
VCACHE_API vcache_status vcache_light_set_save(const vcache_light_set *set, uint64_t scene, vcache_write write,
                                               void *context, char *message);
VCACHE_API vcache_status vcache_light_set_load(vcache *cache, const vcache_light *lights, uint32_t count,
                                               uint64_t bytes, uint64_t scene, vcache_read read, void *context,
                                               vcache_light_set **out, char *message);

#ifdef __cplusplus
}
#endif

#endif
