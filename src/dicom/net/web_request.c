#include "dicom/net/web.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

/* From a file or the environment, never from the command line, where other users see it. */
static CtsStatus read_credentials(const CtsNet *net, char text[CTS_MAX_CREDENTIALS], CtsError *err)
{
    const char *variable = getenv("CTSPLAT_CREDENTIALS");
    text[0] = 0;
    if (net->credentials) {
        FILE *file = fopen(net->credentials, "re");
        if (!file)
            return cts_fail(err, CTS_ERR_READ, "%s: cannot be read: %s", net->credentials, strerror(errno));
        const char *line = fgets(text, CTS_MAX_CREDENTIALS, file);
        fclose(file);
        if (!line)
            return cts_fail(err, CTS_ERR_READ, "%s: is empty (user:password, or Bearer and a token)", net->credentials);
    } else if (variable)
        snprintf(text, CTS_MAX_CREDENTIALS, "%s", variable);
    text[strcspn(text, "\r\n")] = 0;
    if (*text && strncasecmp(text, "Bearer ", 7) != 0 && !strchr(text, ':'))
        return cts_fail(err, CTS_ERR_USAGE, "the credentials are neither user:password nor Bearer and a token");
    return CTS_OK;
}

static int stop_transfer(void *context, curl_off_t a, curl_off_t b, curl_off_t c, curl_off_t d)
{
    const CtsWeb *web = context;
    (void)a, (void)b, (void)c, (void)d;
    return cts_net_stopped(web->net);
}

static size_t keep_answer(char *bytes, size_t size, size_t n, void *context)
{
    CtsWeb *web = context;
    const size_t room = CTS_MAX_WEB_ANSWER - web->n_answer, part = size * n < room ? size * n : room;
    memcpy(web->answer + web->n_answer, bytes, part);
    web->n_answer += part;
    web->too_long |= part < size * n;
    return size * n;
}

bool cts_web_add_header(CtsWeb *web, const char *line)
{
    struct curl_slist *longer = curl_slist_append(web->headers, line);
    web->headers = longer ? longer : web->headers;
    return longer;
}

CtsStatus cts_web_open(CtsWeb *web, const CtsPeer *peer, const CtsNet *net, const char *what, const char *accept,
                       CtsError *err)
{
    char url[CTS_MAX_QUERY + sizeof peer->url];
    *web = (CtsWeb){.net = net, .answer = malloc(CTS_MAX_WEB_ANSWER)};
    CtsStatus st = read_credentials(net, web->credentials, err);
    if (st)
        return st;
    if (curl_global_init(CURL_GLOBAL_DEFAULT) || !(web->curl = curl_easy_init()))
        return cts_fail(err, CTS_ERR_INTERNAL, "libcurl cannot be started");
    if (!web->answer || !cts_web_add_header(web, accept))
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    CURL *c = web->curl;
    snprintf(url, sizeof url, "%s/%s", peer->url, what);
    curl_easy_setopt(c, CURLOPT_URL, url);
    curl_easy_setopt(c, CURLOPT_PROTOCOLS_STR, "http,https");
    curl_easy_setopt(c, CURLOPT_NOSIGNAL, 1L);
    curl_easy_setopt(c, CURLOPT_ERRORBUFFER, web->why);
    curl_easy_setopt(c, CURLOPT_CONNECTTIMEOUT, (long)net->timeout_s);
    curl_easy_setopt(c, CURLOPT_LOW_SPEED_LIMIT, 1L); /* silence for so long ends a transfer */
    curl_easy_setopt(c, CURLOPT_LOW_SPEED_TIME, (long)net->timeout_s);
    curl_easy_setopt(c, CURLOPT_USERAGENT, "ctsplat/" CTS_VERSION);
    /* Curl decodes an answer that is compressed all the same. */
    curl_easy_setopt(c, CURLOPT_ACCEPT_ENCODING, "identity");
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

void cts_web_close(CtsWeb *web)
{
    curl_mime_free(web->body);
    if (web->curl)
        curl_easy_cleanup(web->curl);
    curl_slist_free_all(web->headers);
    free(web->answer);
    explicit_bzero(web->credentials, sizeof web->credentials);
    memset(web, 0, sizeof *web);
}

/* The URL `to` without a user, to be freed with curl_free(), where it has the scheme, host and port of `from`: only
 * there go requests and credentials. NULL elsewhere. */
static char *next_url(const char *from, const char *to)
{
    static const CURLUPart parts[] = {CURLUPART_SCHEME, CURLUPART_HOST, CURLUPART_PORT};
    CURLU *const a = curl_url(), *const b = curl_url();
    char *url = NULL;
    bool same = a && b && from && !curl_url_set(a, CURLUPART_URL, from, 0) && !curl_url_set(b, CURLUPART_URL, to, 0);
    for (size_t i = 0; same && i < sizeof parts / sizeof *parts; i++) {
        char *one = NULL, *two = NULL;
        same = !curl_url_get(a, parts[i], &one, CURLU_DEFAULT_PORT) &&
               !curl_url_get(b, parts[i], &two, CURLU_DEFAULT_PORT) && strcasecmp(one, two) == 0;
        curl_free(one);
        curl_free(two);
    }
    if (same && !curl_url_set(b, CURLUPART_USER, NULL, 0) && !curl_url_set(b, CURLUPART_PASSWORD, NULL, 0))
        curl_url_get(b, CURLUPART_URL, &url, 0);
    curl_url_cleanup(a);
    curl_url_cleanup(b);
    return url;
}

/* The address to which the peer redirects the request, without change of its method: a 303 after POST would ask for
 * another resource. NULL: none. */
static const char *redirection(const CtsWeb *web, CURLcode code, long status)
{
    const char *to = NULL;
    if (!code && (status == 301 || status == 302 || status == 307 || status == 308 || (status == 303 && !web->body)))
        curl_easy_getinfo(web->curl, CURLINFO_REDIRECT_URL, &to);
    return to;
}

CURLcode cts_web_perform(CtsWeb *web, long *status)
{
    curl_easy_setopt(web->curl, CURLOPT_HTTPHEADER, web->headers);
    for (int i = 0; i <= CTS_MAX_REDIRECTS; i++) {
        const char *from = NULL;
        web->n_answer = 0;
        web->too_long = false;
        const CURLcode code = curl_easy_perform(web->curl);
        *status = 0;
        curl_easy_getinfo(web->curl, CURLINFO_RESPONSE_CODE, status);
        const char *const to = redirection(web, code, *status);
        if (!to)
            return code;
        curl_easy_getinfo(web->curl, CURLINFO_EFFECTIVE_URL, &from);
        char *const next = next_url(from, to);
        const bool follows = next && !curl_easy_setopt(web->curl, CURLOPT_URL, next);
        curl_free(next);
        if (!follows)
            break;
    }
    web->redirected = true;
    return CURLE_OK;
}

const char cts_web_accepts_json[] = "Accept: application/dicom+json";

const char *cts_web_content_type(const CtsWeb *web)
{
    const char *type = NULL;
    curl_easy_getinfo(web->curl, CURLINFO_CONTENT_TYPE, &type);
    return type ? type : "";
}

CtsStatus cts_web_fail(const CtsWeb *web, CURLcode code, long status, CtsStatus fault, CtsError *err)
{
    if (code)
        return cts_fail(err, fault, "the connection failed: %s", *web->why ? web->why : curl_easy_strerror(code));
    if (web->redirected)
        return cts_fail(
            err, fault,
            "the peer redirects to another host, port or scheme, or more than %d times, status %ld (give the "
            "URL of the service itself)",
            CTS_MAX_REDIRECTS, status);
    return cts_fail(err, fault, "the peer answers with status %ld%s", status,
                    status == 401 || status == 403 ? " (`credentials` FILE or CTSPLAT_CREDENTIALS)" : "");
}
