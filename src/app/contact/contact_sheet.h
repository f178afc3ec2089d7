/* The contact sheet: one page of all series in a batch's journals, that opens from disk in any browser. */
#pragma once

#include "ctsplat/labels.h"
#include "ctsplat/picture.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct CtsContactWanted {
    size_t n_ended, n_series;                          /* of a batch that has not ended all of them; 0: all is over */
    bool goes_on;                                      /* it is running */
    uint64_t n_objects;                                /* of the archive, without an image */
    void (*change)(const void *context, json_t *line); /* of the journal, before it is shown; or NULL */
    const void *context;
} CtsContactWanted;

/* Writes dir/index.html, whole or not at all, from dir/batch.jsonl and dir/batch-I-of-N.jsonl, and from
 * those in folders directly below dir. Of a series with several
 * lines the last of a journal counts, and of several journals the one that ended last. Lines that are no series (a torn
 * last line is passed over in silence) are counted on the page. Holds one line at a time. CTS_ERR_READ when dir holds
 * no journal. */
CtsStatus cts_contact_sheet_write(const char *dir, const CtsContactWanted *wanted, CtsError *err);

/* The page's HTML before and after the data, a JSON object in a script element. */
extern const unsigned char cts_contact_head[], cts_contact_tail[];
extern const size_t cts_contact_head_bytes, cts_contact_tail_bytes;

typedef struct CtsThumbnail CtsThumbnail;

/* CTS_THUMBNAIL_SIDE: usual longest side in pixels; smaller pictures keep their size. CTS_THUMBNAIL_FRAMES: largest
 * number of frames of a rotation side by side, steps of 10 degrees; longer rotations are subsampled evenly. The strip
 * of 8640 pixels is narrower than WebP's limit, 16383. */
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
 * band, not yet added. stem: a path without its ending, in an existing folder. side: the longest side in pixels.
 * Single-threaded; the same picture gives the same bytes. */
CtsStatus cts_thumbnail_begin(CtsThumbnail **thumb, const char *stem, int side, const CtsPicture *first, int n_frames,
                              CtsError *err);
CtsStatus cts_thumbnail_rows(CtsThumbnail *thumb, const CtsPicture *band, CtsError *err);
/* Writes one file, or two for a rotation, each whole or not at all, replacing existing ones. Sets *thumb to NULL, also
 * on failure. */
CtsStatus cts_thumbnail_end(CtsThumbnail **thumb, CtsThumbnailFile files[CTS_THUMBNAIL_FILES], int *n_files,
                            CtsError *err);
/* Frees without writing; *thumb may be NULL. */
void cts_thumbnail_discard(CtsThumbnail **thumb);

enum { CTS_SECTION_SIDE = 240 }; /* as of a thumbnail */

/* Axial, coronal and sagittal sections side by side (app/job/patient_sections.h), each of CTS_SECTION_SIDE squared
 * pixels. */
CtsStatus cts_card_sections(const CtsScanned *scanned, const CtsLabels *labels, CtsPicture **picture, CtsError *err);
