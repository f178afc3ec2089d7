/* A thread pool for parallel loops. */
#pragma once

#include "ctsplat/api.h"
#include <stddef.h>

CTS_C_BEGIN

/* Items first to end - 1 of a loop. worker is 0 to n_threads - 1, and no two concurrent calls have the same:
 * scratch[worker] needs no lock. The assignment of items to workers is not deterministic, so a result must not depend
 * on it; floating-point sums are stored per item and added up in order afterwards. */
typedef void (*cts_work_fn)(void *context, int worker, size_t first, size_t end);

/* Calls work for items 0 to n - 1, each once, and returns when all are done. Workers claim chunk items at a time; chunk
 * 0: an eighth of one worker's share. The caller is worker 0 and waits only for workers in the middle of their last
 * items, so that a loop never takes longer than with the caller alone, even on a busy machine. Loops may be nested and
 * run in several threads at once. Where threads cannot be created, there are fewer.
 *
 * Threads are created when first needed, sleep between loops, block signals, and are created again after a fork. */
void cts_parallel(int n_threads, size_t n, size_t chunk, cts_work_fn work, void *context);

/* Time that callers have spent in loops that more than one thread can work on, whether or not one did; nested loops
 * count once. The remaining time of a process is its serial part. */
double cts_parallel_ms(void);

CTS_C_END
