#include "base/site_key.h"

#include "base/file.h"
#include "base/hash.h"
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/random.h>
#include <sys/stat.h>
#include <unistd.h>

enum { FEWEST_BYTES = 16, MAX_BYTES = 4096 };

/* Written to a temporary file and renamed, so that readers never see a partial file; the first of two writers wins. */
static CtsStatus make_key_file(const char *path, CtsError *err)
{
    uint8_t bytes[CTS_KEY_BYTES];
    char text[2 * CTS_KEY_BYTES + 2] = "", *temp = NULL;
    if (getrandom(bytes, sizeof bytes, 0) != (ssize_t)sizeof bytes)
        return cts_fail(err, CTS_ERR_INTERNAL, "the system gave no random numbers for a key");
    for (int i = 0; i < CTS_KEY_BYTES; i++)
        snprintf(text + 2 * i, 3, "%02x", bytes[i]);
    strcat(text, "\n");
    if (asprintf(&temp, "%s.%ld", path, (long)getpid()) < 0)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    const int fd = open(temp, O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0600);
    const bool written = fd >= 0 && write(fd, text, strlen(text)) == (ssize_t)strlen(text) && cts_sync_file(fd);
    CtsStatus st = CTS_OK;
    if (!written || (!cts_rename_new(temp, path) && errno != EEXIST))
        st = cts_fail(err, CTS_ERR_READ, "%s: a key cannot be made: %s (`key` takes another file)", path,
                      strerror(errno));
    if (fd >= 0) {
        close(fd);
        unlink(temp);
    }
    free(temp);
    return st;
}

static CtsStatus read_key(int fd, const char *path, CtsKey *key, CtsError *err)
{
    uint8_t bytes[MAX_BYTES + 1];
    struct stat info;
    const ssize_t n = fstat(fd, &info) || !S_ISREG(info.st_mode) ? -1 : read(fd, bytes, sizeof bytes);
    if (n < FEWEST_BYTES || n > MAX_BYTES)
        return cts_fail(err, CTS_ERR_READ, "%s: is no key (a file of %d to %d bytes is needed)", path, FEWEST_BYTES,
                        MAX_BYTES);
    CtsHash *hash = cts_hash_start(NULL);
    cts_hash_bytes(hash, bytes, (size_t)n);
    return cts_hash_finish(&hash, key->bytes, err);
}

CtsStatus cts_key_load(const char *path, bool may_make, CtsKey *key, CtsError *err)
{
    char own[PATH_MAX];
    const bool is_own = !path && cts_user_path(own, sizeof own, "XDG_STATE_HOME", ".local/state", "key", may_make);
    const char *name = is_own ? own : path;
    CtsStatus st = CTS_OK;
    if (!name)
        return cts_fail(err, CTS_ERR_READ,
                        "the key's folder is unknown, as neither XDG_STATE_HOME nor HOME is set (give `key`)");
    int fd = open(name, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0 && is_own && may_make && errno == ENOENT) {
        st = make_key_file(name, err);
        fd = st ? -1 : open(name, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    }
    if (!st && fd < 0)
        st = cts_fail(err, CTS_ERR_READ,
                      "%s: the key cannot be read: %s (give `key`, or let one run without shards make "
                      "it)",
                      name, strerror(errno));
    if (!st)
        st = read_key(fd, name, key, err);
    if (fd >= 0)
        close(fd);
    return st;
}
