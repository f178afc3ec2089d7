/* The time that outputs carry: SOURCE_DATE_EPOCH when it is set, so that files can be made again byte for byte. */
#ifndef CTS_EXPORT_DATE_H
#define CTS_EXPORT_DATE_H

#include <stdbool.h>
#include <time.h>

#ifdef __cplusplus
extern "C" {
#endif

/* UTC from SOURCE_DATE_EPOCH (seconds since 1970), else local time now; returns whether it came from there. A value
 * that is no whole number of seconds up to the year 9999 counts as unset. */
bool cts_date_now(struct tm *date);

#ifdef __cplusplus
}
#endif
#endif
