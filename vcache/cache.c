/* SPDX-License-Identifier: Apache-2.0 */
/* The cache itself: config, creation, clearing. */
#if defined(__linux__)
#define _DEFAULT_SOURCE /* madvise */
#include <sys/mman.h>
#endif

#include "internal.h"
#include "sized.h"

#include <float.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

vcache_status vcache_complain(char *message, vcache_status status, const char *format, ...)
{
    if (message) {
        va_list args;
        va_start(args, format);
        vsnprintf(message, VCACHE_MESSAGE_BYTES, format, args);
        va_end(args);
    }
    return status;
}

/* Fresh pages stay untouched until they are written. Look-ups go all over the table, so where the system has large
 * pages on request (Linux), ask for them: a miss of the address translation costs as much as one of the cache. */
#define LARGE_PAGE ((size_t)2 << 20)

static void *default_allocate(void *context, size_t bytes)
{
    (void)context;
    size_t align = bytes >= LARGE_PAGE ? LARGE_PAGE : 64;
    if (bytes > SIZE_MAX - align - sizeof(void *))
        return NULL;
    char *start = calloc(1, bytes + align + sizeof(void *));
    if (!start)
        return NULL;
    char *aligned = start + sizeof(void *) + align - 1;
    aligned -= (uintptr_t)aligned % align;
    memcpy(aligned - sizeof(void *), &start, sizeof start);
#if defined(MADV_HUGEPAGE)
    if (align == LARGE_PAGE)
        (void)madvise(aligned, bytes / LARGE_PAGE * LARGE_PAGE, MADV_HUGEPAGE); /* a wish: failing is no harm */
#endif
    return aligned;
}

static void default_release(void *context, void *memory, size_t bytes)
{
    (void)context, (void)bytes;
    char *start;
    memcpy(&start, (char *)memory - sizeof(void *), sizeof start);
    free(start);
}

void vcache_fill_config(vcache_config *out, size_t size)
{
    const vcache_config f = {
        .size = sizeof(vcache_config),
        .bounds_max = {1.0f, 1.0f, 1.0f},
        .normal_bins = 8,
        .layers = 8,
        .resolution_step = 1.2f,
        .levels = 0,
        .table_bytes = (uint64_t)4 << 20,
        .hash = VCACHE_HASH_SPLIT,
        .isa = VCACHE_ISA_ALL,
        .allocator = {default_allocate, default_release, NULL},
    };
    sized_fill(out, size, &f, sizeof f);
}

static vcache_status check(const vcache_config *f, char *message)
{
    const vcache_status bad = VCACHE_ERROR_ARGUMENT;
    for (int i = 0; i < 3; i++)
        if (!isfinite(f->bounds_min[i]) || !isfinite(f->bounds_max[i]) || !(f->bounds_min[i] <= f->bounds_max[i]))
            return vcache_complain(message, bad, "bounds[%d] are [%g, %g]: they must be finite, min <= max", i,
                                   (double)f->bounds_min[i], (double)f->bounds_max[i]);
    if (f->normal_bins < 1 || f->normal_bins > 64)
        return vcache_complain(message, bad, "normal_bins (C_N) is %d: it must be 1 ... 64", f->normal_bins);
    if (f->layers < 1 || f->layers > 64)
        return vcache_complain(message, bad, "layers (C_Z) is %d: it must be 1 ... 64", f->layers);
    if (!(f->resolution_step >= 1.05f && f->resolution_step <= 16.0f))
        return vcache_complain(message, bad, "resolution_step (C_R) is %g: it must be 1.05 ... 16",
                               (double)f->resolution_step);
    if (f->levels < 0 || f->levels > VCACHE_MAX_LEVELS)
        return vcache_complain(message, bad, "levels (C_MSR) is %d: it must be 0 (log2 C_E) ... %d", f->levels,
                               VCACHE_MAX_LEVELS);
    if (f->table_bytes < 4 || f->table_bytes > (uint64_t)1 << 34 || f->table_bytes > SIZE_MAX)
        return vcache_complain(message, bad, "table_bytes is %llu: it must be 4 ... 16 GiB",
                               (unsigned long long)f->table_bytes);
    if ((int)f->hash < VCACHE_HASH_SPLIT || f->hash > VCACHE_HASH_LCG_XORSHIFT)
        return vcache_complain(message, bad, "hash is %d: no such family", (int)f->hash);
    if (!f->allocator.allocate || !f->allocator.release)
        return vcache_complain(message, bad, "allocator: both functions must be set");
    return VCACHE_OK;
}

/* Bounding sphere and the curve of resolutions (Eq. 8). */
static void measure(vcache *c)
{
    const vcache_config *f = &c->config;
    double square = 0.0, largest = 0.0;
    for (int i = 0; i < 3; i++) {
        double low = f->bounds_min[i], high = f->bounds_max[i], reach = fabs(low) > fabs(high) ? fabs(low) : fabs(high);
        c->center[i] = 0.5 * (low + high);
        square += (high - low) * (high - low);
        largest = reach > largest ? reach : largest;
    }
    /* A scene of one point gets the smallest sphere that its positions can resolve. */
    double smallest = largest * 0x1p-20 > (double)FLT_MIN ? largest * 0x1p-20 : (double)FLT_MIN;
    c->diameter = sqrt(square) > smallest ? sqrt(square) : smallest;
    c->inverse_diameter = 1.0 / c->diameter;

    /* C_R^i by repeated multiplication: the same bits everywhere, unlike pow(). */
    double ratio = f->resolution_step, power = 1.0;
    int count = 0;
    for (; count < VCACHE_MAX_STEPS && power < 0x1p32; power *= ratio)
        count++;
    power = 1.0;
    for (int i = 0; i < 2 * count; i++, power *= ratio)
        c->power[i] = power;
    c->steps = count;
    for (int k = 0; k < count; k++) {
        c->resolution[k] = (uint32_t)c->power[k];
        float side = (float)(c->diameter / c->resolution[k]);
        c->side_squared[k] = side * side;
        c->canonical[k] = (uint16_t)(k > 0 && c->resolution[k] == c->resolution[k - 1] ? c->canonical[k - 1] : k);
    }

    /* A layer must stay 4 ulp of the largest coordinate thick. */
    double finest = c->diameter / (4.0 * f->layers * largest * 0x1p-23), cap = 0x1p25 / f->layers;
    finest = finest < cap ? finest : cap; /* infinity in a scene of one point at the origin */
    c->step_limit = 0;
    while (c->step_limit + 1 < count && c->power[c->step_limit + 1] <= finest)
        c->step_limit++;
    /* Components of a direction are good to 2^-24; the octahedral cells are 2 / R wide. */
    c->direction_limit = 0;
    while (c->direction_limit + 1 < count && c->power[c->direction_limit + 1] <= 0x1p21)
        c->direction_limit++;
    c->step_limit = c->canonical[c->step_limit];
    power = 1.0;
    for (int e = 0, k = 0; e < 66; e++, power *= 2.0) {
        while (k < count - 1 && c->power[2 * k + 1] <= power)
            k++;
        c->first_step[e] = (uint16_t)k;
    }
}

vcache_status vcache_create(const vcache_config *given, vcache **out, char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    vcache_config config = vcache_default_config();
    const char *wrong =
        given ? sized_take(&config, sizeof config, SIZED_FIRST(vcache_config, allocator), given) : "config is NULL";
    if (wrong)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "%s: start from vcache_default_config()", wrong);
    vcache_status status = check(&config, message);
    if (status != VCACHE_OK)
        return status;

    const vcache_allocator *a = &config.allocator;
    vcache *c = a->allocate(a->context, sizeof *c);
    if (!c)
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for the cache");
    c->config = config;
    c->table.count = config.table_bytes / 4;
    c->table.words = a->allocate(a->context, c->table.count * 4);
    if (!c->table.words) {
        a->release(a->context, c, sizeof *c);
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for a table of %llu bytes",
                               (unsigned long long)config.table_bytes);
    }
    atomic_init(&c->epoch, 0);
    atomic_init(&c->epoch_key, 0);
    measure(c);
    c->kernels = kernels_choose(config.isa);
    *out = c;
    return VCACHE_OK;
}

void vcache_destroy(vcache **cache)
{
    if (!cache || !*cache)
        return;
    vcache *c = *cache;
    vcache_allocator a = c->config.allocator;
    a.release(a.context, (void *)c->table.words, c->table.count * 4);
    a.release(a.context, c, sizeof *c);
    *cache = NULL;
}

void vcache_clear(vcache *c)
{
    /* Every pair gets another key; what is in the table looks foreign from now on and is overwritten as such. */
    uint64_t epoch = atomic_fetch_add_explicit(&c->epoch, 1, memory_order_relaxed) + 1;
    /* chained, so that it is new after a vcache_load as well */
    uint64_t old = atomic_load_explicit(&c->epoch_key, memory_order_relaxed);
    atomic_store_explicit(&c->epoch_key, hash_words(epoch, old, 0x589965cc75374cc3u), memory_order_release);
}

const char *vcache_isa(const vcache *c)
{
    return c->kernels->name;
}

uint64_t vcache_table_words(const vcache *c)
{
    return c->table.count;
}

double vcache_table_filled(const vcache *c, uint64_t samples)
{
    if (samples > c->table.count)
        samples = c->table.count;
    if (samples == 0)
        return 0.0;
    uint64_t filled = 0, count = c->table.count;
    for (uint64_t i = 0; i < samples; i++)
        filled += table_load_relaxed(&c->table, i * count / samples) != 0;
    return (double)filled / (double)samples;
}

const char *vcache_status_text(vcache_status status)
{
    switch (status) {
    case VCACHE_OK:
        return "ok";
    case VCACHE_ERROR_ARGUMENT:
        return "bad argument";
    case VCACHE_ERROR_MEMORY:
        return "out of memory";
    case VCACHE_ERROR_FILE:
        return "bad file";
    }
    return "unknown status";
}

uint32_t vcache_version(void)
{
    return VCACHE_VERSION_MAJOR * 10000 + VCACHE_VERSION_MINOR * 100 + VCACHE_VERSION_PATCH;
}
