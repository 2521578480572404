/* SPDX-License-Identifier: Apache-2.0 */
/* Hashes of real streams of keys: what the camera of each built-in scene sees against patches on its surfaces, and a
 * stream made to collide. Slots, keys and false hits are as of random numbers, in tables of any size. */
#include "../renderers/common/camera.h"
#include "../renderers/common/rng.h"
#include "../renderers/common/tracer.h"

#include "../vcache/cells.h"
#include "support.h"

enum { EYES = 1500, PATCHES = 400, WIDTH = 256, HEIGHT = 192 };

typedef struct stream {
    char name[64];
    vcache *cache;
    uint64_t half[WIDTH * HEIGHT], patch[PATCHES]; /* distinct */
    size_t eyes, patches;
} stream;

static float component(vec3 v, int i)
{
    return i == 0 ? v.x : i == 1 ? v.y : v.z;
}

static vcache_surface end_of(const surface *s, float density)
{
    vcache_surface out = {.density = density};
    for (int i = 0; i < 3; i++) {
        out.position[i] = component(s->position, i);
        out.normal[i] = component(s->geometric_normal, i);
    }
    return out;
}

/* Unique values to the front; they come sorted. */
static size_t unique(uint64_t *values, size_t count)
{
    (void)count_distinct(values, count);
    size_t n = 0;
    for (size_t i = 0; i < count; i++)
        if (n == 0 || values[i] != values[n - 1])
            values[n++] = values[i];
    return n;
}

static void of_scene(const char *name, stream *out)
{
    scene *s = NULL;
    tracer *t = NULL;
    message err = {{0}};
    notice_enable(false);
    if (!scene_builtin(name, &s) || !scene_finish(s, &err) || !tracer_create(s, 1, &t, &err))
        fail_msg("%s: %s", name, err.text);
    snprintf(out->name, sizeof out->name, "%s", name);
    vcache_config config = vcache_default_config();
    for (int i = 0; i < 3; i++) {
        config.bounds_min[i] = component(s->bounds_min, i);
        config.bounds_max[i] = component(s->bounds_max, i);
    }
    config.table_bytes = 4;
    out->cache = make_cache(&config);
    camera_frame f = camera_frame_of(&s->cameras[0], WIDTH, HEIGHT);
    rng r = rng_make(1, 1);
    vcache_light patches[PATCHES];
    uint32_t found = 0;
    for (uint32_t p = 0; p < WIDTH * HEIGHT; p++) {
        float cosine;
        surface hit, next;
        vec3 d = camera_direction(&f, (float)(p % WIDTH) + 0.5f, (float)(p / WIDTH) + 0.5f, &cosine);
        if (!tracer_closest(t, s->cameras[0].eye, d, &hit))
            continue;
        float width =
            v3_length(v3_sub(hit.position, s->cameras[0].eye)) * 2.0f * tanf(0.5f * s->cameras[0].yfov) / HEIGHT;
        vcache_surface end = end_of(&hit, vcache_density_cone(width, fabsf(v3_dot(d, hit.geometric_normal)), 1.0f));
        vcache_eye *eye = make_eye(out->cache, &end, 4.0f, 0);
        out->half[out->eyes++] = vcache_eye_cell(eye, 0);
        free(eye);
        vec3 away = v3(rng_float(&r) - 0.5f, rng_float(&r) - 0.5f, rng_float(&r) - 0.5f);
        if (v3_dot(away, hit.geometric_normal) < 0.0f)
            away = v3_neg(away);
        if (p % 37 == 0 && found < PATCHES &&
            tracer_closest(t, surface_offset(&hit, away), v3_normalize(away), &next)) {
            end = end_of(&next, vcache_density_unknown(out->cache, 4000.0f));
            vcache_prepare_patch(out->cache, &end, &patches[found]);
            out->patch[out->patches++] = patches[found++].key.hash;
        }
    }
    tracer_free(t);
    scene_free(s);
}

/* Cells on a lattice of powers of two, one to the other differing in single bits of their keys; the same of lights. */
static void of_lattice(stream *out)
{
    snprintf(out->name, sizeof out->name, "lattice");
    vcache_config config = vcache_default_config();
    config.table_bytes = 4;
    out->cache = make_cache(&config);
    for (int i = 0; i < EYES; i++) {
        cell q = {(i % 30) << 16, (i / 30 % 25) << 16, i / 750 << 12};
        out->half[out->eyes++] = cell_hash(q, 0, 0, 0x8bb84b93962eacc9u);
    }
    for (int i = 0; i < PATCHES; i++) {
        vcache_light l;
        float at[3] = {ldexpf(1.0f, i % 20), ldexpf(1.0f, i / 20), 0.0f};
        vcache_prepare_point(out->cache, at, 0, &l);
        out->patch[out->patches++] = l.key.hash;
    }
}

static uint64_t key_of(const stream *s, size_t i)
{
    return hash_fold(s->half[i / s->patches], s->patch[i % s->patches]);
}

/* Standard deviations between the slots that are filled and n (1 - (1 - 1/n)^k). */
static double filled_sigmas(const stream *s, size_t keys, uint64_t words)
{
    uint8_t *filled = calloc(words, 1);
    assert_non_null(filled);
    table t = {.count = words};
    double n = (double)words, k = (double)keys, load = k / n, count = 0.0;
    for (size_t i = 0; i < keys; i++) {
        uint8_t *slot = &filled[table_slot(&t, key_of(s, i))];
        count += !*slot;
        *slot = 1;
    }
    free(filled);
    double theory = n * -expm1(k * log1p(-1.0 / n)), variance = n * exp(-load) * (1.0 - (1.0 + load) * exp(-load));
    return (count - theory) / sqrt(variance + 1.0);
}

/* Keys of the first half of the eyes are stored, the others asked for: how many find 12 bits of their digest, in
 * standard deviations from the number of full slots met x 2^-12; `whole`: how many find all 31. */
static double false_hit_sigmas(const stream *s, size_t keys, uint64_t words, uint64_t *whole)
{
    const uint32_t mask = 0xfffu << 1;
    uint32_t *held = calloc(words, sizeof *held);
    assert_non_null(held);
    table t = {.count = words};
    double met = 0.0, hits = 0.0;
    for (size_t i = 0; i < keys / 2; i++)
        held[table_slot(&t, key_of(s, i))] = table_word(key_of(s, i));
    for (size_t i = keys / 2; i < keys; i++) {
        uint32_t there = held[table_slot(&t, key_of(s, i))], mine = table_word(key_of(s, i));
        met += there != 0;
        hits += there != 0 && ((there ^ mine) & mask) == 0;
        *whole += there == mine;
    }
    free(held);
    return (hits - met / 4096.0) / sqrt(met / 4096.0 + 1.0);
}

static void check(stream *s)
{
    s->eyes = unique(s->half, s->eyes);
    s->patches = unique(s->patch, s->patches);
    /* spread over the whole stream, which is sorted by hash */
    if (s->eyes > EYES)
        for (size_t i = 0; i < EYES; i++)
            s->half[i] = s->half[i * s->eyes / EYES];
    s->eyes = s->eyes < EYES ? s->eyes : EYES;
    size_t keys = s->eyes * s->patches;
    uint64_t *all = malloc((keys + 1) * sizeof *all), whole = 0;
    assert_non_null(all);
    for (size_t i = 0; i < keys; i++)
        all[i] = key_of(s, i);
    static uint32_t bins[997];
    memset(bins, 0, sizeof bins);
    table t = {.count = 997};
    for (size_t i = 0; i < keys; i++)
        bins[table_slot(&t, all[i])]++;
    double even = chi_square_sigmas(bins, 997, keys);
    size_t distinct = count_distinct(all, keys);
    free(all);
    static const uint64_t sizes[] = {1, 7, 12345, 1 << 16, 1000003, 1 << 20};
    double worst = 0.0, worst_hit = 0.0;
    for (int i = 0; i < 6; i++) {
        double sigmas = fabs(filled_sigmas(s, keys, sizes[i])), hit = fabs(false_hit_sigmas(s, keys, sizes[i], &whole));
        worst = sigmas > worst ? sigmas : worst;
        worst_hit = hit > worst_hit ? hit : worst_hit;
    }
    print_message("%-9s %4zu cells x %3zu: %zu of %zu keys distinct; evenness %+.1f, slots %.1f, false hits of 12 bits "
                  "%.1f standard deviations; of 31 bits %llu\n",
                  s->name, s->eyes, s->patches, distinct, keys, even, worst, worst_hit, (unsigned long long)whole);
    assert_true(keys > 30000 && distinct == keys && whole <= 1);
    assert_true(fabs(even) < 5.0 && worst < 5.0 && worst_hit < 5.0);
    vcache_destroy(&s->cache);
}

static void built_in_scenes(void **state)
{
    (void)state;
    for (const char *const *name = scene_builtin_names; *name; name++) {
        stream *s = calloc(1, sizeof *s);
        assert_non_null(s);
        of_scene(*name, s);
        check(s);
        free(s);
    }
}

static void made_to_collide(void **state)
{
    (void)state;
    stream *s = calloc(1, sizeof *s);
    assert_non_null(s);
    of_lattice(s);
    check(s);
    assert_true(s->eyes == EYES && s->patches == PATCHES); /* no two cells, no two lights have one hash */
    free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(built_in_scenes), cmocka_unit_test(made_to_collide)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
