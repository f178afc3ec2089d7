#include "dicom/net/wire.h"

#include <errno.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

/* Longest text: a path has 4 KiB. */
enum { MAX_TEXT = 1 << 16 };

bool cts_wire_read(int socket, void *bytes, size_t n)
{
    char *at = bytes;
    for (ssize_t part; n > 0; at += part, n -= (size_t)part)
        if ((part = TEMP_FAILURE_RETRY(recv(socket, at, n, 0))) <= 0)
            return false;
    return true;
}

static bool pass_text(int socket, const char *text)
{
    const size_t n = text ? strlen(text) + 1 : 0; /* with the 0 at its end */
    return cts_send_all(socket, &n, sizeof n) && cts_send_all(socket, text, n);
}

static bool take_text(int socket, const char **text)
{
    size_t n;
    char *copy;
    *text = NULL;
    if (!cts_wire_read(socket, &n, sizeof n) || n > MAX_TEXT)
        return false;
    if (n == 0)
        return true;
    if (!(*text = copy = malloc(n)) || !cts_wire_read(socket, copy, n))
        return false;
    copy[n - 1] = 0;
    return true;
}

#define TEXT(field) offsetof(CtsNetRequest, field)
static const size_t texts[] = {TEXT(net.own_aet),         TEXT(net.tls_ca),      TEXT(net.tls_key),
                               TEXT(net.tls_certificate), TEXT(net.credentials), TEXT(query.study_uid),
                               TEXT(query.series_uid),    TEXT(query.accession), TEXT(query.patient_id),
                               TEXT(query.study_date),    TEXT(query.modality),  TEXT(folder)};
enum { N_TEXTS = sizeof texts / sizeof *texts };

bool cts_wire_write_request(int socket, const CtsNetRequest *request)
{
    bool good = cts_send_all(socket, request, sizeof *request);
    for (int i = 0; i < N_TEXTS && good; i++)
        good = pass_text(socket, *(const char *const *)(const void *)((const char *)request + texts[i]));
    for (int i = 0; i < request->n_outgoing && good; i++)
        good = cts_send_all(socket, &request->outgoing[i], sizeof *request->outgoing) &&
               pass_text(socket, request->outgoing[i].path);
    return good;
}

bool cts_wire_read_request(int socket, CtsNetRequest *request)
{
    bool good = cts_wire_read(socket, request, sizeof *request);
    for (int i = 0; i < N_TEXTS && good; i++)
        good = take_text(socket, (const char **)(void *)((char *)request + texts[i]));
    good = good && (request->outgoing = calloc((size_t)request->n_outgoing + 1, sizeof *request->outgoing));
    for (int i = 0; i < request->n_outgoing && good; i++)
        good = cts_wire_read(socket, &request->outgoing[i], sizeof *request->outgoing) &&
               take_text(socket, &request->outgoing[i].path);
    return good;
}
