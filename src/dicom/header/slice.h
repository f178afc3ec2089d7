/* One slice as its header describes it: tags as numbers, pixels as a place in a file. No DCMTK type. */
#pragma once

#include "base/file_bytes.h"
#include "base/string_pool.h"
#include "core/volume/stored.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"
#include "dicom/protocol/syntax.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_C_BEGIN

typedef enum CtsObjectKind {
    CTS_OBJECT_OTHER,     /* DICOM, but no slice: other SOP classes, structured reports, directories */
    CTS_OBJECT_SLICE,     /* CT, MR or PET Image Storage */
    CTS_OBJECT_FRAMES,    /* Enhanced or Legacy Converted Enhanced CT, MR or PET: many frames in one object */
    CTS_OBJECT_DIRECTORY, /* a DICOMDIR */
    CTS_OBJECT_LABELS,    /* a segmentation or a structure set */
    CTS_OBJECT_NIFTI,     /* no DICOM, but a NIfTI CT that was named: its slices are this file's alone */
    CTS_OBJECT_IMAGE      /* of another class; one slice, with a fault, that has neither place nor values */
} CtsObjectKind;

/* Deviations that do not prevent use; the series gives one warning for each. */
enum {
    CTS_DEVIATION_NO_PREAMBLE = 1,  /* no preamble or meta header: a bare data set */
    CTS_DEVIATION_NO_SYNTAX = 2,    /* no transfer syntax UID; found by looking */
    CTS_DEVIATION_ORIENTATION = 4,  /* direction cosines off by more than 0.001 */
    CTS_DEVIATION_MONOCHROME1 = 8,  /* display polarity only; HU do not change */
    CTS_DEVIATION_LOSSY = 16,       /* (0028,2110) is 01, or a lossy transfer syntax */
    CTS_DEVIATION_LONG_PIXELS = 32, /* more bytes than the frames need; the surplus is not read */
    CTS_DEVIATION_UNSPECIFIED = 64, /* RescaleType is US, "unspecified", not HU */
    CTS_DEVIATION_FALLING = 128,    /* RescaleSlope is negative, which no scanner writes */
    CTS_DEVIATION_NOT_HU = 256,     /* ImageType or RescaleType names another quantity */
    CTS_DEVIATION_BURNED_IN = 512,  /* (0028,0301) is YES */
    CTS_DEVIATION_MAY_NAME = 1024   /* pixels may show the patient's name (CtsSeries) */
};

/* Attributes that identify patient, study and space; the slices of one volume agree in all of them. */
typedef enum CtsIdentity {
    CTS_PATIENT_ID,
    CTS_PATIENT_ISSUER,
    CTS_PATIENT_NAME,
    CTS_PATIENT_BIRTH_DATE,
    CTS_PATIENT_SEX,
    CTS_STUDY_UID,
    CTS_FRAME_UID,
    CTS_N_IDENTITY
} CtsIdentity;

/* Numbers and words by which volumes at the same positions differ; those from CTS_ECHO_NUMBER on of MR and PET. */
typedef enum CtsVolumeNumber {
    CTS_ACQUISITION_NUMBER,   /* (0020,0012) */
    CTS_VOLTAGE,              /* (0018,0060) */
    CTS_TEMPORAL_POSITION,    /* (0020,0100) */
    CTS_TRIGGER_TIME,         /* (0018,1060) */
    CTS_PHASE_PERCENT,        /* of a cardiac cycle: (0020,9241) */
    CTS_PHASE_DELAY,          /* (0020,9153), ms */
    CTS_CONTENT_TIME,         /* (0008,0033), seconds of the day */
    CTS_ACQUISITION_TIME,     /* (0008,0032), else ContentTime, seconds of the day */
    CTS_ECHO_NUMBER,          /* (0018,0086) */
    CTS_ECHO_TIME,            /* (0018,0081) */
    CTS_INVERSION_TIME,       /* (0018,0082) */
    CTS_FLIP_ANGLE,           /* (0018,1314) */
    CTS_B_VALUE,              /* (0018,9087), and private ones */
    CTS_FRAME_REFERENCE_TIME, /* of PET: (0054,1300), or (0018,9151) in seconds */
    CTS_TIME_SLICE,           /* of PET: its number by ImageIndex (0054,1330) */
    CTS_N_VOLUME_NUMBERS
} CtsVolumeNumber;
typedef enum CtsVolumeWord {
    CTS_GRADIENT_DIRECTION, /* (0018,9089), and private ones */
    CTS_IMAGE_TYPE,         /* (0008,0008) from its third value on */
    CTS_COMPLEX_COMPONENT,  /* (0008,9208) */
    CTS_N_VOLUME_WORDS
} CtsVolumeWord;

/* The attributes of a PET slice that SUV follow from. */

typedef enum CtsPetUnits { CTS_PET_OTHER_UNITS, CTS_PET_BQML, CTS_PET_CNTS, CTS_PET_GML } CtsPetUnits;

/* Time to which radioactive decay was corrected. */
typedef enum CtsPetDecay {
    CTS_PET_NO_DECAY_CORRECTION,
    CTS_PET_SCAN_START,
    CTS_PET_INJECTION,
    CTS_PET_REFERENCE_TIME /* of an enhanced object: CTS_PET_REFERENCE_S */
} CtsPetDecay;

/* Times are seconds from 1970-01-01 in the scanner's time zone. */
typedef enum CtsPetValue {
    CTS_PET_WEIGHT_KG,                               /* (0010,1030) */
    CTS_PET_DOSE_BQ,                                 /* (0018,1074) */
    CTS_PET_HALF_LIFE_S,                             /* (0018,1075) */
    CTS_PET_INJECTION_S,                             /* (0018,1078) */
    CTS_PET_INJECTION_CLOCK_S,                       /* (0018,1072), or the time of (0018,1078): of the day */
    CTS_PET_N_DRUGS,                                 /* items of (0054,0016) */
    CTS_PET_SERIES_S,                                /* (0008,0021), (0008,0031) */
    CTS_PET_GE_SCAN_S,                               /* (0009,xx0D) of GEMS_PETD_01 */
    CTS_PET_REFERENCE_S,                             /* (0018,9701) */
    CTS_PET_PHILIPS_SUV,                             /* (7053,xx00): SUVbw of a count */
    CTS_PET_PHILIPS_BQML,                            /* (7053,xx09): Bq/ml of a count */
    CTS_PET_N_SERIES_VALUES,                         /* those before are one for all slices */
    CTS_PET_ACQUISITION_S = CTS_PET_N_SERIES_VALUES, /* (0008,0022), (0008,0032) */
    CTS_PET_FRAME_REFERENCE_MS,                      /* (0054,1300) */
    CTS_PET_FRAME_DURATION_MS,                       /* (0018,1242) */
    CTS_PET_N_VALUES
} CtsPetValue;

typedef struct CtsPet {
    CtsPetUnits units; /* (0054,1001), or of an enhanced object's real world values */
    CtsPetDecay decay; /* (0054,1102) */
    bool is_suvbw;     /* SUVType (0054,1006) is missing or BW */
    bool is_corrected; /* for attenuation and decay, by (0028,0051) */
    bool has_date;     /* else its times are of one day */
    bool is_enhanced;
    bool is_dynamic;                /* SeriesType (0054,1000) is DYNAMIC or GATED */
    bool is_reprojection;           /* SeriesType is REPROJECTION */
    double value[CTS_PET_N_VALUES]; /* NaN where missing */
} CtsPet;

/* Its texts, "" where missing, are the reader's (CtsHeaderReader), shared by the slices it has read. */
typedef struct CtsSlice {
    const char *path;      /* the file's (CtsFile) */
    const uint8_t *memory; /* the bytes of an archive\'s member, owned by the series list; NULL for a file */
    uint64_t file_bytes;   /* with mtime_ns: the file must be the same when the pixels are read */
    int64_t mtime_ns;
    CtsObjectKind kind;
    CtsModality modality_id;
    const CtsSyntax *syntax; /* NULL when the UID is unknown */
    const char *syntax_uid;
    unsigned deviations; /* CTS_DEVIATION_... */

    const char *sop_uid, *series_uid; /* at most 64 characters */
    const char *class_uid;            /* its object's SOP class */
    /* As stored, without padding. Patient attributes are compared and never written to messages. */
    const char *identity[CTS_N_IDENTITY];
    const char *modality;              /* at most 16 */
    const char *scanner;               /* manufacturer, model and serial number, concatenated */
    const char *description, *charset; /* (0008,103E) and (0008,0005) as stored */
    const char *study_date;            /* (0008,0020) as stored */
    int series_number;                 /* (0020,0011); negative where missing */
    bool has_instance;
    int instance_number;
    const char *kernel;                          /* (0018,1210), at most 64 characters */
    double thickness_mm;                         /* (0018,0050); negative when missing */
    bool declared_lossless;                      /* (0028,2110) is 00 */
    const char *lossy_ratio, *lossy_method;      /* (0028,2112) and (0028,2114) as stored */
    double volume_number[CTS_N_VOLUME_NUMBERS];  /* NaN where missing */
    const char *volume_word[CTS_N_VOLUME_WORDS]; /* of MR */
    CtsPet pet;
    bool localizer;         /* a scout */
    bool contrast;          /* (0018,0010) or (0018,0012) names a contrast agent */
    const char *image_type; /* (0008,0008), at most 64 characters */
    bool is_report;         /* a dose report or the like: never had a place in a patient */
    int frame, n_frames;    /* of an object with many: which one, from 0; n_frames is 0 for a single slice */
    const char *stack_id;   /* (0020,9056), of a frame; at most 16 characters */
    /* For a frame whose object is a part of a concatenation (PS3.3 C.7.6.16.2.2.4): */
    const char *concatenation; /* (0020,9161) */
    int part_number, n_parts;  /* (0020,9162), from 1, and (0020,9163); 0 where missing */
    int64_t first_frame;       /* (0020,9228), from 0; negative where missing */
    /* If parts are missing: the series' message about them, and the number of missing frames between others. NULL,
     * 0. */
    const char *missing_parts;
    int n_lacking;

    int rows, columns, bits_allocated, bits_stored, high_bit;
    bool is_signed;
    int padding_low, padding_high; /* stored values, inclusive, (0028,0120) and (0028,0121); none: low > high */
    int padding_word;              /* a padding value that exceeds bits_stored: the whole 16-bit word; else -1 */
    double slope, intercept;       /* value = slope * stored + intercept; once a series is checked, in its quantity */
    const char *rescale_type;      /* (0028,1054) of a CT, if it names another quantity than HU */
    double row_lps[3], column_lps[3];         /* unit directions of rising row and column index */
    double normal_lps[3];                     /* row x column */
    double position_lps[3];                   /* centre of the first pixel, mm */
    double column_spacing_mm, row_spacing_mm; /* along row_lps, along column_lps */

    /* The value of PixelData (7FE0,0010): its place in the file, or in the inflated data set when deflated; the frame's
     * fragments, each with its item's 8 bytes in front, when encapsulated. */
    uint64_t pixel_offset, pixel_bytes;
    uint64_t data_offset; /* offset of the data set in the file */
    bool pixel_words;     /* VR OW: big-endian files swap 8-bit pixels in pairs */

    /* A slice of the same place and HU that was left out for this one, and so on; owned, NULL: none. */
    struct CtsSlice *copy;

    CtsStatus fault;      /* why this slice cannot be used, or CTS_OK */
    char fault_text[256]; /* without the path */
} CtsSlice;

/* True if slope and intercept give values. CT: a range of 65535 * 1e-6 HU is none, and 1e7 HU is no scanner's. Others:
 * numbers that single precision holds. */
bool cts_slice_has_scale(const CtsSlice *slice);

/* The quantity that the rules name for series that name none. */
static inline CtsQuantity cts_rules_quantity(const CtsSeriesRules *rules)
{
    return rules->named_quantity ? (CtsQuantity)(rules->named_quantity - 1) : CTS_QUANTITY_HU;
}

/* One of which nothing is known. */
CtsSlice cts_slice_unknown(void);

/* One of malloc()'s, with its copies. */
void cts_slice_free(CtsSlice *slice);

/* Record why the slice cannot be used; the first reason stays. */
void cts_slice_fault(CtsSlice *slice, CtsStatus status, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* The path without its folders. */
const char *cts_slice_name(const CtsSlice *slice);

/* The label with the frame number, from 1, where there are several; truncated to its size. */
typedef struct CtsSliceLabel {
    char text[320];
} CtsSliceLabel;
CtsSliceLabel cts_slice_label(const CtsSlice *slice);

/* Contents of one file: a slice, or the frames of an object with many. */
typedef struct CtsObject {
    CtsObjectKind kind;
    CtsModality modality_id; /* of slices and frames */
    const char *class_uid;   /* of DICOM; "" if missing */
    const char *class_name;  /* readable, of DICOM without slices or with an image; NULL: no DICOM */
    const char *study_uid;   /* of DICOM; "" if missing */
    bool has_number;
    int instance_number; /* (0020,0013) of DICOM */
    CtsSlice **slices;   /* n_slices of them, owned; none unless kind is slice, frames or image */
    int n_slices;
    /* for a file that is not DICOM: its probable packer, such as "gzip"; or NIfTI that was not named itself; else
     * NULL */
    const char *packed;
} CtsObject;

/* Adds a slice, a copy of `like` (NULL: one of which nothing is known) of the object's kind and modality; NULL without
 * memory. */
CtsSlice *cts_object_add_slice(CtsObject *object, const CtsSlice *like);
void cts_object_free(CtsObject *object);

/* The conversion of its stored words. */
CtsStored cts_slice_stored(const CtsSlice *slice);
/* True if the same words have the same values in both. */
bool cts_slice_same_values(const CtsSlice *a, const CtsSlice *b);

/* Samples of grey levels of 1 HU (0: padding, and -1024 HU or less) at the centres of a grid over the slice, from its
 * stored words or, where are_grey, from such grey levels. The grid's 1024 samples are one in 256 of 512 x 512 pixels.
 */
enum { CTS_SAMPLE_SIDE = 32, CTS_SAMPLES = CTS_SAMPLE_SIDE * CTS_SAMPLE_SIDE };
void cts_slice_sample(const CtsSlice *slice, const uint16_t *words, bool are_grey, uint16_t sample[CTS_SAMPLES]);

/* The slice's file, as cts_file_bytes_open(); CTS_ERR_READ when it is not the one any more whose header was read. */
CtsStatus cts_slice_open(const CtsSlice *slice, CtsFileBytes *file, CtsError *err);

CTS_C_END
