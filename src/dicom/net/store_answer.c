#include "dicom/net/store_answer.h"

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ALREADY_THERE: 0111, and B00E of a widespread DICOMweb server (45070 in its conformance statement). */
typedef enum Kind { PERMANENT, PASSING, ALREADY_THERE } Kind;

/* The first row that holds is taken: single values come before ranges. */
static const struct {
    unsigned mask, status;
    Kind kind;
    const char *words, *remedy; /* NULL: the peer's log says more */
} statuses[] = {
    {0xffff, 0x0106, PERMANENT, " (invalid attribute value)", NULL},
    {0xffff, 0x0110, PERMANENT, " (processing failure)", NULL},
    {0xffff, 0x0111, ALREADY_THERE, " (duplicate SOP instance)", NULL},
    {0xffff, 0x0117, PERMANENT, " (invalid SOP instance)", NULL},
    {0xffff, 0x0120, PERMANENT, " (missing attribute)", NULL},
    {0xffff, 0x0122, PERMANENT, " (SOP class not supported)", "the peer must be set up to store its class"},
    {0xffff, 0x0124, PERMANENT, " (not authorized)", "the peer must allow it"},
    {0xffff, 0x0213, PASSING, " (resource limitation)", NULL},
    {0xffff, 0xa801, PERMANENT, " (move destination unknown: the peer must know the AE title that `aet` gives)", NULL},
    {0xffff, 0xb000, PERMANENT, " (coercion of data elements)", NULL},
    {0xffff, 0xb006, PERMANENT, " (elements discarded)", NULL},
    {0xffff, 0xb007, PERMANENT, " (data set does not match SOP class)", NULL},
    {0xffff, 0xb00e, ALREADY_THERE, " (already stored)", NULL},
    {0xffff, 0xc122, PERMANENT, " (transfer syntax not supported)", "`compress` none makes it uncompressed"},
    {0xff00, 0xa700, PASSING, " (out of resources)", NULL},
    {0xff00, 0xa900, PERMANENT, " (data set does not match SOP class)", NULL},
    {0xf000, 0xc000, PERMANENT, " (cannot understand)", NULL},
    {0, 0, PERMANENT, "", NULL},
};

static int status_row(unsigned status)
{
    int i = 0;
    while ((status & statuses[i].mask) != statuses[i].status)
        i++;
    return i;
}

const char *cts_status_words(unsigned status)
{
    return statuses[status_row(status)].words;
}

static const json_t *values_of(const json_t *object, const char *tag)
{
    return json_object_get(json_object_get(object, tag), "Value");
}

/* True where an item of the sequence names the instance by ReferencedSOPInstanceUID (0008,1155), or, unless `by_name`,
 * names none: a request stores one. *reason gets the item's reason. */
static bool read_items(const json_t *data_set, const char *sequence, const char *reason_tag, const char *sop_uid,
                       bool by_name, unsigned *reason)
{
    const json_t *const items = values_of(data_set, sequence);
    for (size_t i = 0; i < json_array_size(items); i++) {
        const json_t *const item = json_array_get(items, i);
        const char *const uid = json_string_value(json_array_get(values_of(item, "00081155"), 0));
        const size_t n = strlen(sop_uid);
        if (uid ? strncmp(uid, sop_uid, n) || uid[n + strspn(uid + n, " ")] : by_name)
            continue;
        const json_t *const value = json_array_get(values_of(item, reason_tag), 0);
        *reason =
            json_is_string(value) ? (unsigned)atoi(json_string_value(value)) : (unsigned)json_integer_value(value);
        return true;
    }
    return false;
}

CtsStoreAnswer cts_store_answer_read(const char *text, size_t n_bytes, const char *sop_uid)
{
    CtsStoreAnswer answer = {0};
    json_t *const whole = json_loadb(text, n_bytes, JSON_ALLOW_NUL, NULL);
    const size_t n = json_is_array(whole) ? json_array_size(whole) : json_is_object(whole);
    for (size_t i = 0; i < n; i++) {
        const json_t *const one = json_is_array(whole) ? json_array_get(whole, i) : whole;
        answer.stored |= read_items(one, "00081199", "00081196", sop_uid, true, &answer.warning);
        answer.failed |= read_items(one, "00081198", "00081197", sop_uid, false, &answer.failure) ||
                         read_items(one, "0008119A", "00081197", sop_uid, false, &answer.failure);
    }
    json_decref(whole);
    return answer;
}

void cts_outgoing_file_answered(CtsOutgoingFile *outgoing, const CtsNet *net, bool failed, unsigned status,
                                const char *how, CtsAttempt *result)
{
    const int row = status_row(status);
    const char *const slash = strrchr(outgoing->path, '/'), *const name = slash ? slash + 1 : outgoing->path;
    if (failed && statuses[row].kind != ALREADY_THERE) {
        result->again = statuses[row].kind == PASSING;
        snprintf(result->remedy, sizeof result->remedy, "%s",
                 result->again          ? ""
                 : statuses[row].remedy ? statuses[row].remedy
                                        : "the peer's log says more");
        cts_fail(&result->error, CTS_ERR_OUTPUT, "the peer %s %04X%s", how, status, statuses[row].words);
        return;
    }
    if (failed)
        cts_report_diagnostic(net->report, CTS_DIAGNOSTIC_PEER_WARNS,
                              "%s: the peer has an object of this UID already, and keeps it: %04X%s", name, status,
                              statuses[row].words);
    else if (status)
        cts_report_diagnostic(net->report, CTS_DIAGNOSTIC_PEER_WARNS, "%s: the peer stores it with warning %04X%s",
                              name, status, statuses[row].words);
    outgoing->sent = true;
    if (net->sent)
        net->sent(net->context, outgoing->path);
}
