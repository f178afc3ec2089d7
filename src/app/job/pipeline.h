/* From PATH... to the volume that pictures are made of. */
#pragma once

#include "app/job/watch.h"
#include "ctsplat/label_files.h"
#include "ctsplat/model.h"
#include "ctsplat/net.h"
#include "ctsplat/series.h"
#include "ctsplat/state.h"
#include <stdbool.h>

/* A box of patient coordinates, mm. */
typedef struct CtsCropBox {
    bool given;
    double low_lps[3], high_lps[3];
} CtsCropBox;

/* The value of voxels outside a scan. */
typedef struct CtsFillValue {
    bool given;
    double hu;
} CtsFillValue;

/* Of CtsSource.smooth_mm: CTS_SMOOTH_NOISE_MM where the scan is noisy (CTS_NOISY_HU), else off. */
enum { CTS_SMOOTH_AUTO = -1, CTS_SMOOTH_NOISE_MM = 1 };

/* The series to be loaded and its processing. Plain data; strings are the caller's. */
typedef struct CtsSource {
    const char *const *paths;
    int n_paths;
    const CtsPeer *from;           /* fetch instead of looking at paths; NULL: no */
    const CtsNet *net;             /* settings of the connection */
    const CtsSeriesQuery *fetched; /* the study or series to fetch */
    const char *series_uid;        /* NULL: that of the state, or the first by modality and number of slices */
    const CtsState *state;         /* the presentation state to be rendered; NULL: none */
    const char *const *labels;     /* n_labels label files, folders, or "auto" */
    int n_labels;
    bool labels_listed;                /* paths contains all label files that "auto" may use */
    const CtsArchives *archives;       /* zip files among the paths; or NULL */
    bool labels_unnamed;               /* messages do not contain their paths */
    const char *label_names;           /* names for the numbers of label maps; NULL: none */
    CtsLabelChoice choice;             /* their visibility and appearance */
    const volatile sig_atomic_t *stop; /* cancels reading when set; may be NULL */
    CtsSeriesRules rules;              /* the user's decisions about ambiguous series */
    int n_threads;                     /* 0: the cores this process may use */
    bool remove_table;
    const char *table_kept_by;      /* reason why the table is kept, for the report: "the preset" */
    bool crops_air;                 /* after table removal, to the box of what is left (cts_volume_crop_air()) */
    bool without_body;              /* no picture needs the body mask, so it is not computed */
    CtsInterpolation interpolation; /* between slices that are thick or unevenly spaced */
    double smooth_mm;               /* standard deviation of a Gaussian on the volume; 0: off; CTS_SMOOTH_AUTO */
    CtsCropBox crop;
    CtsFillValue fill; /* becomes air */
} CtsSource;

typedef struct CtsLoaded {
    CtsSeriesList *list;
    const CtsSeries *series; /* of the list */
    CtsLabels *labels;       /* of the scanned voxels; NULL: none were requested */
    CtsScanned *scanned;
    double noise_hu;    /* of its soft tissue, from cts_source_view() on; 0: not known */
    CtsModel model;     /* made of it */
    CtsFetched fetched; /* the fetched files, freed with it */
} CtsLoaded;

/* A text that identifies the processing of the scanned volume: equal texts give equal volumes. Free with free(); NULL
 * without memory. */
char *cts_source_choice(const CtsSource *source);
/* The labels of loaded->series: before its slices, which they are counted on. */
CtsStatus cts_source_labels(const CtsSource *source, CtsLoaded *loaded, CtsReport *report, CtsError *err);
/* Reads the slices of loaded->series as scanned; frees the previous volume. */
CtsStatus cts_source_read(const CtsSource *source, CtsLoaded *loaded, CtsReport *report, CtsError *err);
/* The warning that slices hold a filling, where it is not the source's own. */
void cts_source_report_fill(const CtsSource *source, const CtsScanned *scanned, CtsReport *report);
/* Sets loaded->model: the scanned volume after table removal, crop, smoothing and interpolation of layers between
 * thick slices. last: the slices are not needed again and become the volume. Where memory does not suffice for both
 * they become the volume in any case; loaded->scanned->even->grey is NULL then. */
CtsStatus cts_source_view(const CtsSource *source, bool last, CtsLoaded *loaded, CtsReport *report, CtsError *err);

/* Finds the series, the first of n_steps. Free with cts_loaded_free(), also after a failure. */
CtsStatus cts_source_find(const CtsSource *source, const CtsWatch *watch, int n_steps, CtsLoaded *loaded,
                          CtsReport *report, CtsError *err);
/* Finds the series where loaded has none, and decodes it, the second of n_steps. */
CtsStatus cts_source_scan(const CtsSource *source, const CtsWatch *watch, int n_steps, CtsLoaded *loaded,
                          CtsReport *report, CtsError *err);
void cts_loaded_free(CtsLoaded *loaded);
