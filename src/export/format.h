/* The table of file formats: one row each. */
#ifndef CTS_EXPORT_FORMAT_H
#define CTS_EXPORT_FORMAT_H

#include "base/file.h"
#include "ctsplat/export.h"

typedef struct CtsExportJob {
    const CtsPicture *const *frames; /* all of one size */
    int n_frames;
    const char *path; /* the final name, for messages */
    const CtsExportSettings *settings;
    CtsTempFile *temp; /* where the bytes go; export.c opens and commits it */
    CtsReport *report; /* for findings; may be NULL */
} CtsExportJob;

typedef struct CtsFormat {
    const char *name; /* also the ending, without the dot */
    bool many_frames; /* one file can hold several pictures */
    /* How a file of this format starts. */
    size_t magic_offset;
    const char *magic;                                                                      /* 4 bytes */
    CtsStatus (*check)(const char *path, const CtsExportSettings *settings, CtsError *err); /* may be NULL */
    CtsStatus (*write)(const CtsExportJob *job, CtsError *err);
    CtsStatus (*read)(const char *path, CtsPicture **picture, CtsError *err);
} CtsFormat;

CtsStatus cts_png_write(const CtsExportJob *job, CtsError *err);
CtsStatus cts_png_read(const char *path, CtsPicture **picture, CtsError *err);
CtsStatus cts_exr_write(const CtsExportJob *job, CtsError *err);
CtsStatus cts_exr_read(const char *path, CtsPicture **picture, CtsError *err);
CtsStatus cts_sc_check(const char *path, const CtsExportSettings *settings, CtsError *err);
CtsStatus cts_sc_write(const CtsExportJob *job, CtsError *err);
CtsStatus cts_sc_read(const char *path, CtsPicture **picture, CtsError *err);

#endif
