/* SPDX-License-Identifier: Apache-2.0 */
/* Values of command-line options: reading, describing, printing. */
#include "options_value.h"

#include <inttypes.h>
#include <limits.h>
#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool is_bounded(const option *o)
{
    return o->min != 0.0 || o->max != 0.0;
}

/* --- numbers --- */

static bool is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static bool parse_u64(const char *text, uint64_t *out)
{
    uint64_t n = 0;
    if (!*text)
        return false;
    for (; *text; text++) {
        unsigned digit = (unsigned)(*text - '0');
        if (!is_digit(*text) || n > (UINT64_MAX - digit) / 10)
            return false;
        n = 10 * n + digit;
    }
    *out = n;
    return true;
}

static bool parse_int(const char *text, int *out)
{
    uint64_t n;
    bool negative = *text == '-';
    if (!parse_u64(text + negative, &n) || n > (uint64_t)INT_MAX + negative)
        return false;
    *out = (int)(negative ? -(int64_t)n : (int64_t)n);
    return true;
}

/* Whether text is [-+]digits[.digits][e[-+]digits] with a digit before or after the point. strtod accepts more. */
static bool is_decimal(const char *text)
{
    int digits = 0;
    text += *text == '-' || *text == '+';
    for (; is_digit(*text); text++)
        digits++;
    if (*text == '.')
        for (text++; is_digit(*text); text++)
            digits++;
    if (digits == 0)
        return false;
    if (*text == 'e' || *text == 'E') {
        text++;
        text += *text == '-' || *text == '+';
        if (!is_digit(*text))
            return false;
        while (is_digit(*text))
            text++;
    }
    return *text == '\0';
}

static bool parse_float(const char *text, const option *o, float *out)
{
    if (!is_decimal(text))
        return false;
    locale_t plain = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (!plain)
        return false;
    double x = strtod_l(text, NULL, plain);
    freelocale(plain);
    if (is_bounded(o) && (x < o->min || x > o->max))
        return false;
    *out = (float)x;
    return isfinite(*out);
}

static bool parse_floats(const char *text, const option *o, float *out)
{
    for (int i = 0; i < o->count; i++) {
        char part[64];
        size_t length = strcspn(text, ",");
        if (length >= sizeof part || (text[length] == ',') != (i + 1 < o->count))
            return false;
        memcpy(part, text, length);
        part[length] = '\0';
        float x;
        if (!parse_float(part, o, &x))
            return false;
        if (out)
            out[i] = x;
        text += length + 1;
    }
    return true;
}

static void size_range(const option *o, uint32_t *min, uint32_t *max)
{
    *min = is_bounded(o) ? (uint32_t)o->min : 1;
    *max = is_bounded(o) ? (uint32_t)o->max : 65535;
}

static bool parse_size(const char *text, const option *o, option_size *out)
{
    char left[16];
    uint64_t width, height;
    uint32_t min, max;
    size_t length = strcspn(text, "x");
    if (length >= sizeof left || text[length] != 'x')
        return false;
    memcpy(left, text, length);
    left[length] = '\0';
    size_range(o, &min, &max);
    if (!parse_u64(left, &width) || !parse_u64(text + length + 1, &height) || width < min || width > max ||
        height < min || height > max)
        return false;
    *out = (option_size){(uint32_t)width, (uint32_t)height};
    return true;
}

/* --- choices --- */

/* Length of a choice's name without its "[=TEXT]". */
static size_t choice_length(const char *choice)
{
    return strcspn(choice, "[");
}

static bool parse_choice(const char *text, const option *o, int *index, const char **detail)
{
    size_t length = strcspn(text, "=");
    *detail = text[length] ? text + length + 1 : NULL;
    if (*detail && !**detail)
        return false;
    for (int i = 0; o->choices[i]; i++) {
        size_t n = choice_length(o->choices[i]);
        if (n == length && strncmp(text, o->choices[i], n) == 0 && (!*detail || o->choices[i][n] == '[')) {
            *index = i;
            return true;
        }
    }
    return false;
}

void option_choices(const option *o, const char *separator, char *out, size_t size)
{
    size_t used = 0;
    out[0] = '\0';
    for (int i = 0; o->choices[i] && used < size; i++) {
        int n = snprintf(out + used, size - used, "%s%s", i ? separator : "", o->choices[i]);
        used += n > 0 ? (size_t)n : 0;
    }
}

/* --- for messages and --help --- */

void option_allowed(const option *o, char *out, size_t size)
{
    char range[64] = "";
    uint32_t side_min, side_max;
    if (is_bounded(o))
        snprintf(range, sizeof range, " from %.9g to %.9g", o->min, o->max);
    switch (o->kind) {
    case OPTION_INT:
        snprintf(out, size, "a whole number%s", range);
        break;
    case OPTION_UINT64:
        snprintf(out, size, "a whole number from 0 to 2^64 - 1");
        break;
    case OPTION_FLOAT:
        snprintf(out, size, "a finite number%s", range);
        break;
    case OPTION_FLOATS:
        snprintf(out, size, "%d finite numbers%s, separated by commas", o->count, range);
        break;
    case OPTION_SIZE:
        size_range(o, &side_min, &side_max);
        snprintf(out, size, "WIDTHxHEIGHT, each from %" PRIu32 " to %" PRIu32, side_min, side_max);
        break;
    case OPTION_CHOICE:
        option_choices(o, ", ", out, size);
        break;
    case OPTION_FLAG:
    case OPTION_STRING:
    case OPTION_LIST:
        snprintf(out, size, "a text that is not empty");
        break;
    }
}

void option_default(const option *o, char *out, size_t size)
{
    const option_size *side = o->value;
    const float *numbers = o->value;
    out[0] = '\0';
    if (o->shown) {
        snprintf(out, size, "%s", o->shown);
        return;
    }
    switch (o->kind) {
    case OPTION_INT:
        snprintf(out, size, "%d", *(const int *)o->value);
        break;
    case OPTION_UINT64:
        snprintf(out, size, "%" PRIu64, *(const uint64_t *)o->value);
        break;
    case OPTION_FLOAT:
    case OPTION_FLOATS:
        for (int i = 0; i < (o->kind == OPTION_FLOAT ? 1 : o->count); i++) {
            size_t used = strlen(out);
            snprintf(out + used, size - used, "%s%g", i ? "," : "", (double)numbers[i]);
        }
        break;
    case OPTION_SIZE:
        snprintf(out, size, "%" PRIu32 "x%" PRIu32, side->width, side->height);
        break;
    case OPTION_CHOICE: {
        const char *choice = o->choices[*(const int *)o->value];
        snprintf(out, size, "%.*s", (int)choice_length(choice), choice);
        break;
    }
    case OPTION_STRING:
        if (*(const char *const *)o->value)
            snprintf(out, size, "%s", *(const char *const *)o->value);
        break;
    case OPTION_FLAG:
    case OPTION_LIST:
        break;
    }
}

/* --- reading --- */

bool option_read(const option *o, const char *text, bool commit)
{
    union {
        bool flag;
        int i;
        uint64_t u;
        float f;
        option_size size;
        const char *s;
    } v;
    size_t bytes = 0; /* of v that make the value */
    const char *detail = text;
    bool ok = text == NULL || *text != '\0';
    option_list *list = o->value;

    switch (o->kind) {
    case OPTION_FLAG:
        v.flag = true;
        bytes = sizeof v.flag;
        break;
    case OPTION_INT:
        ok = parse_int(text, &v.i) && (!is_bounded(o) || (v.i >= o->min && v.i <= o->max));
        bytes = sizeof v.i;
        break;
    case OPTION_UINT64:
        ok = parse_u64(text, &v.u);
        bytes = sizeof v.u;
        break;
    case OPTION_FLOAT:
        ok = parse_float(text, o, &v.f);
        bytes = sizeof v.f;
        break;
    case OPTION_FLOATS:
        ok = parse_floats(text, o, commit ? o->value : NULL);
        break;
    case OPTION_SIZE:
        ok = parse_size(text, o, &v.size);
        bytes = sizeof v.size;
        break;
    case OPTION_CHOICE:
        ok = parse_choice(text, o, &v.i, &detail);
        bytes = sizeof v.i;
        break;
    case OPTION_STRING:
        v.s = text;
        bytes = sizeof v.s;
        break;
    case OPTION_LIST:
        if (ok && commit)
            list->items[list->count++] = text;
        break;
    }
    if (ok && commit) {
        memcpy(o->value, &v, bytes);
        if (o->detail)
            *o->detail = detail;
    }
    return ok;
}
