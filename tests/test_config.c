/* SPDX-License-Identifier: Apache-2.0 */
/* Creation: every bad value is named, memory that fails is reported and none is lost, tables of 1 and of 2^32 words. */
#define _DEFAULT_SOURCE /* mmap */
#include "support.h"

#include <sys/mman.h>

/* ---------------------------------------------------------------------------------------------------- bad values */

static void expect_bad(const vcache_config *config, const char *field)
{
    char message[VCACHE_MESSAGE_BYTES];
    memset(message, 'x', sizeof message);
    vcache *cache = (vcache *)(void *)message;
    assert_int_equal(vcache_create(config, &cache, message), VCACHE_ERROR_ARGUMENT);
    assert_null(cache);
    assert_non_null(memchr(message, 0, sizeof message));
    if (!strstr(message, field))
        fail_msg("'%s' does not name %s", message, field);
    assert_int_equal(vcache_create(config, &cache, NULL), VCACHE_ERROR_ARGUMENT);
}

#define EXPECT_BAD(member, bad_value, field)                                                                           \
    do {                                                                                                               \
        vcache_config config_ = vcache_default_config();                                                               \
        config_.member = (bad_value);                                                                                  \
        expect_bad(&config_, field);                                                                                   \
    } while (0)

static void bad_configs(void **state)
{
    (void)state;
    static const float no_number[] = {NAN, INFINITY, -INFINITY};
    static const int32_t no_count[] = {0, -1, 65, INT32_MIN, INT32_MAX};
    static const float no_ratio[] = {0.0f, -1.2f, 1.0f, 1.04f, 16.1f, 1e30f, NAN, INFINITY, -INFINITY};
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) {
            EXPECT_BAD(bounds_min[axis], no_number[i], "bounds");
            EXPECT_BAD(bounds_max[axis], no_number[i], "bounds");
        }
    EXPECT_BAD(bounds_min[1], 1.5f, "bounds[1]"); /* above the maximum */
    EXPECT_BAD(bounds_max[2], -1.0f, "bounds[2]");
    for (int i = 0; i < 5; i++) {
        EXPECT_BAD(normal_bins, no_count[i], "normal_bins");
        EXPECT_BAD(layers, no_count[i], "layers");
    }
    for (int i = 0; i < 9; i++)
        EXPECT_BAD(resolution_step, no_ratio[i], "resolution_step");
    EXPECT_BAD(levels, -1, "levels");
    EXPECT_BAD(levels, 17, "levels");
    EXPECT_BAD(levels, INT32_MIN, "levels");
    EXPECT_BAD(levels, INT32_MAX, "levels");
    EXPECT_BAD(table_bytes, 0, "table_bytes");
    EXPECT_BAD(table_bytes, 3, "table_bytes");
    EXPECT_BAD(table_bytes, ((uint64_t)1 << 34) + 1, "table_bytes");
    EXPECT_BAD(table_bytes, UINT64_MAX, "table_bytes");
    EXPECT_BAD(hash, (vcache_hash)3, "hash");
    EXPECT_BAD(hash, (vcache_hash)-1, "hash");
    EXPECT_BAD(allocator.allocate, NULL, "allocator");
    EXPECT_BAD(allocator.release, NULL, "allocator");
    vcache_config zeroed;
    memset(&zeroed, 0, sizeof zeroed);
    expect_bad(&zeroed, "vcache_default_config");
    expect_bad(NULL, "config");
    char message[VCACHE_MESSAGE_BYTES];
    vcache_config config = vcache_default_config();
    assert_int_equal(vcache_create(&config, NULL, message), VCACHE_ERROR_ARGUMENT);
    assert_non_null(strstr(message, "out"));
}

/* The ends of every range are inside. */
static void limits_are_allowed(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        vcache_config config = vcache_default_config();
        config.normal_bins = config.layers = i ? 64 : 1;
        config.resolution_step = i ? 16.0f : 1.05f;
        config.levels = i ? VCACHE_MAX_LEVELS : 1;
        config.table_bytes = i ? 7 : 4;
        config.bounds_max[0] = config.bounds_max[1] = config.bounds_max[2] = i ? 3.4e38f : 0.0f;
        char message[VCACHE_MESSAGE_BYTES] = "old";
        vcache *cache;
        assert_int_equal(vcache_create(&config, &cache, message), VCACHE_OK);
        assert_string_equal(message, "");
        assert_int_equal(vcache_table_words(cache), 1);
        assert_true(vcache_eye_size(cache, 1e30f) <= VCACHE_EYE_BYTES);
        assert_true(vcache_eye_size(cache, NAN) <= VCACHE_EYE_BYTES);
        vcache_destroy(&cache);
        assert_null(cache);
        vcache_destroy(&cache);
    }
    vcache_destroy(NULL);
    assert_true(vcache_light_size() <= VCACHE_LIGHT_BYTES && vcache_light_size() % 8 == 0);
    assert_true(vcache_vertex_size() <= VCACHE_VERTEX_BYTES && vcache_vertex_size() % 8 == 0);
}

static void bad_worker(vcache *cache, const vcache_worker_config *config, const char *field)
{
    char message[VCACHE_MESSAGE_BYTES];
    vcache_worker *worker = (vcache_worker *)(void *)message;
    assert_int_equal(vcache_worker_create(cache, config, &worker, message), VCACHE_ERROR_ARGUMENT);
    assert_null(worker);
    if (!strstr(message, field))
        fail_msg("'%s' does not name %s", message, field);
    assert_int_equal(vcache_worker_create(cache, config, &worker, NULL), VCACHE_ERROR_ARGUMENT);
}

static void bad_worker_configs(void **state)
{
    (void)state;
    vcache_config small = vcache_default_config();
    small.table_bytes = 4;
    vcache *cache = make_cache(&small);
    static const uint32_t capacities[] = {0, (1u << 24) + 1, UINT32_MAX};
    for (int i = 0; i < 3; i++) {
        vcache_worker_config config = vcache_default_worker_config();
        config.capacity = capacities[i];
        bad_worker(cache, &config, "capacity");
    }
    vcache_worker_config config = vcache_default_worker_config();
    memset(&config, 0, sizeof config);
    bad_worker(cache, &config, "vcache_default_worker_config");
    bad_worker(NULL, NULL, "cache");
    char message[VCACHE_MESSAGE_BYTES];
    assert_int_equal(vcache_worker_create(cache, NULL, NULL, message), VCACHE_ERROR_ARGUMENT);
    assert_non_null(strstr(message, "out"));
    vcache_worker *worker;
    assert_int_equal(vcache_worker_create(cache, NULL, &worker, message), VCACHE_OK);
    assert_string_equal(message, "");
    vcache_worker_destroy(&worker);
    assert_null(worker);
    vcache_worker_destroy(&worker);
    vcache_worker_destroy(NULL);
    vcache_destroy(&cache);
}

/* --------------------------------------------------------------------------------------------------------- memory */

typedef struct ledger {
    void *memory[16];
    size_t bytes[16];
    int open, calls, fail_at; /* the call with this number returns NULL */
    size_t total;
} ledger;

static void *ledger_allocate(void *context, size_t bytes)
{
    ledger *l = context;
    if (++l->calls == l->fail_at)
        return NULL;
    for (int i = 0; i < 16; i++)
        if (!l->memory[i]) {
            void *memory = aligned_alloc(64, (bytes + 63) / 64 * 64);
            assert_non_null(memory);
            memset(memory, 0, bytes);
            l->memory[i] = memory, l->bytes[i] = bytes, l->open++, l->total += bytes;
            return memory;
        }
    return NULL;
}

static void ledger_release(void *context, void *memory, size_t bytes)
{
    ledger *l = context;
    for (int i = 0; i < 16; i++)
        if (l->memory[i] == memory) {
            assert_non_null(memory);
            assert_int_equal(l->bytes[i], bytes);
            l->memory[i] = NULL, l->open--;
            free(memory);
            return;
        }
    fail_msg("release of memory that was not allocated here");
}

static void failing_memory(void **state)
{
    (void)state;
    char message[VCACHE_MESSAGE_BYTES];
    int needed = 0;
    for (int fail_at = 1; fail_at < 10; fail_at++) {
        ledger l = {.fail_at = fail_at};
        vcache_config config = vcache_default_config();
        config.table_bytes = 4000;
        config.allocator = (vcache_allocator){ledger_allocate, ledger_release, &l};
        vcache *cache;
        vcache_worker *worker = NULL;
        vcache_status status = vcache_create(&config, &cache, message);
        if (status == VCACHE_OK)
            status = vcache_worker_create(cache, NULL, &worker, message);
        if (status == VCACHE_OK) {
            needed = l.calls;
            /* all of it comes from this allocator: the table, and a worker's batch */
            uint64_t capacity = vcache_default_worker_config().capacity;
            assert_true(l.total > 4000 + capacity * (sizeof(vcache_miss) + sizeof(vcache_answer)));
        } else {
            assert_int_equal(status, VCACHE_ERROR_MEMORY);
            assert_non_null(strstr(message, "no memory"));
            assert_null(worker);
            assert_true(fail_at == l.calls);
        }
        vcache_worker_destroy(&worker);
        vcache_destroy(&cache);
        assert_int_equal(l.open, 0);
        if (needed)
            break;
    }
    assert_int_equal(needed, 3); /* the cache, its table, the worker */
}

static bool all_visible(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    (void)misses;
    *(size_t *)context += count;
    memset(answers, VCACHE_VISIBLE, count);
    return true;
}

/* Queries allocate nothing. */
static void queries_need_no_memory(void **state)
{
    (void)state;
    ledger l = {0};
    vcache_config config = vcache_default_config();
    config.allocator = (vcache_allocator){ledger_allocate, ledger_release, &l};
    vcache *cache = make_cache(&config);
    vcache_worker *worker = make_worker(cache, 100, false);
    int calls = l.calls;
    vcache_surface s = {.normal = {0.0f, 0.0f, 1.0f}, .density = 1000.0f};
    vcache_light light;
    size_t traced = 0;
    uint64_t visible = 0;
    vcache_prepare_point(cache, (float[3]){0.5f, 0.5f, 1.0f}, 0, &light);
    for (int i = 0; i < 1000; i++) {
        s.position[0] = (float)i / 1000.0f;
        vcache_eye *eye = make_eye(cache, &s, 4.0f, 0);
        assert_true(vcache_query(worker, eye, &light, 1, NULL, &visible, all_visible, &traced));
        assert_true(vcache_visible(worker, eye, &light, all_visible, &traced));
        free(eye);
    }
    vcache_clear(cache);
    assert_int_equal(l.calls, calls);
    assert_true(traced > 0);
    vcache_worker_destroy(&worker);
    vcache_destroy(&cache);
    assert_int_equal(l.open, 0);
}

/* Memory that costs nothing until it is touched. */
static void *lazy_allocate(void *context, size_t bytes)
{
    (void)context;
    void *memory = mmap(NULL, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
    return memory == MAP_FAILED ? NULL : memory;
}

static void lazy_release(void *context, void *memory, size_t bytes)
{
    (void)context;
    munmap(memory, bytes);
}

/* A table that is used a little, cleared, and used again. The clear may not touch it: a fault would end the test. */
static void use_a_little(uint64_t bytes)
{
    vcache_config config = vcache_default_config();
    config.table_bytes = bytes;
    config.allocator = (vcache_allocator){lazy_allocate, lazy_release, NULL};
    char message[VCACHE_MESSAGE_BYTES];
    vcache *cache;
    if (vcache_create(&config, &cache, message) == VCACHE_ERROR_MEMORY) {
        print_message("skipped: %s\n", message);
        skip();
    }
    assert_int_equal(vcache_table_words(cache), bytes / 4);
    vcache_worker *worker = make_worker(cache, 64, false);
    vcache_surface s = {.normal = {0.0f, 0.0f, 1.0f}, .density = 1e6f};
    vcache_light light;
    vcache_prepare_point(cache, (float[3]){0.5f, 0.5f, 1.0f}, 0, &light);
    size_t traced = 0;
    uint64_t slots[100];
    for (int round = 0; round < 3; round++) {
        for (int i = 0; i < 100; i++) {
            s.position[0] = (float)i / 100.0f;
            vcache_eye *eye = make_eye(cache, &s, 4.0f, 0);
            assert_true(vcache_visible(worker, eye, &light, all_visible, &traced));
            slots[i] =
                pair_slot(cache, config.hash, pair_key(config.hash, cache->epoch_key, vcache_eye_cell(eye, 0), &light));
            assert_true(slots[i] < bytes / 4);
            free(eye);
        }
        if (round != 1) { /* nothing is known at first and after the clear, all of it the second time */
            assert_int_equal(traced, 100);
            traced = 0;
            assert_true(count_distinct(slots, 100) > 98);
            assert_true(slots[99] > bytes / 5 && slots[0] < bytes / 20); /* spread over the whole table, now sorted */
        } else {
            assert_int_equal(traced, 0);
            void *words = (void *)cache->table.words;
            assert_int_equal(mprotect(words, bytes, PROT_NONE), 0);
            vcache_clear(cache);
            assert_int_equal(mprotect(words, bytes, PROT_READ | PROT_WRITE), 0);
        }
    }
    vcache_worker_destroy(&worker);
    vcache_destroy(&cache);
}

static void clear_is_constant(void **state)
{
    (void)state;
    use_a_little((uint64_t)1 << 30);
}

static void largest_table(void **state)
{
    (void)state;
    use_a_little((uint64_t)1 << 34);
}

/* ------------------------------------------------------------------------------------------------------ odds and ends
 */

static void share_filled(void **state)
{
    (void)state;
    vcache_config config = vcache_default_config();
    config.table_bytes = 4 * 1000;
    vcache *cache = make_cache(&config);
    assert_true(vcache_table_filled(cache, 1000) == 0.0);
    assert_true(vcache_table_filled(cache, 0) == 0.0);
    for (uint64_t i = 500; i < 1000; i++)
        table_store_relaxed(&cache->table, i, 2);
    /* any number of samples sees the whole table, not its front alone */
    static const uint64_t samples[] = {10, 499, 501, 600, 999, 1000, UINT64_MAX};
    for (int i = 0; i < 7; i++) {
        double share = vcache_table_filled(cache, samples[i]);
        if (fabs(share - 0.5) > 0.01)
            fail_msg("%llu samples of a half-filled table see %g of it filled", (unsigned long long)samples[i], share);
    }
    vcache_destroy(&cache);
}

static void version_and_texts(void **state)
{
    (void)state;
    assert_int_equal(vcache_version(),
                     VCACHE_VERSION_MAJOR * 10000 + VCACHE_VERSION_MINOR * 100 + VCACHE_VERSION_PATCH);
    for (int i = -1; i <= 3; i++) {
        const char *text = vcache_status_text((vcache_status)i);
        assert_true(text && strlen(text) > 0);
    }
    assert_string_not_equal(vcache_status_text(VCACHE_ERROR_MEMORY), vcache_status_text(VCACHE_ERROR_ARGUMENT));
    /* a host that was built against a shorter struct of statistics */
    vcache_config config = vcache_default_config();
    config.table_bytes = 4;
    vcache *cache = make_cache(&config);
    vcache_worker *worker = make_worker(cache, 1, false);
    unsigned char bytes[sizeof(vcache_statistics)];
    vcache_statistics s;
    memset(&s, 0xee, sizeof s);
    s.size = offsetof(vcache_statistics, traced);
    vcache_worker_statistics(worker, &s);
    memcpy(bytes, &s, sizeof s);
    assert_int_equal(s.size, offsetof(vcache_statistics, traced));
    assert_int_equal(s.asked, 0);
    for (size_t i = offsetof(vcache_statistics, traced); i < sizeof s; i++)
        assert_int_equal(bytes[i], 0xee);
    vcache_worker_destroy(&worker);
    vcache_destroy(&cache);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bad_configs),
        cmocka_unit_test(limits_are_allowed),
        cmocka_unit_test(bad_worker_configs),
        cmocka_unit_test(failing_memory),
        cmocka_unit_test(queries_need_no_memory),
        cmocka_unit_test(clear_is_constant),
        cmocka_unit_test(largest_table),
        cmocka_unit_test(share_filled),
        cmocka_unit_test(version_and_texts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
