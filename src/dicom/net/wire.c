#include "dicom/net/wire.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

/* Longest text: a path has 4 KiB. */
enum { MAX_TEXT = 1 << 16 };

bool cts_wire_read(int socket, void *bytes, size_t n)
{
    char *at = bytes;
    for (ssize_t part; n > 0; at += part, n -= (size_t)part)
        if ((part = TEMP_FAILURE_RETRY(recv(socket, at, n, 0))) <= 0)
            return false;
    return true;
}

bool cts_wire_write_text(int socket, const char *text)
{
    const size_t n = text ? strlen(text) + 1 : 0; /* with the 0 at its end */
    return cts_send_all(socket, &n, sizeof n) && cts_send_all(socket, text, n);
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
