/* One thread serves all connections. */
#include "app/serve/server.h"

#include <microhttpd.h>
#include <poll.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* MAX_CONNECTIONS: each is an open file; one thread serves all. SILENCE_S: a connection without traffic is closed after
 * it, except one that waits for its picture. LAST_MS: time for the last answers to be sent when the server stops.
 * POLL_MS: between checks whether they are. */
enum { MAX_CONNECTIONS = 2000, SILENCE_S = 30, LAST_MS = 3000, POLL_MS = 5 };

struct CtsHttpServer {
    struct MHD_Daemon *daemon;
    CtsServer *server;
    atomic_int n_requests; /* requests without a complete answer */
};

static enum MHD_Result add_parameter(void *query, enum MHD_ValueKind kind, const char *name, const char *value)
{
    (void)kind;
    cts_query_add(query, name, value ? value : "");
    return MHD_YES;
}

void cts_http_query(const CtsHttpRequest *request, CtsQuery *query)
{
    MHD_get_connection_values(request->connection, MHD_GET_ARGUMENT_KIND, add_parameter, query);
}

void cts_http_wait(CtsHttpRequest *request)
{
    request->waits = true;
    MHD_suspend_connection(request->connection);
}

void cts_http_answer(CtsHttpRequest *request, CtsHttpAnswer *answer)
{
    request->answer = *answer;
    if (request->waits)
        MHD_resume_connection(request->connection);
}

const char *cts_http_header(const CtsHttpRequest *request, const char *name)
{
    return MHD_lookup_connection_value(request->connection, MHD_HEADER_KIND, name);
}

static bool has_body(const CtsHttpRequest *request)
{
    const char *length = cts_http_header(request, MHD_HTTP_HEADER_CONTENT_LENGTH);
    return cts_http_header(request, MHD_HTTP_HEADER_TRANSFER_ENCODING) || (length && strcmp(length, "0"));
}

static enum MHD_Result handle(void *context, struct MHD_Connection *connection, const char *path, const char *method,
                              const char *version, const char *body, size_t *n_body, void **kept)
{
    CtsHttpServer *const http = context;
    CtsHttpRequest *r = *kept;
    (void)version, (void)body;
    if (!r) {
        if (!(r = *kept = calloc(1, sizeof *r)))
            return MHD_NO;
        atomic_fetch_add(&http->n_requests, 1);
        *r = (CtsHttpRequest){
            .method = method,
            .path = path,
            .cookie = MHD_lookup_connection_value(connection, MHD_COOKIE_KIND, "ctsplat"),
            .socket = MHD_get_connection_info(connection, MHD_CONNECTION_INFO_CONNECTION_FD)->connect_fd,
            .connection = connection,
        };
        r->has_body = has_body(r);
        if (!r->has_body) /* answered before it is read, which ends the connection */
            return MHD_YES;
    }
    *n_body = 0;
    if (!r->is_dispatched) {
        r->is_dispatched = true;
        cts_routes_dispatch(http->server, r);
        if (r->waits)
            return MHD_YES;
    }
    if (!r->answer.response)
        return MHD_NO;
    return MHD_queue_response(connection, (unsigned)r->answer.status, r->answer.response);
}

static void completed(void *context, struct MHD_Connection *connection, void **kept,
                      enum MHD_RequestTerminationCode why)
{
    CtsHttpServer *const http = context;
    CtsHttpRequest *const r = *kept;
    (void)connection, (void)why;
    if (r)
        atomic_fetch_sub(&http->n_requests, 1);
    if (r && r->answer.response)
        MHD_destroy_response(r->answer.response);
    free(r);
    *kept = NULL;
}

CtsStatus cts_http_start(CtsHttpServer **http, CtsServer *server, int socket, const char *certificate, const char *key,
                         CtsError *err)
{
    CtsHttpServer *const s = *http = calloc(1, sizeof *s);
    if (!s)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    s->server = server;
    const struct MHD_OptionItem keys[] = {
        {MHD_OPTION_HTTPS_MEM_CERT, 0, (void *)(uintptr_t)certificate},
        {MHD_OPTION_HTTPS_MEM_KEY, 0, (void *)(uintptr_t)key},
        {MHD_OPTION_END, 0, NULL},
    };
    const unsigned flags = MHD_USE_EPOLL_INTERNAL_THREAD | MHD_ALLOW_SUSPEND_RESUME | (key ? MHD_USE_TLS : 0u);
    s->daemon = MHD_start_daemon(flags, 0, NULL, NULL, handle, s, MHD_OPTION_LISTEN_SOCKET, socket,
                                 MHD_OPTION_CONNECTION_LIMIT, (unsigned)MAX_CONNECTIONS, MHD_OPTION_CONNECTION_TIMEOUT,
                                 (unsigned)SILENCE_S, MHD_OPTION_NOTIFY_COMPLETED, completed, s, MHD_OPTION_ARRAY,
                                 key ? keys : keys + 2, MHD_OPTION_END);
    if (s->daemon)
        return CTS_OK;
    free(s);
    *http = NULL;
    return cts_fail(err, CTS_ERR_READ, "the server could not be started%s",
                    key ? " (is the certificate that of the key, both PEM?)" : "");
}

void cts_http_stop(CtsHttpServer **http)
{
    const int socket = MHD_quiesce_daemon((*http)->daemon);
    for (int ms = 0; ms < LAST_MS && atomic_load(&(*http)->n_requests); ms += POLL_MS)
        poll(NULL, 0, POLL_MS);
    MHD_stop_daemon((*http)->daemon);
    close(socket);
    free(*http);
    *http = NULL;
}
