/* Deflate (RFC 1951) for the filtered rows of a picture; its bytes depend on the input alone. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Run of bytes that equal the byte before them. */
typedef struct CtsByteRun {
    uint32_t first, length; /* bytes from the start of the input */
} CtsByteRun;

/* Room that cts_deflate() needs for n bytes: runs, and packed bytes. */
static inline size_t cts_deflate_max_runs(size_t n)
{
    return n / 4 + 1; /* a run has 4 bytes or more, and one ends the list */
}

static inline size_t cts_deflate_max_bytes(size_t n)
{
    return n + n / 2 + 256; /* 12 bits a byte, and the code table */
}

/* Packs n bytes (less than 4 GiB) as one block, and returns how many bytes it has. A block that is not the last of its
 * stream ends on a byte, so that the next one can follow. runs is working memory. */
size_t cts_deflate(const uint8_t *bytes, size_t n, bool last, CtsByteRun *runs, uint8_t *packed);
