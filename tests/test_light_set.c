/* SPDX-License-Identifier: Apache-2.0 */
/* Light sets: creation and sizes, and Algorithm 2 in rows against a dictionary. */
#include "ledger.h"
#include "patchwork.h"

/* ------------------------------------------------------------------------------------------------------- creation */

static void bad_arguments(void **state)
{
    (void)state;
    ledger book = {0};
    vcache_config config = vcache_default_config();
    config.allocator = (vcache_allocator){ledger_allocate, ledger_release, &book};
    vcache *c = make_cache(&config);
    ledger before = book;
    vcache_light light[65];
    for (int i = 0; i < 65; i++)
        vcache_prepare_direction(c, (float[3]){0.0f, 1.0f, (float)i}, 0, &light[i]);
    const struct {
        vcache *cache;
        const vcache_light *lights;
        uint32_t count;
        uint64_t bytes;
        const char *says;
    } bad[] = {
        {NULL, light, 65, 4096, "NULL"},
        {c, NULL, 65, 4096, "NULL"},
        {c, light, 0, 4096, "0 lights"},
        {c, light, VCACHE_MAX_SET + 1, 1 << 30, "65537 lights"},
        {c, light, UINT32_MAX, UINT64_MAX, "lights"},
        {c, light, 65, 0, "bytes is 0"},
        {c, light, 65, 63, "bytes is 63"},
        {c, light, 65, (uint64_t)1 << 38, "bytes is"},
        {c, light, 65, UINT64_MAX, "bytes is"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char message[VCACHE_MESSAGE_BYTES] = "old";
        vcache_light_set *set = (vcache_light_set *)(void *)light;
        assert_int_equal(
            vcache_light_set_create(bad[i].cache, bad[i].lights, bad[i].count, bad[i].bytes, &set, message),
            VCACHE_ERROR_ARGUMENT);
        assert_null(set);
        assert_non_null(strstr(message, bad[i].says));
        assert_null(strchr(message, '\n'));
        assert_int_equal(vcache_light_set_create(bad[i].cache, bad[i].lights, bad[i].count, bad[i].bytes, &set, NULL),
                         VCACHE_ERROR_ARGUMENT);
    }
    char message[VCACHE_MESSAGE_BYTES];
    vcache_light_set *set = NULL;
    assert_int_equal(vcache_light_set_create(c, light, 65, 4096, NULL, message), VCACHE_ERROR_ARGUMENT);
    assert_non_null(strstr(message, "out"));
    book.fails = true;
    assert_int_equal(vcache_light_set_create(c, light, 65, 4096, &set, message), VCACHE_ERROR_MEMORY);
    assert_null(set);
    assert_non_null(strstr(message, "memory"));
    assert_int_equal(vcache_light_set_create(c, light, 65, 4096, &set, NULL), VCACHE_ERROR_MEMORY);
    book.fails = false;
    assert_int_equal(vcache_light_set_create(c, light, 65, 4096, &set, message), VCACHE_OK);
    assert_string_equal(message, "");
    assert_int_equal(book.blocks, before.blocks + 1);
    vcache_light_set_destroy(&set);
    assert_null(set);
    vcache_light_set_destroy(&set);
    vcache_light_set_destroy(NULL);
    assert_int_equal(book.blocks, before.blocks);
    assert_int_equal(book.bytes, before.bytes);
    vcache_destroy(&c);
    assert_int_equal(book.blocks + book.bytes, 0);
}

static bool by_user(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    *(uint64_t *)context += count;
    for (size_t i = 0; i < count; i++)
        answers[i] = misses[i].light_user % 3 == 0;
    return true;
}

/* Sizes around words and lines: rows as documented; the lights were copied; each light has a bit of its own, found
 * again without a ray; beyond the last word nothing is written. */
static void sizes(void **state)
{
    (void)state;
    static const uint32_t counts[] = {1, 63, 64, 65, 1000, 1024, 1025, 4096, VCACHE_MAX_SET};
    vcache_config config = vcache_default_config();
    vcache *c = make_cache(&config);
    vcache_surface s = {.normal = {0.0f, 0.0f, 1.0f}, .density = 100.0f};
    vcache_eye *eye = make_eye(c, &s, 4.0f, 0);
    for (size_t k = 0; k < sizeof counts / sizeof *counts; k++) {
        uint32_t n = counts[k], words = (n + 63) / 64;
        vcache_light *lights = malloc(n * sizeof *lights);
        uint64_t *visible = malloc(words * sizeof *visible); /* no word more: the address sanitizer watches */
        assert_true(lights && visible);
        for (uint32_t i = 0; i < n; i++)
            vcache_prepare_direction(c, (float[3]){0.0f, 1.0f, (float)i}, i, &lights[i]);
        vcache_light_set *set = NULL;
        assert_int_equal(vcache_light_set_create(c, lights, n, row_bytes(n) - 1, &set, NULL), VCACHE_ERROR_ARGUMENT);
        assert_int_equal(vcache_light_set_create(c, lights, n, 4 * row_bytes(n) - 1, &set, NULL), VCACHE_OK);
        assert_int_equal(vcache_light_set_rows(set), 3);
        assert_int_equal((uintptr_t)set->memory % 64, 0);
        memset(lights, 0xff, n * sizeof *lights);
        free(lights);
        vcache_worker *worker = make_worker(c, 3000, false);
        uint64_t rays = 0;
        for (int pass = 0; pass < 2; pass++) {
            memset(visible, pass ? 0xff : 0, words * sizeof *visible);
            query_set(worker, eye, set, NULL, visible, by_user, &rays);
            assert_int_equal(rays, n);
            for (uint32_t i = 0; i < 64 * words; i++)
                assert_int_equal(bit_of(visible, i), i < n ? i % 3 == 0 : pass);
        }
        free(visible);
        vcache_worker_destroy(&worker);
        vcache_light_set_destroy(&set);
    }
    free(eye);
    vcache_destroy(&c);
}

/* ---------------------------------------------------------------------------------- Alg. 2 against a dictionary */

/* What is known of a cell, a byte per light. */
enum { UNKNOWN, CLAIMED, BLOCKED, VISIBLE, MOST_CELLS = 1 << 15 };

typedef struct reference {
    const world *w;
    const vcache_light *lights;
    uint32_t count;
    uint64_t half[MOST_CELLS];
    uint8_t *cells; /* MOST_CELLS x count */
    struct pending {
        size_t eye;
        uint32_t light, level;
    } * asking, *waiting;
    size_t asking_count, waiting_count;
    uint64_t rays, bypassed, hits[VCACHE_MAX_LEVELS];
    uint64_t (*visible)[20];
    uint64_t (*refine)[20]; /* NULL: all */
} reference;

static uint8_t *cell_at(reference *r, uint64_t half, uint32_t light)
{
    size_t i = half % MOST_CELLS;
    while (r->half[i] && r->half[i] != half)
        i = (i + 1) % MOST_CELLS;
    r->half[i] = half;
    return &r->cells[i * r->count + light];
}

static void say(reference *r, struct pending p, bool visible)
{
    uint64_t *word = &r->visible[p.eye][p.light / 64], mask = (uint64_t)1 << p.light % 64;
    *word = visible ? *word | mask : *word & ~mask;
}

static void reference_walk(reference *r, struct pending p)
{
    const vcache_eye *eye = eye_at(r->w, p.eye);
    for (;; p.level++) {
        uint8_t *own = cell_at(r, eye->level[p.level].center, p.light);
        if (*own == UNKNOWN) {
            *own = CLAIMED;
            r->asking[r->asking_count++] = p;
            return;
        }
        if (*own == CLAIMED) {
            r->waiting[r->waiting_count++] = p;
            return;
        }
        bool differs = false;
        bool refine = !r->refine || bit_of(r->refine[p.eye], p.light);
        for (int k = 0; k < 4 && refine; k++) {
            uint8_t other = *cell_at(r, eye->level[p.level].neighbour[k], p.light);
            differs |= other >= BLOCKED && other != *own;
        }
        if (!differs || p.level + 1 == eye->levels) {
            r->hits[p.level]++;
            say(r, p, *own == VISIBLE);
            return;
        }
    }
}

static void reference_add(reference *r, size_t eye, uint32_t light)
{
    struct pending p = {eye, light, 0};
    const vcache_light *l = &r->lights[light];
    const float *x = r->w->surface[eye].position;
    double d = 0.0, side = fmax((double)eye_at(r->w, eye)->side_squared, (double)l->side_squared);
    for (int i = 0; i < 3; i++)
        d += pow((double)x[i] - (double)l->position[i], 2.0);
    if (l->side_squared >= 0.0f && d < side) {
        r->rays++, r->bypassed++;
        say(r, p, sees(x, l->position, false));
        return;
    }
    reference_walk(r, p);
}

static void reference_resolve(reference *r)
{
    while (r->asking_count) {
        size_t waiting = r->waiting_count;
        r->rays += r->asking_count;
        for (size_t i = 0; i < r->asking_count; i++) {
            struct pending p = r->asking[i];
            const vcache_light *l = &r->lights[p.light];
            bool visible = sees(r->w->surface[p.eye].position, l->position, l->side_squared < 0.0f);
            say(r, p, visible);
            *cell_at(r, eye_at(r->w, p.eye)->level[p.level].center, p.light) = visible ? VISIBLE : BLOCKED;
        }
        r->asking_count = r->waiting_count = 0;
        for (size_t i = 0; i < waiting; i++)
            reference_walk(r, r->waiting[i]);
    }
}

/* Lights of all kinds, some of them a hair above the floor, where the eyes are. */
static vcache_light *make_lights(const vcache *cache, uint32_t count)
{
    vcache_light *lights = malloc(count * sizeof *lights);
    assert_non_null(lights);
    uint64_t seed = 21;
    for (uint32_t i = 0; i < count; i++) {
        vcache_surface s = {.normal = {0.0f, 0.0f, -1.0f}, .density = 20.0f, .user = i};
        s.position[0] = (float)random_unit(&seed), s.position[1] = (float)random_unit(&seed);
        s.position[2] = i % 8 ? 2.0f : 0.02f;
        float d[3];
        random_direction(&seed, d);
        d[2] = fabsf(d[2]) + 0.2f;
        if (i % 4 == 0)
            vcache_prepare_point(cache, s.position, i, &lights[i]);
        else if (i % 4 == 1)
            vcache_prepare_direction(cache, d, i, &lights[i]);
        else if (i % 4 == 2)
            vcache_prepare_patch(cache, &s, &lights[i]);
        else
            vcache_prepare_solid_angle(cache, d, 20.0f, i, &lights[i]);
    }
    return lights;
}

/* Eyes of which no two cells fall on one row, so that nothing is evicted. */
static size_t choose_eyes(const world *w, const vcache_light_set *set, size_t wanted, size_t *chosen)
{
    uint64_t *owner = calloc(set->rows, sizeof *owner);
    assert_non_null(owner);
    size_t count = 0;
    for (size_t e = 0; e < EYES && count < wanted; e++) {
        const vcache_eye *eye = eye_at(w, e);
        bool fits = true;
        for (int pass = 0; pass < 2 && fits; pass++)
            for (uint32_t d = 0; d < eye->levels; d++) {
                uint64_t key = row_key(0, eye->level[d].center);
                uint64_t *o = &owner[(size_t)(row_of(set, key) - set->memory) / set->stride];
                fits = fits && (*o == 0 || *o == key);
                if (pass && fits)
                    *o = key;
            }
        if (fits)
            chosen[count++] = e;
    }
    free(owner);
    return count;
}

/* `step`: eyes that are pending at a time. Sometimes all lights are asked for, sometimes a random part, sometimes from
 * the middle of a word on. `some`: a random half of the lights is not refined. */
static void compare(int levels, uint32_t count, size_t wanted, uint32_t capacity, size_t step, bool some)
{
    world *w = make_world(16.0f, levels, 1, VCACHE_HASH_SPLIT);
    vcache_light *lights = make_lights(w->cache, count);
    vcache_light_set *set = make_set(w->cache, lights, count, 1 << 16);
    vcache_worker *worker = make_worker(w->cache, capacity, false);
    reference *r = calloc(1, sizeof *r);
    static size_t eyes[EYES];
    size_t n = choose_eyes(w, set, wanted, eyes);
    assert_true(n > wanted / 2);
    uint64_t(*visible)[20] = malloc(EYES * sizeof *visible), (*asked)[20] = malloc(EYES * sizeof *asked);
    uint64_t(*refine)[20] = malloc(EYES * sizeof *refine);
    assert_true(r && visible && asked && refine);
    *r = (reference){.w = w, .lights = lights, .count = count, .cells = calloc(MOST_CELLS, count)};
    r->asking = malloc(count * step * sizeof *r->asking);
    r->waiting = malloc(count * step * sizeof *r->waiting);
    r->visible = malloc(EYES * sizeof *visible);
    assert_true(r->cells && r->asking && r->waiting && r->visible);
    if (some)
        r->refine = refine;
    uint64_t seed = 31, wanted_pairs = 0;
    for (size_t e = 0; e < EYES; e++)
        for (int i = 0; i < 20; i++) {
            visible[e][i] = r->visible[e][i] = random_bits(&seed);
            asked[e][i] = random_bits(&seed) & random_bits(&seed), refine[e][i] = random_bits(&seed);
        }
    tracer t = {0};
    for (size_t k = 0; k < n; k++) {
        size_t e = eyes[k];
        const uint64_t *mask = k % 3 ? NULL : asked[e];
        uint32_t next, first = k % 5 ? 0 : (uint32_t)(random_bits(&seed) % count);
        for (; first < count; first = next) {
            next = some ? vcache_add_set_refining(worker, eye_at(w, e), set, first, mask, refine[e], visible[e])
                        : vcache_add_set(worker, eye_at(w, e), set, first, mask, visible[e]);
            for (uint32_t l = first; l < next; l++)
                if (!mask || bit_of(mask, l)) {
                    wanted_pairs++;
                    reference_add(r, e, l);
                }
            assert_true(next <= count);
            assert_true(next == count || !mask || bit_of(mask, next));
            assert_true(vcache_misses(worker, NULL) <= capacity);
            if (next < count || k % step == 0) {
                assert_true(vcache_resolve(worker, trace, &t));
                reference_resolve(r);
                assert_int_equal(t.rays, r->rays);
            }
        }
    }
    assert_true(vcache_resolve(worker, trace, &t));
    reference_resolve(r);
    /* all words: bits that nobody asked for are as they were */
    assert_memory_equal(visible, r->visible, EYES * sizeof *visible);
    vcache_statistics s = statistics_of(worker);
    assert_int_equal(s.asked, wanted_pairs);
    assert_int_equal(s.asked, s.traced + hits_of(&s));
    assert_int_equal(s.traced, r->rays);
    assert_int_equal(s.bypassed, r->bypassed);
    assert_true(s.bypassed > 0);
    assert_int_equal(s.stored, s.traced - s.bypassed);
    assert_int_equal(s.once + s.overwritten, 0);
    assert_memory_equal(s.hits, r->hits, sizeof s.hits);
    for (int d = 0; d < VCACHE_MAX_LEVELS; d++)
        assert_int_equal(s.hits[d] > 0, s.hit_levels >> d & 1);
    if (levels > 1)
        assert_true(s.hits[1] > 0);
    free(r->cells), free(r->asking), free(r->waiting), free(r->visible), free(r);
    free(visible), free(asked), free(refine), free(lights);
    vcache_worker_destroy(&worker);
    vcache_light_set_destroy(&set);
    free_world(w);
}

static void follows_algorithm_two(void **state)
{
    (void)state;
    static const uint32_t capacities[] = {1, 2, 7, 64, 100000};
    for (int i = 0; i < 5; i++)
        compare(3, 70, 1000, capacities[i], 1 + (size_t)i, i % 2);
    compare(1, 70, EYES, 100000, 40, false);
    compare(2, 200, 1000, 100000, 40, true);
    compare(4, 1100, 200, 100000, 10, true); /* more than one piece of words */
    compare(3, 1100, 200, 700, 1, false);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bad_arguments),
        cmocka_unit_test(sizes),
        cmocka_unit_test(follows_algorithm_two),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
