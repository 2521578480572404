/* SPDX-License-Identifier: Apache-2.0 */
/* Grid coherence that warps blockers, on worlds that are worked by hand: into which cells they move, what is traced for
 * it, and what comes out. */
#include "grid_support.h"

static const float away[3] = {10, 0, 0}, above[3] = {0, 10, 0}, ahead[3] = {0, 0, 10};

static void move(world *w, uint32_t x, uint32_t y, const float to[3])
{
    memcpy(w->position[y * w->width + x], to, 3 * sizeof *to);
}

/* Lights traced and seen at each of 3 x 3 pixels. */
static void assert_decided(world *w, const char *mode, const uint64_t traced[9], const uint64_t visible[9])
{
    run_mode(w, mode);
    for (uint32_t i = 0; i < 9; i++) {
        uint64_t t = traced_at(w, i % 3, i / 3), v = visible_at(w, i % 3, i / 3);
        if (t != traced[i] || v != visible[i])
            fail_msg("%s, pixel %u %u: traced %02llx, not %02llx; visible %02llx, not %02llx", mode, i % 3, i / 3,
                     (unsigned long long)t, (unsigned long long)traced[i], (unsigned long long)v,
                     (unsigned long long)visible[i]);
    }
}

/* A light and those that it touches: all but the one behind it. */
static const uint64_t all = ALL_SIX, around_nx = ALL_SIX & ~BIT(PX), around_ny = ALL_SIX & ~BIT(PY),
                      around_pz = ALL_SIX & ~BIT(NZ), around_nz = ALL_SIX & ~BIT(PZ);
static const uint64_t no_nx = ALL_SIX & ~BIT(NX), no_ny = ALL_SIX & ~BIT(NY), no_pz = ALL_SIX & ~BIT(PZ),
                      no_nz = ALL_SIX & ~BIT(NZ);

/* Three informers of the middle find a blocker towards +z, at (0, 0, 1). From (10, 0, 0) it lies in the cell of -x,
 * from (0, 10, 0) in that of -y. */
static world moved(void)
{
    world w = three();
    block(&w, 0, 0, PZ);
    block(&w, 1, 0, PZ);
    block(&w, 0, 1, PZ);
    move(&w, 1, 1, away);
    move(&w, 2, 1, away);
    move(&w, 2, 2, above);
    return w;
}

static void scanline_uncertainty(void **state)
{
    (void)state;
    world w = moved();
    /* 1 1: three blockers in -x of three informers: blocked, not traced, and passed on.
     * 2 1: two in -x, from 1 1 and 1 0, none from 2 0: uncertain; whatever the ray finds floods, once: the others are
     *      seen as predicted.
     * 1 2: from the origin two in +z, from 1 1 and 0 1, none from 0 2: uncertain.
     * 2 2: one in -y, from 1 1; rays of 2 1 and 1 2 found none. */
    const uint64_t traced[9] = {all, all, all, all, 0, around_nx, all, around_pz, around_ny};
    const uint64_t visible[9] = {no_pz, no_pz, all, no_pz, no_nx, all, all, all, all};
    assert_decided(&w, "SWU", traced, visible);
    block(&w, 2, 1, NX); /* the ray finds a blocker, which from 2 2 lies in -y too: two */
    const uint64_t found[9] = {no_pz, no_pz, all, no_pz, no_nx, no_nx, all, all, all};
    assert_decided(&w, "SWU", traced, found);
    world_free(&w);

    w = three(); /* blockers are counted, not informers: two of 0 1 and one of 1 0 make three */
    block(&w, 0, 1, PZ);
    block(&w, 0, 1, PY);
    block(&w, 1, 0, PZ);
    move(&w, 1, 1, away);
    run_mode(&w, "SWU");
    assert_traced(&w, 1, 1, 0);
    assert_int_equal(visible_at(&w, 1, 1), no_nx);
    w.blocked[pair_at(&w, 1, 0, PZ)] = 0; /* two do not */
    run_mode(&w, "SWU");
    assert_traced(&w, 1, 1, around_nx);
    assert_int_equal(visible_at(&w, 1, 1), all);
    world_free(&w);
}

static void scanline_boundary(void **state)
{
    (void)state;
    world w = moved();
    /* 1 1: -x is taken for blocked, and lies at a boundary with the four that it touches; its ray finds no blocker.
     * 2 1: one in -x, from 1 0, is enough.
     * 1 2: from the origin one in +z, from 0 1.
     * 2 2: nothing left of which to know. */
    const uint64_t traced[9] = {all, all, all, all, around_nx, around_nx, all, around_pz, 0};
    const uint64_t visible[9] = {no_pz, no_pz, all, no_pz, all, all, all, all, all};
    assert_decided(&w, "SWB", traced, visible);
    const uint64_t few[9] = {all, all, all, all, around_nx, 0, all, 0, 0}; /* one is not more than one */
    assert_decided(&w, "SWB,threshold=1", few, visible);

    /* What the ray of 1 1 finds, (9, 0, 0), takes the place of what was warped there.
     * 2 1: from (8, 0, 0) it lies in +x, the blocker of 1 0 in -x: two blocked, and all others beside them.
     * 1 2: from the origin in +x, the blocker of 0 1 in +z.
     * 2 2: from (0, 10, 0) in -y. */
    block(&w, 1, 1, NX);
    move(&w, 2, 1, (const float[]){8, 0, 0});
    const uint64_t found[9] = {all, all, all, all, around_nx, all, all, all, around_ny};
    const uint64_t then[9] = {no_pz, no_pz, all, no_pz, no_nx, all, all, all, all};
    assert_decided(&w, "SWB", found, then);
    /* 2 1: (0, 0, 1) twice in -x, from 1 1 that did not trace, and 1 0; 1 2 and 2 2 as without the blocker */
    const uint64_t uncertain[9] = {all, all, all, all, 0, around_nx, all, around_pz, around_ny};
    assert_decided(&w, "SWU", uncertain, then);
    world_free(&w);
}

/* Below an informer's horizon: unknown. Below the pixel's own: lights that touch those are traced by SWB. */
static void scanline_horizons(void **state)
{
    (void)state;
    world w = three();
    w.below[pair_at(&w, 1, 0, NY)] = 1;
    run_mode(&w, "SWU"); /* nobody agrees on it: it floods */
    assert_traced(&w, 1, 1, around_ny);
    run_mode(&w, "SWB"); /* no blocker in its cell: taken for visible, and it is */
    assert_traced(&w, 1, 1, BIT(NY));
    block(&w, 1, 1, NY);
    run_mode(&w, "SWB");
    assert_traced(&w, 1, 1, around_ny);
    assert_int_equal(visible_at(&w, 1, 1), no_ny);
    world_free(&w);

    w = three();
    w.below[pair_at(&w, 1, 1, NY)] = 1;
    run_mode(&w, "SWU");
    assert_traced(&w, 1, 1, 0);
    run_mode(&w, "SWB");
    assert_traced(&w, 1, 1, BIT(PX) | BIT(NX) | BIT(PZ) | BIT(NZ));
    block(&w, 1, 1, PZ); /* what rises over the horizon is found, and +y for its sake */
    run_mode(&w, "SWB");
    assert_traced(&w, 1, 1, no_ny);
    assert_int_equal(visible_at(&w, 1, 1), no_ny & no_pz);
    world_free(&w);

    w = moved(); /* blockers go below the horizon: no light is blocked by them */
    w.below[pair_at(&w, 1, 1, NX)] = 1;
    run_mode(&w, "SWU");
    assert_traced(&w, 1, 1, 0);
    assert_int_equal(visible_at(&w, 1, 1), no_nx);
    run_mode(&w, "SWB");
    assert_traced(&w, 1, 1, BESIDE_X);
    world_free(&w);
}

/* All corners find a blocker at (0, 0, 1), which each other pixel sees elsewhere: the middle and 1 0 in -x, 0 1 in +z,
 * 2 1 in -y, 1 2 in -z. Edges have three informers: two corners and the middle. */
static world corners(void)
{
    world w = three();
    block_corners(&w, PZ);
    move(&w, 1, 1, away);
    move(&w, 1, 0, away);
    move(&w, 2, 1, above);
    move(&w, 1, 2, ahead);
    return w;
}

static void grid_uncertainty(void **state)
{
    (void)state;
    world w = corners(); /* four of four; the middle passes it on: three of three */
    const uint64_t traced[9] = {all, 0, all, 0, 0, 0, all, 0, all};
    const uint64_t visible[9] = {no_pz, no_nx, no_pz, no_pz, no_nx, no_ny, no_pz, no_nz, no_pz};
    assert_decided(&w, "GWU,spacing=2", traced, visible);
    w.blocked[pair_at(&w, 2, 2, PZ)] = 0; /* three of four, and the ray finds none; two and one of three */
    const uint64_t more[9] = {all, around_nx, all, around_pz, around_nx, around_ny, all, around_nz, all};
    const uint64_t seen[9] = {no_pz, all, no_pz, all, all, all, no_pz, all, all};
    assert_decided(&w, "GWU,spacing=2", more, seen);
    /* The ray of the middle finds one at (9, 0, 0): the third in -x for 1 0, alone in +x for 0 1, beside that of 2 0 in
     * -y for 2 1, and that of 0 2 in -z for 1 2. */
    block(&w, 1, 1, NX);
    const uint64_t found[9] = {all, 0, all, all, around_nx, around_ny, all, around_nz, all};
    const uint64_t then[9] = {no_pz, no_nx, no_pz, all, no_nx, all, no_pz, all, all};
    assert_decided(&w, "GWU,spacing=2", found, then);
    world_free(&w);
}

static void grid_boundary(void **state)
{
    (void)state;
    world w = corners(); /* blocked where there is one, and traced with what it touches */
    const uint64_t traced[9] = {all, around_nx, all, around_pz, around_nx, around_ny, all, around_nz, all};
    const uint64_t visible[9] = {no_pz, all, no_pz, all, all, all, no_pz, all, no_pz};
    assert_decided(&w, "GWB,spacing=2", traced, visible);
    const uint64_t middle[9] = {all, 0, all, 0, around_nx, 0, all, 0, all}; /* edges have two left */
    assert_decided(&w, "GWB,spacing=2,threshold=2", middle, visible);
    /* 2 1, whose horizon hides +z: in grid order that is no reason to trace */
    w.below[pair_at(&w, 2, 1, PZ)] = 1;
    run_mode(&w, "GWB,spacing=2,threshold=2");
    assert_traced(&w, 2, 1, 0);
    world_free(&w);
}

/* Blockers one unit above the corners, seen from ten units aside, lie in another cell. */
static void distances(void **state)
{
    (void)state;
    world w = three();
    block_corners(&w, PZ);
    w.position[4][0] = 10.0f;
    run_mode(&w, "GWU,spacing=2");
    assert_traced(&w, 1, 1, 0);
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(NX));
    run_mode(&w, "GNU,spacing=2");
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PZ));
    w.distance = INFINITY; /* far away */
    run_mode(&w, "GWU,spacing=2");
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PZ));
    w.distance = 1000.0f;
    run_mode(&w, "GWU,spacing=2");
    assert_int_equal(visible_at(&w, 1, 1), ALL_SIX & ~BIT(PZ));

    w.distance = 1.0f; /* one of four */
    memset(w.blocked, 0, 9 * SIX);
    block(&w, 2, 2, PZ);
    run_mode(&w, "GWU,spacing=2");
    assert_traced(&w, 1, 1, BIT(NX) | BIT(PY) | BIT(NY) | BIT(PZ) | BIT(NZ));
    run_mode(&w, "GWB,spacing=2"); /* taken for blocked, and traced with its boundary */
    assert_traced(&w, 1, 1, BIT(NX) | BIT(PY) | BIT(NY) | BIT(PZ) | BIT(NZ));
    run_mode(&w, "GWB,spacing=2,threshold=1");
    assert_traced(&w, 1, 1, 0);
    world_free(&w);
}

/* Of the blockers in a cell the one nearest to its light is passed on. */
static void nearest_blocker(void **state)
{
    (void)state;
    world w = world_new(5, 1, six, NULL, SIX);
    for (uint32_t x = 0; x < 5; x++)
        block(&w, x, 0, PZ);
    w.position[0][0] = 0.4f; /* blockers at (0.4, 0, 1) and (-0.1, 0, 1): from the middle the second is nearer to +z */
    w.position[4][0] = -0.1f;
    /* pixel 3 has two informers: pixel 4 with (-0.1, 0, 1), pixel 2 with what it kept. From (-3, 0, 0) both lie in the
     * cell of +x; from (-0.8, 0, 0) (0.4, 0, 1) would lie in that of +x, (-0.1, 0, 1) in that of +z */
    w.position[3][0] = -0.8f;
    run_mode(&w, "GWU,spacing=4");
    assert_traced(&w, 2, 0, 0);
    assert_int_equal(visible_at(&w, 2, 0), ALL_SIX & ~BIT(PZ));
    assert_traced(&w, 3, 0, 0);
    assert_int_equal(visible_at(&w, 3, 0), ALL_SIX & ~BIT(PZ));

    w.position[0][0] = -0.1f; /* the same the other way round: the first of two is the nearer, and pixel 1 is told */
    w.position[4][0] = 0.4f;
    w.position[1][0] = -0.8f;
    run_mode(&w, "GWU,spacing=4");
    assert_traced(&w, 1, 0, 0);
    assert_int_equal(visible_at(&w, 1, 0), ALL_SIX & ~BIT(PZ));
    world_free(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scanline_uncertainty), cmocka_unit_test(scanline_boundary),
        cmocka_unit_test(scanline_horizons),    cmocka_unit_test(grid_uncertainty),
        cmocka_unit_test(grid_boundary),        cmocka_unit_test(distances),
        cmocka_unit_test(nearest_blocker),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
