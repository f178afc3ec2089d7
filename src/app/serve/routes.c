/* Routing of URLs to answers. */
#include "app/serve/server.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void answer_json(const CtsServer *server, CtsHttpAnswer *answer, char *json)
{
    if (json)
        cts_answer_bytes(answer, server, 200, "application/json", json, strlen(json), false);
    else
        cts_answer_text(answer, server, 503, "out of memory");
}

static bool answer_asset(const CtsServer *server, CtsHttpAnswer *answer, const char *name)
{
    for (size_t i = 0; i < cts_page_n_assets; i++) {
        const CtsPageAsset *const a = &cts_page_assets[i];
        if (strcmp(a->name, name))
            continue;
        cts_answer_bytes(answer, server, 200, a->media_type, a->bytes, a->n_bytes, true);
        cts_answer_header(answer, "Content-Security-Policy",
                          "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
                          "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
        cts_answer_header(answer, "Referrer-Policy", "no-referrer");
        return true;
    }
    return false;
}

/* The series, study or object that a URL names. */
typedef struct Target {
    char id[17], study_uid[65], uid[65], instance_uid[65]; /* id, or the UIDs; "": not given */
    int frame;                                             /* of the object; 0: any */
    bool thumbnail;
} Target;

static CtsStatus find_target(CtsServer *server, const Target *t, CtsCachedSeries **found, CtsError *err)
{
    if (t->id[0]) {
        *found = cts_series_cache_by_id(&server->cache, t->id);
        return *found ? CTS_OK : cts_fail(err, CTS_ERR_NO_SERIES, "there is no such series here");
    }
    return t->uid[0]
               ? cts_series_cache_by_uid(&server->cache, t->study_uid, t->uid, t->instance_uid, t->frame, found, err)
               : cts_series_cache_of_study(&server->cache, t->study_uid, t->thumbnail, found, err);
}

/* Queues the render request, which is the queue's then, or fails with the reason. *is_kept: it is a thumbnail's that
 * need not be made, and is not queued. */
static CtsStatus queue(CtsServer *server, CtsRenderRequest *r, const Target *target, bool *is_kept, CtsError *err)
{
    pthread_mutex_lock(&server->lock);
    CtsStatus st = server->stopping ? cts_fail(err, CTS_ERR_INTERRUPTED, "the server is stopping")
                                    : find_target(server, target, &r->cached, err);
    if (!st && r->cached->series && target->thumbnail)
        st = cts_thumbnail_find(server, r, err);
    else if (!st && r->cached->series && !r->cached->series->renderable)
        st = cts_fail(err, CTS_ERR_GEOMETRY, "%s", r->cached->series->reason);
    *is_kept = !st && r->is_kept;
    if (!st && !*is_kept && !cts_render_queue_add(server, r))
        st = cts_fail(err, CTS_ERR_MEMORY, "too many pictures are queued (ask again)");
    else if (!st && !*is_kept)
        cts_http_wait(r->request);
    pthread_mutex_unlock(&server->lock);
    return st;
}

static CtsStatus prepare_request(CtsServer *server, CtsRenderRequest *r, const CtsFormatInfo *format, CtsError *err)
{
    CtsStatus st = cts_render_query_options(&r->render_query, format, server->folder, ++server->n_pictures,
                                            server->options->render.n_threads, &r->report, err);
    if (st == CTS_ERR_READ && r->render_query.state_path)
        st = CTS_ERR_USAGE; /* the client's fault, not the server's */
    r->render_query.job.render.stop = r->render_query.job.source.stop = &r->stop;
    return st;
}

/* Answers at once, or queues the request, which then waits. format NULL: use the standard's parameters. */
static void request_picture(CtsServer *server, CtsHttpRequest *request, Target *target, const CtsFormatInfo *format,
                            CtsHttpAnswer *answer)
{
    CtsError err = {0};
    CtsRenderRequest *const r = calloc(1, sizeof *r);
    bool is_kept = false;
    if (!r) {
        cts_answer_text(answer, server, 503, "out of memory");
        return;
    }
    r->request = request;
    cts_http_query(request, &r->render_query.query);
    r->render_query.thumbnail = target->thumbnail;
    /* An object is a presentation state, or should be a whole series where it is not a thumbnail's. */
    if (!target->thumbnail && target->instance_uid[0])
        r->render_query.state_path = cts_series_cache_state(&server->cache, target->uid, target->instance_uid);
    if (!r->render_query.state_path)
        strcpy(r->render_query.instance_uid, target->instance_uid);
    CtsStatus st =
        format ? CTS_OK
               : cts_render_query_rendered3d(&r->render_query, cts_http_header(request, "Accept"), &format, &err);
    if (!st && format && !(st = prepare_request(server, r, format, &err))) {
        const CtsState *const state = r->render_query.options.state;
        if (state) { /* its picture is of the volume that it names */
            strcpy(target->uid, state->source_uid);
            strcpy(target->instance_uid, state->slice_uid);
            target->frame = state->slice_frame;
        }
        st = queue(server, r, target, &is_kept, &err);
    }
    if (!st && is_kept)
        st = cts_answer_picture(answer, server, r, &err);
    else if (!st && format)
        return;
    if (st)
        cts_answer_failure(answer, server, r->cached, st, &err);
    else if (!format)
        cts_answer_text(answer, server, 406,
                        target->thumbnail
                            ? "there are image/jpeg, image/png and image/webp"
                            : "there are image/jpeg, image/png, image/webp and application/dicom (of a swivel the last "
                              "two), and application/dicom+json for renderedvolumetricmetadata");
    cts_render_request_free(r);
}

/* /series/ID/ and more. */
static void request_series(CtsServer *server, CtsHttpRequest *request, Target *target, const char *what,
                           CtsHttpAnswer *answer)
{
    const CtsFormatInfo *const format = cts_export_format(what);
    target->thumbnail = !strcmp(what, "thumbnail");
    if (!strcmp(what, "labels"))
        answer_json(server, answer, cts_list_labels(server, target->id));
    else if (!strcmp(what, "presets"))
        answer_json(server, answer, cts_list_presets(server, target->id));
    else if (target->thumbnail || (format && !strncmp(what, "picture.", 8) && !strcmp(what + 8, format->name)))
        request_picture(server, request, target, format, answer);
    else
        cts_answer_text(answer, server, 404,
                        "there are /series, /series/ID/labels, /series/ID/presets, /series/ID/thumbnail and "
                        "/series/ID/picture.ENDING, its ending a format's");
}

/* /studies/S/rendered3D, thumbnail, and paths below it. */
static void request_study(CtsServer *server, CtsHttpRequest *request, CtsHttpAnswer *answer)
{
    const char *const path = request->path;
    char what[16];
    int n = 0;
    Target t = {.thumbnail = false};
    const bool is_one =
        (sscanf(path, "/studies/%64[^/]/%15[^/]%n", t.study_uid, what, &n) == 2 && !path[n]) ||
        (sscanf(path, "/studies/%64[^/]/series/%64[^/]/%15[^/]%n", t.study_uid, t.uid, what, &n) == 3 && !path[n]) ||
        (sscanf(path, "/studies/%64[^/]/series/%64[^/]/instances/%64[^/]/%15[^/]%n", t.study_uid, t.uid, t.instance_uid,
                what, &n) == 4 &&
         !path[n]);
    t.thumbnail = is_one && !strcmp(what, "thumbnail");
    if (t.thumbnail || (is_one && !strcmp(what, "rendered3D")))
        request_picture(server, request, &t, NULL, answer);
    else
        cts_answer_text(
            answer, server, 404,
            "of PS3.18 there are rendered3D and thumbnail, of a study, a series or an object; renderedMPR and other "
            "resources are not supported");
}

/* Finds the answer to an address. */
static void answer_path(CtsServer *server, CtsHttpRequest *request, CtsHttpAnswer *answer)
{
    const char *const path = request->path;
    Target series = {.thumbnail = false};
    char what[64];
    int n = 0;
    if (*path == '/' &&
        answer_asset(server, answer, strcmp(request->method, "OPTIONS") ? path + 1 : "capabilities.wadl"))
        return;
    if (!strcmp(path, "/series"))
        answer_json(server, answer, cts_list_series(server));
    else if (!strcmp(path, "/presets"))
        answer_json(server, answer, cts_list_presets(server, NULL));
    else if (!strncmp(path, "/studies/", 9))
        request_study(server, request, answer);
    else if (sscanf(path, "/series/%16[^/]/%63[^/]%n", series.id, what, &n) == 2 && !path[n])
        request_series(server, request, &series, what, answer);
    else
        cts_answer_text(answer, server, 404, "no such address (there are /, /series, /presets and /studies/...)");
}

void cts_routes_dispatch(CtsServer *server, CtsHttpRequest *request)
{
    CtsHttpAnswer answer;
    if (cts_access_check(server, request, &answer))
        answer_path(server, request, &answer);
    if (!request->waits)
        cts_http_answer(request, &answer);
}
