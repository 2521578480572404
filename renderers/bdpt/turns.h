/* SPDX-License-Identifier: Apache-2.0 */
/* Threads that work on batches at the same time, and ask the cache one after the other, in the batches' order. */
#ifndef BDPT_TURNS_H
#define BDPT_TURNS_H

#include <stddef.h>

/* Threads take batches 0, 1, ... as they come; each takes one at a time, waits for its turn, and passes it on. */
typedef struct turns turns;
turns *turns_new(int threads);
void turns_free(turns *t);
/* Batch 0 is the next. No thread waits. */
void turns_begin(turns *t);
void turns_wait(turns *t, size_t batch);
void turns_pass(turns *t);

#endif
