/* SPDX-License-Identifier: Apache-2.0 */
/* The same picture bit for bit, and the same rays, whatever the number of threads is and however they are scheduled;
 * but for a cache that threads share. */
#include "render_support.h"

#include "interrupt.h"
#include "metrics.h"

#include <signal.h>

static const int thread_counts[] = {2, 3, 7};

typedef struct mode {
    const char *name;
    visibility_mode visibility;
    bool words;
    float ce_samples;
    uint64_t bytes; /* of the cache: a small one evicts */
} mode;

static frame render(stage *g, const mode *m, int threads)
{
    settings *f = &g->v.settings;
    f->visibility = m->visibility;
    f->words = m->words;
    f->ce = 8.0f, f->ce_samples = m->ce_samples, f->ce_delta = 0.0f;
    f->rays = 3.0f;
    f->cache.table_bytes = m->bytes;
    f->threads = threads;
    frame out;
    message err = {{0}};
    if (!frame_render(&g->v, "test", true, NULL, NULL, &out, &err))
        fail_msg("%s", err.text);
    return out;
}

static void same_with_any_threads(void **state)
{
    (void)state;
    static const mode modes[] = {{"exact", VISIBILITY_EXACT, false, 0, 1 << 20},
                                 {"cache", VISIBILITY_CACHE, false, 0, 1 << 20},
                                 {"cache, small", VISIBILITY_CACHE, false, 4, 1 << 12},
                                 {"cache, words", VISIBILITY_CACHE, true, 4, 1 << 16},
                                 {"estimate", VISIBILITY_ESTIMATE, false, 0, 1 << 20},
                                 {"estimate, small", VISIBILITY_ESTIMATE, false, 0, 1 << 12},
                                 {"select", VISIBILITY_SELECT, false, 0, 1 << 20},
                                 {"select by cache", VISIBILITY_SELECT_BY_CACHE, false, 0, 1 << 20}};
    stage g = mixed_stage(200, 165, 1); /* 42 tiles in three regions, the last ones cut */
    g.v.settings.vpls = 32;             /* so many that estimates pay */
    g.v.settings.light_samples = g.v.settings.env_samples = 1;
    for (size_t m = 0; m < sizeof modes / sizeof *modes; m++) {
        frame first = render(&g, &modes[m], 1);
        assert_true(first.complete && first.rays.traced > 0);
        assert_true((first.rays.traced < first.rays.asked) == (modes[m].visibility != VISIBILITY_EXACT));
        for (size_t t = (size_t)case_step() - 1; t < sizeof thread_counts / sizeof *thread_counts;
             t += (size_t)case_step()) {
            frame f = render(&g, &modes[m], thread_counts[t]);
            if (!same_images(&f.image, &first.image) || f.rays.traced != first.rays.traced ||
                f.rays.asked != first.rays.asked)
                fail_msg("%s, %d threads: another picture, or %llu rays of %llu instead of %llu", modes[m].name,
                         thread_counts[t], (unsigned long long)f.rays.traced, (unsigned long long)f.rays.asked,
                         (unsigned long long)first.rays.traced);
            frame_free(&f);
        }
        frame_free(&first);
    }
    stage_free(&g);
}

/* One cache for all threads, written to in any order: another picture each time, and as good. */
static void threads_share_a_cache(void **state)
{
    (void)state;
    static const mode modes[] = {{"exact", VISIBILITY_EXACT, false, 0, 1 << 20},
                                 {"rows", VISIBILITY_CACHE, false, 4, 1 << 20},
                                 {"words", VISIBILITY_CACHE, true, 4, 1 << 20}};
    stage g = mixed_stage(200, 165, 1); /* three regions, a thread each */
    frame exact = render(&g, &modes[0], 1);
    for (size_t m = 1; m < sizeof modes / sizeof *modes; m++) {
        g.v.settings.shared = false;
        frame own = render(&g, &modes[m], 1);
        double error = image_compare(&own.lit, &exact.lit).mean_relative;
        g.v.settings.shared = true;
        for (int threads = 1; threads <= 7; threads += 3 * case_step()) {
            frame f = render(&g, &modes[m], threads);
            double shared = image_compare(&f.lit, &exact.lit).mean_relative;
            print_message("%s, %d threads: %llu rays, error %.2f %%; a cache for each region: %llu, %.2f %%\n",
                          modes[m].name, threads, (unsigned long long)f.rays.traced, 100.0 * shared,
                          (unsigned long long)own.rays.traced, 100.0 * error);
            assert_true(f.rays.asked == own.rays.asked && f.rays.traced < own.rays.traced * 5 / 4);
            if (threads == 1) /* what one region learnt, the next one knows */
                assert_true(f.rays.traced < own.rays.traced);
            assert_true(shared < 1.25 * error);
            frame_free(&f);
        }
        frame_free(&own);
    }
    frame_free(&exact);
    stage_free(&g);
}

/* No memory for the cache of a region: an error that says so, for any number of threads. */
static void *no_memory(void *context, size_t bytes)
{
    (void)context, (void)bytes;
    return NULL;
}

static void release_nothing(void *context, void *memory, size_t bytes)
{
    (void)context, (void)memory, (void)bytes;
}

static void memory_runs_out(void **state)
{
    (void)state;
    stage g = mixed_stage(230, 200, 1);
    g.v.settings.cache.allocator = (vcache_allocator){no_memory, release_nothing, NULL};
    g.v.settings.visibility = VISIBILITY_CACHE;
    g.v.settings.ce = 8.0f;
    for (int threads = 1; threads <= 3; threads++) {
        g.v.settings.threads = threads;
        frame f;
        message err = {{0}};
        assert_false(frame_render(&g.v, "test", true, NULL, NULL, &f, &err));
        assert_non_null(strstr(err.text, "no memory"));
        frame_free(&f);
    }
    stage_free(&g);
}

/* Nothing in place of a black image. Last: it stays interrupted. */
static void interrupted_before_it_begins(void **state)
{
    (void)state;
    stage g = mixed_stage(64, 64, 1);
    interrupt_install();
    raise(SIGINT);
    g.v.settings.tolerance = 0.1f, g.v.settings.certainty = 0.5f;
    g.v.settings.lattice = true;
    assert_true(grid_parse(NULL, &g.v.settings, NULL));
    for (int m = 0; m < VISIBILITY_MODES; m++) {
        frame f = render(&g, &(mode){.visibility = (visibility_mode)m, .bytes = 1 << 20}, 2);
        assert_true(!f.image.pixels && !f.lit.pixels && !f.complete);
    }
    stage_free(&g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(same_with_any_threads), cmocka_unit_test(threads_share_a_cache),
                                       cmocka_unit_test(memory_runs_out),
                                       cmocka_unit_test(interrupted_before_it_begins)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
