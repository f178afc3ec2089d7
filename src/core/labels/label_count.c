#include "base/mem.h"
#include "base/vec3.h"
#include "core/labels/label_set.h"
#include "core/volume/components.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define AIR_SHARE 0.2 /* of a label that is no air itself */

/* Names of structures that may contain air. */
static const char *const airy[] = {"lung", "airway", "trachea", "bronch", "bowel", "colon", "air", "gas"};

static bool may_hold_air(const CtsLabel *l)
{
    for (size_t i = 0; i < sizeof airy / sizeof *airy; i++)
        if (strcasestr(l->fact.name, airy[i]))
            return true;
    return l->surrounds;
}

/* Removes the items, which begin with a row, in slices that could not be read, and renumbers the rows of the others. */
static size_t keep_rows(void *items, size_t size, size_t n, uint32_t n_rows, const int *new_number)
{
    char *to = items;
    for (size_t i = 0; i < n; i++) {
        const char *const from = (const char *)items + i * size;
        uint32_t row;
        memcpy(&row, from, sizeof row);
        const int slice = new_number[row / n_rows];
        if (slice < 0)
            continue;
        row = (uint32_t)slice * n_rows + row % n_rows;
        memmove(to, from, size);
        memcpy(to, &row, sizeof row);
        to += size;
    }
    return (size_t)(to - (char *)items) / size;
}

double cts_label_slice_at_mm(const CtsLabelGrid *g, int slice)
{
    return cts_dot3(g->position_lps[slice], g->normal_lps);
}

double cts_label_slice_thickness_mm(const CtsLabelGrid *g, int slice)
{
    const int before = slice > 0 ? slice - 1 : slice, behind = slice + 1 < g->n_slices ? slice + 1 : slice;
    const double apart_mm = cts_label_slice_at_mm(g, behind) - cts_label_slice_at_mm(g, before);
    return behind > before ? apart_mm / (behind - before) : 0;
}

static CtsStatus drop_slices(CtsLabels *labels, const int *slice_number, int n_kept, CtsError *err)
{
    CtsLabelGrid *const g = &labels->grid;
    int *new_number = NULL;
    const CtsStatus st = cts_alloc_array(&new_number, (size_t)g->n_slices, err);
    if (st)
        return st;
    for (int k = 0; k < g->n_slices; k++)
        new_number[k] = -1;
    for (int k = 0; k < n_kept; k++) {
        new_number[slice_number[k]] = k;
        memmove(g->position_lps[k], g->position_lps[slice_number[k]], sizeof *g->position_lps);
    }
    g->n_slices = n_kept;
    for (CtsLabel *l = labels->items; l < labels->items + labels->n; l++) {
        l->n_runs = keep_rows(l->runs, sizeof *l->runs, l->n_runs, (uint32_t)g->rows, new_number);
        l->n_shares = keep_rows(l->shares, sizeof *l->shares, l->n_shares, (uint32_t)g->rows, new_number);
    }
    cts_free(&new_number);
    return CTS_OK;
}

static bool is_at_edge(CtsLabelRun r, const CtsLabelGrid *g)
{
    const uint32_t rows = (uint32_t)g->rows, slice = r.row / rows, row = r.row % rows;
    return r.first == 0 || r.end == g->columns || row == 0 || row + 1 == rows || slice == 0 ||
           slice + 1 == (uint32_t)g->n_slices;
}

double cts_label_ml(const CtsLabel *l, const CtsLabelGrid *g)
{
    double area[3], ml = 0;
    cts_cross3(g->step_lps[0], g->step_lps[1], area);
    const double area_mm2 = cts_norm3(area);
    const uint32_t rows = (uint32_t)g->rows;
    uint64_t here = 0;
    for (size_t i = 0; i < l->n_runs; i++) {
        const uint32_t slice = l->runs[i].row / rows;
        here += (uint64_t)(l->runs[i].end - l->runs[i].first);
        if (i + 1 < l->n_runs && l->runs[i + 1].row / rows == slice)
            continue;
        ml += (double)here * area_mm2 * cts_label_slice_thickness_mm(g, (int)slice) / 1000;
        here = 0;
    }
    return ml;
}

static void count_label_voxels(CtsLabel *l, const CtsLabelGrid *g)
{
    for (size_t i = 0; i < l->n_runs; i++) {
        l->fact.touches_edge |= is_at_edge(l->runs[i], g);
        l->fact.voxels += (uint64_t)(l->runs[i].end - l->runs[i].first);
    }
    l->fact.ml = cts_label_ml(l, g);
}

/* One label's runs in one slice, from its cursor on: marked as held once or more often, or those counted. */
static void pass_over(CtsLabel *l, size_t *at, uint32_t slice, const CtsLabelGrid *g, uint8_t *held, bool count)
{
    const uint32_t rows = (uint32_t)g->rows, end = (slice + 1) * rows;
    size_t i = *at;
    for (; i < l->n_runs && l->runs[i].row < end; i++) {
        const CtsLabelRun r = l->runs[i];
        uint8_t *const row = held + (size_t)(r.row - slice * rows) * (size_t)g->columns;
        for (int x = r.first; x < r.end; x++)
            if (count)
                l->fact.overlap += row[x] > 1;
            else
                row[x] = row[x] ? 2 : 1;
    }
    if (count)
        *at = i;
}

static CtsStatus count_overlap(CtsLabels *labels, CtsError *err)
{
    const CtsLabelGrid *const g = &labels->grid;
    const size_t n = (size_t)g->columns * (size_t)g->rows;
    uint8_t *held = NULL;
    size_t *at = NULL;
    CtsStatus st = cts_alloc_array(&held, n, err);
    if (!st)
        st = cts_alloc_zeroed(&at, labels->n, err);
    for (uint32_t k = 0; !st && k < (uint32_t)g->n_slices; k++) {
        memset(held, 0, n);
        for (int pass = 0; pass < 2; pass++)
            for (size_t i = 0; i < labels->n; i++)
                pass_over(&labels->items[i], &at[i], k, g, held, pass == 1);
    }
    cts_free(&held);
    cts_free(&at);
    return st;
}

static void report_label(const CtsLabelFact *f, CtsReport *report)
{
    cts_report_label(report, f);
    if (f->in_air)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_LABEL_IN_AIR,
                              "label file %d: %.0f %% of label %d (%s) lie below %d HU (a mirrored or shifted mask?)",
                              f->file, 100 * f->air_share, f->number, f->name, (int)CTS_LABEL_AIR_HU);
}

/* Number of 26-connected parts of a label. */
static CtsStatus count_parts(CtsLabel *l, const CtsLabelGrid *g, CtsError *err)
{
    CtsComponents p = {.dims = {g->columns, g->rows, g->n_slices}, .n_runs = (uint32_t)l->n_runs};
    const size_t n_rows = (size_t)g->rows * (size_t)g->n_slices;
    CtsStatus st;
    uint32_t n = 0;
    if (l->n_runs > UINT32_MAX)
        return cts_fail(err, CTS_ERR_MEMORY, "a label of too many pieces");
    if (!(st = cts_alloc_array(&p.runs, l->n_runs, err)) && !(st = cts_alloc_array(&p.row_start, n_rows + 1, err))) {
        for (size_t row = 0; row <= n_rows; row++) {
            p.row_start[row] = n;
            for (; n < p.n_runs && l->runs[n].row == row; n++)
                p.runs[n] = (CtsRun){l->runs[n].first, l->runs[n].end, n};
        }
        st = cts_components_join(&p, CTS_CONNECTED_BY_CORNERS, err);
    }
    l->fact.parts = p.n_parts;
    cts_components_free(&p);
    return st;
}

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

/* Of a pair of labels the left one must lie left of the right one. That detects mirrored masks of symmetric anatomy,
 * none of whose voxels lie in air. */
static CtsStatus report_laterality(const CtsLabels *labels, CtsReport *report, CtsError *err)
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

CtsStatus cts_labels_count(CtsLabels *labels, const int *slice_number, int n_kept, CtsReport *report, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (size_t i = 0; i < labels->n; i++)
        cts_label_take_sums(&labels->items[i], slice_number, n_kept);
    if (n_kept < labels->grid.n_slices)
        st = drop_slices(labels, slice_number, n_kept, err);
    for (size_t i = 0; !st && i < labels->n; i++) {
        CtsLabel *const l = &labels->items[i];
        count_label_voxels(l, &labels->grid);
        l->fact.in_air = labels->grid.quantity == CTS_QUANTITY_HU && l->fact.air_share > AIR_SHARE && !may_hold_air(l);
        st = count_parts(l, &labels->grid, err);
    }
    if (!st && labels->n > 1)
        st = count_overlap(labels, err);
    for (size_t i = 0; !st && i < labels->n; i++)
        report_label(&labels->items[i].fact, report);
    if (!st && labels->n > 1)
        st = report_laterality(labels, report, err);
    labels->counted = !st;
    return st;
}
