/* A run by `settled` that has nothing to do is found without reading a file: names, sizes and times below PATH and -O,
 * and the settings, are those of the last run, and nothing is due. */
#pragma once

#include "app/batch/batch.h"
#include "base/clock.h"
#include "base/hash.h"

typedef struct CtsIdle {
    char settings[65]; /* hash; "" where a run cannot be known to be idle */
    uint64_t inputs;   /* sum of names, sizes and times below the paths, when the run began */
} CtsIdle;

/* True if this run has nothing to do; the result then has the last run's number of series, and as done those that
 * neither were refused nor failed. key: see cts_plan_new(). */
bool cts_idle_begin(CtsIdle *idle, const CtsBatchSettings *settings, const CtsKey *key, CtsBatchResult *result);
/* Keeps the state for the next run, after one that has ended. Without it the next run searches, so failures do not
 * matter. */
void cts_idle_end(const CtsIdle *idle, const CtsBatchSettings *settings, const CtsUtc *due,
                  const CtsBatchResult *result);
