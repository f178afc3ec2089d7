#include "app/serve/server.h"

#include "base/exit_code.h"
#include <errno.h>
#include <fcntl.h>
#include <microhttpd.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void cts_answer_header(CtsHttpAnswer *answer, const char *name, const char *value)
{
    const char *const before = answer->response ? MHD_get_response_header(answer->response, name) : NULL;
    if (before)
        MHD_del_response_header(answer->response, name, before);
    if (answer->response)
        MHD_add_response_header(answer->response, name, value);
}

static void begin_answer(CtsHttpAnswer *answer, const CtsServer *server, int status, struct MHD_Response *response,
                         const char *media_type)
{
    *answer = (CtsHttpAnswer){status, response};
    cts_answer_header(answer, "Content-Type", media_type);
    cts_answer_header(answer, "Cache-Control", "no-store"); /* a patient's picture */
    cts_answer_header(answer, "X-Content-Type-Options", "nosniff");
    if (server->options->allow_origin) {
        cts_answer_header(answer, "Access-Control-Allow-Origin", server->options->allow_origin);
        cts_answer_header(answer, "Access-Control-Expose-Headers", "Ctsplat-Scene");
        cts_answer_header(answer, "Vary", "Origin");
    }
}

void cts_answer_bytes(CtsHttpAnswer *answer, const CtsServer *server, int status, const char *media_type,
                      const void *bytes, size_t n, bool lasting)
{
    void *const text = (void *)(uintptr_t)bytes;
    struct MHD_Response *const response =
        MHD_create_response_from_buffer(n, text, lasting ? MHD_RESPMEM_PERSISTENT : MHD_RESPMEM_MUST_FREE);
    if (!response && !lasting)
        free(text);
    begin_answer(answer, server, status, response, media_type);
}

void cts_answer_text(CtsHttpAnswer *answer, const CtsServer *server, int status, const char *text)
{
    char *line = malloc(strlen(text) + 2);
    const size_t n = line ? (size_t)sprintf(line, "%s\n", text) : 0;
    for (size_t i = 0; i + 1 < n; i++)
        if ((unsigned char)line[i] < 0x20 || line[i] == 0x7f)
            line[i] = '?';
    cts_answer_bytes(answer, server, status, "text/plain; charset=utf-8", line ? line : "", n, !line);
    if (status == 503) {
        char seconds[16];
        snprintf(seconds, sizeof seconds, "%d", CTS_SERVE_RETRY_S);
        cts_answer_header(answer, "Retry-After", seconds);
    }
}

/* The HTTP status of a failure: 400 for a bad request, 503 for a temporary lack of resources, else 500. */
static int status_of(CtsStatus st)
{
    const bool is_bad = st == CTS_ERR_SYNTAX || cts_exit_code(st) == 2 || cts_exit_code(st) == 4;
    const bool passes = st == CTS_ERR_MEMORY || st == CTS_ERR_INTERRUPTED;
    return st == CTS_ERR_NO_SERIES ? 404 : is_bad ? 400 : passes ? 503 : 500;
}

char *cts_server_masked(const CtsServer *server, const CtsCachedSeries *cached, const char *text)
{
    CtsNames own = {0};
    for (size_t i = 0; cached && cached->on_demand && cached->loaded.list && i < cached->loaded.list->n_paths; i++)
        cts_names_add(&own, cached->loaded.list->paths[i]);
    char *const here = cts_redact_names(text, &server->names, NULL);
    char *const there = here ? cts_redact_names(here, &own, NULL) : NULL;
    char *const masked = there ? cts_redact_uids(&server->cache.key, there) : NULL;
    free(here);
    free(there);
    cts_names_free(&own);
    return masked;
}

void cts_answer_failure(CtsHttpAnswer *answer, const CtsServer *server, const CtsCachedSeries *cached, CtsStatus st,
                        const CtsError *err)
{
    char *text = cts_server_masked(server, cached, err->text);
    cts_answer_text(answer, server, status_of(st), text ? text : "out of memory");
    free(text);
}

/* Of a picture the file, which has no name any more. */
static CtsStatus answer_file(CtsHttpAnswer *answer, const CtsServer *server, const CtsRenderRequest *r, CtsError *err)
{
    const int fd = open(r->render_query.path, O_RDONLY | O_CLOEXEC);
    if (fd < 0)
        return cts_fail(err, CTS_ERR_OUTPUT, "the picture cannot be read back: %s", strerror(errno));
    if (!r->etag[0] || !server->thumbnails[0])
        unlink(r->render_query.path);
    const off_t size = lseek(fd, 0, SEEK_END);
    struct MHD_Response *const response = size < 0 ? NULL : MHD_create_response_from_fd64((uint64_t)size, fd);
    if (!response)
        close(fd);
    begin_answer(answer, server, 200, response, r->render_query.media_type);
    return CTS_OK;
}

CtsStatus cts_answer_picture(CtsHttpAnswer *answer, const CtsServer *server, const CtsRenderRequest *r, CtsError *err)
{
    char *const json = r->render_query.metadata ? cts_list_module(r) : r->etag[0] ? NULL : cts_list_scene(server, r);
    const char *const has = cts_http_header(r->request, "If-None-Match");
    CtsStatus st = CTS_OK;
    if (r->render_query.metadata && json) {
        cts_answer_bytes(answer, server, 200, "application/dicom+json", json, strlen(json), false);
        return CTS_OK;
    }
    if (r->render_query.metadata)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (r->etag[0] && has && strstr(has, r->etag))
        cts_answer_bytes(answer, server, 304, r->render_query.media_type, "", 0, true);
    else
        st = answer_file(answer, server, r, err);
    if (!st && r->etag[0]) {
        cts_answer_header(answer, "ETag", r->etag);
        cts_answer_header(answer, "Cache-Control", "private, no-cache"); /* asks with the ETag each time */
    } else if (!st && json)
        cts_answer_header(answer, "Ctsplat-Scene", json);
    free(json);
    return st;
}
