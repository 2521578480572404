/* SPDX-License-Identifier: Apache-2.0 */
/* Each row of docs/troubleshooting.md that can be seen in the examples' scene: the symptom, and that the remedy helps.
 * Test names stand in the rows. */
#include "../examples/host.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

typedef struct result {
    double traced, bypassed, overwritten, error; /* shares of asked, traced, stored, and of the image */
    float image[PIXELS];
} result;

static float exact[PIXELS];

static void render_exactly(float aside, float *image)
{
    memset(image, 0, PIXELS * sizeof *image);
    for (int i = 0; i < PIXELS; i++) {
        hit h;
        for (int l = 0; see(i, 0, aside, &h) && l < LAMPS; l++) {
            float light = light_of(&h, l);
            if (light > 0.0f && !occluded(h.position, lamp_at(l)))
                image[i] += light;
        }
    }
}

/* What is done to surfaces before they are prepared; NULL: nothing. */
typedef void (*spoil)(vcache_surface *s, int pixel, const hit *h);

static void render_with(vcache *cache, const vcache_light *lamps, float ce, float aside, spoil change, result *r)
{
    memset(r, 0, sizeof *r);
    vcache_worker_config config = vcache_default_worker_config();
    char message[VCACHE_MESSAGE_BYTES];
    vcache_worker *worker;
    check(vcache_worker_create(cache, &config, &worker, message), message);
    uint64_t eye[VCACHE_EYE_BYTES / 8], asked[LAMPS / 64], visible[LAMPS / 64];
    for (int i = 0; i < PIXELS; i++) {
        hit h;
        if (!see(i, 0, aside, &h))
            continue;
        vcache_surface surface = surface_of(&h, 1.0f);
        if (change)
            change(&surface, i, &h);
        vcache_prepare_eye(cache, &surface, ce, 0, (vcache_eye *)eye);
        memset(asked, 0, sizeof asked);
        for (int l = 0; l < LAMPS; l++)
            asked[l / 64] |= (uint64_t)(light_of(&h, l) > 0.0f) << l % 64;
        vcache_query(worker, (vcache_eye *)eye, lamps, LAMPS, asked, visible, trace, NULL);
        for (int l = 0; l < LAMPS; l++)
            if (asked[l / 64] & visible[l / 64] & (uint64_t)1 << l % 64)
                r->image[i] += light_of(&h, l);
    }
    vcache_statistics s = statistics_of(worker);
    r->traced = (double)s.traced / (double)s.asked;
    r->bypassed = (double)s.bypassed / (double)s.traced;
    r->overwritten = (double)s.overwritten / (double)(s.stored ? s.stored : 1);
    r->error = image_error(r->image, exact, PIXELS);
    vcache_worker_destroy(&worker);
}

static result last, usual; /* usual: as it should be */

static const result *render(const vcache_config *config, float ce, spoil change)
{
    vcache *cache = make_cache(config);
    vcache_light *lamps = make_lamps(cache);
    render_with(cache, lamps, ce, 0.0f, change, &last);
    printf("# traced %.1f %%, bypassed %.1f %%, overwritten %.1f %%, error %.2f %%\n", 100.0 * last.traced,
           100.0 * last.bypassed, 100.0 * last.overwritten, 100.0 * last.error);
    free(lamps);
    vcache_destroy(&cache);
    return &last;
}

static void smaller_cells(void **state)
{
    (void)state;
    vcache_config config = config_of_scene();
    const result *coarse = render(&config, 16.0f, NULL);
    assert_true(usual.error < 0.8 * coarse->error);
    assert_true(usual.traced > 1.1 * coarse->traced && usual.traced < 2.2 * coarse->traced);
}

static void sparse(vcache_surface *s, int pixel, const hit *h)
{
    (void)pixel, (void)h;
    s->density *= 0.25f;
}
static void per_pixel(vcache_surface *s, int pixel, const hit *h)
{
    (void)pixel, (void)h;
    s->density = 1.0f; /* one sample per pixel, not per area */
}
static void low_density(void **state)
{
    (void)state;
    vcache_config config = config_of_scene();
    const result *low = render(&config, 8.0f, sparse);
    assert_true(low->error > 1.5 * usual.error && low->traced < usual.traced);
    const result *absurd = render(&config, 8.0f, per_pixel); /* cells larger than the distances */
    assert_true(absurd->traced > 2.0 * usual.traced && absurd->bypassed > 0.9);
}

static void infinite(vcache_surface *s, int pixel, const hit *h)
{
    (void)pixel, (void)h;
    s->density = INFINITY;
}
static void bumps(vcache_surface *s, int pixel, const hit *h)
{
    (void)h;
    for (int k = 0; k < 3; k++)
        s->normal[k] +=
            0.8f * (float)((unsigned)pixel * (2654435761u + 40503u * (unsigned)k) >> 16 & 0xff) / 255.0f - 0.4f;
}
static void nearly_all_traced(void **state)
{
    (void)state;
    vcache_config config = config_of_scene();
    assert_true(render(&config, 8.0f, infinite)->traced > 0.9 && last.bypassed < 0.05);
    assert_true(render(&config, 0.5f, NULL)->traced > 0.9 && last.bypassed < 0.05);
    assert_true(render(&config, 8.0f, bumps)->traced > 1.5 * usual.traced);
}

static void broken_normal(vcache_surface *s, int pixel, const hit *h)
{
    (void)h;
    memset(s->normal, 0, pixel % 2 ? sizeof s->normal : 0);
}
static void broken_ends(void **state)
{
    (void)state;
    vcache_config config = config_of_scene();
    assert_true(render(&config, 8.0f, broken_normal)->bypassed > 0.5 && usual.bypassed < 0.2);
}

static void wrong_bounds(void **state)
{
    (void)state;
    vcache_config small = config_of_scene(), large = small, huge = small;
    for (int i = 0; i < 3; i++) {
        small.bounds_min[i] *= 0.01f, small.bounds_max[i] *= 0.01f;
        large.bounds_min[i] *= 1e3f, large.bounds_max[i] *= 1e3f;
        huge.bounds_min[i] *= 1e6f, huge.bounds_max[i] *= 1e6f;
    }
    assert_true(render(&small, 8.0f, NULL)->traced > 1.3 * usual.traced && last.bypassed > 0.03);
    assert_true(render(&large, 8.0f, NULL)->traced < 1.1 * usual.traced);
    assert_true(render(&huge, 8.0f, NULL)->bypassed > 0.99);
}

/* One pair, where its ray would find `found`. */
static bool ask(vcache_worker *worker, const uint64_t *eye, const vcache_light *light, vcache_answer found)
{
    uint64_t visible = 0;
    const vcache_miss *misses;
    vcache_add(worker, (const vcache_eye *)eye, light, 0, 1, NULL, &visible);
    while (vcache_misses(worker, &misses))
        vcache_commit(worker, &found);
    return visible;
}

/* Two sides of the floor, of which one sees the lamp: what the lower one is told after the upper one has asked. */
static bool leaks(const vcache_config *config, float lower_side)
{
    vcache *cache = make_cache(config);
    vcache_worker *worker = make_worker(cache, false);
    uint64_t eye[VCACHE_EYE_BYTES / 8], light[VCACHE_LIGHT_BYTES / 8];
    const float lamp[3] = {0.0f, 0.0f, 5.0f};
    vcache_prepare_point(cache, lamp, 0, (vcache_light *)light);
    bool last_answer = false;
    for (int below = 0; below < 2; below++) {
        vcache_surface s = {{7.0f, 7.0f, 0.0f}, {0.0f, 0.0f, below ? lower_side : 1.0f}, 100.0f, 0};
        vcache_prepare_eye(cache, &s, 8.0f, 0, (vcache_eye *)eye);
        last_answer = ask(worker, eye, (vcache_light *)light, below ? VCACHE_BLOCKED : VCACHE_VISIBLE);
    }
    vcache_worker_destroy(&worker);
    vcache_destroy(&cache);
    return last_answer;
}

static void thin_walls(void **state)
{
    (void)state;
    vcache_config config = config_of_scene();
    assert_false(leaks(&config, -1.0f));
    assert_true(leaks(&config, 1.0f));
    config.normal_bins = 1;
    assert_true(leaks(&config, -1.0f));
}

/* Lamps as patches, as virtual point lights are. */
static double error_of_patches(float density)
{
    vcache_config config = config_of_scene();
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    for (int i = 0; i < LAMPS; i++) {
        const vec l = lamp_at(i);
        const vcache_surface s = {{l.x, l.y, l.z}, {0.0f, 0.0f, -1.0f}, density, (uint64_t)i};
        vcache_prepare_patch(cache, &s, vcache_light_at(lamps, (size_t)i));
    }
    render_with(cache, lamps, 8.0f, 0.0f, NULL, &last);
    printf("# traced %.1f %%, error %.2f %%\n", 100.0 * last.traced, 100.0 * last.error);
    free(lamps);
    vcache_destroy(&cache);
    return last.error;
}

static void sparse_patches(void **state)
{
    (void)state;
    assert_true(error_of_patches(0.1f) > 1.5 * error_of_patches(4.0f));
}

static void curved_exactly(vcache_surface *s, int pixel, const hit *h)
{
    (void)pixel;
    s->density = h->normal.z < 0.999f ? INFINITY : s->density;
}
static void curved_things(void **state)
{
    (void)state;
    vcache_config config = config_of_scene(), less = config;
    less.normal_bins = 4, less.layers = 2;
    const result *less_apart = render(&less, 8.0f, NULL);
    assert_true(less_apart->traced < 0.95 * usual.traced && less_apart->error < 1.3 * usual.error);
    assert_true(render(&config, 8.0f, curved_exactly)->error < usual.error);
}

/* The second of two equal frames. */
static const result *again(uint64_t table_bytes)
{
    vcache_config config = config_of_scene();
    config.table_bytes = table_bytes;
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    for (int frame = 0; frame < 2; frame++)
        render_with(cache, lamps, 8.0f, 0.0f, NULL, &last);
    printf("# traced %.1f %%, overwritten %.1f %%\n", 100.0 * last.traced, 100.0 * last.overwritten);
    free(lamps);
    vcache_destroy(&cache);
    return &last;
}

static void small_tables(void **state)
{
    (void)state;
    const result small = *again(1 << 20), *large = again(64 << 20);
    assert_true(small.overwritten > 0.5 && large->overwritten < 0.2 && large->traced < 0.2 * small.traced);
}

static void things_that_move(void **state)
{
    (void)state;
    static float rolled[PIXELS];
    vcache_config config = config_of_scene();
    config.table_bytes = 64 << 20;
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    render_with(cache, lamps, 8.0f, 0.0f, NULL, &last);
    make_scene(1.0f);
    render_exactly(0.0f, rolled);
    render_with(cache, lamps, 8.0f, 0.0f, NULL, &last);
    double stale = image_error(last.image, rolled, PIXELS);
    vcache_clear(cache);
    render_with(cache, lamps, 8.0f, 0.0f, NULL, &last);
    double fresh = image_error(last.image, rolled, PIXELS);
    printf("# error %.2f %% not cleared, %.2f %% cleared\n", 100.0 * stale, 100.0 * fresh);
    assert_true(stale > 1.5 * fresh);
    make_scene(0.0f);
    free(lamps);
    vcache_destroy(&cache);
}

/* Mean change of the error from a frame to the next, over the picture. */
static double flicker(float ce, bool keep)
{
    static float now[PIXELS], before[PIXELS];
    vcache_config config = config_of_scene();
    config.table_bytes = 64 << 20;
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    double change = 0.0, sum = 0.0;
    for (int frame = 0; frame < 6; frame++) {
        float aside = 0.01f * (float)frame;
        if (frame >= 3)
            render_exactly(aside, now);
        render_with(cache, lamps, ce, aside, NULL, &last);
        for (int i = 0; i < PIXELS; i++) {
            float wrong = last.image[i] - now[i];
            change += frame >= 4 ? fabs((double)(wrong - before[i])) : 0.0; /* the first ones learn */
            sum += frame >= 4 ? (double)now[i] : 0.0;
            before[i] = wrong;
        }
        if (!keep)
            vcache_clear(cache);
    }
    free(lamps);
    vcache_destroy(&cache);
    printf("# flicker %.2f %% with C_E %g, %s\n", 100.0 * change / sum, (double)ce, keep ? "kept" : "cleared");
    return change / sum;
}

static void flickering(void **state)
{
    (void)state;
    double cleared = flicker(8.0f, false);
    assert_true(flicker(8.0f, true) < 0.9 * cleared);
    assert_true(flicker(4.0f, false) < 0.9 * cleared);
}

/* The sum of all lamps at one point, estimated many times. `forgotten`: every second lamp is said to bring nothing. */
static void estimates(bool forgotten, double *error, double *standard_error, double *noise)
{
    enum { TIMES = 4000 };
    char message[VCACHE_MESSAGE_BYTES];
    vcache_config config = config_of_scene();
    vcache *cache = make_cache(&config);
    vcache_light *lamps = make_lamps(cache);
    vcache_light_set *set;
    vcache_predictor *predictor;
    check(vcache_light_set_create(cache, lamps, LAMPS, 1 << 20, &set, message), message);
    check(vcache_predictor_create(set, VCACHE_DRAW_UNCERTAIN, &predictor, message), message);
    hit h = {.distance = 1.0f};
    assert_true(see(45 * WIDTH + 60, 0, 0.0f, &h));
    vcache_surface surface = surface_of(&h, 1.0f);
    float f[LAMPS], given[LAMPS];
    double truth = 0.0, sum = 0.0, squares = 0.0;
    int seen = 0;
    for (int l = 0; l < LAMPS; l++) {
        f[l] = light_of(&h, l);
        given[l] = forgotten && l % 2 ? 0.0f : f[l];
        bool visible = !occluded(h.position, lamp_at(l));
        truth += visible ? (double)f[l] : 0.0;
        seen += visible;
    }
    assert_true(seen > 10 && seen < 118); /* in a penumbra */
    uint64_t state = 1;
    for (int k = 0; k < TIMES; k++) {
        vcache_pick picks[64];
        vcache_answer found[64];
        vcache_prediction p = vcache_predict(predictor, &surface, 12.0f, 0, given);
        state = state * 6364136223846793005u + 1442695040888963407u;
        uint32_t n = vcache_pick_lights(predictor, 6.0f, 1, (double)(state >> 11) * 0x1p-53, picks, 64);
        double estimate = (double)p.expected;
        for (uint32_t j = 0; j < n; j++) {
            uint32_t l = picks[j].light;
            found[j] = !occluded(h.position, lamp_at((int)l));
            estimate += (double)(f[l] * ((float)found[j] - p.mean[l]) * picks[j].weight);
        }
        vcache_learn(set, &p.cells, picks, found, k < 2 ? n : 0);
        sum += estimate / truth, squares += estimate / truth * estimate / truth;
    }
    double mean = sum / TIMES;
    *noise = sqrt(squares / TIMES - mean * mean);
    *standard_error = *noise / sqrt(TIMES);
    *error = fabs(mean - 1.0);
    printf("# mean off by %.2f %% (standard error %.2f %%), noise %.1f %%\n", 100.0 * *error, 100.0 * *standard_error,
           100.0 * *noise);
    vcache_predictor_destroy(&predictor);
    vcache_light_set_destroy(&set);
    free(lamps);
    vcache_destroy(&cache);
}

static void noise_and_bias(void **state)
{
    (void)state;
    double error, standard_error, noise;
    estimates(false, &error, &standard_error, &noise);
    assert_true(error < 4.0 * standard_error && noise > 0.01);
    estimates(true, &error, &standard_error, &noise);
    assert_true(error > 10.0 * standard_error);
}

/* Two times within a shutter: the lamp is seen at the first alone. */
static bool second_time(uint64_t salt)
{
    vcache_config config = config_of_scene();
    vcache *cache = make_cache(&config);
    vcache_worker *worker = make_worker(cache, false);
    vcache_light *lamps = make_lamps(cache);
    uint64_t eye[VCACHE_EYE_BYTES / 8];
    const vcache_surface s = {{7.0f, 7.0f, 0.0f}, {0.0f, 0.0f, 1.0f}, 100.0f, 0};
    bool visible = false;
    for (int time = 0; time < 2; time++) {
        vcache_prepare_eye(cache, &s, 8.0f, time ? salt : 0, (vcache_eye *)eye);
        visible = ask(worker, eye, lamps, time ? VCACHE_BLOCKED : VCACHE_VISIBLE);
    }
    vcache_worker_destroy(&worker);
    free(lamps);
    vcache_destroy(&cache);
    return visible;
}

static void salts(void **state)
{
    (void)state;
    assert_true(second_time(0));
    assert_false(second_time(1));
}

int main(void)
{
    make_scene(0.0f);
    render_exactly(0.0f, exact);
    vcache_config config = config_of_scene();
    usual = *render(&config, 8.0f, NULL);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(smaller_cells),
        cmocka_unit_test(low_density),
        cmocka_unit_test(nearly_all_traced),
        cmocka_unit_test(broken_ends),
        cmocka_unit_test(wrong_bounds),
        cmocka_unit_test(thin_walls),
        cmocka_unit_test(sparse_patches),
        cmocka_unit_test(curved_things),
        cmocka_unit_test(small_tables),
        cmocka_unit_test(things_that_move),
        cmocka_unit_test(flickering),
        cmocka_unit_test(noise_and_bias),
        cmocka_unit_test(salts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
