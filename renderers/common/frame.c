/* SPDX-License-Identifier: Apache-2.0 */
#include "frame.h"

#include <stdlib.h>
#include <string.h>

void frame_free(frame *f)
{
    image *images[] = {&f->image, &f->lit, &f->seen, &f->normal, &f->cells};
    for (size_t i = 0; i < sizeof images / sizeof *images; i++)
        image_free(images[i]);
    free(f->depth);
    free(f->traced_share);
    free(f->extra);
    memset(f, 0, sizeof *f);
}
