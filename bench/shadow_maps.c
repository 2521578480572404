/* SPDX-License-Identifier: Apache-2.0 */
/* Plain shadow maps (Williams 1978) beside shadow rays: six faces around each point and spot light, of which those are
 * made that an eye sample lies in, one map over the whole scene for each directional light; nearest texel, depth bias
 * in proportion to the texel's width and the receiver's slope. Texels are found by coherent packets of rays. Everything
 * else of the frame is the renderer's.
 *
 *     shadow_maps SCENE [--map N] [--size WxH] ...
 *
 * Prints JSON. `bias`: of those in `sweep`, in texels, the one with the fewest wrong pairs. `frame_s`, of which
 * `build_s` and `lookup_s` are part, is that of a frame by maps, `exact_s` that of one by rays, `visibility_s` its
 * rays. How much faster: `faster`; `without_building`, as if maps were there already; `limit`, no visibility at all.
 */
#include "lighting.h"

#include "renderers/common/flip.h"
#include "renderers/common/metrics.h"

#include <math.h>
#include <stdio.h>

static const float biases[] = {0.0f, 0.25f, 0.5f, 1.0f, 2.0f, 4.0f, 8.0f};
enum { BIASES = sizeof biases / sizeof *biases, TIMED = 3, FACES = 6 };

/* Slopes beyond count as this one. */
#define SLOPE_MAX 16.0f

/* A square of N x N texels in front of a light. */
typedef struct face {
    bool parallel;
    vec3 origin;     /* the light; parallel: the corner of texel (0, 0) on the near plane */
    vec3 axis, u, v; /* unit, perpendicular */
    float width;     /* parallel: of a side. Else a side is twice as wide as its distance */
    uint32_t size;
    float *depth; /* [size][size] along the axis */
} face;

static face cube_face(const light *l, uint32_t index, uint32_t size, float *depth)
{
    static const vec3 axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    face f = {.origin = l->position, .size = size, .depth = depth};
    f.axis = v3_scale(axes[index / 2], index % 2 ? -1.0f : 1.0f);
    f.u = axes[(index / 2 + 1) % 3];
    f.v = axes[(index / 2 + 2) % 3];
    return f;
}

static face parallel_face(const light *l, const scene *s, uint32_t size, float *depth)
{
    face f = {.parallel = true, .axis = l->direction, .size = size, .depth = depth};
    f.u = v3_normalize(v3_cross(f.axis, fabsf(f.axis.x) < 0.5f ? v3(1, 0, 0) : v3(0, 1, 0)));
    f.v = v3_cross(f.axis, f.u);
    vec3 low = v3(INFINITY, INFINITY, INFINITY), high = v3_neg(low);
    for (int i = 0; i < 8; i++) {
        vec3 p = v3(i & 1 ? s->bounds_max.x : s->bounds_min.x, i & 2 ? s->bounds_max.y : s->bounds_min.y,
                    i & 4 ? s->bounds_max.z : s->bounds_min.z);
        vec3 q = v3(v3_dot(p, f.u), v3_dot(p, f.v), v3_dot(p, f.axis));
        low = v3(fminf(low.x, q.x), fminf(low.y, q.y), fminf(low.z, q.z));
        high = v3(fmaxf(high.x, q.x), fmaxf(high.y, q.y), fmaxf(high.z, q.z));
    }
    f.width = fmaxf(high.x - low.x, high.y - low.y);
    float before = 1e-3f * f.width; /* so that what lies in the near plane is met */
    f.origin = v3_mad(v3_mad(v3_scale(f.u, low.x), low.y, f.v), low.z - before, f.axis);
    return f;
}

/* 4 x 4 texels a packet, as the renderer traces 4 x 4 pixels. */
static void build(const face *f, const tracer *t)
{
    ray_packet p;
    packet_init(&p);
    float step = (f->parallel ? f->width : 2.0f) / (float)f->size, from = f->parallel ? 0.0f : -1.0f;
    for (uint32_t y = 0; y < f->size; y += 4)
        for (uint32_t x = 0; x < f->size; x += 4) {
            for (uint32_t k = 0; k < GROUP; k++) {
                float across = from + ((float)(x + k % 4) + 0.5f) * step,
                      along = from + ((float)(y + k / 4) + 0.5f) * step;
                vec3 shift = v3_mad(v3_scale(f->u, across), along, f->v);
                vec3 origin = f->parallel ? v3_add(f->origin, shift) : f->origin;
                vec3 direction = f->parallel ? f->axis : v3_add(f->axis, shift);
                p.org_x[k] = origin.x, p.org_y[k] = origin.y, p.org_z[k] = origin.z;
                p.dir_x[k] = direction.x, p.dir_y[k] = direction.y, p.dir_z[k] = direction.z;
                p.tfar[k] = INFINITY;
            }
            tracer_distance16(t, &p, 0xffffu, true);
            for (uint32_t k = 0; k < GROUP; k++)
                f->depth[(size_t)(y + k / 4) * f->size + x + k % 4] = p.tfar[k];
        }
}

/* What a look-up needs of an eye sample: a sixth of it, so that more of them stay near. */
typedef struct receiver {
    vec3 position, normal;
} receiver;

/* Whether the face's light reaches the receiver, with so many texels of bias. */
static bool reaches(const face *f, const receiver *r, float bias)
{
    vec3 d = v3_sub(r->position, f->origin), n = r->normal;
    float depth = v3_dot(d, f->axis), texels = (float)f->size;
    float width = f->parallel ? f->width : 2.0f * depth, per_width = texels / width;
    float facing = fabsf(f->parallel ? v3_dot(n, f->axis) : v3_dot(n, d) / depth);
    float slope = (fabsf(v3_dot(n, f->u)) + fabsf(v3_dot(n, f->v))) / facing;
    float shift = f->parallel ? 0.0f : 0.5f * texels;
    float x = v3_dot(d, f->u) * per_width + shift, y = v3_dot(d, f->v) * per_width + shift;
    uint32_t last = f->size - 1, i = x > 0.0f ? (uint32_t)x : 0, j = y > 0.0f ? (uint32_t)y : 0;
    float stored = f->depth[(size_t)(j < last ? j : last) * f->size + (i < last ? i : last)];
    return !(stored * per_width < depth * per_width - bias * (1.0f + (slope < SLOPE_MAX ? slope : SLOPE_MAX)));
}

/* The face of the cube that it lies in. */
static uint32_t face_of(const light *l, const receiver *r)
{
    if (l->kind == LIGHT_DIRECTIONAL)
        return 0;
    vec3 d = v3_sub(r->position, l->position);
    float x = fabsf(d.x), y = fabsf(d.y), z = fabsf(d.z);
    return x >= y && x >= z ? d.x < 0.0f : y >= z ? 2u + (d.y < 0.0f) : 4u + (d.z < 0.0f);
}

typedef struct result {
    uint64_t *visible[BIASES]; /* [eye samples][words] */
    uint32_t words, maps;
    double build_s, lookup_s;
} result;

typedef struct bucket {
    uint32_t *eyes, count;
} bucket;

static void ask(const face *f, const stage *s, const receiver *at, const bucket *b, uint32_t index, result *out)
{
    double start = lighting_now();
    build(f, s->tracer);
    double built = lighting_now();
    for (uint32_t i = 0; i < b->count; i++)
        out->visible[TIMED][(size_t)b->eyes[i] * out->words + index / 64] |=
            (uint64_t)reaches(f, &at[b->eyes[i]], biases[TIMED]) << index % 64;
    out->build_s += built - start;
    out->lookup_s += lighting_now() - built;
    out->maps++;
    for (int k = 0; k < BIASES; k++)
        for (uint32_t i = 0; i < b->count && k != TIMED; i++)
            out->visible[k][(size_t)b->eyes[i] * out->words + index / 64] |=
                (uint64_t)reaches(f, &at[b->eyes[i]], biases[k]) << index % 64;
}

static void ask_light(const stage *s, const receiver *at, uint32_t count, const light_bits *bits, uint32_t index,
                      float *depth, uint32_t size, bucket buckets[FACES], result *out)
{
    const light *l = &s->scene->lights[index];
    double start = lighting_now();
    for (int k = 0; k < FACES; k++)
        buckets[k].count = 0;
    for (uint32_t i = 0; i < count; i++)
        if (bits->asked[(size_t)i * bits->words + bits->punctual + index / 64] >> index % 64 & 1u) {
            bucket *b = &buckets[face_of(l, &at[i])];
            b->eyes[b->count++] = i;
        }
    out->lookup_s += lighting_now() - start;
    for (uint32_t k = 0; k < FACES; k++) {
        if (buckets[k].count == 0)
            continue;
        face f = l->kind == LIGHT_DIRECTIONAL ? parallel_face(l, s->scene, size, depth) : cube_face(l, k, size, depth);
        ask(&f, s, at, &buckets[k], index, out);
    }
}

static result ask_maps(const stage *s, const eye_list *eyes, const light_bits *bits, uint32_t size)
{
    result out = {.words = bits->words - bits->punctual};
    float *depth = xmalloc((size_t)size * size * sizeof *depth);
    double start = lighting_now();
    receiver *at = xmalloc(((size_t)eyes->count + 1) * sizeof *at);
    for (uint32_t i = 0; i < eyes->count; i++)
        at[i] = (receiver){eyes->items[i].surface.position, eyes->items[i].surface.geometric_normal};
    out.lookup_s += lighting_now() - start;
    bucket buckets[FACES];
    for (int k = 0; k < FACES; k++)
        buckets[k].eyes = xmalloc(((size_t)eyes->count + 1) * sizeof(uint32_t));
    for (int k = 0; k < BIASES; k++)
        out.visible[k] = xcalloc((size_t)eyes->count * out.words + 1, sizeof(uint64_t));
    for (uint32_t i = 0; i < s->scene->light_count; i++)
        ask_light(s, at, eyes->count, bits, i, depth, size, buckets, &out);
    for (int k = 0; k < FACES; k++)
        free(buckets[k].eyes);
    free(at);
    free(depth);
    return out;
}

/* Share of the pairs that a bias decides wrongly. */
static double wrong(const result *r, int bias, const light_bits *exact, uint32_t count)
{
    uint64_t wrong = 0, asked = 0;
    for (size_t i = 0; i < count; i++)
        for (uint32_t w = 0; w < r->words; w++) {
            size_t at = i * exact->words + exact->punctual + w;
            wrong += (uint32_t)__builtin_popcountll((exact->visible[at] ^ r->visible[bias][i * r->words + w]) &
                                                    exact->asked[at]);
            asked += (uint32_t)__builtin_popcountll(exact->asked[at]);
        }
    return asked ? (double)wrong / (double)asked : 0.0;
}

typedef struct known {
    const uint64_t *visible;
    uint32_t words;
} known;

static void decide(void *context, chunk *c, const uint32_t *eyes, tile_pixels *pixels)
{
    const known *k = context;
    const pair_bits *b = &c->bits[LIGHTS_PUNCTUAL];
    (void)pixels;
    for (uint32_t e = 0; e < c->count; e++)
        for (uint32_t w = 0; w < b->words; w++)
            b->visible[(size_t)e * b->words + w] =
                b->asked[(size_t)e * b->words + w] & k->visible[(size_t)eyes[e] * k->words + w];
}

static void compare(const stage *s, uint32_t size)
{
    double start = lighting_now();
    eye_list eyes = eye_list_new(&s->view);
    double eyes_s = lighting_now() - start;
    lit warm = lighting_exact(&s->view, &s->lights, &eyes);
    lit_free(&warm);
    lit exact = lighting_exact(&s->view, &s->lights, &eyes);
    result r = ask_maps(s, &eyes, &exact.bits, size);
    int best = 0;
    double share[BIASES];
    for (int k = 0; k < BIASES; k++) {
        share[k] = wrong(&r, k, &exact.bits, eyes.count);
        best = share[k] < share[best] ? k : best;
    }
    lit maps = lighting_render(&s->view, &s->lights, &eyes, NULL, decide, &(known){r.visible[best], r.words});
    image_error e = image_compare(&maps.image, &exact.image);
    double flip = flip_ldr(&maps.image, &exact.image, image_exposure(&exact.image), NULL);
    double exact_s = eyes_s + exact.seconds, without_s = eyes_s + maps.seconds + r.lookup_s,
           maps_s = without_s + r.build_s;
    printf("{");
    stage_print(s, eyes.count);
    printf(", \"map\": %u, \"maps\": %u, \"bias\": %g, \"build_s\": %.9g, \"lookup_s\": %.9g, "
           "\"exact_s\": %.9g, \"visibility_s\": %.9g, \"frame_s\": %.9g, ",
           size, r.maps, (double)biases[best], r.build_s, r.lookup_s, exact_s, exact.decide_s, maps_s);
    printf("\"faster\": %.9g, \"without_building\": %.9g, \"limit\": %.9g, ", exact_s / maps_s, exact_s / without_s,
           exact_s / (exact_s - exact.decide_s));
    printf("\"l_inf\": %.9g, \"p999\": %.9g, \"mispredicted\": %.9g, \"flip\": %.9g, \"sweep\": [", e.l_inf, e.p999,
           share[best], flip);
    for (int k = 0; k < BIASES; k++)
        printf("%s{\"bias\": %g, \"mispredicted\": %.9g}", k ? ", " : "", (double)biases[k], share[k]);
    printf("]}\n");
    for (int k = 0; k < BIASES; k++)
        free(r.visible[k]);
    lit_free(&maps);
    lit_free(&exact);
    eye_list_free(&eyes);
}

int main(int argc, char *argv[])
{
    stage s = stage_defaults("shadow_maps");
    int map = 1024, code = 0;
    message err = {{0}};
    const option table[] = {
        STAGE_OPTIONS(&s),
        {.name = "map", .kind = OPTION_INT, .value = &map, .min = 4, .max = 16384, .help = "texels a side"},
    };
    if (stage_open(&s, "Shadow maps of all punctual lights beside shadow rays, as JSON.", table,
                   sizeof table / sizeof *table, argc, argv, &code)) {
        bool ok = map % 4 == 0 || fail(&err, "--map takes multiples of 4, not %d", map);
        ok = ok && ((s.lights.count == 0 && s.scene->light_count > 0) ||
                    fail(&err, "maps are for punctual lights alone: --vpls 0, and a scene that has some"));
        if (ok)
            compare(&s, (uint32_t)map);
        code = program_end(&s.arguments, ok, &err);
    }
    stage_free(&s);
    return code;
}
