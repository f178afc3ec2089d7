/* Rules for the answers to a query, on plain data: they are checked against the keys (PS3.4 C.2.2.2), and counted once.
 */
#pragma once

#include "ctsplat/api.h"
#include "ctsplat/net.h"
#include <stdint.h>

CTS_C_BEGIN

typedef enum CtsMatching { CTS_MATCH_UID, CTS_MATCH_TEXT, CTS_MATCH_CODE, CTS_MATCH_DATE } CtsMatching;

/* The attributes of a query and of its answers, in ascending order of their tags within a level. */
typedef enum CtsQueryKey {
    CTS_KEY_STUDY_DATE,
    CTS_KEY_ACCESSION,
    CTS_KEY_PATIENT_ID,
    CTS_KEY_STUDY_UID,
    CTS_KEY_MODALITY,
    CTS_KEY_DESCRIPTION,
    CTS_KEY_SERIES_UID,
    CTS_KEY_N_OBJECTS,
    CTS_N_KEYS
} CtsQueryKey;

typedef struct CtsQueryKeyRow {
    uint32_t tag; /* group and element */
    const char *name;
    CtsMatching matching;
    bool of_series; /* asked for at the level of series; else of studies */
} CtsQueryKeyRow;
extern const CtsQueryKeyRow cts_key_rows[CTS_N_KEYS];

/* True where a value contradicts the key: never where there is no key, no value, or a text that cannot be compared (no
 * valid UTF-8). Several values have backslashes between them; one that matches suffices. */
bool cts_key_contradicts(CtsMatching matching, const char *key, const char *value);

/* An answer's values, as UTF-8, several with backslashes between them; "" where the peer does not return the attribute.
 * The size holds four values of 64 characters. */
typedef struct CtsAnswer {
    char text[CTS_N_KEYS][1024];
} CtsAnswer;
/* Adds a value without the blanks that pad it. */
void cts_answer_add(CtsAnswer *answer, CtsQueryKey key, const char *value);

struct json_t;

/* A query's search at one level after the other. Zero-initialise; end with cts_search_end(). */
typedef struct CtsSearch {
    const char *keys[CTS_N_KEYS]; /* NULL: none */
    bool of_series;
    CtsFoundSeries study; /* at the level of series: its study */
    CtsFound *found;      /* gets what is taken; at the level of studies its series_uid is "" */
    struct json_t *seen;  /* UIDs of this level's answers, each with its index in found, or -1 for one left out */
    int n_left_out[CTS_N_KEYS];
    const char *warning; /* how the peer warned; NULL: not */
} CtsSearch;

/* study NULL: the level of studies. */
CtsStatus cts_search_begin(CtsSearch *search, const CtsSeriesQuery *query, const CtsFoundSeries *study, CtsFound *found,
                           CtsError *err);
/* The key with which this level is searched, "" for an attribute that is only to be returned; NULL: not of this level.
 */
const char *cts_search_key(const CtsSearch *search, CtsQueryKey key);
/* Takes an answer, unless it contradicts a key or is known. CTS_ERR_READ past CTS_MAX_FOUND answers. */
CtsStatus cts_search_take(CtsSearch *search, const CtsAnswer *answer, CtsError *err);
/* Number of different answers of this level so far. */
size_t cts_search_count(const CtsSearch *search);
/* Reports what was left out, and the peer's warning. report may be NULL. */
void cts_search_end(CtsSearch *search, CtsReport *report);

/* Runs one search over a connection. */
typedef CtsStatus (*CtsAsk)(void *connection, CtsSearch *search, CtsError *err);
/* The series of the query's study_uid, with its series_uid and modality where they are given. */
CtsStatus cts_search_study(const CtsSeriesQuery *query, const CtsNet *net, CtsAsk ask, void *connection,
                           CtsFound *found, CtsError *err);
/* The series of a query: its studies, then the series of each. */
CtsStatus cts_search_series(const CtsSeriesQuery *query, const CtsNet *net, CtsAsk ask, void *connection,
                            CtsFound *found, CtsError *err);

CTS_C_END
