/* SPDX-License-Identifier: Apache-2.0 */
/* Hides the differences between Embree 3.13 and Embree 4: header path and the last argument of the queries.
 * The build defines HAVE_EMBREE4 where it links Embree 4. */
#ifndef COMMON_EMBREE_COMPAT_H
#define COMMON_EMBREE_COMPAT_H

#include <stdbool.h>

#ifdef HAVE_EMBREE4
#include <embree4/rtcore.h>

static inline void embree_intersect1(RTCScene top, struct RTCRayHit *ray)
{
    rtcIntersect1(top, ray, NULL);
}

static inline void embree_occluded1(RTCScene top, struct RTCRay *ray)
{
    rtcOccluded1(top, ray, NULL);
}

static inline struct RTCIntersectArguments embree_intersect_arguments(bool coherent)
{
    struct RTCIntersectArguments a;
    rtcInitIntersectArguments(&a);
    a.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
    return a;
}

#define EMBREE_INTERSECT(width)                                                                                        \
    static inline void embree_intersect##width(const int *valid, RTCScene top, struct RTCRayHit##width *rays,          \
                                               bool coherent)                                                          \
    {                                                                                                                  \
        struct RTCIntersectArguments a = embree_intersect_arguments(coherent);                                         \
        rtcIntersect##width(valid, top, rays, &a);                                                                     \
    }

static inline struct RTCOccludedArguments embree_arguments(bool coherent)
{
    struct RTCOccludedArguments a;
    rtcInitOccludedArguments(&a);
    a.flags = coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
    return a;
}

#define EMBREE_OCCLUDED(width)                                                                                         \
    static inline void embree_occluded##width(const int *valid, RTCScene top, struct RTCRay##width *rays,              \
                                              bool coherent)                                                           \
    {                                                                                                                  \
        struct RTCOccludedArguments a = embree_arguments(coherent);                                                    \
        rtcOccluded##width(valid, top, rays, &a);                                                                      \
    }

#else
#include <embree3/rtcore.h>

static inline struct RTCIntersectContext embree_context(bool coherent)
{
    struct RTCIntersectContext c;
    rtcInitIntersectContext(&c);
    c.flags = coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
    return c;
}

static inline void embree_intersect1(RTCScene top, struct RTCRayHit *ray)
{
    struct RTCIntersectContext c = embree_context(false);
    rtcIntersect1(top, &c, ray);
}

#define EMBREE_INTERSECT(width)                                                                                        \
    static inline void embree_intersect##width(const int *valid, RTCScene top, struct RTCRayHit##width *rays,          \
                                               bool coherent)                                                          \
    {                                                                                                                  \
        struct RTCIntersectContext c = embree_context(coherent);                                                       \
        rtcIntersect##width(valid, top, &c, rays);                                                                     \
    }

static inline void embree_occluded1(RTCScene top, struct RTCRay *ray)
{
    struct RTCIntersectContext c = embree_context(false);
    rtcOccluded1(top, &c, ray);
}

#define EMBREE_OCCLUDED(width)                                                                                         \
    static inline void embree_occluded##width(const int *valid, RTCScene top, struct RTCRay##width *rays,              \
                                              bool coherent)                                                           \
    {                                                                                                                  \
        struct RTCIntersectContext c = embree_context(coherent);                                                       \
        rtcOccluded##width(valid, top, &c, rays);                                                                      \
    }

#endif

EMBREE_INTERSECT(4)
EMBREE_INTERSECT(8)
EMBREE_INTERSECT(16)
EMBREE_OCCLUDED(4)
EMBREE_OCCLUDED(8)
EMBREE_OCCLUDED(16)

#undef EMBREE_INTERSECT
#undef EMBREE_OCCLUDED

#endif
