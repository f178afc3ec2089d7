/* Work shared out among threads that sleep when there is none. */
#ifndef CTS_BASE_PARALLEL_H
#define CTS_BASE_PARALLEL_H

#include "ctsplat/api.h"
#include <stddef.h>

CTS_C_BEGIN

/* Items first to end - 1 of a loop. worker is 0 to n_threads - 1, and no two calls that run at the same time have the
 * same: what belongs to scratch[worker] needs no lock. Which worker gets which items is left open, so a result must
 * not depend on it; sums of floating point numbers go through one place an item, added up in order afterwards. */
typedef void (*cts_work_fn)(void *context, int worker, size_t first, size_t end);

/* Calls work for items 0 to n - 1, each once, and returns when all are done. Workers take chunk items at a time, as
 * they become free; chunk 0: an eighth of one worker's share. The caller is worker 0 and waits for none but those in
 * the middle of their last items, so a loop never takes longer than by the caller alone, however busy the machine is.
 * Loops may stand inside loops and in several threads at once. Where threads cannot be had, there are fewer.
 *
 * The threads are made when first needed, sleep between loops, take no signals, and are made anew after a fork. */
void cts_parallel(int n_threads, size_t n, size_t chunk, cts_work_fn work, void *context);

/* How long the callers of loops have been inside those that more than one thread can work on, whether or not one did;
 * a loop inside a loop is part of that one. What a process takes besides is its serial part. */
double cts_parallel_ms(void);

CTS_C_END
#endif
