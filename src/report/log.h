/* The timing log: JSON Lines from a CtsReport, appended to a file in one write. */
#ifndef CTS_REPORT_LOG_H
#define CTS_REPORT_LOG_H

#include "ctsplat/report.h"
#include "ctsplat/status.h"

typedef struct CtsLog CtsLog;

/* path "-" is stderr; NULL makes *log NULL, which all of the following accept and ignore. start_ms is cts_wall_ms()
 * at the start of the program: what t_ms counts from. Opens the file, so that a log that cannot be written is refused
 * before any work. */
CtsStatus cts_log_open(CtsLog **log, const char *path, double start_ms, CtsError *err);

/* An output that is written. */
void cts_log_output(CtsLog *log, const char *path, const char *format, uint64_t bytes);
/* Stages, skipped work, voxel counts and measured error. */
void cts_log_report(CtsLog *log, const CtsReport *report);
/* The last line of a run that came to its end. n_threads as asked for, 0: as many as there are. */
void cts_log_done(CtsLog *log, int n_threads);
/* Append all lines and close. */
CtsStatus cts_log_close(CtsLog **log, CtsError *err);

#endif
