#include "dicom/net/answers.h"

#include "base/mem.h"
#include "base/text.h"
#include "dicom/net/peer.h"
#include <ctype.h>
#include <jansson.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const CtsQueryKeyRow cts_key_rows[CTS_N_KEYS] = {
    [CTS_KEY_STUDY_DATE] = {0x00080020, "StudyDate", CTS_MATCH_DATE, false},
    [CTS_KEY_ACCESSION] = {0x00080050, "AccessionNumber", CTS_MATCH_TEXT, false},
    [CTS_KEY_PATIENT_ID] = {0x00100020, "PatientID", CTS_MATCH_TEXT, false},
    [CTS_KEY_STUDY_UID] = {0x0020000d, "StudyInstanceUID", CTS_MATCH_UID, false},
    [CTS_KEY_MODALITY] = {0x00080060, "Modality", CTS_MATCH_CODE, true},
    [CTS_KEY_DESCRIPTION] = {0x0008103e, "SeriesDescription", CTS_MATCH_TEXT, true},
    [CTS_KEY_SERIES_UID] = {0x0020000e, "SeriesInstanceUID", CTS_MATCH_UID, true},
    [CTS_KEY_N_OBJECTS] = {0x00201209, "NumberOfSeriesRelatedInstances", CTS_MATCH_TEXT, true},
};

/* A part of a text, without the blanks that pad it. */
typedef struct TextSpan {
    const char *at, *end;
} TextSpan;

static TextSpan span_of(const char *text, size_t n)
{
    TextSpan s = {text, text + n};
    while (s.at < s.end && *s.at == ' ')
        s.at++;
    while (s.at < s.end && s.end[-1] == ' ')
        s.end--;
    return s;
}

/* False for other bytes than UTF-8, for escapes of other character sets, and for combining marks (U+0300 to U+036F,
 * from byte CC 80), which may be a part of the letter before them in another notation. */
static bool is_comparable(TextSpan s)
{
    for (bool safe = true; s.at < s.end;) {
        const unsigned char c = (unsigned char)*s.at;
        s.at += cts_text_step(s.at, (size_t)(s.end - s.at), &safe);
        if (!safe || c == 0xcc || c == 0xcd)
            return false;
    }
    return true;
}

/* With * for any characters and ? for one (PS3.4 C.2.2.2.4). */
static bool matches_text(TextSpan key, TextSpan value, bool ignores_case)
{
    const CtsPattern pattern = {key.at, (size_t)(key.end - key.at), ignores_case, true};
    return cts_text_matches(&pattern, value.at, (size_t)(value.end - value.at));
}

/* A date of eight digits, of older devices with dots between them (PS3.5 6.2); -1 where s begins otherwise. */
static long take_date(TextSpan *s)
{
    long date = 0;
    int n = 0;
    const char *at = s->at;
    for (; at < s->end && n < 8 && (isdigit((unsigned char)*at) || *at == '.'); at++)
        if (*at != '.') {
            date = date * 10 + (*at - '0');
            n++;
        }
    if (n < 8)
        return -1;
    s->at = at;
    return date;
}

/* True also where either is no date: then nothing is contradicted. */
static bool matches_date(TextSpan key, TextSpan value)
{
    TextSpan rest = value;
    const long date = take_date(&rest);
    for (const char *c = key.at; c < key.end; c++)
        if (*c == '*' || *c == '?')
            return date < 0 || matches_text(key, value, false);
    long first = take_date(&key), last = first;
    if (key.at < key.end && *key.at == '-') {
        key.at++;
        last = key.at < key.end ? take_date(&key) : LONG_MAX;
        first = first < 0 ? 0 : first;
    }
    return date < 0 || first < 0 || last < 0 || key.at < key.end || (first <= date && date <= last);
}

static bool matches(CtsMatching matching, TextSpan key, TextSpan value)
{
    if (value.at == value.end || !is_comparable(value) || !is_comparable(key))
        return true;
    if (matching == CTS_MATCH_DATE)
        return matches_date(key, value);
    return matches_text(key, value, matching == CTS_MATCH_CODE);
}

bool cts_key_contradicts(CtsMatching matching, const char *key, const char *value)
{
    if (!key || !*key || !*value)
        return false;
    for (const char *at = value;; at++) {
        const size_t n = strcspn(at, "\\");
        if (matches(matching, span_of(key, strlen(key)), span_of(at, n)))
            return false;
        at += n;
        if (!*at)
            return true;
    }
}

void cts_answer_add(CtsAnswer *answer, CtsQueryKey key, const char *value)
{
    char *const text = answer->text[key];
    const size_t n = strlen(text);
    const TextSpan s = span_of(value, strlen(value));
    snprintf(text + n, sizeof answer->text[key] - n, "%s%.*s", n ? "\\" : "", (int)(s.end - s.at), s.at);
}

void cts_found_free(CtsFound *found)
{
    free(found->items);
    *found = (CtsFound){0};
}

CtsStatus cts_search_begin(CtsSearch *search, const CtsSeriesQuery *query, const CtsFoundSeries *study, CtsFound *found,
                           CtsError *err)
{
    search->study = study ? *study : (CtsFoundSeries){0};
    search->of_series = study;
    search->found = found;
    search->keys[CTS_KEY_STUDY_DATE] = query->study_date;
    search->keys[CTS_KEY_ACCESSION] = query->accession;
    search->keys[CTS_KEY_PATIENT_ID] = query->patient_id;
    search->keys[CTS_KEY_STUDY_UID] = study ? search->study.study_uid : query->study_uid;
    search->keys[CTS_KEY_MODALITY] = query->modality;
    search->keys[CTS_KEY_SERIES_UID] = query->series_uid;
    json_decref(search->seen);
    search->seen = json_object();
    return search->seen ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
}

const char *cts_search_key(const CtsSearch *search, CtsQueryKey key)
{
    if (cts_key_rows[key].of_series != search->of_series && !(search->of_series && key == CTS_KEY_STUDY_UID))
        return NULL;
    return search->keys[key] ? search->keys[key] : "";
}

size_t cts_search_count(const CtsSearch *search)
{
    return json_object_size(search->seen);
}

static int count_of(const char *text)
{
    const long n = strtol(text, NULL, 10);
    return n > 0 && n < INT_MAX ? (int)n : 0;
}

static void copy_text(char *to, size_t size, const char *from)
{
    snprintf(to, size, "%.*s", (int)size - 1, from);
}

static CtsStatus add(CtsSearch *search, const CtsAnswer *answer, const char *uid, CtsError *err)
{
    CtsFoundSeries one = search->study;
    if (search->of_series) {
        copy_text(one.series_uid, sizeof one.series_uid, uid);
        copy_text(one.modality, sizeof one.modality, answer->text[CTS_KEY_MODALITY]);
        copy_text(one.description, sizeof one.description, answer->text[CTS_KEY_DESCRIPTION]);
        one.n_objects = count_of(answer->text[CTS_KEY_N_OBJECTS]);
    } else {
        copy_text(one.study_uid, sizeof one.study_uid, uid);
        copy_text(one.study_date, sizeof one.study_date, answer->text[CTS_KEY_STUDY_DATE]);
    }
    const CtsStatus st = cts_grow(&search->found->items, search->found->n, err);
    if (!st)
        search->found->items[search->found->n++] = one;
    return st;
}

CtsStatus cts_search_take(CtsSearch *search, const CtsAnswer *answer, CtsError *err)
{
    CtsQueryKey key = 0;
    const char *uid = answer->text[search->of_series ? CTS_KEY_SERIES_UID : CTS_KEY_STUDY_UID];
    if (!cts_uid_is_valid(uid))
        return CTS_OK;
    const json_t *const known = json_object_get(search->seen, uid);
    const json_int_t index = known ? json_integer_value(known) : -1;
    while (key < CTS_N_KEYS && !cts_key_contradicts(cts_key_rows[key].matching, search->keys[key], answer->text[key]))
        key++;
    if (index >= 0) { /* in part from each of two stores: the larger count is the safe one */
        const int n = key < CTS_N_KEYS ? 0 : count_of(answer->text[CTS_KEY_N_OBJECTS]);
        CtsFoundSeries *const one = &search->found->items[index];
        one->n_objects = one->n_objects > n ? one->n_objects : n;
        return CTS_OK;
    }
    if (search->found->n >= CTS_MAX_FOUND || cts_search_count(search) >= CTS_MAX_FOUND)
        return cts_fail(err, CTS_ERR_READ, "the peer answers with more than %d %s, the limit (narrow the query)",
                        CTS_MAX_FOUND, search->of_series ? "series" : "studies");
    if (key < CTS_N_KEYS && !known)
        search->n_left_out[key]++;
    const CtsStatus st = key < CTS_N_KEYS ? CTS_OK : add(search, answer, uid, err);
    if (!st && json_object_set_new(search->seen, uid, json_integer(key < CTS_N_KEYS ? -1 : search->found->n - 1)))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    return st;
}

void cts_search_end(CtsSearch *search, CtsReport *report)
{
    for (int k = 0; k < CTS_N_KEYS; k++)
        if (search->n_left_out[k])
            cts_report_diagnostic(report, CTS_DIAGNOSTIC_ANSWERS_LEFT_OUT,
                                  "left out %d of the peer's answers, whose %s (%04X,%04X) contradicts the search key "
                                  "(the peer ignores the key)",
                                  search->n_left_out[k], cts_key_rows[k].name, cts_key_rows[k].tag >> 16,
                                  cts_key_rows[k].tag & 0xffff);
    if (search->warning)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_PEER_WARNS,
            "the peer warns (%s) that it may ignore search keys; answers that contradict one are left out",
            search->warning);
    json_decref(search->seen);
    search->seen = NULL;
}

CtsStatus cts_search_study(const CtsSeriesQuery *query, const CtsNet *net, CtsAsk ask, void *connection,
                           CtsFound *found, CtsError *err)
{
    CtsSearch search = {0};
    CtsFoundSeries study = {0};
    snprintf(study.study_uid, sizeof study.study_uid, "%s", query->study_uid);
    CtsStatus st = cts_search_begin(&search, query, &study, found, err);
    if (!st)
        st = ask(connection, &search, err);
    search.warning = NULL; /* of keys that peers must heed, or that are returned alone */
    cts_search_end(&search, net->report);
    return st;
}

CtsStatus cts_search_series(const CtsSeriesQuery *query, const CtsNet *net, CtsAsk ask, void *connection,
                            CtsFound *found, CtsError *err)
{
    CtsSearch search = {0};
    CtsFound studies = {0};
    CtsStatus st = cts_search_begin(&search, query, NULL, &studies, err);
    if (!st)
        st = ask(connection, &search, err);
    for (int i = 0; i < studies.n && !st && !cts_net_stopped(net); i++)
        if (!(st = cts_search_begin(&search, query, &studies.items[i], found, err)))
            st = ask(connection, &search, err);
    cts_search_end(&search, net->report);
    cts_found_free(&studies);
    return st;
}
