/* Threads with large stacks, independent of the process's limit (ulimit -s). */
#pragma once

#include "ctsplat/api.h"
#include <pthread.h>

CTS_C_BEGIN

typedef void *(*CtsThreadFn)(void *context);

/* pthread_create() with a stack of 8 MiB, Linux's default for a process; only used pages take memory. Returns 0, or an
 * errno. */
int cts_thread_start(pthread_t *thread, CtsThreadFn run, void *context);
/* Calls run(context) here, or, where this process's stack is limited to less, in a thread with a large stack, which
 * receives all signals meanwhile. Returns run's result; where no thread can be created, it runs here. */
void *cts_thread_with_stack(CtsThreadFn run, void *context);

CTS_C_END
