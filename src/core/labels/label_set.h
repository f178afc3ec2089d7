/* Labels while they are made and chosen. */
#ifndef CTS_LABELS_LABEL_SET_H
#define CTS_LABELS_LABEL_SET_H

#include "ctsplat/labels.h"

/* Labels while they are made, run by run. */

enum { CTS_MAX_LABELS = 65535, CTS_LABEL_AIR_HU = -900 };

/* Takes over what the grid owns, also when it fails. */
CtsStatus cts_labels_new(CtsLabels **labels, CtsLabelGrid *grid, CtsError *err);
void cts_label_grid_free(CtsLabelGrid *grid);
/* thickness_mm from at_mm. */
void cts_label_grid_thickness(CtsLabelGrid *grid);

/* Another label without voxels; name is copied and made safe to show. CTS_ERR_READ when there are too many. */
CtsStatus cts_labels_add(CtsLabels *labels, int file, int number, const char *name, CtsLabelSource source,
                         CtsError *err);
/* Another object that labels come from. */
CtsStatus cts_labels_add_object(CtsLabels *labels, const CtsLabelObject *object, CtsError *err);
/* A name for several labels of a file; name and numbers are copied. */
CtsStatus cts_labels_add_region(CtsLabels *labels, int file, const char *name, const int *numbers, size_t n,
                                CtsError *err);
/* Voxels of one row, which may be there already; rows in any order. */
CtsStatus cts_label_add_run(CtsLabel *label, uint32_t row, int first, int end, CtsError *err);
/* A share, more than nothing and less than all, of a voxel; in any order. */
CtsStatus cts_label_add_share(CtsLabel *label, uint32_t row, int column, int share, CtsError *err);
/* Its colour as PS3.3 C.10.7.1.1 encodes CIELab: 0 to 65535 each, L* to 100, a* and b* from -128 to 127. */
void cts_label_take_lab(CtsLabel *label, const int lab[3]);
/* Runs in order, and those that touch made one; shares in order. */
void cts_label_sort_runs(CtsLabel *label);
/* The first run, or share, at or behind a row. */
size_t cts_label_find_row(const CtsLabel *label, uint32_t row);
size_t cts_label_find_share(const CtsLabel *label, uint32_t row);

/* Steps of counting that are files of their own. */
uint64_t cts_label_parts(const CtsLabel *label, int rows, CtsStatus *status, CtsError *err);
void cts_label_take_sums(CtsLabel *label, const int *slice_number, int n_kept);
void cts_label_sums_free(CtsLabel *label);
/* Of labels that are counted: adds the finding label_mirrored. */
CtsStatus cts_label_tell_sides(const CtsLabels *labels, CtsReport *report, CtsError *err);

/* Gives the voxels of a volume their owners: of n, owner i holds what label[i] does, and the one that stands later in
 * `order` wins; the rest is number n. Looks are still to be said, and the owners to be finished. */
CtsStatus cts_labels_paint(const CtsLabels *labels, const size_t *label, const size_t *order, size_t n, CtsVolume *v,
                           int n_threads, CtsError *err);

/* Which labels the words of a choice mean. */

/* Sets hit[i] = value for each label i that one item of a list names, and hit[labels->n] for the rest. option: whose
 * list it is, for messages. CTS_ERR_USAGE where it names none, or without a file what several files have. */
CtsStatus cts_label_find(const CtsLabels *labels, const char *option, const char *item, size_t length, uint32_t value,
                         uint32_t *hit, CtsError *err);
/* Whether an item names a label, a region, all or the rest. */
bool cts_label_fits(const CtsLabels *labels, const char *item, size_t length);
/* The length of the longest name that fits in front of a separator, a comma or =, since names may hold these; a comma
 * is as good as the end. 0: none fits. */
size_t cts_label_name_length(const CtsLabels *labels, const char *text, char separator);
/* The same with all items of a list, a JSON array or names with commas between them: values rise from 1 on, and what
 * was hit keeps its value. */
CtsStatus cts_label_find_list(const CtsLabels *labels, const char *option, const char *list, uint32_t *hit,
                              CtsError *err);
/* The same of a list `show` for what these labels have; what they lack, with commas between, is to be freed. */
CtsStatus cts_label_find_present(const CtsLabels *labels, const char *show, uint32_t *hit, char **lacking,
                                 CtsError *err);

struct CtsOwnerLook;
/* The look that a text asks for, without a name in front. */
CtsStatus cts_label_look(const char *text, struct CtsOwnerLook *look, CtsError *err);
/* The colour of the n-th label that has none of its own: told apart by all who see, however they see colours. */
void cts_label_colour(size_t n, double rgb[3]);

#endif
