/* Thumbnails for the contact sheet: WebP files of a few KB, scaled down in linear light while a picture's bands come.
 */
#ifndef CTS_SHEET_THUMB_H
#define CTS_SHEET_THUMB_H

#include "ctsplat/picture.h"
#include "ctsplat/status.h"
#include <stdint.h>

typedef struct CtsThumb CtsThumb;

/* The longest side in pixels (smaller pictures keep their size), and how many frames of a rotation stand side by side;
 * of a longer rotation every so manieth. */
enum { CTS_THUMB_SIDE = 240, CTS_THUMB_FRAMES = 36 };

/* One file that cts_thumb_end() wrote: the stem with suffix behind it. */
typedef struct CtsThumbFile {
    const char *suffix; /* ".webp": the first frame; "-turn.webp": frames from left to right */
    int n_frames;       /* side by side */
    int width, height;  /* of one frame */
    uint64_t bytes;
} CtsThumbFile;
enum { CTS_THUMB_FILES = 2 };

/* Takes bands as cts_export_rows() does: all of the first frame from the top, then the next frame's. first: the first
 * band, of which no row is taken yet. stem is a path without its ending; its folder must exist. Serial, and the same
 * picture gives the same bytes. */
CtsStatus cts_thumb_begin(CtsThumb **thumb, const char *stem, const CtsPicture *first, int n_frames, CtsError *err);
CtsStatus cts_thumb_rows(CtsThumb *thumb, const CtsPicture *band, CtsError *err);
/* Writes one file, or two of a rotation, each whole or not at all, over what may be there. Makes *thumb NULL, whatever
 * comes of it. */
CtsStatus cts_thumb_end(CtsThumb **thumb, CtsThumbFile files[CTS_THUMB_FILES], int *n_files, CtsError *err);
/* Gives up; does nothing when *thumb is NULL. */
void cts_thumb_discard(CtsThumb **thumb);

#endif
