/* multipart/related bodies (RFC 2046) taken apart while they come. */
#ifndef CTS_DICOM_MULTIPART_H
#define CTS_DICOM_MULTIPART_H

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>

/* One call for the start of a part, some for its bytes, one for its end. A failure ends all. */
typedef struct CtsPartSink {
    CtsStatus (*begin)(void *context, CtsError *err);
    CtsStatus (*bytes)(void *context, const void *bytes, size_t n, CtsError *err);
    CtsStatus (*end)(void *context, CtsError *err);
    void *context;
} CtsPartSink;

enum { CTS_MAX_BOUNDARY = 70, CTS_MAX_PART_HEADER = 8192 };

typedef struct CtsMultipart {
    CtsPartSink sink;
    char delimiter[CTS_MAX_BOUNDARY + 5]; /* CR LF -- boundary */
    size_t n_delimiter;
    enum { CTS_PART_BEFORE, CTS_PART_HEADER, CTS_PART_BODY, CTS_PART_AFTER } state;
    char held[2 * CTS_MAX_PART_HEADER]; /* what came last: the start of a delimiter, perhaps, or a header so far */
    size_t n_held;
} CtsMultipart;

/* content_type: the response's header. CTS_ERR_READ when it is no multipart type with a boundary. */
CtsStatus cts_multipart_start(CtsMultipart *m, const char *content_type, const CtsPartSink *sink, CtsError *err);
CtsStatus cts_multipart_feed(CtsMultipart *m, const char *bytes, size_t n, CtsError *err);
/* CTS_ERR_READ when the last delimiter did not come. */
CtsStatus cts_multipart_finish(const CtsMultipart *m, CtsError *err);

#endif
