/* The files that one job writes: names for each frame, checked before any work. */
#ifndef CTS_JOB_OUTPUTS_H
#define CTS_JOB_OUTPUTS_H

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

/* How many frames this output's file holds: all, where its format holds several. */
int cts_output_n_frames(const CtsOutputs *outputs, int output);

/* Its format is DICOM. */
bool cts_output_is_dicom(const CtsOutputs *outputs, int output);

/* Some output has a place for depth. */
bool cts_outputs_hold_depth(const CtsOutputs *outputs);

/* Every path has a known ending, is given once, can be written, and is no CT slice that force would destroy. */
CtsStatus cts_outputs_check(const CtsOutputs *outputs, const CtsExportSettings *settings, CtsError *err);

typedef struct CtsFiles {
    const CtsOutputs *outputs;
    const CtsExportSettings *settings;
    const CtsWatch *watch;
    CtsExport **exports;  /* by output: the file being written, or NULL */
    CtsPictureInfo first; /* how the first frame was made */
} CtsFiles;

CtsStatus cts_files_begin(CtsFiles *files, CtsError *err);
/* One band of frame: a file begins with the first band it holds. */
CtsStatus cts_files_rows(CtsFiles *files, int frame, const CtsPicture *band, CtsReport *report, CtsError *err);
/* Ends the files that are whole with this frame, and tells who watches; the report knows what its verification found.
 */
CtsStatus cts_files_frame_done(CtsFiles *files, int frame, CtsReport *report, CtsError *err);
/* What is not whole by now is given up. */
void cts_files_end(CtsFiles *files);

#endif
