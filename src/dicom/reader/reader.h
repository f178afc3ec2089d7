/* The reader: a program of its own (base/sandbox.h), the only place where bytes of DICOM headers are interpreted. DCMTK
 * reads them, behind a check of their framing (dicom/reader/tag_scan.h). No DCMTK type and no exception crosses this
 * interface. */
#pragma once

#include "dicom/header/header_answer.h"

CTS_C_BEGIN

/* Makes DCMTK ready for reading. */
CtsStatus cts_reader_prepare(CtsError *err);

/* All tasks, in an isolated process: reads the headers of one message (dicom/header/header_answer.h), and gives their
 * slices, all elements as records (dicom/header/elements.h), or an object that is written from them (dicom/writer). */
CtsStatus cts_reader_answer(const void *order, const uint8_t *stream, size_t n, void *answer, size_t n_answer,
                            CtsError *err);

/* A decimal string (DS, PS3.5 6.2) of exactly n_values numbers: the whole text, finite, with '.' as the decimal point
 * in any locale. Accepts more than 16 bytes per value, surrounding blanks and a sign. */
bool cts_parse_ds(const char *text, size_t n, double *values, int n_values);
/* An integer string (IS). */
bool cts_parse_is(const char *text, size_t n, int *value);

/* A readable name of the SOP class, such as "MR Image", truncated to size. */
void cts_reader_class_name(const char *class_uid, char *text, size_t size);

CTS_C_END
