#include "output/net/multipart.h"

#include <stdio.h>
#include <string.h>
#include <strings.h>

CtsStatus cts_multipart_start(CtsMultipart *m, const char *content_type, const CtsPartSink *sink, CtsError *err)
{
    const char *at = content_type;
    memset(m, 0, sizeof *m);
    m->sink = *sink;
    if (strncasecmp(at, "multipart/", 10) != 0)
        return cts_fail(err, CTS_ERR_READ, "the peer answers with %.60s, not with multipart/related", content_type);
    while ((at = strchr(at, ';'))) {
        at++;
        at += strspn(at, " \t");
        if (strncasecmp(at, "boundary=", 9) == 0)
            break;
    }
    if (!at)
        return cts_fail(err, CTS_ERR_READ, "the peer's multipart answer has no boundary");
    at += 9;
    const bool quoted = *at == '"';
    at += quoted;
    const size_t n = strcspn(at, quoted ? "\"" : "; \t\r\n");
    if (n < 1 || n > CTS_MAX_BOUNDARY)
        return cts_fail(err, CTS_ERR_READ, "the peer's multipart answer has a boundary of %zu characters", n);
    m->n_delimiter = (size_t)snprintf(m->delimiter, sizeof m->delimiter, "\r\n--%.*s", (int)n, at);
    /* The first delimiter may stand at the very start: as if a line had ended before. */
    memcpy(m->held, "\r\n", 2);
    m->n_held = 2;
    return CTS_OK;
}

/* One more byte of the body: held back while it may belong to a delimiter. */
static CtsStatus take_body(CtsMultipart *m, char byte, bool store, CtsError *err)
{
    CtsStatus st = CTS_OK;
    m->held[m->n_held++] = byte;
    while (m->n_held > 0 && memcmp(m->held, m->delimiter, m->n_held) != 0) {
        /* A delimiter starts with CR and has no other: what is held can only start anew at its next CR. */
        const char *next = memchr(m->held + 1, '\r', m->n_held - 1);
        const size_t n = next ? (size_t)(next - m->held) : m->n_held;
        if (store && (st = m->sink.bytes(m->sink.context, m->held, n, err)))
            return st;
        memmove(m->held, m->held + n, m->n_held - n);
        m->n_held -= n;
    }
    if (m->n_held < m->n_delimiter)
        return CTS_OK;
    m->n_held = 0;
    m->state = CTS_PART_LINE;
    return store ? m->sink.end(m->sink.context, err) : CTS_OK;
}

/* The rest of a delimiter's line: "--" ends everything. */
static CtsStatus take_line(CtsMultipart *m, char byte, CtsError *err)
{
    if (m->n_held == 4)
        return cts_fail(err, CTS_ERR_READ, "the peer's multipart answer is damaged after a boundary");
    if (byte != ' ' && byte != '\t')
        m->held[m->n_held++] = byte;
    if (m->n_held == 2 && memcmp(m->held, "--", 2) == 0)
        m->state = CTS_PART_AFTER;
    else if (m->n_held == 2 && memcmp(m->held, "\r\n", 2) == 0)
        m->state = CTS_PART_HEADER; /* held: a header may be empty, and then its blank line comes at once */
    return CTS_OK;
}

static CtsStatus take_header(CtsMultipart *m, char byte, CtsError *err)
{
    if (m->n_held == CTS_MAX_PART_HEADER)
        return cts_fail(err, CTS_ERR_READ, "the peer's multipart answer has a header of more than %d bytes",
                        CTS_MAX_PART_HEADER);
    m->held[m->n_held++] = byte;
    if (m->n_held < 4 || memcmp(m->held + m->n_held - 4, "\r\n\r\n", 4) != 0)
        return CTS_OK;
    m->n_held = 0;
    m->state = CTS_PART_BODY;
    return m->sink.begin(m->sink.context, err);
}

/* The bytes of a body that cannot belong to a delimiter, in one go. */
static size_t plain_run(const CtsMultipart *m, const char *bytes, size_t n)
{
    if (m->state != CTS_PART_BODY || m->n_held > 0)
        return 0;
    const char *cr = memchr(bytes, '\r', n);
    return cr ? (size_t)(cr - bytes) : n;
}

CtsStatus cts_multipart_feed(CtsMultipart *m, const char *bytes, size_t n, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (size_t i = 0; i < n && !st;) {
        const size_t run = plain_run(m, bytes + i, n - i);
        if (run > 0) {
            st = m->sink.bytes(m->sink.context, bytes + i, run, err);
            i += run;
            continue;
        }
        const char byte = bytes[i++];
        if (m->state == CTS_PART_BEFORE)
            st = take_body(m, byte, false, err);
        else if (m->state == CTS_PART_LINE)
            st = take_line(m, byte, err);
        else if (m->state == CTS_PART_HEADER)
            st = take_header(m, byte, err);
        else if (m->state == CTS_PART_BODY)
            st = take_body(m, byte, true, err);
    }
    return st;
}

CtsStatus cts_multipart_finish(const CtsMultipart *m, CtsError *err)
{
    return m->state == CTS_PART_AFTER ? CTS_OK
                                      : cts_fail(err, CTS_ERR_READ, "the peer's answer ends before its last part does");
}
