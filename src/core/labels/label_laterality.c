/* Laterality check: of a pair of labels the left one must lie left of the right one. It detects mirrored masks of
 * symmetric anatomy, none of whose voxels lie in air. */
#include "base/mem.h"
#include "core/labels/label_set.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The centre of a label's voxels along the patient's axis to the left. */
static double centre_left_mm(const CtsLabel *l, const CtsLabelGrid *g)
{
    double sum = 0;
    for (size_t i = 0; i < l->n_runs; i++) {
        const CtsLabelRun r = l->runs[i];
        const double j = r.row % (uint32_t)g->rows, middle = (r.first + r.end - 1) / 2.0;
        sum += (r.end - r.first) *
               (g->position_lps[r.row / (uint32_t)g->rows][0] + middle * g->step_lps[0][0] + j * g->step_lps[1][0]);
    }
    return sum / (double)l->fact.voxels;
}

static int by_name(const void *a, const void *b)
{
    const CtsLabel *x = *(const CtsLabel *const *)a, *y = *(const CtsLabel *const *)b;
    return x->fact.file != y->fact.file ? x->fact.file - y->fact.file : strcasecmp(x->fact.name, y->fact.name);
}

/* The label of the same file with "right" for "left" in its name; NULL: none, or one of them is empty. */
static const CtsLabel *other_side(const CtsLabel *left, const CtsLabel *const *sorted, size_t n)
{
    char name[600];
    const char *const at = strcasestr(left->fact.name, "left");
    if (!at || !left->fact.voxels || strlen(left->fact.name) + 2 > sizeof name)
        return NULL;
    const int before = (int)(at - left->fact.name);
    snprintf(name, sizeof name, "%.*sright%s", before, left->fact.name, at + strlen("left"));
    const CtsLabel wanted = {.fact = {.file = left->fact.file, .name = name}}, *key = &wanted;
    const CtsLabel *const *const found = bsearch(&key, sorted, n, sizeof *sorted, by_name);
    return found && (*found)->fact.voxels ? *found : NULL;
}

/* Of each file's pairs; a single one may be named wrongly, or lie so, and most of them can't. */
static void warn_mirrored(const CtsLabels *labels, const CtsLabel *const *sorted, CtsReport *report)
{
    for (size_t i = 0, n_pairs = 0, n_wrong = 0; i < labels->n; i++) {
        const CtsLabel *const left = sorted[i], *const right = other_side(left, sorted, labels->n);
        if (right) {
            n_pairs++;
            n_wrong += centre_left_mm(left, &labels->grid) < centre_left_mm(right, &labels->grid);
        }
        if (i + 1 < labels->n && sorted[i + 1]->fact.file == left->fact.file)
            continue;
        if (2 * n_wrong > n_pairs)
            cts_report_diagnostic(
                report, CTS_DIAGNOSTIC_LABEL_MIRRORED,
                "label file %d: in %zu of %zu pairs the left one lies to the right of the right one (a "
                "mirrored mask, or a mirrored scan?)",
                left->fact.file, n_wrong, n_pairs);
        n_pairs = n_wrong = 0;
    }
}

CtsStatus cts_label_report_laterality(const CtsLabels *labels, CtsReport *report, CtsError *err)
{
    const CtsLabel **sorted = NULL;
    const CtsStatus st = cts_alloc_bytes((void **)&sorted, labels->n, sizeof *sorted, err);
    if (st)
        return st;
    for (size_t i = 0; i < labels->n; i++)
        sorted[i] = &labels->items[i];
    qsort(sorted, labels->n, sizeof *sorted, by_name);
    warn_mirrored(labels, sorted, report);
    cts_free_bytes(sorted);
    return CTS_OK;
}
