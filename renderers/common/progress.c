/* SPDX-License-Identifier: Apache-2.0 */
/* Progress line; see progress.h. Adding is one atomic addition and a look at the clock; only the thread that finds the
 * line out of date draws, and nobody waits for it. */
#include "progress.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#include <unistd.h>

#define REDRAW_NS 100000000

struct progress {
    char label[32];
    uint64_t total;
    int64_t start; /* ns */
    atomic_uint_least64_t done;
    atomic_int_least64_t next_draw; /* ns */
    pthread_mutex_t drawing;
};

static int64_t now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000000000 + t.tv_nsec;
}

/* 65 -> "1:05", 3700 -> "1:01:40" */
static void format_seconds(double seconds, char out[32])
{
    long s = (long)(seconds + 0.5);
    if (s >= 3600)
        snprintf(out, 32, "%ld:%02ld:%02ld", s / 3600, s / 60 % 60, s % 60);
    else
        snprintf(out, 32, "%ld:%02ld", s / 60, s % 60);
}

static void draw(const progress *p, uint64_t done, int64_t now)
{
    char taken[32], left[32];
    double share = p->total ? (double)done / (double)p->total : 1.0;
    double seconds = (double)(now - p->start) * 1e-9;
    share = share < 1.0 ? share : 1.0;
    format_seconds(seconds, taken);
    fprintf(stderr, "\r%s %3d %%  %s", p->label, (int)(100.0 * share), taken);
    if (share > 0.0 && seconds / share < 1e7) {
        format_seconds(seconds / share - seconds, left);
        fprintf(stderr, ", %s left", left);
    }
    fputs("\033[K", stderr); /* clear to the end of the line */
    fflush(stderr);
}

progress *progress_new(const char *label, uint64_t total, bool quiet)
{
    if (quiet || !isatty(STDERR_FILENO))
        return NULL;
    progress *p = calloc(1, sizeof *p);
    if (!p)
        return NULL;
    if (pthread_mutex_init(&p->drawing, NULL) != 0) {
        free(p);
        return NULL;
    }
    snprintf(p->label, sizeof p->label, "%s", label);
    p->total = total;
    p->start = now_ns();
    atomic_init(&p->next_draw, p->start + REDRAW_NS); /* short work shows no line at all */
    return p;
}

void progress_add(progress *p, uint64_t n)
{
    if (!p)
        return;
    atomic_fetch_add_explicit(&p->done, n, memory_order_relaxed);
    int64_t now = now_ns();
    if (now < atomic_load_explicit(&p->next_draw, memory_order_relaxed) || pthread_mutex_trylock(&p->drawing) != 0)
        return;
    atomic_store_explicit(&p->next_draw, now + REDRAW_NS, memory_order_relaxed);
    draw(p, atomic_load_explicit(&p->done, memory_order_relaxed), now);
    pthread_mutex_unlock(&p->drawing);
}

void progress_free(progress *p)
{
    if (!p)
        return;
    fputs("\r\033[K", stderr);
    fflush(stderr);
    pthread_mutex_destroy(&p->drawing);
    free(p);
}
