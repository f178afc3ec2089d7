#include "dicom/net/peer.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

static CtsStatus fail_peer(const char *text, const char *why, CtsError *err)
{
    return cts_fail(err, CTS_ERR_USAGE, "%.200s: %s (AET@HOST:PORT, or a DICOMweb URL)", text, why);
}

/* An AE title (PS3.5 6.2): up to 16 characters without control characters, backslash or blanks around it. */
bool cts_aet_is_valid(const char *aet, size_t n)
{
    if (n < 1 || n > 16 || aet[0] == ' ' || aet[n - 1] == ' ')
        return false;
    for (size_t i = 0; i < n; i++)
        if (aet[i] < 0x20 || aet[i] > 0x7e || aet[i] == '\\')
            return false;
    return true;
}

bool cts_url_is_here(const char *url)
{
    const char *host = strstr(url, "://") + 3;
    const size_t n = strcspn(host, ":/");
    return (n == 9 && !strncasecmp(host, "localhost", n)) || !strncmp(host, "[::1]", 5) ||
           (!strncmp(host, "127.", 4) && strspn(host, "0123456789.") == n);
}

static CtsStatus parse_url(const char *text, CtsPeer *peer, CtsError *err)
{
    const char *host = strstr(text, "://") + 3;
    const size_t n_host = strcspn(host, "/?#");
    for (const char *c = text; *c; c++)
        if (*c <= 0x20 || *c > 0x7e)
            return fail_peer("URL", "has characters that must be percent-encoded", err);
    if (memchr(host, '@', n_host))
        return cts_fail(err, CTS_ERR_USAGE,
                        "the URL holds a user or password (put them into `credentials` FILE or CTSPLAT_CREDENTIALS)");
    if (n_host == 0 || host[n_host + strcspn(host + n_host, "?#")])
        return fail_peer(text, "is no root of a DICOMweb service", err);
    if (strlen(text) >= sizeof peer->url)
        return fail_peer(text, "is too long", err);
    peer->web = true;
    snprintf(peer->url, sizeof peer->url, "%s", text);
    for (size_t n = strlen(peer->url); n > 0 && peer->url[n - 1] == '/'; n--)
        peer->url[n - 1] = 0;
    return CTS_OK;
}

CtsStatus cts_peer_parse(const char *text, CtsPeer *peer, CtsError *err)
{
    const char *at = strrchr(text, '@'), *colon = strrchr(text, ':');
    char *end;
    *peer = (CtsPeer){0};
    if (strncasecmp(text, "http://", 7) == 0 || strncasecmp(text, "https://", 8) == 0)
        return parse_url(text, peer, err);
    if (!at || !colon || colon < at)
        return fail_peer(text, "is no peer", err);
    if (!cts_aet_is_valid(text, (size_t)(at - text)))
        return fail_peer(text, "its AE title is not 1 to 16 characters", err);
    const size_t n_host = (size_t)(colon - at - 1);
    if (n_host < 1 || n_host >= sizeof peer->host)
        return fail_peer(text, "has no host name", err);
    for (const char *c = at + 1; c < colon; c++)
        if (!isalnum((unsigned char)*c) && !strchr(".-_", *c))
            return fail_peer(
                text, strchr(":[]", *c) ? "DIMSE goes over IPv4 alone" : "its host has other characters than a name",
                err);
    const long port = strtol(colon + 1, &end, 10);
    if (!isdigit((unsigned char)colon[1]) || *end || port < 1 || port > 65535)
        return fail_peer(text, "its port is not within 1 to 65535", err);
    snprintf(peer->aet, sizeof peer->aet, "%.*s", (int)(at - text), text);
    snprintf(peer->host, sizeof peer->host, "%.*s", (int)n_host, at + 1);
    peer->port = (int)port;
    return CTS_OK;
}

bool cts_net_stopped(const CtsNet *net)
{
    return net->stop && *net->stop;
}
