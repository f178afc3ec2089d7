/* Allocation of large blocks: sizes checked for overflow, blocks aligned for vector code. */
#pragma once

#include "ctsplat/status.h"
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

enum { CTS_ALIGNMENT = 64 };

/* n * size bytes aligned to 64, zeroed for cts_alloc_zeroed; n or size 0 gives a block that may be freed but not used.
 * On failure *block is NULL and the status CTS_ERR_MEMORY. */
CtsStatus cts_alloc_bytes(void **block, size_t n, size_t size, CtsError *err);
CtsStatus cts_alloc_zeroed_bytes(void **block, size_t n, size_t size, CtsError *err);
void cts_free_bytes(void *block);
/* A block with room for n items, of which the first n_kept are as they were in the old one; large ones are not copied.
 * On failure the block is as it was. */
CtsStatus cts_resize_bytes(void **block, size_t n_kept, size_t n, size_t size, CtsError *err);

/* For a pointer variable p of any type: cts_alloc_array(&p, n, err). */
#define cts_alloc_array(p, n, err) cts_alloc_bytes((void **)(p), (n), sizeof **(p), (err))
#define cts_alloc_zeroed(p, n, err) cts_alloc_zeroed_bytes((void **)(p), (n), sizeof **(p), (err))
#define cts_resize_array(p, n_kept, n, err) cts_resize_bytes((void **)(p), (n_kept), (n), sizeof **(p), (err))
/* Frees and leaves NULL behind. */
#define cts_free(p) (cts_free_bytes(*(p)), (void)(*(p) = NULL))

/* Makes room for one more than n items in a malloc() block that grows by one item at a time: it doubles at powers of
 * two, so that its capacity needs no field. For a pointer variable p of any type: cts_grow(&p, n, err). */
CtsStatus cts_grow_bytes(void **items, size_t n, size_t size, CtsError *err);
#define cts_grow(p, n, err) cts_grow_bytes((void **)(p), (size_t)(n), sizeof **(p), (err))

/* Memory available without swapping: of the machine, or of its control groups where that is less; 0 when unknown. */
uint64_t cts_memory_available(void);
/* Memory that control groups leave to this process, including reclaimable page cache; INFINITY without a limit. The
 * paths are /proc/self/cgroup and the hierarchy, /sys/fs/cgroup. */
double cts_memory_quota(const char *groups_path, const char *mount);
/* True if a volume may use so many bytes: 60 % of the free memory (0: unknown), so that a batch does not cause
 * swapping. */
int cts_memory_allows(double n_bytes, uint64_t free_bytes);

/* *product = a * b; nonzero when it does not fit. */
static inline int cts_mul_overflows(size_t a, size_t b, size_t *product)
{
    return __builtin_mul_overflow(a, b, product);
}

CTS_C_END
