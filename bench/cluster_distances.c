/* SPDX-License-Identifier: Apache-2.0 */
/* How far from a true shadow edge are wrong answers? (Popov et al. 2013, Sect. 3.4: within C_E x C_E eye samples.) */
#include "clusters.h"
#include "distances.h"

#include <stdio.h>
#include <string.h>

enum { BINS = 16, QUARTERS = 4 };

typedef struct share {
    double wrong, beyond, diagonal, sum, pairs;
} share;

typedef struct walk {
    const record *r;
    const replay_bits *bits;
    uint8_t *mask[2]; /* of a light: pixels with an eye sample that does not see it, and with one that does */
    float *distance[2];
    uint8_t *quarter; /* of each eye sample, from near to far */
    double unit;      /* pixels */
    double bins[BINS + 1], largest;
    share all, quarters[QUARTERS], slants[2]; /* cosine above 1/2, below */
} walk;

static float depth_of(const record *r, uint32_t eye)
{
    return v3_length(v3_sub(r->eyes[eye].surface.position, r->view.camera.eye));
}

static int by_depth(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static void divide_by_depth(walk *s)
{
    const record *r = s->r;
    float *sorted = xmalloc((r->count + 1) * sizeof *sorted);
    for (uint32_t i = 0; i < r->count; i++)
        sorted[i] = depth_of(r, i);
    qsort(sorted, r->count, sizeof *sorted, by_depth);
    for (uint32_t i = 0; i < r->count; i++) {
        float depth = depth_of(r, i);
        s->quarter[i] = 0;
        for (uint32_t q = 1; q < QUARTERS; q++)
            s->quarter[i] += depth >= sorted[(uint64_t)q * r->count / QUARTERS];
    }
    free(sorted);
}

static void count_in(share *s, double distance)
{
    s->wrong += 1.0;
    s->sum += distance;
    s->beyond += distance > 1.0;
    s->diagonal += distance > sqrt(2.0);
}

static void add_wrong(walk *s, uint32_t eye, bool answered)
{
    const record *r = s->r;
    double pixels = (double)s->distance[answered][r->pixel[eye]] - 0.5;
    double d = fmax(0.0, pixels) / s->unit;
    double at = d * 4.0;
    s->bins[at < BINS ? (int)at : BINS] += 1.0;
    s->largest = isfinite(d) ? fmax(s->largest, d) : s->largest;
    const surface *hit = &r->eyes[eye].surface;
    vec3 back = v3_normalize(v3_sub(r->view.camera.eye, hit->position));
    count_in(&s->all, d);
    count_in(&s->quarters[s->quarter[eye]], d);
    count_in(&s->slants[fabsf(v3_dot(back, hit->geometric_normal)) < 0.5f], d);
}

static void one_light(walk *s, uint32_t i)
{
    const record *r = s->r;
    uint32_t width = r->view.settings.width, height = r->view.settings.height;
    bool any = false;
    for (int k = 0; k < 2; k++)
        memset(s->mask[k], 0, (size_t)width * height);
    for (uint32_t e = 0; e < r->count; e++) {
        if (!clusters_bit(r->asked, r, e, i))
            continue;
        s->mask[clusters_bit(r->visible, r, e, i)][r->pixel[e]] = 1;
        any |= clusters_bit(s->bits->wrong, r, e, i);
    }
    for (int k = 0; any && k < 2; k++)
        mask_distances(s->mask[k], width, height, s->distance[k]);
    for (uint32_t e = 0; any && e < r->count; e++)
        if (clusters_bit(s->bits->wrong, r, e, i))
            add_wrong(s, e, !clusters_bit(r->visible, r, e, i));
}

static void count_pairs(walk *s)
{
    for (uint32_t e = 0; e < s->r->count; e++)
        for (uint32_t w = 0; w < s->r->words; w++)
            s->quarters[s->quarter[e]].pairs += __builtin_popcountll(s->r->asked[(size_t)e * s->r->words + w]);
}

static void print_share(const share *s)
{
    double n = fmax(1.0, s->wrong);
    printf("\"wrong\": %.0f, \"mean\": %.6g, \"beyond\": %.6g, \"diagonal\": %.6g", s->wrong, s->sum / n, s->beyond / n,
           s->diagonal / n);
}

static void print(const walk *s)
{
    double n = fmax(1.0, s->all.wrong), within = 0.0;
    printf(", \"distance\": {\"unit\": %.6g, \"largest\": %.6g, ", s->unit, s->largest);
    print_share(&s->all);
    printf(", \"bins\": [");
    for (int i = 0; i <= BINS; i++) {
        within += s->bins[i] / n;
        printf("%s{\"from\": %g, \"share\": %.6g, \"within\": %.6g}", i ? ", " : "", 0.25 * i, s->bins[i] / n, within);
    }
    printf("], \"quarters\": [");
    for (int i = 0; i < QUARTERS; i++) {
        printf("%s{\"mispredicted\": %.6g, ", i ? ", " : "", s->quarters[i].wrong / fmax(1.0, s->quarters[i].pairs));
        print_share(&s->quarters[i]);
        printf("}");
    }
    printf("], \"slants\": [{");
    print_share(&s->slants[0]);
    printf("}, {");
    print_share(&s->slants[1]);
    printf("}]}");
}

void print_distances(const record *r, const grid_policy *p, const replay_bits *bits)
{
    const settings *f = &r->view.settings;
    size_t pixels = (size_t)f->width * f->height;
    walk s = {.r = r, .bits = bits, .unit = (double)p->ce / sqrt(f->spp)};
    for (int k = 0; k < 2; k++) {
        s.mask[k] = xmalloc(pixels);
        s.distance[k] = xmalloc(pixels * sizeof *s.distance[k]);
    }
    s.quarter = xmalloc(r->count + 1);
    divide_by_depth(&s);
    count_pairs(&s);
    for (uint32_t i = 0; i < r->lights.count; i++)
        one_light(&s, i);
    print(&s);
    for (int k = 0; k < 2; k++) {
        free(s.mask[k]);
        free(s.distance[k]);
    }
    free(s.quarter);
}
