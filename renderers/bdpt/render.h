/* SPDX-License-Identifier: Apache-2.0 */
/* Progressive rendering: passes until there are enough, or until time is up. */
#ifndef BDPT_RENDER_H
#define BDPT_RENDER_H

#include "film.h"

#include "../common/frame.h"

/* What a frame counts besides (frame.extra). */
typedef struct frame_passes {
    uint32_t passes, from; /* paths per pixel; of these: from the file that was gone on from */
    uint64_t camera_rays;  /* connections to the camera */
    uint64_t not_finite;   /* contributions and light paths left out, for they are beyond what floats hold */
    double asking_s;       /* seconds of all threads in what settings.deterministic lets one do at a time */
} frame_passes;

static inline const frame_passes *passes_of(const frame *f)
{
    return f->extra;
}

/* Fills in a view whose settings stand; `l` may be NULL. */
void view_set(view *v, const scene *s, const tracer *t, const light_sources *l, const camera *c);

/* Memory that the images of one frame take, and what light paths bring to other pixels. */
uint64_t bdpt_frame_bytes(const settings *f);
/* `start`: NULL, or the passes to go on from (left as they are). frame.shade_s becomes the time spent on visibility of
 * connections, frame.rays their counts. */
bool bdpt_render(const view *v, const film *start, const char *title, bool quiet, frame *out, message *err);

#endif
