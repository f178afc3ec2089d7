/* An input file and its bytes: opened without blocking, regular files alone, every read in full. */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* An input file: a path, or the bytes of an archive's member. */
typedef struct CtsFile {
    const char *path;
    bool named; /* by the caller, not found in a folder: a DICOMDIR is followed, a failure to open it is an error */
    const uint8_t *memory; /* of an archive's member; else NULL */
    uint64_t n_memory;
} CtsFile;

typedef struct CtsFileBytes {
    int fd;
    const uint8_t *memory; /* the bytes of an archive's member; fd is then 0 and unused */
    uint64_t n_bytes;
    int64_t mtime_ns;
} CtsFileBytes;

/* CTS_ERR_READ when it cannot be opened; fd is -1 then, and also, with CTS_OK, for a file that is not regular. */
CtsStatus cts_file_bytes_open(CtsFileBytes *file, const CtsFile *source, CtsError *err);
/* A member of an archive as a file. */
CtsFileBytes cts_file_bytes_in_memory(const uint8_t *memory, uint64_t n_bytes);
void cts_file_bytes_close(CtsFileBytes *file);

/* Exactly n bytes from offset. */
CtsStatus cts_file_bytes_read(const CtsFileBytes *file, void *bytes, size_t n, uint64_t offset, CtsError *err);

/* Grows the buffer to n bytes, keeping its contents. */
CtsStatus cts_bytes_reserve(uint8_t **bytes, size_t *capacity, size_t n, CtsError *err);

/* Inflates (raw deflate) up to n bytes after skipping `skip`; *got: their number. CTS_ERR_PIXELS when the stream is
 * damaged. */
CtsStatus cts_inflate(const uint8_t *deflated, size_t n_deflated, uint64_t skip, uint8_t *bytes, size_t n, size_t *got,
                      CtsError *err);

CTS_C_END
