/* The values of DICOM headers, and the C door to DCMTK for what reading asks of it. Nothing of DCMTK comes through, no
 * exception either. All calls are thread-safe. */
#ifndef CTS_DICOM_DCM_READ_H
#define CTS_DICOM_DCM_READ_H

#include "ctsplat/status.h"
#include "dicom/header/slice.h"
#include "dicom/parser/tag_scan.h"
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* Before any other use of DCMTK, by whoever uses it: its log goes to a counter instead of stderr, the decoders are
 * registered, the data dictionary is loaded, which takes several ms. Later calls return the first one's result. */
CtsStatus cts_dcm_start(CtsError *err);
/* The same without the dictionary, which decoders do not need. */
CtsStatus cts_dcm_start_decoders(CtsError *err);

/* A data set in memory up to its pixels, encoded as `native` (an uncompressed syntax), and what cts_scan_data() found
 * in it. */
typedef struct CtsDataSet {
    const uint8_t *bytes;
    size_t n;
    const CtsDataScan *scan;
    const CtsSyntax *native;
} CtsDataSet;

/* What it describes, into a zeroed object whose texts are kept in texts: of each slice all but path, file facts,
 * syntax, odd syntax flags and the place of the pixels, which the caller knows. class_uid: what the meta header tells,
 * where the data set does not. A slice whose values cannot be used is a success with slice->fault set; so is an object
 * with many frames that cannot be used at all, of one slice. DCMTK is not asked. */
CtsStatus cts_dcm_read_object(const CtsDataSet *data_set, CtsTexts *texts, const char *class_uid, CtsObject *object,
                              CtsError *err);

/* The SOP class by a name that people know, such as "MR Image". Cut to its size. */
void cts_dcm_class_name(const char *class_uid, char *text, size_t size);

/* Text in a DICOM character set (0008,0005; NULL: ASCII) as UTF-8, at most 64 characters, controls replaced by '?'.
 * What cannot be converted becomes '?' too. NULL without memory. */
char *cts_dcm_utf8(const char *text, const char *charset);
/* The same by DCMTK, of any length and with all that is in it; NULL when it cannot, too. Free with free(). */
char *cts_dcm_convert(const char *text, const char *charset);

CTS_C_END
#endif
