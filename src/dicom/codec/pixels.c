#include "dicom/codec/pixels.h"

#include <string.h>

/* Size of reads, small enough that the data are still in the L2 cache when they are processed. */
enum { PART_BYTES = 64 << 10 };

CtsSandbox cts_codec_make(void)
{
    return cts_sandbox_make(CTS_PIXELS_PROGRAM, CTS_PIXELS_DECODE, "decoder");
}

/* Bytes for a frame: DCMTK needs an even number. */
static size_t room_for(const CtsFrameFormat *format)
{
    return cts_frame_bytes(format) + 1;
}

CtsStatus cts_codec_submit(CtsSandbox *decoder, const CtsFrameFormat *format, const CtsFileBytes *file, uint64_t offset,
                           uint64_t end, CtsError *err)
{
    const size_t n = (size_t)(end - offset);
    const CtsFrameOrder order = {*format, cts_syntax_number(format->syntax)};
    uint8_t *stream;
    CtsStatus st = cts_sandbox_room(decoder, n, room_for(format), &stream, err);
    if (!st && !(st = cts_file_bytes_read(file, stream, n, offset, err)))
        cts_sandbox_send(decoder, &order, sizeof order, stream, n, room_for(format));
    return st;
}

/* The decoder's input: the frame's fragments, or the whole of a deflated data set. */
static void find_stream(const CtsSlice *s, uint64_t *offset, uint64_t *n)
{
    *offset = s->syntax->deflated ? s->data_offset : s->pixel_offset;
    *n = s->syntax->deflated ? s->file_bytes - s->data_offset : s->pixel_bytes;
}

/* Hand the slice to its decoder. Only where it fits. */
static CtsStatus submit(const CtsSlice *s, const CtsFrameFormat *format, CtsSandbox *decoder, CtsError *err)
{
    uint64_t offset, n;
    CtsFileBytes file;
    find_stream(s, &offset, &n);
    CtsStatus st = cts_slice_open(s, &file, err);
    if (!st)
        st = cts_codec_submit(decoder, format, &file, offset, offset + n, err);
    cts_file_bytes_close(&file);
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

static CtsStatus new_decoder(CtsSandbox **decoder, CtsError *err)
{
    return cts_sandbox_new(decoder, CTS_PIXELS_PROGRAM, CTS_PIXELS_DECODE, "decoder", CTS_SANDBOX_SLOTS, err);
}

bool cts_slice_begin(const CtsSlice *s, CtsSandbox **decoder)
{
    uint64_t offset, n;
    const CtsFrameFormat format = format_of(s);
    find_stream(s, &offset, &n);
    return cts_slice_is_compressed(s) && !new_decoder(decoder, NULL) &&
           cts_sandbox_fits(*decoder, (size_t)n, room_for(&format)) && !submit(s, &format, *decoder, NULL);
}

static CtsStatus decode(const CtsSlice *s, CtsSandbox **decoder, const void **pixels, CtsError *err)
{
    const CtsFrameFormat format = format_of(s);
    CtsStatus st = new_decoder(decoder, err);
    if (!st && (*decoder)->n_jobs == 0)
        st = submit(s, &format, *decoder, err);
    return st ? st : cts_sandbox_take(*decoder, pixels, err);
}

static void swap_pairs(uint8_t *bytes, size_t n)
{
    for (size_t i = 0; i + 1 < n; i += 2) {
        const uint8_t first = bytes[i];
        bytes[i] = bytes[i + 1];
        bytes[i + 1] = first;
    }
}

/* Bytes first <= i < end of its frame, in the file's byte order, become 16-bit words in native order; first is even.
 * bytes and words may be the same memory. */
static void widen(const CtsSlice *s, uint8_t *bytes, uint16_t *words, size_t first, size_t end)
{
    if (s->syntax->big_endian && (s->bits_allocated == 16 || s->pixel_words))
        swap_pairs(bytes + first, end - first);
    if (s->bits_allocated == 8)
        for (size_t i = first; i < end; i++)
            words[i] = bytes[i];
}

CtsStatus cts_slice_read_pixels(const CtsSlice *s, CtsSandbox **decoder, uint16_t *words, cts_words_ready_fn ready,
                                void *context, CtsError *err)
{
    const size_t n = (size_t)s->rows * (size_t)s->columns, word_bytes = (size_t)(s->bits_allocated / 8);
    const size_t frame_bytes = n * word_bytes;
    /* 8-bit pixels are read into the upper half of their place and widened forwards. */
    uint8_t *bytes = (uint8_t *)words + (2 * n - frame_bytes);
    const void *decoded = NULL; /* else the pixels are read as they are */
    CtsFileBytes file = {.fd = -1};
    CtsStatus st = cts_slice_is_compressed(s) ? decode(s, decoder, &decoded, err) : cts_slice_open(s, &file, err);
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
