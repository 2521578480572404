/* SPDX-License-Identifier: Apache-2.0 */
/* Grid-coherence mode (grid.h): the methods by name, creation. */
#include "grid_internal.h"
#include "sized.h"

#include <stdlib.h>
#include <string.h>

/* ---------------------------------------------------------------------------------------------------------- names */

static const char *const names[] = {"TRUE", "EYE", "SNB", "SNU", "SWB", "SWU",  "GNB", "GNU",
                                    "GWB",  "GWU", "RES", "FLO", "OPT", "NEAR", NULL};

const char *const *vcache_grid_mode_names(void)
{
    return names;
}

static void set_mode(vcache_grid_config *f, const char *name)
{
    bool near = strcmp(name, "NEAR") == 0, optimized = near || strcmp(name, "OPT") == 0;
    f->order = VCACHE_GRID_GRID;
    f->warping = f->boundary = false;
    f->restricted = optimized || strcmp(name, "RES") == 0;
    f->near = near ? 2 : 0;
    f->flood = near ? 2 : optimized || strcmp(name, "FLO") == 0;
    if (strcmp(name, "TRUE") == 0 || strcmp(name, "EYE") == 0)
        f->order = name[0] == 'T' ? VCACHE_GRID_TRUE : VCACHE_GRID_EYE;
    if (!strchr("SG", name[0]))
        return;
    f->order = name[0] == 'S' ? VCACHE_GRID_SCANLINE : VCACHE_GRID_GRID;
    f->warping = name[1] == 'W';
    f->boundary = name[2] == 'B';
}

static bool parse_option(const char *text, size_t length, vcache_grid_config *f)
{
    char option[32], *end;
    if (length >= sizeof option)
        return false;
    memcpy(option, text, length);
    option[length] = 0;
    char *value = strchr(option, '=');
    if (!value || !value[1] || !strchr("0123456789", value[1]))
        return false;
    *value++ = 0;
    if (strcmp(option, "threshold") == 0) {
        f->threshold = strtof(value, &end);
        return !*end;
    }
    unsigned long n = strtoul(value, &end, 10);
    uint32_t *to = strcmp(option, "spacing") == 0  ? &f->spacing
                   : strcmp(option, "rounds") == 0 ? &f->rounds
                   : strcmp(option, "bright") == 0 ? &f->bright
                   : strcmp(option, "flood") == 0  ? &f->flood
                   : strcmp(option, "near") == 0   ? &f->near
                                                   : NULL;
    if (*end || n > UINT32_MAX || !to)
        return false;
    *to = (uint32_t)n;
    return true;
}

/* ------------------------------------------------------------------------------------------------------- creation */

void vcache_grid_fill_config(vcache_grid_config *out, size_t size)
{
    vcache_grid_config f = {.size = sizeof f,
                            .pixels = 65 * 65,
                            .spacing = 16,
                            .threshold = 0.99f,
                            .rays = 16384,
                            .allocator = vcache_default_config().allocator};
    set_mode(&f, "NEAR");
    sized_fill(out, size, &f, sizeof f);
}

/* The host's config over the defaults; false, with a message, for a size that is none. */
static bool take(vcache_grid_config *f, const vcache_grid_config *given, char *message)
{
    *f = vcache_grid_default_config();
    const char *wrong =
        given ? sized_take(f, sizeof *f, SIZED_FIRST(vcache_grid_config, allocator), given) : "config is NULL";
    if (wrong)
        vcache_complain(message, VCACHE_ERROR_ARGUMENT, "%s: start from vcache_grid_default_config()", wrong);
    return !wrong;
}

static vcache_status check(const vcache_grid_config *f, char *message)
{
    const vcache_status bad = VCACHE_ERROR_ARGUMENT;
    if (f->pixels < 1 || f->pixels > 1u << 24)
        return vcache_complain(message, bad, "pixels is %u: it must be 1 ... %u", f->pixels, 1u << 24);
    if ((uint32_t)f->order > VCACHE_GRID_GRID)
        return vcache_complain(message, bad, "order is %d: it must be one of vcache_grid_order", (int)f->order);
    if (f->spacing < 2 || f->spacing > 64 || (f->spacing & (f->spacing - 1)) != 0)
        return vcache_complain(message, bad, "spacing is %u: it must be 2, 4, 8, 16, 32 or 64", f->spacing);
    if (f->flood > 64 || f->near > 64)
        return vcache_complain(message, bad, "%s is %u: it must be 0 ... 64", f->flood > 64 ? "flood" : "near",
                               f->flood > 64 ? f->flood : f->near);
    if (!(f->threshold >= 0.0f && f->threshold < 4.0f))
        return vcache_complain(message, bad, "threshold is %g: it must be 0 ... 3.99", (double)f->threshold);
    if (!f->allocator.allocate || !f->allocator.release)
        return vcache_complain(message, bad, "allocator: both functions must be set");
    return VCACHE_OK;
}

bool vcache_grid_parse_mode(const char *text, vcache_grid_config *config, char *message)
{
    vcache_grid_config f;
    if (!take(&f, config, message))
        return false;
    size_t length = strcspn(text, ",");
    const char *const *name = names;
    while (*name && (strlen(*name) != length || strncmp(*name, text, length) != 0))
        name++;
    if (!*name) {
        vcache_complain(message, VCACHE_ERROR_ARGUMENT,
                        "%.*s is none of TRUE, EYE, SNB, SNU, SWB, SWU, GNB, GNU, GWB, GWU, RES, FLO, OPT, NEAR",
                        length < 32 ? (int)length : 32, text);
        return false;
    }
    set_mode(&f, *name);
    while (text[length] == ',') {
        text += length + 1;
        length = strcspn(text, ",");
        if (!parse_option(text, length, &f)) {
            vcache_complain(message, VCACHE_ERROR_ARGUMENT,
                            "%.*s is none of spacing=N, rounds=N, bright=N, flood=N, near=N, threshold=X",
                            length < 32 ? (int)length : 32, text);
            return false;
        }
    }
    if (check(&f, message) != VCACHE_OK)
        return false;
    sized_fill(config, config->size, &f, sizeof f);
    return true;
}

/* `block` NULL: only counts. */
static size_t lay_out(vcache_grid *g, char *block)
{
    size_t at = 0;
    vcache_grid o = *g;
    size_t words = o.words, pixels = o.config.pixels, lights = o.lights->count;
    size_t part = pixels < PART_PIXELS ? pixels : PART_PIXELS;
    bool warping = o.config.warping;
    grid_carve(block, &at, 1, sizeof o);
    o.bright = grid_carve(block, &at, words, sizeof *o.bright);
    o.valid = grid_carve(block, &at, words, sizeof *o.valid);
    o.scratch = grid_carve(block, &at, SCRATCH_ROWS * words, sizeof *o.scratch);
    o.bits = grid_carve(block, &at, 2 * pixels * words, sizeof *o.bits);
    o.object = grid_carve(block, &at, pixels, sizeof *o.object);
    o.seen = grid_carve(block, &at, pixels, sizeof *o.seen);
    o.position = grid_carve(block, &at, warping ? 3 * pixels : 0, sizeof *o.position);
    o.blocker = grid_carve(block, &at, warping ? 3 * pixels * lights : 0, sizeof *o.blocker);
    o.part = grid_carve(block, &at, PART_PIXELS, sizeof *o.part);
    o.active = grid_carve(block, &at, part, sizeof *o.active);
    o.todo = grid_carve(block, &at, part * words, sizeof *o.todo);
    o.traced = grid_carve(block, &at, part * words, sizeof *o.traced);
    o.predicted = grid_carve(block, &at, part * words, sizeof *o.predicted);
    o.doubtful = grid_carve(block, &at, part * words, sizeof *o.doubtful);
    o.rays = grid_carve(block, &at, o.config.rays, sizeof *o.rays);
    o.counts = grid_carve(block, &at, lights, sizeof *o.counts);
    o.hits = grid_carve(block, &at, warping ? lights : 0, sizeof *o.hits);
    o.closeness = grid_carve(block, &at, warping ? lights : 0, sizeof *o.closeness);
    if (block)
        *g = o;
    return at;
}

vcache_status vcache_grid_create(const vcache_grid_config *given, const vcache_grid_lights *lights, vcache_grid **out,
                                 char *message)
{
    if (message)
        message[0] = 0;
    if (!out)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "out is NULL");
    *out = NULL;
    vcache_grid_config config;
    if (!take(&config, given, message))
        return VCACHE_ERROR_ARGUMENT;
    if (!lights)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "lights is NULL");
    vcache_status status = check(&config, message);
    if (status != VCACHE_OK)
        return status;
    if (config.rays < lights->count)
        return vcache_complain(message, VCACHE_ERROR_ARGUMENT, "rays is %u: it must be at least the lights, %u",
                               config.rays, lights->count);
    vcache_grid made = {.config = config, .lights = lights, .words = lights->words};
    made.bytes = lay_out(&made, NULL);
    const vcache_allocator *a = &config.allocator;
    char *block = a->allocate(a->context, made.bytes);
    if (!block)
        return vcache_complain(message, VCACHE_ERROR_MEMORY, "no memory for a block of %u pixels and %u lights",
                               config.pixels, lights->count);
    lay_out(&made, block);
    vcache_grid *g = (vcache_grid *)(void *)block;
    *g = made;
    for (uint32_t i = 0; i < lights->count; i++)
        g->valid[i / 64] |= (uint64_t)1 << i % 64;
    for (uint32_t i = 0; i < config.bright && i < lights->count; i++)
        g->bright[lights->ranked[i] / 64] |= (uint64_t)1 << lights->ranked[i] % 64;
    grid_walk_begin(&g->next, VCACHE_GRID_EYE, 2, 1, 1);
    g->next.done = true;
    *out = g;
    return VCACHE_OK;
}

void vcache_grid_destroy(vcache_grid **grid)
{
    if (!grid || !*grid)
        return;
    vcache_allocator a = (*grid)->config.allocator;
    a.release(a.context, *grid, (*grid)->bytes);
    *grid = NULL;
}

size_t vcache_grid_bytes(const vcache_grid *grid)
{
    return grid->bytes;
}
