/* Wall and CPU time in ms, and the peak memory of this process. */
#ifndef CTS_BASE_CLOCK_H
#define CTS_BASE_CLOCK_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

double cts_wall_ms(void);          /* monotonic */
double cts_cpu_ms(void);           /* this process, all threads, and its children that have ended */
double cts_thread_cpu_ms(void);    /* the calling thread */
uint64_t cts_peak_rss_bytes(void); /* the larger of this process and its children */

#ifdef __cplusplus
}
#endif
#endif
