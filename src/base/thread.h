/* Threads whose stacks are large enough, whatever the limit of the process is (ulimit -s). */
#ifndef CTS_BASE_THREAD_H
#define CTS_BASE_THREAD_H

#include "ctsplat/api.h"
#include <pthread.h>

CTS_C_BEGIN

typedef void *(*CtsThreadFn)(void *context);

/* As pthread_create() with a stack of 8 MiB, what Linux gives a process by default; only what is used takes memory.
 * Returns 0, or an errno. */
int cts_thread_start(pthread_t *thread, CtsThreadFn run, void *context);
/* Calls run(context) here, or where this process's stack may not grow to so much, in a thread that may, which takes all
 * signals meanwhile. Returns what run returns; where no thread can be had, it runs here. */
void *cts_thread_with_stack(CtsThreadFn run, void *context);

CTS_C_END
#endif
