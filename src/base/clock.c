#include "base/clock.h"

#include <stdatomic.h>
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

/* Global state of this file: what cts_cpu_add() added. */
static _Atomic int64_t added_us, added_kib;

void cts_cpu_add(double ms, int64_t peak_kib)
{
    added_us += (int64_t)(ms * 1e3);
    for (int64_t most = added_kib; peak_kib > most;)
        if (atomic_compare_exchange_weak(&added_kib, &most, peak_kib))
            break;
}

double cts_cpu_ms(void)
{
    return read_ms(CLOCK_PROCESS_CPUTIME_ID) + (double)added_us * 1e-3;
}

uint64_t cts_peak_rss_bytes(void)
{
    struct rusage self;
    getrusage(RUSAGE_SELF, &self);
    return (uint64_t)(self.ru_maxrss > added_kib ? self.ru_maxrss : added_kib) * 1024;
}
