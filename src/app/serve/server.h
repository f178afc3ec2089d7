/* Loaded volumes and pictures of them over HTTP: PS3.18 rendered3D, ctsplat's own URLs, and a page. Shared state of the
 * server's files. */
#pragma once

#include "app/options/options.h"
#include "app/serve/http.h"
#include "app/serve/series_cache.h"
#include "dicom/header/slice.h"
#include "output/report/redact.h"
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stddef.h>

/* query.c, rendered3d.c: translation and checks of a request's query as ctsplat's options. CTS_QUERY_PARTS: a request
 * may have fewer than 50 options. CTS_QUERY_MADE: PS3.18's parameters become at most five. */
enum { CTS_QUERY_PARTS = 64, CTS_QUERY_MADE = 8 };

/* A query: names and values as the request has them, or made here. */
typedef struct CtsQuery {
    struct {
        const char *name, *value;
    } parts[CTS_QUERY_PARTS];
    char made[CTS_QUERY_MADE][96];
    int n, n_made;
    bool too_many;
} CtsQuery;

/* Texts must stay. */
void cts_query_add(CtsQuery *query, const char *name, const char *value);
void cts_query_make(CtsQuery *query, const char *name, const char *format, ...) __attribute__((format(printf, 3, 4)));
/* NULL where it is not given. */
const char *cts_query_value(const CtsQuery *query, const char *name);

typedef struct CtsRenderQuery {
    CtsQuery query; /* as ctsplat's own options */
    bool thumbnail; /* of PS3.18's parameters only those of a thumbnail */
    const char *media_type;
    bool metadata;                                  /* the answer is the metadata, not the picture */
    double swivel_range_deg, swivel_step_deg, rate; /* 0: not given */
    char *state_path;                               /* of the presentation state requested; NULL: none */
    char instance_uid[65]; /* the object of a thumbnail; of a picture the one that must be the whole series; "": any */
    char *path;            /* temporary file for the picture */
    CtsOptions options;
    CtsPreset preset;
    CtsJob job; /* points at the two */
} CtsRenderQuery;

/* Translates ctsplat's own options; format: from the URL's ending. CTS_ERR_USAGE for options that a request may not
 * use. folder and serial determine the temporary file. */
CtsStatus cts_render_query_options(CtsRenderQuery *render_query, const CtsFormatInfo *format, const char *folder,
                                   unsigned long serial, int n_threads, CtsReport *report, CtsError *err);

/* Replaces the parameters of PS3.18 8.3.5 in query by options, and chooses a media type that accept (the header; may be
 * NULL) allows; *format is NULL where there is none. */
CtsStatus cts_render_query_rendered3d(CtsRenderQuery *render_query, const char *accept, const CtsFormatInfo **format,
                                      CtsError *err);

/* The files of the page, put into C by page/embed_assets.py. */
typedef struct CtsPageAsset {
    const char *name; /* below the server's root; "" is the page itself */
    const char *media_type;
    const unsigned char *bytes;
    size_t n_bytes;
} CtsPageAsset;

extern const CtsPageAsset cts_page_assets[];
extern const size_t cts_page_n_assets;

/* CTS_SERVE_WORKERS: threads that render, at most one less of one series, so that a slow series or picture leaves room
 * for others. CTS_SERVE_WAITING: queued requests, 16 for each thread; further clients are asked to retry after
 * CTS_SERVE_RETRY_S. */
enum { CTS_SERVE_WORKERS = 4, CTS_SERVE_WAITING = 64, CTS_SERVE_RETRY_S = 1 };

/* One request for a picture. */
typedef struct CtsRenderRequest {
    CtsHttpRequest *request;
    CtsRenderQuery render_query;
    CtsCachedSeries *cached;
    CtsReport report;
    CtsPictureInfo info; /* of the first frame, once has_info is set */
    bool has_info;
    /* Of a thumbnail: */
    char etag[67];         /* a hash of what decides its bytes, quoted; "": of a picture */
    const CtsSlice *slice; /* shown by itself, NULL: the volume is shown */
    bool is_kept;          /* on the disk, or with the client */
    bool is_settled;       /* the job is complete (cts_options_settle()), unless err has a status */
    CtsError err;
    volatile sig_atomic_t stop; /* set when the client has disconnected */
    bool running;
    struct CtsRenderRequest *next;
} CtsRenderRequest;

typedef struct CtsServer {
    const CtsOptions *options;
    char *folder;              /* for pictures being sent, unlinked once they are complete */
    char thumbnails[PATH_MAX]; /* the folder of those that are kept, with a slash behind it; "": none are */
    char token[4097];          /* "": no token is needed */
    bool local_socket, tls;
    CtsNames names;       /* of input files and of the folder, which are never sent */
    pthread_mutex_t lock; /* of all below */
    pthread_cond_t work;
    CtsSeriesCache cache;
    CtsRenderRequest *first;
    int n_waiting;
    unsigned long n_pictures;
    bool stopping;
    pthread_t workers[CTS_SERVE_WORKERS];
    int n_workers;
} CtsServer;

/* response.c: common parts of answers. A header replaces one of the same name. */
void cts_answer_header(CtsHttpAnswer *answer, const char *name, const char *value);
/* lasting: bytes stay; else they are the answer's, from malloc(). */
void cts_answer_bytes(CtsHttpAnswer *answer, const CtsServer *server, int status, const char *media_type,
                      const void *bytes, size_t n, bool lasting);
/* One line. */
void cts_answer_text(CtsHttpAnswer *answer, const CtsServer *server, int status, const char *text);
/* The answer for a failure: status and reason, without names of files and UIDs. cached may be NULL. */
void cts_answer_failure(CtsHttpAnswer *answer, const CtsServer *server, const CtsCachedSeries *cached, CtsStatus st,
                        const CtsError *err);
/* The picture, thumbnail or metadata of a finished request. */
CtsStatus cts_answer_picture(CtsHttpAnswer *answer, const CtsServer *server, const CtsRenderRequest *render_request,
                             CtsError *err);
/* text without names of files and UIDs; free with free(), NULL without memory. */
char *cts_server_masked(const CtsServer *server, const CtsCachedSeries *cached, const char *text);

/* access.c: true if access is allowed; else *answer contains the reason. */
bool cts_access_check(const CtsServer *server, const CtsHttpRequest *request, CtsHttpAnswer *answer);
CtsStatus cts_access_token(CtsServer *server, CtsError *err);

/* listen.c: opens a listening socket; *url is its URL, to be freed. */
CtsStatus cts_listen_open(CtsServer *server, int *fd, char **url, CtsError *err);
void cts_listen_close(const CtsServer *server);

/* routes.c: answers a request, or queues it; returns quickly. */
void cts_routes_dispatch(CtsServer *server, CtsHttpRequest *request);

/* render_queue.c: queues a request, or returns false where too many are queued; render_request->cached and its request
 * must be set. The caller holds the lock. */
bool cts_render_queue_add(CtsServer *server, CtsRenderRequest *render_request);
void cts_render_request_free(CtsRenderRequest *render_request);
CtsStatus cts_render_queue_begin(CtsServer *server, CtsError *err);
/* Waits, then stops rendering for clients that have disconnected. */
void cts_render_queue_watch(CtsServer *server, int ms);
void cts_render_queue_end(CtsServer *server);

/* thumbnails.c: finds the folder, makes it, and removes old ones. */
void cts_thumbnails_begin(CtsServer *server, void (*note)(const char *text));
/* Sets what the request shows, once its series is known, and is_kept. CTS_ERR_NO_SERIES for an object that is not there
 * and for pixels that are not shown. */
CtsStatus cts_thumbnail_find(const CtsServer *server, CtsRenderRequest *render_request, CtsError *err);
/* Writes that of a slice. */
CtsStatus cts_thumbnail_draw(CtsRenderRequest *render_request, CtsError *err);

/* listings.c: JSON, to be freed with free(); NULL without memory. */
char *cts_list_series(CtsServer *server);
/* All presets, or those that suit a series; id NULL: all. */
char *cts_list_presets(CtsServer *server, const char *id);
/* The labels of a series; empty while it is not loaded. */
char *cts_list_labels(CtsServer *server, const char *id);
/* The Rendered Volume Response Module (PS3.18 Annex K). */
char *cts_list_module(const CtsRenderRequest *render_request);
/* The scene of the picture, one line of JSON for the header of its answer. */
char *cts_list_scene(const CtsServer *server, const CtsRenderRequest *render_request);

/* Serves until options->net.stop is set; running requests are then answered with 503. Options are those of the command
 * `serve`. ready gets the URL of the page, with the token where the server generated it; note gets messages about the
 * series found. */
CtsStatus cts_serve(const CtsOptions *options, void (*ready)(const char *url), void (*note)(const char *text),
                    CtsError *err);
