/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Saving and loading. A file is a row of 64-bit words, lowest byte first:
 *
 *     header, FIELDS words | table: two words of it at a time  or  rows: key, known, visible; 0 for an empty one | sum
 *
 * The sum goes over all words before it. Each value of a word of the table or a row is as good as any other to those
 * who look it up, so that nothing in a file can lead outside of memory; sizes come from the config, never from the
 * file.
 */
#include "save.h"

#include "light_set.h"

#include <string.h>

static const uint64_t magic = 0x1a6568636163762eu; /* ".vcache" and end of file */

/* To be raised when keys, words or rows change their meaning. */
enum { FORMAT = 1 };

enum { KIND_TABLE = 1, KIND_SET = 2 };

enum field {
    FIELD_MAGIC,
    FIELD_FORMAT,
    FIELD_KIND,
    FIELD_SCENE,
    FIELD_BOUNDS,
    FIELD_NORMAL_BINS,
    FIELD_LAYERS,
    FIELD_RESOLUTION_STEP,
    FIELD_LEVELS,
    FIELD_HASH,
    FIELD_SIZE, /* words of the table, or rows */
    FIELD_LIGHT_COUNT,
    FIELD_LIGHTS,
    FIELD_EPOCH, /* last: a table takes it over, all others must be equal */
    FIELDS
};

static const char *const complaint[FIELDS] = {
    "this is no file of vcache",
    "saved by a version of vcache with another format",
    "a cache is saved here where a light set is wanted, or the other way round",
    "saved for another scene: stale or foreign",
    "saved with other bounds",
    "saved with another normal_bins (C_N)",
    "saved with another layers (C_Z)",
    "saved with another resolution_step (C_R)",
    "saved with another levels (C_MSR)",
    "saved with another hash",
    "saved with another size of the table or the rows (bytes)",
    "saved with another number of lights",
    "saved with other lights",
    "saved in another state of the cache: load the cache that was saved with it first",
};
static const char *const short_file = "the file ends too early or cannot be read";
static const char *const damaged = "the file is damaged: its checksum does not fit";

enum { BLOCK = 512 };

typedef struct stream {
    vcache_write write;
    vcache_read read;
    void *context;
    uint64_t sum;
    unsigned char bytes[8 * BLOCK];
} stream;

static void add_to_sum(stream *s, const uint64_t *words, size_t count)
{
    for (size_t i = 0; i < count; i++)
        s->sum = hash_words(words[i], s->sum, 0x27d4eb2f165667c5u);
}

/* At most BLOCK words. */
static bool put(stream *s, const uint64_t *words, size_t count)
{
    add_to_sum(s, words, count);
    for (size_t i = 0; i < 8 * count; i++)
        s->bytes[i] = (unsigned char)(words[i / 8] >> i % 8 * 8);
    return s->write(s->context, s->bytes, 8 * count);
}

static bool get(stream *s, uint64_t *words, size_t count)
{
    if (!s->read(s->context, s->bytes, 8 * count))
        return false;
    memset(words, 0, 8 * count);
    for (size_t i = 0; i < 8 * count; i++)
        words[i / 8] |= (uint64_t)s->bytes[i] << i % 8 * 8;
    add_to_sum(s, words, count);
    return true;
}

static bool put_sum(stream *s)
{
    uint64_t sum = s->sum;
    return put(s, &sum, 1);
}

static const char *get_sum(stream *s)
{
    uint64_t sum = s->sum, word;
    if (!get(s, &word, 1))
        return short_file;
    return word == sum ? NULL : damaged;
}

static uint64_t bits_of(float x)
{
    uint32_t bits;
    x += 0.0f; /* -0 and 0 are one place */
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static void describe_config(const vcache *c, uint64_t scene, uint64_t field[FIELDS])
{
    const vcache_config *f = &c->config;
    memset(field, 0, FIELDS * sizeof *field);
    field[FIELD_MAGIC] = magic;
    field[FIELD_FORMAT] = FORMAT;
    field[FIELD_SCENE] = scene;
    for (int i = 0; i < 3; i++)
        field[FIELD_BOUNDS] = hash_words(bits_of(f->bounds_min[i]), bits_of(f->bounds_max[i]), field[FIELD_BOUNDS]);
    field[FIELD_NORMAL_BINS] = (uint64_t)f->normal_bins;
    field[FIELD_LAYERS] = (uint64_t)f->layers;
    field[FIELD_RESOLUTION_STEP] = bits_of(f->resolution_step);
    field[FIELD_LEVELS] = (uint64_t)f->levels;
    field[FIELD_HASH] = (uint64_t)f->hash;
    field[FIELD_EPOCH] = atomic_load_explicit(&c->epoch_key, memory_order_acquire);
}

static void describe_table(const vcache *c, uint64_t scene, uint64_t field[FIELDS])
{
    describe_config(c, scene, field);
    field[FIELD_KIND] = KIND_TABLE;
    field[FIELD_SIZE] = c->table.count;
}

static void describe_set(const vcache_light_set *s, uint64_t scene, uint64_t field[FIELDS])
{
    describe_config(s->cache, scene, field);
    field[FIELD_KIND] = KIND_SET;
    field[FIELD_SIZE] = s->rows;
    field[FIELD_LIGHT_COUNT] = s->count;
    uint64_t sum = 0;
    for (uint32_t i = 0; i < s->count; i++) {
        const vcache_light *l = &s->lights[i];
        sum = hash_words((uint64_t)l->kind << 1 | l->bad, bits_of(l->side_squared), sum);
        sum = hash_words(bits_of(l->position[0]) << 32 | bits_of(l->position[1]), bits_of(l->position[2]), sum);
    }
    field[FIELD_LIGHTS] = sum;
}

/* The header against what is expected; `epoch` (or NULL: must be equal) takes what the file says. NULL: it fits. */
static const char *get_header(stream *s, const uint64_t expected[FIELDS], uint64_t *epoch)
{
    uint64_t field[FIELDS];
    if (!get(s, field, FIELDS))
        return short_file;
    for (int i = 0; i < FIELDS; i++)
        if (field[i] != expected[i] && !(i == FIELD_EPOCH && epoch))
            return complaint[i];
    if (epoch)
        *epoch = field[FIELD_EPOCH];
    return NULL;
}

static vcache_status begin(bool arguments, char *message)
{
    if (message)
        message[0] = 0;
    return arguments ? VCACHE_OK : vcache_complain(message, VCACHE_ERROR_ARGUMENT, "an argument is NULL");
}

static vcache_status saved(bool fine, char *message)
{
    return fine ? VCACHE_OK : vcache_complain(message, VCACHE_ERROR_FILE, "the file cannot be written");
}

/* ------------------------------------------------------------------------------------------------------ the table */

vcache_status vcache_save(const vcache *c, uint64_t scene, vcache_write write, void *context, char *message)
{
    vcache_status status = begin(c && write, message);
    if (status != VCACHE_OK)
        return status;
    stream s = {.write = write, .context = context};
    uint64_t field[FIELDS], block[BLOCK];
    describe_table(c, scene, field);
    bool fine = put(&s, field, FIELDS);
    for (uint64_t i = 0; i < c->table.count && fine;) {
        size_t n = 0;
        for (; n < BLOCK && i < c->table.count; n++, i += 2)
            block[n] = table_load_relaxed(&c->table, i) |
                       (i + 1 < c->table.count ? (uint64_t)table_load_relaxed(&c->table, i + 1) << 32 : 0);
        fine = put(&s, block, n);
    }
    return saved(fine && put_sum(&s), message);
}

static const char *load_table(vcache *c, stream *s, uint64_t scene)
{
    uint64_t field[FIELDS], block[BLOCK], epoch = 0;
    describe_table(c, scene, field);
    const char *wrong = get_header(s, field, &epoch);
    for (uint64_t i = 0; i < c->table.count && !wrong;) {
        uint64_t left = (c->table.count - i + 1) / 2;
        size_t n = left < BLOCK ? (size_t)left : BLOCK;
        if (!get(s, block, n))
            wrong = short_file;
        for (size_t k = 0; k < n && !wrong; k++, i += 2) {
            if (block[k] == 0)
                continue; /* pages that hold nothing stay untouched */
            table_store_relaxed(&c->table, i, (uint32_t)block[k]);
            if (i + 1 < c->table.count)
                table_store_relaxed(&c->table, i + 1, (uint32_t)(block[k] >> 32));
        }
    }
    if (!wrong)
        wrong = get_sum(s);
    atomic_store_explicit(&c->epoch_key, epoch, memory_order_relaxed);
    return wrong;
}

vcache_status vcache_load(const vcache_config *config, uint64_t scene, vcache_read read, void *context, vcache **out,
                          char *message)
{
    if (out)
        *out = NULL;
    vcache_status status = begin(read && out, message);
    if (status == VCACHE_OK)
        status = vcache_create(config, out, message);
    if (status != VCACHE_OK)
        return status;
    stream s = {.read = read, .context = context};
    const char *wrong = load_table(*out, &s, scene);
    if (!wrong)
        return VCACHE_OK;
    vcache_destroy(out);
    return vcache_complain(message, VCACHE_ERROR_FILE, "%s", wrong);
}

/* ----------------------------------------------------------------------------------------------------------- rows */

enum { MAX_WORDS = VCACHE_MAX_SET / 64 };

static bool put_all(stream *s, const uint64_t *words, size_t count)
{
    for (size_t i = 0; i < count; i += BLOCK)
        if (!put(s, words + i, count - i < BLOCK ? count - i : BLOCK))
            return false;
    return true;
}

static bool get_all(stream *s, uint64_t *words, size_t count)
{
    for (size_t i = 0; i < count; i += BLOCK)
        if (!get(s, words + i, count - i < BLOCK ? count - i : BLOCK))
            return false;
    return true;
}

vcache_status vcache_light_set_save(const vcache_light_set *set, uint64_t scene, vcache_write write, void *context,
                                    char *message)
{
    vcache_status status = begin(set && write, message);
    if (status != VCACHE_OK)
        return status;
    stream s = {.write = write, .context = context};
    uint64_t field[FIELDS], known[MAX_WORDS], visible[MAX_WORDS];
    describe_set(set, scene, field);
    bool fine = put(&s, field, FIELDS);
    for (uint64_t i = 0; i < set->rows && fine; i++) {
        uint64_t key = atomic_load_explicit(&set->memory[i * set->stride + ROW_KEY], memory_order_acquire);
        if (key && !row_read(set, key, 0, set->words, known, visible))
            key = 0; /* being written */
        fine = put(&s, &key, 1);
        if (key)
            fine = fine && put_all(&s, known, set->words) && put_all(&s, visible, set->words);
    }
    return saved(fine && put_sum(&s), message);
}

static const char *load_rows(vcache_light_set *set, stream *s, uint64_t scene)
{
    uint64_t field[FIELDS], known[MAX_WORDS], visible[MAX_WORDS];
    describe_set(set, scene, field);
    const char *wrong = get_header(s, field, NULL);
    for (uint64_t i = 0; i < set->rows && !wrong; i++) {
        uint64_t key;
        if (!get(s, &key, 1))
            return short_file;
        if (!key)
            continue;
        if (!get_all(s, known, set->words) || !get_all(s, visible, set->words))
            return short_file;
        bool replaced;
        _Atomic uint64_t *row = row_open(set, key, &replaced); /* nobody else has the set yet */
        for (uint32_t w = 0; w < set->words; w++)
            row_store(set, row, w, (light_states){known[w], visible[w]});
        row_close(row);
    }
    return wrong ? wrong : get_sum(s);
}

vcache_status vcache_light_set_load(vcache *cache, const vcache_light *lights, uint32_t count, uint64_t bytes,
                                    uint64_t scene, vcache_read read, void *context, vcache_light_set **out,
                                    char *message)
{
    if (out)
        *out = NULL;
    vcache_status status = begin(read && out, message);
    if (status == VCACHE_OK)
        status = vcache_light_set_create(cache, lights, count, bytes, out, message);
    if (status != VCACHE_OK)
        return status;
    stream s = {.read = read, .context = context};
    const char *wrong = load_rows(*out, &s, scene);
    if (!wrong)
        return VCACHE_OK;
    vcache_light_set_destroy(out);
    return vcache_complain(message, VCACHE_ERROR_FILE, "%s", wrong);
}
