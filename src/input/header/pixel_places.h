/* Where in its file each frame's pixels lie. */
#ifndef CTS_DICOM_PIXEL_PLACES_H
#define CTS_DICOM_PIXEL_PLACES_H

#include "input/files/file_bytes.h"
#include "input/header/slice.h"

/* n frames' places among the fragments of the value at pixel_offset: those of frame k lie between offset[k] and
 * offset[k + 1], each with the 8 bytes of its item. n + 1 numbers, for cts_free(). */
CtsStatus cts_find_frames(const CtsFileBytes *file, uint64_t pixel_offset, int n, uint64_t **offset, CtsError *err);

/* For the n frames of one object, in order, whose pixel_offset and pixel_bytes still are those of the whole value of
 * PixelData: set them to each frame's own. A fault where the bytes do not hold the frames, or do not tell which
 * fragment begins which frame. */
CtsStatus cts_place_fragments(const CtsFileBytes *file, CtsSlice *const *frames, int n, CtsError *err);
void cts_place_native(const CtsFileBytes *file, CtsSlice *const *frames, int n);

#endif
