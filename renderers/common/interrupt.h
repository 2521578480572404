/* SPDX-License-Identifier: Apache-2.0 */
/* Ctrl-C ends a rendering early, but in order: what is finished can still be written. */
#ifndef COMMON_INTERRUPT_H
#define COMMON_INTERRUPT_H

#include <stdbool.h>

/* From now on the first SIGINT or SIGTERM only sets the flag, any further one kills the process as usual. A signal that
 * the parent process chose to ignore stays ignored. */
void interrupt_install(void);
/* Whether such a signal has come. Any thread; as cheap as reading a variable. */
bool interrupted(void);
/* The number of that signal, 0 where none has come. */
int interrupt_signal(void);

#endif
