#include "base/thread.h"

#include <signal.h>
#include <sys/resource.h>

static const size_t STACK_BYTES = 8 << 20;

int cts_thread_start(pthread_t *thread, CtsThreadFn run, void *context)
{
    pthread_attr_t attributes;
    int error = pthread_attr_init(&attributes);
    if (error)
        return error;
    error = pthread_attr_setstacksize(&attributes, STACK_BYTES);
    if (!error)
        error = pthread_create(thread, &attributes, run, context);
    pthread_attr_destroy(&attributes);
    return error;
}

void *cts_thread_with_stack(CtsThreadFn run, void *context)
{
    pthread_t thread;
    struct rlimit stack;
    sigset_t all, before;
    void *result = NULL;
    if (getrlimit(RLIMIT_STACK, &stack) || stack.rlim_cur >= STACK_BYTES || cts_thread_start(&thread, run, context))
        return run(context);
    /* Signals are to be handled by other threads than the waiting one. */
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    pthread_join(thread, &result);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return result;
}
