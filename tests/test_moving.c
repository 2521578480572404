/* SPDX-License-Identifier: Apache-2.0 */
/* Frames in which something moves: no answer from before is given where it may have changed, little is asked anew. A
 * floor with a ball that rolls over it, under lights of all kinds. */
#include "../vcache/light_set.h"
#include "support.h"

enum { SIDE = 48, COUNT = SIDE * SIDE, LIGHT_COUNT = 96, WORD_COUNT = 2 };

typedef struct stage {
    vcache *cache;
    vcache_worker *worker;
    vcache_light_set *set;
    vcache_light lights[LIGHT_COUNT];
    float ball[3];
    double radius;
    vcache_surface surface[COUNT];
    uint64_t rays;
} stage;

static bool sees_past_ball(const stage *g, const float eye[3], const float light[3], bool infinite)
{
    double d[3], o[3], dd = 0.0, od = 0.0, oo = 0.0;
    for (int i = 0; i < 3; i++) {
        o[i] = (double)eye[i] - g->ball[i];
        d[i] = infinite ? (double)light[i] : (double)light[i] - eye[i];
        dd += d[i] * d[i], od += o[i] * d[i], oo += o[i] * o[i];
    }
    double root = od * od - dd * (oo - g->radius * g->radius);
    if (root < 0.0)
        return true;
    double t = (-od - sqrt(root)) / dd, u = (-od + sqrt(root)) / dd;
    return u <= 0.0 || (!infinite && t >= 1.0);
}

static bool trace_ball(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    stage *g = context;
    g->rays += count;
    for (size_t i = 0; i < count; i++)
        answers[i] = sees_past_ball(g, misses[i].eye_position, misses[i].light_position, misses[i].infinite);
    return true;
}

static void prepare_light(const stage *g, int i, uint64_t *seed, vcache_light *out)
{
    float p[3] = {(float)random_unit(seed), (float)random_unit(seed), 1.0f}, d[3];
    random_direction(seed, d);
    d[2] = fabsf(d[2]) + 0.2f;
    vcache_surface s = {.position = {p[0], p[1], p[2]}, .normal = {0, 0, -1}, .density = 100.0f};
    if (i % 3 == 0)
        vcache_prepare_point(g->cache, p, 0, out);
    else if (i % 3 == 1)
        vcache_prepare_direction(g->cache, d, 0, out);
    else
        vcache_prepare_patch(g->cache, &s, out);
}

/* Floor points with normals that vary, so that cells are tilted. */
static stage *make_stage(int bins, bool rows)
{
    stage *g = calloc(1, sizeof *g);
    assert_non_null(g);
    vcache_config config = vcache_default_config();
    config.normal_bins = bins;
    config.table_bytes = 1 << 22;
    g->cache = make_cache(&config);
    g->worker = make_worker(g->cache, 4096, false);
    uint64_t seed = 5;
    for (int i = 0; i < LIGHT_COUNT; i++)
        prepare_light(g, i, &seed, &g->lights[i]);
    if (rows)
        assert_int_equal(vcache_light_set_create(g->cache, g->lights, LIGHT_COUNT, 1 << 22, &g->set, NULL), VCACHE_OK);
    for (int i = 0; i < COUNT; i++) {
        vcache_surface *s = &g->surface[i];
        *s = (vcache_surface){.density = (float)COUNT, .normal = {0, 0, 1}};
        s->position[0] = ((float)(i % SIDE) + (float)random_unit(&seed)) / SIDE;
        s->position[1] = ((float)(i / SIDE) + (float)random_unit(&seed)) / SIDE;
        s->position[2] = 0.05f * sinf(6.0f * s->position[0]);
        s->normal[0] = -0.3f * cosf(6.0f * s->position[0]);
    }
    g->radius = 0.08;
    g->ball[1] = 0.5f, g->ball[2] = 0.3f;
    return g;
}

static void free_stage(stage *g)
{
    vcache_light_set_destroy(&g->set);
    vcache_worker_destroy(&g->worker);
    vcache_destroy(&g->cache);
    free(g);
}

static void ask(stage *g, size_t i, uint64_t salt, const uint64_t *asked, uint64_t *visible)
{
    vcache_eye *eye = make_eye(g->cache, &g->surface[i], 3.0f, salt);
    for (uint32_t l = 0; l < LIGHT_COUNT;) {
        l = g->set ? vcache_add_set(g->worker, eye, g->set, l, asked, visible)
                   : vcache_add(g->worker, eye, g->lights, l, LIGHT_COUNT, asked, visible);
        vcache_resolve(g->worker, trace_ball, g);
    }
    free(eye);
}

/* How an animation is answered. */
typedef enum keeping { CLEAR_ALL, CROSSING, STALE } keeping;

/* Where the ball is nearer to a cell's neighbourhood than its answers can be right about: of a still picture of the
 * frame alone, in a cache that was cleared. */
typedef struct frames {
    uint64_t rays, wrong, fresh_wrong;
} frames;

/* Pairs that differ from the truth, in a row of frames, and in each frame by itself from an empty cache. */
static frames animate(int bins, bool rows, keeping how)
{
    stage *g = make_stage(bins, rows), *fresh = make_stage(bins, rows);
    frames f = {0};
    float low[3] = {2, 2, 2}, high[3] = {-2, -2, -2};
    for (int frame = 0; frame < 6; frame++) {
        g->ball[0] = fresh->ball[0] = 0.2f + 0.1f * (float)frame;
        for (int k = 0; k < 3; k++) {
            low[k] = fminf(low[k], g->ball[k] - (float)g->radius);
            high[k] = fmaxf(high[k], g->ball[k] + (float)g->radius);
        }
        if (how == CLEAR_ALL)
            vcache_clear(g->cache);
        vcache_clear(fresh->cache);
        for (size_t i = 0; i < COUNT; i++) {
            uint64_t visible[WORD_COUNT] = {0}, alone[WORD_COUNT] = {0}, crossing[WORD_COUNT] = {0}, other[WORD_COUNT];
            if (how == CROSSING) {
                vcache_eye *eye = make_eye(g->cache, &g->surface[i], 3.0f, 0);
                vcache_crossing(g->cache, eye, g->lights, LIGHT_COUNT, low, high, crossing);
                free(eye);
            }
            for (int w = 0; w < WORD_COUNT; w++)
                other[w] = ~crossing[w];
            ask(g, i, 0, other, visible);
            if (how == CROSSING)
                ask(g, i, (uint64_t)frame + 1, crossing, visible);
            ask(fresh, i, 0, NULL, alone);
            for (uint32_t l = 0; l < LIGHT_COUNT; l++) {
                bool truth =
                    sees_past_ball(g, g->surface[i].position, g->lights[l].position, g->lights[l].side_squared < 0.0f);
                f.wrong += (visible[l / 64] >> l % 64 & 1) != truth;
                f.fresh_wrong += (alone[l / 64] >> l % 64 & 1) != truth;
            }
        }
    }
    f.rays = g->rays;
    free_stage(g);
    free_stage(fresh);
    return f;
}

/* Stale answers are told from those of a cell by their number: as many are wrong as in frames that know of no other. */
static void a_ball_rolls(void **state)
{
    (void)state;
    for (int rows = 0; rows < 2; rows++) {
        frames clear = animate(8, rows, CLEAR_ALL), keep = animate(8, rows, CROSSING), stale = animate(8, rows, STALE);
        double pairs = 6.0 * COUNT * LIGHT_COUNT;
        print_message("%s: cleared %.2f %% of the rays, %.3f %% wrong; crossing the box %.2f %%, %.3f %%; nothing done "
                      "%.2f %%, %.3f %%\n",
                      rows ? "rows" : "words", 100.0 * (double)clear.rays / pairs, 100.0 * (double)clear.wrong / pairs,
                      100.0 * (double)keep.rays / pairs, 100.0 * (double)keep.wrong / pairs,
                      100.0 * (double)stale.rays / pairs, 100.0 * (double)stale.wrong / pairs);
        assert_int_equal(clear.wrong, clear.fresh_wrong);
        assert_true((double)keep.wrong < 1.1 * (double)clear.wrong && (double)keep.rays < 0.7 * (double)clear.rays);
        assert_true((double)stale.wrong > 2.0 * (double)clear.wrong); /* else this test sees nothing */
    }
}

/* No pair that is asked under the old salt may be one whose answer another point of its cells gave through the box. All
 * pairs of points that share both cells are tried. */
static void no_stale_bit(void **state)
{
    (void)state;
    static const int bins[] = {1, 3, 8, 64};
    for (int b = 0; b < 4; b++) {
        stage *g = make_stage(bins[b], false);
        const float low[3] = {0.4f, 0.4f, 0.2f}, high[3] = {0.5f, 0.5f, 0.3f};
        uint64_t keys[COUNT], missed = 0, pairs = 0, set = 0;
        static uint64_t grown[COUNT][WORD_COUNT], exact[COUNT][WORD_COUNT];
        for (size_t i = 0; i < COUNT; i++) {
            vcache_eye *eye = make_eye(g->cache, &g->surface[i], 6.0f, 0);
            keys[i] = vcache_eye_cell(eye, 0);
            vcache_crossing(g->cache, eye, g->lights, LIGHT_COUNT, low, high, grown[i]);
            eye->side_squared = 0.0f; /* the segment alone */
            vcache_crossing(g->cache, eye, g->lights, LIGHT_COUNT, low, high, exact[i]);
            free(eye);
        }
        for (size_t i = 0; i < COUNT; i++)
            for (size_t k = 0; k < COUNT; k++)
                if (keys[i] == keys[k])
                    for (uint32_t l = 0; l < LIGHT_COUNT; l++) {
                        bool crosses = exact[k][l / 64] >> l % 64 & 1, known = grown[i][l / 64] >> l % 64 & 1;
                        if (l % 3 == 2)
                            continue; /* patches have cells of their own */
                        pairs++, set += known, missed += crosses && !known;
                    }
        print_message("C_N %d: %llu pairs of points, %.1f %% cross, %llu missed\n", bins[b], (unsigned long long)pairs,
                      100.0 * (double)set / (double)pairs, (unsigned long long)missed);
        assert_true(missed == 0 && pairs > 1000000 && set > pairs / 100 && (bins[b] < 8 || set < 7 * pairs / 10));
        free_stage(g);
    }
}

static void odd_boxes(void **state)
{
    (void)state;
    stage *g = make_stage(8, false);
    vcache_eye *eye = make_eye(g->cache, &g->surface[0], 3.0f, 0);
    uint64_t crossing[WORD_COUNT] = {0, (uint64_t)1 << 63};
    const float nowhere[3] = {9, 9, 9}, not_a_number[3] = {NAN, NAN, NAN};
    const float least[3] = {-INFINITY, -INFINITY, -INFINITY}, most[3] = {INFINITY, INFINITY, INFINITY};
    vcache_crossing(g->cache, eye, g->lights, LIGHT_COUNT, nowhere, nowhere, crossing);
    assert_true(crossing[0] == 0 && crossing[1] == (uint64_t)1 << 63); /* bits beyond stay */
    vcache_crossing(g->cache, eye, g->lights, LIGHT_COUNT, least, most, crossing);
    assert_true(crossing[0] == ~(uint64_t)0);
    vcache_crossing(g->cache, eye, g->lights, LIGHT_COUNT, not_a_number, not_a_number, crossing);
    assert_true(crossing[0] == ~(uint64_t)0);
    free(eye);
    g->surface[0].position[0] = NAN;
    eye = make_eye(g->cache, &g->surface[0], 3.0f, 0);
    vcache_crossing(g->cache, eye, g->lights, LIGHT_COUNT, nowhere, nowhere, crossing);
    assert_true(crossing[0] == ~(uint64_t)0);
    free(eye);
    free_stage(g);
}

/* A light moves: it is traced anew, all others are not. */
static void a_light_moves(void **state)
{
    (void)state;
    stage *g = make_stage(8, true);
    uint64_t visible[WORD_COUNT], seed = 99;
    g->ball[0] = 0.5f;
    for (int round = 0; round < 2; round++)
        for (size_t i = 0; i < COUNT; i += 7)
            ask(g, i, 0, NULL, visible);
    for (uint32_t l = 0; l < LIGHT_COUNT; l += 31) {
        uint64_t others[WORD_COUNT] = {~(uint64_t)0, ~(uint64_t)0}, alone[WORD_COUNT] = {0};
        others[l / 64] ^= (uint64_t)1 << l % 64, alone[l / 64] = (uint64_t)1 << l % 64;
        prepare_light(g, (int)l, &seed, &g->lights[l]);
        vcache_light_set_replace(g->set, l, &g->lights[l]);
        uint64_t before = g->rays, wrong = 0, lights = 0;
        for (size_t i = 0; i < COUNT; i += 7)
            ask(g, i, 0, others, visible);
        assert_true(g->rays - before < COUNT / 7); /* those too near for a cell */
        before = g->rays;
        for (size_t i = 0; i < COUNT; i += 7) {
            ask(g, i, 0, alone, visible);
            wrong += (visible[l / 64] >> l % 64 & 1) !=
                     sees_past_ball(g, g->surface[i].position, g->lights[l].position, g->lights[l].side_squared < 0.0f);
            lights++;
        }
        assert_true(g->rays > before && wrong * 20 < lights);
    }
    free_stage(g);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_ball_rolls), cmocka_unit_test(no_stale_bit),
                                       cmocka_unit_test(odd_boxes), cmocka_unit_test(a_light_moves)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
