#define _GNU_SOURCE
#include "dicom/codec_check.h"
#include "dicom/dcm_read.h"
#include "dicom/file_bytes.h"
#include "dicom/slice.h"

static CtsStatus read_deflated(const CtsSlice *s, const CtsFileBytes *file, CtsScratch *scratch, uint8_t *bytes,
                               size_t n, CtsError *err)
{
    const size_t n_deflated = (size_t)(s->file_bytes - s->data_offset);
    size_t got = 0;
    CtsStatus st = cts_bytes_reserve(&scratch->file, &scratch->file_capacity, n_deflated, err);
    if (!st)
        st = cts_file_bytes_read(file, scratch->file, n_deflated, s->data_offset, err);
    if (!st)
        st = cts_inflate(scratch->file, n_deflated, s->pixel_offset, bytes, n, &got, err);
    if (!st && got < n)
        st = cts_fail(err, CTS_ERR_PIXELS, "truncated: PixelData needs %zu bytes, %zu left", n, got);
    return st;
}

/* Only the part of the file from the data set to the end of PixelData reaches the decoder. */
static CtsStatus read_compressed(const CtsSlice *s, const CtsFileBytes *file, CtsScratch *scratch, void *bytes,
                                 CtsError *err)
{
    const uint64_t offset = s->pixel_offset - s->data_offset;
    const size_t n = (size_t)(offset + s->pixel_bytes);
    const CtsCodecFrame frame = {s->syntax->codec, s->columns, s->rows, s->bits_allocated, 1, 1};
    CtsStatus st = cts_bytes_reserve(&scratch->file, &scratch->file_capacity, n, err);
    if (!st)
        st = cts_file_bytes_read(file, scratch->file, n, s->data_offset, err);
    if (!st)
        st = cts_codec_check(&frame, scratch->file + offset, (size_t)s->pixel_bytes, err);
    if (!st)
        st = cts_dcm_decode(scratch->file, n, s, bytes, err);
    return st;
}

static void swap_pairs(uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i + 1 < n; i += 2) {
        const uint8_t first = bytes[i];
        bytes[i] = bytes[i + 1];
        bytes[i + 1] = first;
    }
}

CtsStatus cts_slice_read_pixels(const CtsSlice *s, CtsScratch *scratch, uint16_t *words, CtsError *err)
{
    const size_t n = (size_t)s->rows * (size_t)s->columns;
    const size_t frame_bytes = n * (size_t)(s->bits_allocated / 8);
    /* 8-bit pixels are read into the upper half of their place and widened forwards. */
    uint8_t *bytes = (uint8_t *)words + (2 * n - frame_bytes);
    CtsFileBytes file;
    CtsStatus st = cts_file_bytes_open(&file, s->path, err);
    if (!st && file.fd < 0)
        st = cts_fail(err, CTS_ERR_READ, "is no file any more");
    if (!st && (file.n_bytes != s->file_bytes || file.mtime_ns != s->mtime_ns))
        st = cts_fail(err, CTS_ERR_READ, "changed while it was being read (wait until it is complete)");
    if (!st && cts_syntax_encapsulated(s->syntax))
        st = read_compressed(s, &file, scratch, bytes, err);
    else if (!st && s->syntax->deflated)
        st = read_deflated(s, &file, scratch, bytes, frame_bytes, err);
    else if (!st)
        st = cts_file_bytes_read(&file, bytes, frame_bytes, s->pixel_offset, err);
    cts_file_bytes_close(&file);
    if (st)
        return st;
    if (s->syntax->big_endian && (s->bits_allocated == 16 || s->pixel_words))
        swap_pairs(bytes, frame_bytes);
    if (s->bits_allocated == 8)
        for (size_t i = 0; i < n; i++)
            words[i] = bytes[i];
    return CTS_OK;
}
