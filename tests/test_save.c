/* SPDX-License-Identifier: Apache-2.0 */
/* Saving and loading: what comes back answers as before; what does not belong here, or is damaged, is refused. */
#include "../vcache/save.h"
#include "world.h"

typedef struct file {
    unsigned char *bytes;
    size_t size, at, room; /* room: of writing */
} file;

static bool put(void *context, const void *data, size_t bytes)
{
    file *f = context;
    if (f->size + bytes > f->room)
        return false;
    f->bytes = realloc(f->bytes, f->size + bytes);
    assert_non_null(f->bytes);
    memcpy(f->bytes + f->size, data, bytes);
    f->size += bytes;
    return true;
}

static bool get(void *context, void *data, size_t bytes)
{
    file *f = context;
    if (f->at + bytes > f->size)
        return false;
    memcpy(data, f->bytes + f->at, bytes);
    f->at += bytes;
    return true;
}

enum { WORDS_OF_TABLE = 400001, SET_BYTES = 1 << 20 };
static const uint64_t scene = 0x123456789abcdefu;

/* Asks for all pairs; the answers as a checksum, the rays in *rays. */
static uint64_t ask(const world *w, vcache *cache, vcache_light_set *set, uint64_t *rays)
{
    vcache_worker *worker = make_worker(cache, 512, false);
    tracer t = {0};
    uint64_t sum = 0;
    for (size_t i = 0; i < EYES; i += 4) {
        uint64_t visible[WORDS] = {0};
        for (uint32_t first = 0; set && first < LIGHTS;) {
            first = vcache_add_set(worker, eye_at(w, i), set, first, NULL, visible);
            assert_true(vcache_resolve(worker, trace, &t));
        }
        if (!set)
            assert_true(vcache_query(worker, eye_at(w, i), w->light, LIGHTS, NULL, visible, trace, &t));
        sum = checksum(sum, visible, sizeof visible);
    }
    vcache_statistics s = statistics_of(worker);
    *rays = s.traced - s.bypassed;
    vcache_worker_destroy(&worker);
    return sum;
}

static file save(const vcache *cache, const vcache_light_set *set)
{
    file f = {.room = SIZE_MAX};
    char message[VCACHE_MESSAGE_BYTES] = "?";
    assert_int_equal(set ? vcache_light_set_save(set, scene, put, &f, message)
                         : vcache_save(cache, scene, put, &f, message),
                     VCACHE_OK);
    assert_string_equal(message, "");
    return f;
}

static vcache_light_set *make_set(const world *w, vcache *cache)
{
    vcache_light_set *set = NULL;
    char message[VCACHE_MESSAGE_BYTES];
    if (vcache_light_set_create(cache, w->light, LIGHTS, SET_BYTES, &set, message) != VCACHE_OK)
        fail_msg("%s", message);
    return set;
}

static vcache_config config_of(const world *w)
{
    return w->cache->config;
}

static void a_table_comes_back(void **state)
{
    (void)state;
    for (int family = VCACHE_HASH_SPLIT; family <= VCACHE_HASH_LCG_XORSHIFT; family++) {
        world *w = make_world(8.0f, 0, WORDS_OF_TABLE, (vcache_hash)family);
        uint64_t rays, again, known;
        vcache_clear(w->cache); /* keys of a later epoch come back as well */
        (void)ask(w, w->cache, NULL, &rays);
        (void)ask(w, w->cache, NULL, &known); /* collisions are settled: the same words are fought for */
        file f = save(w->cache, NULL);
        assert_int_equal(f.size, (14 + (WORDS_OF_TABLE + 1) / 2 + 1) * 8);
        uint64_t before = ask(w, w->cache, NULL, &known);

        vcache_config config = config_of(w);
        config.isa = VCACHE_ISA_SCALAR; /* makes no difference to what is stored */
        vcache *copy = NULL;
        char message[VCACHE_MESSAGE_BYTES] = "?";
        assert_int_equal(vcache_load(&config, scene, get, &f, &copy, message), VCACHE_OK);
        assert_string_equal(message, "");
        assert_int_equal(f.at, f.size);
        assert_true(ask(w, copy, NULL, &again) == before);
        assert_int_equal(again, known);
        assert_true(again < rays / 4);
        vcache_clear(copy);
        (void)ask(w, copy, NULL, &again);
        assert_true(again > rays * 9 / 10);
        vcache_destroy(&copy);
        free(f.bytes);
        free_world(w);
    }
}

static void rows_come_back(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 0, 1024, VCACHE_HASH_SPLIT);
    vcache_clear(w->cache);
    vcache_light_set *set = make_set(w, w->cache), *copied = NULL;
    uint64_t rays, known, again;
    (void)ask(w, w->cache, set, &rays);
    (void)ask(w, w->cache, set, &known);
    file words = save(w->cache, NULL), rows = save(w->cache, set);
    uint64_t before = ask(w, w->cache, set, &known);

    vcache_config config = config_of(w);
    vcache *copy = NULL;
    char message[VCACHE_MESSAGE_BYTES];
    assert_int_equal(vcache_load(&config, scene, get, &words, &copy, message), VCACHE_OK);
    assert_int_equal(vcache_light_set_load(copy, w->light, LIGHTS, SET_BYTES, scene, get, &rows, &copied, message),
                     VCACHE_OK);
    assert_true(ask(w, copy, copied, &again) == before);
    assert_int_equal(again, known);
    assert_true(again < rays / 4);
    vcache_light_set_destroy(&copied);
    vcache_destroy(&copy);
    free(words.bytes);
    free(rows.bytes);
    vcache_light_set_destroy(&set);
    free_world(w);
}

static void refused(vcache_config config, uint64_t of_scene, const file *f, const char *why)
{
    file copy = *f;
    vcache *cache = (vcache *)(void *)&copy;
    char message[VCACHE_MESSAGE_BYTES] = "";
    copy.at = 0;
    assert_int_equal(vcache_load(&config, of_scene, get, &copy, &cache, message), VCACHE_ERROR_FILE);
    assert_null(cache);
    if (!strstr(message, why))
        fail_msg("'%s' instead of '%s'", message, why);
}

static void strangers_are_refused(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 0, 1024, VCACHE_HASH_SPLIT);
    vcache_light_set *set = make_set(w, w->cache);
    file f = save(w->cache, NULL), rows = save(w->cache, set), empty = {0};
    const vcache_config good = config_of(w);
    vcache_config config = good;
    refused(good, scene + 1, &f, "another scene");
    refused(good, scene, &rows, "light set");
    refused(good, scene, &empty, "ends too early");
    config.bounds_max[1] = 1.5f;
    refused(config, scene, &f, "bounds");
    config = good, config.normal_bins = 10;
    refused(config, scene, &f, "C_N");
    config = good, config.layers = 4;
    refused(config, scene, &f, "C_Z");
    config = good, config.resolution_step = 1.5f;
    refused(config, scene, &f, "C_R");
    config = good, config.levels = 3;
    refused(config, scene, &f, "C_MSR");
    config = good, config.hash = VCACHE_HASH_LCG_PAIR;
    refused(config, scene, &f, "hash");
    config = good, config.table_bytes = 1023 * 4;
    refused(config, scene, &f, "size of the table");
    f.bytes[3] ^= 1;
    refused(good, scene, &f, "no file of vcache");
    f.bytes[3] ^= 1, f.bytes[8] = 77;
    refused(good, scene, &f, "another format");

    /* sets: other lights, other rows, another state of the cache */
    vcache_light_set *out = NULL;
    char message[VCACHE_MESSAGE_BYTES];
    const char *why[] = {"other lights", "number of lights", "size", "another state"};
    for (int i = 0; i < 4; i++) {
        vcache_light lights[LIGHTS];
        memcpy(lights, w->light, sizeof lights);
        lights[69].position[1] += i == 0 ? 0.25f : 0.0f;
        if (i == 3)
            vcache_clear(w->cache);
        rows.at = 0;
        assert_int_equal(vcache_light_set_load(w->cache, lights, LIGHTS - (i == 1), SET_BYTES + (i == 2) * 4096, scene,
                                               get, &rows, &out, message),
                         VCACHE_ERROR_FILE);
        assert_null(out);
        if (!strstr(message, why[i]))
            fail_msg("'%s' instead of '%s'", message, why[i]);
    }
    free(f.bytes);
    free(rows.bytes);
    vcache_light_set_destroy(&set);
    free_world(w);
}

/* Each length, each bit, and 2000 times some bytes at once. */
static void damage_is_found(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 0, 64, VCACHE_HASH_SPLIT);
    vcache_light_set *set = NULL;
    char message[VCACHE_MESSAGE_BYTES];
    assert_int_equal(vcache_light_set_create(w->cache, w->light, LIGHTS, 1024, &set, message), VCACHE_OK);
    uint64_t rays, seed = 3;
    (void)ask(w, w->cache, NULL, &rays);
    (void)ask(w, w->cache, set, &rays);
    const vcache_config config = config_of(w);
    for (int kind = 0; kind < 2; kind++) {
        file f = save(w->cache, kind ? set : NULL);
        unsigned char *whole = malloc(f.size);
        assert_non_null(whole);
        memcpy(whole, f.bytes, f.size);
        size_t size = f.size, cases = size + 8 * size + 2000;
        for (size_t i = 0; i <= cases; i++) {
            vcache *cache = NULL;
            vcache_light_set *rows = NULL;
            memcpy(f.bytes, whole, size);
            f.size = size, f.at = 0;
            if (i < size)
                f.size = i;
            else if (i < 9 * size)
                f.bytes[(i - size) / 8] ^= (unsigned char)(1u << (i - size) % 8);
            else if (i < cases)
                for (int k = 0; k < 5; k++)
                    f.bytes[random_bits(&seed) % size] = (unsigned char)random_bits(&seed);
            bool same = f.size == size && memcmp(f.bytes, whole, size) == 0;
            vcache_status status =
                kind ? vcache_light_set_load(w->cache, w->light, LIGHTS, 1024, scene, get, &f, &rows, message)
                     : vcache_load(&config, scene, get, &f, &cache, message);
            if (kind == 0 && i >= size + 8 * 8 * 13 && i < size + 8 * 8 * 14)
                assert_string_equal(message, "the file is damaged: its checksum does not fit"); /* the epoch's bits */
            assert_int_equal(status, same ? VCACHE_OK : VCACHE_ERROR_FILE);
            assert_int_equal(message[0] == 0, same);
            vcache_destroy(&cache);
            vcache_light_set_destroy(&rows);
        }
        free(whole);
        free(f.bytes);
    }
    vcache_light_set_destroy(&set);
    free_world(w);
}

static void full_disks_and_bad_arguments(void **state)
{
    (void)state;
    world *w = make_world(8.0f, 0, 4096, VCACHE_HASH_SPLIT);
    vcache_light_set *set = make_set(w, w->cache);
    char message[VCACHE_MESSAGE_BYTES];
    for (size_t room = 0; room < 4000; room += 1000) {
        file f = {.room = room};
        assert_int_equal(vcache_save(w->cache, scene, put, &f, message), VCACHE_ERROR_FILE);
        assert_non_null(strstr(message, "cannot be written"));
        f.size = 0;
        assert_int_equal(vcache_light_set_save(set, scene, put, &f, NULL), VCACHE_ERROR_FILE);
        free(f.bytes);
    }
    vcache_config config = config_of(w);
    vcache *cache;
    vcache_light_set *rows;
    file f = {0};
    assert_int_equal(vcache_save(NULL, scene, put, &f, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_save(w->cache, scene, NULL, &f, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_load(&config, scene, NULL, &f, &cache, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_load(&config, scene, get, &f, NULL, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_load(NULL, scene, get, &f, &cache, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_light_set_save(NULL, scene, put, &f, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_light_set_load(NULL, w->light, LIGHTS, SET_BYTES, scene, get, &f, &rows, message),
                     VCACHE_ERROR_ARGUMENT);
    config.layers = 0;
    assert_int_equal(vcache_load(&config, scene, get, &f, &cache, message), VCACHE_ERROR_ARGUMENT);
    assert_null(cache);
    vcache_light_set_destroy(&set);
    free_world(w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_table_comes_back),           cmocka_unit_test(rows_come_back),
        cmocka_unit_test(strangers_are_refused),        cmocka_unit_test(damage_is_found),
        cmocka_unit_test(full_disks_and_bad_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
