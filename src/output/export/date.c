#include "output/export/format.h"

#include <errno.h>
#include <stdlib.h>

static const long long last_second = 253402300799; /* 9999-12-31 23:59:59: DICOM dates have four digits a year */

bool cts_date_now(struct tm *date)
{
    const char *text = getenv("SOURCE_DATE_EPOCH");
    if (text && *text >= '0' && *text <= '9') {
        char *end;
        errno = 0;
        const long long seconds = strtoll(text, &end, 10);
        if (!errno && !*end && seconds <= last_second && gmtime_r(&(time_t){(time_t)seconds}, date))
            return true;
    }
    const time_t now = time(NULL);
    localtime_r(&now, date);
    return false;
}
