/* SPDX-License-Identifier: Apache-2.0 */
/* Algorithm 2 and its variants, 64 lights at a time as vcache/light_set.c walks. */
#include "replay_around.h"

#include <float.h>
#include <string.h>

enum { NEIGHBOURS = AROUND_MAX, ALL_LEVELS = VCACHE_MAX_LEVELS };

typedef struct replay {
    const record *r;
    const grid_policy *p;
    vcache *cache;
    cells cells;
    rgb *difference;
    float *near_squared; /* of each light: nearer eye samples are answered exactly */
    uint32_t *group;     /* of each light: the next of its light cell, in a ring */
    uint32_t *nearest;   /* [lights][flood] by distance */
    const replay_bits *bits;
    light_neighbours beside;
    /* of the eye sample at hand */
    _Alignas(8) char eye[VCACHE_EYE_BYTES];
    uint64_t around[ALL_LEVELS][AROUND_MAX]; /* keys */
    float *squared_distance, *excess;
    record_row row;
    uint64_t *near_bits, *open, *answer;
    uint64_t *traced, *refuted;   /* with flooding */
    uint64_t *from[ALL_LEVELS];   /* pairs that start at this level or below */
    uint64_t *deeper[ALL_LEVELS]; /* pairs that may go on below this level */
    replay_result result;
} replay;

vcache_surface replay_jitter(const record *r, uint32_t eye, float ce, float jitter)
{
    vcache_surface s = record_surface(r, eye);
    if (!(jitter > 0.0f))
        return s;
    rng random = rng_make(3, eye);
    float reach = jitter * ce / sqrtf(s.density);
    float a = reach * (rng_float(&random) - 0.5f), b = reach * (rng_float(&random) - 0.5f);
    vec3 u, v;
    v3_basis(v3(s.normal[0], s.normal[1], s.normal[2]), &u, &v);
    s.position[0] += a * u.x + b * v.x;
    s.position[1] += a * u.y + b * v.y;
    s.position[2] += a * u.z + b * v.z;
    return s;
}

/* ---------------------------------------------------------------------------------------- sets of lights, as bits */

/* Squared distances, and how much the square that bounds contacts exceeds them. */
CLONES static void distances(const vpl_set *l, vec3 p, const float *restrict near_squared, float side_squared,
                             float *restrict squared, float *restrict excess)
{
    const float *restrict x = l->x, *restrict y = l->y, *restrict z = l->z;
    for (uint32_t i = 0; i < l->padded; i++) {
        float dx = x[i] - p.x, dy = y[i] - p.y, dz = z[i] - p.z;
        float d = dx * dx + dy * dy + dz * dz;
        float bound = near_squared[i] > side_squared ? near_squared[i] : side_squared;
        squared[i] = d;
        excess[i] = bound - d;
    }
}

static void fill(uint64_t *bits, uint32_t words, bool value)
{
    memset(bits, value ? 0xff : 0, words * sizeof *bits);
}

/* Start and depth by contribution: both are thresholds of it. */
static void levels_by_contribution(replay *s, uint32_t eye, uint32_t levels)
{
    const grid_policy *p = s->p;
    const record *r = s->r;
    record_contributions(r, eye, &s->row);
    double sum = 0.0;
    uint32_t facing = 0;
    for (uint32_t i = 0; i < r->padded; i++)
        sum += s->row.luminance[i];
    for (uint32_t w = 0; w < r->words; w++)
        facing += (uint32_t)__builtin_popcountll(r->asked[(size_t)eye * r->words + w]);
    float mean = facing ? (float)(sum / facing) : 1.0f;
    const float *f = s->row.luminance;
    for (uint32_t d = 0; d < levels; d++) {
        if (p->power > 0.0f) /* level 2 has C_E */
            shade_bits_above(f, d ? mean * exp2f(((float)d - 2.5f) / p->power) : 0.0f, r->words, s->from[d]);
        else if (d == 1 && p->finer_above > 0.0f)
            shade_bits_above(f, mean * p->finer_above, r->words, s->from[d]);
        else
            fill(s->from[d], r->words, d == 0);
    }
    for (uint32_t d = 0; d < levels; d++)
        if (p->power > 0.0f) {
            uint32_t start = d + 1 > (uint32_t)p->deeper ? d + 1 - (uint32_t)p->deeper : 0;
            if (start < levels)
                memcpy(s->deeper[d], s->from[start], r->words * sizeof **s->from);
            else
                fill(s->deeper[d], r->words, false);
        } else {
            shade_bits_above(f, mean * p->refine_above, r->words, s->deeper[d]);
        }
}

/* Cells smaller for nearer lights. */
static void levels_by_distance(replay *s, uint32_t levels, float side)
{
    uint32_t words = s->r->words;
    fill(s->from[0], words, true);
    for (uint32_t d = 1; d < levels; d++, side *= 0.5f) {
        float bound = side / s->p->distance;
        shade_bits_above(s->squared_distance, bound * bound, words, s->from[d]);
        for (uint32_t w = 0; w < words; w++)
            s->from[d][w] = ~s->from[d][w];
    }
    for (uint32_t d = 0; d < levels; d++)
        fill(s->deeper[d], words, true);
}

static void choose_levels(replay *s, uint32_t eye, uint32_t levels, float side)
{
    const grid_policy *p = s->p;
    if (p->refine_above > 0.0f || p->finer_above > 0.0f || p->power > 0.0f) {
        levels_by_contribution(s, eye, levels);
        return;
    }
    if (p->distance > 0.0f) {
        levels_by_distance(s, levels, side);
        return;
    }
    for (uint32_t d = 0; d < levels; d++) {
        fill(s->from[d], s->r->words, d == 0);
        fill(s->deeper[d], s->r->words, true);
    }
}

/* ------------------------------------------------------------------------------------------------------- the walk */

/* True where the point may speak for its cell at `level`: shifted by what is left beside the middle part, it stays in.
 */
static bool may_define(const replay *s, uint32_t eye, uint32_t level)
{
    if (!(s->p->middle > 0.0f))
        return true;
    vcache_surface end = record_surface(s->r, eye);
    grid_point p;
    quantize_point(s->cache, end.position, end.normal, &p);
    double ce = s->p->ce, r2 = s->cache->diameter * s->cache->diameter * (double)end.density / (ce * ce);
    cell_size size = quantize_size(s->cache, quantize_step(s->cache, ldexp(r2, 2 * (int)level), s->cache->step_limit));
    double margin = 0.5 * (1.0 - (double)s->p->middle) / size.resolution;
    grid_point low = p, high = p;
    low.u -= margin, low.v -= margin;
    high.u += margin, high.v += margin;
    cell a = quantize_cell(s->cache, &low, size, NULL), b = quantize_cell(s->cache, &high, size, NULL);
    return a.i == b.i && a.j == b.j;
}

/* Traces the lights of a word; returns what is visible. With shared lights the first of a light cell answers for all.
 */
static uint64_t trace(replay *s, uint64_t *row, uint32_t w, uint64_t missing, uint64_t truth_word)
{
    uint64_t *known = row, *visible = row ? row + s->r->words : NULL;
    if (!row || !s->p->share_lights) {
        s->result.rays += (uint32_t)__builtin_popcountll(missing);
        if (row)
            known[w] |= missing, visible[w] |= missing & truth_word;
        return missing & truth_word;
    }
    uint64_t answer = 0;
    for (; missing; missing &= missing - 1) {
        uint64_t bit = missing & -missing;
        uint32_t first = 64 * w + (uint32_t)__builtin_ctzll(missing), i = first;
        if (!(known[w] & bit)) {
            s->result.rays++;
            do {
                uint64_t mask = (uint64_t)1 << i % 64;
                known[i / 64] |= mask;
                visible[i / 64] |= truth_word & bit ? mask : 0;
                i = s->group[i];
            } while (i != first);
        }
        answer |= visible[w] & bit;
    }
    return answer;
}

static uint32_t known_neighbours(const replay *s, const vcache_eye *end, uint32_t d, const uint64_t *rows[NEIGHBOURS])
{
    uint32_t count = 0;
    const uint64_t *keys = s->p->around ? s->around[d] : end->level[d].neighbour;
    for (int i = 0; i < (s->p->around ? AROUND_MAX : 4); i++) {
        uint32_t at = cells_find(&s->cells, keys[i]);
        if (at != NO_CELL)
            rows[count++] = cells_row(&s->cells, at);
    }
    return count;
}

/* Lights that a known neighbour sees otherwise. */
static uint64_t differing(const uint64_t *const rows[NEIGHBOURS], uint32_t count, uint32_t words, uint32_t w,
                          uint64_t visible)
{
    uint64_t differs = 0;
    for (uint32_t i = 0; i < count; i++)
        differs |= rows[i][w] & (rows[i][words + w] ^ visible);
    return differs;
}

static void walk_down(replay *s, uint32_t eye, const vcache_eye *end, const uint64_t *seen)
{
    uint32_t words = s->r->words;
    uint64_t *left = s->open, any = 1;
    for (uint32_t d = 0; d < end->levels && any; d++) {
        uint64_t *row = may_define(s, eye, d) ? cells_row(&s->cells, cells_add(&s->cells, end->level[d].center)) : NULL;
        uint64_t *known = row;
        if (!row) {
            uint32_t at = cells_find(&s->cells, end->level[d].center);
            known = at == NO_CELL ? NULL : cells_row(&s->cells, at);
        }
        const uint64_t *around[NEIGHBOURS];
        bool last = d + 1 == end->levels;
        uint32_t count = last ? 0 : known_neighbours(s, end, d, around);
        any = 0;
        for (uint32_t w = 0; w < words; w++) {
            uint64_t here = left[w] & s->from[d][w] & ~(last ? 0 : s->from[d + 1][w]), later = left[w] & ~here;
            uint64_t hit = here & (known ? known[w] : 0), missing = here & ~hit, visible = known ? known[words + w] : 0;
            if (missing)
                s->answer[w] |= trace(s, row, w, missing, seen[w]);
            s->traced[w] |= missing;
            uint64_t differs = count ? hit & s->deeper[d][w] : 0;
            if (differs)
                differs &= s->p->around >= AROUND_64
                               ? around_differing(&s->beside, around, count, words, w, differs, visible)
                               : differing(around, count, words, w, visible);
            s->answer[w] |= visible & hit & ~differs;
            s->refuted[w] |= differs & (visible ^ seen[w]);
            /* who goes on has started: from now on as any pair of the next level */
            left[w] = later | differs;
            if (!last)
                s->from[d + 1][w] |= differs;
            for (uint32_t e = d + 2; e < end->levels && differs; e++)
                s->from[e][w] &= ~differs;
            any |= left[w];
        }
    }
}

/* Traces the neighbours of lights whose ray refuted a coarser cell, and theirs where answers were wrong (Ben-Artzi et
 * al. 2006, Sect. 4.2). */
static void flood(replay *s, const vcache_eye *end, const uint64_t *asked, const uint64_t *seen)
{
    uint32_t words = s->r->words, count = (uint32_t)s->p->flood;
    uint64_t *finest = cells_row(&s->cells, cells_add(&s->cells, end->level[end->levels - 1].center));
    for (uint32_t w = 0; w < words; w++)
        s->refuted[w] &= s->traced[w];
    for (uint32_t w = 0; w < words; w++)
        while (s->refuted[w]) {
            uint32_t from = 64 * w + (uint32_t)__builtin_ctzll(s->refuted[w]), back = w;
            s->refuted[w] &= s->refuted[w] - 1;
            for (uint32_t k = 0; k < count; k++) {
                uint32_t i = s->nearest[(size_t)from * count + k], v = i / 64;
                uint64_t bit = (uint64_t)1 << i % 64;
                if (!(asked[v] & bit) || (s->traced[v] & bit))
                    continue;
                s->result.rays++;
                s->traced[v] |= bit;
                s->refuted[v] |= (s->answer[v] ^ seen[v]) & bit;
                s->answer[v] = (s->answer[v] & ~bit) | (seen[v] & bit);
                finest[v] |= bit;
                finest[words + v] |= seen[v] & bit;
                back = v < back ? v : back;
            }
            w = back;
        }
}

/* Coarser levels first, as witnesses; a ray defines all cells that are unknown. */
static void walk_up(replay *s, const vcache_eye *end, const uint64_t *seen)
{
    uint32_t words = s->r->words, last = end->levels - 1, top = last - (uint32_t)s->p->agree;
    uint64_t *rows[ALL_LEVELS];
    const uint64_t *around[ALL_LEVELS][NEIGHBOURS];
    uint32_t count[ALL_LEVELS];
    for (uint32_t d = top; d <= last; d++)
        cells_add(&s->cells, end->level[d].center);
    for (uint32_t d = top; d <= last; d++) {
        rows[d] = cells_row(&s->cells, cells_find(&s->cells, end->level[d].center));
        count[d] = known_neighbours(s, end, d, around[d]);
    }
    for (uint32_t w = 0; w < words; w++) {
        uint64_t known = rows[last][w], visible = rows[last][words + w], agree = s->open[w] & ~known;
        uint64_t parent = rows[last - 1][words + w];
        for (uint32_t d = top; d < last; d++)
            agree &= rows[d][w] & ~(rows[d][words + w] ^ parent) & ~differing(around[d], count[d], words, w, parent);
        uint64_t missing = s->open[w] & ~known & ~agree;
        s->result.rays += (uint32_t)__builtin_popcountll(missing);
        s->answer[w] |= s->open[w] & ((known & visible) | (agree & parent) | (missing & seen[w]));
        for (uint32_t d = top; d <= last; d++) {
            uint64_t fresh = missing & ~rows[d][w];
            rows[d][w] |= fresh;
            rows[d][words + w] |= fresh & seen[w];
        }
    }
}

static void one_eye(replay *s, uint32_t eye)
{
    const record *r = s->r;
    vcache_eye *end = (vcache_eye *)(void *)s->eye;
    float ce = s->p->power > 0.0f ? 4.0f * s->p->ce : s->p->ce;
    vcache_surface at = replay_jitter(r, eye, ce, s->p->jitter);
    vcache_prepare_eye(s->cache, &at, ce, 0, end);
    if (s->p->around)
        around_prepare(s->cache, &at, ce, end, s->around);
    const uint64_t *seen = r->visible + (size_t)eye * r->words, *asked = r->asked + (size_t)eye * r->words;
    float side = sqrtf(end->side_squared), finest = ldexpf(side, 1 - (int)end->levels);
    float near_side = s->p->distance > 0.0f ? finest : s->p->power > 0.0f && s->p->eye_contacts ? 0.25f * side : side;
    distances(&r->lights, r->eyes[eye].surface.position, s->near_squared,
              end->levels ? near_side * near_side : INFINITY, s->squared_distance, s->excess);
    shade_bits_above(s->excess, 0.0f, r->words, s->near_bits);
    for (uint32_t w = 0; w < r->words; w++) {
        s->result.rays += (uint32_t)__builtin_popcountll(asked[w] & s->near_bits[w]);
        s->answer[w] = asked[w] & s->near_bits[w] & seen[w];
        s->open[w] = asked[w] & ~s->near_bits[w];
        if (s->bits)
            s->bits->clustered[(size_t)eye * r->words + w] = s->open[w];
    }
    if (s->p->agree > 0 && (int)end->levels > s->p->agree) {
        walk_up(s, end, seen);
    } else {
        choose_levels(s, eye, end->levels, side);
        fill(s->refuted, r->words, false);
        memcpy(s->traced, s->near_bits, r->words * sizeof *s->traced);
        walk_down(s, eye, end, seen);
        if (s->p->flood > 0 && end->levels > 0)
            flood(s, end, asked, seen);
    }
    rgb *d = &s->difference[r->pixel[eye]];
    for (uint32_t w = 0; w < r->words; w++) {
        uint64_t wrong = (s->answer[w] ^ seen[w]) & asked[w];
        if (s->bits)
            s->bits->wrong[(size_t)eye * r->words + w] = wrong;
        for (; wrong; wrong &= wrong - 1) {
            uint32_t i = (uint32_t)__builtin_ctzll(wrong);
            *d = v3_mad(*d, s->answer[w] >> i & 1u ? 1.0f : -1.0f, record_contribution(r, eye, 64 * w + i));
            s->result.wrong++;
        }
    }
}

/* ---- set-up */

static void prepare_lights(replay *s)
{
    const vpl_set *l = &s->r->lights;
    vcache_light *ends = xcalloc(s->r->padded, sizeof *ends);
    for (uint32_t i = 0; i < l->count; i++) {
        vcache_surface at = {.position = {l->x[i], l->y[i], l->z[i]},
                             .normal = {l->gx[i], l->gy[i], l->gz[i]},
                             .density = l->density[i]};
        vcache_prepare_patch(s->cache, &at, &ends[i]);
        s->near_squared[i] = ends[i].bad ? INFINITY : s->p->eye_contacts ? 0.0f : ends[i].side_squared;
        s->group[i] = i;
        for (uint32_t k = i; k-- > 0;)
            if (ends[k].key.hash == ends[i].key.hash && !ends[i].bad) {
                s->group[i] = s->group[k];
                s->group[k] = i;
                break;
            }
    }
    free(ends);
}

/* The `flood` nearest lights of each, by insertion. */
static void find_nearest(replay *s)
{
    const vpl_set *l = &s->r->lights;
    uint32_t count = (uint32_t)s->p->flood;
    float *distance = xcalloc(count + 1, sizeof *distance);
    for (uint32_t i = 0; i < l->count; i++) {
        uint32_t *out = s->nearest + (size_t)i * count, found = 0;
        for (uint32_t k = 0; k < l->count; k++) {
            float x = l->x[k] - l->x[i], y = l->y[k] - l->y[i], z = l->z[k] - l->z[i], d = x * x + y * y + z * z;
            if (k == i || (found == count && d >= distance[count - 1]))
                continue;
            uint32_t at = found < count ? found++ : count - 1;
            for (; at > 0 && distance[at - 1] > d; at--)
                distance[at] = distance[at - 1], out[at] = out[at - 1];
            distance[at] = d, out[at] = k;
        }
    }
    free(distance);
}

replay_result replay_grid(const record *r, const grid_policy *p, const replay_bits *bits)
{
    replay *s = xcalloc(1, sizeof *s);
    vcache_config config = vcache_default_config();
    config.levels = p->levels;
    config.normal_bins = p->normal_bins ? p->normal_bins : config.normal_bins;
    config.layers = p->layers ? p->layers : config.layers;
    config.resolution_step = p->step > 0.0f ? p->step : config.resolution_step;
    s->r = r;
    s->p = p;
    s->bits = bits;
    s->cache = record_cache(r, config);
    if (p->around >= AROUND_64)
        s->beside = light_neighbours_new(r, s->cache, p->around == AROUND_72);
    s->difference = xcalloc((size_t)r->view.settings.width * r->view.settings.height, sizeof *s->difference);
    s->near_squared = xcalloc(r->padded, sizeof *s->near_squared);
    s->group = xcalloc(r->padded, sizeof *s->group);
    s->squared_distance = xcalloc(r->padded, sizeof *s->squared_distance);
    s->excess = xcalloc(r->padded, sizeof *s->excess);
    s->row = record_row_new(r);
    s->nearest = xcalloc((size_t)r->padded * (size_t)(p->flood > 0 ? p->flood : 1), sizeof *s->nearest);
    uint64_t **sets[] = {&s->near_bits, &s->open, &s->answer, &s->traced, &s->refuted};
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++)
        *sets[i] = xcalloc(r->words, sizeof **sets[i]);
    for (int d = 0; d < ALL_LEVELS; d++) {
        s->from[d] = xcalloc(r->words, sizeof **s->from);
        s->deeper[d] = xcalloc(r->words, sizeof **s->deeper);
    }
    cells_new(&s->cells, r->words);
    prepare_lights(s);
    if (p->flood > 0 && r->lights.count > (uint32_t)p->flood)
        find_nearest(s);

    uint32_t *order = xmalloc(r->count * sizeof *order);
    record_sort(r, p->order, (double)p->ce / sqrt(r->view.settings.spp), order);
    for (uint32_t i = 0; i < r->count; i++)
        one_eye(s, order[i]);
    replay_result result = s->result;
    result.l_inf = replay_l_inf(r, s->difference);
    result.cells = s->cells.count;

    free(order);
    cells_free(&s->cells);
    light_neighbours_free(&s->beside);
    for (int d = 0; d < ALL_LEVELS; d++) {
        free(s->from[d]);
        free(s->deeper[d]);
    }
    for (size_t i = 0; i < sizeof sets / sizeof *sets; i++)
        free(*sets[i]);
    record_row_free(&s->row);
    free(s->squared_distance);
    free(s->excess);
    free(s->group);
    free(s->nearest);
    free(s->near_squared);
    free(s->difference);
    vcache_destroy(&s->cache);
    free(s);
    return result;
}
