/* Access control: the token, and a Host header that protects against DNS rebinding. */
#include "app/serve/server.h"

#include <arpa/inet.h>
#include <ctype.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/random.h>

/* MADE_BYTES: 128 random bits cannot be guessed. MIN_CHARACTERS: of a token from a file; random hex digits are 64 bits.
 */
enum { MADE_BYTES = 16, MIN_CHARACTERS = 16 };

static CtsStatus make_token(CtsServer *server, CtsError *err)
{
    unsigned char random[MADE_BYTES];
    if (getrandom(random, sizeof random, 0) != sizeof random)
        return cts_fail(err, CTS_ERR_READ, "no random numbers are available for a token (give `token-file`)");
    for (int i = 0; i < MADE_BYTES; i++)
        sprintf(server->token + 2 * i, "%02x", random[i]);
    return CTS_OK;
}

CtsStatus cts_access_token(CtsServer *server, CtsError *err)
{
    const char *path = server->options->token_file;
    if (server->local_socket)
        return CTS_OK;
    if (!path)
        return make_token(server, err);
    FILE *file = fopen(path, "re");
    if (!file)
        return cts_fail(err, CTS_ERR_READ, "%s: cannot be opened: %s", path, strerror(errno));
    size_t n = fread(server->token, 1, sizeof server->token - 1, file);
    fclose(file);
    while (n && isspace((unsigned char)server->token[n - 1]))
        n--;
    server->token[n] = 0;
    for (size_t i = 0; i < n; i++)
        if (!isgraph((unsigned char)server->token[i]) || strchr("\";,\\&#%+", server->token[i]))
            return cts_fail(err, CTS_ERR_READ, "%s: a token is one word of letters, digits and -._~", path);
    return n >= MIN_CHARACTERS
               ? CTS_OK
               : cts_fail(err, CTS_ERR_READ, "%s: a token has %d characters or more", path, MIN_CHARACTERS);
}

/* Compares in constant time for a length. */
static bool is_token(const CtsServer *server, const char *given)
{
    const size_t n = strlen(server->token);
    unsigned char differs = 0;
    if (!given || strlen(given) != n)
        return false;
    for (size_t i = 0; i < n; i++)
        differs |= (unsigned char)(server->token[i] ^ given[i]);
    return !differs;
}

static bool has_token(const CtsServer *server, const CtsHttpRequest *request)
{
    static const char scheme[] = "Bearer ";
    const char *const authorization = cts_http_header(request, "Authorization");
    if (authorization && !strncasecmp(authorization, scheme, sizeof scheme - 1))
        return is_token(server, authorization + sizeof scheme - 1);
    return is_token(server, request->cookie);
}

/* The address that was printed at the start leads to the page, and does not stay in the browser's history. */
static bool brings_token(const CtsServer *server, const CtsHttpRequest *request, CtsHttpAnswer *answer)
{
    CtsQuery query = {.n = 0};
    char cookie[sizeof server->token + 80];
    if (strcmp(request->path, "/"))
        return false;
    cts_http_query(request, &query);
    if (!is_token(server, cts_query_value(&query, "token")))
        return false;
    snprintf(cookie, sizeof cookie, "ctsplat=%s; HttpOnly; SameSite=Strict; Path=/%s", server->token,
             server->tls ? "; Secure" : "");
    cts_answer_text(answer, server, 303, "the page");
    cts_answer_header(answer, "Location", "./");
    cts_answer_header(answer, "Set-Cookie", cookie);
    return true;
}

static bool host_is_ours(const CtsServer *server, const char *given)
{
    char host[256];
    unsigned char address[sizeof(struct in6_addr)];
    const bool bracketed = given[0] == '[';
    const size_t n = strcspn(given + bracketed, bracketed ? "]" : ":");
    const char *after = given + bracketed + n + bracketed;
    if (n == 0 || n >= sizeof host || (*after && *after != ':'))
        return false;
    snprintf(host, sizeof host, "%.*s", (int)n, given + bracketed);
    bool ours = inet_pton(AF_INET, host, address) == 1 || inet_pton(AF_INET6, host, address) == 1 ||
                !strcasecmp(host, "localhost");
    for (int i = 0; i < server->options->hosts.n; i++)
        ours |= !strcasecmp(host, server->options->hosts.items[i]);
    return ours;
}

static void answer_preflight(const CtsServer *server, CtsHttpAnswer *answer)
{
    cts_answer_text(answer, server, 200, "");
    cts_answer_header(answer, "Access-Control-Allow-Methods", "GET, OPTIONS");
    cts_answer_header(answer, "Access-Control-Allow-Headers", "Authorization");
}

bool cts_access_check(const CtsServer *server, const CtsHttpRequest *request, CtsHttpAnswer *answer)
{
    const char *host = cts_http_header(request, "Host"), *method = request->method;
    if (request->has_body)
        cts_answer_text(answer, server, 413, "a request with a body: only GET is answered, which has none");
    else if (!server->local_socket && (!host || !host_is_ours(server, host)))
        cts_answer_text(answer, server, 400, "Host: not a name of this server (see --host of ctsplat serve)");
    else if (!strcmp(method, "OPTIONS") && server->options->allow_origin &&
             cts_http_header(request, "Access-Control-Request-Method"))
        answer_preflight(server, answer);
    else if (strcmp(method, "GET") && strcmp(method, "HEAD") &&
             (strcmp(method, "OPTIONS") || strcmp(request->path, "/")))
        cts_answer_text(answer, server, 405, "only GET is answered, and OPTIONS of /"),
            cts_answer_header(answer, "Allow", "GET, HEAD");
    else if (server->token[0] && brings_token(server, request, answer))
        return false;
    else if (server->token[0] && !has_token(server, request))
        cts_answer_text(answer, server, 401,
                        "the token is missing or wrong (open the address that ctsplat serve printed, or send "
                        "Authorization: Bearer TOKEN)"),
            cts_answer_header(answer, "WWW-Authenticate", "Bearer");
    else
        return true;
    return false;
}
