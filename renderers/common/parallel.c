/* SPDX-License-Identifier: Apache-2.0 */
/* Parallel loops on pthreads; see parallel.h. */
#include "parallel.h"

#include "interrupt.h"

#include <pthread.h>
#include <sched.h>
#include <unistd.h>

typedef struct loop {
    atomic_size_t next;
    size_t count;
    void (*body)(void *ctx, int thread, size_t index);
    void *ctx;
    const atomic_bool *stop;
    atomic_bool stopped; /* a thread left the loop with work to do */
} loop;

typedef struct worker {
    loop *loop;
    int thread;
} worker;

int parallel_default_threads(void)
{
    long n = sysconf(_SC_NPROCESSORS_ONLN);
#ifdef __linux__
    cpu_set_t allowed; /* a container or taskset may allow fewer */
    if (sched_getaffinity(0, sizeof allowed, &allowed) == 0)
        n = CPU_COUNT(&allowed);
#endif
    if (n < 1)
        return 1;
    return n < PARALLEL_MAX_THREADS ? (int)n : PARALLEL_MAX_THREADS;
}

int parallel_thread_count(int threads)
{
    if (threads <= 0)
        return parallel_default_threads();
    return threads < PARALLEL_MAX_THREADS ? threads : PARALLEL_MAX_THREADS;
}

static void *work(void *argument)
{
    const worker *w = argument;
    loop *l = w->loop;
    size_t index;
    while ((index = atomic_fetch_add_explicit(&l->next, 1, memory_order_relaxed)) < l->count) {
        if (interrupted() || (l->stop && atomic_load_explicit(l->stop, memory_order_relaxed))) {
            atomic_store_explicit(&l->stopped, true, memory_order_relaxed);
            break;
        }
        l->body(l->ctx, w->thread, index);
    }
    return NULL;
}

bool parallel_for_until(int threads, size_t count, void (*body)(void *ctx, int thread, size_t index), void *ctx,
                        const atomic_bool *stop)
{
    loop l = {.count = count, .body = body, .ctx = ctx, .stop = stop};
    worker workers[PARALLEL_MAX_THREADS];
    pthread_t started[PARALLEL_MAX_THREADS];
    int n = parallel_thread_count(threads), running = 1;
    if ((size_t)n > count)
        n = (int)count;

    workers[0] = (worker){&l, 0};
    for (; running < n; running++) {
        workers[running] = (worker){&l, running};
        if (pthread_create(&started[running], NULL, work, &workers[running]) != 0)
            break;
    }
    work(&workers[0]);
    for (int i = 1; i < running; i++)
        pthread_join(started[i], NULL);
    return !atomic_load_explicit(&l.stopped, memory_order_relaxed);
}

void parallel_for(int threads, size_t count, void (*body)(void *ctx, int thread, size_t index), void *ctx)
{
    parallel_for_until(threads, count, body, ctx, NULL);
}
