/* SPDX-License-Identifier: Apache-2.0 */
/* To be preloaded: the allocation with number FAIL_AT fails, of those that the program itself makes and not the
 * libraries it uses. Without FAIL_AT their number is printed at the end. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static uintptr_t low = UINTPTR_MAX, high; /* of the program's own code */
static atomic_long calls;
static long fail_at;

static int first_object(struct dl_phdr_info *info, size_t size, void *unused)
{
    (void)size, (void)unused;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *p = &info->dlpi_phdr[i];
        if (p->p_type != PT_LOAD)
            continue;
        uintptr_t from = info->dlpi_addr + p->p_vaddr, to = from + p->p_memsz;
        low = from < low ? from : low;
        high = to > high ? to : high;
    }
    return 1; /* the program comes first */
}

static void tell(void)
{
    fprintf(stderr, "%ld allocations\n", atomic_load(&calls));
}

__attribute__((constructor)) static void begin(void)
{
    const char *at = getenv("FAIL_AT");
    fail_at = at ? strtol(at, NULL, 10) : 0;
    dl_iterate_phdr(first_object, NULL);
    if (!at)
        atexit(tell);
}

static bool fails(const void *caller)
{
    uintptr_t at = (uintptr_t)caller;
    return at >= low && at < high && atomic_fetch_add(&calls, 1) + 1 == fail_at;
}

/* glibc's own names: dlsym would allocate. */
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

__attribute__((visibility("default"))) void *malloc(size_t bytes)
{
    return fails(__builtin_return_address(0)) ? NULL : __libc_malloc(bytes);
}

__attribute__((visibility("default"))) void *calloc(size_t count, size_t bytes)
{
    return fails(__builtin_return_address(0)) ? NULL : __libc_calloc(count, bytes);
}

__attribute__((visibility("default"))) void *realloc(void *p, size_t bytes)
{
    return fails(__builtin_return_address(0)) ? NULL : __libc_realloc(p, bytes);
}

__attribute__((visibility("default"))) int posix_memalign(void **out, size_t align, size_t bytes)
{
    void *p = fails(__builtin_return_address(0)) ? NULL : __libc_memalign(align, bytes);
    if (!p)
        return ENOMEM;
    *out = p;
    return 0;
}

__attribute__((visibility("default"))) void *aligned_alloc(size_t align, size_t bytes)
{
    return fails(__builtin_return_address(0)) ? NULL : __libc_memalign(align, bytes);
}
