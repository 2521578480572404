/* SPDX-License-Identifier: Apache-2.0 */
/* Two renderers, one direct light: paths of two edges by bidirectional path tracing, and whitted without virtual point
 * lights, from every kind of light. */
#include "bdpt_support.h"

#include "agreement.h"

static void direct_light(void **state)
{
    (void)state;
    for (int kind = 0; kind < ROOMS; kind++) {
        camera c = room_camera();
        stage g = stage_new(room_scene(kind), c, 16, 12);
        g.v.settings.edges = 2;
        tally both = stage_tally(&g, NULL, 600, 1), other = {0};
        for (uint64_t seed = 1; seed <= 200; seed++)
            tally_add(&other, whitted_direct(g.s, g.t, g.e, &c, 16, 12, seed));
        char name[32];
        snprintf(name, sizeof name, "light %d", kind);
        assert_same_mean(&both, &other, name);
        assert_true(tally_error(&both) < 0.02 * tally_mean(&both));
        stage_free(&g);
    }
}

int main(void)
{
    unsetenv("VCACHE_TEST_PART"); /* short, and close to its limits: all samples, in each suite */
    const struct CMUnitTest tests[] = {cmocka_unit_test(direct_light)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
