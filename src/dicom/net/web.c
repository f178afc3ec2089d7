/* DICOMweb (PS3.18): STOW-RS to store, WADO-RS to fetch, QIDO-RS to query. */
#include "dicom/net/web.h"

#include "dicom/net/multipart.h"
#include "dicom/net/store_answer.h"
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static bool passes(CURLcode code)
{
    return code != CURLE_PEER_FAILED_VERIFICATION && code != CURLE_SSL_CERTPROBLEM &&
           code != CURLE_SSL_CACERT_BADFILE && code != CURLE_URL_MALFORMAT && code != CURLE_UNSUPPORTED_PROTOCOL &&
           code != CURLE_ABORTED_BY_CALLBACK && code != CURLE_READ_ERROR;
}

/* A status of success does not suffice: some peers, and login pages, return it for objects that are not stored. Nor
 * does one of failure: the reason decides, where the peer gives it. */
static void check_upload(const CtsWeb *web, CURLcode code, long status, CtsOutgoingFile *outgoing, CtsAttempt *result)
{
    const bool good = !code && (status == 200 || status == 201 || status == 202);
    CtsStoreAnswer answer = {0};
    char how[80];
    if (!code && !web->too_long)
        answer = cts_store_answer_read(web->answer, web->n_answer, outgoing->ids.sop_uid);
    snprintf(how, sizeof how, "answers with status %ld and FailureReason", status);
    if (answer.failure || (good && answer.stored && !answer.failed)) {
        cts_outgoing_file_answered(outgoing, web->net, answer.failed, answer.failed ? answer.failure : answer.warning,
                                   how, result);
    } else if (good) {
        cts_fail(&result->error, CTS_ERR_OUTPUT,
                 "the peer does not say that it stored it, though it answers with status %ld", status);
    } else {
        result->again = code ? passes(code) : status >= 500 || status == 429 || status == 408;
        cts_web_fail(web, code, status, CTS_ERR_OUTPUT, &result->error);
    }
}

/* The body of a STOW-RS request: one part, without the file's name. */
static CtsStatus set_body(CtsWeb *web, const char *path, CtsError *err)
{
    curl_mimepart *const part = (web->body = curl_mime_init(web->curl)) ? curl_mime_addpart(web->body) : NULL;
    if (!part || curl_mime_type(part, "application/dicom") ||
        !cts_web_add_header(web, "Content-Type: multipart/related; type=\"application/dicom\"") ||
        !cts_web_add_header(web, "Expect:"))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (curl_mime_filedata(part, path) || curl_mime_filename(part, NULL))
        return cts_fail(err, CTS_ERR_READ, "it cannot be read");
    curl_easy_setopt(web->curl, CURLOPT_MIMEPOST, web->body);
    return CTS_OK;
}

static void store(const CtsPeer *peer, const CtsNet *net, CtsOutgoingFile *outgoing, CtsAttempt *result)
{
    CtsWeb web;
    long status;
    if (!cts_web_open(&web, peer, net, "studies", cts_web_accepts_json, &result->error) &&
        !set_body(&web, outgoing->path, &result->error)) {
        const CURLcode code = cts_web_perform(&web, &status);
        check_upload(&web, code, status, outgoing, result);
    }
    cts_web_close(&web);
}

static void web_send(const CtsPeer *peer, const CtsNet *net, CtsOutgoingFile *outgoing_files, int n_outgoing,
                     CtsAttempt *result)
{
    for (int i = 0; i < n_outgoing && !result->error.status && !cts_net_stopped(net); i++)
        if (!outgoing_files[i].sent)
            store(peer, net, &outgoing_files[i], result);
}

/* State while a WADO-RS answer is written to files. */
typedef struct Download {
    CtsWeb *web;
    CtsFetchFolder *fetch_folder;
    CtsMultipart multipart;
    bool started; /* the body */
    bool single;  /* it is one object, not multipart */
    char *path;   /* of the file being written */
    FILE *file;
    uint64_t n_bytes;
    CtsError error;
} Download;

static CtsStatus unwritten(const Download *d, CtsError *err)
{
    return cts_fail(err, CTS_ERR_READ, "%s: cannot be written: %s", d->path, strerror(errno));
}

static CtsStatus begin_file(void *context, CtsError *err)
{
    Download *d = context;
    const CtsStatus st = cts_fetch_folder_next(d->fetch_folder, &d->path, err);
    if (st)
        return st;
    d->n_bytes = 0;
    d->file = fopen(d->path, "wbxe");
    return d->file ? CTS_OK : unwritten(d, err);
}

static CtsStatus write_file(void *context, const void *bytes, size_t n, CtsError *err)
{
    Download *d = context;
    const CtsStatus st = cts_fetch_folder_grows(d->fetch_folder, d->n_bytes += n, err);
    return st || fwrite(bytes, 1, n, d->file) == n ? st : unwritten(d, err);
}

static CtsStatus end_file(void *context, CtsError *err)
{
    Download *d = context;
    const CtsStatus st = fclose(d->file) ? unwritten(d, err) : cts_fetch_folder_keep(d->fetch_folder, d->path, err);
    d->file = NULL;
    free(d->path);
    d->path = NULL;
    return st;
}

/* application/dicom, with parameters or none; not application/dicom+json. */
static bool is_one_object(const char *type)
{
    return strncasecmp(type, "application/dicom", 17) == 0 && strchr(" \t;", type[17]);
}

static size_t take_answer(char *bytes, size_t size, size_t n, void *context)
{
    Download *d = context;
    long status = 0;
    curl_easy_getinfo(d->web->curl, CURLINFO_RESPONSE_CODE, &status);
    if (status != 200) /* reported by its number */
        return size * n;
    if (!d->started) {
        const CtsPartSink sink = {begin_file, write_file, end_file, d};
        d->started = true;
        d->single = is_one_object(cts_web_content_type(d->web));
        if (d->single)
            begin_file(d, &d->error);
        else
            cts_multipart_start(&d->multipart, cts_web_content_type(d->web), &sink, &d->error);
    }
    if (!d->error.status && d->single)
        write_file(d, bytes, size * n, &d->error);
    else if (!d->error.status)
        cts_multipart_feed(&d->multipart, bytes, size * n, &d->error);
    return d->error.status ? 0 : size * n;
}

static CtsStatus check_download(Download *d, CURLcode code, long status, CtsError *err)
{
    if (d->error.status)
        return *err = d->error, d->error.status;
    if (!code && (status == 404 || status == 204))
        return cts_fail(err, CTS_ERR_READ, "the peer does not have it (status %ld)", status);
    if (code || status != 200)
        return cts_web_fail(d->web, code, status, CTS_ERR_READ, err);
    if (d->single)
        return end_file(d, err);
    return d->started ? cts_multipart_finish(&d->multipart, err) : CTS_OK;
}

/* Counts the objects, where the peer supports QIDO-RS. */
static void web_count(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *wanted, CtsFetchFolder *folder)
{
    CtsNet quiet = *net;
    CtsFound found = {0};
    CtsWebSearcher searcher = {.peer = peer, .net = &quiet};
    int64_t n = 0;
    quiet.report = NULL;
    if (!cts_search_study(wanted, &quiet, cts_web_search, &searcher, &found, NULL))
        for (int i = 0; i < found.n; i++)
            n += found.items[i].n_objects;
    folder->n_promised = n <= CTS_FETCH_MAX_FILES ? (int)n : 0;
    cts_found_free(&found);
}

static CtsStatus web_fetch(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *wanted, CtsFetchFolder *folder,
                           CtsError *err)
{
    CtsWeb web;
    Download d = {.web = &web, .fetch_folder = folder};
    char what[200];
    long status;
    /* UIDs need no encoding: they have been checked to be digits and dots. */
    snprintf(what, sizeof what, "studies/%s%s%s", wanted->study_uid, wanted->series_uid ? "/series/" : "",
             wanted->series_uid ? wanted->series_uid : "");
    CtsStatus st = cts_web_open(&web, peer, net, what,
                                "Accept: multipart/related; type=\"application/dicom\"; transfer-syntax=*", err);
    if (!st) {
        curl_easy_setopt(web.curl, CURLOPT_WRITEFUNCTION, take_answer);
        curl_easy_setopt(web.curl, CURLOPT_WRITEDATA, &d);
        const CURLcode code = cts_web_perform(&web, &status);
        st = check_download(&d, code, status, err);
    }
    if (!st)
        web_count(peer, net, wanted, folder);
    if (d.file)
        fclose(d.file);
    free(d.path);
    cts_web_close(&web);
    return st;
}

static CtsStatus web_find(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *query, CtsFound *found,
                          CtsError *err)
{
    CtsWebSearcher searcher = {.peer = peer, .net = net};
    return cts_search_series(query, net, cts_web_search, &searcher, found, err);
}

const CtsProtocol cts_protocol_web = {.send = web_send, .fetch = web_fetch, .find = web_find};
