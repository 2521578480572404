/* SPDX-License-Identifier: Apache-2.0 */
/* What each pair of vertices brings if nothing is in between (Veach 1997, Eq. 10.8), times its weight. */
#include "pilot.h"

/* Both ends of a connection. */
typedef struct link {
    vec3 direction;
    float distance2;
} link;

static link link_of(vec3 from, vec3 to)
{
    vec3 d = v3_sub(to, from);
    float d2 = v3_dot(d, d);
    return (link){d2 > 0.0f ? v3_scale(d, 1.0f / sqrtf(d2)) : d, d2};
}

/* What floats cannot hold is left out, and counted. */
static bool brings(connections *c, rgb value)
{
    float most = v3_max_component(value);
    if (most > 0.0f && most < INFINITY)
        return true;
    c->not_finite += !(most < INFINITY); /* or NaN */
    return false;
}

static void push(connections *c, connection item)
{
    if (c->count == c->capacity) {
        c->capacity = c->capacity ? 2 * c->capacity : 1024;
        c->items = xrealloc(c->items, c->capacity * sizeof *c->items);
    }
    c->items[c->count++] = item;
}

/* How an eye vertex scatters what comes along `wi`: f cosine, and both densities. */
typedef struct scattering {
    rgb value;
    float pdf, reverse, cosine; /* cosine: with the geometric normal */
} scattering;

static bool scatters(const vertex *x, vec3 wi, bool adjoint, scattering *out)
{
    const surface *s = &x->surface;
    out->cosine = v3_dot(s->geometric_normal, wi);
    float cosine = v3_dot(s->normal, wi);
    if (!(out->cosine > 0.0f) || !(cosine > 0.0f))
        return false;
    rgb f = material_eval_pdf(s, wi, &out->pdf);
    if (adjoint)
        cosine *= adjoint_correction(s, wi);
    out->value = v3_scale(v3_mul(x->throughput, f), cosine);
    if (!(v3_max_component(out->value) > 0.0f))
        return false;
    out->reverse = reverse_pdf(s, wi);
    return true;
}

static float weight(const settings *f, double eye_side, double light_side)
{
    return f->light_vertices >= 0 ? 1.0f : (float)(1.0 / (1.0 + eye_side + light_side));
}

/* Two surfaces. */
static rgb value_of(const settings *f, const vertex *z, const vertex *y)
{
    scattering a, b;
    link l = link_of(z->origin, y->origin);
    if (!(l.distance2 > 0.0f) || !scatters(z, l.direction, false, &a) || !scatters(y, v3_neg(l.direction), true, &b))
        return v3(0, 0, 0);
    double eye_side = mis_side(f->heuristic, z->mis, (double)b.pdf * a.cosine / l.distance2, a.reverse);
    double light_side = mis_side(f->heuristic, y->mis, (double)a.pdf * b.cosine / l.distance2, b.reverse);
    return v3_scale(v3_mul(a.value, b.value), weight(f, eye_side, light_side) / l.distance2);
}

/* A surface and y_0: next-event estimation by the light path's own light. */
static rgb value_of_light(const view *v, const vertex *z, const light_emission *y0)
{
    const settings *f = &v->settings;
    bool infinite = y0->kind == SOURCE_DIRECTIONAL || y0->kind == SOURCE_ENVIRONMENT;
    link l = infinite ? (link){v3_neg(y0->direction), 1.0f} : link_of(z->origin, y0->origin);
    scattering a;
    float pdf, cosine = 1.0f;
    if (!(l.distance2 > 0.0f) || !scatters(z, l.direction, false, &a))
        return v3(0, 0, 0);
    rgb radiance = light_sources_radiance(v->lights, y0, v3_neg(l.direction), &pdf);
    if (y0->kind == SOURCE_EMITTER)
        cosine = -v3_dot(y0->normal, l.direction);
    if (!(cosine > 0.0f))
        return v3(0, 0, 0);
    /* of the direction, as seen from here */
    double direct = (double)y0->pdf_direct * l.distance2 / cosine;
    bool met = y0->kind == SOURCE_EMITTER || y0->kind == SOURCE_ENVIRONMENT;
    double light_side = met ? mis_power(f->heuristic, a.pdf / direct) / f->partners : 0.0;
    double eye_side = mis_side(f->heuristic, z->mis, (double)pdf * a.cosine / l.distance2, a.reverse);
    return v3_scale(v3_mul(a.value, radiance), (float)(weight(f, eye_side, light_side) / direct));
}

/* Whether both ends look at each other. */
static bool faces(const vertex *x, vec3 towards)
{
    return v3_dot(x->surface.geometric_normal, towards) > 0.0f && v3_dot(x->surface.normal, towards) > 0.0f;
}

static bool faces_light(const vertex *z, const light_emission *y0)
{
    if (y0->kind == SOURCE_DIRECTIONAL || y0->kind == SOURCE_ENVIRONMENT)
        return faces(z, v3_neg(y0->direction));
    vec3 d = v3_sub(y0->origin, z->origin);
    return faces(z, d) && (y0->kind != SOURCE_EMITTER || v3_dot(y0->normal, d) < 0.0f);
}

static bool face(const vertex *z, const vertex *y)
{
    vec3 d = v3_sub(y->origin, z->origin);
    return faces(z, d) && faces(y, v3_neg(d));
}

static rgb value_now(const view *v, const batch *b, const connection *c)
{
    const vertex *z = &b->eye.vertices[c->eye];
    rgb all = c->light < 0 ? value_of_light(v, z, &b->start[c->path])
                           : value_of(&v->settings, z, &b->light.vertices[c->light]);
    return v3_scale(all, 1.0f / (float)b->partners);
}

/* Roulette: below what the pilot paths take for little, by luminance. */
static bool survives(const view *v, connections *all, connection *c)
{
    if (!v->pilot)
        return true;
    float least = v->pilot->least[pilot_region(&v->settings, c->pixel)];
    float value = luminance(c->value);
    if (value >= least)
        return true;
    if (!(rng_float(&all->roulette) * least < value))
        return false;
    c->value = v3_scale(c->value, least / value);
    return true;
}

static void push_pair(const view *v, const batch *b, bool valued, connections *out, connection c)
{
    c.value = valued ? value_now(v, b, &c) : v3(1, 1, 1);
    if (brings(out, c.value) && (!valued || survives(v, out, &c)))
        push(out, c);
}

static void connect_light(const view *v, const batch *b, uint32_t path, connection c, bool valued, connections *out)
{
    const vertex *z = &b->eye.vertices[c.eye];
    const light_emission *y0 = &b->start[path];
    c.kind = y0->kind == SOURCE_EMITTER ? CONNECT_SURFACES : CONNECT_LIGHT;
    c.light = -1;
    if (z->edges < EDGES_MAX && strategy_wanted(&v->settings, z->edges + 1, 1) && faces_light(z, y0))
        push_pair(v, b, valued, out, c);
}

static void connect_surfaces(const view *v, const batch *b, uint32_t path, connection c, bool valued, connections *out)
{
    const vertex *z = &b->eye.vertices[c.eye];
    c.kind = CONNECT_SURFACES;
    for (int i = 0; i < b->light.count[path]; i++) {
        c.light = b->light.of[path][i];
        const vertex *y = &b->light.vertices[c.light];
        int edges = z->edges + 1 + y->edges; /* specular vertices count as well */
        if (edges <= EDGES_MAX && strategy_wanted(&v->settings, edges, y->edges + 1) && face(z, y))
            push_pair(v, b, valued, out, c);
    }
}

/* t = 1. */
static void connect_camera(const view *v, const batch *b, uint32_t path, int32_t at, connections *out)
{
    const settings *f = &v->settings;
    const vertex *y = &b->light.vertices[at];
    float x_at, y_at, cosine;
    scattering s;
    if (y->edges >= EDGES_MAX || !strategy_wanted(f, y->edges + 1, y->edges + 1) ||
        !camera_project(&v->camera, y->origin, &x_at, &y_at, &cosine))
        return;
    link l = link_of(y->origin, v->camera.eye);
    if (!(l.distance2 > 0.0f) || !scatters(y, l.direction, true, &s))
        return;
    double pixels = (double)f->width * f->height;
    double pdf = (double)camera_pixel_pdf(&v->camera, cosine) / l.distance2; /* per unit area facing the camera */
    double light_side = f->partners * mis_side(f->heuristic, y->mis, pdf * s.cosine / pixels, s.reverse);
    rgb value = v3_scale(s.value, (float)(pdf / pixels * weight(f, 0.0, light_side)));
    connection c = {CONNECT_CAMERA, path, 0, at, value, (uint32_t)y_at * f->width + (uint32_t)x_at};
    if (brings(out, value) && survives(v, out, &c))
        push(out, c);
}

void connect_batch(const view *v, const batch *b, bool valued, connections *out)
{
    out->count = 0;
    out->roulette = rng_make(v->settings.seed ^ 0x726f756c65747465u, b->random[0]);
    /* Whose paths a path meets, so many places on, changes with the batch: the same ones each time show as a lattice.
     */
    uint32_t on[BATCH];
    for (uint32_t k = 0; k < b->partners; k++) {
        uint32_t first = k * b->count / b->partners, end = (k + 1) * b->count / b->partners;
        on[k] = first + rng_u32(&out->roulette) % (end - first);
    }
    for (uint32_t p = 0; p < b->count; p++) {
        uint32_t pixel = b->y[p] * v->settings.width + b->x[p];
        for (uint32_t k = 0; k < b->partners; k++) {
            uint32_t partner = (p + on[k]) % b->count;
            for (int i = 0; i < b->eye.count[p]; i++) {
                connection c = {.path = partner, .eye = b->eye.of[p][i], .pixel = pixel};
                if (b->lit[partner])
                    connect_light(v, b, partner, c, valued, out);
                connect_surfaces(v, b, partner, c, valued, out);
            }
        }
        for (int i = 0; i < b->light.count[p]; i++)
            connect_camera(v, b, p, b->light.of[p][i], out);
    }
}

void connect_visible(const view *v, const batch *b, connections *c)
{
    for (size_t i = 0; i < c->count; i++) {
        connection *x = &c->items[i];
        if (x->kind == CONNECT_CAMERA || !(x->value.x > 0.0f))
            continue;
        rgb value = value_now(v, b, x);
        x->value = brings(c, value) ? value : v3(0, 0, 0);
    }
}
