/* SPDX-License-Identifier: Apache-2.0 */
/* What the fuzz targets share: the entry that libFuzzer (or driver.c) calls, and bytes that become values. */
#ifndef FUZZ_H
#define FUZZ_H

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* A contract is broken: libFuzzer keeps the input. */
#define ENSURE(what)                                                                                                   \
    do {                                                                                                               \
        if (!(what)) {                                                                                                 \
            fprintf(stderr, "%s:%d: not %s\n", __FILE__, __LINE__, #what);                                             \
            abort();                                                                                                   \
        }                                                                                                              \
    } while (0)

typedef struct bytes {
    const uint8_t *at, *end;
} bytes;

static inline uint8_t take(bytes *b)
{
    return b->at < b->end ? *b->at++ : 0;
}

/* Plain numbers mostly, and all that floats can be. */
static inline float take_float(bytes *b)
{
    static const float odd[] = {0.0f,   -0.0f,  NAN,   INFINITY, -INFINITY, 1e-42f, -1e-42f, 1e38f,
                                -1e38f, 1e-38f, 1e30f, 1.0f,     -1.0f,     0.5f,   1e-10f,  1e10f};
    uint8_t kind = take(b);
    if (kind < 32)
        return odd[kind % 16];
    if (kind < 40) {
        uint32_t bits = 0;
        float value;
        for (int i = 0; i < 4; i++)
            bits = bits << 8 | take(b);
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    return (float)kind / 128.0f - 1.0f + (float)take(b) / 65536.0f;
}

#endif
