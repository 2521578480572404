/* SPDX-License-Identifier: Apache-2.0 */
/* The sum of all lamps from six rays a sample, without bias: the cache says what to expect of each lamp, few lamps are
 * drawn where that is uncertain, and their rays correct the sum. */
#include "host.h"

enum { MOST = 64 };
static const float rays_per_sample = 6.0f;

/* Uniform in [0, 1), from a Weyl sequence: one is drawn per sample, independent of what the cache holds. */
static double next_random(uint64_t *state)
{
    uint64_t x = *state += 0x9e3779b97f4a7c15u;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return (double)((x ^ x >> 31) >> 11) * 0x1p-53;
}

static float shade(vcache_light_set *set, vcache_predictor *predictor, vcache_budget *budget, const hit *h,
                   uint64_t *random, uint64_t *traced)
{
    float light[LAMPS]; /* vcache_light_set_padded(set) floats: LAMPS is a multiple of 64 */
    for (int i = 0; i < LAMPS; i++)
        light[i] = light_of(h, i);
    vcache_surface surface = surface_of(h, SAMPLES);
    vcache_prediction p = vcache_predict(predictor, &surface, 12.0f, 0, light);
    float sum = p.expected;

    vcache_pick picks[MOST];
    vcache_answer found[MOST];
    float rays = vcache_budget_rays(budget, p.deviation, p.expected, 1);
    uint32_t n = vcache_pick_lights(predictor, rays, 1, next_random(random), picks, MOST);
    for (uint32_t k = 0; k < n; k++) {
        uint32_t i = picks[k].light;
        found[k] = !occluded(h->position, lamp_at((int)i));
        sum += light[i] * ((float)found[k] - p.mean[i]) * picks[k].weight;
    }
    vcache_learn(set, &p.cells, picks, found, n);
    vcache_adapt(predictor, picks, found, n);
    *traced += n;
    return sum;
}

int main(void)
{
    static float image[PIXELS], exact[PIXELS];
    char message[VCACHE_MESSAGE_BYTES];
    make_scene(0.0f);
    vcache_config config = config_of_scene();
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    vcache_light_set *set;
    vcache_predictor *predictor;
    check(vcache_light_set_create(cache, lamps, LAMPS, 4 << 20, &set, message), message);
    check(vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, &predictor, message), message);
    vcache_budget budget = {.rays = rays_per_sample};

    uint64_t random = 1, asked = 0, traced = 0;
    for (int i = 0; i < PIXELS * SAMPLES; i++) {
        hit h;
        if (!see(i / SAMPLES, i % SAMPLES, 0.0f, &h))
            continue;
        image[i / SAMPLES] += shade(set, predictor, &budget, &h, &random, &traced) / SAMPLES;
        for (int l = 0; l < LAMPS; l++) {
            float light = light_of(&h, l);
            asked += light > 0.0f;
            if (light > 0.0f && !occluded(h.position, lamp_at(l)))
                exact[i / SAMPLES] += light / SAMPLES;
        }
    }
    print_figures("", asked, traced, image_error(image, exact, PIXELS));
    vcache_predictor_destroy(&predictor);
    vcache_light_set_destroy(&set);
    free(lamps);
    vcache_destroy(&cache);
    return 0;
}
