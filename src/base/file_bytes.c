#include "base/file_bytes.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

CtsStatus cts_file_bytes_open(CtsFileBytes *file, const CtsFile *source, CtsError *err)
{
    *file = (CtsFileBytes){.fd = -1};
    if (source->memory) {
        *file = cts_file_bytes_in_memory(source->memory, source->n_memory);
        return CTS_OK;
    }
    const int fd = open(source->path, O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY);
    if (fd < 0)
        return errno == ENXIO ? CTS_OK : cts_fail(err, CTS_ERR_READ, "cannot be opened: %s", strerror(errno));
    struct stat info;
    if (fstat(fd, &info)) {
        const int e = errno;
        close(fd);
        return cts_fail(err, CTS_ERR_READ, "cannot be opened: %s", strerror(e));
    }
    if (!S_ISREG(info.st_mode)) {
        close(fd);
        return CTS_OK;
    }
    file->fd = fd;
    file->n_bytes = (uint64_t)info.st_size;
    file->mtime_ns = (int64_t)info.st_mtim.tv_sec * 1000000000 + info.st_mtim.tv_nsec;
    return CTS_OK;
}

CtsFileBytes cts_file_bytes_in_memory(const uint8_t *memory, uint64_t n_bytes)
{
    return (CtsFileBytes){.memory = memory, .n_bytes = n_bytes};
}

void cts_file_bytes_close(CtsFileBytes *file)
{
    if (file->fd >= 0 && !file->memory)
        close(file->fd);
    file->fd = -1;
}

CtsStatus cts_file_bytes_read(const CtsFileBytes *file, void *bytes, size_t n, uint64_t offset, CtsError *err)
{
    uint8_t *p = bytes;
    if (file->memory) {
        if (offset > file->n_bytes || n > file->n_bytes - offset)
            return cts_fail(err, CTS_ERR_READ, "is shorter than it was when it was opened");
        memcpy(p, file->memory + offset, n);
        return CTS_OK;
    }
    while (n > 0) {
        const ssize_t done = pread(file->fd, p, n, (off_t)offset);
        if (done < 0 && errno == EINTR)
            continue;
        if (done < 0)
            return cts_fail(err, CTS_ERR_READ, "cannot be read: %s", strerror(errno));
        if (done == 0)
            return cts_fail(err, CTS_ERR_READ, "is shorter than it was when it was opened");
        p += done;
        n -= (size_t)done;
        offset += (uint64_t)done;
    }
    return CTS_OK;
}

CtsStatus cts_bytes_reserve(uint8_t **bytes, size_t *capacity, size_t n, CtsError *err)
{
    if (n <= *capacity)
        return CTS_OK;
    uint8_t *grown = realloc(*bytes, n);
    if (!grown)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory: %zu bytes asked for", n);
    *bytes = grown;
    *capacity = n;
    return CTS_OK;
}

CtsStatus cts_inflate(const uint8_t *deflated, size_t n_deflated, uint64_t skip, uint8_t *bytes, size_t n, size_t *got,
                      CtsError *err)
{
    *got = 0;
    uint8_t skipped[4096];
    z_stream z = {.next_in = (Bytef *)(uintptr_t)deflated, .avail_in = (uInt)n_deflated};
    if (inflateInit2(&z, -MAX_WBITS) != Z_OK)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    int result = Z_OK;
    while (skip > 0 && result == Z_OK) {
        const uInt room = skip < sizeof skipped ? (uInt)skip : (uInt)sizeof skipped;
        z.next_out = skipped;
        z.avail_out = room;
        result = inflate(&z, Z_NO_FLUSH);
        skip -= room - z.avail_out;
    }
    while (*got < n && result == Z_OK) {
        const uInt room = n - *got > 1u << 30 ? 1u << 30 : (uInt)(n - *got);
        z.next_out = bytes + *got;
        z.avail_out = room;
        result = inflate(&z, Z_NO_FLUSH);
        *got += room - z.avail_out;
    }
    inflateEnd(&z);
    if (result == Z_OK || result == Z_STREAM_END)
        return CTS_OK;
    return cts_fail(err, CTS_ERR_PIXELS, "its deflated data set is damaged%s",
                    result == Z_BUF_ERROR ? " (it is cut short)" : "");
}
