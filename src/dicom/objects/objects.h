/* Secondary captures and presentation states, written by the program ctsplat-dicom (dicom/writer), and read back. The
 * caller decides on the contents (output/export). */
#pragma once

#include "base/file.h"
#include "base/sandbox.h"
#include "ctsplat/api.h"
#include "ctsplat/labels.h"
#include "ctsplat/series.h"
#include "dicom/header/dicom_object.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

/* A coded term. */
typedef struct CtsScCode {
    const char *value, *scheme, *meaning;
} CtsScCode;

/* Texts of a secondary capture. They are ASCII and fit their attribute. */
typedef struct CtsScTexts {
    const char *image_type;                         /* value 3 of (0008,0008) */
    char series_description[65], description[65];   /* of all views; of this one */
    char derivation[1000], patient_orientation[17]; /* (0020,0020), "" for several frames */
    CtsScCode mode, view;                           /* view without a value: of several */
} CtsScTexts;

/* UIDs and numbers of a secondary capture. */
typedef struct CtsScNames {
    char study_uid[65], series_uid[65], sop_uid[65];
    /* "", or the identity to put in the patient's and the study's place: then nothing that identifies is copied and no
     * source object is named. */
    char pseudonym[65];
    int series_number, instance_number;
} CtsScNames;

typedef struct CtsScObject {
    const CtsScTexts *texts;
    const CtsScNames *names;
    int width, height, n_frames;               /* more than one frame makes a multi-frame object */
    bool grey;                                 /* 16-bit texts (MONOCHROME2), else 8-bit red, green, blue */
    const char *syntax_uid;                    /* transfer syntax of the pixels */
    char date[9], time[7];                     /* of creation: YYYYMMDD and HHMMSS; "": omitted */
    const double *azimuth_deg, *elevation_deg; /* of each frame */
    double mm_per_pixel;                       /* 0: not known */
    bool burned_in, recognizable;
    const CtsSeries *source; /* patient and study are copied from its first slice, byte for byte */
    const CtsLabels *labels; /* the labels whose files are referenced; NULL: none */
    const CtsSlice *lossy;   /* with lossy compressed pixels; NULL when there is none */
} CtsScObject;

/* Writes the file up to PixelData (7FE0,0010), which is the last element and the caller's to write: Explicit VR Little
 * Endian, as all compressed syntaxes have it. */
CtsStatus cts_dcm_sc_write(const CtsScObject *object, CtsTempFile *file, CtsError *err);

/* One frame to be compressed, without loss, by ctsplat-pixels: its samples are to be put into its room, and the encoded
 * fragment of even length is valid until the next room is made. Zero-initialise; cts_sandbox_free() its encoder. */
typedef struct CtsScFrame {
    int width, height;
    bool grey;     /* as in CtsScObject */
    void *samples; /* texts in native byte order */
    size_t n_samples_bytes;
    CtsSandbox *encoder;
} CtsScFrame;

CtsStatus cts_frame_room(CtsScFrame *frame, CtsError *err);
/* syntax_uid: RLE Lossless or JPEG Lossless SV1. */
CtsStatus cts_frame_encode(CtsScFrame *frame, const char *syntax_uid, const void **fragment, size_t *n, CtsError *err);

/* The first frame of a secondary capture (8-bit RGB or MONOCHROME2 of 8 or 16 bits), as 16-bit texts, n_samples per
 * pixel, 8-bit values unscaled. Free samples with cts_free(). */
typedef struct CtsScPixels {
    int width, height, n_samples;
    int largest; /* the sample value of 1: 255 or 65535 */
    uint16_t *samples;
} CtsScPixels;

CtsStatus cts_dcm_sc_read(const char *path, CtsScPixels *pixels, CtsError *err);

/* The ICC profile of ctsplat's colours, sRGB (IEC 61966-2-1): version 4.3, input class, as required by DICOM (PS3.3
 * C.11.15). */
enum { CTS_ICC_BYTES = 520 };
extern const uint8_t cts_icc_srgb[CTS_ICC_BYTES];

/* Entries of a presentation state's colour tables: steps of 1 HU over a preset's range of 4096 HU. */
enum { CTS_STATE_ENTRIES = 4096 };

/* Private attributes for settings that the standard's attributes cannot represent exactly. */
enum { CTS_STATE_GROUP = 0x0073, CTS_STATE_CREATOR = 0x0010, CTS_STATE_PRESET = 0x1001, CTS_STATE_OPTIONS = 0x1002 };
#define CTS_STATE_BLOCK "CTSPLAT STATE 1"
#define CTS_STATE_CLASS "1.2.840.10008.5.1.4.1.1.11.9"

typedef struct CtsDcmState {
    const CtsSeries *source;
    char sop_uid[65], series_uid[65], study_uid[65], frame_uid[65], input_uid[65];
    int series_number;
    char date[9], time[7];
    const char *description; /* ASCII */
    CtsScCode view;
    const char *method; /* (0070,120D) */
    double viewpoint_lps[3], look_at_lps[3], up_lps[3], forward_lps[3];
    double field_mm[6]; /* left, right, top, bottom, near, far */
    bool shaded;
    double ambient, diffuse, specular, shininess; /* each 0..1 */
    bool cropped;
    double crop_lps[6];                          /* two opposite vertices */
    const CtsLabels *labels;                     /* that crop the volume, or NULL */
    const CtsLabelCrop *label_crop;              /* of each */
    double window_centre_hu, window_width_hu;    /* range of the tables below */
    uint16_t tables[4][CTS_STATE_ENTRIES];       /* red, green, blue, opacity */
    char capture_class_uid[65], capture_uid[65]; /* "": no picture is referenced */
    const char *preset, *options;                /* private, byte by byte */
} CtsDcmState;

CtsStatus cts_dcm_state_write(const CtsDcmState *state, CtsTempFile *file, CtsError *err);

/* The contents of a state that ctsplat wrote. */
typedef struct CtsDcmStateRead {
    char *preset, *options;             /* the private texts, to be freed with free() */
    char series_uid[65], slice_uid[65]; /* of its volume's first slice; "": missing */
    int slice_frame;                    /* of this object, from 1; 0: any */
} CtsDcmStateRead;

CtsStatus cts_dcm_state_read(const char *path, CtsDcmStateRead *state, CtsError *err);

CTS_C_END
