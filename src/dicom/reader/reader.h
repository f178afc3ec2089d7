/* The reader: a program of its own (base/sandbox.h), the only place where bytes of DICOM headers are interpreted. DCMTK
 * reads them, behind a check of their framing (dicom/parser/tag_scan.h). No DCMTK type and no exception crosses this
 * interface. */
#pragma once

#include "dicom/header/header_answer.h"

CTS_C_BEGIN

/* Makes DCMTK ready: no log, the dictionary of this program alone. */
CtsStatus cts_reader_prepare(CtsError *err);

/* Reads the headers of one message (dicom/header/header_answer.h) in an isolated process. */
CtsStatus cts_reader_headers(const void *order, const uint8_t *stream, size_t n, void *answer, size_t n_answer,
                             CtsError *err);

CTS_C_END
