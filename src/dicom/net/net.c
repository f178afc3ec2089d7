#include "dicom/net/peer.h"

#include "base/compare.h"
#include "base/mem.h"
#include "base/text.h"
#include "dicom/header/header_reader.h"
#include "dicom/header/utf8.h"
#include "dicom/net/answers.h"
#include "dicom/net/wire.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <time.h>

/* Replaces 0 and NULL by the defaults of the header. */
static CtsNet with_defaults(const CtsNet *net)
{
    CtsNet full = *net;
    full.own_aet = net->own_aet ? net->own_aet : "CTSPLAT";
    full.timeout_s = net->timeout_s > 0 ? net->timeout_s : 30;
    full.n_tries = net->n_tries > 0 ? net->n_tries : 4;
    return full;
}

/* Credentials must not be readable on the network. */
static CtsStatus check_credentials(const CtsPeer *peer, const CtsNet *net, CtsError *err)
{
    const char *variable = getenv("CTSPLAT_CREDENTIALS");
    const bool has = net->credentials || (variable && *variable);
    if (!has || net->insecure_http || !peer->web || strncasecmp(peer->url, "http://", 7) || cts_url_is_here(peer->url))
        return CTS_OK;
    return cts_fail(err, CTS_ERR_USAGE,
                    "%.200s: credentials do not go over plain http (give an https URL, or `insecure-http`)", peer->url);
}

CtsStatus cts_net_check(const CtsPeer *peer, const CtsNet *net, CtsError *err)
{
    if (net->own_aet && !cts_aet_is_valid(net->own_aet, strlen(net->own_aet)))
        return cts_fail(err, CTS_ERR_USAGE, "%.40s: is no AE title of 1 to 16 characters", net->own_aet);
    if (!net->tls_key != !net->tls_certificate)
        return cts_fail(err, CTS_ERR_USAGE, "a TLS key and its certificate must be given together");
    return peer ? check_credentials(peer, net, err) : CTS_OK;
}

/* Sleeps in intervals of 50 ms, to react at once to a request to stop. */
static void wait_ms(const CtsNet *net, int ms)
{
    for (; ms > 0 && !cts_net_stopped(net); ms -= 50)
        nanosleep(&(struct timespec){.tv_nsec = 50 * 1000000}, NULL);
}

/* Command to send a file by hand; dcmsend does not support TLS. */
static void by_hand(const CtsPeer *peer, const CtsNet *net, char *text, size_t size)
{
    if (peer->web || net->tls_ca || net->tls_key)
        snprintf(text, size, "run the same again with `force`");
    else
        snprintf(text, size, "dcmsend -aet %s -aec %s %s %d FILE", net->own_aet, peer->aet, peer->host, peer->port);
}

/* The failure of the first file that is not sent. */
static CtsStatus fail_unsent(const CtsPeer *peer, const CtsNet *net, const CtsOutgoingFile *file,
                             const CtsAttempt *result, CtsError *err)
{
    char how[500];
    while (file->sent)
        file++;
    by_hand(peer, net, how, sizeof how);
    return cts_fail(err, CTS_ERR_OUTPUT, "%s: is written, but not sent: %.400s (it stays; %s%s)", file->path,
                    result->error.text, *result->remedy ? "" : "to send it: ", *result->remedy ? result->remedy : how);
}

CtsStatus cts_net_send(const CtsPeer *peer, const CtsNet *given, const char *const *paths, int n_paths, int *n_sent,
                       CtsError *err)
{
    const CtsNet net = with_defaults(given);
    CtsNetAnswer last = {.result.again = true};
    CtsOutgoingFile *const files = calloc((size_t)n_paths + 1, sizeof *files);
    const CtsNetRequest request = {
        .task = CTS_NET_SEND, .peer = *peer, .net = net, .outgoing = files, .n_outgoing = n_paths};
    CtsStatus st = files ? cts_net_check(peer, given, err) : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    int sent = 0;
    for (int i = 0; !st && i < n_paths; i++) {
        files[i].path = paths[i];
        st = cts_dcm_ids(paths[i], &files[i].ids, err);
    }
    for (int k = 0; !st && sent < n_paths && k < net.n_tries && last.result.again; k++) {
        wait_ms(&net, k > 0 ? 500 << k : 0); /* 1, 2 and 4 s with the default of 4 tries */
        if (cts_net_stopped(&net))
            break;
        cts_program_run(&request, NULL, &last);
        sent = 0;
        for (int i = 0; i < n_paths; i++)
            sent += files[i].sent;
    }
    if (!st && n_sent)
        *n_sent = sent;
    if (!st && sent < n_paths)
        st = cts_net_stopped(&net)
                 ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted; %d of %d files sent, all kept", sent, n_paths)
                 : fail_unsent(peer, &net, files, &last.result, err);
    free(files);
    return st;
}

/* True where the object's PatientID contradicts the key. One in another character set than it says is not compared. */
static bool is_of_another_patient(const CtsSlice *slice, const char *key)
{
    const char *const stored = slice->identity[CTS_PATIENT_ID];
    char *const text = key ? cts_dcm_utf8(stored, slice->charset) : NULL;
    const bool converted = text && (strchr(stored, '?') || !strchr(text, '?'));
    const bool is_other = converted && cts_key_contradicts(CTS_MATCH_TEXT, key, text);
    free(text);
    return is_other;
}

/* Checks that one received object is a wanted one. Objects that are not CT are not rendered. */
static CtsStatus check_received(const CtsObject *object, const CtsSeriesQuery *wanted, CtsError *err)
{
    const CtsSlice *const slice = object->n_slices ? object->slices[0] : NULL;
    const char *of = NULL;
    if (slice && strcmp(slice->identity[CTS_STUDY_UID], wanted->study_uid))
        of = "study than it was asked for (StudyInstanceUID (0020,000D))";
    else if (slice && wanted->series_uid && strcmp(slice->series_uid, wanted->series_uid))
        of = "series than it was asked for (SeriesInstanceUID (0020,000E))";
    else if (slice && is_of_another_patient(slice, wanted->patient_id))
        of = "patient than it was asked for (PatientID (0010,0020))";
    return of ? cts_fail(err, CTS_ERR_READ, "the peer sent an object of another %s", of) : CTS_OK;
}

/* Checks all received objects, and counts the different ones. */
static CtsStatus check_fetch_folder(const CtsFetchFolder *folder, const CtsSeriesQuery *wanted, CtsError *err)
{
    const char **uids = NULL;
    CtsHeaderReader reader = {0};
    int n = 0, n_came = 0;
    CtsStatus st = cts_alloc_bytes((void **)&uids, (size_t)folder->n_files + 1, sizeof *uids, err);
    for (int i = 1; !st && i <= folder->n_files; i++) {
        char path[4200];
        CtsObject object = {0};
        snprintf(path, sizeof path, "%s/%06d.dcm", folder->folder, i);
        cts_slice_read_header(&(CtsFile){.path = path}, &reader, &object, NULL);
        st = check_received(&object, wanted, err);
        if (object.n_slices && *object.slices[0]->sop_uid)
            uids[n++] = object.slices[0]->sop_uid;
        else
            n_came += object.class_name != NULL;
        cts_object_free(&object);
    }
    if (!st)
        qsort(uids, (size_t)n, sizeof *uids, cts_compare_text);
    for (int i = 0; !st && i < n; i++)
        n_came += i == 0 || strcmp(uids[i], uids[i - 1]) != 0;
    if (!st && n_came < folder->n_promised)
        st = cts_fail(err, CTS_ERR_READ, "%d of %d objects came, by the peer's own count", n_came, folder->n_promised);
    cts_free_bytes(uids);
    cts_header_reader_free(&reader);
    return st;
}

static CtsStatus check_uids(const CtsSeriesQuery *q, CtsError *err)
{
    const char *const uids[] = {q->study_uid, q->series_uid};
    for (int i = 0; i < 2; i++)
        if (uids[i] && !cts_uid_is_valid(uids[i]))
            return cts_fail(err, CTS_ERR_USAGE, "%.80s: is no UID", uids[i]);
    return CTS_OK;
}

CtsStatus cts_net_fetch(const CtsPeer *peer, const CtsNet *given, const CtsSeriesQuery *wanted, CtsFetched *fetched,
                        CtsReport *report, CtsError *err)
{
    CtsNet net = with_defaults(given);
    const CtsSeriesQuery uids = {.study_uid = wanted->study_uid, .series_uid = wanted->series_uid};
    net.report = report;
    *fetched = (CtsFetched){.lock = -1};
    CtsStatus st = cts_net_check(peer, given, err);
    if (st)
        return st;
    if (!uids.study_uid)
        return cts_fail(err, CTS_ERR_USAGE,
                        "no study to fetch is named (give `study-uid`, and `series-uid` for one of "
                        "its series)");
    if ((st = check_uids(&uids, err)) || (st = cts_fetch_folder_make(fetched, err)))
        return st;
    const CtsNetRequest request = {
        .task = CTS_NET_FETCH, .peer = *peer, .net = net, .query = uids, .folder = fetched->folder};
    CtsNetAnswer last;
    if ((st = cts_program_run(&request, NULL, &last)) && err)
        *err = last.result.error;
    CtsFetchFolder folder = last.fetch_folder;
    folder.folder = fetched->folder;
    if (!st && (folder.n_files < 0 || folder.n_files > CTS_FETCH_MAX_FILES + 1))
        st = cts_fail(err, CTS_ERR_INTERNAL, "ctsplat-net gives an invalid answer");
    if (cts_net_stopped(&net))
        st = cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted");
    if (!st && folder.n_bytes == 0)
        st = cts_fail(err, CTS_ERR_READ, "the peer has no CT image of %s %s", uids.series_uid ? "series" : "study",
                      uids.series_uid ? uids.series_uid : uids.study_uid);
    if (!st)
        st = check_fetch_folder(&folder, wanted, err);
    if (st)
        cts_net_fetched_remove(fetched);
    return st;
}

/* A query value is sent unchanged: one value, within the length limit of all these attributes. */
static CtsStatus check_value(const char *value, CtsError *err)
{
    if (!value)
        return CTS_OK;
    const size_t n = strlen(value);
    bool good = n > 0 && n <= 64;
    for (size_t i = 0; i < n; i++)
        good &= (unsigned char)value[i] >= 0x20 && value[i] != 0x7f && value[i] != '\\';
    return good ? CTS_OK
                : cts_fail(err, CTS_ERR_USAGE, "%.80s: is no value to look for (1 to 64 characters, no backslash)",
                           value);
}

static CtsStatus check_query(const CtsSeriesQuery *q, CtsError *err)
{
    const char *const values[] = {q->accession, q->patient_id, q->study_date, q->modality};
    if (!q->study_uid && !q->accession && !q->patient_id && !q->study_date)
        return cts_fail(err, CTS_ERR_USAGE,
                        "no search key is named (give `study-uid`, `accession`, `patient-id` or `study-date`)");
    CtsStatus st = check_uids(q, err);
    for (int i = 0; i < 4 && !st; i++)
        st = check_value(values[i], err);
    return st;
}

/* Keeps the series of a list of modalities, for which a peer has no key. */
static void keep_modalities(CtsFound *found, const char *list)
{
    int n = 0;
    for (int i = 0; i < found->n; i++)
        if (!found->items[i].modality[0] || cts_text_lists(list, found->items[i].modality))
            found->items[n++] = found->items[i];
    found->n = n;
}

CtsStatus cts_net_find(const CtsPeer *peer, const CtsNet *given, const CtsSeriesQuery *query, CtsFound *found,
                       CtsError *err)
{
    const CtsNet net = with_defaults(given);
    CtsStatus st;
    *found = (CtsFound){0};
    if ((st = cts_net_check(peer, given, err)) || (st = check_query(query, err)))
        return st;
    CtsSeriesQuery asked = *query;
    if (query->modality && strchr(query->modality, ','))
        asked.modality = NULL;
    const CtsNetRequest request = {.task = CTS_NET_FIND, .peer = *peer, .net = net, .query = asked};
    CtsNetAnswer last;
    if ((st = cts_program_run(&request, found, &last)) && err)
        *err = last.result.error;
    else if (!st && asked.modality != query->modality)
        keep_modalities(found, query->modality);
    return cts_net_stopped(&net) ? cts_fail(err, CTS_ERR_INTERRUPTED, "interrupted") : st;
}
