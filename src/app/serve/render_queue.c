/* The queue of render requests: queued, running and cancelled ones. */
#include "app/serve/server.h"

#include "app/job/fit_window.h"
#include "base/clock.h"
#include "base/thread.h"
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void cts_render_request_free(CtsRenderRequest *e)
{
    cts_render_query_free(&e->asked);
    cts_report_free(&e->report);
    free(e);
}

bool cts_render_queue_add(CtsServer *server, CtsRenderRequest *errand)
{
    CtsRenderRequest **end = &server->first;
    if (server->n_waiting >= CTS_SERVE_WAITING)
        return false;
    while (*end)
        end = &(*end)->next;
    *end = errand;
    server->n_waiting++;
    errand->shelved->n_asked++;
    pthread_cond_signal(&server->work);
    return true;
}

/* The lock is the caller's. */
static void unlink_errand(CtsServer *server, CtsRenderRequest *errand)
{
    CtsRenderRequest **link = &server->first;
    while (*link != errand)
        link = &(*link)->next;
    *link = errand->next;
    server->n_waiting -= !errand->running;
    errand->shelved->n_asked--;
    cts_series_cache_sweep(&server->shelf);
}

static void take_info(void *context, int frame, CtsPicture *band)
{
    CtsRenderRequest *const e = context;
    if (frame == 0)
        e->info = band->info;
    /* The picture's description is complete with its first rows. */
    e->told = true;
    e->stop |= e->asked.metadata;
}

static CtsStatus use_lens(CtsRenderRequest *e, const CtsProcessedVolume *cut, CtsCachedRenderer *lens, bool is_new,
                          CtsError *err)
{
    const CtsJob *job = &e->asked.job;
    const CtsLoaded loaded = {.series = e->shelved->series, .volume = cut->volume, .labels = e->shelved->loaded.labels};
    const CtsWatch watch = {.context = e, .band = take_info};
    CtsStatus st = is_new ? cts_job_prepare(job, cut->volume, &lens->prepared, &e->report, err) : CTS_OK;
    if (!st)
        st = cts_job_pictures(job, &loaded, &lens->prepared, &watch, &e->report, err);
    return e->asked.metadata && e->told ? CTS_OK : st;
}

static CtsStatus make_picture(CtsServer *server, CtsRenderRequest *e, CtsProcessedVolume *cut, CtsError *err)
{
    CtsStatus st = cts_fit_window(cut->volume, &e->asked.job.render, &e->asked.preset, &e->report, err);
    if (st)
        return st;
    char *const json = cts_preset_to_json(&e->asked.preset);
    bool is_new = false;
    pthread_mutex_lock(&server->lock);
    CtsCachedRenderer *const lens = json ? cts_cached_renderer_get(cut, &e->asked.job, json, &is_new) : NULL;
    pthread_mutex_unlock(&server->lock);
    free(json);
    if (!lens)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    st = use_lens(e, cut, lens, is_new, err);
    pthread_mutex_lock(&server->lock);
    cts_cached_renderer_give_back(cut, lens, !lens->prepared.renderer);
    pthread_mutex_unlock(&server->lock);
    return st;
}

/* The picture's file, which has no name any more. */
static CtsStatus open_picture(const CtsRenderRequest *e, int *fd, CtsError *err)
{
    *fd = open(e->asked.path, O_RDONLY | O_CLOEXEC);
    if (*fd < 0)
        return cts_fail(err, CTS_ERR_OUTPUT, "the picture cannot be read back: %s", strerror(errno));
    unlink(e->asked.path);
    return CTS_OK;
}

static CtsStatus answer_picture(CtsServer *server, CtsRenderRequest *e, CtsHttpAnswer *answer, CtsError *err)
{
    if (e->asked.metadata) {
        char *const json = cts_list_module(e);
        if (!json)
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        cts_answer_bytes(answer, server, 200, "application/dicom+json", json, strlen(json), false);
        return CTS_OK;
    }
    int fd;
    const CtsStatus st = open_picture(e, &fd, err);
    if (st)
        return st;
    cts_answer_bytes(answer, server, 200, e->asked.media_type, "", 0, true);
    answer->fd = fd;
    char *const scene = cts_list_scene(server, e);
    if (scene)
        cts_answer_header(answer, "Ctsplat-Scene", scene);
    free(scene);
    return CTS_OK;
}

/* One slice is no volume. */
static CtsStatus check_instance(const CtsRenderRequest *e, CtsError *err)
{
    const char *uid = e->asked.instance_uid;
    const int n = uid[0] ? cts_cached_series_count(e->shelved, uid) : e->shelved->series->n_slices;
    if (n == e->shelved->series->n_slices)
        return CTS_OK;
    return n ? cts_fail(err, CTS_ERR_USAGE, "the object holds %d of the %d slices of its series (request the series)",
                        n, e->shelved->series->n_slices)
             : cts_fail(err, CTS_ERR_NO_SERIES, "there is no such object here");
}

static CtsStatus run(CtsServer *server, CtsRenderRequest *e, CtsProcessedVolume *cut, CtsHttpAnswer *answer,
                     CtsError *err)
{
    CtsStatus st = CTS_OK;
    const bool makes = !cut;
    if (makes) {
        st = cts_series_cache_make(&server->shelf, &server->lock, e->shelved, &e->asked.job.source, &cut, &e->report,
                                   err);
        pthread_mutex_lock(&server->lock);
        e->shelved->busy = false;
        if (cut)
            cut->n_users++;
        pthread_cond_broadcast(&server->work);
        pthread_mutex_unlock(&server->lock);
    }
    if (!st)
        st = check_instance(e, err);
    if (!st && !e->stop && !(st = make_picture(server, e, cut, err)))
        st = answer_picture(server, e, answer, err);
    else if (!st)
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "stopped");
    pthread_mutex_lock(&server->lock);
    if (cut)
        cut->n_users--;
    pthread_mutex_unlock(&server->lock);
    return st;
}

/* The first queued request whose volume is not in use by another; reserves its resources. */
static CtsRenderRequest *next_errand(CtsServer *server, CtsProcessedVolume **cut)
{
    for (CtsRenderRequest *e = server->first; e; e = e->next) {
        CtsCachedSeries *const s = e->shelved;
        if (e->running || s->n_running >= CTS_SERVE_WORKERS - 1)
            continue;
        *cut = s->series ? cts_series_cache_volume(s, &e->asked.job.source) : NULL;
        if (!*cut && s->busy)
            continue;
        if (*cut)
            (*cut)->n_users++;
        else
            s->busy = true;
        e->running = true;
        s->n_running++;
        s->used_ms = cts_wall_ms();
        server->n_waiting--;
        return e;
    }
    return NULL;
}

static void serve_one(CtsServer *server, CtsRenderRequest *e, CtsProcessedVolume *cut)
{
    CtsError err = {0};
    CtsHttpAnswer answer;
    pthread_mutex_unlock(&server->lock);
    const CtsStatus st = run(server, e, cut, &answer, &err);
    if (st)
        cts_answer_failure(&answer, server, e->shelved, st, &err);
    /* Release the volume before the client, who may request another picture of it, is answered. */
    pthread_mutex_lock(&server->lock);
    e->shelved->n_running--;
    unlink_errand(server, e);
    pthread_cond_broadcast(&server->work);
    pthread_mutex_unlock(&server->lock);
    server->http->answer(e->request, &answer);
    cts_render_request_free(e);
    pthread_mutex_lock(&server->lock);
}

static void *work(void *context)
{
    CtsServer *const server = context;
    pthread_mutex_lock(&server->lock);
    for (;;) {
        CtsProcessedVolume *cut = NULL;
        CtsRenderRequest *const e = server->stopping ? NULL : next_errand(server, &cut);
        if (e)
            serve_one(server, e, cut);
        else if (server->stopping)
            break;
        else
            pthread_cond_wait(&server->work, &server->lock);
    }
    pthread_mutex_unlock(&server->lock);
    return NULL;
}

CtsStatus cts_render_queue_begin(CtsServer *server, CtsError *err)
{
    for (; server->n_workers < CTS_SERVE_WORKERS; server->n_workers++)
        if (cts_thread_start(&server->workers[server->n_workers], work, server))
            return cts_fail(err, CTS_ERR_MEMORY, "no thread can be started");
    return CTS_OK;
}

/* The lock is the caller's. */
static void drop_waiting(CtsServer *server, CtsRenderRequest *e, const char *why)
{
    CtsHttpAnswer answer;
    cts_answer_text(&answer, server, 503, why);
    server->http->answer(e->request, &answer);
    unlink_errand(server, e);
    cts_render_request_free(e);
}

static void drop_gone(CtsServer *server, const struct pollfd *sockets, int n)
{
    CtsRenderRequest *e = server->first;
    for (int i = 0; i < n && e; i++) {
        CtsRenderRequest *const next = e->next;
        if (sockets[i].revents & (POLLRDHUP | POLLHUP | POLLERR)) {
            e->stop = 1;
            if (!e->running)
                drop_waiting(server, e, "the client has disconnected");
        }
        e = next;
    }
}

void cts_render_queue_watch(CtsServer *server, int ms)
{
    struct pollfd sockets[CTS_SERVE_WAITING + CTS_SERVE_WORKERS];
    int n = 0;
    poll(NULL, 0, ms);
    /* Under the lock no request ends, so that each socket is still its own. */
    pthread_mutex_lock(&server->lock);
    for (const CtsRenderRequest *e = server->first; e; e = e->next)
        sockets[n++] = (struct pollfd){.fd = e->socket, .events = POLLRDHUP};
    if (n && poll(sockets, (nfds_t)n, 0) > 0)
        drop_gone(server, sockets, n);
    pthread_mutex_unlock(&server->lock);
}

void cts_render_queue_end(CtsServer *server)
{
    static const char why[] = "the server is stopping";
    pthread_mutex_lock(&server->lock);
    server->stopping = true;
    for (CtsRenderRequest *e = server->first, *next; e; e = next) {
        next = e->next;
        e->stop = 1;
        if (!e->running)
            drop_waiting(server, e, why);
    }
    pthread_cond_broadcast(&server->work);
    pthread_mutex_unlock(&server->lock);
    for (int i = 0; i < server->n_workers; i++)
        pthread_join(server->workers[i], NULL);
}
