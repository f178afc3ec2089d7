/* The listening socket: an address, a Unix socket, or a socket passed by systemd. */
#include "app/serve/server.h"

#include "dicom/net/listener.h"
#include <errno.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

/* BACKLOG: connections that wait to be accepted; 80 browsers with six each. FIRST_HANDED: the first descriptor that
 * systemd passes (SD_LISTEN_FDS_START). */
enum { BACKLOG = 512, FIRST_HANDED = 3 };
static const char LOCAL[] = "unix:";

static CtsStatus fail_listen(const char *address, const char *what, CtsError *err)
{
    return cts_fail(err, CTS_ERR_READ, "%s: %s: %s (choose another with `listen`)", address, what, strerror(errno));
}

/* True for a Unix socket without a listener, which may be removed. */
static bool is_stale(const struct sockaddr_un *address)
{
    struct stat st;
    if (lstat(address->sun_path, &st) || !S_ISSOCK(st.st_mode))
        return false;
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool stale =
        fd >= 0 && connect(fd, (const struct sockaddr *)address, sizeof *address) && errno == ECONNREFUSED;
    if (fd >= 0)
        close(fd);
    return stale;
}

static CtsStatus open_local(const char *address, int *fd, CtsError *err)
{
    const char *path = address + strlen(LOCAL);
    struct sockaddr_un a = {.sun_family = AF_UNIX};
    if (!*path || strlen(path) >= sizeof a.sun_path)
        return cts_fail(err, CTS_ERR_USAGE, "`listen` %s: a path of 1 to %zu characters", address,
                        sizeof a.sun_path - 1);
    memcpy(a.sun_path, path, strlen(path));
    if (is_stale(&a))
        unlink(path);
    const mode_t before = umask(0177);
    *fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const bool failed = *fd < 0 || bind(*fd, (struct sockaddr *)&a, sizeof a) || listen(*fd, BACKLOG);
    const int why = errno;
    umask(before);
    errno = why;
    return failed ? fail_listen(address, "cannot listen", err) : CTS_OK;
}

static bool is_loopback(const struct sockaddr_storage *a)
{
    if (a->ss_family == AF_INET)
        return ntohl(((const struct sockaddr_in *)(const void *)a)->sin_addr.s_addr) >> 24 == 127;
    if (a->ss_family != AF_INET6)
        return false;
    const struct in6_addr *six = &((const struct sockaddr_in6 *)(const void *)a)->sin6_addr;
    return IN6_IS_ADDR_LOOPBACK(six) || (IN6_IS_ADDR_V4MAPPED(six) && six->s6_addr[12] == 127);
}

/* sd_listen_fds(3), without its library. */
static bool is_handed_over(void)
{
    const char *pid = getenv("LISTEN_PID"), *n = getenv("LISTEN_FDS");
    return pid && n && atol(pid) == (long)getpid() && atoi(n) >= 1;
}

static CtsStatus name_url(CtsServer *server, int fd, char **url, CtsError *err)
{
    struct sockaddr_storage a;
    socklen_t size = sizeof a;
    char where[80];
    if (getsockname(fd, (struct sockaddr *)&a, &size))
        return fail_listen(server->options->listen, "is no socket", err);
    server->local_socket = a.ss_family == AF_UNIX;
    if (server->local_socket) {
        *url = strdup(is_handed_over() ? LOCAL : server->options->listen);
        return *url ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    }
    if (!is_loopback(&a) && !server->tls && !server->options->net.insecure_http)
        return cts_fail(err, CTS_ERR_USAGE,
                        "`listen` %s: beyond this machine the patient's pictures need TLS (give "
                        "`tls-cert` and `tls-key`, or `insecure-http`)",
                        server->options->listen);
    cts_listener_name(fd, where, sizeof where);
    return asprintf(url, "%s://%s/", server->tls ? "https" : "http", where) < 0
               ? cts_fail(err, CTS_ERR_MEMORY, "out of memory")
               : CTS_OK;
}

CtsStatus cts_listen_open(CtsServer *server, int *fd, char **url, CtsError *err)
{
    const char *address = server->options->listen;
    CtsStatus st = CTS_OK;
    *fd = -1;
    *url = NULL;
    if (is_handed_over())
        *fd = FIRST_HANDED;
    else
        st = strncmp(address, LOCAL, strlen(LOCAL)) ? cts_listen(address, fd, err) : open_local(address, fd, err);
    if (!st)
        st = name_url(server, *fd, url, err);
    if (st && *fd >= 0)
        close(*fd);
    return st;
}

void cts_listen_close(const CtsServer *server)
{
    const char *address = server->options->listen;
    if (server->local_socket && !is_handed_over())
        unlink(address + strlen(LOCAL));
}
