/* The table of file formats: one row each. */
#ifndef CTS_EXPORT_FORMAT_H
#define CTS_EXPORT_FORMAT_H

#include "base/file.h"
#include "ctsplat/export.h"

/* What is known of the pictures before their rows come. */
typedef struct CtsExportHead {
    int width, height, n_frames;
    bool grey; /* all pixels of all frames */
    bool has_alpha, has_depth;
    CtsPictureInfo info; /* of the first frame */
} CtsExportHead;

typedef struct CtsExportJob {
    CtsExportHead head;
    char *path; /* the final name, for messages */
    CtsExportSettings settings;
    CtsTempFile *temp; /* where the bytes go; export.c opens and commits it */
    CtsReport *report; /* for findings; may be NULL */
    void *state;       /* the format's own, from begin to close */
} CtsExportJob;

typedef struct CtsFormat {
    CtsFormatInfo info;
    /* How a file of this format starts. */
    size_t magic_offset;
    const char *magic; /* 4 bytes */
    /* Before any work; may be NULL. */
    CtsStatus (*check)(const char *path, const CtsExportSettings *settings, CtsError *err);
    CtsStatus (*check_size)(const char *path, int width, int height, int n_frames, bool grey,
                            const CtsExportSettings *settings, CtsError *err);
    /* One after the other: rows for each band of each frame, in order. close frees job->state, also after a failure of
     * any of the others, begin included; then state may be NULL. */
    CtsStatus (*begin)(CtsExportJob *job, CtsError *err);
    CtsStatus (*rows)(CtsExportJob *job, const CtsPicture *band, CtsError *err);
    CtsStatus (*finish)(CtsExportJob *job, CtsError *err);
    void (*close)(CtsExportJob *job);
    CtsStatus (*read)(const char *path, CtsPicture **picture, CtsError *err); /* NULL: not read_back */
} CtsFormat;

CtsStatus cts_png_begin(CtsExportJob *job, CtsError *err);
CtsStatus cts_png_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err);
CtsStatus cts_png_finish(CtsExportJob *job, CtsError *err);
void cts_png_close(CtsExportJob *job);
CtsStatus cts_png_read(const char *path, CtsPicture **picture, CtsError *err);

CtsStatus cts_jpg_check_size(const char *path, int width, int height, int n_frames, bool grey,
                             const CtsExportSettings *settings, CtsError *err);
CtsStatus cts_jpg_begin(CtsExportJob *job, CtsError *err);
CtsStatus cts_jpg_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err);
CtsStatus cts_jpg_finish(CtsExportJob *job, CtsError *err);
void cts_jpg_close(CtsExportJob *job);

CtsStatus cts_webp_check_size(const char *path, int width, int height, int n_frames, bool grey,
                              const CtsExportSettings *settings, CtsError *err);
CtsStatus cts_webp_begin(CtsExportJob *job, CtsError *err);
CtsStatus cts_webp_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err);
CtsStatus cts_webp_finish(CtsExportJob *job, CtsError *err);
void cts_webp_close(CtsExportJob *job);

CtsStatus cts_exr_begin(CtsExportJob *job, CtsError *err);
CtsStatus cts_exr_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err);
CtsStatus cts_exr_finish(CtsExportJob *job, CtsError *err);
void cts_exr_close(CtsExportJob *job);
CtsStatus cts_exr_read(const char *path, CtsPicture **picture, CtsError *err);

CtsStatus cts_sc_check(const char *path, const CtsExportSettings *settings, CtsError *err);
CtsStatus cts_sc_check_size(const char *path, int width, int height, int n_frames, bool grey,
                            const CtsExportSettings *settings, CtsError *err);
CtsStatus cts_sc_begin(CtsExportJob *job, CtsError *err);
CtsStatus cts_sc_rows(CtsExportJob *job, const CtsPicture *band, CtsError *err);
CtsStatus cts_sc_finish(CtsExportJob *job, CtsError *err);
void cts_sc_close(CtsExportJob *job);
CtsStatus cts_sc_read(const char *path, CtsPicture **picture, CtsError *err);

#endif
