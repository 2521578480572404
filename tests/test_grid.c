/* SPDX-License-Identifier: Apache-2.0 */
/* Grid coherence on worlds that are worked by hand: what is traced, and what comes out. */
#include "grid_support.h"
#include "ledger.h"

/* ---------------------------------------------------------------------------------------------------------- orders */

/* Where all see all, only the pixels that begin are traced. */
static void pixels_that_begin(void **state)
{
    (void)state;
    const struct {
        uint32_t width, height;
        const char *mode;
        uint32_t begin;
    } cases[] = {
        {1, 1, "OPT", 1},
        {2, 1, "OPT", 2},
        {1, 17, "OPT", 2},
        {1, 18, "OPT", 3}, /* 0, 16 and the last */
        {17, 13, "OPT", 4},
        {17, 13, "OPT,spacing=8", 3 * 3},
        {64, 64, "OPT", 5 * 5},
        {65, 65, "OPT", 5 * 5},
        {65, 65, "GNB,spacing=32", 3 * 3},
        {100, 3, "GNU,spacing=2", 51 * 2}, /* the last of 100 is odd */
        {200, 150, "OPT", 14 * 11},
        {17, 13, "SNU", 17 + 13 - 1},
        {1, 9, "SNU", 9},
        {17, 13, "TRUE", 17 * 13},
        {17, 13, "EYE", 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        world w = world_new(cases[i].width, cases[i].height, six, NULL, SIX);
        run_mode(&w, cases[i].mode);
        if (full_pixels(&w) != cases[i].begin || w.statistics.traced != 6 * cases[i].begin)
            fail_msg("%u x %u, %s: %u pixels, %u rays", cases[i].width, cases[i].height, cases[i].mode, full_pixels(&w),
                     (unsigned)w.statistics.traced);
        for (size_t k = 0; k < (size_t)w.width * w.height * SIX; k++)
            assert_true(w.answer[k]);
        assert_int_equal(w.statistics.pixels, w.width * w.height);
        assert_int_equal(w.statistics.asked, 6 * w.width * w.height);
        assert_int_equal(w.statistics.silhouette, 0);
        world_free(&w);
    }
}

/* A light that one corner does not see is in doubt where that corner informs, and only there. */
static void who_informs(void **state)
{
    (void)state;
    world w = world_new(5, 5, six, NULL, SIX);
    block(&w, 4, 0, PX);
    run_mode(&w, "FLO,spacing=4");
    assert_traced(&w, 2, 2, BIT(PX) | BESIDE_X); /* informed by all corners */
    assert_traced(&w, 2, 0, BIT(PX) | BESIDE_X); /* by 0 0, 4 0 and 2 2 */
    assert_traced(&w, 4, 2, BIT(PX) | BESIDE_X);
    assert_traced(&w, 0, 2, 0);
    assert_traced(&w, 3, 1, BIT(PX) | BESIDE_X); /* by 2 0, 4 0, 2 2, 4 2 */
    assert_traced(&w, 1, 1, 0);
    assert_traced(&w, 3, 0, BIT(PX)); /* finest step: no flooding */
    assert_traced(&w, 4, 1, BIT(PX));
    assert_traced(&w, 2, 1, 0);
    assert_traced(&w, 4, 3, 0);
    world_free(&w);
}

/* ----------------------------------------------------------------------------------------------------- uncertainty */

static void uncertainty(void **state)
{
    (void)state;
    world w = three();
    block(&w, 0, 0, PX);
    /* the middle sees it */
    run_mode(&w, "GNU,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX) | BESIDE_X);
    assert_traced(&w, 1, 0, BIT(PX) | BESIDE_X);
    assert_traced(&w, 2, 1, 0);
    assert_traced(&w, 1, 2, 0);
    assert_int_equal(w.statistics.uncertain, 3);
    assert_int_equal(w.statistics.flooded, 12);
    assert_int_equal(w.statistics.surprises, 0);
    run_mode(&w, "FLO,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX) | BESIDE_X);
    assert_traced(&w, 1, 0, BIT(PX));
    run_mode(&w, "OPT,spacing=2"); /* seen, and so are its neighbours as predicted: nothing to flood to */
    assert_traced(&w, 1, 1, BIT(PX));
    run_mode(&w, "RES,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX));
    assert_traced(&w, 1, 0, BIT(PX));
    /* the middle does not */
    block(&w, 1, 1, PX);
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX) | BESIDE_X);
    assert_traced(&w, 1, 0, BIT(PX));
    run_mode(&w, "RES,spacing=2"); /* 1 0 sees it again */
    assert_traced(&w, 1, 0, BIT(PX));
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PX));
    world_free(&w);
}

/* Flooding goes on from rays that surprise, and from no others. */
static void flooding(void **state)
{
    (void)state;
    world w = three();
    block(&w, 0, 0, PX);
    block(&w, 1, 1, PY); /* between corners that see it */
    run_mode(&w, "GNU,spacing=2");
    assert_traced(&w, 1, 1, ALL_SIX); /* +y touches -x */
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PY));
    assert_int_equal(w.statistics.surprises, 1);
    run_mode(&w, "OPT,spacing=2"); /* what floods does not reach it */
    assert_traced(&w, 1, 1, BIT(PX));
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX);
    block(&w, 1, 1, PX);
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 1, 1, ALL_SIX);
    run_mode(&w, "OPT,spacing=2,rounds=1");
    assert_traced(&w, 1, 1, ALL_SIX & ~BIT(NX));
    world_free(&w);

    /* a prediction of blocked that is refuted floods to what is taken for blocked, and not to what is seen */
    w = three();
    block_corners(&w, PY);
    block_corners(&w, PZ);
    block(&w, 0, 0, PX);
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX) | BIT(PY) | BIT(PZ));
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX);
    world_free(&w);
}

/* -------------------------------------------------------------------------------------------------------- boundary */

static void boundaries(void **state)
{
    (void)state;
    world w = three();
    block_corners(&w, PX);
    block(&w, 1, 1, PX);
    run_mode(&w, "GNB,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX) | BESIDE_X);
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PX));
    run_mode(&w, "GNU,spacing=2"); /* all agree */
    assert_traced(&w, 1, 1, 0);
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PX));
    block(&w, 1, 1, PY); /* surprises at the boundary: -x follows */
    run_mode(&w, "GNB,spacing=2");
    assert_traced(&w, 1, 1, ALL_SIX);
    world_free(&w);

    w = three(); /* one blocker of four */
    block(&w, 0, 0, PX);
    run_mode(&w, "GNB,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX) | BESIDE_X); /* taken for blocked */
    run_mode(&w, "GNB,spacing=2,threshold=1.5");
    assert_traced(&w, 1, 1, 0);
    block(&w, 2, 0, PX);
    run_mode(&w, "GNB,spacing=2,threshold=1.5");
    assert_true(traced_at(&w, 1, 1) != 0);
    run_mode(&w, "GNB,spacing=2,threshold=2");
    assert_traced(&w, 1, 1, 0);
    world_free(&w);
}

/* Scanline order: a shadow that rises out of no boundary is missed, but at the horizon (report, Sect. 3.2). */
static void scanline(void **state)
{
    (void)state;
    world w = three();
    block(&w, 1, 1, PX);
    block(&w, 2, 1, PX);
    block(&w, 1, 2, PX);
    block(&w, 2, 2, PX);
    run_mode(&w, "SNB");
    assert_traced(&w, 1, 1, 0);
    assert_int_equal(visible_at(&w, 2, 2), ALL_SIX); /* wrong, and it spreads */
    run_mode(&w, "SNU");
    assert_int_equal(visible_at(&w, 2, 2), ALL_SIX);
    for (uint32_t i = 0; i < 9; i++)
        w.below[(size_t)i * SIX + NY] = 1;
    run_mode(&w, "SNB");
    assert_traced(&w, 1, 1, ALL_SIX & ~BIT(NY)); /* the horizon, and then +y for the sake of +x */
    assert_int_equal(visible_at(&w, 2, 2), ALL_SIX & ~BIT(NY) & ~BIT(PX));
    run_mode(&w, "GNB,spacing=2"); /* the corner 2 2 knows of the shadow; the horizon alone is no reason */
    assert_traced(&w, 1, 0, BIT(PX) | BIT(PY) | BIT(PZ) | BIT(NZ));
    world_free(&w);

    w = three(); /* two informing pixels of three agree */
    block(&w, 1, 0, PX);
    run_mode(&w, "SNU");
    assert_traced(&w, 1, 1, BIT(PX) | BESIDE_X);
    world_free(&w);
}

/* ------------------------------------------------------------------------------- objects, horizons, empty pixels */

static void objects(void **state)
{
    (void)state;
    world w = three();
    w.object[8] = 1;
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 1, 1, ALL_SIX);
    assert_traced(&w, 2, 1, ALL_SIX);
    assert_traced(&w, 1, 2, ALL_SIX);
    assert_traced(&w, 1, 0, 0);
    assert_int_equal(w.statistics.silhouette, 18);
    w.object[8] = 0;
    w.empty[8] = 1;
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 1, 1, ALL_SIX);
    assert_traced(&w, 2, 2, 0);
    assert_int_equal(visible_at(&w, 2, 2), 0);
    assert_int_equal(w.statistics.pixels, 8);
    world_free(&w);
}

/* Three informers that are near are enough; who does not see a light for the horizon does not see it. */
static void near(void **state)
{
    (void)state;
    world w = three();
    w.object[8] = 1;
    run_mode(&w, "NEAR,spacing=2");
    assert_traced(&w, 1, 1, 0);
    assert_traced(&w, 2, 1, ALL_SIX); /* on the border there are but three */
    w.object[6] = 2;
    run_mode(&w, "NEAR,spacing=2");
    assert_traced(&w, 1, 1, ALL_SIX); /* two are not */
    assert_traced(&w, 0, 1, ALL_SIX); /* one of three on the border */
    w.object[6] = 0;
    run_mode(&w, "OPT,spacing=2,near=1"); /* the middle is informed from farther away */
    assert_traced(&w, 1, 1, ALL_SIX);
    w.object[8] = 0;

    w.below[pair_at(&w, 0, 0, PX)] = w.below[pair_at(&w, 2, 0, PX)] = 1;
    run_mode(&w, "NEAR,spacing=2"); /* others see it */
    assert_traced(&w, 1, 1, BIT(PX));
    w.blocked[pair_at(&w, 0, 2, PX)] = w.blocked[pair_at(&w, 2, 2, PX)] = w.blocked[pair_at(&w, 1, 1, PX)] = 1;
    run_mode(&w, "NEAR,spacing=2");
    assert_traced(&w, 1, 1, 0);
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PX));
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX));
    w.below[pair_at(&w, 0, 2, PX)] = 1;
    run_mode(&w, "NEAR,spacing=2"); /* one says so, three do not know */
    assert_traced(&w, 1, 1, BIT(PX));
    world_free(&w);
}

static void horizons(void **state)
{
    (void)state;
    world w = three();
    w.below[pair_at(&w, 0, 0, PX)] = 1; /* unknown there */
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 0, 0, ALL_SIX & ~BIT(PX));
    assert_traced(&w, 1, 1, BIT(PX));
    assert_traced(&w, 1, 0, BIT(PX));
    assert_traced(&w, 2, 1, 0);
    assert_int_equal(visible_at(&w, 0, 0), ALL_SIX & ~BIT(PX));
    run_mode(&w, "GNB,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX));
    run_mode(&w, "GWU,spacing=2");
    assert_traced(&w, 1, 1, BIT(PX) | BESIDE_X);
    w.below[pair_at(&w, 1, 1, PX)] = 1; /* nobody asks */
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 1, 1, 0);
    world_free(&w);
}

/* ---------------------------------------------------------------------------------------------------------- bright */

static void bright_lights(void **state)
{
    (void)state;
    const float energy[SIX] = {1, 1, 1, 1, 1, 5};
    world w = world_new(3, 3, six, energy, SIX);
    block_corners(&w, PX);
    block(&w, 1, 1, PX);
    block(&w, 1, 1, NZ);
    run_mode(&w, "OPT,spacing=2");
    assert_traced(&w, 1, 1, 0);
    run_mode(&w, "OPT,spacing=2,bright=1"); /* -z is beside +x, which is taken for blocked; it surprises */
    assert_traced(&w, 1, 1, BIT(NZ) | BIT(NX) | BIT(PY) | BIT(NY));
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PX) & ~BIT(NZ));
    world_free(&w);
}

/* --------------------------------------------------------------------------------------------------- configuration */

static void names(void **state)
{
    (void)state;
    char message[VCACHE_MESSAGE_BYTES];
    for (const char *const *name = vcache_grid_mode_names(); *name; name++) {
        vcache_grid_config f = vcache_grid_default_config();
        f.spacing = 8;
        f.bright = 3;
        assert_true(vcache_grid_parse_mode(*name, &f, message));
        assert_true(f.spacing == 8 && f.bright == 3);
        bool scan = (*name)[0] == 'S', other = strlen(*name) == 3 && !strchr("SG", (*name)[0]);
        assert_int_equal(f.order, strcmp(*name, "TRUE") == 0  ? VCACHE_GRID_TRUE
                                  : strcmp(*name, "EYE") == 0 ? VCACHE_GRID_EYE
                                  : scan                      ? VCACHE_GRID_SCANLINE
                                                              : VCACHE_GRID_GRID);
        assert_int_equal(f.warping, !other && (*name)[1] == 'W');
        assert_int_equal(f.boundary, !other && (*name)[2] == 'B');
        bool near = strcmp(*name, "NEAR") == 0, optimized = near || strcmp(*name, "OPT") == 0;
        assert_int_equal(f.restricted, optimized || strcmp(*name, "RES") == 0);
        assert_int_equal(f.flood, near ? 2 : optimized || strcmp(*name, "FLO") == 0);
        assert_int_equal(f.near, near ? 2 : 0);
    }
    vcache_grid_config f = mode_of("GNB,spacing=32,rounds=2,bright=9,threshold=2.5,flood=4,near=3");
    assert_true(f.flood == 4 && f.near == 3 && f.spacing == 32 && f.rounds == 2 && f.bright == 9 &&
                f.threshold == 2.5f && f.boundary);
    const char *const bad[] = {"",
                               "opt",
                               "OPTIMAL",
                               "GN",
                               "OPT,",
                               "OPT,ray=1",
                               "OPT,spacing=",
                               "OPT,spacing=3",
                               "OPT,spacing=x",
                               "OPT,spacing=128",
                               "OPT,rounds=-1",
                               "GNB,threshold=4",
                               "OPT,spacing=16x",
                               "OPT,flood=65",
                               "NEAR,near=-1",
                               "OPT spacing=16"};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        vcache_grid_config before = vcache_grid_default_config(), after = before;
        if (vcache_grid_parse_mode(bad[i], &after, message))
            fail_msg("\"%s\" was taken", bad[i]);
        assert_true(message[0] != 0 && memcmp(&before, &after, sizeof before) == 0);
    }
}

static void creation(void **state)
{
    (void)state;
    world w = three();
    vcache_grid *g = (vcache_grid *)&w;
    char message[VCACHE_MESSAGE_BYTES];
    vcache_grid_config good = vcache_grid_default_config(), f;
#define BAD(field, value, says)                                                                                        \
    do {                                                                                                               \
        f = good;                                                                                                      \
        f.field = value;                                                                                               \
        assert_int_equal(vcache_grid_create(&f, w.cells, &g, message), VCACHE_ERROR_ARGUMENT);                         \
        assert_null(g);                                                                                                \
        assert_non_null(strstr(message, says));                                                                        \
    } while (0)
    BAD(size, 1, "config.size");
    BAD(pixels, 0, "pixels is 0");
    BAD(pixels, (1u << 24) + 1, "pixels");
    BAD(order, (vcache_grid_order)9, "order");
    BAD(spacing, 0, "spacing is 0");
    BAD(spacing, 12, "spacing is 12");
    BAD(threshold, NAN, "threshold");
    BAD(threshold, -1.0f, "threshold is -1");
    BAD(rays, 5, "rays is 5");
    BAD(allocator.release, NULL, "allocator");
#undef BAD
    assert_int_equal(vcache_grid_create(NULL, w.cells, &g, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_grid_create(&good, NULL, &g, message), VCACHE_ERROR_ARGUMENT);
    assert_int_equal(vcache_grid_create(&good, w.cells, NULL, message), VCACHE_ERROR_ARGUMENT);
    vcache_grid_destroy(&g);
    vcache_grid_destroy(NULL);
    world_free(&w);
}

static void memory(void **state)
{
    (void)state;
    ledger book = {.fails = true};
    vcache_allocator a = {ledger_allocate, ledger_release, &book};
    vcache_grid_lights *l;
    vcache_grid *g;
    char message[VCACHE_MESSAGE_BYTES];
    assert_int_equal(vcache_grid_create_lights(six, NULL, SIX, &a, &l, message), VCACHE_ERROR_MEMORY);
    assert_null(l);
    book.fails = false;
    assert_int_equal(vcache_grid_create_lights(six, NULL, SIX, &a, &l, message), VCACHE_OK);
    assert_int_equal(book.blocks, 1);
    vcache_grid_config f = vcache_grid_default_config();
    f.allocator = a;
    book.fails = true;
    assert_int_equal(vcache_grid_create(&f, l, &g, message), VCACHE_ERROR_MEMORY);
    assert_null(g);
    book.fails = false;
    size_t before = book.bytes;
    assert_int_equal(vcache_grid_create(&f, l, &g, message), VCACHE_OK);
    assert_int_equal(book.bytes - before, vcache_grid_bytes(g));
    book.fails = true; /* nothing is allocated on the way */
    vcache_grid_begin(g, 3, 3);
    for (uint32_t i = 0; i < 9; i++)
        *vcache_grid_pixel(g, i % 3, i / 3, 0, NULL) = ALL_SIX;
    uint32_t count;
    vcache_answer answers[64] = {0};
    while (vcache_grid_next(g, &count), count > 0)
        vcache_grid_tell(g, answers, NULL);
    vcache_grid_destroy(&g);
    vcache_grid_destroy_lights(&l);
    assert_true(book.blocks == 0 && book.bytes == 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pixels_that_begin),
        cmocka_unit_test(who_informs),
        cmocka_unit_test(uncertainty),
        cmocka_unit_test(flooding),
        cmocka_unit_test(boundaries),
        cmocka_unit_test(scanline),
        cmocka_unit_test(objects),
        cmocka_unit_test(horizons),
        cmocka_unit_test(near),
        cmocka_unit_test(bright_lights),
        cmocka_unit_test(names),
        cmocka_unit_test(creation),
        cmocka_unit_test(memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
