/* SPDX-License-Identifier: Apache-2.0 */
/* What the plain cache spends its rays on: lights worth refining, and when it steps aside. */
#include "render_support.h"

/* The virtual point lights that are not refined hold at most `refine_above` of the light of an eye sample. */
static void refining_is_bounded(void **state)
{
    (void)state;
    stage g = mixed_stage(TILE, TILE, 1);
    static const float shares[] = {0.1f, 0.5f, 1.0f, 4.0f};
    for (int k = 0; k < 4; k++) {
        stage_mode(&g, 8.0f);
        g.v.settings.refine_above = shares[k];
        vpl_set vpls = vpls_new(&g.v);
        chunk c;
        chunk_new(&c, &g.v, &vpls, g.v.scene->light_count);
        eye_samples samples = {0};
        tile_pixels *pixels = xcalloc(1, sizeof *pixels);
        eye_paths(&g.v, (tile){0, 0, TILE, TILE, 0}, 0, 1, &samples, pixels);
        uint64_t refined = 0, coarse = 0;
        for (size_t i = 0; i < samples.count; i += CHUNK) {
            for (c.count = 0; c.count < CHUNK && i + c.count < samples.count; c.count++)
                c.eyes[c.count] = &samples.items[i + c.count];
            shade_unoccluded(&g.v, &vpls, &c);
            const pair_bits *b = &c.bits[LIGHTS_VIRTUAL];
            for (uint32_t e = 0; e < c.count; e++) {
                double all = 0.0, left_out = 0.0;
                for (uint32_t l = 0; l < vpls.count; l++) {
                    size_t word = (size_t)e * b->words + l / 64;
                    if (!(b->asked[word] >> l % 64 & 1))
                        continue;
                    double f = (double)c.geometry[(size_t)e * vpls.padded + l] * (double)vpls.luminance[l];
                    bool refine = b->refine[word] >> l % 64 & 1;
                    all += f, left_out += refine ? 0.0 : f;
                    refined += refine, coarse += !refine;
                }
                assert_true(left_out <= (double)shares[k] * all * 1.00001);
            }
        }
        assert_true(refined > 100 && coarse > 100);
        chunk_free(&c);
        vpls_free(&vpls);
        free(samples.items);
        free(pixels);
    }
    stage_free(&g);
}

/* Cells so small that nothing is shared: after the first pass the exact packets take over, for longer and longer, and
 * where cells are shared again they step back. */
static void steps_aside(void **state)
{
    (void)state;
    stage g = mixed_stage(8 * TILE, 8 * TILE, 1);
    stage_mode(&g, 8.0f);
    g.v.settings.ce_delta = g.v.settings.ce_samples = 0.0f;
    vpl_set vpls = vpls_new(&g.v);
    caches used = {0};
    assert_true(caches_new(&g.v, &vpls, &used, NULL));
    visibility *o = visibility_new(&g.v, &vpls, &used);
    chunk c;
    chunk_new(&c, &g.v, &vpls, g.v.scene->light_count);
    eye_samples samples = {0};
    tile_pixels *pixels = xcalloc(1, sizeof *pixels);
    eye_paths(&g.v, (tile){3 * TILE, 4 * TILE, TILE, TILE, 0}, 0, 1, &samples, pixels);
    /* 10 passes of tiny cells, 10 of large ones */
    char what[64] = "";
    for (int pass = 0; pass < 20; pass++) {
        g.v.settings.ce = pass < 10 ? 0.01f : 8.0f;
        bool aside = visibility_steps_aside(o);
        strcat(what, aside ? "x" : "c");
        ray_counts before = visibility_counts(o);
        for (size_t i = 0; i < samples.count; i += CHUNK) {
            for (c.count = 0; c.count < CHUNK && i + c.count < samples.count; c.count++)
                c.eyes[c.count] = &samples.items[i + c.count];
            shade_unoccluded(&g.v, &vpls, &c);
            visibility_resolve(o, &c, pixels);
        }
        ray_counts after = visibility_counts(o);
        if (aside)
            assert_true(after.traced - before.traced == after.asked - before.asked);
        if (pass < 10)
            vcache_clear(used.table);
    }
    assert_string_equal(what, "cxxcxxxxcxxxxxxxxccc");
    visibility_free(o);
    chunk_free(&c);
    caches_free(&used);
    vpls_free(&vpls);
    free(samples.items);
    free(pixels);
    stage_free(&g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(refining_is_bounded),
        cmocka_unit_test(steps_aside),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
