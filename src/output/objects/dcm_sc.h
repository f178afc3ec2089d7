/* The C door to DCMTK for secondary captures: write one, read one. Nothing of DCMTK comes through, no exception either.
 * What an object says is decided by the caller (output/export/sc.c); how it is encoded is decided here. */
#ifndef CTS_DICOM_DCM_SC_H
#define CTS_DICOM_DCM_SC_H

#include "ctsplat/labels.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include "input/header/head.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* A coded term. */
typedef struct CtsScCode {
    const char *value, *scheme, *meaning;
} CtsScCode;

/* All texts are ASCII and fit their attribute. */
typedef struct CtsScObject {
    int width, height, n_frames; /* more than one frame makes a multi-frame object */
    bool grey;                   /* 16-bit words (MONOCHROME2), else 8-bit red, green, blue */
    const char *syntax_uid;      /* that the pixels come in */
    bool reversible_ycc;         /* colours are stored as JPEG 2000's reversible transform of RGB */

    const char *study_uid, *series_uid, *sop_uid;
    int series_number, instance_number;
    const char *date, *time; /* of the making: YYYYMMDD and HHMMSS; NULL: not told */
    const char *version;
    const char *image_type; /* value 3 of (0008,0008) */
    const char *series_description;
    const char *derivation;
    CtsScCode derivation_code, view;
    const double *azimuth_deg, *elevation_deg; /* of each frame */
    double mm_per_pixel;                       /* 0: not known */
    const char *patient_orientation;           /* (0020,0020), "" for several frames */
    bool burned_in, recognizable;
    const uint8_t *icc_profile; /* of the colours; not used where grey */
    size_t n_icc_profile;

    const CtsSeries *source;
    const CtsDataSet *header; /* of its first slice: patient and study are copied from it, byte for byte */
    const CtsLabels *labels;  /* that are seen, too; NULL: none */
    const CtsDataSet *lossy;  /* of a slice whose pixels went through lossy compression; NULL when there is none */
    /* NULL, or the identity to put in the patient's and the study's place: then nothing that identifies is copied and
     * no source object is named. */
    const char *pseudonym;
} CtsScObject;

/* Takes the encoded file piece by piece. */
typedef CtsStatus (*CtsScSink)(void *context, const void *bytes, size_t n, CtsError *err);

/* The file up to PixelData (7FE0,0010), which is the last element and the caller's to write: Explicit VR Little Endian,
 * as all compressed syntaxes have it. */
CtsStatus cts_dcm_sc_write(const CtsScObject *object, CtsScSink sink, void *context, CtsError *err);

/* One frame on its way into a compressed file. */
typedef struct CtsScFrame {
    int width, height;
    bool grey;     /* as in CtsScObject */
    void *samples; /* words in this machine's order */
    size_t n_samples_bytes;
    int n_threads;
} CtsScFrame;

/* Lossless codecs by their transfer syntax: RLE Lossless, JPEG Lossless SV1 (DCMTK), JPEG 2000 Lossless (OpenJPEG). The
 * sink gets the fragments of the frame, one call each, of even length. */
CtsStatus cts_dcm_sc_encode(const char *syntax_uid, const CtsScFrame *frame, CtsScSink sink, void *context,
                            CtsError *err);
CtsStatus cts_j2k_encode(const CtsScFrame *frame, CtsScSink sink, void *context, CtsError *err);

/* The first frame of a secondary capture (8-bit RGB or MONOCHROME2 of 8 or 16 bits), as 16-bit words, n_samples a
 * pixel: 8-bit values come as they are. Free samples with cts_free(). */
typedef struct CtsScPixels {
    int width, height, n_samples;
    int largest; /* the sample value that stands for 1: 255 or 65535 */
    uint16_t *samples;
} CtsScPixels;

CtsStatus cts_dcm_sc_read(const char *path, CtsScPixels *pixels, CtsError *err);

CTS_C_END
#endif
