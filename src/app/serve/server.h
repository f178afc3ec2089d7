/* A server under way: what its files share. */
#ifndef CTS_SERVE_SERVER_H
#define CTS_SERVE_SERVER_H

#include "app/serve/asked.h"
#include "app/serve/http.h"
#include "app/serve/shelf.h"
#include "output/report/masked.h"
#include <pthread.h>
#include <signal.h>

/* So many pictures are made at once, at most one less of any series, and so many wait; who comes then is told to come
 * back. One series that takes long to read, or one picture that takes long to make, leaves room for the others. */
enum { CTS_SERVE_WORKERS = 4, CTS_SERVE_WAITING = 64, CTS_SERVE_RETRY_S = 1 };

/* One request for a picture. */
typedef struct CtsErrand {
    CtsHttpRequest *request;
    int socket;
    CtsAsked asked;
    CtsShelved *shelved;
    CtsReport report;
    CtsPictureInfo info; /* of the first frame, once it is told */
    bool told;
    volatile sig_atomic_t stop; /* nobody waits for it any more */
    bool running;
    struct CtsErrand *next;
} CtsErrand;

typedef struct CtsServer {
    const CtsHttp *http;
    const CtsOptions *options;
    char *folder;     /* for pictures on their way, which have no name there once they are whole */
    char token[4097]; /* "": none is needed */
    bool local_socket, tls;
    CtsNames names;       /* of input files and of the folder, which nobody is told */
    pthread_mutex_t lock; /* of all below */
    pthread_cond_t work;
    CtsShelf shelf;
    CtsErrand *first;
    int n_waiting;
    unsigned long n_pictures;
    bool stopping;
    pthread_t workers[CTS_SERVE_WORKERS];
    int n_workers;
} CtsServer;

/* answer.c: what every answer has in it. */
void cts_answer_header(CtsHttpAnswer *answer, const char *name, const char *value);
/* bytes: as CtsHttpAnswer has them. */
void cts_answer_bytes(CtsHttpAnswer *answer, const CtsServer *server, int status, const char *media_type,
                      const void *bytes, size_t n, bool lasting);
/* One line. */
void cts_answer_text(CtsHttpAnswer *answer, const CtsServer *server, int status, const char *text);
/* What a failure is to a client: status and reason, without names of files and UIDs. shelved may be NULL. */
void cts_answer_failure(CtsHttpAnswer *answer, const CtsServer *server, const CtsShelved *shelved, CtsStatus st,
                        const CtsError *err);
/* text without names of files and UIDs; free with free(), NULL without memory. */
char *cts_server_masked(const CtsServer *server, const CtsShelved *shelved, const char *text);

/* guard.c: whether the request may go on; else *answer says why not. */
bool cts_guard(const CtsServer *server, const CtsHttpRequest *request, CtsHttpAnswer *answer);
CtsStatus cts_guard_token(CtsServer *server, CtsError *err);

/* door.c: a socket that listens, and what it is called; *url is to be freed. */
CtsStatus cts_door_open(CtsServer *server, int *fd, char **url, CtsError *err);
void cts_door_close(const CtsServer *server);

/* routes.c: CtsHttpSettings.ask. */
void cts_routes_ask(void *server, CtsHttpRequest *request);

/* errands.c: takes the errand, or refuses it where too many wait; errand->shelved and its request are settled. The lock
 * is the caller's. */
bool cts_errand_queue(CtsServer *server, CtsErrand *errand);
void cts_errand_free(CtsErrand *errand);
CtsStatus cts_errands_begin(CtsServer *server, CtsError *err);
/* Waits for a moment, and stops what nobody waits for any more. */
void cts_errands_watch(CtsServer *server, int ms);
void cts_errands_end(CtsServer *server);

/* lists.c: JSON, to be freed with free(); NULL without memory. */
char *cts_list_series(CtsServer *server);
char *cts_list_presets(void);
/* The labels of a series that is loaded; none of others. */
char *cts_list_labels(CtsServer *server, const char *id);
/* The Rendered Volume Response Module (PS3.18 Annex K). */
char *cts_list_module(const CtsErrand *errand);
/* How the picture was made, for who shows it, on one line. */
char *cts_list_scene(const CtsServer *server, const CtsErrand *errand);

#endif
