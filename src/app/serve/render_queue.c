/* The queue of render requests: queued, running and cancelled ones. */
#include "app/serve/server.h"

#include "app/job/auto_window.h"
#include "base/clock.h"
#include "base/thread.h"
#include <poll.h>
#include <stdlib.h>

void cts_render_request_free(CtsRenderRequest *r)
{
    cts_options_free(&r->render_query.options);
    free(r->render_query.path);
    free(r->render_query.state_path);
    cts_report_free(&r->report);
    free(r);
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

static CtsStatus take_info(void *context, int frame, CtsPicture *band, CtsError *err)
{
    CtsRenderRequest *const r = context;
    (void)err;
    if (frame == 0)
        r->info = band->info;
    /* The picture's description is complete with its first rows. */
    r->has_info = true;
    r->stop |= r->render_query.metadata;
    return CTS_OK;
}

_Static_assert((int)CTS_SERVE_WORKERS <= (int)CTS_CACHED_RENDERERS, "a thread finds no renderer");

static CtsStatus make_picture(CtsServer *server, CtsRenderRequest *r, CtsProcessedVolume *processed, CtsError *err)
{
    const CtsJob *const job = &r->render_query.job;
    const CtsLoaded loaded = {
        .series = r->cached->series, .model = processed->model, .labels = r->cached->loaded.labels};
    const CtsWatch watch = {.context = r, .band = take_info};
    CtsStatus st = cts_fit_preset(&processed->model, &job->render, &r->render_query.preset, &r->report, err);
    if (st)
        return st;
    pthread_mutex_lock(&server->lock);
    CtsCachedRenderer *const renderer = cts_cached_renderer_get(processed, job);
    pthread_mutex_unlock(&server->lock);
    if (!(st = cts_job_prepare(job, &processed->model, &renderer->prepared, &r->report, err)))
        st = cts_job_pictures(job, &loaded, &renderer->prepared, &watch, &r->report, err);
    pthread_mutex_lock(&server->lock);
    cts_cached_renderer_give_back(processed, renderer);
    pthread_mutex_unlock(&server->lock);
    return r->render_query.metadata && r->has_info ? CTS_OK : st;
}

/* One slice is no volume. */
static CtsStatus check_instance(const CtsRenderRequest *r, CtsError *err)
{
    const char *const uid = r->render_query.instance_uid;
    const CtsSeries *const s = r->cached->series;
    const CtsState *const state = r->render_query.options.state;
    if (state && !cts_state_is_of(state, s))
        return cts_fail(err, CTS_ERR_NO_SERIES, "the volume of the presentation state is not here");
    const int n = uid[0] ? cts_series_count(s, uid, 0) : s->n_slices;
    if (n == s->n_slices)
        return CTS_OK;
    return n ? cts_fail(err, CTS_ERR_USAGE, "the object holds %d of the %d slices of its series (request the series)",
                        n, s->n_slices)
             : cts_fail(err, CTS_ERR_NO_SERIES, "there is no such object here");
}

/* The preset of the request, once its series is known. */
static CtsStatus settle_request(CtsRenderRequest *r, CtsError *err)
{
    CtsRenderQuery *const q = &r->render_query;
    const CtsSeries *const s = r->cached->series;
    if (s && s->renderable && !r->is_settled) {
        r->is_settled = true;
        cts_options_settle(&q->options, s->modality_id, s->quantity, &q->preset, &q->job, &r->report, &r->err);
    }
    if (r->err.status)
        *err = r->err;
    return r->err.status;
}

static CtsStatus run_request(CtsServer *server, CtsRenderRequest *r, CtsProcessedVolume *processed,
                             CtsHttpAnswer *answer, CtsError *err)
{
    const bool found = processed;
    const CtsSource *const source = &r->render_query.job.source;
    CtsStatus st = cts_series_cache_find(&server->cache, r->cached, source, &r->report, err);
    if (!st && r->render_query.thumbnail)
        st = cts_thumbnail_find(server, r, err);
    const bool is_of_volume = !r->is_kept && !r->slice;
    if (!found) {
        if (!st && is_of_volume && !(st = settle_request(r, err)))
            st = cts_series_cache_load(&server->cache, r->cached, source, &processed, &r->report, err);
        pthread_mutex_lock(&server->lock);
        r->cached->busy = false;
        if (processed)
            processed->n_users++;
        pthread_cond_broadcast(&server->work);
        pthread_mutex_unlock(&server->lock);
    }
    if (!st && !r->render_query.thumbnail)
        st = check_instance(r, err);
    if (!st && r->stop)
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "stopped");
    if (!st && r->slice && !r->is_kept)
        st = cts_thumbnail_draw(r, err);
    else if (!st && is_of_volume)
        st = make_picture(server, r, processed, err);
    if (!st)
        st = cts_answer_picture(answer, server, r, err);
    if (r->render_query.thumbnail && (st == CTS_ERR_PIXELS || st == CTS_ERR_GEOMETRY))
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
    for (CtsRenderRequest *r = server->first; r; r = r->next) {
        CtsCachedSeries *const s = r->cached;
        if (r->running || s->n_running >= CTS_SERVE_WORKERS - 1)
            continue;
        settle_request(r, &unused);
        *processed = s->series ? cts_series_cache_volume(s, &r->render_query.job.source) : NULL;
        if (!*processed && s->busy)
            continue;
        if (*processed)
            (*processed)->n_users++;
        else
            s->busy = true;
        r->running = true;
        s->n_running++;
        s->used_ms = cts_wall_ms();
        server->n_waiting--;
        return r;
    }
    return NULL;
}

static void serve_one(CtsServer *server, CtsRenderRequest *r, CtsProcessedVolume *processed)
{
    CtsError err = {0};
    CtsHttpAnswer answer;
    pthread_mutex_unlock(&server->lock);
    const CtsStatus st = run_request(server, r, processed, &answer, &err);
    if (st)
        cts_answer_failure(&answer, server, r->cached, st, &err);
    /* Release the volume before the client, who may request another picture of it, is answered. */
    pthread_mutex_lock(&server->lock);
    r->cached->n_running--;
    unlink_request(server, r);
    pthread_cond_broadcast(&server->work);
    pthread_mutex_unlock(&server->lock);
    cts_http_answer(r->request, &answer);
    cts_render_request_free(r);
    pthread_mutex_lock(&server->lock);
}

static void *work(void *context)
{
    CtsServer *const server = context;
    pthread_mutex_lock(&server->lock);
    for (;;) {
        CtsProcessedVolume *processed = NULL;
        CtsRenderRequest *const r = server->stopping ? NULL : next_request(server, &processed);
        if (r)
            serve_one(server, r, processed);
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

/* Stops the requests of clients that have disconnected, or all. Under the lock, which is the caller's, no request ends,
 * so that each socket is still its own. */
static void stop_requests(CtsServer *server, bool all)
{
    CtsHttpAnswer answer;
    for (CtsRenderRequest *r = server->first, *next; r; r = next) {
        struct pollfd client = {.fd = r->request->socket, .events = POLLRDHUP};
        next = r->next;
        if (!all && poll(&client, 1, 0) <= 0)
            continue;
        r->stop = 1;
        if (r->running)
            continue;
        cts_answer_text(&answer, server, 503, all ? "the server is stopping" : "the client has disconnected");
        cts_http_answer(r->request, &answer);
        unlink_request(server, r);
        cts_render_request_free(r);
    }
}

void cts_render_queue_watch(CtsServer *server, int ms)
{
    poll(NULL, 0, ms);
    pthread_mutex_lock(&server->lock);
    stop_requests(server, false);
    pthread_mutex_unlock(&server->lock);
}

void cts_render_queue_end(CtsServer *server)
{
    pthread_mutex_lock(&server->lock);
    server->stopping = true;
    stop_requests(server, true);
    pthread_cond_broadcast(&server->work);
    pthread_mutex_unlock(&server->lock);
    for (int i = 0; i < server->n_workers; i++)
        pthread_join(server->workers[i], NULL);
}
