/* An input file and its bytes: opened without blocking, regular files alone, every read in full. */
#ifndef CTS_BASE_FILE_BYTES_H
#define CTS_BASE_FILE_BYTES_H

#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* Where an input file is: a path, or the bytes of an archive's member. */
typedef struct CtsFile {
    const char *path;
    bool named; /* by the caller, not found in a folder: a DICOMDIR is followed, a failure to open it is an error */
    const uint8_t *memory; /* of an archive's member; else NULL */
    uint64_t n_memory;
} CtsFile;

typedef struct CtsFileBytes {
    int fd;
    const uint8_t *memory; /* the bytes of an archive's member, which stands for a file; fd is then 0 and no file */
    uint64_t n_bytes;
    int64_t mtime_ns;
} CtsFileBytes;

/* CTS_ERR_READ when it cannot be opened; fd is -1 then, and also, with CTS_OK, for what is no regular file. */
CtsStatus cts_file_bytes_open(CtsFileBytes *file, const char *path, CtsError *err);
/* A member of an archive as a file. */
CtsFileBytes cts_file_bytes_in_memory(const uint8_t *memory, uint64_t n_bytes);
void cts_file_bytes_close(CtsFileBytes *file);

/* Exactly n bytes from offset. */
CtsStatus cts_file_bytes_read(const CtsFileBytes *file, void *bytes, size_t n, uint64_t offset, CtsError *err);

/* Make room for n bytes, keeping what is there. */
CtsStatus cts_bytes_reserve(uint8_t **bytes, size_t *capacity, size_t n, CtsError *err);

/* Inflate (raw deflate) up to n bytes after skipping `skip`; *got says how many there were. CTS_ERR_PIXELS when the
 * stream is damaged. */
CtsStatus cts_inflate(const uint8_t *deflated, size_t n_deflated, uint64_t skip, uint8_t *bytes, size_t n, size_t *got,
                      CtsError *err);

CTS_C_END
#endif
