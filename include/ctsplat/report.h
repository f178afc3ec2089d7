/* The report of a run: stage times, skipped steps, notes and warnings, voxel counts, measured error.
 *
 * One CtsReport is passed through loading, rendering and export; each adds to it. The cli turns it into the timing log.
 * A report is not thread-safe: stages add to it outside parallel regions. */
#pragma once

#include "ctsplat/diagnostic.h"
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_API_BEGIN

typedef enum CtsStage {
    CTS_STAGE_SCAN,
    CTS_STAGE_LABELS,
    CTS_STAGE_DECODE,
    CTS_STAGE_GREY,
    CTS_STAGE_CLASSIFY,
    CTS_STAGE_OCCLUSION,
    CTS_STAGE_FOOTPRINT,
    CTS_STAGE_SPLAT,
    CTS_STAGE_COMPOSITE,
    CTS_STAGE_SHADE,
    CTS_STAGE_WARP,
    CTS_STAGE_EXPORT,
    CTS_N_STAGES
} CtsStage;

extern const char *const cts_stage_names[CTS_N_STAGES];

typedef struct CtsStageTime {
    bool ran;
    double wall_ms; /* exclusive: the stages of a run add up to its wall time */
    double cpu_ms;
    uint64_t items; /* slices, voxels, samples or pixels, depending on the stage */
    uint64_t bytes;
} CtsStageTime;

typedef struct CtsSkip {
    char what[48];
    char why[200];
} CtsSkip;

typedef struct CtsVoxelCounts {
    bool known;
    uint64_t total, void_voxels, reused, splatted;
} CtsVoxelCounts;

/* Result of table removal, for voxels denser than -350 HU. */
typedef struct CtsTableFact {
    bool known;
    double body_mm3, removed_mm3;
    double thick_mm3; /* removed parts thicker or denser than tables, possibly body */
} CtsTableFact;

typedef struct CtsVerified {
    uint64_t pixels;            /* 0: not verified */
    double rmse;                /* over display values 0..1 of red, green and blue */
    double rmse_low, rmse_high; /* 95 % confidence interval, where no pixel's error is larger than max, or 1/255 */
    double p999, max;
    double share_above; /* share of pixels off by more than 1/255 */
    double share_high;  /* 97.5 % limit of that; with CtsRenderSettings.verify alone */
    /* largest share of the picture for which one sampled pixel stands; 0: all pixels were sampled */
    double unit;
    double wall_ms, cpu_ms; /* the verification's own; not the picture's, though in its composite stage */
    int worst_x, worst_y;
} CtsVerified;

/* Upper limits of a picture's error against the integral, over display values 0..1 before rounding to a file's bits; of
 * several pictures the largest. */
typedef struct CtsErrorBound {
    bool known;
    double rmse;         /* holds in 999 of 1000 pictures */
    double rms_estimate; /* the likely error, no limit */
    double max;          /* of a channel of a pixel; negative where nothing bounds it (an engine that only estimates its
                            errors, or pixels that were interpolated between others) */
    uint64_t n_rerendered; /* pixels that were re-rendered one by one for it */
    char engine[16];       /* engine of the picture */
    char level[16];        /* of that engine; "" without levels */
} CtsErrorBound;

typedef enum CtsLabelSource { CTS_LABEL_SEG, CTS_LABEL_RTSTRUCT, CTS_LABEL_NIFTI, CTS_N_LABEL_SOURCES } CtsLabelSource;
extern const char *const cts_label_source_names[CTS_N_LABEL_SOURCES];

/* A label (segment, structure, number of a label map), with statistics of its voxels. */
typedef struct CtsLabelFact {
    int file;   /* index of its label file, from 1 */
    int number; /* as in its file */
    char *name; /* UTF-8, sanitised for display */
    CtsLabelSource source;
    uint64_t voxels;
    double ml;             /* of a voxel: its area times half the sum of the gaps to both neighbour slices */
    uint64_t n_hu;         /* voxels that are no padding */
    double hu_mean, hu_sd; /* of the stored voxels, as a population; NAN where there are none */
    double air_share;      /* of those, below -900 HU */
    bool in_air;           /* more voxels in air than plausible by the label's name: a mirrored or shifted mask */
    bool touches_edge;     /* has a voxel on a face of the scanned box */
    uint64_t parts;        /* 26-connected parts */
    uint64_t overlap;      /* voxels that another label holds too */
} CtsLabelFact;

typedef struct CtsReport {
    char series_uid[65]; /* the series that was loaded; "" before */
    CtsStageTime stages[CTS_N_STAGES];
    CtsSkip *skips;
    size_t n_skips;
    CtsDiagnostics diagnostics;
    CtsLabelFact *labels;
    size_t n_labels;
    CtsTableFact table;
    CtsVoxelCounts voxels;
    CtsVerified verified;
    CtsErrorBound bound;
    double key_loss; /* share of the volume's opacity that void_key left out; 0 without it */
    char *plan;      /* for people: lines of text; NULL until a plan is made */
} CtsReport;

/* Zero-initialise a CtsReport before use; this frees its contents and zeroes it again. */
void cts_report_free(CtsReport *report);

/* The following functions accept a NULL report and then do nothing. Texts longer than their field are truncated. */
void cts_report_stage(CtsReport *report, CtsStage stage, double wall_ms, double cpu_ms, uint64_t items, uint64_t bytes);

/* Share one parallel region's wall and CPU time among the stages that ran inside it, in proportion to busy[stage]
 * (any unit, summed over threads; 0: did not run). Items and bytes are added as given (either may be NULL). */
void cts_report_region(CtsReport *report, double wall_ms, double cpu_ms, const double busy[CTS_N_STAGES],
                       const uint64_t items[CTS_N_STAGES], const uint64_t bytes[CTS_N_STAGES]);

/* CPU time from classify to warp, without verification: the cost of the picture. */
double cts_report_picture_cpu_ms(const CtsReport *report);

void cts_report_skip(CtsReport *report, const char *what, const char *why_format, ...)
    __attribute__((format(printf, 3, 4)));
void cts_report_diagnostic(CtsReport *report, CtsDiagnosticId id, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
/* Copies the fact. Without memory a label is missing. */
void cts_report_label(CtsReport *report, const CtsLabelFact *label);
void cts_report_plan(CtsReport *report, const char *format, ...) __attribute__((format(printf, 2, 3)));

CTS_API_END
