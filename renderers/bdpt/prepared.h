/* SPDX-License-Identifier: Apache-2.0 */
/* The ends of a batch's connections, as the cache wants them: prepared when they are first wanted, once per vertex,
 * however many connections it has. One thread's. */
#ifndef BDPT_PREPARED_H
#define BDPT_PREPARED_H

#include "bdpt.h"

typedef struct prepared prepared;
prepared *prepared_new(const view *v, const vcache *cache);
void prepared_free(prepared *o);
/* Another batch begins. */
void prepared_forget(prepared *o);

/* Of CONNECT_SURFACES (Eq. 6). The ends of `c` are wanted soon. */
void prepared_prefetch_vertices(const prepared *o, const batch *b, const connection *c);
const vcache_vertex *prepared_eye_vertex(prepared *o, const batch *b, const connection *c);
const vcache_vertex *prepared_light_vertex(prepared *o, const batch *b, const connection *c);
/* Of CONNECT_LIGHT (Eq. 7, 9): eye ends for the sky and for other lights differ. */
bool prepared_sky(const batch *b, const connection *c);
const vcache_eye *prepared_eye_end(prepared *o, const batch *b, const connection *c);
const vcache_light *prepared_light_end(prepared *o, const batch *b, const connection *c);
/* Those that were prepared: by eye vertex, by path. */
const vcache_eye *prepared_eye(const prepared *o, bool sky, uint32_t eye);
const vcache_light *prepared_lights(const prepared *o);

#endif
