/* Wall and CPU time in ms, and the peak memory of this process. */
#pragma once

#include "ctsplat/api.h"
#include <stdint.h>

CTS_C_BEGIN

double cts_wall_ms(void);          /* monotonic */
double cts_cpu_ms(void);           /* of this process, all threads, and its sandboxes */
uint64_t cts_peak_rss_bytes(void); /* maximum of this process and its sandboxes */

/* Now, as YYYY-MM-DDTHH:MM:SSZ. */
typedef struct CtsUtc {
    char text[24];
} CtsUtc;
CtsUtc cts_utc_now(void);
CtsUtc cts_utc_at(int64_t seconds); /* since 1970 */

/* Adds CPU time that a sandbox reports, and the peak of its memory. */
void cts_cpu_add(double ms, int64_t peak_kib);

CTS_C_END
