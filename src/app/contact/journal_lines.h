/* Journals of batches: one object of JSON a line, found again by its place. Of several lines of a series one counts. */
#ifndef CTS_CONTACT_JOURNAL_LINES_H
#define CTS_CONTACT_JOURNAL_LINES_H

#include "ctsplat/status.h"
#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct CtsJournalFile {
    int fd;
    char *folder; /* of the batch, below where it is asked from: "" or "NAME/" */
} CtsJournalFile;

typedef struct CtsJournalLine {
    char *series_uid, ended[24];
    int file;
    uint64_t offset;
    size_t size; /* with its end */
} CtsJournalLine;

typedef struct CtsJournalLines {
    CtsJournalFile *files;
    int n_files;
    CtsJournalLine *items; /* those that count, one a series */
    size_t n;
    json_t *places;   /* of items, by their UIDs */
    int n_unreadable; /* lines that are no series */
    bool own_first;   /* what the first file says counts before all others */
} CtsJournalLines;

bool cts_is_journal(const char *name);
/* Whether a path in a line, where anybody may have written, stays below where it starts. */
bool cts_journal_path_is_safe(const char *path);

/* Takes the whole lines of a file; *end is where the last one ends. Takes fd over, whatever comes of it. Of one file
 * the last line of a series counts, and of several files the one that ended last. */
CtsStatus cts_journal_lines_read(CtsJournalLines *lines, int fd, const char *folder, uint64_t *end, CtsError *err);
/* A line that was written to the first file. */
CtsStatus cts_journal_lines_put(CtsJournalLines *lines, const json_t *line, uint64_t offset, size_t size,
                                CtsError *err);
/* NULL where there is none. */
const CtsJournalLine *cts_journal_lines_find(const CtsJournalLines *lines, const char *series_uid);
/* The caller's to release; NULL where it cannot be read again. */
json_t *cts_journal_lines_load(const CtsJournalLines *lines, const CtsJournalLine *line);
/* Puts items in order of UID, after which none is found any more. */
void cts_journal_lines_sort(CtsJournalLines *lines);
void cts_journal_lines_free(CtsJournalLines *lines);

#endif
