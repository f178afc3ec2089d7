#include "base/clock.h"

#include <stdatomic.h>
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

CtsUtc cts_utc_at(int64_t seconds)
{
    CtsUtc at = {""};
    struct tm utc;
    if (gmtime_r(&(time_t){seconds}, &utc))
        strftime(at.text, sizeof at.text, "%Y-%m-%dT%H:%M:%SZ", &utc);
    return at;
}

CtsUtc cts_utc_now(void)
{
    return cts_utc_at((int64_t)time(NULL));
}

static double seconds_ms(const struct timeval *t)
{
    return (double)t->tv_sec * 1e3 + (double)t->tv_usec * 1e-3;
}

/* Global state of this file: time added by cts_cpu_add_usage(). */
static _Atomic int64_t added_us;
static atomic_long added_kib;

void cts_cpu_add_ms(double ms)
{
    added_us += (int64_t)(ms * 1e3);
}

double cts_cpu_add_usage(const struct rusage *usage)
{
    const double ms = seconds_ms(&usage->ru_utime) + seconds_ms(&usage->ru_stime);
    cts_cpu_add_ms(ms);
    for (long most = added_kib; usage->ru_maxrss > most;)
        if (atomic_compare_exchange_weak(&added_kib, &most, usage->ru_maxrss))
            break;
    return ms;
}

double cts_cpu_ms(void)
{
    struct rusage children;
    getrusage(RUSAGE_CHILDREN, &children);
    return read_ms(CLOCK_PROCESS_CPUTIME_ID) + seconds_ms(&children.ru_utime) + seconds_ms(&children.ru_stime) +
           (double)added_us * 1e-3;
}

uint64_t cts_peak_rss_bytes(void)
{
    struct rusage self, children;
    getrusage(RUSAGE_SELF, &self);
    getrusage(RUSAGE_CHILDREN, &children);
    const long own = self.ru_maxrss > children.ru_maxrss ? self.ru_maxrss : children.ru_maxrss;
    return (uint64_t)(own > added_kib ? own : added_kib) * 1024;
}
