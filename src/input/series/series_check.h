/* From slices and other files to series. */
#pragma once

#include "ctsplat/series.h"
#include "dicom/header/slice.h"

/* From the slices of one SeriesInstanceUID to series that can be loaded, or that are refused with a reason. */

/* The slices of a series while they are being checked; owned. */
typedef struct CtsSliceSet {
    CtsSlice **items;
    int n;
} CtsSliceSet;

void cts_slice_set_free(CtsSliceSet *set);
/* Keeps the slices for which keep[i] is set, frees the others. */
void cts_slice_set_filter(CtsSliceSet *set, const bool *keep);

/* Checks a set by the rules, with the instance numbers of all objects of the study; empties the set; adds a series to
 * the list, or several where one series UID holds several volumes. Fails only without memory. */
CtsStatus cts_series_check(CtsSliceSet *set, const CtsSeriesRules *rules, const CtsStudyNumbers *numbers,
                           CtsSeriesList *list, CtsError *err);

/* True if both have one size, orientation and pixel spacing. */
bool cts_slice_same_grid(const CtsSlice *a, const CtsSlice *b);

/* Sort along the normal of `reference`; slices at one position by acquisition, time and name. */
void cts_slice_set_sort(CtsSliceSet *set, const CtsSlice *reference);

/* True if b, after a in a sorted set, lies at the position of a. */
bool cts_slice_same_place(const CtsSlice *a, const CtsSlice *b, double same_mm);
/* Removes duplicate slices: same position and same HU, whatever the encoding, to the rounding of the coarser rescale
 * slope. Of each, the one of the smallest SOPInstanceUID stays and owns the others (CtsSlice.copy). *n_dropped counts
 * them. */
CtsStatus cts_slice_set_drop_copies(CtsSliceSet *set, double same_mm, int *n_dropped, CtsError *err);

/* Moves the slices of MR or PET to a set for each grid, since an orientation is a volume of its own. Slices that are
 * alone on a grid stay, with a diagnostic. *n_grids is 0, and the set unchanged, where there is one grid or none with
 * several slices. */
CtsStatus cts_slice_set_grids(CtsSliceSet *set, CtsSeries *series, CtsSliceSet **grids, int *n_grids, CtsError *err);
/* Adds slices with the pixel grid of one and nearly its orientation, which may jitter (normals within 8 degrees;
 * settle_orientation() is stricter); keep marks them, and n_kept counts them. */
void cts_slice_set_take_jittering(const CtsSliceSet *set, const CtsSlice *one, CtsSeries *series, bool *keep,
                                  int *n_kept);

/* True if two neighbours of a sorted set lie at one position. */
bool cts_slice_set_repeats(const CtsSliceSet *set, double same_mm);

/* Splits a set into complete parts where several slices share positions, or slices of two volumes alternate along the
 * stack: of CT by one of acquisition number, tube voltage, temporal position, trigger time, cardiac phase, kernel and
 * time, and into slices of different thickness that share a range of positions, complete or not; of MR by echo,
 * inversion time, flip angle, diffusion, time, image type and component, and of PET by time, also by several of these
 * within each other where positions repeat, as they do of dynamic and gated PET alone. *n_parts is 0, and the set
 * unchanged, when no split is needed or none gives complete parts. *by: the criterion that separates, or would
 * separate, them; NULL: none does. */
CtsStatus cts_slice_set_split(CtsSliceSet *set, double same_mm, CtsSliceSet **parts, int *n_parts, const char **by,
                              CtsError *err);

/* True if the instance numbers rise or fall monotonically, in the whole stack or in each of the acquisitions, of three
 * slices or more, that follow each other along it; repeated numbers show no order. */
bool cts_slice_set_in_order(const CtsSliceSet *set);

/* Missing slices, counted by instance numbers (0020,0013): a gap of a sorted set lacks n - 1 slices if the number steps
 * by n over it, the slices are much thinner than the gap, an n-th of the gap is about as wide as a slice is thick or as
 * the smallest gap, and most of the skipped numbers belong to no other object of the study. */
typedef struct CtsMissingSlices {
    int n;     /* 0: none */
    int every; /* n, if every gap misses n slices; else 0 */
    int first; /* the first gap that holds some follows this slice; of it: */
    double gap_mm, thickness_mm;
} CtsMissingSlices;
CtsMissingSlices cts_slice_set_missing(const CtsSliceSet *set, const CtsStudyNumbers *numbers);

/* Sets lacks of each slice whose object is a part of a concatenation: the parts missing by the numbers and offsets of
 * the present ones. The texts are kept in texts. */
CtsStatus cts_concatenations_check(CtsSlice *const *slices, size_t n, CtsStringPool *texts, CtsError *err);

/* Quantity of n slices' values, after multiplication by factor. */
typedef struct CtsValueScale {
    CtsQuantity quantity;
    double factor;
    char why[400]; /* reason why it is not SUVbw of PET; "" where it is, and of other modalities */
} CtsValueScale;

/* SUVbw as QIBA's vendor-neutral formula computes it, with one factor for all slices; Bq/ml where attributes are
 * missing, and stored values where the unit is another one. */
CtsValueScale cts_pet_scale(const CtsSlice *const *slices, int n);

/* Grid and position of a slice; false for one without a sound position, a scout, a page or a frame. */
bool cts_slice_place(const CtsSlice *slice, CtsSlicePlace *place);

/* Adds a note for each stack of single slices in a complete list. */
CtsStatus cts_single_slices_report(CtsSeriesList *list, CtsError *err);
