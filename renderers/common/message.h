/* SPDX-License-Identifier: Apache-2.0 */
/* One-line error messages: a function that can fail returns bool and fills a message. */
#ifndef COMMON_MESSAGE_H
#define COMMON_MESSAGE_H

#include <stdbool.h>

typedef struct message {
    char text[512];
} message;

/* Writes one line (printf format, no trailing newline) and returns false, so that a caller can
 * `return fail(err, "...")`. `m` may be NULL. */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
bool fail(message *m, const char *format, ...);

/* Prints "notice: ..." to stderr unless notices were switched off (--quiet). */
#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
void notice(const char *format, ...);
void notice_enable(bool on);

#endif
