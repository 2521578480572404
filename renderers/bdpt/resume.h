/* SPDX-License-Identifier: Apache-2.0 */
/* A rendering goes on from its image: what it was rendered with is written beside it. */
#ifndef BDPT_RESUME_H
#define BDPT_RESUME_H

#include "render.h"

#include "../common/comparison.h"

/* Texts of all that must be the same, and how far it is. `s`: the settings of the image. */
void resume_texts(const view *v, const settings *s, uint32_t done, image_texts *out);
/* Reads an image with such texts; says what differs. */
bool resume_load(const char *path, const view *v, film *out, message *err);

#endif
