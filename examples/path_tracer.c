/* SPDX-License-Identifier: Apache-2.0 */
/* A progressive path tracer with next-event estimation: one lamp at random at each vertex. Such pairs are known to
 * nobody in advance, so each is an estimate: mostly the visibility that the cache expects, sometimes a ray that
 * corrects it. No bias, only a little more noise. */
#include "host.h"
#include <string.h>

enum { PASSES = 16, BOUNCES = 3 };

typedef struct rng {
    uint64_t state;
} rng;

static float next(rng *r)
{
    uint64_t x = r->state += 0x9e3779b97f4a7c15u;
    x = (x ^ x >> 30) * 0xbf58476d1ce4e5b9u;
    x = (x ^ x >> 27) * 0x94d049bb133111ebu;
    return (float)((x ^ x >> 31) >> 40) * 0x1p-24f;
}

/* A direction around n, with the density of its cosine. */
static vec bounce(vec n, rng *r)
{
    float z = 1.0f - 2.0f * next(r), angle = 6.2831853f * next(r), s = sqrtf(1.0f - z * z);
    return unit(add(n, scale(v(s * cosf(angle), s * sinf(angle), z), 0.999f)));
}

typedef struct renderer {
    vcache *cache;
    vcache_worker *worker;
    vcache_light *lamps;
    float threshold; /* contributions below it are mostly not traced */
} renderer;

/* Light of one lamp at a vertex, `weight` being the path's. `roulette` has nothing to do with what made the path. */
static float next_event(renderer *r, const hit *h, float density, float weight, int lamp, rng *roulette)
{
    float f = weight * LAMPS * light_of(h, lamp);
    if (f == 0.0f)
        return 0.0f;
    uint64_t eye[VCACHE_EYE_BYTES / 8];
    vcache_surface surface = surface_of(h, 1.0f);
    surface.density = density;
    vcache_prepare_eye(r->cache, &surface, 48.0f, 0, (vcache_eye *)eye);
    vcache_light *light = vcache_light_at(r->lamps, (size_t)lamp);
    vcache_estimate e = vcache_estimate_pair(r->worker, (vcache_eye *)eye, light, f / r->threshold);
    if (next(roulette) >= e.probability)
        return f * e.mean;
    vcache_answer found = !occluded(h->position, lamp_at(lamp));
    vcache_learn_pair(r->worker, &e, found);
    return f * (e.mean + ((float)found - e.mean) / e.probability);
}

static float path(renderer *r, int pixel, int pass)
{
    rng random = {(uint64_t)(pixel * PASSES + pass) << 20}, roulette = {random.state ^ 0x5851f42d4c957f2du};
    float sum = 0.0f, weight = 1.0f;
    hit h;
    if (!see(pixel, pass % SAMPLES, 0.0f, &h))
        return 0.0f;
    float density = vcache_density_cone(pixel_width * h.distance, h.cosine, PASSES);
    for (int k = 0; k < BOUNCES; k++) {
        sum += next_event(r, &h, density, weight, (int)(next(&random) * LAMPS), &roulette);
        weight *= 0.6f; /* a grey surface */
        if (!trace_ray(h.position, bounce(h.normal, &random), &h))
            break;
        density = vcache_density_unknown(r->cache, PIXELS * PASSES); /* later vertices lie anywhere */
    }
    return sum;
}

static vcache_statistics render(vcache *cache, vcache_light *lamps, bool exact, float *image, float *half)
{
    renderer r = {cache, make_worker(cache, exact), lamps, 0.5f};
    for (int pass = 0; pass < PASSES; pass++) {
        for (int i = 0; i < PIXELS; i++)
            image[i] += path(&r, i, pass) / PASSES;
        if (pass + 1 == PASSES / 2)
            memcpy(half, image, PIXELS * sizeof *half);
    }
    vcache_statistics s = statistics_of(r.worker);
    vcache_worker_destroy(&r.worker);
    return s;
}

int main(void)
{
    static float image[PIXELS], exact[PIXELS], half[PIXELS], other_half[PIXELS], unused[PIXELS];
    make_scene(0.0f);
    vcache_config config = config_of_scene();
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    (void)render(cache, lamps, true, exact, half);
    vcache_statistics s = render(cache, lamps, false, image, unused);
    print_figures("", s.asked, s.traced, image_error(image, exact, PIXELS));

    double sum = 0.0, sum_exact = 0.0;
    for (int i = 0; i < PIXELS; i++) {
        other_half[i] = exact[i] - half[i];
        sum += (double)image[i], sum_exact += (double)exact[i];
    }
    /* half the difference of two halves is as large as the noise of the whole */
    printf("noise of the paths themselves %.1f %%; sums differ by %.2f %%\n",
           50.0 * image_error(half, other_half, PIXELS), 100.0 * fabs(sum / sum_exact - 1.0));
    free(lamps);
    vcache_destroy(&cache);
    return 0;
}
