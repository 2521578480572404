/* SPDX-License-Identifier: Apache-2.0 */
/* Prepared ends: everything of a key that one end of a connection determines, hashed once. */
#include "cells.h"

#include <float.h>
#include <math.h>
#include <string.h>

#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#endif

/* Seeds keep eye cells and light cells of each kind apart. */
static const uint64_t seed_eye = 0x8bb84b93962eacc9u;
static const uint64_t seed_line = 0x1d8e4e27c47d124fu;
static const uint64_t seed_kind[4] = {0x2d358dccaa6c78a5u, 0x4d5a2da51de1aa47u, 0xc2b2ae3d27d4eb4fu,
                                      0x165667b19e3779f9u};

/* C_MSR = log2 C_E levels unless the config says otherwise. */
int vcache_levels(const vcache *c, float ce)
{
    int levels = c->config.levels;
    if (levels == 0)
        for (levels = 1; levels < VCACHE_MAX_LEVELS && ce >= (float)(2u << levels); levels++)
            ;
    return levels;
}

size_t vcache_eye_size(const vcache *c, float ce)
{
    return sizeof(vcache_eye) + (size_t)vcache_levels(c, ce) * sizeof(eye_level);
}

size_t vcache_light_size(void)
{
    return sizeof(vcache_light);
}

vcache_light *vcache_light_at(vcache_light *lights, size_t index)
{
    return lights + index;
}

void vcache_bundle_lights(const vcache *c, vcache_light *lights, size_t count)
{
    if (c->config.hash != VCACHE_HASH_SPLIT || c->table.count < TABLE_LINE)
        return;
    for (size_t i = 0; i < count; i++) {
        /* the line is named after its first light: equal arrays in two frames or threads share it */
        size_t first = i / TABLE_LINE * TABLE_LINE;
        lights[i].key.line = hash_words(lights[first].key.hash, first, seed_line);
        lights[i].lane = (uint8_t)(i % TABLE_LINE);
    }
}

/* The 7 words of Sect. 3.3 packed into four: orientation and resolution step share one. */
static void pack_cell(cell q, uint32_t orientation, int step, uint32_t words[4])
{
    words[0] = (uint32_t)q.i;
    words[1] = (uint32_t)q.j;
    words[2] = (uint32_t)q.layer;
    words[3] = orientation | (uint32_t)step << 21;
}

static uint64_t hash_four(const uint32_t w[4], uint64_t seed)
{
    return hash_words((uint64_t)w[1] << 32 | w[0], (uint64_t)w[3] << 32 | w[2], seed);
}

/* Half key of an eye cell: a hash of its own, or where the recurrence of a serial family stands after it. */
static uint64_t hash_eye_cell(const vcache *c, cell q, uint32_t orientation, int step, uint64_t salt)
{
    uint32_t words[4];
    if (c->config.hash == VCACHE_HASH_SPLIT)
        return cell_hash(q, orientation, step, seed_eye ^ salt);
    pack_cell(q, orientation, step, words);
    return hash_recurrence(c->config.hash, salt, words, 4);
}

void vcache_prepare_eye(const vcache *c, const vcache_surface *surface, float ce, uint64_t salt, vcache_eye *out)
{
    memcpy(out->position, surface->position, sizeof out->position);
    out->user = surface->user;
    out->side_squared = 0.0f;
    out->levels = 0;
    out->unused = 0;
    grid_point p;
    if (!(surface->density > 0.0f) || !(ce > 0.0f) || !isfinite(ce) ||
        !quantize_point(c, surface->position, surface->normal, &p))
        return;
    /* Eq. 7: R = 2 B_R sqrt(density) / C_E; each level halves C_E and so quadruples R^2. */
    double r2 = c->diameter * c->diameter * (double)surface->density / ((double)ce * ce);
    if (salt)
        salt = hash_words(salt, 0, seed_eye);
    uint32_t levels = (uint32_t)vcache_levels(c, ce);
    int last_step = -1;
    for (uint32_t d = 0; d < levels; d++, r2 *= 4.0) {
        int step = quantize_step(c, r2, c->step_limit);
        if (step == last_step)
            continue; /* the cells of the level before: coarsest or finest ones, or a large C_R */
        last_step = step;
        bool refined = d + 1 < levels; /* nobody asks the last level's neighbours */
        cell_size size = quantize_size(c, step);
        cell around[4], q = quantize_cell(c, &p, size, refined ? around : NULL);
        eye_level *l = &out->level[out->levels++];
        l->center = hash_eye_cell(c, q, p.orientation, step, salt);
        for (int i = 0; i < 4; i++)
            l->neighbour[i] = refined ? hash_eye_cell(c, around[i], p.orientation, step, salt) : l->center;
        if (out->levels == 1)
            out->side_squared = size.side * size.side;
    }
}

bool eye_cells(const vcache *c, const vcache_surface *surface, float ce, uint64_t salt, uint64_t cells[VCACHE_CELLS])
{
    grid_point p;
    if (!(surface->density > 0.0f) || !(ce > 0.0f) || !isfinite(ce) ||
        !quantize_point(c, surface->position, surface->normal, &p))
        return false;
    double r2 = c->diameter * c->diameter * (double)surface->density / ((double)ce * ce);
    if (salt)
        salt = hash_words(salt, 0, seed_eye);
    for (int i = 0; i < VCACHE_CELLS; i++, r2 *= 1.0 / 16.0) {
        int step = quantize_step(c, r2, c->step_limit);
        const cell_size size = {.step = step, .resolution = c->resolution[step]}; /* its side does not matter */
        cells[i] = hash_eye_cell(c, quantize_cell(c, &p, size, NULL), p.orientation, step, salt);
    }
    return true;
}

uint64_t vcache_eye_cell(const vcache_eye *eye, int level)
{
    if (eye->levels == 0)
        return 0;
    uint32_t l = level < 0 ? 0 : (uint32_t)level;
    return eye->level[l < eye->levels ? l : eye->levels - 1].center;
}

static void light_begin(vcache_light *out, enum end_kind kind, const float position[3], uint64_t user)
{
    memset(out, 0, sizeof *out);
    memcpy(out->position, position, sizeof out->position);
    out->user = user;
    out->kind = (uint8_t)kind;
    out->side_squared = kind == END_DIRECTION || kind == END_SOLID_ANGLE ? -1.0f : 0.0f;
    out->bad = 1;
    out->lane = LANE_NONE;
}

/* The kind and the key's words (at most 4) into the hash. */
static void light_finish(const vcache *c, vcache_light *out, const uint32_t *words, uint32_t count)
{
    uint32_t w[4] = {0};
    memcpy(w, words, count * sizeof *words);
    out->bad = 0;
    if (c->config.hash == VCACHE_HASH_SPLIT) {
        out->key.hash = hash_four(w, seed_kind[out->kind]);
        return;
    }
    memcpy(out->key.words, w, sizeof w);
    out->word_count = (uint8_t)count;
}

static void prepare_bitwise(const vcache *c, enum end_kind kind, const float v[3], uint64_t user, vcache_light *out)
{
    light_begin(out, kind, v, user);
    if (!finite3(v))
        return;
    uint32_t words[3];
    for (int i = 0; i < 3; i++) {
        float component = v[i] + 0.0f; /* -0 and 0 are one place */
        memcpy(&words[i], &component, sizeof component);
    }
    light_finish(c, out, words, 3);
}

void vcache_prepare_point(const vcache *c, const float position[3], uint64_t user, vcache_light *out)
{
    prepare_bitwise(c, END_POINT, position, user, out);
}

static bool is_direction(const float d[3])
{
    return finite3(d) && (d[0] != 0.0f || d[1] != 0.0f || d[2] != 0.0f);
}

void vcache_prepare_direction(const vcache *c, const float direction[3], uint64_t user, vcache_light *out)
{
    prepare_bitwise(c, END_DIRECTION, direction, user, out);
    if (!is_direction(direction))
        out->bad = 1;
}

void vcache_prepare_patch(const vcache *c, const vcache_surface *surface, vcache_light *out)
{
    light_begin(out, END_PATCH, surface->position, surface->user);
    grid_point p;
    if (!(surface->density > 0.0f) || !quantize_point(c, surface->position, surface->normal, &p))
        return;
    double r2 = c->diameter * c->diameter * (double)surface->density;
    cell_size size = quantize_size(c, quantize_step(c, r2, c->step_limit));
    uint32_t words[4];
    pack_cell(quantize_cell(c, &p, size, NULL), p.orientation, size.step, words);
    out->side_squared = size.side * size.side;
    light_finish(c, out, words, 4);
}

void vcache_prepare_solid_angle(const vcache *c, const float direction[3], float density, uint64_t user,
                                vcache_light *out)
{
    light_begin(out, END_SOLID_ANGLE, direction, user);
    if (!is_direction(direction) || !(density > 0.0f))
        return;
    /* Eq. 9 with 4 pi in the numerator: n uniform samples give about n cells. */
    int step = quantize_step(c, 12.566370614359172 * (double)density, c->direction_limit);
    double s, t, r = c->resolution[step];
    quantize_octahedral(direction, &s, &t);
    uint32_t i = (uint32_t)(s * r), j = (uint32_t)(t * r), last = c->resolution[step] - 1;
    uint32_t words[3] = {i < last ? i : last, j < last ? j : last, (uint32_t)step};
    light_finish(c, out, words, 3);
}

/* ------------------------------------------------------------------------------------------------------ densities */

float vcache_density_cone(float width, float cosine, float samples_per_pixel)
{
    float capped = cosine > 0.25f ? cosine : 0.25f;
    return samples_per_pixel * capped / (width * width);
}

float vcache_density_pdf(float pdf, float samples)
{
    return pdf * samples;
}

float vcache_density_unknown(const vcache *c, float samples)
{
    return (float)(samples / (3.14159265358979 * c->diameter * c->diameter));
}
