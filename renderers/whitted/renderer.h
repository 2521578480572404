/* SPDX-License-Identifier: Apache-2.0 */
/* whitted as renderers/common/comparison.h sees it. */
#ifndef WHITTED_RENDERER_H
#define WHITTED_RENDERER_H

#include "whitted.h"

#include "../common/comparison.h"

typedef struct whitted {
    view view;
    truth known; /* taken down by an exact frame for the one behind it */
} whitted;

/* Names of the values of options, NULL-terminated. */
extern const char *const visibility_names[], *const store_names[], *const hash_names[];

/* `compare`: mispredictions are to be counted, if there is room for that. Free w->known at the end. */
renderer whitted_renderer(whitted *w, bool compare);

#endif
