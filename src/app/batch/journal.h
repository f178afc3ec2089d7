/* The journal: one JSON record per series in DIR/batch.jsonl, or DIR/batch-I-of-N.jsonl for a shard.
 *
 * Records are appended as series end and synced periodically; the last record of a series is valid. A killed run leaves
 * at most an incomplete line at the end, which the next run truncates. cts_journal_finish() leaves one record per
 * series. */
#pragma once

#include "app/batch/batch.h"
#include <jansson.h>

typedef struct CtsJournal CtsJournal;

/* Locks DIR for this shard (shard 0 of 1: exclusively; others: together with shards of the same total number), waiting
 * briefly for a run that is ending; CTS_ERR_INTERNAL, with the holder in err, when another run has the lock; a warning
 * where the file system has no locks. Reads the records of earlier runs, of this or any other shard; with `fresh`
 * none. settings must stay. */
CtsStatus cts_journal_open(CtsJournal **journal, const CtsBatchSettings *settings, CtsError *err);
/* The record of a series, a new reference; NULL when there is none. *is_own (may be NULL): it is in this shard's own
 * journal. */
json_t *cts_journal_find(const CtsJournal *journal, const char *series_uid, bool *is_own);
/* Appends a record, without the details that the settings exclude. CTS_ERR_OUTPUT leaves the journal unchanged. */
CtsStatus cts_journal_add(CtsJournal *journal, const json_t *record, CtsError *err);
/* Makes all records so far survive a power cut. CTS_ERR_INTERNAL when the lock file was removed. */
CtsStatus cts_journal_sync(CtsJournal *journal, CtsError *err);
/* Removes the records of this shard, and their pictures, whose series is not among the keys of `planned` and ended
 * `forget` days ago. */
void cts_journal_forget(CtsJournal *journal, const json_t *planned);
/* Replaces the file by one with one record per series, in order of UID, without the details that the settings exclude.
 */
CtsStatus cts_journal_finish(CtsJournal *journal, CtsError *err);
/* Releases the lock. */
void cts_journal_close(CtsJournal **journal);
/* Closes the lock's descriptors: in a worker process, which must not keep the lock. */
void cts_journal_leave(CtsJournal *journal);

/* journal_record.c: a journal record as JSON, and the outputs of it that are up to date. */
enum { CTS_RECORD_STEM = 160 }; /* bytes of a picture's name: of its preset and its view */

/* A picture, or a rotation, that has to be made of a series. */
typedef struct CtsBatchPicture {
    int preset, view; /* places in the lists */
    /* outputs that are missing or outdated; NULL-terminated; frames of a rotation get their numbers */
    const char **paths;
    const char *thumb_stem; /* of its thumbnails */
} CtsBatchPicture;

/* Hash, as 64 hex digits and a 0, of the settings that a picture's file depends on beside its series; picture NULL: of
 * those common to all pictures. */
CtsStatus cts_journal_record_hash(const CtsBatchSettings *settings, const CtsBatchPicture *picture, bool is_dcm,
                                  char hex[65], CtsError *err);

/* PRESET-VIEW as a file name may have it. */
void cts_journal_record_stem(const CtsBatchSettings *settings, const CtsBatchPicture *picture,
                             char stem[CTS_RECORD_STEM]);

/* True if the record lists each file of the picture in this format with these settings, and the files are unchanged on
 * the disk; format NULL: its thumbnails. */
bool cts_journal_record_is_up_to_date(const CtsBatchSettings *settings, const json_t *record,
                                      const CtsBatchPicture *picture, const char *format);
/* True if nothing has to be done for a series with these files: all outputs are up to date, or it was refused for
 * good; and the record has all details that the settings request. */
bool cts_journal_record_is_settled(const CtsBatchSettings *settings, const json_t *record, const char *input_sha256);

/* Removes details that the settings, a CtsBatchSettings, exclude: paths, and data that may identify the patient. */
void cts_journal_record_redact(const void *settings, json_t *record);

/* True if a series with this record has pictures of the preset, by its modality and quantity. */
bool cts_journal_record_takes(const CtsBatchSettings *settings, const json_t *record, int preset, int view);
/* True if the entry is a capture that this batch sends and the PACS does not have. */
bool cts_journal_record_is_unsent(const CtsBatchSettings *settings, const json_t *record, const json_t *entry);
/* The number of such entries. */
int cts_journal_record_n_unsent(const CtsBatchSettings *settings, const json_t *record);
/* The full path of an entry's file; false where it is not below -O. */
bool cts_journal_record_path(const CtsBatchSettings *settings, const json_t *entry, char *path, size_t size);

/* Removes the entries of a list ("outputs", "thumbnails" or "errors") for this picture (NULL: all) in this format
 * (NULL: any), and their files. */
void cts_journal_record_drop(json_t *record, const char *list, const CtsBatchSettings *settings,
                             const CtsBatchPicture *picture, const char *format);

/* Size, time and SHA-256 of the entry's file. */
CtsStatus cts_journal_record_file_facts(const CtsBatchSettings *settings, json_t *entry, CtsError *err);
