/* SPDX-License-Identifier: Apache-2.0 */
/* Shadow rays of a chunk where few lights are asked for, each by few of 16 eye samples: a packet for each light would
 * be mostly empty, so the rays of all eye samples are packed light by light. */
#include "whitted.h"

typedef struct packing {
    const tracer *tracer;
    ray_packet packet;
    uint32_t count;                    /* lanes in use */
    uint64_t *word[GROUP], bit[GROUP]; /* where the answers go */
} packing;

/* The coherent flag makes it slower: lights change within a packet. */
static void flush(packing *l)
{
    uint32_t active = (1u << l->count) - 1u;
    uint32_t seen = active & ~tracer_occluded16(l->tracer, &l->packet, active, false);
    for (; seen; seen &= seen - 1) {
        uint32_t k = (uint32_t)__builtin_ctz(seen);
        *l->word[k] |= l->bit[k];
    }
    l->count = 0;
}

static void push(packing *l, vec3 origin, vec3 to, bool infinite, uint64_t *row, uint32_t i)
{
    ray_packet *p = &l->packet;
    uint32_t k = l->count++;
    to = infinite ? to : v3_sub(to, origin);
    p->org_x[k] = origin.x, p->org_y[k] = origin.y, p->org_z[k] = origin.z;
    p->dir_x[k] = to.x, p->dir_y[k] = to.y, p->dir_z[k] = to.z;
    p->tfar[k] = infinite ? INFINITY : RAY_END;
    l->word[k] = row + i / 64;
    l->bit[k] = (uint64_t)1 << i % 64;
    if (l->count == GROUP)
        flush(l);
}

/* Where light i of a group stands for eye sample e. */
static vec3 target_of(const vpl_set *vpls, const chunk *c, int group, uint32_t e, uint32_t i, bool *infinite)
{
    if (group == LIGHTS_PUNCTUAL)
        return punctuals_target(&c->punctual, i, infinite);
    *infinite = false;
    if (group == LIGHTS_VIRTUAL)
        return v3(vpls->x[i], vpls->y[i], vpls->z[i]);
    const light_sample *s = &c->sampled[(size_t)e * c->bits[group].lights + i];
    *infinite = s->infinite;
    return s->target;
}

/* Bit k of row i to bit i of row k (Warren, "Hacker's Delight", Sect. 7-3). */
static void transpose(uint64_t rows[64])
{
    uint64_t mask = 0xffffffffu;
    for (uint32_t step = 32; step; step >>= 1, mask ^= mask << step)
        for (uint32_t k = 0; k < 64; k = (k + step + 1) & ~step) {
            uint64_t swap = (rows[k] >> step ^ rows[k + step]) & mask;
            rows[k] ^= swap << step;
            rows[k + step] ^= swap;
        }
}

uint64_t packed_trace(const tracer *t, const vpl_set *vpls, chunk *c, tile_pixels *pixels)
{
    packing l = {.tracer = t};
    uint64_t rays = 0;
    bool infinite;
    packet_init(&l.packet);
    for (int g = 0; g < LIGHT_GROUPS; g++) {
        pair_bits *b = &c->bits[g];
        for (uint32_t w = 0; w < b->words; w++) {
            uint64_t askers[64] = {0}, any = 0; /* CHUNK eye samples */
            for (uint32_t e = 0; e < c->count; e++)
                any |= askers[e] = b->asked[(size_t)e * b->words + w];
            if (!any)
                continue;
            transpose(askers);
            for (; any; any &= any - 1) {
                uint32_t bit = (uint32_t)__builtin_ctzll(any), i = 64 * w + bit;
                for (uint64_t eyes = askers[bit]; eyes; eyes &= eyes - 1) {
                    uint32_t e = (uint32_t)__builtin_ctzll(eyes);
                    vec3 to = target_of(vpls, c, g, e, i, &infinite);
                    push(&l, c->eyes[e]->origin, to, infinite, b->visible + (size_t)e * b->words, i);
                    pixels->traced[c->eyes[e]->pixel]++;
                    rays++;
                }
            }
        }
    }
    if (l.count > 0)
        flush(&l);
    return rays;
}
