/* SPDX-License-Identifier: Apache-2.0 */
/* Keys are the same bits everywhere. */
#include "support.h"

static uint64_t mix_in(uint64_t sum, uint64_t value)
{
    return (sum ^ value) * 0x100000001b3u;
}

static uint64_t mix_double(uint64_t sum, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return mix_in(sum, bits);
}

/* 10,000 ends of every kind under every family and ten configs, into one number; and the coordinates behind their keys
 * into another, which shows a last bit that hardly ever takes a point across the border of its cell. Both must come out
 * the same with gcc and clang, with and without optimisation, on every machine; a change means that keys change. */
static void keys_are_the_same_everywhere(void **state)
{
    (void)state;
    uint64_t seed = 10, sum = 0xcbf29ce484222325u, numbers = sum;
    for (int run = 0; run < 10; run++) {
        vcache_config config = vcache_default_config();
        for (int i = 0; i < 3; i++)
            config.bounds_min[i] = -3.0f, config.bounds_max[i] = 4.5f + (float)run;
        config.table_bytes = 4;
        config.hash = (vcache_hash)(run % 3);
        config.normal_bins = run == 4 ? 1 : 5 + run;
        config.layers = 1 + 2 * run;
        config.resolution_step = (float)(105 + 20 * run) / 100.0f;
        vcache *c = make_cache(&config);
        for (int i = 0; i < 1000; i++) {
            vcache_surface s = {.density = (float)(1 + (random_bits(&seed) >> 40)) * 0x1p-17f};
            for (int a = 0; a < 3; a++) {
                s.position[a] = (float)(random_bits(&seed) >> 40) * 0x1p-21f - 3.0f;
                s.normal[a] = (float)(random_bits(&seed) >> 40) * 0x1p-23f - 1.0f;
            }
            vcache_light light;
            if (i % 5 == 0) {
                grid_point g;
                assert_true(quantize_point(c, s.position, s.normal, &g));
                numbers = mix_double(mix_double(mix_double(numbers, g.u), g.v), g.w);
                numbers = mix_double(mix_double(numbers, g.slope_u), g.slope_v);
                vcache_eye *eye = make_eye(c, &s, 8.0f, (uint64_t)i % 2);
                for (uint32_t d = 0; d < eye->levels; d++) {
                    sum = mix_in(sum, eye->level[d].center);
                    for (int k = 0; k < 4; k++)
                        sum = mix_in(sum, eye->level[d].neighbour[k]);
                }
                free(eye);
                vcache_vertex a, b;
                vcache_prepare_eye_vertex(c, &s, 4.0f, 100.0f, 0, &a);
                vcache_prepare_light_vertex(c, &s, &b);
                int step = vertex_step(c, &a, &b);
                sum = mix_in(mix_in(sum, (uint64_t)step), vertex_key(c, 1, &a, &b, step));
                continue;
            } else if (i % 5 == 1)
                vcache_prepare_point(c, s.position, 0, &light);
            else if (i % 5 == 2)
                vcache_prepare_direction(c, s.normal, 0, &light);
            else if (i % 5 == 3)
                vcache_prepare_patch(c, &s, &light);
            else
                vcache_prepare_solid_angle(c, s.normal, s.density * 10.0f, 0, &light);
            sum = mix_in(sum, pair_key(c->config.hash, 0, 0x0123456789abcdefu, &light));
        }
        vcache_destroy(&c);
    }
    print_message("checksum of keys: 0x%016llx\n", (unsigned long long)sum);
    print_message("checksum of coordinates: 0x%016llx\n", (unsigned long long)numbers);
    assert_true(sum == 0x59a83995b732d9e6u && numbers == 0x1a26729857f0f6d0u);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(keys_are_the_same_everywhere)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
