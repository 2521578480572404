/* SPDX-License-Identifier: Apache-2.0 */
#include "turns.h"

#include "../common/scene.h"

#include <pthread.h>
#include <stdlib.h>

/* At most `threads` batches in a row wait, so that each has a place of its own. */
struct turns {
    pthread_mutex_t lock;
    size_t next, count;
    pthread_cond_t place[];
};

turns *turns_new(int threads)
{
    turns *t = xcalloc(1, sizeof *t + (size_t)threads * sizeof t->place[0]);
    t->count = (size_t)threads;
    pthread_mutex_init(&t->lock, NULL);
    for (size_t i = 0; i < t->count; i++)
        pthread_cond_init(&t->place[i], NULL);
    return t;
}

void turns_free(turns *t)
{
    if (!t)
        return;
    for (size_t i = 0; i < t->count; i++)
        pthread_cond_destroy(&t->place[i]);
    pthread_mutex_destroy(&t->lock);
    free(t);
}

void turns_begin(turns *t)
{
    t->next = 0;
}

void turns_wait(turns *t, size_t batch)
{
    pthread_mutex_lock(&t->lock);
    while (t->next != batch)
        pthread_cond_wait(&t->place[batch % t->count], &t->lock);
    pthread_mutex_unlock(&t->lock);
}

void turns_pass(turns *t)
{
    pthread_mutex_lock(&t->lock);
    t->next++;
    pthread_cond_signal(&t->place[t->next % t->count]);
    pthread_mutex_unlock(&t->lock);
}
