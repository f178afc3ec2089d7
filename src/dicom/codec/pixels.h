/* Reading the stored words of a slice. */
#pragma once

#include "base/file_bytes.h"
#include "ctsplat/picture.h"
#include "dicom/header/slice.h"
#include "dicom/protocol/pixel_sandbox.h"

/* True if the pixels are encoded by a codec or deflated. */
bool cts_slice_is_compressed(const CtsSlice *slice);

/* Called when words first <= n < end of a slice are available at `at`: in their final place, or, with a decoder, in
 * memory valid during this call. They are in the cache. */
typedef void (*cts_words_ready_fn)(void *context, const uint16_t *at, size_t first, size_t end);

/* The middle frame of a slice's object as DCMTK shows it: by its window or LUT, in colour or grey, with square pixels,
 * at most width x height of them, without an alpha channel. A smaller image keeps its size. CTS_ERR_PIXELS, with the
 * reason, where it cannot be shown. */
CtsStatus cts_slice_picture(const CtsSlice *slice, int width, int height, CtsPicture **picture, CtsError *err);

/* Reads the stored words of a slice without fault, in native byte order and widened to 16 bits: rows * columns words,
 * not yet masked or rescaled. They come in parts, in order; ready() is called after each and writes its result in their
 * place. Error messages contain no path. */
CtsStatus cts_slice_read_pixels(const CtsSlice *slice, CtsSandbox **decoder, uint16_t *words, cts_words_ready_fn ready,
                                void *context, CtsError *err);

/* Reads a compressed slice and passes it to the thread's decoder, which may still be processing the one before. If
 * true, its pixels must be read before those of any slice that was not begun. A failure here occurs again, with a
 * message, when they are read. */
bool cts_slice_begin(const CtsSlice *slice, CtsSandbox **decoder);

/* A decoder without a process yet. */
CtsSandbox cts_codec_make(void);

/* Reads a frame's fragments, or a deflated data set whole, and hands them to a decoder. */
CtsStatus cts_codec_submit(CtsSandbox *decoder, const CtsFrameFormat *format, const CtsFileBytes *file, uint64_t offset,
                           uint64_t end, CtsError *err);
