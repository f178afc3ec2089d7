#include "ctsplat/status.h"

#include "base/exit_code.h"
#include "base/text.h"
#include <stdarg.h>
#include <stdio.h>

CtsStatus cts_fail(CtsError *err, CtsStatus status, const char *format, ...)
{
    if (err) {
        va_list args;
        va_start(args, format);
        vsnprintf(err->text, sizeof err->text, format, args);
        va_end(args);
        cts_text_clean(err->text); /* one message is one line, and drives no terminal */
        err->status = status;
    }
    return status;
}

CtsStatus cts_context(CtsError *err, const char *format, ...)
{
    if (!err)
        return CTS_ERR_INTERNAL;
    const CtsError why = *err;
    char what[sizeof why.text];
    va_list args;
    va_start(args, format);
    const size_t n = (size_t)vsnprintf(what, sizeof what, format, args);
    va_end(args);
    return n + 3 < sizeof what ? cts_fail(err, why.status, "%s: %s", what, why.text) : why.status;
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
