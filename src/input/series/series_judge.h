/* From slices and other files to series. */
#ifndef CTS_SERIES_SERIES_JUDGE_H
#define CTS_SERIES_SERIES_JUDGE_H

#include "ctsplat/series.h"
#include "dicom/header/slice.h"

/* From the slices of one SeriesInstanceUID to series that can be loaded, or that are refused with a reason. */

/* Slices of one series while they are being sorted out; owns them. */
enum { CTS_MAX_PARTS = 64 }; /* volumes in one series */

typedef struct CtsSliceSet {
    CtsSlice **items;
    int n;
} CtsSliceSet;

void cts_slice_set_free(CtsSliceSet *set);
/* Keep the slices for which keep[i] is set, free the others. */
void cts_slice_set_filter(CtsSliceSet *set, const bool *keep);

/* Judge a set by the rules, with the numbers of all objects around it; it is emptied; fills the first of CTS_MAX_PARTS
 * zeroed series, or several where one series UID holds several volumes. Fails only for want of memory; the series are
 * the caller's to free then too. */
CtsStatus cts_series_judge(CtsSliceSet *set, const CtsSeriesRules *rules, const CtsStudyNumbers *numbers,
                           CtsSeries series[CTS_MAX_PARTS], int *n_series, CtsError *err);

/* Sort along the normal of `reference`; slices at one position by acquisition, time and name. */
void cts_slice_set_sort(CtsSliceSet *set, const CtsSlice *reference);

/* Drop slices that stand twice: same position, same pixels and rescale. *n_dropped counts them. */
CtsStatus cts_slice_set_drop_copies(CtsSliceSet *set, double same_mm, int *n_dropped, CtsError *err);

/* Whether two neighbours of a sorted set lie at one position. */
bool cts_slice_set_repeats(const CtsSliceSet *set, double same_mm);

/* Split a set into parts that are whole each where several slices lie at some positions, or slices of two acquisitions
 * take turns along the stack: by acquisition number, tube voltage, temporal position, trigger time, cardiac phase,
 * kernel, or time. *n_parts is 0, and the set as it was, when nothing asks for a split or none gives whole parts. *by:
 * what parted them, or would have; NULL: nothing does. */
CtsStatus cts_slice_set_split(CtsSliceSet *set, double same_mm, CtsSliceSet *parts, int max_parts, int *n_parts,
                              const char **by, CtsError *err);

/* Whether slices rise or fall in number, first <= i < end, whichever; numbers that repeat show no order. */
bool cts_slice_set_in_order(const CtsSliceSet *set, int first, int end);
/* The slice after the last of those that share i's acquisition. */
int cts_slice_set_acquisition_end(const CtsSliceSet *set, int i);
/* Acquisitions of three slices or more that follow each other along the stack, each in an order of its own. */
bool cts_slice_set_each_in_order(const CtsSliceSet *set);

/* Slices that instance numbers (0020,0013) count between those that are there: a gap of a sorted set holds n - 1 of
 * them where the number steps by n over it, the slices are much thinner than it, a slice a step is a step as thick as
 * they are or as the smallest gap is, and most of the numbers that are passed are no other object's of the study. */
typedef struct CtsMissingSlices {
    int n;     /* 0: none */
    int every; /* where every gap holds as many: n of it; else 0 */
    int first; /* the first gap that holds some follows this slice; of it: */
    double gap_mm, thickness_mm;
} CtsMissingSlices;
CtsMissingSlices cts_slice_set_missing(const CtsSliceSet *set, const CtsStudyNumbers *numbers);

/* Slices whose orientations jitter about one direction, so that by the mean of them no voxel moves by more than a tenth
 * of a pixel, and whose direction does not drift along the stack: true, and they have that mean. keep: which of the
 * set's slices are meant. */
bool cts_slice_set_settle(const CtsSliceSet *set, const bool *keep);

/* Says of each slice whose object is a part of a concatenation which parts of that are missing, by the numbers and
 * offsets of those that are there. The words are kept in texts. */
CtsStatus cts_concatenations_check(CtsSlice *const *slices, size_t n, CtsTexts *texts, CtsError *err);

/* What files are that are no CT slices: counted by kind. */

/* n files that are no DICOM; packed: NULL, or what they seem to be packed with. */
CtsStatus cts_others_add_files(CtsSeriesList *list, int n, const char *packed, CtsError *err);
/* n that are no files, and are not followed. */
CtsStatus cts_others_add_special(CtsSeriesList *list, int n, CtsError *err);
/* A DICOM object of this SOP class; "" where it names none. */
CtsStatus cts_others_add_object(CtsSeriesList *list, const char *class_uid, CtsError *err);
/* Once all are there: most frequent first, then by name. */
void cts_others_sort(CtsSeriesList *list);

#endif
