/* The folder that a batch writes into. */
#ifndef CTS_BATCH_OUT_FOLDER_H
#define CTS_BATCH_OUT_FOLDER_H

#include "app/batch/batch.h"

/* Whether it takes a file at all: else a failure to write is not the series' own. */
CtsStatus cts_folder_probe(const CtsBatchSettings *settings, CtsError *err);

#endif
