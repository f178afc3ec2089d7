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

/* The group of the status, where that is none of a signal or of the program itself. */
int cts_exit_code(CtsStatus status)
{
    const int group = status / 10;
    return group == CTS_ERR_INTERRUPTED / 10 ? 130 : group == CTS_ERR_INTERNAL / 10 ? 1 : group;
}
