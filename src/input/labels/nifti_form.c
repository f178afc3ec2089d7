/* Of a label map that has two places, the one that the series has. */
#include "base/vec3.h"
#include "input/labels/label_reading.h"
#include <string.h>

/* Distance of corners, in voxels, up to which grids count as equal: less than an edge moves by interpolation, and more
 * than rounding to float. */
#define SAME_VOXELS 0.1

/* True if a point is a corner of the file's box under a form. */
static bool is_corner(const CtsNifti *f, const CtsNiftiPlace *p, const double point_lps[3])
{
    double from_origin[3], across[3][3], volume;
    for (int c = 0; c < 3; c++)
        from_origin[c] = point_lps[c] - p->origin_lps[c];
    for (int a = 0; a < 3; a++)
        cts_cross3(p->step_lps[(a + 1) % 3], p->step_lps[(a + 2) % 3], across[a]);
    volume = cts_dot3(p->step_lps[0], across[0]);
    for (int a = 0; a < 3; a++) {
        const double index = cts_dot3(from_origin, across[a]) / volume;
        const bool at_end = f->dims[a] > 1 && index > 0.5 * (f->dims[a] - 1);
        if (!(fabs(index - (at_end ? f->dims[a] - 1 : 0)) <= SAME_VOXELS))
            return false;
    }
    return true;
}

static bool equals_grid(const CtsNifti *f, const CtsNiftiPlace *p, const CtsLabelGrid *g)
{
    const int last[3] = {g->columns - 1, g->rows - 1, g->n_slices - 1};
    const size_t n = (size_t)g->columns * (size_t)g->rows * (size_t)g->n_slices;
    for (int k = 0; k < 8; k++) {
        double point[3];
        for (int c = 0; c < 3; c++)
            point[c] = g->position_lps[k & 4 ? last[2] : 0][c] + (k & 1 ? last[0] : 0) * g->step_lps[0][c] +
                       (k & 2 ? last[1] : 0) * g->step_lps[1][c];
        if (!is_corner(f, p, point))
            return false;
    }
    return n == (size_t)f->dims[0] * (size_t)f->dims[1] * (size_t)f->dims[2];
}

/* The same voxels in the same order. */
static bool same_place(const CtsNiftiPlace *p, const CtsNiftiPlace *ct, const int dims[3])
{
    double off[3];
    for (int a = 0; a < 4; a++) {
        const double *x = a < 3 ? p->step_lps[a] : p->origin_lps, *y = a < 3 ? ct->step_lps[a] : ct->origin_lps;
        for (int c = 0; c < 3; c++)
            off[c] = x[c] - y[c];
        if (!(cts_norm3(off) <= (a < 3 ? SAME_VOXELS / dims[a] : SAME_VOXELS) * cts_norm3(ct->step_lps[a % 3])))
            return false;
    }
    return true;
}

/* The CT's voxels as they are stored: of DICOM columns, rows and sorted slices; of NIfTI as its file has them. */
static CtsNiftiPlace place_of_ct(const CtsSeries *series, const CtsLabelGrid *g)
{
    CtsNiftiPlace place = {.given = true};
    CtsFileBytes file = {.fd = -1};
    CtsNifti ct = {0};
    for (int c = 0; c < 3; c++) {
        place.origin_lps[c] = g->position_lps[0][c];
        place.step_lps[0][c] = g->step_lps[0][c];
        place.step_lps[1][c] = g->step_lps[1][c];
        place.step_lps[2][c] =
            (g->position_lps[g->n_slices - 1][c] - g->position_lps[0][c]) / (g->n_slices > 1 ? g->n_slices - 1 : 1);
    }
    if (series->no_patient && !cts_slice_open(series->slices[0], &file, NULL) && !cts_nifti_open(&ct, &file, NULL)) {
        cts_nifti_take_form(&ct, series->rules.nifti_form);
        place = ct.place;
    }
    cts_nifti_close(&ct);
    cts_file_bytes_close(&file);
    return place;
}

CtsStatus cts_label_take_form(const CtsLabelReading *reading, CtsNifti *f, CtsError *err)
{
    const CtsLabelGrid *const grid = &reading->labels->grid;
    const CtsNiftiForm asked = reading->series->rules.nifti_form;
    char text[CTS_NIFTI_FORMS_TEXT];
    const CtsNiftiForms forms = cts_nifti_compare_forms(f, text);
    cts_nifti_take_form(f, asked);
    if (asked != CTS_NIFTI_FORM_AUTO || forms == CTS_NIFTI_FORMS_AGREE)
        return CTS_OK;
    bool equal_s = equals_grid(f, &f->sform, grid), equal_q = equals_grid(f, &f->qform, grid);
    const bool in_box = equal_s && equal_q;
    if (in_box) {
        /* One box, filled in two orders: the CT's own is meant. */
        const CtsNiftiPlace ct = place_of_ct(reading->series, grid);
        equal_s = same_place(&f->sform, &ct, f->dims);
        equal_q = same_place(&f->qform, &ct, f->dims);
    }
    if (equal_s != equal_q) {
        cts_nifti_take_form(f, equal_s ? CTS_NIFTI_FORM_S : CTS_NIFTI_FORM_Q);
        cts_report_diagnostic(
            reading->report, CTS_DIAGNOSTIC_NIFTI_FORM_TAKEN,
            "label file %d: its sform and its qform differ: %s; the %s is taken, which equals the grid "
            "of the CT",
            reading->file, text, equal_s ? "sform" : "qform");
        return CTS_OK;
    }
    if (forms == CTS_NIFTI_FORMS_CONTRADICT)
        return cts_fail(err, CTS_ERR_GEOMETRY,
                        "its sform and its qform contradict each other: %s, and %s the grid of the CT (choose one: "
                        "`nifti-form` sform or qform)",
                        text, in_box ? "both fill" : "neither equals");
    cts_report_diagnostic(
        reading->report, CTS_DIAGNOSTIC_NIFTI_FORMS,
        "label file %d: its sform and its qform differ: %s; the sform is taken (`nifti-form` qform takes "
        "the other)",
        reading->file, text);
    return CTS_OK;
}
