/* Series: found in folders from their headers alone, then loaded as a volume. */
#pragma once

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <signal.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

CTS_API_BEGIN

struct CtsStored;     /* src/core/volume/stored.h */
struct CtsSlice;      /* src/dicom/header/slice.h */
struct CtsStringPool; /* src/base/string_pool.h */

/* Instance numbers (0020,0013) of the objects of all studies that are there: a number that a series skips may be
 * another object's. Zero-initialise; sort once all are added. */
typedef struct CtsStudyNumbers {
    uint64_t *keys; /* n hashes of study and number; owned */
    size_t n;
} CtsStudyNumbers;
CtsStatus cts_study_numbers_add(CtsStudyNumbers *numbers, const char *study_uid, int number, CtsError *err);
void cts_study_numbers_sort(CtsStudyNumbers *numbers);
bool cts_study_numbers_have(const CtsStudyNumbers *numbers, const char *study_uid, int number);
void cts_study_numbers_free(CtsStudyNumbers *numbers);

/* Choice between a NIfTI file's two forms where they disagree. AUTO: the sform, or for a label map the form that equals
 * the CT's grid. */
typedef enum CtsNiftiForm { CTS_NIFTI_FORM_AUTO, CTS_NIFTI_FORM_S, CTS_NIFTI_FORM_Q } CtsNiftiForm;

/* The user's decisions about ambiguous series. All 0: none. */
typedef struct CtsSeriesRules {
    bool allow_missing_slices; /* a series in which slices are missing is rendered, with a warning */
    CtsNiftiForm nifti_form;
    /* 1 + the CtsQuantity of a NIfTI file, and of a CT whose RescaleType (0028,1054) names another one than HU; 0: not
     * named, so that their values must be HU. */
    unsigned named_quantity;
} CtsSeriesRules;

typedef struct CtsSeries {
    char uid[65]; /* SeriesInstanceUID (0020,000E); "" where missing */
    int part;     /* 0; or 1, 2, ... where the UID holds several volumes at the same or alternating positions */
    char study_uid[65];
    /* Like the description it may identify the patient: print only when requested. */
    char study_date[11]; /* (0008,0020) as YYYY-MM-DD; "" where missing */
    int series_number;   /* (0020,0011); negative where missing */
    char modality[17];   /* as stored */
    CtsModality modality_id;
    CtsQuantity quantity; /* of the volume that loading makes */
    double value_factor;  /* its values divided by those after rescale, as of SUV */
    char *description;    /* (0008,103E), UTF-8, may identify the patient: print only when requested */
    char transfer_syntax[65];
    char orientation[16]; /* axial, coronal, sagittal or oblique */
    char traits[160];     /* size, spacing, thickness, kernel, contrast agent and image type; not the patient */
    int n_slices, columns, rows;
    /* column, row, slice (along the slice normal, the median where it varies; 0: fewer than two positions) */
    double spacing_mm[3];
    double tilt_deg;    /* angle between the slice normal and the line of positions */
    bool no_patient;    /* a NIfTI file: no DICOM object can be made of it */
    bool frames_differ; /* each slice has a frame of reference of its own, as anonymisers write; the series has none */
    CtsSeriesRules rules; /* the rules applied, also for loading */
    bool renderable;
    bool may_name;     /* its pixels may show the patient's name: YES in BurnedInAnnotation (0028,0301), or not NO in a
                          class of images that often do */
    bool passed;       /* not renderable, as it is no volume by its nature: a scout, a dose page, a single slice */
    CtsStatus refusal; /* why not, when not renderable: the status that loading would return */
    char reason[512];
    CtsDiagnostics diagnostics;
    struct CtsSlice **slices; /* n_slices headers in order of position; owned */
} CtsSeries;

/* n files of one kind: "MR Image", "not DICOM". */
typedef struct CtsFileCount {
    char what[64];
    int n;
} CtsFileCount;

/* Zip files that stay unpacked in memory, from one search to the next, and for processes that are forked between. */
typedef struct CtsArchives CtsArchives;

typedef struct CtsSeriesList {
    CtsSeries *items; /* CT before PET before MR, those with most slices first, then by uid and part */
    size_t n;
    int n_files;        /* number of files read */
    const char **paths; /* of the files in folders and archives; n_paths, owned, among the texts */
    size_t n_paths;
    int n_not_ct;         /* passed over in silence: not DICOM, other modalities, DICOMDIR, ... */
    int n_unreadable;     /* DICOM that could not be read; findings name them */
    CtsFileCount *others; /* kinds of the n_not_ct files, most frequent first; n_others, owned */
    size_t n_others;
    CtsDiagnostics diagnostics;
    CtsArchives *archives;       /* zip files in memory, which slices are read from; owned */
    struct CtsStringPool *texts; /* which the slices share; owned */
} CtsSeriesList;

/* Paths are files, folders (searched to any depth), zip files of folders, DICOMDIRs or NIfTI CTs, which have no UID.
 * Reads headers only. Fails with CTS_ERR_READ when a path cannot be read and CTS_ERR_NO_SERIES when nothing is a
 * slice. n_threads 0: all cores. */
CtsStatus cts_series_find(const char *const *paths, int n_paths, int n_threads, CtsSeriesList **list, CtsReport *report,
                          CtsError *err);
void cts_series_list_free(CtsSeriesList **list);

void cts_archives_free(CtsArchives **archives);
/* The same by other rules, and among more than the paths. Plain data; all of it must outlast the call, and archives the
 * list. */
typedef struct CtsSeriesSearch {
    const char *const *paths;
    int n_paths, n_threads;
    bool images; /* lists series of images that are neither slices nor frames, too; none is renderable */
    CtsSeriesRules rules;
    const CtsArchives *archives;    /* archives whose members paths may name: "FILE.zip/MEMBER"; NULL: none */
    const CtsStudyNumbers *numbers; /* of more objects than the paths hold; NULL: of theirs */
} CtsSeriesSearch;
CtsStatus cts_series_search(const CtsSeriesSearch *search, CtsSeriesList **list, CtsReport *report, CtsError *err);

/* The skipped files, as text: "3 MR Image, 1 not DICOM"; "" without any. Truncated to size. */
void cts_series_list_others(const CtsSeriesList *list, char *text, size_t size);

/* Grid and position of a slice that is alone in its object. */
typedef struct CtsSlicePlace {
    int rows, columns;
    int series_number;                        /* (0020,0011); negative where missing */
    double row_spacing_mm, column_spacing_mm; /* along column_lps, along row_lps */
    double row_lps[3], column_lps[3];         /* unit directions of rising column and row index */
    double position_lps[3];                   /* centre of the first pixel, mm */
} CtsSlicePlace;

/* Stacks among n slices of one study that are each the only one of a series, as some anonymisers write a scan: 3 or
 * more of one size, orientation and pixel spacing that a series of them would be a volume of, at even distances. Sets
 * stack[i], for slice i, to the number of its stack, from 1 to *n_stacks, or to 0. */
CtsStatus cts_single_slices_find(const CtsSlicePlace *places, size_t n, int *stack, int *n_stacks, CtsError *err);

/* The diagnostic of such a stack; text for a format: UID of one of its series, number of the others, of all. */
#define CTS_SINGLE_SLICES_TEXT                                                                                         \
    "series %s and %d others are %d single slices that lie as one stack (give them one SeriesInstanceUID (0020,000E) " \
    "to render it)"

/* A file of an archive, valid during the call: a slice, or an object with labels. */
typedef struct CtsArchiveFile {
    const char *path;
    const char *why; /* reason why it cannot be read, or NULL; the other fields are then empty */
    const char *series_uid, *sop_uid;
    bool is_alone;         /* a series of its own, without a UID */
    const char *labels_of; /* study of a segmentation or a structure set; NULL: neither */
    const char *study_uid; /* of a slice; "" if missing */
    bool has_number;
    int instance_number; /* of a slice alone in its object */
    uint64_t bytes;
    int64_t mtime_ns;
    uint64_t n_voxels;          /* of all frames, by the header */
    const CtsSlicePlace *place; /* of a slice alone in its object, no scout and no page; NULL: of none */
} CtsArchiveFile;

typedef struct CtsArchiveCounts {
    uint64_t n_files, n_not_ct, n_unreadable;
    uint64_t n_objects; /* of n_not_ct: DICOM objects without an image */
    uint64_t n_packed;  /* of n_not_ct: zip files and the like, which are read only where they are named as paths */
} CtsArchiveCounts;

/* Reads the header of each file below paths once, in the folders' own order, and calls found for each slice or other
 * image, for each segmentation and structure set, and for each unreadable file; other files are only counted. Memory
 * does not grow with the number of files. found's status, when not CTS_OK, ends the search. *stop, unless stop is NULL,
 * ends it with CTS_ERR_INTERRUPTED. */
typedef CtsStatus (*CtsArchiveSink)(void *context, const CtsArchiveFile *file, CtsError *err);
typedef struct CtsArchiveSearch {
    const char *const *paths;
    int n_paths, n_threads;
    CtsArchiveSink found;
    void *context;
    CtsArchives **archives; /* receives the zip files among the paths; their members have paths of their own */
    const volatile sig_atomic_t *stop;
} CtsArchiveSearch;
CtsStatus cts_archive_search(const CtsArchiveSearch *search, CtsArchiveCounts *counts, CtsError *err);

/* The series named by uid (NULL: the renderable one with the most slices, or the first). "UID#2" names the second
 * volume of a UID that contains several, "2" the second series of the list. CTS_ERR_USAGE when there is none, and for
 * NULL where several renderable ones have the most slices. */
CtsStatus cts_series_choose(const CtsSeriesList *list, const char *uid, const CtsSeries **series, CtsError *err);

/* The number of its slices that this object contains; frame: this one of it, from 1; 0: all. */
int cts_series_count(const CtsSeries *series, const char *sop_uid, int frame);

/* The scanned slices of a series with their positions. Constant after reading; cts_scanned_volume() makes volumes for
 * pictures. Slice k's voxels are at grey[k * columns * rows] of `even`. */
typedef struct CtsScanned {
    int n_slices;
    int *number;               /* n_slices: which of the series' slices each is; damaged ones are left out */
    double (*position_lps)[3]; /* the centre of each slice's first voxel */
    double *layer;             /* position of each slice, in layers of `even`; NULL: slice k is layer k */
    CtsVolume *even;           /* place, size and HU of the evenly spaced volume; its grey may be handed over: NULL */
} CtsScanned;

/* Observer of the reading of slices. take (may be NULL) gets the stored values: called for words first <= n < end of
 * series->slices[slice], from `words` on, before they become grey levels; HU = slope * stored + intercept. From any
 * thread, one slice's from one thread and in order; a slice that is read again begins again. *stop (stop may be NULL),
 * set by a signal handler or another thread, ends the reading within a slice per thread, with CTS_ERR_INTERRUPTED. */
typedef struct CtsWordWatch {
    void (*take)(void *context, int slice, const uint16_t *words, size_t first, size_t end,
                 const struct CtsStored *stored, double slope, double intercept);
    void *context;
    const volatile sig_atomic_t *stop;
} CtsWordWatch;

/* Decodes the pixels, in parallel, each slice directly into its place. The list that contains the series must still
 * exist. Refuses a series that is not renderable. Adds the decode and grey stages and the series' warnings to report.
 * watch may be NULL. */
CtsStatus cts_series_scan(const CtsSeries *series, const CtsWordWatch *watch, int n_threads, CtsScanned **scanned,
                          CtsReport *report, CtsError *err);

void cts_scanned_free(CtsScanned **scanned);

/* Detects filling outside a scan from padding, rotating or masking: at least 16 voxels of exactly one value above -700
 * HU in a row or column from each of a slice's corners on, or from one corner on and 4 such rows or columns. False
 * where there is none, and where all values lie within 100 HU. */
bool cts_scanned_find_fill(const CtsScanned *scanned, double *hu);
/* Standard deviation of the noise of soft tissue in HU: of 0 to 100 HU, in squares of 4 x 4 voxels of at most 16
 * slices; 0 for another quantity, and where there is little soft tissue. Above CTS_NOISY_HU fat and muscle, which are
 * 150 HU apart, differ by less than five times the noise, at which a detail is detected (Rose 1948). */
enum { CTS_NOISY_HU = 30 };
double cts_scanned_noise_hu(const CtsScanned *scanned);
/* Voxels of exactly this value that are connected to the border of the volume, by faces, become air. */
CtsStatus cts_scanned_clear_fill(CtsScanned *scanned, double hu, int n_threads, uint64_t *n_cleared, CtsError *err);
CtsStatus cts_scanned_copy(const CtsScanned *scanned, CtsScanned **copy, CtsError *err);

/* Values from elsewhere than DICOM, a box of numbers in any order: voxel (a, b, c) is the number at
 * bytes + a * stride_bytes[0] + b * stride_bytes[1] + c * stride_bytes[2], and its centre lies at
 * origin_lps + a * step_lps[0] + b * step_lps[1] + c * step_lps[2] (mm). */
typedef enum CtsNumber { CTS_INT16, CTS_UINT16, CTS_INT32, CTS_FLOAT32, CTS_FLOAT64, CTS_N_NUMBERS } CtsNumber;
typedef struct CtsHuArray {
    const void *bytes;
    CtsNumber number;
    int dims[3];
    ptrdiff_t stride_bytes[3];
    double origin_lps[3], step_lps[3][3];
    CtsQuantity quantity;
    CtsModality modality;
} CtsHuArray;

/* A scan from an array: axes are permuted and reversed to a scanner's storage order (the thickest across the
 * slices, rows to the left or the back, columns to the back or the feet), which moves no voxel. Non-finite values
 * become padding. Refuses steps that do not span space, and numbers that are not HU where
 * the quantity is HU. */
CtsStatus cts_scanned_of_hu(const CtsHuArray *given, int n_threads, CtsScanned **scanned, CtsReport *report,
                            CtsError *err);

/* Evenly spaced layers, as a volume of its own, interpolated like cts_volume_interpolate() where slices are unevenly
 * spaced. Adds to *made. hand_over: no other volume will be made of it; the slices' own memory becomes the volume, and
 * scanned keeps only their positions. Layers of unevenly spaced slices need memory beside the slices' in any case. */
CtsStatus cts_scanned_volume(CtsScanned *scanned, CtsInterpolation how, bool hand_over, int n_threads,
                             CtsVolume **volume, CtsInterpolationCounts *made, CtsError *err);

/* Slices that are unevenly spaced (scanned->layer) and not handed over, as linear layers. */
CtsLinearLayers cts_scanned_linear_layers(const CtsScanned *scanned);
/* Of such slices, voxels low[] to high[], inclusive, of a volume: low[] is even; the others are
 * counted as air. last: the memory of the slices is freed. */
CtsStatus cts_scanned_box(CtsScanned *scanned, CtsInterpolation how, const int low[3], const int high[3], bool last,
                          int n_threads, CtsVolume **volume, CtsInterpolationCounts *made, CtsError *err);

/* Both in one, with linear interpolation, for a single volume. stop: as in a CtsWordWatch. */
CtsStatus cts_series_load(const CtsSeries *series, int n_threads, const volatile sig_atomic_t *stop, CtsVolume **volume,
                          CtsReport *report, CtsError *err);

CTS_API_END
