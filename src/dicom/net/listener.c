#include "dicom/net/listener.h"

#include <errno.h>
#include <netdb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

/* Connections that wait to be accepted, so that a burst of many peers is not refused; the system has a limit of its
 * own. */
enum { BACKLOG = 512 };

static CtsStatus resolve(const char *text, struct addrinfo **found, CtsError *err)
{
    const struct addrinfo hints = {.ai_flags = AI_NUMERICSERV | AI_PASSIVE, .ai_socktype = SOCK_STREAM};
    const char *colon = strrchr(text, ':');
    char host[256];
    char *end = "";
    const long port = colon && colon[1] ? strtol(colon + 1, &end, 10) : -1;
    const bool bracketed = colon && text[0] == '[' && colon[-1] == ']';
    snprintf(host, sizeof host, "%.*s", colon ? (int)(colon - text) - 2 * bracketed : 0, text + bracketed);
    if (port < 0 || port > 65535 || *end || !*host || (strchr(host, ':') && !bracketed) ||
        getaddrinfo(host, colon + 1, &hints, found))
        return cts_fail(err, CTS_ERR_USAGE, "`listen` %.80s: is no HOST:PORT of this machine, such as 127.0.0.1:11112",
                        text);
    return CTS_OK;
}

CtsStatus cts_listen(const char *text, int *listener, CtsError *err)
{
    struct addrinfo *found;
    const int on = 1;
    const CtsStatus st = resolve(text, &found, err);
    *listener = -1;
    if (st)
        return st;
    const int fd = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    const bool listens = fd >= 0 && !setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) &&
                         !bind(fd, found->ai_addr, found->ai_addrlen) && !listen(fd, BACKLOG);
    const int why = errno;
    freeaddrinfo(found);
    if (listens) {
        *listener = fd;
        return CTS_OK;
    }
    if (fd >= 0)
        close(fd);
    return cts_fail(err, CTS_ERR_INTERNAL, "%s: cannot be listened at: %s", text, strerror(why));
}

void cts_listener_name(int listener, char *text, size_t size)
{
    struct sockaddr_storage own = {0};
    socklen_t n = sizeof own;
    char host[64] = "", port[8] = "";
    if (!getsockname(listener, (struct sockaddr *)&own, &n))
        getnameinfo((const struct sockaddr *)&own, n, host, sizeof host, port, sizeof port,
                    NI_NUMERICHOST | NI_NUMERICSERV);
    snprintf(text, size, strchr(host, ':') ? "[%s]:%s" : "%s:%s", host, port);
}
