/* The time that outputs carry: SOURCE_DATE_EPOCH when it is set, so that files can be made again byte for byte. */
#ifndef CTS_EXPORT_DATE_H
#define CTS_EXPORT_DATE_H

#include "ctsplat/api.h"
#include <stdbool.h>
#include <time.h>

CTS_C_BEGIN

/* UTC from SOURCE_DATE_EPOCH (seconds since 1970), else local time now; returns whether it came from there. A value
 * that is no whole number of seconds up to the year 9999 counts as unset. */
bool cts_date_now(struct tm *date);

CTS_C_END
#endif
