/* NIfTI label maps, and masks of one label each. */
#include "base/bytes.h"
#include "base/mem.h"
#include "base/vec3.h"
#include "input/files/nifti.h"
#include "input/labels/label_reading.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

typedef struct Map {
    const CtsLabelReading *reading;
    CtsNifti nifti;
    uint16_t *numbers; /* of all voxels, as the file has them */
    uint16_t *plane;   /* one of the mask's planes, where these are not the file's own */
    int n[3];          /* the mask's columns, rows and planes */
    size_t along[3];   /* from voxel to voxel along them */
    int32_t *label_of; /* by number */
    CtsLabelNames names;
} Map;

/* Largest deviation from a whole number caused by scl_slope, resampling and floats. */
static const double rounding = 1e-3;

static CtsStatus take_numbers(void *context, const double *values, size_t first, size_t n, CtsError *err)
{
    Map *const m = context;
    for (size_t i = 0; i < n; i++) {
        const double x = values[i], whole = round(x);
        if (x == 0) /* most are, as is the array */
            continue;
        if (!(whole >= 0 && whole <= UINT16_MAX) || !(fabs(x - whole) <= rounding))
            return cts_fail(err, CTS_ERR_PIXELS, "holds %.9g, which is no number of a label (whole, 0 to 65535)", x);
        m->numbers[first + i] = (uint16_t)whole;
    }
    return CTS_OK;
}

static CtsStatus read_numbers(Map *m, CtsError *err)
{
    size_t n = 0;
    CtsStatus st = cts_nifti_count(&m->nifti, sizeof *m->numbers, &n, err);
    if (!st && !(st = cts_alloc_zeroed(&m->numbers, n, err)))
        st = cts_nifti_read(&m->nifti, n, NULL, take_numbers, m, err);
    return st;
}

static CtsStatus find_names(Map *m, CtsError *err)
{
    CtsNifti *const f = &m->nifti;
    for (size_t at = 4; at + 8 <= f->n_extension;) {
        const uint8_t *const p = (const uint8_t *)f->extension + at;
        const uint32_t size = f->big_endian ? __builtin_bswap32(cts_little32(p)) : cts_little32(p);
        if (size < 8 || size > f->n_extension - at)
            break; /* contains nothing about positions */
        size_t n = size - 8;
        const char *const text = (const char *)p + 8;
        while (n && text[n - 1] == 0)
            n--;
        CtsStatus st = CTS_OK;
        if (n && text[0] == '<')
            st = cts_label_names_xml(text, n, &m->names, err);
        else if (n && text[0] == '{' && cts_label_names_parse("extension", text, n, &m->names, NULL))
            cts_label_names_free(&m->names); /* JSON of another kind */
        if (st)
            return st;
        at += size;
    }
    return CTS_OK;
}

static CtsStatus add_label(Map *m, int number, bool alone, CtsError *err)
{
    const CtsLabelReading *const r = m->reading;
    char name[512];
    const CtsLabelName *known = cts_label_names_find(r->names, number);
    known = known ? known : cts_label_names_find(&m->names, number);
    if (r->name && alone)
        snprintf(name, sizeof name, "%s", r->name);
    else if (known)
        snprintf(name, sizeof name, "%s", known->name);
    else
        snprintf(name, sizeof name, "%s %d", r->name ? r->name : "label", number);
    const CtsStatus st =
        cts_labels_add(r->labels, r->file, r->name && alone ? r->number : number, name, CTS_LABEL_NIFTI, err);
    if (st)
        return st;
    m->label_of[number] = (int32_t)r->labels->n - 1;
    if (known && known->coloured && !(r->name && alone)) {
        CtsLabel *const label = &r->labels->items[r->labels->n - 1];
        label->coloured = true;
        memcpy(label->rgb, known->rgb, sizeof label->rgb);
    }
    return CTS_OK;
}

/* Once for all masks of a folder. */
static CtsStatus add_regions(const CtsLabelReading *r, const CtsLabelNames *names, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (size_t i = 0; !st && names && i < names->n_regions; i++) {
        const CtsLabelRegion *const region = &names->regions[i];
        bool known = false;
        for (size_t k = 0; k < r->labels->n_regions; k++)
            known |= r->labels->regions[k].file == r->file && !strcmp(r->labels->regions[k].name, region->name);
        if (!known)
            st = cts_labels_add_region(r->labels, r->file, region->name, region->numbers, region->n, err);
    }
    return st;
}

/* A mask named by its file may be empty. */
static CtsStatus add_labels(Map *m, CtsError *err)
{
    const size_t n = (size_t)m->nifti.dims[0] * (size_t)m->nifti.dims[1] * (size_t)m->nifti.dims[2];
    int n_numbers = 0;
    CtsStatus st = cts_alloc_array(&m->label_of, CTS_MASK_VALUES, err);
    if (!st)
        memset(m->label_of, -1, CTS_MASK_VALUES * sizeof *m->label_of);
    for (size_t i = 0; !st && i < n; i++) {
        const int v = m->numbers[i];
        if (!v || m->label_of[v] == 0)
            continue;
        n_numbers++;
        m->label_of[v] = 0;
    }
    for (int v = 1; !st && v < CTS_MASK_VALUES; v++)
        if (m->label_of[v] >= 0)
            st = add_label(m, v, n_numbers == 1, err);
    if (!st && n_numbers == 0 && m->reading->name)
        st = cts_labels_add(m->reading->labels, m->reading->file, m->reading->number, m->reading->name, CTS_LABEL_NIFTI,
                            err);
    return st;
}

static CtsStatus plane_of(void *context, int number, CtsMaskPlane *plane, CtsError *err)
{
    Map *const m = context;
    const uint16_t *const first = m->numbers + (size_t)number * m->along[2];
    (void)err;
    plane->values = m->plane ? m->plane : first;
    for (int j = 0; m->plane && j < m->n[1]; j++)
        for (int i = 0; i < m->n[0]; i++)
            m->plane[(size_t)j * (size_t)m->n[0] + (size_t)i] =
                first[(size_t)i * m->along[0] + (size_t)j * m->along[1]];
    return CTS_OK;
}

/* The file's axis nearest to a direction, among those not yet used. */
static int nearest_axis(const CtsNifti *f, const double direction[3], const bool taken[3])
{
    int nearest = -1;
    double most = -1;
    for (int axis = 0; axis < 3; axis++) {
        const double along = fabs(cts_dot3(f->place.step_lps[axis], direction)) / cts_norm3(f->place.step_lps[axis]);
        if (!taken[axis] && along > most) {
            most = along;
            nearest = axis;
        }
    }
    return nearest;
}

/* Planes across the scanned slices' normal, for any order of the file's axes. */
static CtsStatus place_map(Map *m, CtsError *err)
{
    const CtsNifti *const f = &m->nifti;
    const CtsLabelGrid *const g = &m->reading->labels->grid;
    const size_t steps[3] = {1, (size_t)f->dims[0], (size_t)f->dims[0] * (size_t)f->dims[1]};
    const double *const direction[3] = {g->step_lps[0], g->step_lps[1], g->normal_lps};
    bool taken[3] = {false};
    double held = 0, across[3];
    CtsMask mask = {.plane = plane_of, .context = m, .label_of = m->label_of};
    for (int a = 2; a >= 0; a--) {
        const int axis = nearest_axis(f, direction[a], taken);
        taken[axis] = true;
        m->n[a] = f->dims[axis];
        m->along[a] = steps[axis];
        memcpy(a < 2 ? mask.step_lps[a] : across, f->place.step_lps[axis], sizeof across);
    }
    mask.columns = m->n[0];
    mask.rows = m->n[1];
    mask.n_planes = m->n[2];
    double normal[3];
    cts_cross3(mask.step_lps[0], mask.step_lps[1], normal);
    mask.gap_mm = fabs(cts_dot3(normal, across)) / cts_norm3(normal);
    CtsStatus st = cts_alloc_array(&mask.position_lps, (size_t)mask.n_planes, err);
    if (!st && (m->along[2] != steps[2] || m->along[0] != 1))
        st = cts_alloc_array(&m->plane, (size_t)m->n[0] * (size_t)m->n[1], err);
    for (int k = 0; !st && k < mask.n_planes; k++)
        for (int c = 0; c < 3; c++)
            mask.position_lps[k][c] = f->place.origin_lps[c] + k * across[c];
    if (!st && !(st = cts_mask_place(&mask, m->reading, NULL, &held, err)))
        st = cts_label_check_meets(m->reading, held, err);
    cts_free(&mask.position_lps);
    return st;
}

/* Distance of corners, in voxels, up to which grids count as equal: less than an edge moves by interpolation, and more
 * than rounding to float. */
#define SAME_VOXELS 0.1

/* True if a point is a corner of the file's box under a form. */
static bool is_corner(const CtsNifti *f, const CtsNiftiPlace *p, const double point_lps[3])
{
    double from_origin[3], across[3][3], volume;
    cts_sub3(point_lps, p->origin_lps, from_origin);
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
        cts_sub3(x, y, off);
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

/* Chooses one of a label map's two forms: where they differ the one that equals the series' grid. CTS_ERR_GEOMETRY
 * where they contradict each other and neither or both equal it. */
static CtsStatus take_form(const CtsLabelReading *reading, CtsNifti *f, CtsError *err)
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

CtsStatus cts_label_read_nifti(const CtsLabelReading *reading, const CtsFileBytes *file, CtsError *err)
{
    Map m = {.reading = reading};
    CtsStatus st = cts_nifti_open(&m.nifti, file, err);
    if (!st && !(st = take_form(reading, &m.nifti, err)) && !(st = read_numbers(&m, err)) &&
        !(st = find_names(&m, err)) && !(st = add_labels(&m, err)) &&
        !(st = add_regions(reading, reading->names, err)) && !(st = add_regions(reading, &m.names, err)))
        st = place_map(&m, err);
    cts_nifti_close(&m.nifti);
    cts_label_names_free(&m.names);
    cts_free(&m.numbers);
    cts_free(&m.plane);
    cts_free(&m.label_of);
    return st;
}
