#include "base/clock.h"

#include <sys/resource.h>
#include <time.h>

static double read_ms(clockid_t id)
{
    struct timespec t;
    clock_gettime(id, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

double cts_wall_ms(void)
{
    return read_ms(CLOCK_MONOTONIC);
}

static double seconds_ms(const struct timeval *t)
{
    return (double)t->tv_sec * 1e3 + (double)t->tv_usec * 1e-3;
}

double cts_cpu_ms(void)
{
    struct rusage children;
    getrusage(RUSAGE_CHILDREN, &children);
    return read_ms(CLOCK_PROCESS_CPUTIME_ID) + seconds_ms(&children.ru_utime) + seconds_ms(&children.ru_stime);
}

double cts_thread_cpu_ms(void)
{
    return read_ms(CLOCK_THREAD_CPUTIME_ID);
}

uint64_t cts_peak_rss_bytes(void)
{
    struct rusage self, children;
    getrusage(RUSAGE_SELF, &self);
    getrusage(RUSAGE_CHILDREN, &children);
    const long kib = self.ru_maxrss > children.ru_maxrss ? self.ru_maxrss : children.ru_maxrss;
    return (uint64_t)kib * 1024;
}
