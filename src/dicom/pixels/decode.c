#include "dicom/pixels/pixel_tasks.h"

#include "base/bytes.h"
#include "base/file_bytes.h"
#include <stdlib.h>
#include <string.h>

enum { ITEM_BYTES = 8 }; /* tag and length in front of a fragment */

/* A single frame, or a part of a deflated data set. */
static CtsStatus inflate_frame(const CtsFrameFormat *f, const uint8_t *stream, size_t n, void *pixels, CtsError *err)
{
    size_t got = 0;
    const uint64_t n_before = f->syntax->deflated ? f->n_before : 0;
    const CtsStatus st = cts_inflate(stream, n, n_before, pixels, cts_frame_bytes(f), &got, err);
    if (!st && got < cts_frame_bytes(f))
        return cts_fail(err, CTS_ERR_PIXELS, "truncated: PixelData needs %zu bytes, %zu left", cts_frame_bytes(f), got);
    return st;
}

/* A frame of odd length is padded to an even one. */
static CtsStatus copy_frame(const CtsFrameFormat *f, const uint8_t *stream, size_t n, void *pixels, CtsError *err)
{
    const size_t need = cts_frame_bytes(f);
    if (n < need || n > need + 1)
        return cts_fail(err, CTS_ERR_PIXELS, "a frame of PixelData needs %zu bytes, and its fragments hold %zu", need,
                        n);
    memcpy(pixels, stream, need);
    return CTS_OK;
}

/* By CtsCodec. A stream that fails the check never reaches the decoder. */
static const struct {
    CtsStatus (*check)(CtsCodecFrame *frame, const uint8_t *stream, size_t n, CtsError *err);
    cts_decode_fn decode;
} codecs[CTS_N_CODECS] = {
    [CTS_CODEC_NATIVE] = {NULL, inflate_frame}, /* compressed only as part of a deflated data set */
    [CTS_CODEC_RLE] = {cts_codec_check_rle, cts_dcm_decode},
    [CTS_CODEC_JPEG] = {cts_codec_check_jpeg, cts_dcm_decode},
    [CTS_CODEC_JPEG_LS] = {cts_codec_check_jpeg, cts_dcm_decode},
    [CTS_CODEC_DEFLATE] = {NULL, inflate_frame},
    [CTS_CODEC_COPY] = {NULL, copy_frame},
    /* OpenJPEG checks the stream's dimensions before it decodes */
    [CTS_CODEC_JPEG_2000] = {NULL, cts_jpeg2000_decode},
};

/* If the stream has more significant bits than the header states, and its precision is not a whole number of bytes,
 * these bits belong to the number and the header would misread it. With all 16 bits they may be an overlay. */
static CtsStatus check_words(const CtsFrameFormat *f, int precision, const uint16_t *words, CtsError *err)
{
    const size_t n = (size_t)f->columns * (size_t)f->rows;
    if (f->bits_allocated != 16 || f->is_signed || precision <= f->bits_stored || precision == 16 ||
        f->high_bit != f->bits_stored - 1)
        return CTS_OK;
    for (size_t i = 0; i < n; i++)
        if (words[i] >> f->bits_stored && words[i] != f->padding_word)
            return cts_fail(err, CTS_ERR_PIXELS,
                            "its JPEG stream (%d bits) holds %d, which the header (%d bits) reads as another number",
                            precision, words[i], f->bits_stored);
    return CTS_OK;
}

CtsStatus cts_codec_decode(const CtsFrameFormat *f, const uint8_t *stream, size_t n, void *pixels, CtsError *err)
{
    const CtsCodec codec = f->syntax->codec;
    CtsCodecFrame frame = {f->columns, f->rows, f->bits_allocated, f->n_colours > 0 ? f->n_colours : 1, 0};
    if (!codecs[codec].decode)
        return cts_fail(err, CTS_ERR_SYNTAX, "transfer syntax %s cannot be decoded by this build", f->syntax->uid);
    CtsStatus st = codecs[codec].check ? codecs[codec].check(&frame, stream, n, err) : CTS_OK;
    if (!st)
        st = codecs[codec].decode(f, stream, n, pixels, err);
    return st ? st : check_words(f, frame.precision, pixels, err);
}

/* The fragment at pos, behind its item header. */
static bool next_fragment(const uint8_t *stream, size_t n, size_t *pos, size_t *length)
{
    *length = n - *pos < ITEM_BYTES ? SIZE_MAX : cts_little32(stream + *pos + 4);
    *pos += ITEM_BYTES;
    return *pos <= n && *length <= n - *pos;
}

/* Finds the only fragment of a frame, as most have, or joins several in *joined. */
static CtsStatus join_fragments(const uint8_t **stream, size_t *n, uint8_t **joined, CtsError *err)
{
    size_t pos = 0, length, n_joined = 0;
    while (next_fragment(*stream, *n, &pos, &length)) {
        const bool last = pos + length == *n, only = last && n_joined == 0;
        if (!only && !*joined && !(*joined = malloc(*n)))
            return cts_fail(err, CTS_ERR_MEMORY, "out of memory");
        if (!only)
            memcpy(*joined + n_joined, *stream + pos, length);
        n_joined += length;
        if (last) {
            *stream = only ? *stream + pos : *joined;
            *n = n_joined;
            return CTS_OK;
        }
        pos += length;
    }
    return cts_fail(err, CTS_ERR_READ, "changed while it was being read (wait until it is complete)");
}

CtsStatus cts_pixels_decode(const void *order, const uint8_t *stream, size_t n, void *pixels, size_t n_pixels,
                            CtsError *err)
{
    CtsFrameOrder o;
    memcpy(&o, order, sizeof o);
    o.format.syntax = cts_syntax_by_number(o.syntax_number);
    if (n_pixels < cts_frame_bytes(&o.format))
        return cts_fail(err, CTS_ERR_INTERNAL, "its frame has no room");
    uint8_t *joined = NULL;
    CtsStatus st = o.format.syntax->deflated ? CTS_OK : join_fragments(&stream, &n, &joined, err);
    if (!st)
        st = cts_codec_decode(&o.format, stream, n, pixels, err);
    free(joined);
    return st;
}
