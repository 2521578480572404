/* SPDX-License-Identifier: Apache-2.0 */
/* Parallel loops, interruption, progress line. Meant to run under ThreadSanitizer as well. */
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>
#include <cmocka.h>

#include "interrupt.h"
#include "parallel.h"
#include "progress.h"

enum { count = 20000 };

typedef struct tally {
    atomic_int calls[count];
    long per_thread[PARALLEL_MAX_THREADS]; /* not atomic: one thread each */
    atomic_int busy[PARALLEL_MAX_THREADS];
    atomic_int highest_thread, clashes, total;
    int stop_after;
    atomic_bool stop;
} tally;

static tally *new_tally(void)
{
    tally *t = calloc(1, sizeof *t);
    assert_non_null(t);
    return t;
}

static void record(void *ctx, int thread, size_t index)
{
    tally *t = ctx;
    if (atomic_exchange(&t->busy[thread], 1))
        atomic_fetch_add(&t->clashes, 1);
    atomic_fetch_add(&t->calls[index], 1);
    t->per_thread[thread]++;
    int highest = atomic_load(&t->highest_thread);
    while (thread > highest && !atomic_compare_exchange_weak(&t->highest_thread, &highest, thread))
        continue;
    if (atomic_fetch_add(&t->total, 1) + 1 >= t->stop_after)
        atomic_store(&t->stop, true);
    atomic_store(&t->busy[thread], 0);
}

static void each_index_once(void **state)
{
    (void)state;
    static const int threads[] = {1, 2, 7, 64, 0, -5, 100000};
    for (size_t k = 0; k < sizeof threads / sizeof *threads; k++) {
        tally *t = new_tally();
        parallel_for(threads[k], count, record, t);
        long sum = 0;
        for (int i = 0; i < count; i++)
            assert_int_equal(t->calls[i], 1);
        for (int i = 0; i < PARALLEL_MAX_THREADS; i++)
            sum += t->per_thread[i];
        assert_int_equal(sum, count);
        assert_int_equal(t->clashes, 0);
        assert_true(t->highest_thread < parallel_thread_count(threads[k]));
        free(t);
    }
}

static void thread_counts(void **state)
{
    (void)state;
    assert_in_range(parallel_default_threads(), 1, PARALLEL_MAX_THREADS);
    assert_int_equal(parallel_thread_count(0), parallel_default_threads());
    assert_int_equal(parallel_thread_count(-1), parallel_default_threads());
    assert_int_equal(parallel_thread_count(3), 3);
    assert_int_equal(parallel_thread_count(1000000), PARALLEL_MAX_THREADS);
}

static void few_indices(void **state)
{
    (void)state;
    tally *t = new_tally();
    assert_true(parallel_for_until(8, 0, record, t, NULL));
    assert_int_equal(t->total, 0);
    assert_true(parallel_for_until(8, 3, record, t, NULL));
    assert_int_equal(t->total, 3);
    free(t);
}

/* All four wait for each other: passes only where they run at the same time, each under its own number. */
static void meet(void *ctx, int thread, size_t index)
{
    (void)index;
    atomic_int *present = ctx;
    atomic_fetch_or(present, 1 << thread);
    time_t give_up = time(NULL) + 10;
    while (atomic_load(present) != 0xf && time(NULL) < give_up)
        nanosleep(&(struct timespec){.tv_nsec = 100000}, NULL);
}

static void threads_run_at_the_same_time(void **state)
{
    (void)state;
    atomic_int present = 0;
    time_t begin = time(NULL);
    parallel_for(4, 4, meet, &present);
    assert_int_equal(present, 0xf);
    assert_true(time(NULL) - begin < 10);
}

static void stop_flag(void **state)
{
    (void)state;
    enum { threads = 4 };
    tally *t = new_tally();
    t->stop_after = 100;
    assert_false(parallel_for_until(threads, count, record, t, &t->stop));
    assert_in_range(t->total, 100, 100 + threads); /* those already handed out still run */
    assert_false(parallel_for_until(threads, count, record, t, &t->stop));
    assert_in_range(t->total, 100, 100 + threads);
    free(t);

    t = new_tally();
    t->stop_after = count; /* too late to matter */
    assert_true(parallel_for_until(threads, count, record, t, &t->stop));
    free(t);
}

static void interrupt_once(void *ctx, int thread, size_t index)
{
    record(ctx, thread, index);
    if (index == 50)
        kill(getpid(), SIGINT);
}

/* Runs `child` in a process of its own; returns its wait status. */
static int in_child(void (*child)(void))
{
    pid_t pid = fork();
    assert_true(pid >= 0);
    if (pid == 0) {
        child();
        _exit(99);
    }
    int status;
    while (waitpid(pid, &status, 0) < 0)
        assert_int_equal(errno, EINTR);
    return status;
}

static void loop_until_signal(void)
{
    tally *t = calloc(1, sizeof *t);
    if (!t)
        _exit(1);
    interrupt_install();
    if (interrupted())
        _exit(2);
    bool all = parallel_for_until(1, count, interrupt_once, t, NULL);
    _exit(!all && interrupted() && t->total == 51 ? 0 : 3);
}

static void two_interrupts(void)
{
    interrupt_install();
    raise(SIGINT);
    if (!interrupted())
        _exit(1);
    raise(SIGINT);
}

static void interrupt_and_terminate(void)
{
    interrupt_install();
    raise(SIGINT);
    raise(SIGTERM);
}

static void ignored_stays_ignored(void)
{
    signal(SIGINT, SIG_IGN);
    interrupt_install();
    raise(SIGINT);
    raise(SIGINT);
    _exit(interrupted() ? 1 : 0);
}

static void signals(void **state)
{
    (void)state;
    int status = in_child(loop_until_signal);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    status = in_child(two_interrupts);
    assert_true(WIFSIGNALED(status));
    assert_int_equal(WTERMSIG(status), SIGINT);
    status = in_child(interrupt_and_terminate);
    assert_true(WIFSIGNALED(status));
    assert_int_equal(WTERMSIG(status), SIGTERM);
    status = in_child(ignored_stays_ignored);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    assert_false(interrupted());
}

static void add_slowly(void *ctx, int thread, size_t index)
{
    (void)thread, (void)index;
    nanosleep(&(struct timespec){.tv_nsec = 10000000}, NULL);
    progress_add(ctx, 1);
}

static void progress_on_a_terminal(void **state)
{
    (void)state;
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0)
        skip(); /* no pseudo-terminals here */
    int terminal = open(ptsname(master), O_RDWR | O_NOCTTY), old = dup(STDERR_FILENO);
    assert_true(terminal >= 0 && old >= 0);

    struct timespec begin, end;
    clock_gettime(CLOCK_MONOTONIC, &begin);
    dup2(terminal, STDERR_FILENO);
    progress *quiet = progress_new("render", 100, true), *p = progress_new("render", 100, false);
    parallel_for(4, 100, add_slowly, p); /* a quarter of a second at least */
    progress_free(p);
    dup2(old, STDERR_FILENO);
    clock_gettime(CLOCK_MONOTONIC, &end);
    assert_null(quiet);
    assert_non_null(p);

    char out[4096] = "";
    size_t used = 0;
    struct pollfd readable = {.fd = master, .events = POLLIN};
    while (used + 1 < sizeof out && !strstr(out, "\r\033[K") && poll(&readable, 1, 5000) > 0) {
        ssize_t n = read(master, out + used, sizeof out - 1 - used);
        assert_true(n > 0);
        used += (size_t)n;
        out[used] = '\0';
    }
    assert_non_null(strstr(out, "\rrender "));
    assert_non_null(strstr(out, " %  0:0"));
    assert_non_null(strstr(out, " left"));
    assert_non_null(strstr(out, "\r\033[K")); /* cleared */
    int drawn = 0;
    for (const char *c = out; (c = strstr(c, "render")) != NULL; c++)
        drawn++;
    /* ten times a second, not at each step; the rest is slack */
    long tenths = 10 * (end.tv_sec - begin.tv_sec) + (end.tv_nsec - begin.tv_nsec) / 100000000;
    assert_in_range(drawn, 1, 2 * tenths + 4);
    close(terminal);
    close(old);
    close(master);
}

static void no_progress_elsewhere(void **state)
{
    (void)state;
    int old = dup(STDERR_FILENO), null = open("/dev/null", O_WRONLY);
    assert_true(old >= 0 && null >= 0);
    dup2(null, STDERR_FILENO);
    progress *p = progress_new("render", 100, false);
    dup2(old, STDERR_FILENO);
    assert_null(p);
    progress_add(p, 1); /* NULL is fine */
    progress_free(p);
    close(old);
    close(null);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_index_once),
        cmocka_unit_test(thread_counts),
        cmocka_unit_test(few_indices),
        cmocka_unit_test(threads_run_at_the_same_time),
        cmocka_unit_test(stop_flag),
        cmocka_unit_test(signals),
        cmocka_unit_test(progress_on_a_terminal),
        cmocka_unit_test(no_progress_elsewhere),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
