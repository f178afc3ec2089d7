/* Labels while they are made and chosen. */
#pragma once

#include "ctsplat/labels.h"

/* Labels while they are made, run by run. */

enum { CTS_MAX_LABELS = 65535, CTS_LABEL_AIR_HU = -900 };

/* Takes ownership of the grid's contents, also on failure. */
CtsStatus cts_labels_new(CtsLabels **labels, CtsLabelGrid *grid, CtsError *err);
/* Position of a slice along the normal; and half the sum of the gaps on both of its sides, at an end the one gap. */
double cts_label_slice_at_mm(const CtsLabelGrid *grid, int slice);
double cts_label_slice_thickness_mm(const CtsLabelGrid *grid, int slice);

/* Adds a label without voxels; name is copied and sanitised. CTS_ERR_READ when there are too many. */
CtsStatus cts_labels_add(CtsLabels *labels, int file, int number, const char *name, CtsLabelSource source,
                         CtsError *err);
/* A name for several labels of a file; name and numbers are copied. */
CtsStatus cts_labels_add_region(CtsLabels *labels, int file, const char *name, const int *numbers, size_t n,
                                CtsError *err);
void cts_label_regions_free(CtsLabelRegion *regions, size_t n);
/* Notes a label that is not added, and why. */
CtsStatus cts_labels_leave_out(CtsLabels *labels, int file, int number, const char *name, const char *reason,
                               CtsError *err);
/* Voxels of one row, which may be there already; rows in any order. */
CtsStatus cts_label_add_run(CtsLabel *label, uint32_t row, int first, int end, CtsError *err);
/* A share, more than nothing and less than all, of a voxel; in any order. */
CtsStatus cts_label_add_share(CtsLabel *label, uint32_t row, int column, int share, CtsError *err);
/* Its colour as PS3.3 C.10.7.1.1 encodes CIELab: 0 to 65535 each, L* to 100, a* and b* from -128 to 127. */
void cts_label_take_lab(CtsLabel *label, const int lab[3]);
/* Sorts runs and joins adjacent ones; sorts fractions. */
void cts_label_sort_runs(CtsLabel *label);
/* The first run, or share, at or behind a row. */
size_t cts_label_find_row(const CtsLabel *label, uint32_t row);
size_t cts_label_find_share(const CtsLabel *label, uint32_t row);

/* Volume of its runs. */
double cts_label_ml(const CtsLabel *label, const CtsLabelGrid *grid);
void cts_label_take_sums(CtsLabel *label, const int *slice_number, int n_kept);
void cts_label_sums_free(CtsLabel *label);

/* Assigns the model's voxels: voxel label i of n is assigned to the voxels of label[i], and the later one in `order`
 * wins; unlabelled voxels get number n. Sets no appearances; cts_voxel_labels_finish() must follow. */
CtsStatus cts_labels_to_volume(const CtsLabels *labels, const size_t *label, const size_t *order, size_t n,
                               CtsModel *model, int n_threads, CtsError *err);

/* Selection of labels by name or number. */

/* Sets hit[i] = value for each label i that one list item names, hit[labels->n] for `rest`, and hit[labels->n + 1] to
 * 1 + the index of a label that was left out. option: the list's option, for messages. CTS_ERR_USAGE for an unknown
 * item, or an ambiguous one that several files have. */
CtsStatus cts_label_find(const CtsLabels *labels, const char *option, const char *item, size_t length, uint32_t value,
                         uint32_t *hit, CtsError *err);
/* Length of the longest name that matches before a separator, a comma or =, since names may contain these; with a comma
 * the end of the text matches too. 0: none. */
size_t cts_label_name_length(const CtsLabels *labels, const char *text, char separator);
/* The same for all items of a list, a JSON array or names separated by commas: values rise from 1 on, and labels
 * already hit keep their value. lacking: items that no label has, separated by commas, in CTS_LACKING_TEXT bytes; NULL:
 * they are refused. */
CtsStatus cts_label_find_list(const CtsLabels *labels, const char *option, const char *list, uint32_t *hit,
                              char *lacking, CtsError *err);
/* CTS_ERR_GEOMETRY where nothing was hit but a label that was left out. */
CtsStatus cts_label_check_shown(const CtsLabels *labels, const uint32_t *hit, CtsError *err);

struct CtsAppearance;
/* Parses an appearance, without a name in front. */
CtsStatus cts_label_appearance_parse(const char *text, struct CtsAppearance *appearance, CtsError *err);
/* The default colour of the n-th label: distinguishable with any kind of colour vision. */
void cts_label_colour(size_t n, double rgb[3]);
