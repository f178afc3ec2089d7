/* From PATH... to the volume that pictures are made of. */
#ifndef CTS_JOB_SOURCE_H
#define CTS_JOB_SOURCE_H

#include "app/job/watch.h"
#include "ctsplat/label_files.h"
#include "ctsplat/net.h"
#include "ctsplat/series.h"
#include "ctsplat/volume.h"
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

/* Which series, and what of it. Plain data; strings are the caller's. */
typedef struct CtsSource {
    const char *const *paths;
    int n_paths;
    const CtsPeer *from;                     /* fetch instead of looking at paths; NULL: no */
    const CtsNet *net;                       /* how */
    const char *study_uid, *peer_series_uid; /* what; peer_series_uid NULL: all of the study */
    const char *series_uid;                  /* NULL: the one with the most slices */
    const char *const *labels;               /* n_labels label files, folders, or "auto" */
    int n_labels;
    bool labels_listed;                /* paths are all label files that "auto" may take */
    const CtsArchives *archives;       /* that hold some of them; or NULL */
    bool labels_unnamed;               /* messages do not tell their paths */
    const char *label_names;           /* a file of names for the numbers of label maps; NULL: none */
    CtsLabelChoice choice;             /* what is seen of them */
    const volatile sig_atomic_t *stop; /* ends the reading; NULL: nobody */
    CtsSeriesRules rules;              /* what the user decides of series in doubt */
    int n_threads;                     /* 0: the cores this process may use */
    bool remove_table;
    const char *table_kept_by;      /* why not, as the report tells it: "the preset" */
    bool inside_unseen;             /* no picture will look at the inside of the body, which then is not found */
    CtsInterpolation interpolation; /* between slices that are thick or unevenly spaced */
    double smooth_mm;               /* standard deviation of a Gaussian on the volume; 0: none */
    CtsCropBox crop;
    CtsFillValue fill; /* becomes air */
} CtsSource;

typedef struct CtsLoaded {
    CtsSeriesList *list;
    const CtsSeries *series; /* of the list */
    CtsLabels *labels;       /* of the scanned voxels; NULL: none were asked for */
    CtsScanned *scanned;
    CtsVolume *volume;  /* made of it */
    CtsFetched fetched; /* goes with it */
} CtsLoaded;

/* Which volume the source makes of what was scanned, as a text: equal ones make the same. free() it; NULL without
 * memory. */
char *cts_source_choice(const CtsSource *source);
/* The labels of loaded->series: before its slices, which they are counted on. */
CtsStatus cts_source_labels(const CtsSource *source, CtsLoaded *loaded, CtsReport *report, CtsError *err);
/* The slices of loaded->series, as they were scanned; the volume that was made of them before goes. */
CtsStatus cts_source_read(const CtsSource *source, CtsLoaded *loaded, CtsReport *report, CtsError *err);
/* The warning that slices hold a filling, where it is not the source's own. */
void cts_source_tell_fill(const CtsSource *source, const CtsScanned *scanned, CtsReport *report);
/* loaded->volume: of what was scanned the patient alone, and of it the part that is asked for, smoothed, and with
 * layers between thick slices. last: nobody will want another of these slices, which become the volume. Where there is
 * no memory for both they do so anyway: loaded->scanned->even->grey is NULL then. */
CtsStatus cts_source_view(const CtsSource *source, bool last, CtsLoaded *loaded, CtsReport *report, CtsError *err);

/* Finds the series and decodes it. Tells watch the first two of n_steps. Free with cts_loaded_free(), also after a
 * failure. */
CtsStatus cts_source_scan(const CtsSource *source, const CtsWatch *watch, int n_steps, CtsLoaded *loaded,
                          CtsReport *report, CtsError *err);
/* And cuts it to what is asked for, the only volume of it. */
CtsStatus cts_source_load(const CtsSource *source, const CtsWatch *watch, int n_steps, CtsLoaded *loaded,
                          CtsReport *report, CtsError *err);
void cts_loaded_free(CtsLoaded *loaded);

#endif
