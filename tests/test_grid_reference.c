/* SPDX-License-Identifier: Apache-2.0 */
/* Grid coherence against the method as the paper writes it: pixel by pixel, light by light, with a stack of lights to
 * trace. The traced sets are to be the same, not only their size. */
#include "grid_support.h"

typedef struct reference {
    const world *w;
    const vcache_grid_config *f;
    uint8_t *visible, *traced; /* [pixels][lights] */
    double (*blocker)[3];      /* [pixels][lights] points, where blocked */
    uint8_t *bright;           /* [lights] */
} reference;

static bool joined(const world *w, uint32_t a, uint32_t b)
{
    return vcache_grid_neighbours(w->cells, a)[b / 64] >> b % 64 & 1u;
}

static double along(const world *w, uint32_t light, int axis)
{
    return (double)w->cells->direction[3 * light + (uint32_t)axis];
}

static void trace(reference *r, uint32_t pixel, uint32_t light)
{
    const world *w = r->w;
    size_t at = (size_t)pixel * w->lights + light;
    r->traced[at] = 1;
    r->visible[at] = !w->blocked[at];
    double distance = w->distances && w->distances[at] > 0 ? fmin((double)w->distances[at], 1e18) : 1e18;
    for (int k = 0; k < 3; k++)
        r->blocker[at][k] = (double)w->position[pixel][k] + distance * along(w, light, k);
}

/* Blockers of the informers, as this pixel sees them: how many lie in the cell of each light. Of those in one cell the
 * nearest to the light's direction is passed on. */
static void warp(reference *r, uint32_t pixel, const uint32_t *informers, uint32_t count, uint32_t *hits)
{
    const world *w = r->w;
    uint32_t n = w->lights;
    double *nearest = zeroes(n, sizeof *nearest);
    for (size_t from = 0; from < (size_t)count * n; from++) {
        size_t at = (size_t)informers[from / n] * n + from % n;
        if (w->below[at] || r->visible[at])
            continue;
        double d[3], length = 0, best = -2;
        uint32_t into = 0;
        for (int k = 0; k < 3; k++)
            d[k] = r->blocker[at][k] - (double)w->position[pixel][k], length += d[k] * d[k];
        for (uint32_t i = 0; i < n; i++) {
            double cosine = 0;
            for (int k = 0; k < 3; k++)
                cosine += d[k] * along(w, i, k) / sqrt(length);
            if (cosine > best)
                best = cosine, into = i;
        }
        if (hits[into]++ == 0 || best > nearest[into]) {
            nearest[into] = best;
            memcpy(r->blocker[(size_t)pixel * n + into], r->blocker[at], sizeof *r->blocker);
        }
    }
    free(nearest);
}

enum { VISIBLE, BLOCKED, UNCERTAIN, NOT_ASKED };

/* From the lights of `first`, and from neighbour to neighbour, at most `rounds` of them far. */
static void flood(reference *r, uint32_t pixel, const uint8_t *predicted, const uint8_t *first, bool on)
{
    uint32_t n = r->w->lights, head = 0, tail = 0;
    size_t row = (size_t)pixel * n;
    uint32_t(*queue)[2] = zeroes((size_t)n * n + n, sizeof *queue); /* light, how far */
    for (uint32_t i = 0; i < n; i++)
        if (first[i])
            queue[tail++][0] = i;
    while (head < tail) {
        uint32_t i = queue[head][0], far = queue[head++][1];
        if (r->traced[row + i])
            continue;
        trace(r, pixel, i);
        bool visible = r->visible[row + i];
        if (!on || predicted[i] == (visible ? VISIBLE : BLOCKED) || (r->f->rounds > 0 && far == r->f->rounds))
            continue;
        for (uint32_t k = 0; k < n; k++) {
            bool agrees = predicted[k] == (visible ? VISIBLE : BLOCKED);
            if (joined(r->w, i, k) && predicted[k] != NOT_ASKED && !r->traced[row + k] && !(r->f->restricted && agrees))
                queue[tail][0] = k, queue[tail++][1] = far + 1;
        }
    }
    free(queue);
}

/* Bright lights with a neighbour that is predicted otherwise or in doubt. */
static void add_bright(const reference *r, const uint8_t *predicted, uint8_t *first)
{
    uint32_t n = r->w->lights;
    uint8_t *doubt = zeroes(n, 1);
    memcpy(doubt, first, n);
    for (uint32_t i = 0; i < n; i++)
        for (uint32_t k = 0; k < n; k++)
            if (r->bright[i] && predicted[i] != NOT_ASKED && predicted[k] != NOT_ASKED && joined(r->w, i, k) &&
                (doubt[k] || predicted[k] != predicted[i]))
                first[i] = 1;
    free(doubt);
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
    uint32_t *hits = zeroes(n, sizeof *hits);
    if (same && r->f->warping)
        warp(r, pixel, informers, count, hits);
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
        if (r->f->warping)
            predicted[i] = r->f->boundary    ? (float)hits[i] > r->f->threshold ? BLOCKED : VISIBLE
                           : unknown         ? UNCERTAIN
                           : hits[i] == 0    ? VISIBLE
                           : hits[i] < count ? UNCERTAIN
                                             : BLOCKED;
        else if (r->f->boundary)
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
    if (same && !r->f->boundary)
        add_bright(r, predicted, first);
    if (same)
        flood(r, pixel, predicted, first, distance > r->f->flood);
    free(predicted);
    free(first);
    free(hits);
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

/* On a surface with waves; blockers nearer than the width of the image, some at it and some far away. */
static void place(world *w, uint64_t seed)
{
    size_t pixels = (size_t)w->width * w->height;
    w->distances = zeroes(pixels * w->lights, sizeof *w->distances);
    for (size_t p = 0; p < pixels; p++) {
        float x = 0.1f * (float)(p % w->width), y = 0.1f * (float)(p / w->width);
        w->position[p][0] = x, w->position[p][1] = 0.2f * sinf(3.0f * x + y), w->position[p][2] = y;
    }
    for (size_t i = 0; i < pixels * w->lights; i++) {
        double far = random_unit(&seed);
        w->distances[i] = far < 0.1 ? INFINITY : far < 0.12 ? 0.0f : (float)(0.3 * exp(3.0 * random_unit(&seed)));
    }
}

/* Worlds of many sizes: the lights, their energy, the shadows. */
static world world_of(const uint32_t size[3], uint64_t seed, float energy[70])
{
    float d[3 * 70];
    for (uint32_t i = 0; i < size[2]; i++) {
        random_direction(&seed, d + 3 * (size_t)i);
        energy[i] = (float)random_unit(&seed);
    }
    world w = world_new(size[0], size[1], d, energy, size[2]);
    scatter(&w, seed);
    place(&w, seed);
    return w;
}

static void compare(world *w, const vcache_grid_config *f, const float *energy, const char *mode)
{
    size_t pairs = (size_t)w->width * w->height * w->lights;
    reference r = {w, f, zeroes(pairs, 1), zeroes(pairs, 1), zeroes(pairs, sizeof *r.blocker), zeroes(w->lights, 1)};
    for (uint32_t i = 0; i < w->lights; i++) {
        uint32_t brighter = 0;
        for (uint32_t k = 0; k < w->lights; k++)
            brighter += energy[k] > energy[i];
        r.bright[i] = brighter < f->bright;
    }
    if (f->order == VCACHE_GRID_SCANLINE)
        scanline(&r);
    else
        coarse_to_fine(&r);
    world_run(w, f);
    for (size_t i = 0; i < pairs; i++)
        if (r.traced[i] != w->traced[i] || r.visible[i] != w->answer[i])
            fail_msg("%s, %u x %u, restricted %d: pixel %zu, light %zu: traced %d, not %d; visible %d, not %d", mode,
                     w->width, w->height, f->restricted, i / w->lights, i % w->lights, w->traced[i], r.traced[i],
                     w->answer[i], r.visible[i]);
    free(r.visible);
    free(r.traced);
    free(r.blocker);
    free(r.bright);
}

static const uint32_t sizes[][3] = {{1, 1, 5},    {1, 40, 20},  {40, 1, 20}, {2, 2, 7},   {17, 13, 70},
                                    {33, 33, 20}, {37, 30, 66}, {16, 16, 9}, {150, 7, 12}};

static void as_the_paper(void **state)
{
    (void)state;
    const char *const modes[] = {"SNB",
                                 "SNU",
                                 "GNB",
                                 "GNU",
                                 "RES",
                                 "FLO",
                                 "OPT",
                                 "NEAR",
                                 "SWB",
                                 "SWU",
                                 "GWB",
                                 "GWU",
                                 "GNB,threshold=2",
                                 "SWB,threshold=2",
                                 "GWB,threshold=2.5",
                                 "OPT,spacing=4",
                                 "GWU,spacing=4",
                                 "GNU,near=1",
                                 "GWU,near=2",
                                 "GWB,near=1,flood=1",
                                 "NEAR,near=3,flood=2",
                                 "GNB,near=4"};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        float energy[70];
        world w = world_of(sizes[s], s + 1, energy);
        for (size_t m = 0; m < sizeof modes / sizeof *modes; m++) {
            vcache_grid_config f = mode_of(modes[m]);
            f.rays = 100; /* many batches */
            compare(&w, &f, energy, modes[m]);
        }
        world_free(&w);
    }
}

/* Few rounds, bright lights, restricted flooding: with every method. */
static void options(void **state)
{
    (void)state;
    const char *const methods[] = {"SNB", "SNU", "SWB", "SWU", "GNB", "GNU", "GWB", "GWU", "FLO", "NEAR"};
    const char *const more[] = {"",          ",rounds=1",          ",rounds=2", ",rounds=3",
                                ",bright=1", ",bright=5,rounds=1", ",bright=70"};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        float energy[70];
        world w = world_of(sizes[s], s + 100, energy);
        for (size_t m = 0; m < sizeof methods / sizeof *methods; m++)
            for (size_t k = 0; k < 2 * sizeof more / sizeof *more; k++) {
                char mode[64];
                snprintf(mode, sizeof mode, "%s%s", methods[m], more[k / 2]);
                vcache_grid_config f = mode_of(mode);
                f.restricted = k % 2;
                compare(&w, &f, energy, mode);
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
    place(&w, seed);
    size_t pairs = (size_t)w.width * w.height * w.lights;
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
        cmocka_unit_test(options),
        cmocka_unit_test(batches_change_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
