#define _GNU_SOURCE
#include "dicom/codec_check.h"
#include "dicom/dcm_read.h"
#include "dicom/file_bytes.h"
#include "dicom/slice.h"

/* What is read at a time, so that it is still in the nearest caches when it is looked at. */
enum { PART_BYTES = 64 << 10 };

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

/* Bytes first <= i < end of the frame become words; first is even. */
static void widen(const CtsSlice *s, const uint8_t *bytes, uint16_t *words, size_t first, size_t end)
{
    if (s->syntax->big_endian && (s->bits_allocated == 16 || s->pixel_words))
        swap_pairs((uint8_t *)(uintptr_t)bytes + first, end - first);
    if (s->bits_allocated == 8)
        for (size_t i = first; i < end; i++)
            words[i] = bytes[i];
}

CtsStatus cts_slice_read_pixels(const CtsSlice *s, CtsScratch *scratch, uint16_t *words, cts_words_ready_fn ready,
                                void *context, CtsError *err)
{
    const size_t n = (size_t)s->rows * (size_t)s->columns, word_bytes = (size_t)(s->bits_allocated / 8);
    const size_t frame_bytes = n * word_bytes;
    /* 8-bit pixels are read into the upper half of their place and widened forwards. */
    uint8_t *bytes = (uint8_t *)words + (2 * n - frame_bytes);
    const bool plain = !cts_syntax_encapsulated(s->syntax) && !s->syntax->deflated;
    const size_t part = plain ? PART_BYTES : frame_bytes;
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
    for (size_t first = 0; !st && first < frame_bytes; first += part) {
        const size_t end = frame_bytes - first < part ? frame_bytes : first + part;
        if (plain)
            st = cts_file_bytes_read(&file, bytes + first, end - first, s->pixel_offset + first, err);
        if (st)
            break;
        widen(s, bytes, words, first, end);
        ready(context, first / word_bytes, end / word_bytes);
    }
    cts_file_bytes_close(&file);
    return st;
}
