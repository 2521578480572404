/* SPDX-License-Identifier: Apache-2.0 */
/* Frames whose light samples are estimated against frames that trace all of them: the same light on average. Both draw
 * the same eye paths and light samples of a seed, so that their difference is the estimate's error alone. */
#include "render_support.h"

enum { SIZE = 12 };

/* Lamp, sky, glass, gloss and boxes; 4 samples an eye sample. */
static stage boxes(int vpls, float ce, uint64_t bytes)
{
    stage g = mixed_stage(SIZE, SIZE, 2);
    settings *f = &g.v.settings;
    f->vpls = vpls, f->ce = 4.0f, f->rays = 3.0f;
    f->light_samples = f->env_samples = 2;
    f->ce_samples = ce;
    f->cache.table_bytes = bytes;
    return g;
}

static frame render(stage *g, visibility_mode mode, uint64_t seed)
{
    frame f;
    message err = {{0}};
    g->v.settings.visibility = mode, g->v.settings.seed = seed;
    if (!frame_render(&g->v, "test", true, NULL, NULL, &f, &err))
        fail_msg("%s", err.text);
    for (size_t i = 0; i < (size_t)f.image.width * f.image.height; i++) {
        rgb p = f.image.pixels[i]; /* corrections may be negative */
        assert_true(isfinite(p.x) && isfinite(p.y) && isfinite(p.z));
        assert_true(f.traced_share[i] >= 0.0f && f.traced_share[i] <= 1.0f);
    }
    assert_true(f.complete && f.served == mode && f.rays.traced <= f.rays.asked);
    return f;
}

static double energy(const frame *f)
{
    double sum = 0.0;
    for (size_t i = 0; i < (size_t)f->lit.width * f->lit.height; i++)
        sum += (double)f->lit.pixels[i].x + (double)f->lit.pixels[i].y + (double)f->lit.pixels[i].z;
    return sum;
}

typedef struct outcome {
    tally difference;
    double exact, share; /* mean energy; of the rays that were traced */
} outcome;

static outcome compare(stage *g, uint64_t first, uint64_t seeds)
{
    outcome o = {.exact = 0.0};
    ray_counts all = {0};
    for (uint64_t seed = first; seed < first + seeds; seed++) {
        frame exact = render(g, VISIBILITY_EXACT, seed), few = render(g, VISIBILITY_ESTIMATE, seed);
        assert_true(same_images(&exact.seen, &few.seen));
        assert_true(exact.rays.asked == few.rays.asked);
        o.exact += energy(&exact) / (double)seeds;
        tally_add(&o.difference, energy(&few) - energy(&exact));
        all.asked += few.rays.asked, all.traced += few.rays.traced;
        frame_free(&exact);
        frame_free(&few);
    }
    o.share = (double)all.traced / (double)all.asked;
    return o;
}

/* 3 standard errors in two runs of other seeds. */
static bool biased(stage *g, uint64_t seeds, const char *what)
{
    for (uint64_t run = 0; run < 2; run++) {
        outcome o = compare(g, 1 + run * seeds, seeds);
        double mean = tally_mean(&o.difference), error = tally_error(&o.difference);
        print_message("%s: %+.2f standard errors of %.3f %%, %.1f %% of the rays\n", what, mean / error,
                      100.0 * error / o.exact, 100.0 * o.share);
        assert_true(error < 0.01 * o.exact && o.share < 0.9); /* else nothing would be seen */
        if (fabs(mean) <= 3.0 * error)
            return false;
    }
    return true;
}

/* Alone, and with virtual lights that are estimated too; too few of those are traced. */
static void light_samples(void **state)
{
    (void)state;
    for (int vpls = 0; vpls <= 100; vpls += 10 + 80 * (vpls > 0))
        for (float ce = 2.0f; ce < 100.0f; ce *= 32.0f) {
            stage g = boxes(vpls, ce, 1 << 16);
            char what[64];
            snprintf(what, sizeof what, "%d virtual lights, C_E %g", vpls, (double)ce);
            assert_false(biased(&g, 48, what));
            stage_free(&g);
        }
}

static void one_kind(void **state)
{
    (void)state;
    for (int kind = 0; kind < 2; kind++) {
        stage g = boxes(0, 16.0f, 1 << 16);
        (kind ? &g.v.settings.env_samples : &g.v.settings.light_samples)[0] = 0;
        assert_false(biased(&g, 48, kind ? "lamp" : "sky"));
        stage_free(&g);
    }
}

/* Of more than 64 bits a row; with a table of one word, that forgets all. */
static void many_samples_one_word(void **state)
{
    (void)state;
    stage g = boxes(0, 16.0f, 16);
    g.v.settings.light_samples = 70, g.v.settings.env_samples = 3, g.v.settings.spp = 1;
    assert_false(biased(&g, 16, "one word"));
    stage_free(&g);
}

/* What the first samples of a pixel find teaches the others, whose rays must not follow from it. */
static void samples_of_one_pixel(void **state)
{
    (void)state;
    stage g = boxes(0, 64.0f, 1 << 16);
    g.v.settings.width = g.v.settings.height = 1, g.v.camera.yfov = 0.3f;
    g.v.settings.spp = 80; /* two passes */
    assert_false(biased(&g, 500, "one pixel"));
    stage_free(&g);
}

static void threads_share(void **state)
{
    (void)state;
    stage g = boxes(100, 16.0f, 1 << 12);
    g.v.settings.threads = 3, g.v.settings.shared = true;
    g.v.settings.width = g.v.settings.height = 40; /* more than a tile */
    assert_false(biased(&g, 12, "threads"));
    stage_free(&g);
}

/* A table that remembers against one that forgets: fewer rays, and each brings more (n rays leave an error of about
 * 1 / sqrt(n)). */
static void learning_helps(void **state)
{
    (void)state;
    double error[2], rays[2];
    for (int words = 0; words < 2; words++) {
        stage g = boxes(0, 32.0f, words ? 1 << 20 : 16);
        g.v.settings.width = g.v.settings.height = 96, g.v.settings.spp = 4;
        frame exact = render(&g, VISIBILITY_EXACT, 1), few = render(&g, VISIBILITY_ESTIMATE, 1);
        error[words] = 0.0, rays[words] = (double)few.rays.traced;
        for (size_t i = 0; i < 96 * 96; i++)
            error[words] += fabs((double)few.lit.pixels[i].y - (double)exact.lit.pixels[i].y) * 3.0 / energy(&exact);
        frame_free(&exact);
        frame_free(&few);
        stage_free(&g);
    }
    print_message("error without memory %.2f %%, with %.2f %% of %.2f times the rays\n", 100.0 * error[0],
                  100.0 * error[1], rays[1] / rays[0]);
    double fewer = rays[1] / rays[0], less = error[1] / error[0];
    assert_true(fewer < 0.8 && less * less * fewer < 0.95);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(light_samples),         cmocka_unit_test(one_kind),
        cmocka_unit_test(many_samples_one_word), cmocka_unit_test(samples_of_one_pixel),
        cmocka_unit_test(threads_share),         cmocka_unit_test(learning_helps),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
