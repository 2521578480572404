/* SPDX-License-Identifier: Apache-2.0 */
/* What image_load shares with the readers of the single formats. */
#ifndef COMMON_IMAGE_FILES_H
#define COMMON_IMAGE_FILES_H

#include "image.h"

/* Larger images are taken for damaged headers: 2^28 pixels are 3 GiB of floats. */
#define IMAGE_MAX_PIXELS ((uint64_t)1 << 28)

/* As image_new, but false with a message instead of an exit: for sizes that a file claims. */
bool image_new_checked(uint64_t width, uint64_t height, image *out, message *err);

/* Decodes a whole OpenEXR file held in memory; `grey`: a luminance alone will do; `texts` as image_load_exr_texts, or
 * NULL. The message does not name the file. On failure *out is empty. */
bool exr_decode(const unsigned char *bytes, size_t size, bool grey, exr_text *texts, size_t text_count, image *out,
                message *err);

#endif
