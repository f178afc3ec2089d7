/* Work that a run by `settled` leaves to a later one: series that still arrive, and failed ones until their next try.
 */
#pragma once

#include "app/batch/batch_plan.h"
#include "app/batch/journal.h"
#include "base/clock.h"

/* due: the earliest time at which a later run has something to do although no file changes; "" for never. Each of these
 * functions makes it earlier where it has to be. */

/* True if a file of the series came less than `settled` seconds ago. *record (NULL: none yet) becomes one of status
 * "waiting" that keeps its outputs; *changed: it was none before. */
bool cts_later_waits(CtsUtc *due, const CtsBatchSettings *settings, const CtsPlanSeries *series, json_t **record,
                     bool *changed);
/* True if the same series failed under the same options, and its next try is not due. */
bool cts_later_is_held(CtsUtc *due, const CtsBatchSettings *settings, const json_t *record, const char *input_sha256);
/* Sets the time of the next try in the final record of a series that may succeed then; removes it from others. */
void cts_later_set_try(CtsUtc *due, const CtsBatchSettings *settings, json_t *record);
