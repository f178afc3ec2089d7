/* Callbacks for the progress and the results of a job. Each may be NULL; a status that one returns is the job's. */
#pragma once

#include "ctsplat/picture.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include <stdint.h>

typedef struct CtsWatch {
    void *context;
    /* Progress: done of all steps, with fractions; what describes the current step. With this callback pictures are
     * rendered in bands low enough to show the progress. */
    void (*step)(void *context, double done, int all, const char *what);
    /* The report may hold findings that it did not hold before. */
    void (*diagnostics)(void *context, const CtsReport *report);
    /* The series found, before any of it is read. */
    void (*found)(void *context, const CtsSeriesList *list);
    /* The volume is read: from here on the job checks its settings' stop flag. */
    void (*loaded)(void *context);
    /* Rows of a frame as they are written. In a job without outputs the callback may take the band's contents. */
    CtsStatus (*band)(void *context, int frame, CtsPicture *band, CtsError *err);
    /* A file is complete. frame: of a rotation with a file for each, else -1. */
    CtsStatus (*output)(void *context, int frame, const char *path, const char *format, uint64_t bytes, CtsError *err);
    /* A frame is complete, with the files that end with it; bound: of its error. */
    CtsStatus (*frame)(void *context, const CtsErrorBound *bound, CtsError *err);
} CtsWatch;

static inline void cts_watch_step(const CtsWatch *watch, double done, int all, const char *what)
{
    if (watch->step)
        watch->step(watch->context, done, all, what);
}

static inline void cts_watch_diagnostics(const CtsWatch *watch, const CtsReport *report)
{
    if (watch->diagnostics)
        watch->diagnostics(watch->context, report);
}
