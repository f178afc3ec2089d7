/* Journals of batches: one JSON object per line, found by its offset. The last record of a series is valid. */
#pragma once

#include "ctsplat/status.h"
#include <jansson.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

typedef struct CtsJournalFile {
    FILE *stream;
    char *folder; /* of the batch, relative to the folder of the sheet: "" or "NAME/" */
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
    CtsJournalLine *items; /* the valid records, one per series */
    size_t n;
    json_t *places;   /* of items, by their UIDs */
    int n_unreadable; /* lines that are no series */
    bool own_first;   /* records of the first file take precedence over all others */
} CtsJournalLines;

/* True if a path in a record, which anyone may have written, stays below its folder. */
bool cts_journal_path_is_safe(const char *path);

/* Reads the complete lines of a file; *end is the offset after the last one. Closes fd, also on failure. The last
 * record of a series in a file is valid, and among files the one that ended last. */
CtsStatus cts_journal_lines_read(CtsJournalLines *lines, int fd, const char *folder, uint64_t *end, CtsError *err);
/* Reads the journals in dir/folder, except the one of this name (NULL: none); deep: and in the folders below. */
CtsStatus cts_journal_lines_read_folder(CtsJournalLines *lines, const char *dir, const char *folder, bool deep,
                                        const char *except, CtsError *err);
/* Adds the line of this JSON; its file, offset and size are given. */
CtsStatus cts_journal_lines_put(CtsJournalLines *lines, const json_t *json, CtsJournalLine line, CtsError *err);
/* NULL where there is none. */
const CtsJournalLine *cts_journal_lines_find(const CtsJournalLines *lines, const char *series_uid);
/* A new reference; NULL where it cannot be read back. */
json_t *cts_journal_lines_load(const CtsJournalLines *lines, const CtsJournalLine *line);
/* Sorts items by UID; cts_journal_lines_find() finds nothing afterwards. */
void cts_journal_lines_sort(CtsJournalLines *lines);
void cts_journal_lines_free(CtsJournalLines *lines);
