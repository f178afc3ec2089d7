/* A series of the batch as render jobs: one volume for all its pictures. */
#ifndef CTS_BATCH_WORK_H
#define CTS_BATCH_WORK_H

#include "app/batch/batch.h"
#include "ctsplat/net.h"
#include "app/job/render_job.h"

/* What all pictures of a batch share. */
typedef struct CtsBatchJob {
    CtsJob job; /* but for preset, view, paths and threads, which the batch fills in */
    const CtsBatchSettings *settings;
    const char *log;     /* timing log to append to, or NULL */
    const char *command; /* as the log has it */
    const CtsPeer *peer; /* the PACS that captures go to, and how */
    const CtsNet *net;
} CtsBatchJob;

/* A CtsBatchWork with a CtsBatchJob as its context. */
CtsStatus cts_batch_render(void *context, const CtsBatchTask *task, CtsError *err);

/* A CtsBatchSend with the same context. */
CtsStatus cts_batch_send(void *context, const char *const *paths, int n,
                         void (*sent)(void *sent_context, const char *path), void *sent_context, CtsError *err);

/* All that can be refused before any series is read. */
CtsStatus cts_batch_check(const CtsBatchJob *job, CtsReport *report, CtsError *err);

#endif
