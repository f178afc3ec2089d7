/* Wall and CPU time in ms, and the peak memory of this process. */
#pragma once

#include "ctsplat/api.h"
#include <stdint.h>
#include <sys/resource.h>

CTS_C_BEGIN

double cts_wall_ms(void);          /* monotonic */
double cts_cpu_ms(void);           /* of this process, all threads, its terminated child processes, and time added */
uint64_t cts_peak_rss_bytes(void); /* maximum of this process, its child processes and values added */

/* Now, as YYYY-MM-DDTHH:MM:SSZ. */
typedef struct CtsUtc {
    char text[24];
} CtsUtc;
CtsUtc cts_utc_now(void);
CtsUtc cts_utc_at(int64_t seconds); /* since 1970 */

/* Adds the usage of processes that are not this one's children; returns their CPU time in ms. */
double cts_cpu_add_usage(const struct rusage *usage);
void cts_cpu_add_ms(double ms);

CTS_C_END
