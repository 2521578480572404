/* SPDX-License-Identifier: Apache-2.0 */
/* Creation of light sets; rows are read and written by the inline functions of light_set.h. */
#include "light_set.h"

#include <math.h>
#include <string.h>

vcache_status vcache_light_set_create(vcache *cache, const vcache_light *lights, uint32_t count, uint64_t bytes,
                                      vcache_light_set **out, char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    if (!cache || !lights)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "cache or lights are NULL");
    if (count < 1 || count > VCACHE_MAX_SET)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "a light set of %u lights: it must be 1 ... %d", count,
                               VCACHE_MAX_SET);
    uint32_t words = (count + 63) / 64;
    size_t stride = (ROW_BITS + 2 * (size_t)words + 7) / 8 * 8;
    uint64_t rows = bytes / (stride * sizeof(uint64_t));
    if (rows < 1 || rows > UINT32_MAX || bytes > SIZE_MAX / 2)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "bytes is %llu: %u lights take %zu ... 2^32 times that",
                               (unsigned long long)bytes, count, stride * sizeof(uint64_t));
    size_t padded = (size_t)words * 64;
    size_t header = (sizeof(vcache_light_set) + 63) / 64 * 64, ends = (count * sizeof(vcache_light) + 63) / 64 * 64;
    size_t memory = (size_t)rows * stride * sizeof(uint64_t);
    size_t all = memory + header + ends + 4 * padded * sizeof(float);
    const vcache_allocator *a = &cache->config.allocator;
    char *block = a->allocate(a->context, all);
    if (!block)
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for a light set of %llu bytes",
                               (unsigned long long)bytes);
    /* rows first: they want the allocation's alignment */
    vcache_light_set *s = (vcache_light_set *)(void *)(block + memory);
    s->cache = cache;
    s->bytes = all;
    s->count = count;
    s->words = words;
    s->rows = rows;
    s->stride = stride;
    s->memory = (_Atomic uint64_t *)(void *)block;
    s->lights = (vcache_light *)(void *)(block + memory + header);
    s->x = (float *)(void *)(block + memory + header + ends);
    s->y = s->x + padded;
    s->z = s->y + padded;
    s->side_squared = s->z + padded;
    memcpy(s->lights, lights, count * sizeof *lights);
    for (uint32_t i = 0; i < count; i++) {
        s->x[i] = lights[i].position[0];
        s->y[i] = lights[i].position[1];
        s->z[i] = lights[i].position[2];
        /* a bypass is !(distance^2 >= side^2): never for directions, always for ends that cannot be quantized */
        s->side_squared[i] = lights[i].bad ? INFINITY : lights[i].side_squared;
    }
    *out = s;
    return VCACHE_OK;
}

void vcache_light_set_destroy(vcache_light_set **set)
{
    if (!set || !*set)
        return;
    vcache_light_set *s = *set;
    vcache_allocator a = s->cache->config.allocator;
    a.release(a.context, (void *)s->memory, s->bytes);
    *set = NULL;
}

uint64_t vcache_light_set_rows(const vcache_light_set *s)
{
    return s->rows;
}
