/* DICOMweb with libcurl (PS3.18): STOW-RS out, WADO-RS in. */
#define _GNU_SOURCE
#include "output/net/multipart.h"
#include "output/net/peer.h"
#include "output/net/web_find.h"

#include <curl/curl.h>
#include <errno.h>
#include <jansson.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

enum { MAX_CREDENTIALS = 4096 };

static const char boundary[] = "ctsplat-part";

/* One request and what it needs to be kept alive. */
typedef struct Web {
    CURL *curl;
    struct curl_slist *headers;
    const CtsNet *net;
    char credentials[MAX_CREDENTIALS];
    char why[CURL_ERROR_SIZE];
    char content_type[300];
} Web;

/* From a file or the environment, never from the command line, where other users see it. */
static CtsStatus read_credentials(const CtsNet *net, char text[MAX_CREDENTIALS], CtsError *err)
{
    const char *variable = getenv("CTSPLAT_CREDENTIALS");
    text[0] = 0;
    if (net->credentials) {
        FILE *file = fopen(net->credentials, "re");
        if (!file)
            return cts_fail(err, CTS_ERR_READ, "%s: cannot be read: %s", net->credentials, strerror(errno));
        const char *line = fgets(text, MAX_CREDENTIALS, file);
        fclose(file);
        if (!line)
            return cts_fail(err, CTS_ERR_READ, "%s: is empty (user:password, or Bearer and a token)", net->credentials);
    } else if (variable)
        snprintf(text, MAX_CREDENTIALS, "%s", variable);
    text[strcspn(text, "\r\n")] = 0;
    if (*text && strncasecmp(text, "Bearer ", 7) != 0 && !strchr(text, ':'))
        return cts_fail(err, CTS_ERR_USAGE, "the credentials are neither user:password nor Bearer and a token");
    return CTS_OK;
}

static int stop_transfer(void *context, curl_off_t a, curl_off_t b, curl_off_t c, curl_off_t d)
{
    const Web *web = context;
    (void)a, (void)b, (void)c, (void)d;
    return cts_net_stopped(web->net);
}

static size_t keep_content_type(char *bytes, size_t size, size_t n, void *context)
{
    Web *web = context;
    static const char name[] = "content-type:";
    const size_t length = size * n, prefix = sizeof name - 1;
    if (length > prefix && strncasecmp(bytes, name, prefix) == 0) {
        snprintf(web->content_type, sizeof web->content_type, "%.*s", (int)(length - prefix), bytes + prefix);
        web->content_type[strcspn(web->content_type, "\r\n")] = 0;
        memmove(web->content_type, web->content_type + strspn(web->content_type, " \t"),
                strlen(web->content_type + strspn(web->content_type, " \t")) + 1);
    }
    return length;
}

static bool add_header(Web *web, const char *line)
{
    struct curl_slist *longer = curl_slist_append(web->headers, line);
    web->headers = longer ? longer : web->headers;
    return longer;
}

static CtsStatus web_open(Web *web, const CtsNet *net, const char *url, CtsError *err)
{
    memset(web, 0, sizeof *web);
    web->net = net;
    CtsStatus st = read_credentials(net, web->credentials, err);
    if (st)
        return st;
    if (curl_global_init(CURL_GLOBAL_DEFAULT) || !(web->curl = curl_easy_init()))
        return cts_fail(err, CTS_ERR_INTERNAL, "libcurl cannot be started");
    CURL *c = web->curl;
    curl_easy_setopt(c, CURLOPT_URL, url);
    curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(c, CURLOPT_ERRORBUFFER, web->why);
    curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT, (long)net->timeout_s);
    curl_easy_setopt(c, CURLOPT_LOW_SPEED_LIMIT, 1L); /* silence for so long ends a transfer */
    curl_easy_setopt(c, CURLOPT_LOW_SPEED_TIME, (long)net->timeout_s);
    curl_easy_setopt(c, CURLOPT_USERAGENT, "ctsplat/" CTS_VERSION);
    curl_easy_setopt(c, CURLOPT_NOPROGRESS, 0L);
    curl_easy_setopt(c, CURLOPT_XFERINFOFUNCTION, stop_transfer);
    curl_easy_setopt(c, CURLOPT_XFERINFODATA, web);
    curl_easy_setopt(c, CURLOPT_HEADERFUNCTION, keep_content_type);
    curl_easy_setopt(c, CURLOPT_HEADERDATA, web);
    if (net->tls_ca)
        curl_easy_setopt(c, CURLOPT_CAINFO, net->tls_ca);
    if (net->tls_key) {
        curl_easy_setopt(c, CURLOPT_SSLKEY, net->tls_key);
        curl_easy_setopt(c, CURLOPT_SSLCERT, net->tls_certificate);
    }
    if (strncasecmp(web->credentials, "Bearer ", 7) == 0) {
        curl_easy_setopt(c, CURLOPT_HTTPAUTH, (long)CURLAUTH_BEARER);
        curl_easy_setopt(c, CURLOPT_XOAUTH2_BEARER, web->credentials + 7);
    } else if (*web->credentials) {
        curl_easy_setopt(c, CURLOPT_HTTPAUTH, (long)CURLAUTH_BASIC); /* at once: an upload is not sent twice */
        curl_easy_setopt(c, CURLOPT_USERPWD, web->credentials);
    }
    return CTS_OK;
}

static void web_close(Web *web)
{
    if (web->curl)
        curl_easy_cleanup(web->curl);
    curl_slist_free_all(web->headers);
    explicit_bzero(web->credentials, sizeof web->credentials);
    memset(web, 0, sizeof *web);
}

/* A peer that hangs up must not end the program: curl leaves SIGPIPE to its caller. */
static CURLcode perform(Web *web, long *status)
{
    sigset_t pipe, before;
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    pthread_sigmask(SIG_BLOCK, &pipe, &before);
    curl_easy_setopt(web->curl, CURLOPT_HTTPHEADER, web->headers);
    const CURLcode code = curl_easy_perform(web->curl);
    while (sigtimedwait(&pipe, NULL, &(struct timespec){0}) > 0)
        continue;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    *status = 0;
    curl_easy_getinfo(web->curl, CURLINFO_RESPONSE_CODE, status);
    return code;
}

/* The body of a STOW-RS request: a head, the file, a tail. */
typedef struct Upload {
    FILE *file;
    char head[200], tail[64];
    size_t n_head, n_tail; /* that are still to be sent */
} Upload;

static size_t read_upload(char *to, size_t size, size_t n, void *context)
{
    Upload *u = context;
    size_t room = size * n, got = 0;
    const size_t head = u->n_head < room ? u->n_head : room;
    memcpy(to, u->head + strlen(u->head) - u->n_head, head);
    u->n_head -= head;
    got += head;
    if (got < room && u->n_head == 0) {
        got += fread(to + got, 1, room - got, u->file);
        if (ferror(u->file))
            return CURL_READFUNC_ABORT;
    }
    if (got < room && feof(u->file)) {
        const size_t tail = u->n_tail < room - got ? u->n_tail : room - got;
        memcpy(to + got, u->tail + strlen(u->tail) - u->n_tail, tail);
        u->n_tail -= tail;
        got += tail;
    }
    return got;
}

/* What a peer says; an answer that is longer says nothing. */
typedef struct Answer {
    char text[1 << 20];
    size_t n;
    bool too_long;
} Answer;

static size_t keep_answer(char *bytes, size_t size, size_t n, void *context)
{
    Answer *a = context;
    const size_t room = sizeof a->text - 1 - a->n, part = size * n < room ? size * n : room;
    memcpy(a->text + a->n, bytes, part);
    a->n += part;
    a->text[a->n] = 0;
    a->too_long |= part < size * n;
    return size * n;
}

/* The sequence's items name this instance: ReferencedSOPInstanceUID (0008,1155). */
static bool names(const json_t *answer, const char *sequence, const char *sop_uid)
{
    const json_t *items = json_object_get(json_object_get(answer, sequence), "Value");
    for (size_t i = 0; i < json_array_size(items); i++) {
        const json_t *values = json_object_get(json_object_get(json_array_get(items, i), "00081155"), "Value");
        const char *uid = json_string_value(json_array_get(values, 0));
        if (uid && strcmp(uid, sop_uid) == 0)
            return true;
    }
    return false;
}

/* ReferencedSOPSequence (0008,1199) names what is stored, FailedSOPSequence (0008,1198) what is not. */
static bool confirmed_by_json(const Answer *a, const char *sop_uid)
{
    json_t *answer = json_loadb(a->text, a->n, 0, NULL);
    const size_t n = json_is_array(answer) ? json_array_size(answer) : json_is_object(answer);
    bool stored = false, failed = false;
    for (size_t i = 0; i < n; i++) {
        const json_t *object = json_is_array(answer) ? json_array_get(answer, i) : answer;
        stored |= names(object, "00081199", sop_uid);
        failed |= names(object, "00081198", sop_uid);
    }
    json_decref(answer);
    return stored && !failed;
}

/* The native DICOM model (PS3.19 A.1): the sequence that a UID stands in is the last one that began before it. */
static bool confirmed_by_xml(const Answer *a, const char *sop_uid)
{
    char value[80];
    bool stored = false, failed = false;
    snprintf(value, sizeof value, ">%s<", sop_uid);
    for (const char *at = a->text; (at = strstr(at, value)); at++) {
        const char *referenced = NULL, *other = NULL;
        for (const char *tag = a->text; (tag = strstr(tag, "\"0008119")) && tag < at; tag++)
            *(tag[8] == '9' ? &referenced : &other) = tag;
        stored |= referenced && (!other || other < referenced);
        failed |= other && (!referenced || referenced < other);
    }
    return stored && !failed;
}

/* A status of success is not enough: there are peers, and pages to log in by, that give it for what is not stored. */
static bool is_confirmed(const Answer *a, const char *content_type, const char *sop_uid)
{
    return !a->too_long &&
           (strcasestr(content_type, "xml") ? confirmed_by_xml(a, sop_uid) : confirmed_by_json(a, sop_uid));
}

static bool passes(CURLcode code)
{
    return code != CURLE_PEER_FAILED_VERIFICATION && code != CURLE_SSL_CERTPROBLEM &&
           code != CURLE_SSL_CACERT_BADFILE && code != CURLE_URL_MALFORMAT && code != CURLE_UNSUPPORTED_PROTOCOL &&
           code != CURLE_ABORTED_BY_CALLBACK && code != CURLE_READ_ERROR;
}

static void judge_upload(const Web *web, CURLcode code, long status, const Answer *answer, CtsParcel *parcel,
                         const CtsNet *net, CtsTry *result)
{
    if (code) {
        result->again = passes(code);
        cts_fail(&result->error, CTS_ERR_OUTPUT, "%s", *web->why ? web->why : curl_easy_strerror(code));
    } else if (status == 200 || status == 201) {
        if (is_confirmed(answer, web->content_type, parcel->sop_uid))
            cts_parcel_is_sent(parcel, net);
        else
            cts_fail(&result->error, CTS_ERR_OUTPUT,
                     "the peer does not say that it stored it, though it answers with status %ld", status);
    } else {
        result->again = status >= 500 || status == 429 || status == 408;
        cts_fail(&result->error, CTS_ERR_OUTPUT, "the peer answers with status %ld%s", status,
                 status == 401 || status == 403 ? " (--credentials FILE or CTSPLAT_CREDENTIALS)" : "");
    }
}

static void store(const CtsPeer *peer, const CtsNet *net, CtsParcel *parcel, CtsTry *result)
{
    Web web;
    Upload upload = {0};
    Answer *answer = calloc(1, sizeof *answer);
    struct stat info;
    char url[1100], type[200];
    long status = 0;
    snprintf(url, sizeof url, "%s/studies", peer->url);
    snprintf(type, sizeof type, "Content-Type: multipart/related; type=\"application/dicom\"; boundary=%s", boundary);
    snprintf(upload.head, sizeof upload.head, "--%s\r\nContent-Type: application/dicom\r\n\r\n", boundary);
    snprintf(upload.tail, sizeof upload.tail, "\r\n--%s--\r\n", boundary);
    upload.n_head = strlen(upload.head);
    upload.n_tail = strlen(upload.tail);
    if (web_open(&web, net, url, &result->error))
        goto end;
    if (!answer) {
        cts_fail(&result->error, CTS_ERR_MEMORY, "out of memory");
        goto end;
    }
    if (!(upload.file = fopen(parcel->path, "rbe")) || fstat(fileno(upload.file), &info)) {
        cts_fail(&result->error, CTS_ERR_READ, "it cannot be read: %s", strerror(errno));
        goto end;
    }
    if (!add_header(&web, type) || !add_header(&web, "Accept: application/dicom+json") ||
        !add_header(&web, "Expect:")) {
        cts_fail(&result->error, CTS_ERR_MEMORY, "out of memory");
        goto end;
    }
    curl_easy_setopt(web.curl, CURLOPT_POST, 1L);
    curl_easy_setopt(web.curl, CURLOPT_POSTFIELDSIZE_LARGE,
                     (curl_off_t)(upload.n_head + upload.n_tail) + (curl_off_t)info.st_size);
    curl_easy_setopt(web.curl, CURLOPT_READFUNCTION, read_upload);
    curl_easy_setopt(web.curl, CURLOPT_READDATA, &upload);
    curl_easy_setopt(web.curl, CURLOPT_WRITEFUNCTION, keep_answer);
    curl_easy_setopt(web.curl, CURLOPT_WRITEDATA, answer);
    const CURLcode code = perform(&web, &status);
    judge_upload(&web, code, status, answer, parcel, net, result);
end:
    if (upload.file)
        fclose(upload.file);
    free(answer);
    web_close(&web);
}

static void web_send(const CtsPeer *peer, const CtsNet *net, CtsParcel *parcels, int n_parcels, CtsTry *result)
{
    for (int i = 0; i < n_parcels && !result->error.status && !cts_net_stopped(net); i++)
        if (!parcels[i].sent)
            store(peer, net, &parcels[i], result);
}

/* A WADO-RS answer on its way into files. */
typedef struct Download {
    Web *web;
    CtsInbox *inbox;
    CtsMultipart multipart;
    bool started; /* the multipart body */
    char *path;   /* of the file being written */
    FILE *file;
    uint64_t n_bytes;
    CtsStatus status;
    CtsError error;
} Download;

static CtsStatus begin_file(void *context, CtsError *err)
{
    Download *d = context;
    const CtsStatus st = cts_inbox_next(d->inbox, &d->path, err);
    if (st)
        return st;
    d->n_bytes = 0;
    d->file = fopen(d->path, "wbxe");
    return d->file ? CTS_OK : cts_fail(err, CTS_ERR_READ, "%s: cannot be written: %s", d->path, strerror(errno));
}

static CtsStatus write_file(void *context, const void *bytes, size_t n, CtsError *err)
{
    Download *d = context;
    const CtsStatus st = cts_inbox_grows(d->inbox, d->n_bytes += n, err);
    if (st)
        return st;
    return fwrite(bytes, 1, n, d->file) == n
               ? CTS_OK
               : cts_fail(err, CTS_ERR_READ, "%s: cannot be written: %s", d->path, strerror(errno));
}

static CtsStatus end_file(void *context, CtsError *err)
{
    Download *d = context;
    const int failed = fclose(d->file);
    d->file = NULL;
    CtsStatus st = failed ? cts_fail(err, CTS_ERR_READ, "%s: cannot be written: %s", d->path, strerror(errno)) : CTS_OK;
    if (!st)
        st = cts_inbox_keep(d->inbox, d->path, err);
    free(d->path);
    d->path = NULL;
    return st;
}

static size_t take_answer(char *bytes, size_t size, size_t n, void *context)
{
    Download *d = context;
    long status = 0;
    curl_easy_getinfo(d->web->curl, CURLINFO_RESPONSE_CODE, &status);
    if (status != 200) /* told by its number */
        return size * n;
    if (!d->started) {
        const CtsPartSink sink = {begin_file, write_file, end_file, d};
        d->started = true;
        d->status = cts_multipart_start(&d->multipart, d->web->content_type, &sink, &d->error);
    }
    if (!d->status)
        d->status = cts_multipart_feed(&d->multipart, bytes, size * n, &d->error);
    return d->status ? 0 : size * n;
}

static CtsStatus judge_download(const Download *d, CURLcode code, long status, CtsError *err)
{
    if (d->status) {
        *err = d->error;
        return d->status;
    }
    if (code)
        return cts_fail(err, CTS_ERR_READ, "the peer cannot be read from: %s",
                        *d->web->why ? d->web->why : curl_easy_strerror(code));
    if (status == 404 || status == 204)
        return cts_fail(err, CTS_ERR_READ, "the peer does not have it (status %ld)", status);
    if (status != 200)
        return cts_fail(err, CTS_ERR_READ, "the peer answers with status %ld%s", status,
                        status == 401 || status == 403 ? " (--credentials FILE or CTSPLAT_CREDENTIALS)" : "");
    return d->started ? cts_multipart_finish(&d->multipart, err) : CTS_OK;
}

/* The sum of NumberOfSeriesRelatedInstances (0020,1209) over the series of an answer to QIDO-RS. */
static int count_instances(const json_t *answer, const char *series_uid)
{
    json_int_t n = 0;
    for (size_t i = 0; i < json_array_size(answer); i++) {
        const json_t *series = json_array_get(answer, i);
        const char *uid = cts_web_text(series, "0020000E");
        if (!series_uid || strcmp(uid, series_uid) == 0)
            n += cts_web_integer(series, "00201209");
    }
    return n > 0 && n <= CTS_INBOX_MAX_FILES ? (int)n : 0;
}

static CtsStatus judge_answer(const Web *web, CURLcode code, long status, const Answer *answer, CtsError *err)
{
    if (code)
        return cts_fail(err, CTS_ERR_READ, "the peer cannot be read from: %s",
                        *web->why ? web->why : curl_easy_strerror(code));
    if (status != 200 && status != 204)
        return cts_fail(err, CTS_ERR_READ, "the peer answers with status %ld%s", status,
                        status == 401 || status == 403 ? " (--credentials FILE or CTSPLAT_CREDENTIALS)" : "");
    return answer->too_long
               ? cts_fail(err, CTS_ERR_READ, "the peer answers with more than %zu bytes (narrow the query)",
                          sizeof answer->text)
               : CTS_OK;
}

CtsStatus cts_web_ask(const CtsPeer *peer, const CtsNet *net, const char *what, json_t **told, CtsError *err)
{
    Web web = {0};
    char url[CTS_WEB_QUERY + 1100];
    long status = 0;
    Answer *answer = calloc(1, sizeof *answer);
    *told = NULL;
    snprintf(url, sizeof url, "%s/%s", peer->url, what);
    CtsStatus st = answer ? web_open(&web, net, url, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st && !add_header(&web, "Accept: application/dicom+json"))
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (!st) {
        curl_easy_setopt(web.curl, CURLOPT_WRITEFUNCTION, keep_answer);
        curl_easy_setopt(web.curl, CURLOPT_WRITEDATA, answer);
        const CURLcode code = perform(&web, &status);
        st = judge_answer(&web, code, status, answer, err);
    }
    if (!st && status != 204 && !(*told = json_loadb(answer->text, answer->n, 0, NULL)))
        st = cts_fail(err, CTS_ERR_READ, "the peer answers a query with something else than JSON");
    free(answer);
    web_close(&web);
    return st;
}

/* How many objects there are, where the peer answers QIDO-RS. */
static void web_count(const CtsPeer *peer, const CtsNet *net, const CtsRequest *request)
{
    char what[300];
    json_t *told = NULL;
    snprintf(what, sizeof what, "studies/%s/series?includefield=00201209%s%s", request->study_uid,
             request->series_uid ? "&SeriesInstanceUID=" : "", request->series_uid ? request->series_uid : "");
    if (!cts_web_ask(peer, net, what, &told, NULL))
        *request->n_promised = count_instances(told, request->series_uid);
    json_decref(told);
}

static CtsStatus web_fetch(const CtsPeer *peer, const CtsNet *net, const CtsRequest *request, CtsError *err)
{
    Web web;
    char url[1300];
    long status = 0;
    Download *d = calloc(1, sizeof *d);
    CtsStatus st = d ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    /* UIDs are digits and dots: they were looked at. */
    snprintf(url, sizeof url, "%s/studies/%s%s%s", peer->url, request->study_uid, request->series_uid ? "/series/" : "",
             request->series_uid ? request->series_uid : "");
    if (st)
        return st;
    d->web = &web;
    d->inbox = request->inbox;
    if ((st = web_open(&web, net, url, err)))
        goto end;
    if (!add_header(&web, "Accept: multipart/related; type=\"application/dicom\"; transfer-syntax=*")) {
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        goto end;
    }
    curl_easy_setopt(web.curl, CURLOPT_WRITEFUNCTION, take_answer);
    curl_easy_setopt(web.curl, CURLOPT_WRITEDATA, d);
    const CURLcode code = perform(&web, &status);
    if (!(st = judge_download(d, code, status, err)))
        web_count(peer, net, request);
end:
    if (d->file)
        fclose(d->file);
    free(d->path);
    free(d);
    web_close(&web);
    return st;
}

const CtsWay cts_way_web = {.send = web_send, .fetch = web_fetch, .find = cts_web_find};
