/* DICOMweb with libcurl (PS3.18): STOW-RS to store, WADO-RS to fetch, QIDO-RS to query. */
#include "dicom/net/multipart.h"
#include "dicom/net/peer.h"

#include "base/load_plugin.h"
#include <ctype.h>
#include <curl/curl.h>
#include <errno.h>
#include <jansson.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* Bytes of buffers. MAX_CREDENTIALS: signed tokens have 1 to 2 kB. MAX_ANSWER: of an upload's answer or a search's.
 * MAX_QUERY: four keys of up to 64 characters, three bytes each when encoded, are 768, and their names less than 100.
 */
enum { MAX_CREDENTIALS = 4096, MAX_ANSWER = 1 << 20, MAX_QUERY = 1200 };

/* One request and its resources. */
typedef struct Web {
    CURL *curl;
    struct curl_slist *headers;
    curl_mime *body; /* of the data sent; NULL: none */
    const CtsNet *net;
    char credentials[MAX_CREDENTIALS];
    char why[CURL_ERROR_SIZE];
    char *answer; /* the answer, 0-terminated; ignored where it is too long */
    size_t n_answer;
    bool too_long;
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

static size_t keep_answer(char *bytes, size_t size, size_t n, void *context)
{
    Web *web = context;
    const size_t room = MAX_ANSWER - web->n_answer, part = size * n < room ? size * n : room;
    memcpy(web->answer + web->n_answer, bytes, part);
    web->n_answer += part;
    web->answer[web->n_answer] = 0;
    web->too_long |= part < size * n;
    return size * n;
}

static bool add_header(Web *web, const char *line)
{
    struct curl_slist *longer = curl_slist_append(web->headers, line);
    web->headers = longer ? longer : web->headers;
    return longer;
}

/* A request below the peer's root; web_close() in any case. */
static CtsStatus web_open(Web *web, const CtsPeer *peer, const CtsNet *net, const char *what, const char *accept,
                          CtsError *err)
{
    char url[MAX_QUERY + sizeof peer->url];
    *web = (Web){.net = net, .answer = malloc(MAX_ANSWER + 1)};
    CtsStatus st = read_credentials(net, web->credentials, err);
    if (st)
        return st;
    if (curl_global_init(CURL_GLOBAL_DEFAULT) || !(web->curl = curl_easy_init()))
        return cts_fail(err, CTS_ERR_INTERNAL, "libcurl cannot be started");
    if (!web->answer || !add_header(web, accept))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    CURL *c = web->curl;
    web->answer[0] = 0;
    snprintf(url, sizeof url, "%s/%s", peer->url, what);
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
    curl_easy_setopt(c, CURLOPT_WRITEFUNCTION, keep_answer);
    curl_easy_setopt(c, CURLOPT_WRITEDATA, web);
    if (cts_url_is_here(peer->url)) /* unencrypted traffic to this machine must not go through a proxy either */
        curl_easy_setopt(c, CURLOPT_PROXY, "");
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
    curl_mime_free(web->body);
    if (web->curl)
        curl_easy_cleanup(web->curl);
    curl_slist_free_all(web->headers);
    free(web->answer);
    explicit_bzero(web->credentials, sizeof web->credentials);
    memset(web, 0, sizeof *web);
}

/* A closed connection must not end the program: curl leaves SIGPIPE to its caller. */
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

static const char accept_json[] = "Accept: application/dicom+json";

static const char *content_type(const Web *web)
{
    const char *type = NULL;
    curl_easy_getinfo(web->curl, CURLINFO_CONTENT_TYPE, &type);
    return type ? type : "";
}

/* The reason why there is no valid answer. */
static CtsStatus fail(const Web *web, CURLcode code, long status, CtsStatus fault, CtsError *err)
{
    if (code)
        return cts_fail(err, fault, "the connection failed: %s", *web->why ? web->why : curl_easy_strerror(code));
    return cts_fail(err, fault, "the peer answers with status %ld%s", status,
                    status == 401 || status == 403 ? " (`credentials` FILE or CTSPLAT_CREDENTIALS)" : "");
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

/* ReferencedSOPSequence (0008,1199) lists stored objects, FailedSOPSequence (0008,1198) rejected ones. */
static bool confirmed_by_json(const Web *web, const char *sop_uid)
{
    json_t *answer = json_loadb(web->answer, web->n_answer, 0, NULL);
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

/* The native DICOM model (PS3.19 A.1): a UID belongs to the last sequence that began before it. */
static bool confirmed_by_xml(const Web *web, const char *sop_uid)
{
    char value[80];
    bool stored = false, failed = false;
    snprintf(value, sizeof value, ">%s<", sop_uid);
    for (const char *at = web->answer; (at = strstr(at, value)); at++) {
        const char *referenced = NULL, *other = NULL;
        for (const char *tag = web->answer; (tag = strstr(tag, "\"0008119")) && tag < at; tag++)
            *(tag[8] == '9' ? &referenced : &other) = tag;
        stored |= referenced && (!other || other < referenced);
        failed |= other && (!referenced || referenced < other);
    }
    return stored && !failed;
}

/* A status of success does not suffice: some peers, and login pages, return it for objects that are not stored. */
static bool is_confirmed(const Web *web, const char *sop_uid)
{
    return !web->too_long &&
           (strcasestr(content_type(web), "xml") ? confirmed_by_xml(web, sop_uid) : confirmed_by_json(web, sop_uid));
}

static bool passes(CURLcode code)
{
    return code != CURLE_PEER_FAILED_VERIFICATION && code != CURLE_SSL_CERTPROBLEM &&
           code != CURLE_SSL_CACERT_BADFILE && code != CURLE_URL_MALFORMAT && code != CURLE_UNSUPPORTED_PROTOCOL &&
           code != CURLE_ABORTED_BY_CALLBACK && code != CURLE_READ_ERROR;
}

static void check_upload(const Web *web, CURLcode code, long status, CtsOutgoingFile *outgoing, CtsAttempt *result)
{
    if (code || (status != 200 && status != 201)) {
        result->again = code ? passes(code) : status >= 500 || status == 429 || status == 408;
        fail(web, code, status, CTS_ERR_OUTPUT, &result->error);
    } else if (is_confirmed(web, outgoing->ids.sop_uid)) {
        cts_outgoing_file_is_sent(outgoing, web->net);
    } else {
        cts_fail(&result->error, CTS_ERR_OUTPUT,
                 "the peer does not say that it stored it, though it answers with status %ld", status);
    }
}

/* The body of a STOW-RS request: one part, without the file's name. */
static CtsStatus set_body(Web *web, const char *path, CtsError *err)
{
    curl_mimepart *const part = (web->body = curl_mime_init(web->curl)) ? curl_mime_addpart(web->body) : NULL;
    if (!part || curl_mime_type(part, "application/dicom") ||
        !add_header(web, "Content-Type: multipart/related; type=\"application/dicom\"") || !add_header(web, "Expect:"))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    if (curl_mime_filedata(part, path) || curl_mime_filename(part, NULL))
        return cts_fail(err, CTS_ERR_READ, "it cannot be read");
    curl_easy_setopt(web->curl, CURLOPT_MIMEPOST, web->body);
    return CTS_OK;
}

static void store(const CtsPeer *peer, const CtsNet *net, CtsOutgoingFile *outgoing, CtsAttempt *result)
{
    Web web;
    long status;
    if (!web_open(&web, peer, net, "studies", accept_json, &result->error) &&
        !set_body(&web, outgoing->path, &result->error)) {
        const CURLcode code = perform(&web, &status);
        check_upload(&web, code, status, outgoing, result);
    }
    web_close(&web);
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
    Web *web;
    CtsFetchFolder *fetch_folder;
    CtsMultipart multipart;
    bool started; /* the multipart body */
    char *path;   /* of the file being written */
    FILE *file;
    uint64_t n_bytes;
    CtsStatus status;
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
        d->status = cts_multipart_start(&d->multipart, content_type(d->web), &sink, &d->error);
    }
    if (!d->status)
        d->status = cts_multipart_feed(&d->multipart, bytes, size * n, &d->error);
    return d->status ? 0 : size * n;
}

static CtsStatus check_download(const Download *d, CURLcode code, long status, CtsError *err)
{
    if (d->status) {
        *err = d->error;
        return d->status;
    }
    if (!code && (status == 404 || status == 204))
        return cts_fail(err, CTS_ERR_READ, "the peer does not have it (status %ld)", status);
    if (code || status != 200)
        return fail(d->web, code, status, CTS_ERR_READ, err);
    return d->started ? cts_multipart_finish(&d->multipart, err) : CTS_OK;
}

/* The first value of an attribute in DICOM's JSON model (PS3.18 F.2), as text ("" if missing) or as a number. */
static const json_t *first_value(const json_t *object, const char *tag)
{
    return json_array_get(json_object_get(json_object_get(object, tag), "Value"), 0);
}

static const char *text_of_tag(const json_t *object, const char *tag)
{
    const char *text = json_string_value(first_value(object, tag));
    return text ? text : "";
}

static json_int_t integer_of(const json_t *object, const char *tag)
{
    const json_t *value = first_value(object, tag);
    return json_is_string(value) ? atoi(json_string_value(value)) : json_integer_value(value);
}

/* The sum of NumberOfSeriesRelatedInstances (0020,1209) over the series of an answer to QIDO-RS. */
static int count_instances(const json_t *answer, const char *series_uid)
{
    json_int_t n = 0;
    for (size_t i = 0; i < json_array_size(answer); i++) {
        const json_t *series = json_array_get(answer, i);
        const char *uid = text_of_tag(series, "0020000E");
        if (!series_uid || strcmp(uid, series_uid) == 0)
            n += integer_of(series, "00201209");
    }
    return n > 0 && n <= CTS_FETCH_MAX_FILES ? (int)n : 0;
}

/* True for a truncated result list, which the peer marks (PS3.18 8.3.4.4). */
static bool is_cut(const Web *web)
{
    struct curl_header *warning;
    return !curl_easy_header(web->curl, "Warning", 0, CURLH_HEADER, -1, &warning) &&
           strcasestr(warning->value, "exceeded");
}

static CtsStatus check_answer(const Web *web, CURLcode code, long status, CtsError *err)
{
    if (code || (status != 200 && status != 204))
        return fail(web, code, status, CTS_ERR_READ, err);
    return web->too_long || is_cut(web)
               ? cts_fail(err, CTS_ERR_READ, "the peer has more results than it returns at once (narrow the query)")
               : CTS_OK;
}

/* The answer to GET of the peer's root and `what`, a new reference; NULL when it has no result (204). */
static CtsStatus get_json(const CtsPeer *peer, const CtsNet *net, const char *what, json_t **answered, CtsError *err)
{
    Web web;
    long status = 0;
    *answered = NULL;
    CtsStatus st = web_open(&web, peer, net, what, accept_json, err);
    if (!st) {
        const CURLcode code = perform(&web, &status);
        st = check_answer(&web, code, status, err);
    }
    if (!st && status != 204 && !(*answered = json_loadb(web.answer, web.n_answer, 0, NULL)))
        st = cts_fail(err, CTS_ERR_READ, "the peer answers a query with something else than JSON");
    web_close(&web);
    return st;
}

/* Counts the objects, where the peer supports QIDO-RS. */
static void web_count(const CtsPeer *peer, const CtsNet *net, const CtsRequest *request)
{
    char what[300];
    json_t *answered = NULL;
    snprintf(what, sizeof what, "studies/%s/series?includefield=00201209%s%s", request->study_uid,
             request->series_uid ? "&SeriesInstanceUID=" : "", request->series_uid ? request->series_uid : "");
    if (!get_json(peer, net, what, &answered, NULL))
        *request->n_promised = count_instances(answered, request->series_uid);
    json_decref(answered);
}

static CtsStatus web_fetch(const CtsPeer *peer, const CtsNet *net, const CtsRequest *request, CtsError *err)
{
    Web web;
    Download d = {.web = &web, .fetch_folder = request->fetch_folder};
    char what[200];
    long status;
    /* UIDs need no encoding: they have been checked to be digits and dots. */
    snprintf(what, sizeof what, "studies/%s%s%s", request->study_uid, request->series_uid ? "/series/" : "",
             request->series_uid ? request->series_uid : "");
    CtsStatus st = web_open(&web, peer, net, what,
                            "Accept: multipart/related; type=\"application/dicom\"; transfer-syntax=*", err);
    if (!st) {
        curl_easy_setopt(web.curl, CURLOPT_WRITEFUNCTION, take_answer);
        curl_easy_setopt(web.curl, CURLOPT_WRITEDATA, &d);
        const CURLcode code = perform(&web, &status);
        st = check_download(&d, code, status, err);
    }
    if (!st)
        web_count(peer, net, request);
    if (d.file)
        fclose(d.file);
    free(d.path);
    web_close(&web);
    return st;
}

/* Appends NAME=VALUE to the text, percent-encoded (RFC 3986, 2.3). */
static void add_key(char text[MAX_QUERY], const char *name, const char *value)
{
    size_t n = strlen(text);
    if (!value)
        return;
    n += (size_t)snprintf(text + n, MAX_QUERY - n, "%c%s=", strchr(text, '?') ? '&' : '?', name);
    for (const char *c = value; *c && n + 4 < MAX_QUERY; c++)
        n += (size_t)snprintf(text + n, MAX_QUERY - n,
                              isalnum((unsigned char)*c) || strchr("-._~*", *c) ? "%c" : "%%%02X", (unsigned char)*c);
}

static CtsStatus find_series(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *q, const json_t *study,
                             CtsFound *found, CtsError *err)
{
    const char *study_uid = text_of_tag(study, "0020000D");
    char what[MAX_QUERY];
    json_t *answered = NULL;
    if (!cts_uid_is_valid(study_uid))
        return CTS_OK;
    snprintf(what, sizeof what, "studies/%s/series", study_uid);
    add_key(what, "SeriesInstanceUID", q->series_uid);
    add_key(what, "Modality", q->modality);
    add_key(what, "includefield", "00201209");
    add_key(what, "includefield", "0008103E");
    CtsStatus st = get_json(peer, net, what, &answered, err);
    for (size_t i = 0; i < json_array_size(answered) && !st; i++) {
        const json_t *answer = json_array_get(answered, i);
        CtsFoundSeries series = {.n_objects = (int)integer_of(answer, "00201209")};
        snprintf(series.study_uid, sizeof series.study_uid, "%s", study_uid);
        snprintf(series.study_date, sizeof series.study_date, "%s", text_of_tag(study, "00080020"));
        snprintf(series.series_uid, sizeof series.series_uid, "%s", text_of_tag(answer, "0020000E"));
        snprintf(series.modality, sizeof series.modality, "%s", text_of_tag(answer, "00080060"));
        snprintf(series.description, sizeof series.description, "%s", text_of_tag(answer, "0008103E"));
        st = cts_found_add(found, &series, err);
    }
    json_decref(answered);
    return st;
}

/* QIDO-RS: the series that a query names (PS3.18 10.6). */
static CtsStatus web_find(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *q, CtsFound *found,
                          CtsError *err)
{
    char what[MAX_QUERY] = "studies";
    json_t *studies = NULL;
    add_key(what, "StudyInstanceUID", q->study_uid);
    add_key(what, "AccessionNumber", q->accession);
    add_key(what, "PatientID", q->patient_id);
    add_key(what, "StudyDate", q->study_date);
    CtsStatus st = get_json(peer, net, what, &studies, err);
    for (size_t i = 0; i < json_array_size(studies) && !st && !cts_net_stopped(net); i++)
        st = find_series(peer, net, q, json_array_get(studies, i), found, err);
    json_decref(studies);
    return st;
}

const CtsProtocol cts_protocol_web = {.send = web_send, .fetch = web_fetch, .find = web_find};

CTS_PLUGIN_TABLE(CtsNetPlugin, cts_net_plugin, &cts_protocol_dimse, &cts_protocol_web)
