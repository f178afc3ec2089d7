/* The batch's memory: one line of JSON a series in DIR/batch.jsonl, or DIR/batch-I-of-N.jsonl of a shard.
 *
 * Lines are appended as work ends and synced now and then, and of several lines of a series the last one holds: a run
 * that is killed leaves at worst half a line at the end, which the next one cuts off. cts_journal_finish() leaves one
 * line a series. */
#ifndef CTS_BATCH_JOURNAL_H
#define CTS_BATCH_JOURNAL_H

#include "ctsplat/status.h"
#include <jansson.h>
#include <stdbool.h>

typedef struct CtsJournal CtsJournal;

/* Locks DIR for this shard (shard 0 of 1: for itself alone; shards of one number of shards beside each other), waiting
 * a moment for a run that is just ending; CTS_ERR_INTERNAL, and err says who has it, when another run is at work. Reads
 * what earlier runs left, this shard's or any other's. fresh: as if there were nothing of this one's. */
CtsStatus cts_journal_open(CtsJournal **journal, const char *folder, int shard, int n_shards, bool fresh,
                           CtsError *err);
/* The line of a series, the caller's to release; NULL when there is none. */
json_t *cts_journal_find(const CtsJournal *journal, const char *series_uid);
/* Whether that line stands in this shard's own journal. */
bool cts_journal_holds(const CtsJournal *journal, const char *series_uid);
/* Appends; does not take line over. CTS_ERR_OUTPUT leaves the journal as it was. */
CtsStatus cts_journal_add(CtsJournal *journal, const json_t *line, CtsError *err);
/* Lines so far outlast a power cut too. CTS_ERR_INTERNAL when somebody has removed the lock's file. */
CtsStatus cts_journal_sync(CtsJournal *journal, CtsError *err);
/* One line a series, in order of UID, in a new file that takes the old one's place. change may change each line. */
CtsStatus cts_journal_finish(CtsJournal *journal, void (*change)(void *context, json_t *line), void *context,
                             CtsError *err);
/* Lets the lock go. */
void cts_journal_close(CtsJournal **journal);
/* The descriptors that hold the locks are closed: in a child, which must not keep them alive. */
void cts_journal_leave(CtsJournal *journal);

#endif
