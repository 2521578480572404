/* SPDX-License-Identifier: Apache-2.0 */
#include "message.h"

#include <stdarg.h>
#include <stdio.h>

static bool notices_on = true;

bool fail(message *m, const char *format, ...)
{
    if (m) {
        va_list args;
        va_start(args, format);
        vsnprintf(m->text, sizeof m->text, format, args);
        va_end(args);
    }
    return false;
}

void notice_enable(bool on)
{
    notices_on = on;
}

void notice(const char *format, ...)
{
    if (!notices_on)
        return;
    va_list args;
    va_start(args, format);
    fputs("notice: ", stderr);
    vfprintf(stderr, format, args);
    fputc('\n', stderr);
    va_end(args);
}
