/* SPDX-License-Identifier: Apache-2.0 */
/* One-line error messages: a function that can fail returns bool and fills a message. */
#ifndef COMMON_MESSAGE_H
#define COMMON_MESSAGE_H

#include <stdbool.h>

typedef struct message {
    char text[512];
} message;

/* File names and arguments may hold anything; each character that would break or colour a line becomes '?'. */
void replace_control_characters(char *text);

/* Writes one line (printf format, no trailing newline) without control characters and returns false, so that a caller
 * can `return fail(err, "...")`. `m` may be NULL. */
#if defined(__GNUC__)
__attribute__((format(printf, 2, 3)))
#endif
bool fail(message *m, const char *format, ...);

/* Prints "notice: ..." in one line to stderr unless notices were switched off (--quiet). */
#if defined(__GNUC__)
__attribute__((format(printf, 1, 2)))
#endif
void notice(const char *format, ...);
void notice_enable(bool on);

#endif
