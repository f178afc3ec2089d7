#include "app/contact/contact_sheet.h"

#include "base/mem.h"
#include "base/vec3.h"
#include <math.h>
#include <stdlib.h>

enum { SIDE = CTS_SECTION_SIDE };

/* A plane of the patient: directions of a picture's right and down (LPS), and the axis across it. */
typedef struct Plane {
    double right_lps[3], down_lps[3];
} Plane;
static const Plane planes[3] = {
    {{1, 0, 0}, {0, 1, 0}},  /* axial, seen from the feet */
    {{1, 0, 0}, {0, 0, -1}}, /* coronal, seen from the front */
    {{0, 1, 0}, {0, 0, -1}}, /* sagittal, the front at the left */
};

typedef struct Drawing {
    const CtsScanned *scanned;
    const CtsLabels *labels; /* NULL: none */
    int dims[3];             /* columns, rows, slices */
    double inverse[3][3];    /* from LPS to columns, rows and layers */
    double centre_lps[3];    /* on all three planes */
    double middle_lps[3];    /* of the scan: the middle of each square, within its plane */
    double mm;               /* of a pixel */
    double low_hu, high_hu, tissue_hu;
    int32_t *voxel_label; /* of each pixel of one section: index in labels + 1; 0: none */
    CtsPicture *picture;
} Drawing;

/* The slice coordinate of a layer. */
static double slice_of_layer(const Drawing *d, double layer)
{
    const double *const layers = d->scanned->layer;
    int k = 0;
    if (!layers || d->dims[2] < 2)
        return layer;
    while (k + 2 < d->dims[2] && layers[k + 1] < layer)
        k++;
    return k + (layer - layers[k]) / (layers[k + 1] - layers[k]);
}

static double layer_of_slice(const Drawing *d, double slice)
{
    const int k = (int)slice;
    const double *const layers = d->scanned->layer;
    return !layers ? slice : k + 1 < d->dims[2] ? layers[k] + (slice - k) * (layers[k + 1] - layers[k]) : layers[k];
}

static void voxel_to_lps(const Drawing *d, const double voxel[3], double lps[3])
{
    const CtsVolume *const v = d->scanned->even;
    for (int c = 0; c < 3; c++)
        lps[c] = v->origin_lps[c] + voxel[0] * v->step_lps[0][c] + voxel[1] * v->step_lps[1][c] +
                 layer_of_slice(d, voxel[2]) * v->step_lps[2][c];
}

/* The voxel coordinates of a pixel of a plane; false outside the scan, whose outermost voxels have half their size
 * more. */
static bool voxel_of_pixel(const Drawing *d, const Plane *plane, int x, int y, double voxel[3])
{
    const CtsVolume *const v = d->scanned->even;
    const double right_mm = (x + 0.5 - SIDE / 2.0) * d->mm, down_mm = (y + 0.5 - SIDE / 2.0) * d->mm;
    bool inside = true;
    double from_origin[3];
    for (int c = 0; c < 3; c++)
        from_origin[c] = (plane->right_lps[c] != 0 || plane->down_lps[c] != 0 ? d->middle_lps : d->centre_lps)[c] +
                         right_mm * plane->right_lps[c] + down_mm * plane->down_lps[c] - v->origin_lps[c];
    for (int a = 0; a < 3; a++) {
        voxel[a] = cts_dot3(d->inverse[a], from_origin);
        if (a == 2)
            voxel[a] = slice_of_layer(d, voxel[a]);
        inside &= voxel[a] >= -0.5 && voxel[a] <= d->dims[a] - 0.5;
        voxel[a] = fmin(fmax(voxel[a], 0), d->dims[a] - 1);
    }
    return inside;
}

static double scanned_value(const Drawing *d, int i, int j, int k)
{
    const CtsVolume *const v = d->scanned->even;
    const size_t row = (size_t)k * (size_t)d->dims[1] + (size_t)j;
    return v->hu_offset + v->hu_step * v->grey[row * (size_t)d->dims[0] + (size_t)i];
}

static double section_value(const Drawing *d, const double voxel[3])
{
    double sum = 0;
    for (int corner = 0; corner < 8; corner++) {
        int at[3];
        double weight = 1;
        for (int a = 0; a < 3; a++) {
            const int low = (int)fmin(voxel[a], fmax(d->dims[a] - 2, 0)), up = corner >> a & 1;
            weight *= up ? voxel[a] - low : 1 - (voxel[a] - low);
            at[a] = low + up < d->dims[a] ? low + up : low;
        }
        if (weight > 0)
            sum += weight * scanned_value(d, at[0], at[1], at[2]);
    }
    return sum;
}

static void window(Drawing *d)
{
    const CtsVolume *const v = d->scanned->even;
    const bool is_hu = v->quantity == CTS_QUANTITY_HU;
    d->low_hu = is_hu ? -160 : v->air_value; /* HU: the window of soft tissue that radiologists use */
    d->high_hu = is_hu ? 240 : v->bright_value;
    d->tissue_hu = is_hu ? -400 : v->air_limit; /* between lung and soft tissue */
    if (!(d->high_hu > d->low_hu)) {
        d->low_hu = v->hu_min;
        d->high_hu = v->hu_max > v->hu_min ? v->hu_max : v->hu_min + 1;
    }
}

/* The centre of the labelled voxels; without any, of what is denser than air: of every STEP-th voxel. */
static void find_centre(Drawing *d)
{
    enum { STEP = 4 };
    double n = 0, sum[3] = {0};
    for (size_t l = 0; d->labels && l < d->labels->n; l++)
        for (size_t r = 0; !d->labels->items[l].surrounds && r < d->labels->items[l].n_runs; r++) {
            const CtsLabelRun run = d->labels->items[l].runs[r];
            const double length = run.end - run.first;
            n += length;
            sum[0] += length * (run.first + run.end - 1) / 2;
            sum[1] += length * (run.row % (uint32_t)d->dims[1]);
            sum[2] += length * (run.row / (uint32_t)d->dims[1]);
        }
    for (int k = 0; n == 0 && k < d->dims[2]; k++)
        for (int j = 0; j < d->dims[1]; j += STEP)
            for (int i = 0; i < d->dims[0]; i += STEP)
                if (scanned_value(d, i, j, k) > d->tissue_hu) {
                    n++;
                    sum[0] += i;
                    sum[1] += j;
                    sum[2] += k;
                }
    double voxel[3];
    for (int a = 0; a < 3; a++)
        voxel[a] = n > 0 ? floor(sum[a] / n + 0.5) : floor(d->dims[a] / 2.0); /* within one slice: sharp */
    voxel_to_lps(d, voxel, d->centre_lps);
}

/* The scan's middle, and the scale at which it fits a square. */
static void find_frame(Drawing *d)
{
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    d->mm = 1e-6;
    for (int corner = 0; corner < 8; corner++) {
        double voxel[3], lps[3];
        for (int a = 0; a < 3; a++)
            voxel[a] = corner >> a & 1 ? d->dims[a] - 1 : 0;
        voxel_to_lps(d, voxel, lps);
        for (int c = 0; c < 3; c++) {
            low[c] = fmin(low[c], lps[c]);
            high[c] = fmax(high[c], lps[c]);
        }
    }
    for (int c = 0; c < 3; c++) {
        d->middle_lps[c] = (low[c] + high[c]) / 2;
        d->mm = fmax(d->mm, (high[c] - low[c]) / (SIDE - 2)); /* a pixel at each side, for half a voxel */
    }
}

/* Large ones first, so that small ones lie over them. */
static int by_size(const void *a, const void *b)
{
    const CtsLabel *x = *(const CtsLabel *const *)a, *y = *(const CtsLabel *const *)b;
    if (x->surrounds != y->surrounds)
        return x->surrounds ? -1 : 1;
    if (x->fact.voxels != y->fact.voxels)
        return x->fact.voxels > y->fact.voxels ? -1 : 1;
    return x < y ? 1 : -1;
}

/* Pixels of a section by the row of voxels that they show: lists of pixels. */
typedef struct RowPixels {
    int32_t *first, *next; /* of each row; of each pixel; -1: none */
    uint16_t *column;      /* of each pixel */
} RowPixels;

static void mark_run(const Drawing *d, const RowPixels *pixels, CtsLabelRun run, int32_t voxel_label)
{
    for (int32_t p = pixels->first[run.row]; p >= 0; p = pixels->next[p])
        if (pixels->column[p] >= run.first && pixels->column[p] < run.end)
            d->voxel_label[p] = voxel_label;
}

static void list_pixels(const Drawing *d, const Plane *plane, const RowPixels *pixels)
{
    const size_t n_rows = (size_t)d->dims[1] * (size_t)d->dims[2];
    double voxel[3];
    for (size_t r = 0; r < n_rows; r++)
        pixels->first[r] = -1;
    for (int p = 0; p < SIDE * SIDE; p++) {
        if (!voxel_of_pixel(d, plane, p % SIDE, p / SIDE, voxel))
            continue;
        const size_t row = (size_t)(voxel[2] + 0.5) * (size_t)d->dims[1] + (size_t)(voxel[1] + 0.5);
        pixels->column[p] = (uint16_t)(voxel[0] + 0.5);
        pixels->next[p] = pixels->first[row];
        pixels->first[row] = p;
    }
}

/* Sets voxel_label of each pixel. */
static CtsStatus find_voxel_labels(Drawing *d, const Plane *plane, CtsError *err)
{
    const size_t n = d->labels ? d->labels->n : 0;
    const CtsLabel **order = NULL;
    RowPixels pixels = {0};
    CtsStatus st;
    for (int p = 0; p < SIDE * SIDE; p++)
        d->voxel_label[p] = 0;
    if (!n)
        return CTS_OK;
    if (!(st = cts_alloc_array(&pixels.first, (size_t)d->dims[1] * (size_t)d->dims[2], err)) &&
        !(st = cts_alloc_array(&pixels.next, SIDE * SIDE, err)) &&
        !(st = cts_alloc_array(&pixels.column, SIDE * SIDE, err)))
        st = cts_alloc_bytes((void **)&order, n, sizeof *order, err);
    if (!st) {
        list_pixels(d, plane, &pixels);
        for (size_t i = 0; i < n; i++)
            order[i] = &d->labels->items[i];
        qsort(order, n, sizeof *order, by_size);
    }
    for (size_t i = 0; !st && i < n; i++)
        for (size_t r = 0; r < order[i]->n_runs; r++)
            mark_run(d, &pixels, order[i]->runs[r], (int32_t)(order[i] - d->labels->items) + 1);
    cts_free_bytes(order);
    cts_free(&pixels.first);
    cts_free(&pixels.next);
    cts_free(&pixels.column);
    return st;
}

/* CSS Color 4: hsl(hue 90% 60%). */
static void colour_of(int label, float rgb[3])
{
    /* Steps of the golden ratio put each hue into the largest gap between those before it. */
    const double hue = fmod(label * 0.618034, 1), light = 0.6, reach = 0.9 * (1 - light);
    for (int c = 0; c < 3; c++) {
        const double k = fmod((c == 0 ? 0 : c == 1 ? 8 : 4) + hue * 12, 12);
        rgb[c] = (float)(light - reach * fmax(-1, fmin(fmin(k - 3, 9 - k), 1)));
    }
}

static bool is_edge(const int32_t *labels, int x, int y)
{
    const int32_t own = labels[y * SIDE + x];
    return own > 0 &&
           ((x > 0 && labels[y * SIDE + x - 1] != own) || (x + 1 < SIDE && labels[y * SIDE + x + 1] != own) ||
            (y > 0 && labels[(y - 1) * SIDE + x] != own) || (y + 1 < SIDE && labels[(y + 1) * SIDE + x] != own));
}

static CtsStatus draw_square(Drawing *d, int square, CtsError *err)
{
    const CtsStatus st = find_voxel_labels(d, &planes[square], err);
    for (int y = 0; !st && y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            float *const pixel = d->picture->pixels + 4 * ((size_t)y * 3 * SIDE + (size_t)(square * SIDE + x));
            double voxel[3];
            pixel[3] = 1;
            if (!voxel_of_pixel(d, &planes[square], x, y, voxel))
                continue;
            const double share = (section_value(d, voxel) - d->low_hu) / (d->high_hu - d->low_hu);
            pixel[0] = pixel[1] = pixel[2] = (float)fmin(fmax(share, 0), 1);
            if (is_edge(d->voxel_label, x, y))
                colour_of(d->voxel_label[y * SIDE + x] - 1, pixel);
        }
    return st;
}

CtsStatus cts_sections(const CtsScanned *scanned, const CtsLabels *labels, CtsPicture **picture, CtsError *err)
{
    const CtsVolume *const v = scanned->even;
    Drawing d = {.scanned = scanned, .labels = labels, .dims = {v->dims[0], v->dims[1], scanned->n_slices}};
    CtsStatus st = cts_picture_new(picture, 3 * SIDE, SIDE, 4, err);
    d.picture = *picture;
    if (!st && !cts_volume_inverse(v, d.inverse))
        st = cts_fail(err, CTS_ERR_GEOMETRY, "the steps of the scan do not span space");
    if (!st)
        st = cts_alloc_array(&d.voxel_label, SIDE * SIDE, err);
    window(&d);
    find_centre(&d);
    find_frame(&d);
    for (int square = 0; square < 3 && !st; square++)
        st = draw_square(&d, square, err);
    cts_free(&d.voxel_label);
    if (st)
        cts_picture_free(picture);
    return st;
}
