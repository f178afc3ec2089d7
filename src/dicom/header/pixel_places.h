/* Offsets of the frames' pixels in the file. */
#pragma once

#include "base/file_bytes.h"
#include "dicom/header/slice.h"

CTS_C_BEGIN

/* n frames' places among the fragments of the value at pixel_offset: those of frame k lie between offset[k] and
 * offset[k + 1], each with the 8 bytes of its item. n + 1 numbers, for cts_free(). */
CtsStatus cts_find_frames(const CtsFileBytes *file, uint64_t pixel_offset, int n, uint64_t **offset, CtsError *err);

/* For the n frames of one object, in order, whose pixel_offset and pixel_bytes are those of the whole value of
 * PixelData: sets them to each frame's own. Sets a fault where the bytes do not contain the frames, or the first
 * fragment of each frame is unknown. */
CtsStatus cts_place_fragments(const CtsFileBytes *file, CtsSlice *const *frames, int n, CtsError *err);

CTS_C_END
