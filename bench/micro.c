/* SPDX-License-Identifier: Apache-2.0 */
/* Micro-benchmarks of the library: nanoseconds of CPU time per pair, end, eye end or miss. After a warm-up each case
 * runs long enough (20 ms) several times; the median is the figure, the smallest and largest say how quiet the machine
 * was.
 *
 *     micro [--list] [--filter REGEX] [--csv FILE] [--isa scalar|avx2|avx512|all] [--runs N]
 */
#define _POSIX_C_SOURCE 200809L
#include "micro.h"

#include <errno.h>
#include <regex.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MOST_RUNS = 1001 };
static const double least_seconds = 0.02;

_Noreturn void die(const char *format, ...)
{
    va_list args;
    fflush(stdout);
    fputs("micro: ", stderr);
    va_start(args, format);
    vfprintf(stderr, format, args);
    va_end(args);
    fputc('\n', stderr);
    exit(1);
}

typedef struct arguments {
    const char *filter, *csv;
    uint32_t isa;
    int runs;
    bool list;
} arguments;

static const char usage[] =
    "usage: micro [--list] [--filter REGEX] [--csv FILE] [--isa scalar|avx2|avx512|all] [--runs N]";

static _Noreturn void misuse(const char *what, const char *word)
{
    fprintf(stderr, "micro: %s '%s'; %s\n", what, word, usage);
    exit(2);
}

static uint32_t parse_isa(const char *text)
{
    static const char *const names[] = {"scalar", "avx2", "avx512", "all"};
    static const uint32_t values[] = {VCACHE_ISA_SCALAR, VCACHE_ISA_AVX2, VCACHE_ISA_AVX512, VCACHE_ISA_ALL};
    for (int i = 0; i < 4; i++)
        if (strcmp(text, names[i]) == 0)
            return values[i];
    misuse("--isa: no such instruction set:", text);
}

static arguments parse(int argc, char *argv[])
{
    arguments a = {.filter = "", .isa = VCACHE_ISA_ALL, .runs = 7};
    for (int i = 1; i < argc; i++) {
        const char *name = argv[i], *value = i + 1 < argc ? argv[i + 1] : NULL;
        if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0) {
            puts(usage);
            exit(0);
        }
        if (strcmp(name, "--list") == 0) {
            a.list = true;
            continue;
        }
        bool takes = false;
        static const char *const valued[] = {"--filter", "--csv", "--isa", "--runs"};
        for (int k = 0; k < 4; k++)
            takes = takes || strcmp(name, valued[k]) == 0;
        if (!takes)
            misuse("no such option:", name);
        if (!value || !*value)
            misuse("no value for", name);
        i++;
        if (strcmp(name, "--filter") == 0)
            a.filter = value;
        else if (strcmp(name, "--csv") == 0)
            a.csv = value;
        else if (strcmp(name, "--isa") == 0)
            a.isa = parse_isa(value);
        else {
            char *end;
            long runs = strtol(value, &end, 10);
            if (*end || runs < 1 || runs > MOST_RUNS)
                misuse("--runs takes 1 ... 1001, not", value);
            a.runs = (int)runs;
        }
    }
    return a;
}

/* Of this process alone: others on the machine must not count. */
static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct result {
    double median, least, most;
    uint64_t units; /* of a run */
} result;

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Steps are doubled until a run is long enough; that is the warm-up. */
static result measure(const micro_case *m, world *w, int runs)
{
    static double ns[MOST_RUNS];
    uint64_t steps = 1, units = 0;
    for (double seconds = 0.0; seconds < least_seconds; steps *= 2) {
        double start = now();
        m->run(m, w, steps);
        seconds = now() - start;
    }
    for (int i = 0; i < runs; i++) {
        double start = now();
        units = m->run(m, w, steps);
        ns[i] = 1e9 * (now() - start) / (double)units;
    }
    qsort(ns, (size_t)runs, sizeof *ns, by_size);
    double median = runs % 2 ? ns[runs / 2] : 0.5 * (ns[runs / 2 - 1] + ns[runs / 2]);
    return (result){median, ns[0], ns[runs - 1], units};
}

static bool same_world(const world *w, const world_spec *s)
{
    return w && w->spec.kind == s->kind && w->spec.where == s->where && w->spec.hash == s->hash &&
           w->spec.bundled == s->bundled && w->spec.isa == s->isa;
}

/* False where this machine lacks the instructions. */
static bool has_isa(const world *w)
{
    const char *name = vcache_isa(w->cache);
    return (w->spec.isa != VCACHE_ISA_AVX2 || strcmp(name, "avx2") == 0) &&
           (w->spec.isa != VCACHE_ISA_AVX512 || strcmp(name, "avx512") == 0);
}

static void print_result(const micro_case *m, const world *w, const result *r)
{
    bool filled = w->spec.kind != WORLD_EMPTY;
    printf("%-46s %9.2f  (%.2f ... %.2f)", m->name, r->median, r->least, r->most);
    if (filled)
        printf("  %.0f %% known", 100.0 * w->filled);
    putchar('\n');
    fflush(stdout);
}

static void write_result(FILE *csv, const micro_case *m, const world *w, const result *r, int runs)
{
    fprintf(csv, "%s,%s,%.4g,%.4g,%.4g,%d,%llu,%s,%.3f\n", m->name, m->unit, r->median, r->least, r->most, runs,
            (unsigned long long)r->units, vcache_isa(w->cache), w->filled);
    fflush(csv);
}

int main(int argc, char *argv[])
{
    arguments a = parse(argc, argv);
    regex_t filter;
    int wrong = regcomp(&filter, a.filter, REG_EXTENDED | REG_NOSUB);
    if (wrong) {
        char text[128];
        regerror(wrong, &filter, text, sizeof text);
        die("--filter '%s': %s", a.filter, text);
    }
    size_t count, matches = 0;
    micro_case *cases = cases_new(a.isa, &count);
    for (size_t i = 0; i < count; i++)
        if (regexec(&filter, cases[i].name, 0, NULL, 0) == 0)
            cases[matches++] = cases[i];
    if (matches == 0)
        die("--filter '%s' matches no case; --list shows them", a.filter);
    if (a.list) {
        for (size_t i = 0; i < matches; i++)
            printf("%s\n", cases[i].name);
    } else {
        FILE *csv = a.csv ? fopen(a.csv, "w") : NULL;
        if (a.csv && !csv)
            die("%s: %s", a.csv, strerror(errno));
        if (csv)
            fprintf(csv, "case,unit,median_ns,min_ns,max_ns,runs,units,isa,known\n");
        printf("%-46s %9s  (smallest ... largest of %d runs)\n", "case", "ns", a.runs);
        world *w = NULL;
        for (size_t i = 0; i < matches; i++) {
            const micro_case *m = &cases[i];
            if (!same_world(w, &m->world)) {
                world_free(w);
                w = world_new(&m->world);
            }
            if (!has_isa(w)) {
                printf("%-46s this machine lacks the instructions\n", m->name);
                continue;
            }
            world_choose(w, m->levels);
            result r = measure(m, w, a.runs);
            print_result(m, w, &r);
            if (csv)
                write_result(csv, m, w, &r, a.runs);
        }
        world_free(w);
        if (csv && (ferror(csv) | fclose(csv)))
            die("%s: cannot write", a.csv);
    }
    regfree(&filter);
    free(cases);
    if (fflush(stdout) != 0 || ferror(stdout))
        die("standard output: cannot write");
    return 0;
}
