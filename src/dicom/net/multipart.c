#include "dicom/net/multipart.h"

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
    /* The first delimiter may be at the very start, as if a line had ended before it. */
    memcpy(m->held, "\r\n", 2);
    m->n_held = 2;
    return CTS_OK;
}

static void drop_bytes(CtsMultipart *m, size_t n)
{
    m->n_held -= n;
    memmove(m->held, m->held + n, m->n_held);
}

/* Consumes up to a delimiter, or to a possible start of one, which needs more data. */
static CtsStatus take_body(CtsMultipart *m, bool *more, CtsError *err)
{
    const char *at = memmem(m->held, m->n_held, m->delimiter, m->n_delimiter);
    const size_t kept = m->n_held < m->n_delimiter ? m->n_held : m->n_delimiter - 1;
    const size_t n = at ? (size_t)(at - m->held) : m->n_held - kept;
    const bool inside = m->state == CTS_PART_BODY;
    CtsStatus st = inside && n ? m->sink.bytes(m->sink.context, m->held, n, err) : CTS_OK;
    *more = !at;
    drop_bytes(m, at ? n + m->n_delimiter : n);
    if (st || !at)
        return st;
    m->state = CTS_PART_HEADER;
    return inside ? m->sink.end(m->sink.context, err) : CTS_OK;
}

/* The remainder of a delimiter's line ("--" ends the body), and a header up to its blank line, which may follow at
 * once. */
static CtsStatus take_header(CtsMultipart *m, bool *more, CtsError *err)
{
    const char *blank_line = memmem(m->held, m->n_held, "\r\n\r\n", 4);
    size_t n = 0;
    while (n < m->n_held && (m->held[n] == ' ' || m->held[n] == '\t'))
        n++;
    *more = !blank_line;
    if (m->n_held >= 2 && memcmp(m->held, "--", 2) == 0)
        m->state = CTS_PART_AFTER;
    else if (n < m->n_held && m->held[n] != '\r' && !(m->n_held == 1 && m->held[0] == '-'))
        return cts_fail(err, CTS_ERR_READ, "the peer's multipart answer is damaged after a boundary");
    else if (blank_line) {
        drop_bytes(m, (size_t)(blank_line - m->held) + 4);
        m->state = CTS_PART_BODY;
        return m->sink.begin(m->sink.context, err);
    } else if (m->n_held > CTS_MAX_PART_HEADER)
        return cts_fail(err, CTS_ERR_READ, "the peer's multipart answer has a header of more than %d bytes",
                        CTS_MAX_PART_HEADER);
    return CTS_OK;
}

CtsStatus cts_multipart_feed(CtsMultipart *m, const char *bytes, size_t n, CtsError *err)
{
    CtsStatus st = CTS_OK;
    while (n > 0 && !st && m->state != CTS_PART_AFTER) {
        const size_t room = sizeof m->held - m->n_held, part = n < room ? n : room;
        memcpy(m->held + m->n_held, bytes, part);
        m->n_held += part;
        bytes += part;
        n -= part;
        for (bool more = false; !st && !more && m->state != CTS_PART_AFTER;)
            st = m->state == CTS_PART_HEADER ? take_header(m, &more, err) : take_body(m, &more, err);
    }
    return st;
}

CtsStatus cts_multipart_finish(const CtsMultipart *m, CtsError *err)
{
    return m->state == CTS_PART_AFTER ? CTS_OK
                                      : cts_fail(err, CTS_ERR_READ, "the peer's answer ends before its last part does");
}
