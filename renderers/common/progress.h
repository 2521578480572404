/* SPDX-License-Identifier: Apache-2.0 */
/* Progress line on stderr: percentage, time taken, time left. */
#ifndef COMMON_PROGRESS_H
#define COMMON_PROGRESS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct progress progress;

/* NULL, which all functions take and ignore, where `quiet` is set or stderr is not a terminal. `label` is copied;
 * `total` is the amount of work at which the line shows 100 %. */
progress *progress_new(const char *label, uint64_t total, bool quiet);
/* Counts n units of work as done. Any thread; redraws at most ten times a second. */
void progress_add(progress *p, uint64_t n);
/* Clears the line. Call once, after the last progress_add. */
void progress_free(progress *p);

#endif
