/* Thumbnails for the contact sheet: WebP files of a few KB, scaled down in linear light while a picture's bands come.
 */
#ifndef CTS_THUMBNAIL_H
#define CTS_THUMBNAIL_H

#include "ctsplat/labels.h"
#include "ctsplat/picture.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include <stdint.h>

typedef struct CtsThumbnail CtsThumbnail;

/* The usual longest side in pixels (smaller pictures keep their size), and how many frames of a rotation stand side by
 * side; of a longer rotation every so manieth. */
enum { CTS_THUMBNAIL_SIDE = 240, CTS_THUMBNAIL_FRAMES = 36 };

/* One file that cts_thumbnail_end() wrote: the stem with suffix behind it. */
typedef struct CtsThumbnailFile {
    const char *suffix; /* ".webp": the first frame; "-turn.webp": frames from left to right */
    int n_frames;       /* side by side */
    int width, height;  /* of one frame */
    uint64_t bytes;
} CtsThumbnailFile;
enum { CTS_THUMBNAIL_FILES = 2 };

/* Takes bands as cts_export_rows() does: all of the first frame from the top, then the next frame's. first: the first
 * band, of which no row is taken yet. stem is a path without its ending; its folder must exist; side is the longest in
 * pixels. Serial, and the same picture gives the same bytes. */
CtsStatus cts_thumbnail_begin(CtsThumbnail **thumb, const char *stem, int side, const CtsPicture *first, int n_frames,
                              CtsError *err);
CtsStatus cts_thumbnail_rows(CtsThumbnail *thumb, const CtsPicture *band, CtsError *err);
/* Writes one file, or two of a rotation, each whole or not at all, over what may be there. Makes *thumb NULL, whatever
 * comes of it. */
CtsStatus cts_thumbnail_end(CtsThumbnail **thumb, CtsThumbnailFile files[CTS_THUMBNAIL_FILES], int *n_files,
                            CtsError *err);
/* Gives up; does nothing when *thumb is NULL. */
void cts_thumbnail_discard(CtsThumbnail **thumb);

enum { CTS_LABEL_SLICES_SIDE = 240 };

/* Three squares side by side, each side so many pixels: one scanned slice as it is stored, then along its rows, then
 * along its columns, the last slice at the top; through the centre of what the labels hold. All of one scale; HU in a
 * window of soft tissue. The outline of label i has the hue i times the golden ratio, which the sheet's list repeats.
 * scanned still has its grey levels, and labels are counted on it. */
CtsStatus cts_label_slices(const CtsScanned *scanned, const CtsLabels *labels, CtsPicture **picture, CtsError *err);

#endif
