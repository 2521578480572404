/* SPDX-License-Identifier: Apache-2.0 */
#include "message.h"

#include <stdarg.h>
#include <stdio.h>

static bool notices_on = true;

void replace_control_characters(char *text)
{
    for (; *text; text++)
        if ((unsigned char)*text < ' ' || *text == 127)
            *text = '?';
}

bool fail(message *m, const char *format, ...)
{
    if (m) {
        va_list args;
        va_start(args, format);
        vsnprintf(m->text, sizeof m->text, format, args);
        va_end(args);
        replace_control_characters(m->text);
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
    char text[1024];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    replace_control_characters(text);
    fprintf(stderr, "notice: %s\n", text);
}
