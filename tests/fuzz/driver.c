/* SPDX-License-Identifier: Apache-2.0 */
/* In the place of libFuzzer, where there is none: replays a corpus, then inputs made from it.
 *   TARGET [--runs N] [--seconds S] [--seed N] FILE-OR-FOLDER ... */
#include "fuzz.h"

#include <dirent.h>
#include <sys/stat.h>
#include <time.h>

enum { MOST = 1 << 16, INPUTS = 512 };

typedef struct input {
    uint8_t *data;
    size_t size;
} input;

static input corpus[INPUTS];
static size_t corpus_count;

static void add_file(const char *path)
{
    FILE *f = fopen(path, "rb");
    if (!f || corpus_count == INPUTS) {
        fprintf(stderr, "%s: cannot be read\n", path);
        exit(2);
    }
    input in = {malloc(MOST), 0};
    in.size = in.data ? fread(in.data, 1, MOST, f) : 0;
    fclose(f);
    corpus[corpus_count++] = in;
}

static void add(const char *path)
{
    struct stat s;
    DIR *d = stat(path, &s) == 0 && S_ISDIR(s.st_mode) ? opendir(path) : NULL;
    if (!d) {
        add_file(path);
        return;
    }
    for (struct dirent *e; (e = readdir(d));)
        if (e->d_name[0] != '.') {
            char inside[4096];
            snprintf(inside, sizeof inside, "%s/%s", path, e->d_name);
            add_file(inside);
        }
    closedir(d);
}

static uint64_t next(uint64_t *state)
{
    uint64_t x = *state += 0x9e3779b97f4a7c15u;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return x ^ x >> 31;
}

/* Flips, sets, inserts, drops, repeats; and splices two inputs. */
static size_t mutate(uint8_t *d, size_t size, uint64_t *seed)
{
    for (uint64_t n = 1 + next(seed) % 4; n > 0; n--) {
        size_t at = size ? next(seed) % size : 0, length = 1 + next(seed) % 16;
        switch (next(seed) % 7) {
        case 0:
            if (size)
                d[at] ^= (uint8_t)(1u << next(seed) % 8);
            break;
        case 1:
            if (size)
                d[at] = (uint8_t)next(seed);
            break;
        case 2:
            if (size + length < MOST) {
                memmove(d + at + length, d + at, size - at);
                for (size_t i = 0; i < length; i++)
                    d[at + i] = (uint8_t)next(seed);
                size += length;
            }
            break;
        case 3:
            if (at + length < size) {
                memmove(d + at, d + at + length, size - at - length);
                size -= length;
            }
            break;
        case 4:
            size = size ? at + 1 : 0;
            break;
        case 5: {
            const input *other = &corpus[next(seed) % corpus_count];
            size_t from = other->size ? next(seed) % other->size : 0;
            length = other->size - from < MOST - at ? other->size - from : MOST - at;
            memcpy(d + at, other->data + from, length);
            size = at + length > size ? at + length : size;
            break;
        }
        default:
            if (at + 4 <= size) { /* a length or an offset that is far off */
                static const uint32_t odd[] = {0,      1,      0x7f,       0x80,       0xff,
                                               0x7fff, 0xffff, 0x7fffffff, 0x80000000, 0xffffffff};
                memcpy(d + at, &odd[next(seed) % 10], 4);
            }
        }
    }
    return size;
}

int main(int argc, char *argv[])
{
    uint64_t runs = 0, seed = 1, done = 0;
    double seconds = 0.0;
    for (int i = 1; i < argc; i++) {
        if (!strcmp(argv[i], "--runs") && i + 1 < argc)
            runs = strtoull(argv[++i], NULL, 10);
        else if (!strcmp(argv[i], "--seconds") && i + 1 < argc)
            seconds = strtod(argv[++i], NULL);
        else if (!strcmp(argv[i], "--seed") && i + 1 < argc)
            seed = strtoull(argv[++i], NULL, 10);
        else
            add(argv[i]);
    }
    for (size_t i = 0; i < corpus_count; i++)
        LLVMFuzzerTestOneInput(corpus[i].data, corpus[i].size);
    time_t start = time(NULL);
    uint8_t *d = malloc(MOST);
    while (d && corpus_count && (done < runs || (seconds > 0.0 && difftime(time(NULL), start) < seconds))) {
        const input *in = &corpus[next(&seed) % corpus_count];
        memcpy(d, in->data, in->size);
        size_t size = mutate(d, in->size, &seed);
        uint8_t *exact = malloc(size + !size); /* its end is watched by the address sanitizer */
        memcpy(exact, d, size);
        LLVMFuzzerTestOneInput(exact, size);
        free(exact);
        done++;
    }
    printf("%zu inputs, %llu made from them\n", corpus_count, (unsigned long long)done);
    free(d);
    for (size_t i = 0; i < corpus_count; i++)
        free(corpus[i].data);
    return corpus_count ? 0 : 2;
}
