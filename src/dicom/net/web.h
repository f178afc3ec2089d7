/* Requests of DICOMweb (PS3.18) with libcurl. */
#pragma once

#include "dicom/net/answers.h"
#include "dicom/net/peer.h"
#include <curl/curl.h>

/* Bytes of buffers. CTS_MAX_CREDENTIALS: signed tokens have 1 to 2 kB. CTS_MAX_WEB_ANSWER: of an upload's answer or a
 * search's. CTS_MAX_QUERY: four keys of up to 64 characters, three bytes each when encoded, are 768, and their names
 * less than 100. CTS_MAX_REDIRECTS: one for a slash at the end, one for the service's version, and as many again. */
enum { CTS_MAX_CREDENTIALS = 4096, CTS_MAX_WEB_ANSWER = 1 << 20, CTS_MAX_QUERY = 1200, CTS_MAX_REDIRECTS = 4 };

/* One request and its resources. */
typedef struct CtsWeb {
    CURL *curl;
    struct curl_slist *headers;
    curl_mime *body; /* of the data sent; NULL: none */
    const CtsNet *net;
    char credentials[CTS_MAX_CREDENTIALS];
    char why[CURL_ERROR_SIZE];
    char *answer; /* ignored where it is too long */
    size_t n_answer;
    bool too_long;
    bool redirected; /* to another host, or too often */
} CtsWeb;

extern const char cts_web_accepts_json[];

/* A request for `what` below the peer's root; cts_web_close() in any case. */
CtsStatus cts_web_open(CtsWeb *web, const CtsPeer *peer, const CtsNet *net, const char *what, const char *accept,
                       CtsError *err);
void cts_web_close(CtsWeb *web);
bool cts_web_add_header(CtsWeb *web, const char *line);
/* Sends the request, again where the peer redirects it within its own host. */
CURLcode cts_web_perform(CtsWeb *web, long *status);
const char *cts_web_content_type(const CtsWeb *web);
/* The reason why there is no valid answer. */
CtsStatus cts_web_fail(const CtsWeb *web, CURLcode code, long status, CtsStatus fault, CtsError *err);

/* The connection of a search (CtsAsk). */
typedef struct CtsWebSearcher {
    const CtsPeer *peer;
    const CtsNet *net;
    bool one_page; /* the peer is known to ignore or refuse an offset */
} CtsWebSearcher;

/* QIDO-RS (PS3.18 10.6). */
CtsStatus cts_web_search(void *searcher, CtsSearch *search, CtsError *err);
