/* SPDX-License-Identifier: Apache-2.0 */
/* Signal handling; see interrupt.h. */
#include "interrupt.h"

#include <signal.h>
#include <stdatomic.h>
#include <stddef.h>

#if ATOMIC_INT_LOCK_FREE != 2
#error "signal handlers need a lock-free atomic int"
#endif

/* The one variable of the program that a signal handler can reach: the number of the last signal. */
static atomic_int signal_seen;

static void on_signal(int number)
{
    if (atomic_exchange(&signal_seen, number)) {
        signal(number, SIG_DFL);
        raise(number); /* delivered when the handler returns */
    }
}

void interrupt_install(void)
{
    static const int numbers[] = {SIGINT, SIGTERM};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct sigaction old, action = {.sa_handler = on_signal, .sa_flags = SA_RESTART};
        sigemptyset(&action.sa_mask);
        if (sigaction(numbers[i], NULL, &old) == 0 && old.sa_handler != SIG_IGN)
            sigaction(numbers[i], &action, NULL);
    }
}

bool interrupted(void)
{
    return interrupt_signal() != 0;
}

int interrupt_signal(void)
{
    return atomic_load_explicit(&signal_seen, memory_order_relaxed);
}
