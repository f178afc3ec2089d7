/* HTTP by libmicrohttpd: requests and their answers. */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>

struct CtsServer;
struct CtsQuery;
struct MHD_Connection;
struct MHD_Response;
typedef struct CtsHttpServer CtsHttpServer;

typedef struct CtsHttpAnswer {
    int status;
    struct MHD_Response *response; /* NULL: there was no memory for it */
} CtsHttpAnswer;

/* A request until it is answered. It owns its texts. */
typedef struct CtsHttpRequest {
    const char *method, *path;
    const char *cookie; /* value of the one called ctsplat */
    bool has_body;      /* which is not read */
    int socket;
    /* Of http.c alone: */
    struct MHD_Connection *connection;
    CtsHttpAnswer answer;
    bool is_dispatched, waits;
} CtsHttpRequest;

/* Passes requests to cts_routes_dispatch() in a thread of its own. socket: listens already; the server's from now on.
 * certificate and key: PEM texts, or NULL: no TLS. */
CtsStatus cts_http_start(CtsHttpServer **http, struct CtsServer *server, int socket, const char *certificate,
                         const char *key, CtsError *err);
/* Every request must have been answered. */
void cts_http_stop(CtsHttpServer **http);
/* The value of a header; NULL where it is absent. */
const char *cts_http_header(const CtsHttpRequest *request, const char *name);
/* Adds the parameters; the value of one without is "". */
void cts_http_query(const CtsHttpRequest *request, struct CtsQuery *query);
/* Within cts_routes_dispatch(): announces a later answer from any thread. */
void cts_http_wait(CtsHttpRequest *request);
/* Once, within that or after cts_http_wait(); frees request and takes over the contents of answer. */
void cts_http_answer(CtsHttpRequest *request, CtsHttpAnswer *answer);
