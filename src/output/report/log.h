/* The timing log: JSON Lines from a CtsReport, appended to a file in one write. */
#pragma once

#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include <stdbool.h>

typedef struct CtsLog CtsLog;
struct CtsNames; /* redact.h */

/* path "-" is stderr; NULL makes *log NULL, which all functions accept and ignore. start_ms is cts_wall_ms() at the
 * start of the program, the origin of t_ms. Opens the file, so that a log that cannot be written is refused before any
 * work. UIDs are written as hashes under a key (base/site_key.h), and omitted without one. */
CtsStatus cts_log_open(CtsLog **log, const char *path, const char *key, bool may_make_key, double start_ms,
                       CtsError *err);

/* Checks that it could be opened. */
CtsStatus cts_log_check(const char *path, CtsError *err);

/* A picture, or the first of a rotation, that is to be made. */
void cts_log_picture(CtsLog *log, const char *preset, const CtsRenderSettings *settings, int n_frames);
/* An output that is written. */
void cts_log_output(CtsLog *log, const char *path, const char *format, uint64_t bytes);
/* From here on these names of input files are removed from messages; names must outlast the log. */
void cts_log_without_names(CtsLog *log, const struct CtsNames *names);
/* Stages, skipped work, voxel counts and measured error. Here the run's time ends. */
void cts_log_report(CtsLog *log, const CtsReport *report);
/* The fields of event error, from report->verified; a new reference. */
struct json_t *cts_error_json(const CtsReport *report);
/* Sets fields of the first line, run; texts are copied, and may be NULL. command: without patient data. */
void cts_log_run(CtsLog *log, const char *command, const char *series_uid);
/* The last line of a run that ended and was reported (n_threads as requested, 0: all cores), and of one that did
 * not. */
void cts_log_done(CtsLog *log, int n_threads);
void cts_log_failed(CtsLog *log, int exit_code, const char *message);
/* The text and file of a log of a run that is broken off here and now: for a signal handler, which can do no more than
 * write it. Valid until the log is closed; false when there is no log. */
bool cts_log_last_words(CtsLog *log, int *fd, const char **text, size_t *size);
/* Append all lines and close. */
CtsStatus cts_log_close(CtsLog **log, CtsError *err);
