#include "dicom/net/wire.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

/* Longest text: a path has 4 KiB. */
enum { MAX_TEXT = 1 << 16 };

bool cts_wire_write(int socket, const void *bytes, size_t n)
{
    for (const char *at = bytes; n > 0;) {
        const ssize_t part = send(socket, at, n, MSG_NOSIGNAL);
        if (part < 0 && errno != EINTR)
            return false;
        at += part > 0 ? part : 0;
        n -= part > 0 ? (size_t)part : 0;
    }
    return true;
}

bool cts_wire_read(int socket, void *bytes, size_t n)
{
    for (char *at = bytes; n > 0;) {
        const ssize_t part = recv(socket, at, n, 0);
        if (part == 0 || (part < 0 && errno != EINTR))
            return false;
        at += part > 0 ? part : 0;
        n -= part > 0 ? (size_t)part : 0;
    }
    return true;
}

bool cts_wire_write_text(int socket, const char *text)
{
    const size_t n = text ? strlen(text) + 1 : 0; /* with the 0 at its end */
    return cts_wire_write(socket, &n, sizeof n) && cts_wire_write(socket, text, n);
}

bool cts_wire_read_text(int socket, char **text)
{
    size_t n;
    *text = NULL;
    if (!cts_wire_read(socket, &n, sizeof n) || n > MAX_TEXT)
        return false;
    if (n == 0)
        return true;
    if (!(*text = malloc(n)) || !cts_wire_read(socket, *text, n))
        return false;
    (*text)[n - 1] = 0;
    return true;
}
