/* SPDX-License-Identifier: Apache-2.0 */
/* Direct light by whitted, for a test of bdpt: both have types of the same names. */
#ifndef TESTS_AGREEMENT_H
#define TESTS_AGREEMENT_H

#include "../renderers/common/emitters.h"
#include "../renderers/common/tracer.h"

#include <stdint.h>

/* Mean luminance that is reflected once towards the camera, without virtual point lights. */
double whitted_direct(const scene *s, const tracer *t, const emitters *e, const camera *c, uint32_t width,
                      uint32_t height, uint64_t seed);

#endif
