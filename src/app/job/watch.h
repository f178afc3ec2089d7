/* What whoever runs a job may want to see while it goes on. Any function may be NULL; none may fail the job. */
#ifndef CTS_JOB_WATCH_H
#define CTS_JOB_WATCH_H

#include "ctsplat/picture.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include <stdint.h>

typedef struct CtsWatch {
    void *context;
    /* Step done of all is at hand, or a part of it behind: what says what happens in it. A picture is then made in
     * bands low enough to tell how far it is. */
    void (*step)(void *context, double done, int all, const char *what);
    /* The report may hold findings that it did not hold before. */
    void (*findings)(void *context, const CtsReport *report);
    /* What was found, before any of it is read. */
    void (*found)(void *context, const CtsSeriesList *list);
    /* The volume is read: from here on the job looks at its settings' stop flag. */
    void (*loaded)(void *context);
    /* Rows of a frame as they go into the files. Of a job without outputs it may take what the band holds. */
    void (*band)(void *context, int frame, CtsPicture *band);
    /* A file stands, whole. */
    void (*output)(void *context, const char *path, const char *format, uint64_t bytes);
} CtsWatch;

static inline void cts_watch_step(const CtsWatch *watch, double done, int all, const char *what)
{
    if (watch->step)
        watch->step(watch->context, done, all, what);
}

static inline void cts_watch_findings(const CtsWatch *watch, const CtsReport *report)
{
    if (watch->findings)
        watch->findings(watch->context, report);
}

#endif
