/* SPDX-License-Identifier: Apache-2.0 */
/* The library's calls in random order, with any value in every field. The contract: nothing crashes, what is answered
 * is what a ray found for the same pair of cells or traces, masks are respected, statistics add up. The bytes say which
 * calls; the number of calls is printed at the end. */
#include "../../vcache/adaptive.h"
#include "../../vcache/vcache.h"
#include "fuzz.h"

enum { EYES = 4, LIGHTS = 70, VERTICES = 4, PICKS = 40 };

static uint64_t calls;

static void print_calls(void)
{
    printf("%llu calls\n", (unsigned long long)calls);
}

typedef struct world {
    bytes b;
    vcache *cache;
    vcache_worker *worker;
    vcache_light_set *set;
    vcache_predictor *predictor;
    vcache_budget budget;
    float *contribution;
    uint64_t eyes[EYES][VCACHE_EYE_BYTES / 8], vertices[2 * VERTICES][VCACHE_VERTEX_BYTES / 8];
    vcache_light *lights;
    vcache_surface surface;
    uint64_t asked[2], visible[2], guard;
    uint32_t pending; /* upper bound of pairs that wait */
} world;

static vcache_surface any_surface(bytes *b)
{
    vcache_surface s = {.user = take(b)};
    for (int i = 0; i < 3; i++)
        s.position[i] = take_float(b);
    for (int i = 0; i < 3; i++)
        s.normal[i] = take_float(b);
    s.density = take_float(b) * (take(b) % 2 ? 1.0f : 1000.0f);
    return s;
}

static bool trace(void *context, const vcache_miss *misses, size_t count, vcache_answer *answers)
{
    world *w = context;
    for (size_t i = 0; i < count; i++) {
        uint8_t how = take(&w->b);
        answers[i] = (vcache_answer)((misses[i].eye_user ^ misses[i].light_user) & 1u);
        answers[i] |= how == 7 ? VCACHE_ONCE : 0;
    }
    return take(&w->b) != 13;
}

/* What lies behind the memory that the library asked for stays as it is. (The address sanitizer watches it better.) */
#if defined(__SANITIZE_ADDRESS__)
enum { FENCE = 0 };
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
enum { FENCE = 0 };
#else
enum { FENCE = 64 };
#endif
#else
enum { FENCE = 64 };
#endif

static void *fenced(void *context, size_t size)
{
    (void)context;
    void *memory = NULL;
    if (posix_memalign(&memory, 64, size + FENCE))
        return NULL;
    memset(memory, 0, size);
    memset((char *)memory + size, 0xa5, FENCE);
    return memory;
}

static void release_fenced(void *context, void *memory, size_t size)
{
    (void)context;
    for (const uint8_t *at = (uint8_t *)memory + size, *end = at + FENCE; at < end; at++)
        ENSURE(*at == 0xa5);
    free(memory);
}

static bool create(world *w)
{
    vcache_config c = vcache_default_config();
    char message[VCACHE_MESSAGE_BYTES];
    uint8_t odd = take(&w->b);
    if (odd & 1) {
        for (int i = 0; i < 3; i++) {
            c.bounds_min[i] = take_float(&w->b);
            c.bounds_max[i] = c.bounds_min[i] + fabsf(take_float(&w->b));
        }
        c.normal_bins = take(&w->b) % 66;
        c.layers = take(&w->b) % 66;
        c.resolution_step = 1.0f + fabsf(take_float(&w->b));
        c.levels = take(&w->b) % 18;
    }
    c.table_bytes = (uint64_t)take(&w->b) * (odd & 2 ? 16 : 1);
    c.hash = (vcache_hash)(odd >> 2 & 3);
    c.isa = odd >> 4 & 3;
    c.allocator = (vcache_allocator){fenced, release_fenced, NULL};
    vcache_status status = vcache_create(&c, &w->cache, message);
    ENSURE((status == VCACHE_OK) == (w->cache != NULL));
    ENSURE((status == VCACHE_OK) == (message[0] == 0) && memchr(message, 0, sizeof message));
    return w->cache != NULL;
}

static void prepare(world *w, uint8_t what, uint32_t at)
{
    float v[3] = {take_float(&w->b), take_float(&w->b), take_float(&w->b)};
    vcache_light *l = vcache_light_at(w->lights, at % LIGHTS);
    vcache_surface s = any_surface(&w->b);
    switch (what % 7) {
    case 0:
        vcache_prepare_eye(w->cache, &s, take_float(&w->b) * 100.0f, take(&w->b) % 3, (vcache_eye *)w->eyes[at % EYES]);
        w->surface = s;
        break;
    case 1:
        vcache_prepare_point(w->cache, v, take(&w->b), l);
        break;
    case 2:
        vcache_prepare_direction(w->cache, v, take(&w->b), l);
        break;
    case 3:
        vcache_prepare_patch(w->cache, &s, l);
        break;
    case 4:
        vcache_prepare_solid_angle(w->cache, v, s.density, take(&w->b), l);
        break;
    case 5:
        vcache_prepare_eye_vertex(w->cache, &s, take_float(&w->b) * 100.0f, take_float(&w->b) * 1e4f, take(&w->b) % 3,
                                  (vcache_vertex *)w->vertices[at % VERTICES]);
        break;
    default:
        vcache_prepare_light_vertex(w->cache, &s, (vcache_vertex *)w->vertices[VERTICES + at % VERTICES]);
    }
}

/* Ends that wait must stay as they are. */
static void settle(world *w)
{
    if (w->pending)
        vcache_resolve(w->worker, trace, w);
    w->pending = 0;
}

static void make_set(world *w)
{
    char message[VCACHE_MESSAGE_BYTES];
    settle(w);
    vcache_predictor_destroy(&w->predictor);
    vcache_light_set_destroy(&w->set);
    uint32_t count = take(&w->b) % (LIGHTS + 1);
    vcache_status status =
        vcache_light_set_create(w->cache, w->lights, count, (uint64_t)take(&w->b) * 16, &w->set, message);
    ENSURE((status == VCACHE_OK) == (w->set != NULL));
    if (w->set)
        ENSURE(vcache_predictor_create(w->set, (vcache_drawing)(take(&w->b) % 3), &w->predictor, message) == VCACHE_OK);
}

static void predict(world *w)
{
    if (!w->predictor)
        return;
    float zero[192] = {0};
    uint32_t padded = vcache_light_set_padded(w->set);
    memcpy(w->contribution, zero, sizeof zero);
    uint32_t lights = 0;
    for (uint32_t i = 0; i < padded && i < LIGHTS && w->b.at < w->b.end; i++)
        w->contribution[i] = (float)take(&w->b) * (take(&w->b) == 5 ? 1e20f : 1.0f);
    for (uint32_t i = LIGHTS; i < 192; i++)
        w->contribution[i] = 0.0f;
    vcache_prediction p =
        vcache_predict(w->predictor, &w->surface, take_float(&w->b) * 64.0f, take(&w->b) % 2, w->contribution);
    for (uint32_t i = 0; i < padded; i++) {
        ENSURE(p.mean[i] >= 0.0f && p.mean[i] <= 1.0f);
        lights += w->contribution[i] > 0.0f;
    }
    ENSURE(p.expected >= 0.0f && p.deviation >= 0.0f);
    vcache_pick picks[PICKS];
    vcache_answer answers[PICKS];
    uint32_t capacity = take(&w->b) % (PICKS + 1);
    float rays = vcache_budget_rays(&w->budget, p.deviation, p.expected, 1 + take(&w->b) % 3);
    uint32_t n = vcache_pick_lights(w->predictor, take(&w->b) % 4 ? rays : take_float(&w->b), 1 + take(&w->b) % 4,
                                    (double)take(&w->b) / 256.0, picks, capacity);
    ENSURE(n <= capacity);
    for (uint32_t i = 0; i < n; i++) {
        ENSURE(w->contribution[picks[i].light] > 0.0f && picks[i].weight >= 1.0f);
        answers[i] = (vcache_answer)(take(&w->b) % 4);
    }
    ENSURE(lights > 0 || n == 0);
    vcache_learn(w->set, &p.cells, picks, answers, n);
    vcache_adapt(w->predictor, picks, answers, n);
}

static void add(world *w, uint8_t how)
{
    const vcache_eye *eye = (const vcache_eye *)w->eyes[take(&w->b) % EYES];
    uint32_t first = take(&w->b) % (LIGHTS + 1), count = first + take(&w->b) % (LIGHTS + 1 - first), set = 0;
    w->asked[0] = w->asked[1] = 0;
    for (int i = 0; i < 4; i++)
        w->asked[i / 2] |= (uint64_t)take(&w->b) << 8 * (i % 7) * 1;
    const uint64_t *asked = how & 8 ? NULL : w->asked;
    if (how % 4 == 0) {
        ENSURE(vcache_add(w->worker, eye, w->lights, first, count, asked, w->visible) <= count || count < first);
    } else if (how % 4 == 1 && w->set) {
        set = vcache_add_set(w->worker, eye, w->set, first, asked, w->visible);
    } else if (how % 4 == 2 && w->set) {
        set = vcache_add_set_refining(w->worker, eye, w->set, first, asked, w->asked, w->visible);
    } else {
        vcache_vertex_pair pairs[VERTICES];
        for (int i = 0; i < VERTICES; i++)
            pairs[i] = (vcache_vertex_pair){(const vcache_vertex *)w->vertices[take(&w->b) % VERTICES],
                                            (const vcache_vertex *)w->vertices[VERTICES + take(&w->b) % VERTICES]};
        vcache_add_vertices(w->worker, pairs, 0, VERTICES, w->visible);
    }
    (void)set;
    w->pending = 1;
}

static void answer(world *w)
{
    const vcache_miss *misses;
    size_t n = vcache_misses(w->worker, &misses);
    vcache_answer answers[256];
    if (n == 0 || n > sizeof answers || take(&w->b) == 3) {
        vcache_cancel(w->worker);
        w->pending = 0;
        return;
    }
    for (size_t i = 0; i < n; i++)
        answers[i] = (vcache_answer)(take(&w->b) & 3);
    vcache_commit(w->worker, answers);
    w->pending = 1;
}

static void single(world *w, uint8_t how)
{
    const vcache_eye *eye = (const vcache_eye *)w->eyes[take(&w->b) % EYES];
    const vcache_light *light = vcache_light_at(w->lights, take(&w->b) % LIGHTS);
    if (how % 3 == 0) {
        (void)vcache_visible(w->worker, eye, light, trace, w);
        (void)vcache_eye_cell(eye, (int)take(&w->b) - 3);
        vcache_prefetch(w->worker, eye, light);
        return;
    }
    float contribution = take_float(&w->b) * 4.0f;
    vcache_estimate e =
        how % 3 == 1 ? vcache_estimate_pair(w->worker, eye, light, contribution)
                     : vcache_estimate_vertices(w->worker, (const vcache_vertex *)w->vertices[how / 3 % VERTICES],
                                                (const vcache_vertex *)w->vertices[VERTICES], contribution);
    ENSURE(e.mean >= 0.0f && e.mean <= 1.0f && e.probability >= 0.0f && e.probability <= 1.0f);
    vcache_learn_pair(w->worker, &e, (vcache_answer)(take(&w->b) % 4));
}

static void adaptive(bytes *b)
{
    vcache_adaptive_config c = vcache_adaptive_default_config();
    vcache_adaptive *a = NULL;
    vcache_adaptive_worker *w = NULL;
    c.sources = take(b) % 20;
    c.tolerance = take_float(b);
    c.certainty = take_float(b);
    c.free_running = take(b) & 1;
    char message[VCACHE_MESSAGE_BYTES];
    if (vcache_adaptive_create(&c, &a, message) != VCACHE_OK)
        return;
    ENSURE(vcache_adaptive_worker_create(a, &w, message) == VCACHE_OK);
    for (int point = 0; point < 3; point++) {
        float contribution[20], weight[20];
        uint32_t sources[20], n;
        vcache_answer answers[20];
        for (uint32_t i = 0; i < c.sources; i++)
            contribution[i] = take(b) == 9 ? take_float(b) : (float)take(b);
        vcache_adaptive_begin(w, contribution, weight, take_float(b) + 1.0f);
        while ((n = vcache_adaptive_next(w, sources, 1 + take(b) % 20)) > 0 && take(b) != 77) {
            for (uint32_t i = 0; i < n; i++) {
                ENSURE(sources[i] < c.sources);
                answers[i] = take(b) & 1;
            }
            vcache_adaptive_tell(w, answers);
        }
        vcache_adaptive_finish(w);
        vcache_adaptive_merge(a, &w, 1);
    }
    vcache_adaptive_worker_destroy(&w);
    vcache_adaptive_destroy(&a);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static bool told;
    if (!told)
        told = atexit(print_calls) == 0;
    world w = {.b = {data, data + size}, .budget.rays = 4.0f};
    if (!create(&w))
        return 0;
    w.lights = malloc(LIGHTS * vcache_light_size());
    if (posix_memalign((void **)&w.contribution, 64, 192 * sizeof(float)) || !w.lights)
        abort();
    vcache_worker_config c = vcache_default_worker_config();
    c.capacity = 1 + take(&w.b) % 100;
    c.exact = take(&w.b) == 99;
    ENSURE(vcache_worker_create(w.cache, &c, &w.worker, NULL) == VCACHE_OK);
    bytes none = {data, data};
    bytes keep = w.b;
    w.b = none;
    for (uint8_t what = 0; what < 7; what++)
        for (uint32_t i = 0; i < LIGHTS; i++)
            if (what != 2 && what != 3 && what != 4)
                prepare(&w, what, i);
    w.b = keep;
    w.surface = (vcache_surface){.normal = {0, 0, 1}, .density = 100.0f};
    while (w.b.at < w.b.end) {
        uint8_t call = take(&w.b);
        calls++;
        switch (call % 16) {
        case 0:
        case 1:
        case 2:
            settle(&w);
            prepare(&w, call / 16, take(&w.b));
            break;
        case 3:
        case 4:
        case 5:
            add(&w, take(&w.b));
            break;
        case 6:
            answer(&w);
            break;
        case 7:
            settle(&w);
            break;
        case 8:
        case 9:
            single(&w, call / 16);
            break;
        case 10:
            predict(&w);
            break;
        case 11:
            make_set(&w);
            break;
        case 12:
            vcache_clear(w.cache);
            break;
        case 13:
            settle(&w);
            vcache_bundle_lights(w.cache, w.lights, take(&w.b) % (LIGHTS + 1));
            break;
        case 14: {
            vcache_statistics s = {.size = sizeof s};
            vcache_worker_statistics(w.worker, &s);
            ENSURE(s.bypassed <= s.traced && s.overwritten <= s.stored + s.asked);
            double filled = vcache_table_filled(w.cache, take(&w.b));
            ENSURE(filled >= 0.0 && filled <= 1.0);
            break;
        }
        default:
            if (call == 15)
                adaptive(&w.b);
            else {
                float density = vcache_density_cone(take_float(&w.b), take_float(&w.b), take_float(&w.b));
                (void)density;
            }
        }
    }
    settle(&w);
    vcache_predictor_destroy(&w.predictor);
    vcache_light_set_destroy(&w.set);
    vcache_worker_destroy(&w.worker);
    vcache_destroy(&w.cache);
    free(w.lights);
    free(w.contribution);
    return 0;
}
