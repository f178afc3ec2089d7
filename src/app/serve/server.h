/* Volumes that stay loaded, and pictures of them for whoever asks over HTTP: PS3.18 rendered3D, ctsplat's own words,
 * and a page. A server under way: what its files share. */
#ifndef CTS_SERVE_SERVER_H
#define CTS_SERVE_SERVER_H

#include "app/serve/http.h"
#include "app/serve/shelf.h"
#include "app/words/options.h"
#include "output/report/masked.h"
#include <pthread.h>
#include <signal.h>
#include <stddef.h>

/* asked.c, rendered.c: what a request asks for, in ctsplat's own words: its query, checked and ready to be made. */
enum { CTS_ASKED_PARTS = 64, CTS_ASKED_MADE = 8 };

/* A query: names and values as the request has them, or made here. */
typedef struct CtsQuery {
    struct {
        const char *name, *value;
    } parts[CTS_ASKED_PARTS];
    char made[CTS_ASKED_MADE][96];
    int n, n_made;
    bool too_many;
} CtsQuery;

/* Texts must stay. */
void cts_query_add(void *query, const char *name, const char *value);
void cts_query_make(CtsQuery *query, const char *name, const char *format, ...) __attribute__((format(printf, 3, 4)));
/* NULL where it is not given. */
const char *cts_query_value(const CtsQuery *query, const char *name);

typedef struct CtsAsked {
    CtsQuery query; /* as ctsplat's own words */
    const char *media_type;
    bool metadata;                                  /* how the picture is rendered, not the picture */
    double swivel_range_deg, swivel_step_deg, rate; /* 0: not asked for */
    char *state_path;                               /* of the presentation state that is asked for; NULL: none */
    char instance_uid[65];                          /* the object that must be the whole series; "": none */
    char *path;                                     /* where the picture goes */
    CtsOptions options;
    CtsPreset preset;
    CtsJob job; /* points at the two */
} CtsAsked;

/* By ctsplat's words; format: what the address ends in. CTS_ERR_USAGE for what no request may ask for. folder and
 * serial name a file of its own. Free with cts_asked_free(), also after a failure. */
CtsStatus cts_asked_words(CtsAsked *asked, const CtsFormatInfo *format, const char *folder, unsigned long serial,
                          int n_threads, CtsReport *report, CtsError *err);
void cts_asked_free(CtsAsked *asked);

const char *cts_media_type_of(const CtsFormatInfo *format);

/* The parameters of PS3.18 8.3.5 in query become words, and the media type one that accept (the header; may be NULL)
 * takes; *format is NULL where it takes none. */
CtsStatus cts_asked_rendered(CtsAsked *asked, const char *accept, const CtsFormatInfo **format, CtsError *err);

/* The files of the page, put into C by page/embed_assets.py. */
typedef struct CtsPageAsset {
    const char *name; /* below the server's root; "" is the page itself */
    const char *media_type;
    const unsigned char *bytes;
    size_t n_bytes;
} CtsPageAsset;

extern const CtsPageAsset cts_page_assets[];
extern const size_t cts_page_n_assets;

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

/* Serves until options->net.stop is set; requests under way are then answered with 503. Options are those of the
 * command `serve`. ready is told where to find the page, its token in it where nobody else knows it; note what is
 * found. */
CtsStatus cts_serve(const CtsOptions *options, void (*ready)(const char *url), void (*note)(const char *text),
                    CtsError *err);

#endif
