/* The attributes of a PET slice that SUV follow from, as plain data. */
#pragma once

#include <stdbool.h>

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
