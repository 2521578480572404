/* SPDX-License-Identifier: Apache-2.0 */
/* An allocator for tests. */
#ifndef TESTS_LEDGER_H
#define TESTS_LEDGER_H

#include <stdbool.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

/* Counts what is out, and sees whether sizes come back as they went. */
typedef struct ledger {
    size_t blocks, bytes;
    bool fails;
} ledger;

static inline void *ledger_allocate(void *context, size_t bytes)
{
    ledger *l = context;
    size_t whole = (bytes + 63) / 64 * 64;
    void *memory = l->fails ? NULL : aligned_alloc(64, whole);
    if (!memory)
        return NULL;
    l->blocks++, l->bytes += bytes;
    return memset(memory, 0, whole);
}

static inline void ledger_release(void *context, void *memory, size_t bytes)
{
    ledger *l = context;
    l->blocks--, l->bytes -= bytes;
    free(memory);
}

#endif
