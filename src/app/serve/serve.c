/* The server's main function: search, listen, serve, shut down. */
#include "app/serve/server.h"

#include "base/cpu.h"
#include "base/file.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

/* Interval of checks for disconnected clients. */
enum { WATCH_MS = 100 };

/* A connection is an open file. */
static void allow_connections(void)
{
    struct rlimit files;
    if (getrlimit(RLIMIT_NOFILE, &files))
        return;
    files.rlim_cur = files.rlim_max;
    setrlimit(RLIMIT_NOFILE, &files);
}

/* A PEM file that holds a part of this kind; the caller's to free. */
static CtsStatus read_pem(const char *path, const char *kind, char **text, CtsError *err)
{
    enum { MOST = 1 << 20 }; /* bytes; a chain of certificates has about 10 kB */
    size_t n;
    const CtsStatus st = cts_file_text(path, MOST, CTS_ERR_READ, text, &n, err);
    return st || strstr(*text, kind) ? st : cts_fail(err, CTS_ERR_READ, "%s: holds no %s in PEM", path, kind);
}

/* Messages must not contain paths below the folders of series loaded on demand either. */
static void hide_path(CtsNames *names, const char *path)
{
    const char *place = strstr(path, CTS_SERIES_UID_MARKER);
    char *const before = place ? strndup(path, (size_t)(place - path)) : NULL;
    if (before)
        cts_names_add(names, before);
    free(before);
}

static CtsStatus search_served(CtsServer *server, void (*note)(const char *text), CtsError *err)
{
    CtsReport report = {0};
    char text[160];
    size_t n = 0;
    const CtsStatus st = cts_series_cache_fill(&server->cache, server->options, &report, err);
    const CtsSeriesList *const list = server->cache.list;
    for (size_t i = 0; list && i < list->n_paths; i++)
        cts_names_add(&server->names, list->paths[i]);
    for (int i = 0; i < server->options->paths.n; i++)
        hide_path(&server->names, server->options->paths.items[i]);
    for (size_t i = 0; list && i < list->n; i++)
        n += list->items[i].renderable;
    cts_report_free(&report);
    if (!st) {
        snprintf(text, sizeof text, "%zu series, %zu of them volumes; %llu MiB for those that are loaded",
                 list ? list->n : 0, n, (unsigned long long)(server->cache.max_bytes >> 20));
        note(text);
    }
    return st;
}

/* The server's threads block signals, which the main thread waits for. */
static CtsStatus begin_threads(CtsServer *server, CtsHttpServer **http, int socket, const char *certificate,
                               const char *key, CtsError *err)
{
    sigset_t all, before;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    CtsStatus st = cts_render_queue_begin(server, err);
    if (!st)
        st = cts_http_start(http, server, socket, certificate, key, err);
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    return st;
}

/* The address is opened before the archive is searched, so that a wrong one is reported at once. */
static CtsStatus listen_and_serve(CtsServer *server, const char *certificate, const char *key,
                                  void (*ready)(const char *url), void (*note)(const char *text), CtsError *err)
{
    char *url;
    CtsHttpServer *http = NULL;
    int socket;
    server->tls = certificate != NULL;
    CtsStatus st = cts_listen_open(server, &socket, &url, err);
    if (st) {
        free(url);
        return st;
    }
    if (!(st = search_served(server, note, err)) && !(st = cts_access_token(server, err)) &&
        !(st = cts_temp_folder("ctsplat-serve-", &server->folder, err))) {
        cts_names_add(&server->names, server->folder);
        cts_thumbnails_begin(server, note);
        st = begin_threads(server, &http, socket, certificate, key, err);
    }
    if (!st) {
        const bool made = server->token[0] && !server->options->token_file;
        char text[8192];
        snprintf(text, sizeof text, "%s%s%s", url, made ? "?token=" : "", made ? server->token : "");
        ready(text);
    }
    while (!st && !*server->options->net.stop)
        cts_render_queue_watch(server, WATCH_MS);
    cts_render_queue_end(server);
    if (http)
        cts_http_stop(&http);
    else
        close(socket);
    cts_listen_close(server);
    if (server->folder)
        rmdir(server->folder);
    free(server->folder);
    free(url);
    return st;
}

static CtsStatus check_serve_options(const CtsOptions *o, CtsError *err)
{
    if (!o->paths.n && !o->from.given)
        return cts_fail(err, CTS_ERR_USAGE, "nothing to serve (give PATH, or `from` a peer)");
    if (!o->net.tls_key != !o->net.tls_certificate)
        return cts_fail(err, CTS_ERR_USAGE, "`tls-cert` and `tls-key` must be given together");
    return CTS_OK;
}

CtsStatus cts_serve(const CtsOptions *options, void (*ready)(const char *url), void (*note)(const char *text),
                    CtsError *err)
{
    CtsOptions own = *options;
    char *certificate = NULL, *key = NULL;
    CtsStatus st = check_serve_options(options, err);
    CtsServer *const server = st ? NULL : calloc(1, sizeof *server);
    if (!server)
        return st ? st : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    own.render.n_threads = cts_threads(options->render.n_threads);
    server->options = &own;
    pthread_mutex_init(&server->lock, NULL);
    server->cache.lock = &server->lock;
    pthread_cond_init(&server->work, NULL);
    allow_connections();
    if (!options->net.tls_key || (!(st = read_pem(options->net.tls_certificate, "CERTIFICATE", &certificate, err)) &&
                                  !(st = read_pem(options->net.tls_key, "PRIVATE KEY", &key, err))))
        st = listen_and_serve(server, certificate, key, ready, note, err);
    cts_series_cache_free(&server->cache);
    cts_names_free(&server->names);
    pthread_mutex_destroy(&server->lock);
    pthread_cond_destroy(&server->work);
    free(certificate);
    free(key);
    free(server);
    return st;
}
