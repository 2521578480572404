/* SPDX-License-Identifier: Apache-2.0 */
/* Internal to options.c: one option's value. */
#ifndef COMMON_OPTIONS_VALUE_H
#define COMMON_OPTIONS_VALUE_H

#include "options.h"

/* Checks `text` (NULL: a flag without one) and, where `commit` is set, writes the value. False for a bad one. */
bool option_read(const option *o, const char *text, bool commit);

/* Each writes a text without newline: what the option accepts; its present value ("": nothing to show); its choices. */
void option_allowed(const option *o, char *out, size_t size);
void option_default(const option *o, char *out, size_t size);
void option_choices(const option *o, const char *separator, char *out, size_t size);

#endif
