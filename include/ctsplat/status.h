/* Error handling: a status as return value, and one message in a record that the caller owns. */
#pragma once

#include "ctsplat/api.h"

CTS_API_BEGIN

/* Groups leave gaps so that they can grow. */
typedef enum CtsStatus {
    CTS_OK = 0,
    CTS_ERR_MEMORY = 10,
    CTS_ERR_USAGE = 20,       /* an option or setting is not valid */
    CTS_ERR_PRESET = 21,      /* a preset is not valid */
    CTS_ERR_READ = 30,        /* the input cannot be read */
    CTS_ERR_NO_SERIES = 31,   /* the input holds no CT series */
    CTS_ERR_SYNTAX = 32,      /* a transfer syntax this build lacks */
    CTS_ERR_GEOMETRY = 40,    /* the series' geometry is refused */
    CTS_ERR_PIXELS = 41,      /* the series' pixel data is refused */
    CTS_ERR_OUTPUT = 50,      /* an output could not be written */
    CTS_ERR_INTERRUPTED = 60, /* the caller requested a stop */
    CTS_ERR_INTERNAL = 70     /* a fault of ctsplat's own */
} CtsStatus;

/* Filled by the call that fails; text is one line without a final newline. */
typedef struct CtsError {
    CtsStatus status;
    char text[1024];
} CtsError;

/* Sets err (which may be NULL) and returns status, so that a failure is one statement. */
CtsStatus cts_fail(CtsError *err, CtsStatus status, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* Puts the context in front of the message: "reading IM3: ..."; returns err's status. */
CtsStatus cts_context(CtsError *err, const char *format, ...) __attribute__((format(printf, 2, 3)));

CTS_API_END
