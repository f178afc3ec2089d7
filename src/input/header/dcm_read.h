/* The C door to DCMTK for reading. Nothing of DCMTK comes through, no exception either. All calls are thread-safe. */
#ifndef CTS_DICOM_DCM_READ_H
#define CTS_DICOM_DCM_READ_H

#include "ctsplat/status.h"
#include "input/files/tag_scan.h"
#include "input/header/slice.h"
#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Before any other use of DCMTK, by whoever uses it: its log goes to a counter instead of stderr, the decoders are
 * registered, the data dictionary is loaded, which takes several ms. Later calls return the first one's result. */
CtsStatus cts_dcm_start(CtsError *err);
/* The same without the dictionary, which decoders do not need. */
CtsStatus cts_dcm_start_decoders(CtsError *err);

/* Read the attributes of a data set that ends before its pixels, encoded as `native` (an uncompressed syntax), into
 * slice, its texts into texts: all but path, file facts, syntax, odd syntax flags and the place of the pixels, which
 * the caller knows. class_uid is the SOP class that the meta header tells, and becomes the data set's own where that
 * has one. scan is what cts_scan_data() found; where that says all, DCMTK is not asked. Fails with CTS_ERR_READ when
 * DCMTK cannot parse it; a CT slice whose values cannot be used is a success with slice->fault set. Of an object with
 * many frames only its kind is told; its slices come from cts_dcm_read_frames(). */
CtsStatus cts_dcm_read_header(const uint8_t *data_set, size_t n, const CtsDataScan *scan, const CtsSyntax *native,
                              CtsTexts *texts, char class_uid[65], CtsSlice *slice, CtsError *err);

/* What cts_dcm_read_header() asks DCMTK. */
CtsStatus cts_dcm_parse_header(const uint8_t *data_set, size_t n, const CtsSyntax *native, CtsTexts *texts,
                               char class_uid[65], CtsSlice *slice, CtsError *err);

/* The frames of an Enhanced CT or Legacy Converted Enhanced CT object: slices by their functional groups, each frame's
 * own before the shared ones. As cts_dcm_read_header(), one slice a frame, in the order of the pixels; free each and
 * the array with cts_slice_free(). What cannot be used at all is one slice with a fault. */
CtsStatus cts_dcm_read_frames(const uint8_t *data_set, size_t n, const CtsSyntax *native, CtsTexts *texts,
                              CtsSlice ***frames, int *n_frames, CtsError *err);

/* The files a DICOMDIR's records name, relative to its folder, '/' between the parts; only names made of plain parts
 * (no "..", no slash). Free each and the array with free(). */
CtsStatus cts_dcm_directory(const uint8_t *data_set, size_t n, const CtsSyntax *native, char ***files, size_t *n_files,
                            size_t *n_refused, CtsError *err);

/* The SOP class by a name that people know, such as "MR Image". Cut to its size. */
void cts_dcm_class_name(const char *class_uid, char *text, size_t size);

/* Text in a DICOM character set (0008,0005; NULL: ASCII) as UTF-8, at most 64 characters, controls replaced by '?'.
 * What cannot be converted becomes '?' too. NULL without memory. */
char *cts_dcm_utf8(const char *text, const char *charset);
/* The same by DCMTK, of any length and with all that is in it; NULL when it cannot, too. Free with free(). */
char *cts_dcm_convert(const char *text, const char *charset);

/* A decimal string (DS, PS3.5 6.2) of exactly n_values numbers: whole text, finite, '.' as the decimal point whatever
 * the locale. More than 16 bytes a value, blanks around it and a sign are accepted. */
int cts_dcm_parse_ds(const char *text, size_t n_bytes, double *values, int n_values);
/* An integer string (IS). */
int cts_dcm_parse_is(const char *text, size_t n_bytes, int *value);

#ifdef __cplusplus
}
#endif
#endif
