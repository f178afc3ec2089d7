/* Bands of rows of a picture, as they are rendered, into all files that are asked for. */
#ifndef CTS_JOB_FILES_H
#define CTS_JOB_FILES_H

#include "app/job/outputs.h"
#include "app/job/watch.h"
#include "ctsplat/picture.h"

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
