/* Objects encoded by DCMTK, in the program ctsplat-dicom. The functions throw as cts_dcm_check() does. */
#pragma once

#include "dicom/dcmtk/dcmtk_failures.hpp"
#include "dicom/header/elements.h"
#include "dicom/header/header_answer.h"

#include <dcmtk/config/osconfig.h>
#include <dcmtk/dcmdata/dctk.h>

/* Encodes an object of these attributes, and of the patient and study of the source, into at most n bytes; returns the
 * number of bytes, or more than n where they do not fit. */
size_t cts_dcm_write(DcmItem &source, const CtsReaderOrder &order, CtsElements attributes, uint8_t *bytes, size_t n);

/* Copies patient and study, or leaves what is required of them empty; and the side of the body part. */
void cts_dcm_copy_study(DcmItem &to, DcmItem &source, bool deidentified);
void cts_dcm_copy_side(DcmItem &to, DcmItem &source);

/* Copies an element with its value bytes, without private elements in it; filled: nothing where it has no value. */
void cts_dcm_copy(DcmItem &to, DcmElement &element, bool filled);
