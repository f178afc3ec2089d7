/* Pictures to and from files. The file name's ending picks the format. */
#pragma once

#include "ctsplat/picture.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include <stdbool.h>

CTS_API_BEGIN

typedef enum CtsScCompression { CTS_SC_NONE, CTS_SC_RLE, CTS_SC_JPEG_LOSSLESS, CTS_SC_N_COMPRESSIONS } CtsScCompression;
extern const char *const cts_sc_compression_names[CTS_SC_N_COMPRESSIONS];

/* CTS_QUALITY_DEFAULT: errors of 1.3 to 2.6 of 255 rms (.jpg) and 1.5 to 2.2 (.webp) at 0.2 to 0.25 and 0.11 to 0.2 of
 * a PNG's bytes; 95 has 0.65 to 0.8 of the error at 1.3 to 1.4 times the bytes (three series, 512 x 512 pixels).
 * CTS_FRAME_RATE_DEFAULT: frames a second; a rotation of 36 takes 3.6 s. */
enum { CTS_QUALITY_DEFAULT = 90, CTS_FRAME_RATE_DEFAULT = 10 };

struct CtsLabels;
typedef struct CtsExportSettings {
    const CtsSeries *source;        /* source of a secondary capture, which joins its study; NULL for other formats */
    const struct CtsLabels *labels; /* (ctsplat/labels.h) visible labels, to be referenced; NULL: none */
    CtsScCompression compression;   /* of secondary captures */
    bool new_uids, deidentify;      /* of secondary captures */
    const char *key;   /* key file for the UIDs of deidentify; NULL: the site's key, created at first use */
    int series_number; /* of secondary captures; 0: one that preset, kind and view have for themselves */
    const char *series_description; /* of secondary captures, ASCII, at most 64 characters; NULL: by preset and mode */
    bool png_8_bits;                /* a .png has 8 bits a sample, not 16 */
    int quality;                    /* of .jpg, .webp and .mp4, 1 to 100; 0: the default */
    int frame_rate;                 /* frames a second of .webp, .mp4 and .gif; 0: the default */
    bool scratch;                   /* a temporary file of this process, which need not be synced to the disk */
    bool force;                     /* overwrite a file that exists; else CTS_ERR_OUTPUT */
    int n_threads;
} CtsExportSettings;

/* Properties of a format. */
typedef struct CtsFormatInfo {
    const char *name;  /* also the ending, without the dot */
    const char *about; /* for people */
    const char *media_type;
    bool many_frames;  /* one file holds all pictures of a rotation */
    bool has_depth;    /* writes depth_mm where the picture has it */
    bool has_alpha;    /* else a picture over nothing is written over black */
    /* a secondary capture: joins the study of its source, supports compression, new_uids and deidentify */
    bool is_object;
    bool read_back; /* cts_picture_read() reads it */
} CtsFormatInfo;

/* The formats by index; NULL past the last. */
const CtsFormatInfo *cts_format(size_t index);

/* Endings of the selected formats (NULL: of all) in text, as ".png, .exr or .dcm"; returns text. */
enum { CTS_ENDINGS_MAX = 128 };
const char *cts_format_endings(bool (*wanted)(const CtsFormatInfo *format), char text[CTS_ENDINGS_MAX]);

/* The format a path's ending names, or NULL. */
const CtsFormatInfo *cts_export_format(const char *path);

/* Checks before any work: the ending is known, the folder exists and is writable, the file may be (over)written. The
 * source may still be NULL. */
CtsStatus cts_export_check(const char *path, const CtsExportSettings *settings, CtsError *err);

/* Checks that the format supports so many pictures of this size, all grey or not. n_frames > 1 only for formats with
 * many_frames. */
CtsStatus cts_export_check_size(const char *path, int width, int height, int n_frames, bool grey,
                                const CtsExportSettings *settings, CtsError *err);

/* A file written while its rows arrive: all bands of the first frame from the top, then the next frame's. Memory does
 * not grow with the size of the picture (but a compressed secondary capture buffers a frame) or the number of frames.
 * Written whole or not at all: temporary file in the same folder, fsync, rename. Adds to the export stage. */
typedef struct CtsExport CtsExport;

/* first: the first band, not yet added; its info.grey says whether all frames are grey. settings are copied, their
 * source and report must outlive the output. */
CtsStatus cts_export_begin(CtsExport **output, const char *path, const CtsPicture *first, int n_frames,
                           const CtsExportSettings *settings, CtsReport *report, CtsError *err);
CtsStatus cts_export_rows(CtsExport *output, const CtsPicture *band, CtsError *err);
/* Before the end: the error estimate of a picture, which PNG, EXR, WebP and secondary captures carry; of several
 * pictures in a file the largest. Without it, or not known, they carry none. */
void cts_export_error(CtsExport *output, const CtsErrorBound *bound);
/* A .dcm describes the error in report->verified. Sets *output to NULL, also on failure; bytes (may be NULL) is the
 * file's size. */
CtsStatus cts_export_end(CtsExport **output, uint64_t *bytes, CtsError *err);
/* Frees without writing; *output may be NULL. */
void cts_export_discard(CtsExport **output);

/* Whole pictures at once; grey when every pixel is. bytes (may be NULL) is the file's size. */
CtsStatus cts_export(const CtsPicture *const *frames, int n_frames, const char *path, const CtsExportSettings *settings,
                     uint64_t *bytes, CtsReport *report, CtsError *err);

/* Read a PNG, EXR or secondary capture (its first frame) back as display values. */
CtsStatus cts_picture_read(const char *path, CtsPicture **picture, CtsError *err);

CTS_API_END
