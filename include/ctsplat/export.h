/* Pictures to and from files. The file name's ending picks the format: .png, .exr, .dcm. */
#ifndef CTSPLAT_EXPORT_H
#define CTSPLAT_EXPORT_H

#include "ctsplat/picture.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum CtsScCompression { CTS_SC_NONE, CTS_SC_RLE, CTS_SC_JPEG_LOSSLESS } CtsScCompression;

typedef struct CtsExportSettings {
    const CtsSeries *source;      /* whose study a secondary capture joins; NULL where no .dcm is written */
    CtsScCompression compression; /* for .dcm */
    bool new_uids, deidentify;    /* for .dcm */
    bool force;                   /* overwrite a file that exists; else CTS_ERR_OUTPUT */
    int n_threads;
} CtsExportSettings;

/* The format a path's ending names ("png", "exr", "dcm"), or NULL. */
const char *cts_export_format(const char *path);

/* Before any work: the ending is known, the folder exists and can be written, the file may be (over)written. The source
 * may still be NULL. */
CtsStatus cts_export_check(const char *path, const CtsExportSettings *settings, CtsError *err);

/* Written whole or not at all: temporary file in the same folder, fsync, rename. Adds the export stage.
 * n_frames > 1 only for .dcm (one multi-frame object); bytes (may be NULL) is the file's size. */
CtsStatus cts_export(const CtsPicture *const *frames, int n_frames, const char *path, const CtsExportSettings *settings,
                     uint64_t *bytes, CtsReport *report, CtsError *err);

/* Read a PNG, EXR or secondary capture (its first frame) back as display values. */
CtsStatus cts_picture_read(const char *path, CtsPicture **picture, CtsError *err);

#ifdef __cplusplus
}
#endif
#endif
