#define _GNU_SOURCE
#include "input/codec/decoder.h"
#include "input/files/file_bytes.h"
#include "input/header/slice.h"
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>

/* What is read at a time, so that it is still in the nearest caches when it is looked at. */
enum { PART_BYTES = 64 << 10 };

void cts_scratch_free(CtsScratch *scratch)
{
    free(scratch->file);
    free(scratch->inflated);
    cts_texts_free(&scratch->texts);
    cts_decoder_free(&scratch->decoder);
    cts_decoder_free(&scratch->inflater);
    *scratch = (CtsScratch){0};
}

/* Takes the items' own 8 bytes out from between the fragments; most frames have one fragment, which stays where it is.
 */
static CtsStatus join_fragments(uint8_t **stream, size_t *n, CtsError *err)
{
    uint8_t *const bytes = *stream;
    size_t n_joined = 0, pos = 0;
    while (*n - pos >= 8) {
        const size_t length =
            bytes[pos + 4] | (size_t)bytes[pos + 5] << 8 | (size_t)bytes[pos + 6] << 16 | (size_t)bytes[pos + 7] << 24;
        pos += 8;
        if (length > *n - pos)
            break;
        if (n_joined == 0)
            *stream = bytes + pos;
        else
            memmove(*stream + n_joined, bytes + pos, length);
        n_joined += length;
        pos += length;
    }
    if (pos != *n)
        return cts_fail(err, CTS_ERR_READ, "changed while it was being read (wait until it is complete)");
    *n = n_joined;
    return CTS_OK;
}

/* What a decoder is given: the frame's fragments, or a deflated data set whole. */
static void find_stream(const CtsSlice *s, uint64_t *offset, uint64_t *n)
{
    *offset = s->syntax->deflated ? s->data_offset : s->pixel_offset;
    *n = s->syntax->deflated ? s->file_bytes - s->data_offset : s->pixel_bytes;
}

/* Hand the slice to its decoder. Only where it fits. */
static CtsStatus submit(const CtsSlice *s, const CtsFrameFormat *format, CtsDecoder *decoder, CtsError *err)
{
    uint64_t offset, n_bytes;
    uint8_t *stream;
    CtsFileBytes file;
    find_stream(s, &offset, &n_bytes);
    size_t n = (size_t)n_bytes;
    CtsStatus st = cts_slice_open(s, &file, err);
    if (!st && !(st = cts_decoder_room(decoder, format, n, &stream, err)))
        st = cts_file_bytes_read(&file, stream, n, offset, err);
    cts_file_bytes_close(&file);
    if (!st && !s->syntax->deflated)
        st = join_fragments(&stream, &n, err);
    if (!st)
        cts_decoder_send(decoder, format, stream, n);
    return st;
}

static CtsFrameFormat format_of(const CtsSlice *s)
{
    return (CtsFrameFormat){.syntax = s->syntax,
                            .columns = s->columns,
                            .rows = s->rows,
                            .bits_allocated = s->bits_allocated,
                            .bits_stored = s->bits_stored,
                            .high_bit = s->high_bit,
                            .is_signed = s->is_signed,
                            .padding_word = s->padding_word,
                            .n_before = s->pixel_offset};
}

bool cts_slice_is_compressed(const CtsSlice *s)
{
    return cts_syntax_encapsulated(s->syntax) || s->syntax->deflated;
}

const char *cts_slice_why_slow(const CtsSlice *s)
{
    return s->syntax && s->syntax->codec == CTS_CODEC_HTJ2K ? cts_htj2k_prepare() : NULL;
}

bool cts_slice_begin(const CtsSlice *s, CtsScratch *scratch)
{
    uint64_t offset, n;
    const CtsFrameFormat format = format_of(s);
    find_stream(s, &offset, &n);
    return cts_slice_is_compressed(s) &&
           !cts_decoder_new(&scratch->decoder, cts_codec_decode, CTS_DECODER_SLOTS, NULL) &&
           cts_decoder_fits(scratch->decoder, &format, (size_t)n) && !submit(s, &format, scratch->decoder, NULL);
}

static CtsStatus decode(const CtsSlice *s, CtsScratch *scratch, const void **pixels, CtsError *err)
{
    const CtsFrameFormat format = format_of(s);
    CtsStatus st = cts_decoder_new(&scratch->decoder, cts_codec_decode, CTS_DECODER_SLOTS, err);
    if (!st && scratch->decoder->n_jobs == 0)
        st = submit(s, &format, scratch->decoder, err);
    return st ? st : cts_decoder_take(scratch->decoder, pixels, err);
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

void cts_slice_see_pixels(CtsSlice *s, const uint8_t *pixels)
{
    enum { BLOCK = 1024 };
    const CtsStored stored = cts_slice_stored(s);
    const size_t n = (size_t)s->rows * (size_t)s->columns, word_bytes = (size_t)(s->bits_allocated / 8);
    s->range = (CtsStoredRange){INT32_MAX, INT32_MIN};
    for (size_t first = 0; first < n; first += BLOCK) {
        const size_t part = n - first < BLOCK ? n - first : BLOCK;
        uint16_t words[BLOCK];
        uint8_t bytes[2 * BLOCK];
        memcpy(word_bytes == 1 ? bytes : (uint8_t *)words, pixels + first * word_bytes, part * word_bytes);
        widen(s, word_bytes == 1 ? bytes : (uint8_t *)words, words, 0, part * word_bytes);
        s->range = cts_stored_range_join(s->range, cts_stored_range(words, part, &stored));
    }
    s->range_known = true;
}

CtsStatus cts_slice_open(const CtsSlice *s, CtsFileBytes *file, CtsError *err)
{
    if (s->memory) {
        *file = cts_file_bytes_in_memory(s->memory, s->file_bytes);
        return CTS_OK;
    }
    CtsStatus st = cts_file_bytes_open(file, s->path, err);
    if (!st && file->fd < 0)
        st = cts_fail(err, CTS_ERR_READ, "is no file any more");
    if (!st && (file->n_bytes != s->file_bytes || file->mtime_ns != s->mtime_ns))
        st = cts_fail(err, CTS_ERR_READ, "changed while it was being read (wait until it is complete)");
    return st;
}

CtsStatus cts_slice_read_pixels(const CtsSlice *s, CtsScratch *scratch, uint16_t *words, cts_words_ready_fn ready,
                                void *context, CtsError *err)
{
    const size_t n = (size_t)s->rows * (size_t)s->columns, word_bytes = (size_t)(s->bits_allocated / 8);
    const size_t frame_bytes = n * word_bytes;
    /* 8-bit pixels are read into the upper half of their place and widened forwards. */
    uint8_t *bytes = (uint8_t *)words + (2 * n - frame_bytes);
    const void *decoded = NULL; /* else the pixels are read as they are */
    CtsFileBytes file = {.fd = -1};
    CtsStatus st = cts_slice_is_compressed(s) ? decode(s, scratch, &decoded, err) : cts_slice_open(s, &file, err);
    for (size_t first = 0; !st && first < frame_bytes; first += PART_BYTES) {
        const size_t end = frame_bytes - first < PART_BYTES ? frame_bytes : first + PART_BYTES;
        if (decoded && word_bytes == sizeof *words && !s->syntax->big_endian) {
            ready(context, (const uint16_t *)decoded + first / word_bytes, first / word_bytes, end / word_bytes);
            continue;
        }
        if (decoded)
            memcpy(bytes + first, (const uint8_t *)decoded + first, end - first);
        else
            st = cts_file_bytes_read(&file, bytes + first, end - first, s->pixel_offset + first, err);
        if (st)
            break;
        widen(s, bytes, words, first, end);
        ready(context, words + first / word_bytes, first / word_bytes, end / word_bytes);
    }
    cts_file_bytes_close(&file);
    return st;
}
