/* The files that one job writes: names for each frame, checked before any work. */
#pragma once

#include "app/job/watch.h"
#include "ctsplat/export.h"
#include "ctsplat/picture.h"
#include <stdbool.h>

typedef struct CtsOutputs {
    const char *const *paths; /* the endings pick the formats */
    int n;
    const char *state; /* a presentation state beside them, or NULL */
    int rotation;      /* frames, or 0: one picture, and paths as they are */
} CtsOutputs;

/* Number of frames in this output's file: all where its format supports several, else 1. */
int cts_output_n_frames(const CtsOutputs *outputs, int output);

/* Its format is DICOM. */
bool cts_output_is_dicom(const CtsOutputs *outputs, int output);

/* Some output has all frames in one file. */
bool cts_outputs_hold_frames(const CtsOutputs *outputs);

/* Some output has a place for depth. */
bool cts_outputs_hold_depth(const CtsOutputs *outputs);

/* Checks that every path has a known ending, is given once, can be written, and is not a CT slice that `force` would
 * overwrite. */
CtsStatus cts_outputs_check(const CtsOutputs *outputs, const CtsExportSettings *settings, CtsError *err);

typedef struct CtsFiles {
    const CtsOutputs *outputs;
    const CtsExportSettings *settings;
    const CtsWatch *watch;
    CtsExport **exports;  /* by output: the file being written, or NULL */
    int same;             /* of the current frame's view: the number of an earlier frame plus 1, or 0. Its files, of
                             outputs with a file a frame, are copied instead of written again */
    CtsPictureInfo first; /* description of the first frame */
} CtsFiles;

CtsStatus cts_files_begin(CtsFiles *files, CtsError *err);
/* One band of frame: a file begins with the first band it holds. captioned: of the files whose format has no depth;
 * else of the others, which hold no captions. */
CtsStatus cts_files_rows(CtsFiles *files, int frame, const CtsPicture *band, bool captioned, CtsReport *report,
                         CtsError *err);
/* Ends the files that this frame completes, and notifies the watch; the report contains the frame's verification. */
CtsStatus cts_files_frame_done(CtsFiles *files, int frame, CtsReport *report, CtsError *err);
/* Discards incomplete files. */
void cts_files_end(CtsFiles *files);
