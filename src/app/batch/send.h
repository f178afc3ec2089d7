/* What a series has and the PACS has not goes there. */
#ifndef CTS_BATCH_SEND_H
#define CTS_BATCH_SEND_H

#include "app/batch/child.h"

/* Starts a process that sends what the line's series has. *socket is the parent's end; non-blocking. */
CtsStatus cts_sender_start(const CtsBatchSettings *settings, CtsJournal *journal, const json_t *line, pid_t *pid,
                           int *socket, CtsError *err);

#endif
