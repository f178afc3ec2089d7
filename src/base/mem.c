#define _GNU_SOURCE
#include "base/mem.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

/* From this size on, huge pages save most of the page faults; below, they would waste memory. */
enum { HUGE_PAGE = 2 << 20, HUGE_FROM = 8 << 20 };

static CtsStatus checked_size(size_t n, size_t size, size_t *bytes, CtsError *err)
{
    if (cts_mul_overflows(n, size, bytes) || *bytes > PTRDIFF_MAX)
        return cts_fail(err, CTS_ERR_MEMORY, "%zu items of %zu bytes are more than memory can hold", n, size);
    return CTS_OK;
}

static void *aligned_block(size_t bytes)
{
    const size_t alignment = bytes >= HUGE_FROM ? HUGE_PAGE : CTS_ALIGNMENT;
    const size_t rounded = (bytes + alignment - 1) / alignment * alignment;
    if (rounded < bytes)
        return NULL;
    void *block = aligned_alloc(alignment, rounded ? rounded : alignment);
    if (block && bytes >= HUGE_FROM)
        madvise(block, rounded, MADV_HUGEPAGE); /* advice only: a refusal changes nothing */
    return block;
}

CtsStatus cts_alloc_bytes(void **block, size_t n, size_t size, CtsError *err)
{
    size_t bytes;
    *block = NULL;
    const CtsStatus st = checked_size(n, size, &bytes, err);
    if (st)
        return st;
    *block = aligned_block(bytes);
    return *block ? CTS_OK : cts_fail(err, CTS_ERR_MEMORY, "out of memory: %zu bytes asked for", bytes);
}

CtsStatus cts_alloc_zeroed_bytes(void **block, size_t n, size_t size, CtsError *err)
{
    const CtsStatus st = cts_alloc_bytes(block, n, size, err);
    if (st == CTS_OK)
        memset(*block, 0, n * size);
    return st;
}

void cts_free_bytes(void *block)
{
    free(block);
}
