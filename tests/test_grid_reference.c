/* SPDX-License-Identifier: Apache-2.0 */
/* Grid coherence against the method as the paper writes it: pixel by pixel, light by light, with a stack of lights to
 * trace. The traced sets are to be the same, not only their size. */
#include "grid_support.h"

typedef struct reference {
    const world *w;
    const vcache_grid_config *f;
    uint8_t *visible, *traced; /* [pixels][lights] */
} reference;

static bool joined(const world *w, uint32_t a, uint32_t b)
{
    return vcache_grid_neighbours(w->cells, a)[b / 64] >> b % 64 & 1u;
}

static void trace(reference *r, uint32_t pixel, uint32_t light)
{
    size_t at = (size_t)pixel * r->w->lights + light;
    r->traced[at] = 1;
    r->visible[at] = !r->w->blocked[at];
}

enum { VISIBLE, BLOCKED, UNCERTAIN, NOT_ASKED };

static void flood(reference *r, uint32_t pixel, const uint8_t *predicted, const uint8_t *first, bool on)
{
    uint32_t n = r->w->lights, top = 0;
    size_t row = (size_t)pixel * n;
    uint32_t *stack = zeroes((size_t)n * n + n, sizeof *stack);
    for (uint32_t i = 0; i < n; i++)
        if (first[i])
            stack[top++] = i;
    while (top > 0) {
        uint32_t i = stack[--top];
        if (r->traced[row + i])
            continue;
        trace(r, pixel, i);
        bool visible = r->visible[row + i];
        if (!on || predicted[i] == (visible ? VISIBLE : BLOCKED))
            continue;
        for (uint32_t k = 0; k < n; k++) {
            bool agrees = predicted[k] == (visible ? VISIBLE : BLOCKED);
            if (joined(r->w, i, k) && predicted[k] != NOT_ASKED && !r->traced[row + k] && !(r->f->restricted && agrees))
                stack[top++] = k;
        }
    }
    free(stack);
}

/* `distance`: of the informers, pixels. */
static void decide(reference *r, uint32_t pixel, const uint32_t *informers, uint32_t count, double distance)
{
    const world *w = r->w;
    uint32_t n = w->lights;
    size_t row = (size_t)pixel * n;
    if (w->empty[pixel])
        return;
    bool near = distance <= r->f->near;
    uint32_t alike[4], number = 0;
    for (uint32_t i = 0; i < count; i++)
        if (!w->empty[informers[i]] && w->object[informers[i]] == w->object[pixel])
            alike[number++] = informers[i];
    bool same = count > 0 && (number == count || (near && number == 3));
    informers = alike;
    count = number;
    uint8_t *predicted = zeroes(n, 1), *first = zeroes(n, 1);
    for (uint32_t i = 0; i < n; i++) {
        if (w->below[row + i]) {
            predicted[i] = NOT_ASKED;
            continue;
        }
        if (!same) {
            trace(r, pixel, i);
            continue;
        }
        uint32_t blockers = 0, unknown = 0;
        for (uint32_t k = 0; k < count; k++) {
            size_t at = (size_t)informers[k] * n + i;
            unknown += w->below[at];
            blockers += !w->below[at] && !r->visible[at];
        }
        if (r->f->boundary)
            predicted[i] = (float)blockers > r->f->threshold || blockers == count ? BLOCKED : VISIBLE;
        else if (near && blockers > 1 && blockers + unknown == count)
            predicted[i] = BLOCKED, unknown = 0;
        else
            predicted[i] = unknown == count || (blockers > 0 && blockers + unknown < count) ? UNCERTAIN
                           : blockers                                                       ? BLOCKED
                                                                                            : VISIBLE;
        /* a light that some do not know is traced, but only floods against those that do */
        first[i] = predicted[i] == UNCERTAIN || unknown;
        r->visible[row + i] = predicted[i] == VISIBLE;
    }
    for (uint32_t i = 0; same && r->f->boundary && i < n; i++)
        for (uint32_t k = 0; predicted[i] != NOT_ASKED && k < n; k++)
            if (joined(w, i, k) &&
                (predicted[k] == NOT_ASKED ? r->f->order == VCACHE_GRID_SCANLINE : predicted[k] != predicted[i]))
                first[i] = 1;
    if (same)
        flood(r, pixel, predicted, first, distance > r->f->flood);
    free(predicted);
    free(first);
}

static void scanline(reference *r)
{
    uint32_t width = r->w->width;
    for (uint32_t p = 0; p < width * r->w->height; p++) {
        const uint32_t informers[] = {p - 1, p - width, p - width - 1};
        decide(r, p, informers, p % width == 0 || p < width ? 0 : 3, INFINITY);
    }
}

/* Nearest member of a set below and above; -1: none. */
static int below_of(const uint8_t *set, int x)
{
    do
        x--;
    while (x >= 0 && !set[x]);
    return x;
}

static int above_of(const uint8_t *set, int x, int length)
{
    do
        x++;
    while (x < length && !set[x]);
    return x < length ? x : -1;
}

/* Members of `odd` beside x, if no member of `lattice` is nearer; the last pixel takes what there is below. */
static uint32_t beside(const uint8_t *lattice, const uint8_t *odd, int x, int length, int out[2])
{
    uint32_t n = 0;
    int low = below_of(odd, x), high = above_of(odd, x, length), end = above_of(lattice, x, length);
    if (low >= 0 && (x == length - 1 || low > below_of(lattice, x)))
        out[n++] = low;
    if (high >= 0 && (end < 0 || high < end))
        out[n++] = high;
    return n;
}

static void coarse_to_fine(reference *r)
{
    int width = (int)r->w->width, height = (int)r->w->height, g = (int)r->f->spacing;
    uint8_t *lattice[2] = {zeroes((size_t)width, 1), zeroes((size_t)height, 1)};
    uint8_t *odd[2] = {zeroes((size_t)width, 1), zeroes((size_t)height, 1)};
    const int length[2] = {width, height};
    for (int axis = 0; axis < 2; axis++)
        for (int x = 0; x < length[axis]; x++)
            lattice[axis][x] = x % g == 0 || x == length[axis] - 1;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            if (lattice[0][x] && lattice[1][y])
                decide(r, (uint32_t)(y * width + x), NULL, 0, INFINITY);
    for (; g >= 2; g /= 2) {
        for (int axis = 0; axis < 2; axis++)
            for (int x = 0; x < length[axis]; x++)
                odd[axis][x] = x % g == g / 2 && x != length[axis] - 1;
        for (int half = 0; half < 2; half++)
            for (int y = 0; y < height; y++)
                for (int x = 0; x < width; x++) {
                    uint32_t in[4], n = 0;
                    int pair[2];
                    int left = below_of(lattice[0], x), right = above_of(lattice[0], x, width);
                    int top = below_of(lattice[1], y), bottom = above_of(lattice[1], y, height);
                    if (half == 0 && odd[0][x] && odd[1][y]) {
                        in[n++] = (uint32_t)(top * width + left), in[n++] = (uint32_t)(top * width + right);
                        in[n++] = (uint32_t)(bottom * width + left), in[n++] = (uint32_t)(bottom * width + right);
                    } else if (half == 1 && odd[0][x] && lattice[1][y]) {
                        in[n++] = (uint32_t)(y * width + left), in[n++] = (uint32_t)(y * width + right);
                        uint32_t count = beside(lattice[1], odd[1], y, height, pair);
                        for (uint32_t i = 0; i < count; i++)
                            in[n++] = (uint32_t)(pair[i] * width + x);
                    } else if (half == 1 && lattice[0][x] && odd[1][y]) {
                        in[n++] = (uint32_t)(top * width + x), in[n++] = (uint32_t)(bottom * width + x);
                        uint32_t count = beside(lattice[0], odd[0], x, width, pair);
                        for (uint32_t i = 0; i < count; i++)
                            in[n++] = (uint32_t)(y * width + pair[i]);
                    }
                    if (n > 0)
                        decide(r, (uint32_t)(y * width + x), in, n, g / 2 * (half ? 1.0 : sqrt(2.0)));
                }
        for (int axis = 0; axis < 2; axis++)
            for (int x = 0; x < length[axis]; x++)
                lattice[axis][x] |= odd[axis][x];
    }
    for (int axis = 0; axis < 2; axis++) {
        free(lattice[axis]);
        free(odd[axis]);
    }
}

/* Shadows of all sizes, some of one pixel; horizons; a few objects and holes. */
static void scatter(world *w, uint64_t seed)
{
    uint32_t discs = 12 + w->lights / 2;
    for (uint32_t i = 0; i < discs; i++) {
        double x = random_unit(&seed) * w->width, y = random_unit(&seed) * w->height;
        double radius = 0.5 + 8.0 * random_unit(&seed) * random_unit(&seed);
        float d[3];
        random_direction(&seed, d);
        uint32_t light = vcache_grid_nearest(w->cells, d);
        bool horizon = random_unit(&seed) < 0.2;
        for (uint32_t p = 0; p < w->width * w->height; p++)
            for (uint32_t k = 0; k < w->lights; k++)
                if (hypot(p % w->width - x, p / w->width - y) < radius && (k == light || joined(w, light, k)))
                    (horizon ? w->below : w->blocked)[(size_t)p * w->lights + k] = 1;
    }
    for (uint32_t p = 0; p < w->width * w->height; p++) {
        w->object[p] = p % w->width > 2 * w->width / 3;
        w->empty[p] = random_unit(&seed) < 0.003;
    }
    for (size_t i = 0; i < (size_t)w->width * w->height * w->lights; i++)
        w->blocked[i] ^= random_unit(&seed) < 0.002;
}

static void as_the_paper(void **state)
{
    (void)state;
    const char *const modes[] = {"SNB",           "SNU",        "GNB",
                                 "GNU",           "RES",        "FLO",
                                 "OPT",           "NEAR",       "GNB,threshold=2",
                                 "OPT,spacing=4", "GNU,near=1", "NEAR,near=3,flood=2",
                                 "GNB,near=4"};
    const uint32_t sizes[][3] = {{1, 1, 5},    {1, 40, 20},  {40, 1, 20}, {2, 2, 7},   {17, 13, 70},
                                 {33, 33, 20}, {37, 30, 66}, {16, 16, 9}, {150, 7, 12}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        float d[3 * 70];
        uint64_t seed = s + 1;
        for (uint32_t i = 0; i < sizes[s][2]; i++)
            random_direction(&seed, d + 3 * (size_t)i);
        world w = world_new(sizes[s][0], sizes[s][1], d, NULL, sizes[s][2]);
        scatter(&w, seed);
        size_t pairs = (size_t)w.width * w.height * w.lights;
        for (size_t m = 0; m < sizeof modes / sizeof *modes; m++) {
            vcache_grid_config f = mode_of(modes[m]);
            f.rays = 100; /* many batches */
            reference r = {&w, &f, zeroes(pairs, 1), zeroes(pairs, 1)};
            if (f.order == VCACHE_GRID_SCANLINE)
                scanline(&r);
            else
                coarse_to_fine(&r);
            world_run(&w, &f);
            for (size_t i = 0; i < pairs; i++)
                if (r.traced[i] != w.traced[i] || r.visible[i] != w.answer[i])
                    fail_msg("%s, %u x %u: pixel %zu, light %zu: traced %d, not %d; visible %d, not %d", modes[m],
                             w.width, w.height, i / w.lights, i % w.lights, w.traced[i], r.traced[i], w.answer[i],
                             r.visible[i]);
            free(r.visible);
            free(r.traced);
        }
        world_free(&w);
    }
}

/* The same rays whatever fits into a batch. */
static void batches_change_nothing(void **state)
{
    (void)state;
    float d[3 * 70];
    uint64_t seed = 77;
    for (uint32_t i = 0; i < 70; i++)
        random_direction(&seed, d + 3 * (size_t)i);
    world w = world_new(70, 70, d, NULL, 70);
    scatter(&w, seed);
    size_t pairs = (size_t)w.width * w.height * w.lights;
    for (size_t i = 0; i < pairs; i++)
        w.distance = 3.0f;
    const char *const modes[] = {"GNU", "OPT", "GWB", "SWU", "TRUE"};
    for (size_t m = 0; m < sizeof modes / sizeof *modes; m++) {
        vcache_grid_config f = mode_of(modes[m]);
        world_run(&w, &f);
        uint8_t *before = zeroes(pairs, 1);
        memcpy(before, w.traced, pairs);
        f.rays = 70;
        world_run(&w, &f);
        assert_memory_equal(before, w.traced, pairs);
        free(before);
    }
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(as_the_paper),
        cmocka_unit_test(batches_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
