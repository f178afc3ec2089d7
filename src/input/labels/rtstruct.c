/* RT Structure Sets (PS3.3 A.19, C.8.8.6): contours -> the voxels whose centres lie inside, by even-odd. */
#include "base/compare.h"
#include "base/mem.h"
#include "base/vec3.h"
#include "input/labels/label_reading.h"
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    FRAME_UID = 0x00200052,
    REFERENCED_FRAMES = 0x30060010,
    STRUCTURES = 0x30060020,
    ROI_NUMBER = 0x30060022,
    ROI_FRAME_UID = 0x30060024,
    ROI_NAME = 0x30060026,
    DISPLAY_COLOUR = 0x3006002A,
    ROI_CONTOURS = 0x30060039,
    CONTOURS = 0x30060040,
    CONTOUR_TYPE = 0x30060042,
    CONTOUR_DATA = 0x30060050,
    OBSERVATIONS = 0x30060080,
    REFERENCED_ROI = 0x30060084,
    INTERPRETED_TYPE = 0x300600A4,
    MAX_POINTS = 10000000 /* of one file: 400 MB at 40 bytes each */
};

typedef struct Contour {
    double at_mm; /* along the slices' normal */
    size_t first, n;
} Contour;

typedef struct Outline {
    const CtsLabelReading *reading;
    const CtsLabelGrid *grid;
    double inverse[2][3];
    Contour *contours;
    size_t n_contours;
    double (*points)[3]; /* LPS */
    double (*pixels)[2]; /* the same as pixels of the slice that is being filled */
    size_t n_points, n_read;
    size_t n_ignored;         /* contours that enclose nothing */
    size_t n_off, n_unfilled; /* planes far from any slice; slices without a plane between two with one */
    double *crossings;
} Outline;

static size_t n_values_of(CtsElements value)
{
    size_t n = value.at < value.end;
    for (const uint8_t *p = value.at; p < value.end; p++)
        n += *p == '\\';
    return n;
}

/* A vertex within 1e-6 pixels of a voxel's centre is snapped to it: rounding of its decimals. */
static double snapped_vertex(double x)
{
    return fabs(x - rint(x)) < 1e-6 ? rint(x) : x;
}

static CtsStatus add_points(Outline *o, const double (*lps)[3], size_t n, CtsError *err)
{
    const CtsLabelGrid *const g = o->grid;
    const double gap_mm = g->n_slices > 1 ? g->at_mm[1] - g->at_mm[0] : 1;
    double low = INFINITY, high = -INFINITY;
    for (size_t i = 0; i < n; i++) {
        const double at_mm = cts_dot3(lps[i], g->normal_lps);
        low = fmin(low, at_mm);
        high = fmax(high, at_mm);
    }
    /* Far less than the half of a gap that separates slices; 0.01 mm: rounding. */
    if (!(high - low <= 0.2 * gap_mm + 0.01))
        return cts_fail(err, CTS_ERR_GEOMETRY, "a contour is not parallel to the slices: it spans %.3g mm across them",
                        high - low);
    CtsStatus st = cts_grow(&o->contours, o->n_contours, err);
    if (st)
        return st;
    o->contours[o->n_contours++] = (Contour){(low + high) / 2, o->n_points, n};
    for (size_t i = 0; i < n && !(st = cts_grow(&o->points, o->n_points, err)); i++)
        memcpy(o->points[o->n_points++], lps[i], sizeof *o->points);
    return st;
}

static CtsStatus add_contour(Outline *o, CtsElements item, CtsError *err)
{
    char type[17];
    const size_t n = n_values_of(cts_elements_find(item, CONTOUR_DATA));
    cts_elements_text(item, CONTOUR_TYPE, type, sizeof type);
    const bool closed = !strcmp(type, "CLOSED_PLANAR") || !strcmp(type, "CLOSEDPLANAR_XOR") || !type[0];
    if (!closed || n < 9) {
        o->n_ignored++;
        return CTS_OK;
    }
    o->n_read += n / 3;
    if (o->n_read > MAX_POINTS)
        return cts_fail(err, CTS_ERR_READ, "has more than %d contour points", MAX_POINTS);
    double(*lps)[3] = malloc(n * sizeof(double));
    CtsStatus st = CTS_OK;
    if (!lps)
        st = cts_fail(err, CTS_ERR_MEMORY, "out of memory");
    else if (n % 3 || !cts_elements_decimals(item, CONTOUR_DATA, lps[0], (int)n))
        st = cts_fail(err, CTS_ERR_READ, "a contour's ContourData (3006,0050) is not points of three numbers");
    if (!st)
        st = add_points(o, (const double(*)[3])lps, n / 3, err);
    free(lps);
    return st;
}

/* Crossings of the contours' edges with a row of voxel centres: an edge includes its lower end and excludes its upper
 * one, so that a vertex on a row counts once. */
static CtsStatus find_crossings(Outline *o, const Contour *first, const Contour *end, int row, size_t *n, CtsError *err)
{
    *n = 0;
    for (const Contour *c = first; c < end; c++)
        for (size_t i = 0, before = c->n - 1; i < c->n; before = i++) {
            const double *a = o->pixels[c->first + before], *b = o->pixels[c->first + i];
            if ((a[1] > row) == (b[1] > row))
                continue;
            const CtsStatus st = cts_grow(&o->crossings, *n, err);
            if (st)
                return st;
            o->crossings[(*n)++] = snapped_vertex((b[0] - a[0]) * (row - a[1]) / (b[1] - a[1]) + a[0]);
        }
    qsort(o->crossings, *n, sizeof *o->crossings, cts_compare_double);
    return CTS_OK;
}

/* A centre lies inside when an odd number of crossings lies beyond it. */
static CtsStatus fill_row(const Outline *o, CtsLabel *label, uint32_t row, size_t n, CtsError *err)
{
    CtsStatus st = CTS_OK;
    for (size_t i = 0; i + 1 < n && !st; i += 2) {
        const double first = fmax(ceil(o->crossings[i]), 0), end = fmin(ceil(o->crossings[i + 1]), o->grid->columns);
        if (first < end)
            st = cts_label_add_run(label, row, (int)first, (int)end, err);
    }
    return st;
}

/* Vertices in pixels of a slice, and the range of rows they span. */
static void to_pixels(Outline *o, int slice, const Contour *first, const Contour *end, int *low, int *high)
{
    double top = INFINITY, bottom = -INFINITY;
    for (const Contour *c = first; c < end; c++)
        for (size_t i = c->first; i < c->first + c->n; i++) {
            double offset[3];
            for (int axis = 0; axis < 3; axis++)
                offset[axis] = o->points[i][axis] - o->grid->position_lps[slice][axis];
            for (int axis = 0; axis < 2; axis++)
                o->pixels[i][axis] = snapped_vertex(cts_dot3(o->inverse[axis], offset));
            top = fmin(top, o->pixels[i][1]);
            bottom = fmax(bottom, o->pixels[i][1]);
        }
    *low = (int)fmax(0, fmin(ceil(top), o->grid->rows));
    *high = (int)fmin(o->grid->rows - 1, fmax(floor(bottom), -1));
}

static CtsStatus fill_slice(Outline *o, CtsLabel *label, int slice, const Contour *first, const Contour *end,
                            CtsError *err)
{
    CtsStatus st = CTS_OK;
    int low, high;
    to_pixels(o, slice, first, end, &low, &high);
    for (int j = low; j <= high && !st; j++) {
        size_t n;
        st = find_crossings(o, first, end, j, &n, err);
        if (!st)
            st = fill_row(o, label, (uint32_t)slice * (uint32_t)o->grid->rows + (uint32_t)j, n, err);
    }
    return st;
}

static int by_place(const void *a, const void *b)
{
    const Contour *x = a, *y = b;
    return x->at_mm != y->at_mm ? (x->at_mm < y->at_mm ? -1 : 1) : x->first < y->first ? -1 : x->first > y->first;
}

/* The contours of one plane, within 0.01 mm, from *at on; the next plane's begin at *at then. */
static const Contour *next_plane(const Outline *o, size_t *at, const Contour **end)
{
    const Contour *const first = o->contours + *at;
    while (*at < o->n_contours && o->contours[*at].at_mm - first->at_mm < 0.01)
        ++*at;
    *end = o->contours + *at;
    return first;
}

/* The slice of a contour plane: at most half the distance to the next slice away; 1e-6 mm is rounding. */
static int slice_at(const CtsLabelGrid *g, double at_mm)
{
    for (int k = 0; k < g->n_slices; k++) {
        const double before = k > 0 ? g->at_mm[k] - g->at_mm[k - 1] : g->thickness_mm[k];
        const double behind = k + 1 < g->n_slices ? g->at_mm[k + 1] - g->at_mm[k] : g->thickness_mm[k];
        if (at_mm > g->at_mm[k] - before / 2 + 1e-6 && at_mm <= g->at_mm[k] + behind / 2 + 1e-6)
            return k;
    }
    return -1;
}

/* Each slice gets the nearest of its planes. */
static CtsStatus fill_slices(Outline *o, CtsLabel *label, CtsError *err)
{
    CtsStatus st = CTS_OK;
    const Contour *first = NULL, *end = NULL, *nearest = NULL, *nearest_end = NULL;
    int slice = -1, last_filled = -1;
    size_t at = 0;
    qsort(o->contours, o->n_contours, sizeof *o->contours, by_place);
    while (!st && (at < o->n_contours || nearest)) {
        const bool more = at < o->n_contours;
        if (more)
            first = next_plane(o, &at, &end);
        const int here = more ? slice_at(o->grid, first->at_mm) : -1;
        const bool same = more && nearest && here == slice;
        if (nearest && !same) {
            st = fill_slice(o, label, slice, nearest, nearest_end, err);
            o->n_unfilled += last_filled >= 0 ? (size_t)(slice - last_filled - 1) : 0;
            last_filled = slice;
            nearest = NULL;
        }
        o->n_off += more && (here < 0 || same);
        const double slice_mm = here >= 0 ? o->grid->at_mm[here] : 0;
        if (more && here >= 0 && (!nearest || fabs(first->at_mm - slice_mm) < fabs(nearest->at_mm - slice_mm))) {
            nearest = first;
            nearest_end = end;
            slice = here;
        }
    }
    cts_label_sort_runs(label);
    return st;
}

static CtsElements item_with_number(CtsElements elements, uint32_t sequence_tag, uint32_t number_tag, int number)
{
    CtsElements sequence = cts_elements_find(elements, sequence_tag), item;
    int found;
    while (cts_items_next(&sequence, &item))
        if (cts_elements_integer(item, number_tag, &found) && found == number)
            return item;
    return (CtsElements){.at = elements.end, .end = elements.end};
}

static double area_of(const Outline *o)
{
    double all = 0;
    for (const Contour *c = o->contours; c < o->contours + o->n_contours; c++) {
        double sum[3] = {0};
        for (size_t i = 0; i < c->n; i++) {
            double cross[3], a[3], b[3];
            for (int axis = 0; axis < 3; axis++) {
                a[axis] = o->points[c->first + i][axis] - o->points[c->first][axis];
                b[axis] = o->points[c->first + (i + 1) % c->n][axis] - o->points[c->first][axis];
            }
            cts_cross3(a, b, cross);
            for (int axis = 0; axis < 3; axis++)
                sum[axis] += cross[axis] / 2;
        }
        all += cts_norm3(sum);
    }
    return all;
}

static CtsStatus read_structure(Outline *o, const CtsLabelDicom *object, CtsElements structure, double *held,
                                CtsError *err)
{
    int number;
    char name[512], type[17];
    CtsLabels *const labels = o->reading->labels;
    if (!cts_elements_integer(structure, ROI_NUMBER, &number))
        return cts_fail(err, CTS_ERR_READ, "a structure has no number");
    cts_label_dicom_text(object, structure, ROI_NAME, name, sizeof name);
    CtsStatus st = cts_labels_add(labels, o->reading->file, number, name, CTS_LABEL_RTSTRUCT, err);
    if (st)
        return st;
    CtsLabel *const label = &labels->items[labels->n - 1];
    cts_elements_text(item_with_number(object->elements, OBSERVATIONS, REFERENCED_ROI, number), INTERPRETED_TYPE, type,
                      sizeof type);
    label->surrounds = !strcmp(type, "EXTERNAL") || !strcmp(type, "SUPPORT");
    const CtsElements drawn = item_with_number(object->elements, ROI_CONTOURS, REFERENCED_ROI, number);
    CtsElements contours = cts_elements_find(drawn, CONTOURS);
    label->coloured = cts_elements_decimals(drawn, DISPLAY_COLOUR, label->rgb, 3);
    for (int c = 0; c < 3; c++)
        label->rgb[c] = fmin(fmax(label->rgb[c] / 255, 0), 1);
    CtsElements contour;
    o->n_contours = o->n_points = 0;
    while (!st && cts_items_next(&contours, &contour))
        st = add_contour(o, contour, err);
    if (!st)
        st = cts_alloc_array(&o->pixels, o->n_points, err);
    if (!st)
        st = fill_slices(o, label, err);
    *held += st ? 0 : area_of(o);
    cts_free(&o->pixels);
    return st;
}

static CtsStatus check_frames(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err)
{
    char uid[65];
    CtsStatus st = CTS_OK;
    CtsElements structures = cts_elements_find(object->elements, STRUCTURES), item;
    cts_elements_text(cts_elements_item(object->elements, REFERENCED_FRAMES), FRAME_UID, uid, sizeof uid);
    if (uid[0])
        return cts_label_check_space(reading, object, uid, err);
    if (cts_items_next(&structures, &item)) {
        cts_elements_text(item, ROI_FRAME_UID, uid, sizeof uid);
        st = cts_label_check_space(reading, object, uid, err);
    }
    return st;
}

static void report_outline(const Outline *o)
{
    CtsReport *const report = o->reading->report;
    const int file = o->reading->file;
    if (o->n_ignored)
        cts_report_diagnostic(
            report, CTS_DIAGNOSTIC_CONTOURS_IGNORED,
            "label file %d: %zu contours that are not closed or have fewer than 3 points are left out", file,
            o->n_ignored);
    if (o->n_off)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_CONTOURS_OFF,
                              "label file %d: %zu contour planes are nearest to no slice and left out", file, o->n_off);
    if (o->n_unfilled)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_SLICES_WITHOUT_CONTOUR,
                              "label file %d: %zu slices between two with contours have none, and are not filled", file,
                              o->n_unfilled);
}

CtsStatus cts_label_read_rtstruct(const CtsLabelReading *reading, const CtsLabelDicom *object, CtsError *err)
{
    Outline o = {.reading = reading, .grid = &reading->labels->grid};
    CtsElements structures = cts_elements_find(object->elements, STRUCTURES), structure;
    double held = 0;
    cts_mask_axes(o.grid->step_lps, o.inverse);
    CtsStatus st = check_frames(reading, object, err);
    while (!st && cts_items_next(&structures, &structure))
        st = read_structure(&o, object, structure, &held, err);
    if (!st)
        st = cts_label_check_meets(reading, held, err);
    if (!st)
        report_outline(&o);
    free(o.contours);
    free(o.points);
    free(o.crossings);
    return st;
}
