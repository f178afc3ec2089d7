/* The queue of render requests: queued, running and cancelled ones. */
#include "app/serve/server.h"

#include "app/job/auto_window.h"
#include "base/clock.h"
#include "base/thread.h"
#include <poll.h>
#include <stdlib.h>
#include <string.h>

void cts_render_request_free(CtsRenderRequest *e)
{
    cts_render_query_free(&e->render_query);
    cts_report_free(&e->report);
    free(e);
}

bool cts_render_queue_add(CtsServer *server, CtsRenderRequest *render_request)
{
    CtsRenderRequest **end = &server->first;
    if (server->n_waiting >= CTS_SERVE_WAITING)
        return false;
    while (*end)
        end = &(*end)->next;
    *end = render_request;
    server->n_waiting++;
    render_request->cached->n_requested++;
    pthread_cond_signal(&server->work);
    return true;
}

/* The lock is the caller's. */
static void unlink_request(CtsServer *server, CtsRenderRequest *render_request)
{
    CtsRenderRequest **link = &server->first;
    while (*link != render_request)
        link = &(*link)->next;
    *link = render_request->next;
    server->n_waiting -= !render_request->running;
    render_request->cached->n_requested--;
    cts_series_cache_sweep(&server->cache);
}

static void take_info(void *context, int frame, CtsPicture *band)
{
    CtsRenderRequest *const e = context;
    if (frame == 0)
        e->info = band->info;
    /* The picture's description is complete with its first rows. */
    e->has_info = true;
    e->stop |= e->render_query.metadata;
}

static CtsStatus render_with(CtsRenderRequest *e, const CtsProcessedVolume *processed, CtsCachedRenderer *renderer,
                             CtsError *err)
{
    const CtsJob *job = &e->render_query.job;
    const CtsLoaded loaded = {
        .series = e->cached->series, .model = processed->model, .labels = e->cached->loaded.labels};
    const CtsWatch watch = {.context = e, .band = take_info};
    CtsStatus st = cts_job_prepare(job, &processed->model, &renderer->prepared, &e->report, err);
    if (!st)
        st = cts_job_pictures(job, &loaded, &renderer->prepared, &watch, &e->report, err);
    return e->render_query.metadata && e->has_info ? CTS_OK : st;
}

static CtsStatus make_picture(CtsServer *server, CtsRenderRequest *e, CtsProcessedVolume *processed, CtsError *err)
{
    CtsStatus st =
        cts_fit_preset(&processed->model, &e->render_query.job.render, &e->render_query.preset, &e->report, err);
    if (st)
        return st;
    pthread_mutex_lock(&server->lock);
    CtsCachedRenderer *const renderer = cts_cached_renderer_get(processed, &e->render_query.job);
    pthread_mutex_unlock(&server->lock);
    if (!renderer)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    st = render_with(e, processed, renderer, err);
    pthread_mutex_lock(&server->lock);
    cts_cached_renderer_give_back(processed, renderer, !renderer->prepared.renderer);
    pthread_mutex_unlock(&server->lock);
    return st;
}

/* One slice is no volume. */
static CtsStatus check_instance(const CtsRenderRequest *e, CtsError *err)
{
    const char *uid = e->render_query.instance_uid;
    const int n = uid[0] ? cts_cached_series_count(e->cached, uid) : e->cached->series->n_slices;
    if (n == e->cached->series->n_slices)
        return CTS_OK;
    return n ? cts_fail(err, CTS_ERR_USAGE, "the object holds %d of the %d slices of its series (request the series)",
                        n, e->cached->series->n_slices)
             : cts_fail(err, CTS_ERR_NO_SERIES, "there is no such object here");
}

/* The preset of the request, once its series is known. */
static CtsStatus settle_request(CtsRenderRequest *e, CtsError *err)
{
    CtsRenderQuery *const q = &e->render_query;
    const CtsSeries *const s = e->cached->series;
    if (s && s->renderable && !e->is_settled) {
        e->is_settled = true;
        cts_options_settle(&q->options, s->modality_id, s->quantity, &q->preset, &q->job, &e->report, &e->err);
    }
    if (e->err.status)
        *err = e->err;
    return e->err.status;
}

static CtsStatus run_request(CtsServer *server, CtsRenderRequest *e, CtsProcessedVolume *processed,
                             CtsHttpAnswer *answer, CtsError *err)
{
    const bool found = processed;
    const CtsSource *const source = &e->render_query.job.source;
    CtsStatus st = cts_series_cache_find(&server->cache, e->cached, source, &e->report, err);
    if (!st && e->render_query.thumbnail)
        st = cts_thumbnail_find(server, e, err);
    const bool is_of_volume = !e->is_kept && !e->slice;
    if (!found) {
        if (!st && is_of_volume && !(st = settle_request(e, err)))
            st = cts_series_cache_load(&server->cache, e->cached, source, &processed, &e->report, err);
        pthread_mutex_lock(&server->lock);
        e->cached->busy = false;
        if (processed)
            processed->n_users++;
        pthread_cond_broadcast(&server->work);
        pthread_mutex_unlock(&server->lock);
    }
    if (!st && !e->render_query.thumbnail)
        st = check_instance(e, err);
    if (!st && e->stop)
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "stopped");
    if (!st && e->slice && !e->is_kept)
        st = cts_thumbnail_draw(e, err);
    else if (!st && is_of_volume)
        st = make_picture(server, e, processed, err);
    if (!st)
        st = cts_answer_picture(answer, server, e, err);
    if (e->render_query.thumbnail && (st == CTS_ERR_PIXELS || st == CTS_ERR_GEOMETRY))
        st = CTS_ERR_NO_SERIES; /* the request is right, but there is no thumbnail: 404 */
    pthread_mutex_lock(&server->lock);
    if (processed)
        processed->n_users--;
    pthread_mutex_unlock(&server->lock);
    return st;
}

/* The first queued request whose volume is not in use by another; reserves its resources. */
static CtsRenderRequest *next_request(CtsServer *server, CtsProcessedVolume **processed)
{
    CtsError unused;
    for (CtsRenderRequest *e = server->first; e; e = e->next) {
        CtsCachedSeries *const s = e->cached;
        if (e->running || s->n_running >= CTS_SERVE_WORKERS - 1)
            continue;
        settle_request(e, &unused);
        *processed = s->series ? cts_series_cache_volume(s, &e->render_query.job.source) : NULL;
        if (!*processed && s->busy)
            continue;
        if (*processed)
            (*processed)->n_users++;
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

static void serve_one(CtsServer *server, CtsRenderRequest *e, CtsProcessedVolume *processed)
{
    CtsError err = {0};
    CtsHttpAnswer answer;
    pthread_mutex_unlock(&server->lock);
    const CtsStatus st = run_request(server, e, processed, &answer, &err);
    if (st)
        cts_answer_failure(&answer, server, e->cached, st, &err);
    /* Release the volume before the client, who may request another picture of it, is answered. */
    pthread_mutex_lock(&server->lock);
    e->cached->n_running--;
    unlink_request(server, e);
    pthread_cond_broadcast(&server->work);
    pthread_mutex_unlock(&server->lock);
    cts_http_answer(e->request, &answer);
    cts_render_request_free(e);
    pthread_mutex_lock(&server->lock);
}

static void *work(void *context)
{
    CtsServer *const server = context;
    pthread_mutex_lock(&server->lock);
    for (;;) {
        CtsProcessedVolume *processed = NULL;
        CtsRenderRequest *const e = server->stopping ? NULL : next_request(server, &processed);
        if (e)
            serve_one(server, e, processed);
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
    cts_http_answer(e->request, &answer);
    unlink_request(server, e);
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
