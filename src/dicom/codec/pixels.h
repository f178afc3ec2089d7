/* The stored words of a slice. */
#ifndef CTS_DICOM_PIXELS_H
#define CTS_DICOM_PIXELS_H

#include "base/file_bytes.h"
#include "dicom/codec/codec.h"
#include "dicom/header/slice.h"

/* Its pixels come from a codec or are deflated. */
bool cts_slice_is_compressed(const CtsSlice *slice);

/* Words first <= n < end of a slice are there, from `at` on: in their own place, or with a decoder, in reach of this
 * call alone. They are in the cache. */
typedef void (*cts_words_ready_fn)(void *context, const uint16_t *at, size_t first, size_t end);

/* The stored words of a slice without fault, as the file has them but in this machine's byte order and widened to 16
 * bits: rows * columns words, not yet masked or rescaled. They come in parts, in order; ready() is called after each
 * and writes into their place what it makes of them. Fails with a message that has no path in it. */
CtsStatus cts_slice_read_pixels(const CtsSlice *slice, CtsSandbox **decoder, uint16_t *words, cts_words_ready_fn ready,
                                void *context, CtsError *err);

/* Read a compressed slice and hand it to the thread's decoder, which may still be at work at the one before. Whether
 * that was done; if so, its pixels are to be read before those of any other slice that is not under way already. What
 * fails here fails again, and says why, when they are. */
bool cts_slice_begin(const CtsSlice *slice, CtsSandbox **decoder);

/* Reads a frame's fragments, or a deflated data set whole, and hands the stream to a sandbox of cts_codec_work(). */
CtsStatus cts_codec_submit(CtsSandbox *decoder, const CtsFrameFormat *format, const CtsFileBytes *file, uint64_t offset,
                           uint64_t end, CtsError *err);

#endif
