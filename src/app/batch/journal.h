/* The batch's memory: one line of JSON a series in DIR/batch.jsonl, or DIR/batch-I-of-N.jsonl of a shard.
 *
 * Lines are appended as work ends and synced now and then, and of several lines of a series the last one holds: a run
 * that is killed leaves at worst half a line at the end, which the next one cuts off. cts_journal_finish() leaves one
 * line a series. */
#ifndef CTS_BATCH_JOURNAL_H
#define CTS_BATCH_JOURNAL_H

#include "app/batch/batch.h"
#include <jansson.h>

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

/* line.c: a line as JSON, and what of it still stands on the disk. */
enum { CTS_LINE_STEM = 160 };

/* A picture, or a rotation, that has to be made of a series. */
typedef struct CtsBatchPicture {
    int preset, view;   /* places in the lists */
    const char **paths; /* of the formats that do not stand; NULL-terminated; a rotation's frames get their numbers */
    const char *thumb_stem; /* of its thumbnails */
} CtsBatchPicture;

/* What one picture's file depends on beside its series, as 64 hex digits and a 0; NULL: what all of them do. */
CtsStatus cts_line_hash(const CtsBatchSettings *settings, const CtsBatchPicture *picture, bool is_dcm, char hex[65],
                        CtsError *err);

/* PRESET-VIEW as a file name may have it. */
void cts_line_stem(const CtsBatchSettings *settings, const CtsBatchPicture *picture, char stem[CTS_LINE_STEM]);

/* Whether the line's list has each file that picture is to have in this format, made with these settings, and the disk
 * has them as they were; with format NULL: its thumbnails. */
bool cts_line_stands(const CtsBatchSettings *settings, const json_t *line, const CtsBatchPicture *picture,
                     const char *format);
/* Whether nothing has to be done for a series with these files: all that is asked for stands, or it was refused for
 * good. */
bool cts_line_settled(const CtsBatchSettings *settings, const json_t *line, const char *input_sha256);

/* What the settings do not let a kept line tell leaves it: where its files are, and what may identify the patient. */
void cts_line_forget(json_t *line, const CtsBatchSettings *settings);

/* Whether it tells all that the settings let it. */
bool cts_line_tells_all(const json_t *line, const CtsBatchSettings *settings);

/* Whether the entry is a capture that this batch is to send and that the PACS does not have. */
bool cts_line_waits(const CtsBatchSettings *settings, const json_t *entry);
/* How many there are of them. */
int cts_line_n_waiting(const CtsBatchSettings *settings, const json_t *line);
/* The full path of an entry's file; false where it is none of -O. */
bool cts_line_path(const CtsBatchSettings *settings, const json_t *entry, char *path, size_t size);

/* What the line's list "outputs", "thumbnails" or "errors" has of this picture, NULL: of all, in this format, NULL: in
 * any, leaves the line, and files leave the disk. */
void cts_line_drop(json_t *line, const char *list, const CtsBatchSettings *settings, const CtsBatchPicture *picture,
                   const char *format);

/* Size, time and SHA-256 of the entry's file. */
CtsStatus cts_line_file_facts(const CtsBatchSettings *settings, json_t *entry, CtsError *err);

#endif
