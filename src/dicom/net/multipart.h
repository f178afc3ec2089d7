/* A streaming parser of multipart/related bodies (RFC 2046). */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>

/* Callbacks for the start of a part, its bytes, and its end. A failure ends the parsing. */
typedef struct CtsPartSink {
    CtsStatus (*begin)(void *context, CtsError *err);
    CtsStatus (*bytes)(void *context, const void *bytes, size_t n, CtsError *err);
    CtsStatus (*end)(void *context, CtsError *err);
    void *context;
} CtsPartSink;

/* Longest boundary by RFC 2046 (5.1.1); longest header of a part, which has a few lines. */
enum { CTS_MAX_BOUNDARY = 70, CTS_MAX_PART_HEADER = 8192 };

typedef struct CtsMultipart {
    CtsPartSink sink;
    char delimiter[CTS_MAX_BOUNDARY + 5]; /* CR LF -- boundary */
    size_t n_delimiter;
    enum { CTS_PART_BEFORE, CTS_PART_HEADER, CTS_PART_BODY, CTS_PART_AFTER } state;
    /* unprocessed bytes: a possible start of a delimiter, or an incomplete header */
    char held[2 * CTS_MAX_PART_HEADER];
    size_t n_held;
} CtsMultipart;

/* content_type: the response's header. CTS_ERR_READ when it is no multipart type with a boundary. */
CtsStatus cts_multipart_start(CtsMultipart *m, const char *content_type, const CtsPartSink *sink, CtsError *err);
CtsStatus cts_multipart_feed(CtsMultipart *m, const char *bytes, size_t n, CtsError *err);
/* CTS_ERR_READ when the last delimiter is missing. */
CtsStatus cts_multipart_finish(const CtsMultipart *m, CtsError *err);
