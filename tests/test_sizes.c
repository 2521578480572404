/* SPDX-License-Identifier: Apache-2.0 */
/* Structs that carry their size (docs/abi.md): hosts of older and newer headers. tests/abi.sh does it with libraries.
 */
#include "../vcache/adaptive.h"
#include "../vcache/grid.h"
#include "../vcache/sized.h"
#include "support.h"

/* ------------------------------------------------------------------------------------------------ any such struct */

typedef struct first_version {
    size_t size;
    uint32_t a;
} first_version;

typedef struct this_version {
    size_t size;
    uint32_t a, unused;
    double b;
} this_version;

static const this_version usual = {sizeof(this_version), 10, 0, 0.5};
enum { FIRST = sizeof(first_version) };

static void older_ones_get_defaults(void **state)
{
    (void)state;
    first_version older[2];
    memset(older, 0xee, sizeof older);
    sized_fill(&older[0], sizeof older[0], &usual, sizeof usual);
    assert_int_equal(older[0].size, sizeof older[0]);
    assert_int_equal(older[0].a, 10);
    for (size_t i = 0; i < sizeof older[1]; i++)
        assert_int_equal(((unsigned char *)&older[1])[i], 0xee);
    older[0].a = 11;
    this_version all = usual;
    assert_null(sized_take(&all, sizeof all, FIRST, &older[0]));
    assert_int_equal(all.size, sizeof all);
    assert_int_equal(all.a, 11);
    assert_true(all.b == 0.5);
}

static void newer_ones_may_ask_for_nothing_new(void **state)
{
    (void)state;
    struct {
        this_version known;
        uint64_t c, d;
    } newer;
    memset(&newer, 0xee, sizeof newer);
    sized_fill(&newer, sizeof newer, &usual, sizeof usual);
    assert_int_equal(newer.known.size, sizeof newer);
    assert_true(newer.known.b == 0.5 && newer.c == 0 && newer.d == 0);
    newer.known.b = 2.0;
    this_version all = usual;
    assert_null(sized_take(&all, sizeof all, FIRST, &newer));
    assert_true(all.size == sizeof all && all.b == 2.0);
    for (int bit = 0; bit < 128; bit += 9) {
        newer.c = newer.d = 0;
        *(bit < 64 ? &newer.c : &newer.d) = (uint64_t)1 << bit % 64;
        this_version same = usual;
        assert_non_null(strstr(sized_take(&same, sizeof same, FIRST, &newer), "newer header"));
        assert_memory_equal(&same, &usual, sizeof same); /* nothing was taken */
    }
    size_t nothing = 77;
    sized_fill(&nothing, sizeof nothing - 1, &usual, sizeof usual);
    assert_int_equal(nothing, 77);
}

/* --------------------------------------------------------------------------------------------------- the library's */

/* How a config is filled and tried. Messages name the function to start from. */
typedef struct kind {
    size_t bytes;
    const char *start;
    void (*fill)(void *out, size_t size);
    vcache_status (*try)(const void *config, char *message);
} kind;

static vcache *cache;
static vcache_grid_lights *sky;

#define KIND(name, type, fill, create)                                                                                 \
    static void fill_##name(void *out, size_t size)                                                                    \
    {                                                                                                                  \
        fill(out, size);                                                                                               \
    }                                                                                                                  \
    static vcache_status try_##name(const void *config, char *message)                                                 \
    {                                                                                                                  \
        type *made;                                                                                                    \
        vcache_status status = (create);                                                                               \
        assert_true((status == VCACHE_OK) == (made != NULL));                                                          \
        type##_destroy(&made);                                                                                         \
        return status;                                                                                                 \
    }

static void fill_sources(vcache_adaptive_config *out, size_t size)
{
    vcache_adaptive_fill_config(out, size);
    out->sources = 3; /* it has no default */
}

KIND(cache, vcache, vcache_fill_config, vcache_create(config, &made, message))
KIND(worker, vcache_worker, vcache_fill_worker_config, vcache_worker_create(cache, config, &made, message))
KIND(adaptive, vcache_adaptive, fill_sources, vcache_adaptive_create(config, &made, message))
KIND(grid, vcache_grid, vcache_grid_fill_config, vcache_grid_create(config, sky, &made, message))

static const kind kinds[] = {
    {sizeof(vcache_config), "vcache_default_config", fill_cache, try_cache},
    {sizeof(vcache_worker_config), "vcache_default_worker_config", fill_worker, try_worker},
    {sizeof(vcache_adaptive_config), "vcache_adaptive_default_config", fill_adaptive, try_adaptive},
    {sizeof(vcache_grid_config), "vcache_grid_default_config", fill_grid, try_grid},
};

/* A config of `size` bytes, no more: what lies behind must not be touched. */
static void *config_of(const kind *k, size_t size)
{
    unsigned char *memory = malloc(size + 8);
    assert_non_null(memory);
    memset(memory, 0xee, size + 8);
    k->fill(memory, size);
    for (int i = 0; i < 8; i++)
        assert_int_equal(memory[size + (size_t)i], 0xee);
    return realloc(memory, size);
}

static void configs_of_other_headers(void **state)
{
    (void)state;
    char message[VCACHE_MESSAGE_BYTES];
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        const kind *k = &kinds[i];
        for (size_t more = 0; more <= SIZED_GROWTH; more += more < 32 ? sizeof(size_t) : 331) {
            size_t size = k->bytes + more / sizeof(size_t) * sizeof(size_t);
            unsigned char *config = config_of(k, size);
            size_t said;
            memcpy(&said, config, sizeof said);
            assert_int_equal(said, size);
            assert_int_equal(k->try(config, message), VCACHE_OK);
            assert_string_equal(message, "");
            for (size_t at = k->bytes; at < size; at += at < size - 1 ? size - 1 - at : 1) {
                config[at] = 1;
                assert_int_equal(k->try(config, message), VCACHE_ERROR_ARGUMENT);
                assert_non_null(strstr(message, "newer header"));
                config[at] = 0;
            }
            free(config);
        }
        static const size_t none[] = {0, 1, 7, 8, SIZE_MAX, SIZE_MAX / 2 + 1};
        unsigned char *config = config_of(k, k->bytes);
        for (size_t j = 0; j < sizeof none / sizeof *none + 4; j++) {
            const size_t near[] = {k->bytes - 1, k->bytes - sizeof(size_t), k->bytes + 1,
                                   k->bytes + SIZED_GROWTH + sizeof(size_t)};
            size_t size = j < 4 ? near[j] : none[j - 4];
            memcpy(config, &size, sizeof size);
            assert_int_equal(k->try(config, message), VCACHE_ERROR_ARGUMENT);
            if (!strstr(message, "size") || !strstr(message, k->start))
                fail_msg("%zu of %zu: %s", size, k->bytes, message);
        }
        free(config);
    }
}

static void modes_of_the_grid_are_set_in_place(void **state)
{
    (void)state;
    const size_t size = sizeof(vcache_grid_config) + 24;
    vcache_grid_config *config = config_of(&kinds[3], size);
    char message[VCACHE_MESSAGE_BYTES];
    assert_true(vcache_grid_parse_mode("FLO,spacing=8", config, message));
    assert_int_equal(config->size, size);
    assert_int_equal(config->spacing, 8);
    ((unsigned char *)config)[size - 1] = 1;
    assert_false(vcache_grid_parse_mode("OPT", config, message));
    assert_non_null(strstr(message, "newer header"));
    free(config);
}

static int set_up(void **state)
{
    (void)state;
    vcache_config config = vcache_default_config();
    config.table_bytes = 64;
    const float directions[3][3] = {{0.0f, 0.0f, 1.0f}, {0.0f, 1.0f, 0.0f}, {1.0f, 0.0f, 0.0f}};
    const float energy[3] = {1.0f, 1.0f, 1.0f};
    return vcache_create(&config, &cache, NULL) == VCACHE_OK &&
                   vcache_grid_create_lights(directions[0], energy, 3, NULL, &sky, NULL) == VCACHE_OK
               ? 0
               : 1;
}

static int tear_down(void **state)
{
    (void)state;
    vcache_grid_destroy_lights(&sky);
    vcache_destroy(&cache);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(older_ones_get_defaults),
        cmocka_unit_test(newer_ones_may_ask_for_nothing_new),
        cmocka_unit_test(configs_of_other_headers),
        cmocka_unit_test(modes_of_the_grid_are_set_in_place),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
