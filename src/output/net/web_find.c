#include "output/net/web.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const json_t *first_value(const json_t *object, const char *tag)
{
    return json_array_get(json_object_get(json_object_get(object, tag), "Value"), 0);
}

const char *cts_web_text(const json_t *object, const char *tag)
{
    const char *text = json_string_value(first_value(object, tag));
    return text ? text : "";
}

json_int_t cts_web_integer(const json_t *object, const char *tag)
{
    const json_t *value = first_value(object, tag);
    return json_is_string(value) ? atoi(json_string_value(value)) : json_integer_value(value);
}

/* NAME=VALUE behind what stands in the text, percent-encoded (RFC 3986, 2.3). */
static void add_key(char text[CTS_WEB_QUERY], const char *name, const char *value)
{
    size_t n = strlen(text);
    if (!value)
        return;
    n += (size_t)snprintf(text + n, CTS_WEB_QUERY - n, "%c%s=", strchr(text, '?') ? '&' : '?', name);
    for (const char *c = value; *c && n + 4 < CTS_WEB_QUERY; c++)
        n += (size_t)snprintf(text + n, CTS_WEB_QUERY - n,
                              isalnum((unsigned char)*c) || strchr("-._~*", *c) ? "%c" : "%%%02X", (unsigned char)*c);
}

static CtsStatus find_series(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *q, const json_t *study,
                             CtsFound *found, CtsError *err)
{
    const char *study_uid = cts_web_text(study, "0020000D");
    char what[CTS_WEB_QUERY];
    json_t *told = NULL;
    if (!cts_uid_is_valid(study_uid))
        return CTS_OK;
    snprintf(what, sizeof what, "studies/%s/series", study_uid);
    add_key(what, "SeriesInstanceUID", q->series_uid);
    add_key(what, "Modality", q->modality);
    add_key(what, "includefield", "00201209");
    add_key(what, "includefield", "0008103E");
    CtsStatus st = cts_web_ask(peer, net, what, &told, err);
    for (size_t i = 0; i < json_array_size(told) && !st; i++) {
        const json_t *answer = json_array_get(told, i);
        CtsFoundSeries series = {.n_objects = (int)cts_web_integer(answer, "00201209")};
        snprintf(series.study_uid, sizeof series.study_uid, "%s", study_uid);
        snprintf(series.study_date, sizeof series.study_date, "%s", cts_web_text(study, "00080020"));
        snprintf(series.series_uid, sizeof series.series_uid, "%s", cts_web_text(answer, "0020000E"));
        snprintf(series.modality, sizeof series.modality, "%s", cts_web_text(answer, "00080060"));
        snprintf(series.description, sizeof series.description, "%s", cts_web_text(answer, "0008103E"));
        st = cts_found_add(found, &series, err);
    }
    json_decref(told);
    return st;
}

CtsStatus cts_web_find(const CtsPeer *peer, const CtsNet *net, const CtsSeriesQuery *q, CtsFound *found, CtsError *err)
{
    char what[CTS_WEB_QUERY] = "studies";
    json_t *studies = NULL;
    add_key(what, "StudyInstanceUID", q->study_uid);
    add_key(what, "AccessionNumber", q->accession);
    add_key(what, "PatientID", q->patient_id);
    add_key(what, "StudyDate", q->study_date);
    CtsStatus st = cts_web_ask(peer, net, what, &studies, err);
    for (size_t i = 0; i < json_array_size(studies) && !st && !cts_net_stopped(net); i++)
        st = find_series(peer, net, q, json_array_get(studies, i), found, err);
    json_decref(studies);
    return st;
}
