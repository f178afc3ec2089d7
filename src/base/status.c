#include "ctsplat/status.h"

#include "base/exit_code.h"
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* One message is one line: a file name or a header text must not be able to break it or to drive a terminal. */
static void escape_controls(char *text)
{
    for (unsigned char *c = (unsigned char *)text; *c; c++)
        if (*c < 0x20 || *c == 0x7f)
            *c = '?';
}

CtsStatus cts_fail(CtsError *err, CtsStatus status, const char *format, ...)
{
    if (err) {
        va_list args;
        va_start(args, format);
        vsnprintf(err->text, sizeof err->text, format, args);
        va_end(args);
        escape_controls(err->text);
        err->status = status;
    }
    return status;
}

CtsStatus cts_context(CtsError *err, const char *format, ...)
{
    if (!err)
        return CTS_ERR_INTERNAL;
    CtsError what;
    va_list args;
    va_start(args, format);
    vsnprintf(what.text, sizeof what.text, format, args);
    va_end(args);
    escape_controls(what.text);
    const size_t n = strlen(what.text);
    if (n + 3 < sizeof what.text) {
        snprintf(what.text + n, sizeof what.text - n, ": %.*s", (int)(sizeof what.text - n - 3), err->text);
        memcpy(err->text, what.text, sizeof err->text);
    }
    return err->status;
}

int cts_exit_code(CtsStatus status)
{
    switch (status) {
    case CTS_OK:
        return 0;
    case CTS_ERR_USAGE:
    case CTS_ERR_PRESET:
        return 2;
    case CTS_ERR_READ:
    case CTS_ERR_NO_SERIES:
    case CTS_ERR_SYNTAX:
        return 3;
    case CTS_ERR_GEOMETRY:
    case CTS_ERR_PIXELS:
        return 4;
    case CTS_ERR_OUTPUT:
        return 5;
    case CTS_ERR_INTERRUPTED:
        return 130;
    case CTS_ERR_MEMORY:
    case CTS_ERR_INTERNAL:
        return 1;
    }
    return 1;
}
