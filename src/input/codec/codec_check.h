/* A compressed stream looked over before a decoder sees it: DCMTK 3.6.7 loops for ever on some, overruns on others. */
#ifndef CTS_DICOM_CODEC_CHECK_H
#define CTS_DICOM_CODEC_CHECK_H

#include "ctsplat/status.h"
#include <stddef.h>
#include <stdint.h>

/* What the header says of the frame. */
typedef struct CtsCodecFrame {
    int columns, rows, bits_allocated, n_samples;
    int precision; /* what a JPEG stream says of itself; else 0 */
} CtsCodecFrame;

/* One frame's joined fragments, looked over as a JPEG or JPEG-LS stream, or as an RLE one. CTS_ERR_PIXELS when its size
 * and precision are not the header's, or its markers or offsets are damaged. */
CtsStatus cts_codec_check_jpeg(CtsCodecFrame *frame, const uint8_t *stream, size_t n, CtsError *err);
CtsStatus cts_codec_check_rle(CtsCodecFrame *frame, const uint8_t *stream, size_t n, CtsError *err);

#endif
