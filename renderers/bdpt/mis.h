/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Weights of multiple importance sampling (Veach 1997, Sect. 9.2 and 10.2) by partial sums that grow with a sub-path,
 * so that a connection weighs itself against all other strategies in constant time (Georgiev 2012, "Implementing Vertex
 * Connection and Merging", Eq. 34 - 47 without merging; van Antwerpen 2011).
 *
 * Densities are those of drawing directions and points alone: Russian roulette is left out of the weights. They only
 * have to sum to one over the strategies of a path, and so they do whatever the roulette does on either side.
 * Each eye sub-path is connected to `partners` light sub-paths: such a strategy draws that many paths where meeting an
 * emitter draws one. With either heuristic it counts as that many, not as their square: they share an eye path and
 * hang together. Sums are relative to a connection. Where a batch has fewer paths than that the weights stay as they
 * are: light paths of one batch and eye paths of another find the same paths and must agree on them. Doubles: squared
 * densities of large and tiny scenes leave the range of floats.
 */
#ifndef BDPT_MIS_H
#define BDPT_MIS_H

typedef enum heuristic { HEURISTIC_BALANCE, HEURISTIC_POWER } heuristic;

/* Sums over the strategies with fewer vertices on this side, relative to this one: `connect` is the ratio that lacks
 * the density of the next vertex seen from the other side, `rest` all others without the two next densities. */
typedef struct mis {
    double connect, rest;
} mis;

static inline double mis_power(heuristic h, double ratio)
{
    return h == HEURISTIC_POWER ? ratio * ratio : ratio;
}

/* y_0: densities of the vertex alone and of the ray. `cosine` at an emitter, 1 for the environment; 0: a point or a
 * direction, which no eye path meets. */
static inline mis mis_light(heuristic h, double direct, double ray, double cosine, double partners)
{
    return (mis){mis_power(h, direct / ray), mis_power(h, cosine / ray) / partners};
}

/* z_0: `light_paths` may be connected to the pixel, whose directions have density `pdf`. */
static inline mis mis_camera(heuristic h, double light_paths, double pdf, double partners)
{
    return (mis){mis_power(h, light_paths / pdf) / partners, 0.0};
}

/* A new vertex at `distance` (1 where the sub-path begins at infinity), `cosine` of the arriving ray with the geometric
 * normal. */
static inline mis mis_arrive(heuristic h, mis m, double distance, double cosine)
{
    return (mis){m.connect * mis_power(h, distance * distance / cosine), m.rest / mis_power(h, cosine)};
}

/* Goes on in a direction of density `forward`, cosine with the geometric normal; `reverse`: density of the way back. */
static inline mis mis_scatter(heuristic h, mis m, double forward, double reverse, double cosine)
{
    return (mis){mis_power(h, 1.0 / forward),
                 mis_power(h, cosine / forward) * (m.rest * mis_power(h, reverse) + m.connect)};
}

/* Nothing can be connected to a specular vertex; both densities of its direction are the same. */
static inline mis mis_scatter_specular(heuristic h, mis m, double cosine)
{
    return (mis){0.0, m.rest * mis_power(h, cosine)};
}

/* One side's share of the denominator: `next` is the density per unit area of its last vertex seen from the other side,
 * `reverse` the density of its way back. */
static inline double mis_side(heuristic h, mis m, double next, double reverse)
{
    return mis_power(h, next) * (m.connect + m.rest * mis_power(h, reverse));
}

#endif
