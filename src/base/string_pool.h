/* A string pool for the texts of many slices: repeated texts are stored once, and all are freed together. */
#pragma once

#include "ctsplat/api.h"
#include <stdbool.h>
#include <stddef.h>

CTS_C_BEGIN

enum { CTS_TEXT_SLOTS = 256 };

/* Zero-initialise; free with cts_string_pool_free(). One thread at a time. */
typedef struct CtsStringPool {
    struct CtsStringPoolBlock *blocks;
    const char *shared[CTS_TEXT_SLOTS]; /* by their hashes, the last one of each */
    bool no_memory;                     /* a text could not be added */
} CtsStringPool;

/* A copy of n bytes and a 0 after them. NULL without memory. */
const char *cts_string_pool_add(CtsStringPool *texts, const char *text, size_t n);
/* A pooled copy of the text up to its first 0 byte. NULL without memory. */
const char *cts_string_pool_share(CtsStringPool *texts, const char *text, size_t n);
/* Moves all texts of a pool to another. */
void cts_string_pool_join(CtsStringPool *to, CtsStringPool *from);
void cts_string_pool_free(CtsStringPool *texts);

CTS_C_END
