/* A series of the batch as render jobs: one volume for all its pictures. */
#ifndef CTS_BATCH_WORK_H
#define CTS_BATCH_WORK_H

#include "batch/batch.h"
#include "job/job.h"

/* What all pictures of a batch share. */
typedef struct CtsBatchJob {
    CtsJob job; /* but for preset, view, paths and threads, which the batch fills in */
    CtsSwitch remove_table;
    const CtsBatchSettings *settings;
    const char *log;     /* timing log to append to, or NULL */
    void (*begin)(void); /* called in the process of the series, before all else; may be NULL */
} CtsBatchJob;

/* A CtsBatchWork with a CtsBatchJob as its context. */
CtsStatus cts_batch_render(void *context, const CtsBatchTask *task, CtsError *err);

/* All that can be refused before any series is read. */
CtsStatus cts_batch_check(const CtsBatchJob *job, CtsReport *report, CtsError *err);

#endif
