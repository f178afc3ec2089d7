/* The program ctsplat-pixels, sandboxed (base/sandbox_worker.h): codecs, inflate and zip for bytes from outside. */
#pragma once

#include "base/sandbox_worker.h"
#include "ctsplat/status.h"
#include "dicom/protocol/pixel_sandbox.h"

CTS_C_BEGIN

/* Its tasks (CtsPixelsTask), by cts_sandbox_work_fn. */
CtsStatus cts_pixels_decode(const void *order, const uint8_t *stream, size_t n, void *pixels, size_t n_pixels,
                            CtsError *err);
CtsStatus cts_pixels_gunzip(const void *order, const uint8_t *part, size_t n, void *answer, size_t n_answer,
                            CtsError *err);
CtsStatus cts_pixels_unzip(const void *order, const uint8_t *zip, size_t n, void *room, size_t n_room, CtsError *err);
CtsStatus cts_pixels_image(const void *order, const uint8_t *file, size_t n, void *answer, size_t n_answer,
                           CtsError *err);
CtsStatus cts_pixels_encode(const void *order, const uint8_t *samples, size_t n, void *answer, size_t n_answer,
                            CtsError *err);

/* stream: the frame's fragments, joined; for a deflated data set all of it. Writes rows * columns words of
 * bits_allocated bits in native byte order. CTS_ERR_PIXELS when the stream contradicts the header, or the codec fails
 * or warns, since after its warnings the picture has noise. */
typedef CtsStatus (*cts_decode_fn)(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels,
                                   CtsError *err);

/* By the codec of format->syntax. */
CtsStatus cts_codec_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels, CtsError *err);

/* The codecs, each for its own syntaxes: DCMTK's (RLE, JPEG, JPEG-LS; start DCMTK's decoders first) and OpenJPEG. */
CtsStatus cts_dcm_start_decoders(CtsError *err);
/* The same, and the dictionary that data sets without VRs need. */
CtsStatus cts_dcm_start_images(CtsError *err);
CtsStatus cts_dcm_start_encoders(CtsError *err);
CtsStatus cts_dcm_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels, CtsError *err);
CtsStatus cts_jpeg2000_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels,
                              CtsError *err);

CTS_C_END

/* Checks of a compressed stream before decoding: DCMTK 3.6.7 loops for ever on some streams and overruns on others. */

/* The frame by its header. */
typedef struct CtsCodecFrame {
    int columns, rows, bits_allocated, n_samples;
    int precision; /* precision of a JPEG stream by its own header; else 0 */
} CtsCodecFrame;

/* Check one frame's joined fragments as a JPEG or JPEG-LS stream, or as an RLE one. CTS_ERR_PIXELS when size or
 * precision differ from the header's, or markers or offsets are damaged. */
CtsStatus cts_codec_check_jpeg(CtsCodecFrame *frame, const uint8_t *stream, size_t n, CtsError *err);
CtsStatus cts_codec_check_rle(CtsCodecFrame *frame, const uint8_t *stream, size_t n, CtsError *err);
