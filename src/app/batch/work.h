/* A series of the batch as render jobs: one volume for all its pictures. */
#ifndef CTS_BATCH_WORK_H
#define CTS_BATCH_WORK_H

#include "app/batch/child.h"

/* Starts a process for the series with this many threads. *socket is the parent's end; non-blocking. */
CtsStatus cts_work_start(const CtsBatchSettings *settings, CtsJournal *journal, const CtsArchives *archives,
                         const CtsPlanSeries *series, int n_threads, pid_t *pid, int *socket, CtsError *err);

#endif
