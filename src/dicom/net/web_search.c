#include "dicom/net/web.h"

#include <ctype.h>
#include <jansson.h>
#include <stdio.h>
#include <string.h>

/* A page of results. */
typedef struct Page {
    json_t *answers; /* an array of n; NULL: no result */
    size_t n;
    long status;
    bool cut;     /* the peer has more results than these (PS3.18 8.3.4.4) */
    bool warning; /* Warning 299, of another kind */
} Page;

static void read_warnings(const CtsWeb *web, Page *page)
{
    struct curl_header *warning;
    for (size_t i = 0; !curl_easy_header(web->curl, "Warning", i, CURLH_HEADER, -1, &warning); i++) {
        const bool cut = strcasestr(warning->value, "exceeded") || strcasestr(warning->value, "additional results");
        page->cut |= cut;
        page->warning |= !cut && strncmp(warning->value, "299", 3) == 0;
    }
}

/* GET of the peer's root and `what`. */
static CtsStatus get_page(const CtsWebSearcher *at, const char *what, Page *page, CtsError *err)
{
    CtsWeb web;
    *page = (Page){0};
    CtsStatus st = cts_web_open(&web, at->peer, at->net, what, cts_web_accepts_json, err);
    if (!st) {
        const CURLcode code = cts_web_perform(&web, &page->status);
        read_warnings(&web, page);
        if (code || (page->status != 200 && page->status != 204))
            st = cts_web_fail(&web, code, page->status, CTS_ERR_READ, err);
        else if (web.too_long)
            st = cts_fail(err, CTS_ERR_READ,
                          "the peer answers a query with more than %d MiB, the limit (narrow the query)",
                          CTS_MAX_WEB_ANSWER >> 20);
        else if (page->status == 200 && !(page->answers = json_loadb(web.answer, web.n_answer, JSON_ALLOW_NUL, NULL)))
            st = cts_fail(err, CTS_ERR_READ, "the peer answers a query with something else than JSON");
    }
    page->n = json_array_size(page->answers);
    cts_web_close(&web);
    return st;
}

/* From DICOM's JSON model (PS3.18 F.2). */
static void read_answer(const json_t *object, CtsAnswer *answer)
{
    memset(answer, 0, sizeof *answer);
    for (int k = 0; k < CTS_N_KEYS; k++) {
        char tag[9], number[32];
        snprintf(tag, sizeof tag, "%08X", (unsigned)cts_key_rows[k].tag);
        const json_t *const values = json_object_get(json_object_get(object, tag), "Value");
        for (size_t i = 0; i < json_array_size(values); i++) {
            const json_t *const value = json_array_get(values, i);
            snprintf(number, sizeof number, "%.0f", json_number_value(value));
            if (json_is_string(value) || json_is_number(value))
                cts_answer_add(answer, (CtsQueryKey)k, json_is_string(value) ? json_string_value(value) : number);
        }
    }
}

static CtsStatus take_page(CtsSearch *search, const json_t *answers, CtsError *err)
{
    CtsAnswer answer;
    CtsStatus st = CTS_OK;
    for (size_t i = 0; i < json_array_size(answers) && !st; i++) {
        read_answer(json_array_get(answers, i), &answer);
        st = cts_search_take(search, &answer, err);
    }
    return st;
}

/* Appends NAME=VALUE to the text, percent-encoded (RFC 3986, 2.3). */
static void add_key(char text[CTS_MAX_QUERY], const char *name, const char *value)
{
    size_t n = strlen(text);
    if (!value)
        return;
    n += (size_t)snprintf(text + n, CTS_MAX_QUERY - n, "%c%s=", strchr(text, '?') ? '&' : '?', name);
    for (const char *c = value; *c && n + 4 < CTS_MAX_QUERY; c++)
        n += (size_t)snprintf(text + n, CTS_MAX_QUERY - n,
                              isalnum((unsigned char)*c) || strchr("-._~*", *c) ? "%c" : "%%%02X", (unsigned char)*c);
}

static void write_query(const CtsSearch *search, char text[CTS_MAX_QUERY])
{
    if (search->of_series)
        snprintf(text, CTS_MAX_QUERY, "studies/%s/series", search->study.study_uid);
    else
        snprintf(text, CTS_MAX_QUERY, "studies");
    for (int k = 0; k < CTS_N_KEYS; k++) {
        char tag[9];
        const char *const key = cts_search_key(search, (CtsQueryKey)k);
        snprintf(tag, sizeof tag, "%08X", (unsigned)cts_key_rows[k].tag);
        if (key && *key && !(search->of_series && k == CTS_KEY_STUDY_UID))
            add_key(text, cts_key_rows[k].name, key);
        else if (key && (k == CTS_KEY_N_OBJECTS || k == CTS_KEY_DESCRIPTION)) /* not among those always returned */
            add_key(text, "includefield", tag);
    }
}

/* True once the one result that a unique key can have is there. */
static bool is_complete(const CtsSearch *search)
{
    const char *const unique = search->keys[search->of_series ? CTS_KEY_SERIES_UID : CTS_KEY_STUDY_UID];
    return unique && json_object_get(search->seen, unique);
}

/* Statuses with which peers refuse the parameter, rather than the request at this time. */
static bool refuses_offset(long status)
{
    return status >= 400 && status != 401 && status != 403 && status != 408 && status != 429 && status != 503;
}

/* Peers return as many results as they like, with a Warning or without one: the rest is asked for by offset, until a
 * page brings nothing new. */
CtsStatus cts_web_search(void *searcher, CtsSearch *search, CtsError *err)
{
    CtsWebSearcher *const at = searcher;
    char what[CTS_MAX_QUERY];
    Page page = {0};
    bool cut = false;
    int n_pages = 0; /* that brought something new */
    size_t n_asked = 0, n_known;
    CtsStatus st = CTS_OK;
    write_query(search, what);
    const size_t n_query = strlen(what);
    do {
        CtsError why = {0};
        if (n_pages)
            snprintf(what + n_query, sizeof what - n_query, "%coffset=%zu", strchr(what, '?') ? '&' : '?', n_asked);
        n_known = cts_search_count(search);
        if (!(st = get_page(at, what, &page, &why)))
            st = take_page(search, page.answers, &why);
        json_decref(page.answers);
        if (st && (n_pages != 1 || !refuses_offset(page.status)))
            return err ? *err = why, st : st;
        n_asked += page.n;
        cut |= page.cut && !n_pages;
        search->warning = page.warning ? "Warning 299" : search->warning;
        at->one_page |= n_pages == 1 && (st || page.n) && cts_search_count(search) == n_known;
        n_pages += cts_search_count(search) > n_known;
    } while (!st && cts_search_count(search) > n_known && !at->one_page && !is_complete(search));
    if (cut && n_pages < 2)
        return cts_fail(err, CTS_ERR_READ, "the peer has more results than it returns at once (narrow the query)");
    if (st)
        cts_report_diagnostic(
            at->net->report, CTS_DIAGNOSTIC_PEER_WARNS,
            "the peer refuses to be asked for more than its first %zu results (status %ld): there may "
            "be others (narrow the query)",
            n_asked, page.status);
    return CTS_OK;
}
