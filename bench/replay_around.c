/* SPDX-License-Identifier: Apache-2.0 */
#include "replay_around.h"

#include "vcache/cells.h"

#include <math.h>
#include <string.h>

static const int offset[AROUND_MAX][2] = {{1, 0}, {0, 1}, {-1, 0}, {0, -1}, {1, 1}, {-1, 1}, {-1, -1}, {1, -1}};

/* Keys of the cell that holds the point and of the 8 around it in its tangent plane. */
static uint64_t keys_of(const vcache *c, const grid_point *p, cell_size size, uint64_t around[AROUND_MAX])
{
    double height, layers = c->config.layers;
    cell q = cell_at(c, p, size.resolution, &height);
    for (int i = 0; i < AROUND_MAX; i++) {
        int du = offset[i][0], dv = offset[i][1];
        cell beside = {q.i + du, q.j + dv,
                       floor_int((height - du * p->slope_u - dv * p->slope_v) * layers + SHIFT_LAYER)};
        around[i] = cell_hash(beside, p->orientation, size.step, 1);
    }
    return cell_hash(q, p->orientation, size.step, 1);
}

void around_prepare(const vcache *c, const vcache_surface *at, float ce, vcache_eye *end,
                    uint64_t around[VCACHE_MAX_LEVELS][AROUND_MAX])
{
    grid_point p;
    if (end->levels == 0 || !quantize_point(c, at->position, at->normal, &p))
        return;
    double r2 = c->diameter * c->diameter * (double)at->density / ((double)ce * (double)ce);
    int last_step = -1;
    for (uint32_t d = 0; d < end->levels; r2 *= 4.0) {
        int step = quantize_step(c, r2, c->step_limit);
        if (step == last_step)
            continue;
        last_step = step;
        end->level[d].center = keys_of(c, &p, quantize_size(c, step), around[d]);
        d++;
    }
}

light_neighbours light_neighbours_new(const record *r, const vcache *c, bool with_own)
{
    const vpl_set *l = &r->lights;
    uint64_t *own = xcalloc(l->count, sizeof *own), (*around)[AROUND_MAX] = xcalloc(l->count, sizeof *around);
    for (uint32_t i = 0; i < l->count; i++) {
        grid_point p;
        const float position[3] = {l->x[i], l->y[i], l->z[i]}, normal[3] = {l->gx[i], l->gy[i], l->gz[i]};
        if (!quantize_point(c, position, normal, &p))
            continue;
        double r2 = c->diameter * c->diameter * (double)l->density[i];
        own[i] = keys_of(c, &p, quantize_size(c, quantize_step(c, r2, c->step_limit)), around[i]);
    }
    light_neighbours n = {xcalloc(r->padded + 1, sizeof *n.first), NULL};
    uint32_t count = 0, capacity = 0;
    for (uint32_t i = 0; i < r->padded; i++) {
        n.first[i] = count;
        for (uint32_t k = 0; i < l->count && own[i] && k < l->count; k++)
            for (int a = with_own ? -1 : 0; a < AROUND_MAX; a++)
                if (own[k] == (a < 0 ? own[i] : around[i][a])) {
                    if (count == capacity)
                        n.others = xrealloc(n.others, (capacity = 2 * capacity + 64) * sizeof *n.others);
                    n.others[count++] = k;
                    break;
                }
    }
    n.first[r->padded] = count;
    free(own);
    free(around);
    return n;
}

void light_neighbours_free(light_neighbours *n)
{
    free(n->first);
    free(n->others);
}

uint64_t around_differing(const light_neighbours *n, const uint64_t *const *rows, uint32_t count, uint32_t words,
                          uint32_t w, uint64_t hit, uint64_t visible)
{
    uint64_t differs = 0;
    for (; hit; hit &= hit - 1) {
        uint32_t bit = (uint32_t)__builtin_ctzll(hit), i = 64 * w + bit;
        uint64_t value = visible >> bit & 1u, found = 0;
        for (uint32_t k = n->first[i]; k < n->first[i + 1] && !found; k++) {
            uint32_t word = n->others[k] / 64, shift = n->others[k] % 64;
            for (uint32_t a = 0; a < count; a++)
                found |= rows[a][word] >> shift & (rows[a][words + word] >> shift ^ value) & 1u;
        }
        differs |= found << bit;
    }
    return differs;
}
