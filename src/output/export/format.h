/* The interface of a file format: one row in its own file, listed in export.c. */
#pragma once

#include "base/file.h"
#include "ctsplat/api.h"
#include "ctsplat/export.h"
#include <stdbool.h>
#include <time.h>

CTS_C_BEGIN

/* Description of the pictures, known before their rows. */
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
    CtsTempFile *temp; /* the file being written; export.c opens and commits it */
    CtsReport *report; /* for findings; may be NULL */
    double rmse;       /* largest error estimate of its pictures so far, in display values; negative: none */
    void *state;       /* the format's own, zeroed before begin */
} CtsExportJob;

typedef struct CtsFormat {
    CtsFormatInfo info;
    /* Signature of the format: bytes at an offset from the begin of a file. */
    size_t magic_offset;
    const char *magic; /* 4 bytes */
    int max_side;      /* of a picture, in pixels; 0: as many as a picture can have */
    /* Before any work; may be NULL. */
    CtsStatus (*check)(const char *path, const CtsExportSettings *settings, CtsError *err);
    CtsStatus (*check_size)(const char *path, int width, int height, int n_frames, bool grey,
                            const CtsExportSettings *settings, CtsError *err);
    size_t state_bytes; /* of job->state */
    /* Called in sequence: begin, rows for each band of each frame in order, finish. close frees job->state, also after
     * a failure of any of the others, begin included. */
    CtsStatus (*begin)(CtsExportJob *job, CtsError *err);
    CtsStatus (*rows)(CtsExportJob *job, const CtsPicture *band, CtsError *err);
    CtsStatus (*finish)(CtsExportJob *job, CtsError *err);
    void (*close)(CtsExportJob *job);
    CtsStatus (*read)(const char *path, CtsPicture **picture, CtsError *err); /* NULL: not read_back */
} CtsFormat;

/* Rows of a band that are packed by themselves, at the same time as others. */
typedef struct CtsPackedRows {
    int y, n_rows; /* of the band */
    void *bytes;   /* of cts_alloc_bytes(), freed once they are written */
    size_t n_bytes;
    uint32_t adler; /* the format's own */
    CtsStatus status;
} CtsPackedRows;

typedef struct CtsRowPacking {
    int n_rows; /* at a time, the fewer at the end of a picture; bands are multiples of it */
    CtsStatus (*pack)(const CtsExportJob *job, const CtsPicture *band, CtsPackedRows *rows);
    /* Called in the order of rows. */
    CtsStatus (*write)(CtsExportJob *job, const CtsPicture *band, const CtsPackedRows *rows, CtsError *err);
} CtsRowPacking;

/* Packs and writes a band; the bytes do not depend on the number of threads. */
CtsStatus cts_export_packed(CtsExportJob *job, const CtsPicture *band, const CtsRowPacking *packing, CtsError *err);

/* A row's state and steps: the static functions of a format's file that have these names. */
#define CTS_FORMAT_STEPS(state)                                                                                        \
    .state_bytes = sizeof(state), .begin = begin, .rows = add_rows, .finish = finish, .close = release

extern const CtsFormat cts_format_png, cts_format_exr, cts_format_dcm, cts_format_jpg, cts_format_webp, cts_format_mp4,
    cts_format_gif;

/* The time for outputs: UTC from SOURCE_DATE_EPOCH (seconds since 1970) when it is set, for reproducible files, else
 * local time; returns true for the former. A value that is not a whole number of seconds up to the year 9999 counts as
 * unset. */
bool cts_date_now(struct tm *date);
/* The same as DICOM writes it. */
void cts_date_texts(char date[9], char time[7]);

CTS_C_END
