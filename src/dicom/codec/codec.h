/* Decoders for one compressed frame. Untrusted bytes reach a codec only here, and only in a sandboxed process
 * (base/sandbox.h), since codecs crash, hang and overrun on damaged streams. */
#pragma once

#include "base/sandbox.h"
#include "ctsplat/status.h"
#include "dicom/parser/syntax.h"
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* Format of one frame by its header: grey pixels, or red, green, blue. */
typedef struct CtsFrameFormat {
    const CtsSyntax *syntax;
    int n_colours; /* samples a pixel, side by side; 0: grey */
    int columns, rows, bits_allocated, bits_stored, high_bit;
    bool is_signed;
    int padding_word;  /* as in CtsSlice */
    uint64_t n_before; /* deflated: bytes of the data set before the pixels */
} CtsFrameFormat;

static inline size_t cts_frame_bytes(const CtsFrameFormat *format)
{
    const size_t n_samples = format->n_colours > 0 ? (size_t)format->n_colours : 1;
    return (size_t)format->columns * (size_t)format->rows * n_samples * (size_t)(format->bits_allocated / 8);
}

/* stream: the frame's fragments, joined; for a deflated data set all of it. Writes rows * columns words of
 * bits_allocated bits in native byte order. CTS_ERR_PIXELS when the stream contradicts the header, or the codec fails
 * or warns, since after its warnings the picture has noise. */
typedef CtsStatus (*cts_decode_fn)(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels,
                                   CtsError *err);

/* By the codec of format->syntax. */
CtsStatus cts_codec_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels, CtsError *err);

/* The codecs, each for its own syntaxes: DCMTK's (RLE, JPEG, JPEG-LS; start DCMTK's decoders first) and OpenJPEG. */
CtsStatus cts_dcm_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels, CtsError *err);
CtsStatus cts_jpeg2000_decode(const CtsFrameFormat *format, const uint8_t *stream, size_t n, void *pixels,
                              CtsError *err);

/* The same as a sandbox's work, whose orders are frame formats; and a sandbox's own functions for a frame, which see to
 * it that the codec's library is there. */
CtsStatus cts_codec_work(const void *format, const uint8_t *stream, size_t n, void *pixels, size_t n_pixels,
                         CtsError *err);
bool cts_codec_fits(CtsSandbox *sandbox, const CtsFrameFormat *format, size_t n);
CtsStatus cts_codec_room(CtsSandbox *sandbox, const CtsFrameFormat *format, size_t n, uint8_t **stream, CtsError *err);
void cts_codec_send(CtsSandbox *sandbox, const CtsFrameFormat *format, const uint8_t *stream, size_t n);

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
