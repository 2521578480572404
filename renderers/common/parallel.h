/* SPDX-License-Identifier: Apache-2.0 */
/* Loops over threads. */
#ifndef COMMON_PARALLEL_H
#define COMMON_PARALLEL_H

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

#define PARALLEL_MAX_THREADS 256

/* Number of CPUs this process may use, 1 ... PARALLEL_MAX_THREADS. */
int parallel_default_threads(void);
/* What the loops below make of `threads`: parallel_default_threads() for 0 and less, at most PARALLEL_MAX_THREADS.
 * Allocate that many per-thread states. */
int parallel_thread_count(int threads);

/* Calls body(ctx, thread, index) once for each index below `count`, in no order, from up to `threads` threads, and
 * returns when all calls have returned. `thread` is below parallel_thread_count(threads) and no two calls of one
 * `thread` overlap; thread 0 is the caller. Where threads cannot be started, fewer do the work. Once interrupted() no
 * more indices are handed out. */
void parallel_for(int threads, size_t count, void (*body)(void *ctx, int thread, size_t index), void *ctx);

/* The same, and also stops where *stop becomes true (NULL: never). Returns whether all indices were handed out. */
bool parallel_for_until(int threads, size_t count, void (*body)(void *ctx, int thread, size_t index), void *ctx,
                        const atomic_bool *stop);

#endif
