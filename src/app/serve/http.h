/* The server's door to the network: requests come in, answers go out, and no type of libmicrohttpd shows. What is
 * behind it is a library of its own (base/load_part.h), as no other command needs it. */
#ifndef CTS_SERVE_HTTP_H
#define CTS_SERVE_HTTP_H

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>

typedef struct CtsHttpServer CtsHttpServer;
/* One request, from when it is asked until it is answered. Texts are its own; headers NULL where it has none. */
typedef struct CtsHttpRequest {
    const char *method, *path;
    const char *host, *authorization, *cookie, *accept;
    int socket;
} CtsHttpRequest;

typedef struct CtsHttpSettings {
    int socket;                                          /* listens already; the server's from now on */
    const char *certificate, *key;                       /* PEM texts; NULL: no TLS */
    void (*ask)(void *context, CtsHttpRequest *request); /* in the server's own thread, which it must not keep long */
    void *context;
} CtsHttpSettings;

enum { CTS_HTTP_HEADERS = 8 };

typedef struct CtsHttpAnswer {
    int status;
    const void *bytes; /* n_bytes of them */
    size_t n_bytes;
    bool lasting; /* bytes stay; else they are the answer's, from malloc() */
    int fd;       /* a file instead, which becomes the server's; 0: none */
    struct {
        const char *name;
        char value[2048];
    } headers[CTS_HTTP_HEADERS];
    int n_headers;
} CtsHttpAnswer;

typedef struct CtsHttp {
    CtsStatus (*start)(CtsHttpServer **server, const CtsHttpSettings *settings, CtsError *err);
    /* Every request must have been answered. */
    void (*stop)(CtsHttpServer **server);
    /* take for each part of the query, value "" where it has none. */
    void (*query)(const CtsHttpRequest *request, void (*take)(void *context, const char *name, const char *value),
                  void *context);
    /* Within ask: the answer comes later, from any thread. */
    void (*wait)(CtsHttpRequest *request);
    /* Once, within ask or after wait; request is gone then, and what answer holds is taken. */
    void (*answer)(CtsHttpRequest *request, CtsHttpAnswer *answer);
} CtsHttp;

CtsStatus cts_http(const CtsHttp **http, CtsError *err);

#endif
