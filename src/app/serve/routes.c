/* Routing of URLs to answers. */
#include "app/serve/server.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MAX_PARTS = 8 }; /* studies/UID/series/UID/instances/UID/rendered3D, the longest address, has 7 */

/* The segments of a path: "/series/1/picture.png" has three. */
typedef struct Parts {
    char text[1024];
    const char *at[MAX_PARTS];
    int n; /* more than MAX_PARTS: it is no address here */
} Parts;

static void split_path(const char *path, Parts *p)
{
    p->n = snprintf(p->text, sizeof p->text, "%s", path) >= (int)sizeof p->text ? MAX_PARTS + 1 : 0;
    char *rest = p->text;
    while (p->n <= MAX_PARTS && *rest == '/') {
        *rest++ = 0;
        if (p->n < MAX_PARTS)
            p->at[p->n] = rest;
        p->n++;
        rest += strcspn(rest, "/");
    }
}

static bool is(const Parts *p, int i, const char *text)
{
    return i < p->n && p->n <= MAX_PARTS && !strcmp(p->at[i], text);
}

static void answer_json(CtsServer *server, CtsHttpRequest *request, char *json)
{
    CtsHttpAnswer answer;
    if (json)
        cts_answer_bytes(&answer, server, 200, "application/json", json, strlen(json), false);
    else
        cts_answer_text(&answer, server, 503, "out of memory");
    cts_http_answer(request, &answer);
}

static void answer_text(CtsServer *server, CtsHttpRequest *request, int status, const char *text)
{
    CtsHttpAnswer answer;
    cts_answer_text(&answer, server, status, text);
    cts_http_answer(request, &answer);
}

static bool answer_asset(CtsServer *server, CtsHttpRequest *request, const char *name)
{
    CtsHttpAnswer answer;
    for (size_t i = 0; i < cts_page_n_assets; i++) {
        const CtsPageAsset *const a = &cts_page_assets[i];
        if (strcmp(a->name, name))
            continue;
        cts_answer_bytes(&answer, server, 200, a->media_type, a->bytes, a->n_bytes, true);
        cts_answer_header(&answer, "Content-Security-Policy",
                          "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; "
                          "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'");
        cts_answer_header(&answer, "Referrer-Policy", "no-referrer");
        cts_http_answer(request, &answer);
        return true;
    }
    return false;
}

/* The series, study or object that a URL names. */
typedef struct Target {
    const char *id, *study_uid, *uid; /* id, or the UIDs; uid NULL: the study's one volume */
    const char *instance_uid;         /* NULL: a series */
    bool thumbnail;
} Target;

static CtsStatus find_target(CtsServer *server, const Target *t, CtsCachedSeries **found, CtsError *err)
{
    if (t->id) {
        *found = cts_series_cache_by_id(&server->cache, t->id);
        return *found ? CTS_OK : cts_fail(err, CTS_ERR_NO_SERIES, "there is no such series here");
    }
    return t->uid ? cts_series_cache_by_uid(&server->cache, t->study_uid, t->uid, t->instance_uid, found, err)
                  : cts_series_cache_of_study(&server->cache, t->study_uid, t->thumbnail, found, err);
}

/* Queues the render request, which is the queue's then, or fails with the reason. *is_kept: it is a thumbnail's that
 * need not be made, and is not queued. */
static CtsStatus queue(CtsServer *server, CtsRenderRequest *e, Target target, bool *is_kept, CtsError *err)
{
    pthread_mutex_lock(&server->lock);
    CtsStatus st = server->stopping ? cts_fail(err, CTS_ERR_INTERRUPTED, "the server is stopping")
                                    : find_target(server, &target, &e->cached, err);
    if (!st && e->cached->series && target.thumbnail)
        st = cts_thumbnail_find(server, e, err);
    else if (!st && e->cached->series && !e->cached->series->renderable)
        st = cts_fail(err, CTS_ERR_GEOMETRY, "%s", e->cached->series->reason);
    *is_kept = !st && e->is_kept;
    if (!st && !*is_kept) {
        cts_http_wait(e->request);
        if (!cts_render_queue_add(server, e))
            st = cts_fail(err, CTS_ERR_MEMORY, "too many pictures are queued (ask again)");
    }
    pthread_mutex_unlock(&server->lock);
    return st;
}

static CtsStatus prepare_request(CtsServer *server, CtsRenderRequest *e, const CtsFormatInfo *format, CtsError *err)
{
    CtsStatus st = cts_render_query_options(&e->render_query, format, server->folder, ++server->n_pictures,
                                            server->options->render.n_threads, &e->report, err);
    if (st == CTS_ERR_READ && e->render_query.state_path)
        st = CTS_ERR_USAGE; /* the client's fault, not the server's */
    e->render_query.job.render.stop = e->render_query.job.source.stop = &e->stop;
    return st;
}

/* An object is a presentation state, or should be a whole series where it is not a thumbnail's. */
static void find_instance(const CtsServer *server, CtsRenderRequest *e, const Target *target)
{
    if (!target->instance_uid)
        return;
    if (!target->thumbnail)
        e->render_query.state_path = cts_series_cache_state(&server->cache, target->uid, target->instance_uid);
    if (!e->render_query.state_path)
        snprintf(e->render_query.instance_uid, sizeof e->render_query.instance_uid, "%s", target->instance_uid);
}

/* A presentation state's picture is of the series that it names. */
static Target of_state(const CtsRenderRequest *e, const Target *target)
{
    Target of = *target;
    if (e->render_query.state_path)
        of.uid = e->render_query.options.state->source_uid;
    return of;
}

/* format NULL: use the standard's parameters. */
static void request_picture(CtsServer *server, CtsHttpRequest *request, const Target *target,
                            const CtsFormatInfo *format)
{
    CtsError err = {0};
    CtsHttpAnswer answer;
    CtsRenderRequest *const e = calloc(1, sizeof *e);
    if (!e) {
        answer_text(server, request, 503, "out of memory");
        return;
    }
    e->request = request;
    e->socket = request->socket;
    cts_http_query(request, &e->render_query.query);
    e->render_query.thumbnail = target->thumbnail;
    find_instance(server, e, target);
    CtsStatus st = format ? CTS_OK : cts_render_query_rendered3d(&e->render_query, request->accept, &format, &err);
    const bool acceptable = st || format;
    bool is_kept = false;
    if (!st && format && !(st = prepare_request(server, e, format, &err)))
        st = queue(server, e, of_state(e, target), &is_kept, &err);
    if (!st && is_kept)
        st = cts_answer_picture(&answer, server, e, &err);
    else if (!st && acceptable)
        return;
    if (!acceptable)
        cts_answer_text(&answer, server, 406,
                        target->thumbnail
                            ? "there are image/jpeg, image/png and image/webp"
                            : "there are image/jpeg, image/png, image/webp and application/dicom (of a swivel the last "
                              "two), and application/dicom+json for renderedvolumetricmetadata");
    else if (st)
        cts_answer_failure(&answer, server, e->cached, st, &err);
    cts_render_request_free(e);
    cts_http_answer(request, &answer);
}

static void request_series(CtsServer *server, CtsHttpRequest *request, const Parts *p)
{
    const CtsFormatInfo *const format = p->n == 3 ? cts_export_format(p->at[2]) : NULL;
    if (p->n == 1)
        answer_json(server, request, cts_list_series(server));
    else if (is(p, 2, "labels") && p->n == 3)
        answer_json(server, request, cts_list_labels(server, p->at[1]));
    else if (is(p, 2, "presets") && p->n == 3)
        answer_json(server, request, cts_list_presets(server, p->at[1]));
    else if (is(p, 2, "thumbnail") && p->n == 3)
        request_picture(server, request, &(Target){.id = p->at[1], .thumbnail = true}, NULL);
    else if (format && !strncmp(p->at[2], "picture.", 8) && !strcmp(p->at[2] + 8, format->name))
        request_picture(server, request, &(Target){.id = p->at[1]}, format);
    else
        answer_text(server, request, 404,
                    "there are /series, /series/ID/labels, /series/ID/presets, /series/ID/thumbnail and "
                    "/series/ID/picture.ENDING, its ending a format's");
}

/* /studies/S/rendered3D, thumbnail, and paths below it. */
static void request_study(CtsServer *server, CtsHttpRequest *request, const Parts *p)
{
    const Target target = {.study_uid = p->at[1],
                           .uid = p->n > 3 && is(p, 2, "series") ? p->at[3] : NULL,
                           .instance_uid = p->n == 7 && is(p, 4, "instances") ? p->at[5] : NULL,
                           .thumbnail = is(p, p->n - 1, "thumbnail")};
    const bool of_study = p->n == 3, of_series = p->n == 5 && target.uid;
    if ((of_study || of_series || target.instance_uid) && (target.thumbnail || is(p, p->n - 1, "rendered3D")))
        request_picture(server, request, &target, NULL);
    else
        answer_text(
            server, request, 404,
            "of PS3.18 there are rendered3D and thumbnail, of a study, a series or an object; renderedMPR and other "
            "resources are not supported");
}

void cts_routes_dispatch(CtsServer *server, CtsHttpRequest *request)
{
    CtsHttpAnswer answer;
    Parts p;
    if (!cts_access_check(server, request, &answer)) {
        cts_http_answer(request, &answer);
        return;
    }
    split_path(request->path, &p);
    if (p.n == 1 && answer_asset(server, request, strcmp(request->method, "OPTIONS") ? p.at[0] : "capabilities.wadl"))
        return;
    if (is(&p, 0, "series"))
        request_series(server, request, &p);
    else if (is(&p, 0, "studies") && p.n > 2)
        request_study(server, request, &p);
    else if (is(&p, 0, "presets") && p.n == 1)
        answer_json(server, request, cts_list_presets(server, NULL));
    else
        answer_text(server, request, 404, "no such address (there are /, /series, /presets and /studies/...)");
}
