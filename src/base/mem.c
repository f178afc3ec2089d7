#include "base/mem.h"

#include <malloc.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/sysinfo.h>

/* From this size on, huge pages save most of the page faults; below, they would waste memory. The end of a block gets
 * small pages, unless it fills half of a huge one or more. */
enum { HUGE_PAGE = 2 << 20, HUGE_FROM = 2 << 20 };

static CtsStatus checked_size(size_t n, size_t size, size_t *bytes, CtsError *err)
{
    if (cts_mul_overflows(n, size, bytes) || *bytes > PTRDIFF_MAX / 2)
        return cts_fail(err, CTS_ERR_MEMORY, "%zu items of %zu bytes are more than memory can hold", n, size);
    return CTS_OK;
}

/* malloc() maps blocks of more than this separately, whatever was freed before (mallopt(3)). */
enum { MAPPED_FROM = 32 << 20, PAGE = 4096 };

/* Advises the whole of such a mapping: with two kinds of advice realloc() could not extend it, and would copy it. */
static void advise_mapping(char *start)
{
    char *const first = start - (uintptr_t)start % PAGE;
    madvise(first, (size_t)(start - first) + malloc_usable_size(start), MADV_HUGEPAGE);
}

/* The original address is stored just before the block, so that fresh zeroed pages of calloc() can be used
 * untouched. */
static CtsStatus aligned_block(void **block, size_t n, size_t size, bool zeroed, CtsError *err)
{
    size_t bytes;
    *block = NULL;
    const CtsStatus st = checked_size(n, size, &bytes, err);
    if (st)
        return st;
    const bool huge = bytes >= HUGE_FROM;
    const size_t huge_bytes = huge ? (bytes + HUGE_PAGE / 2) / HUGE_PAGE * HUGE_PAGE : 0;
    const size_t alignment = huge ? HUGE_PAGE : CTS_ALIGNMENT;
    const size_t total = (bytes > huge_bytes ? bytes : huge_bytes) + alignment + sizeof(void *);
    char *start = zeroed ? calloc(1, total) : malloc(total);
    if (!start)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory: %zu bytes asked for", bytes);
    const uintptr_t at = ((uintptr_t)start + sizeof(void *) + alignment - 1) / alignment * alignment;
    char *p = start + (at - (uintptr_t)start);
    memcpy(p - sizeof(void *), &start, sizeof start);
    if (total > MAPPED_FROM)
        advise_mapping(start);
    else if (huge)
        madvise(p, huge_bytes, MADV_HUGEPAGE); /* advice only: a refusal changes nothing */
    *block = p;
    return CTS_OK;
}

CtsStatus cts_alloc_bytes(void **block, size_t n, size_t size, CtsError *err)
{
    return aligned_block(block, n, size, false, err);
}

CtsStatus cts_alloc_zeroed_bytes(void **block, size_t n, size_t size, CtsError *err)
{
    return aligned_block(block, n, size, true, err);
}

static char *start_of(const void *block)
{
    char *start;
    memcpy(&start, (const char *)block - sizeof(void *), sizeof start);
    return start;
}

void cts_free_bytes(void *block)
{
    if (block)
        free(start_of(block));
}

CtsStatus cts_resize_bytes(void **block, size_t n_kept, size_t n, size_t size, CtsError *err)
{
    size_t bytes;
    const CtsStatus st = checked_size(n, size, &bytes, err);
    if (st)
        return st;
    const size_t offset = (size_t)((char *)*block - start_of(*block));
    char *const start = realloc(start_of(*block), offset + bytes + CTS_ALIGNMENT);
    if (!start)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory: %zu bytes asked for", bytes);
    /* mremap() keeps the alignment of pages; only a small block may change it. */
    const size_t off = (uintptr_t)(start + offset) % CTS_ALIGNMENT;
    char *const p = start + offset + (off ? CTS_ALIGNMENT - off : 0);
    if (off)
        memmove(p, start + offset, (n_kept < n ? n_kept : n) * size);
    memcpy(p - sizeof(void *), &start, sizeof start);
    if (bytes > MAPPED_FROM)
        advise_mapping(start);
    else if (bytes >= HUGE_FROM)
        madvise(p, bytes / HUGE_PAGE * HUGE_PAGE, MADV_HUGEPAGE); /* advice only, as above */
    *block = p;
    return CTS_OK;
}

CtsStatus cts_grow_bytes(void **items, size_t n, size_t size, CtsError *err)
{
    if (n & (n - 1))
        return CTS_OK;
    void *grown = reallocarray(*items, n ? 2 * n : 1, size);
    if (!grown)
        return cts_fail(err, CTS_ERR_MEMORY, "out of memory for %zu items", n + 1);
    *items = grown;
    return CTS_OK;
}

static uint64_t machine_available(void)
{
    unsigned long long kib = 0;
    char line[128];
    FILE *file = fopen("/proc/meminfo", "re");
    while (file && kib == 0 && fgets(line, sizeof line, file))
        if (sscanf(line, "MemAvailable: %llu kB", &kib) != 1)
            kib = 0;
    if (file)
        fclose(file);
    /* In a service /proc may be hidden: then use free memory without the page cache. */
    struct sysinfo machine;
    if (kib == 0 && !sysinfo(&machine))
        return (uint64_t)machine.freeram * machine.mem_unit;
    return (uint64_t)kib * 1024;
}

uint64_t cts_memory_available(void)
{
    const uint64_t machine = machine_available();
    const double quota = cts_memory_quota("/proc/self/cgroup", "/sys/fs/cgroup");
    if (isinf(quota) || (machine > 0 && quota > (double)machine))
        return machine;
    return quota > 1 ? (uint64_t)quota : 1; /* 0 would mean unknown */
}

int cts_memory_allows(double n_bytes, uint64_t free_bytes)
{
    return free_bytes == 0 || n_bytes <= 0.6 * (double)free_bytes;
}
