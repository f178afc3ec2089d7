#include "app/contact/contact_sheet.h"

#include "base/mem.h"
#include "base/vec3.h"
#include <math.h>
#include <stdlib.h>

enum { SIDE = CTS_LABEL_SLICES_SIDE };
static const double low_hu = -160, high_hu = 240; /* the window of soft tissue that radiologists use */

/* A section through the voxels: axes of its columns (`across`) and rows (`down`) and the axis across it (`through`); 0
 * columns, 1 rows, 2 slices of the scan. */
typedef struct Cut {
    int across, down, through;
} Cut;
static const Cut cuts[3] = {{0, 1, 2}, {0, 2, 1}, {1, 2, 0}};

typedef struct Drawing {
    const CtsScanned *scanned;
    const CtsLabels *labels;
    int dims[3], middle[3];
    double step_mm[2], extent_mm[3], mm; /* of a pixel */
    int32_t *voxel_label;                /* of each voxel of the section: index in labels + 1; 0: none */
    CtsPicture *picture;
} Drawing;

/* The centre of the labelled voxels; without any, that of the scan. */
static void find_middle(Drawing *d)
{
    double n = 0, sum[3] = {0};
    for (size_t i = 0; i < d->labels->n; i++)
        for (size_t r = 0; !d->labels->items[i].surrounds && r < d->labels->items[i].n_runs; r++) {
            const CtsLabelRun run = d->labels->items[i].runs[r];
            const double length = run.end - run.first;
            n += length;
            sum[0] += length * (run.first + run.end - 1) / 2;
            sum[1] += length * (run.row % (uint32_t)d->dims[1]);
            sum[2] += length * (run.row / (uint32_t)d->dims[1]);
        }
    for (int a = 0; a < 3; a++)
        d->middle[a] = n > 0 ? (int)(sum[a] / n) : d->dims[a] / 2;
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

static void own_run(const Drawing *d, const Cut *cut, CtsLabelRun run, int32_t voxel_label)
{
    const int at[2] = {(int)(run.row % (uint32_t)d->dims[1]), (int)(run.row / (uint32_t)d->dims[1])};
    if (cut->through > 0) {
        if (at[cut->through - 1] == d->middle[cut->through])
            for (int x = run.first; x < run.end; x++)
                d->voxel_label[(size_t)at[cut->down - 1] * (size_t)d->dims[0] + (size_t)x] = voxel_label;
    } else if (run.first <= d->middle[0] && d->middle[0] < run.end) {
        d->voxel_label[(size_t)at[1] * (size_t)d->dims[1] + (size_t)at[0]] = voxel_label;
    }
}

static CtsStatus find_voxel_labels(Drawing *d, const Cut *cut, CtsError *err)
{
    const CtsLabels *const labels = d->labels;
    const CtsLabel **order = NULL;
    CtsStatus st = cts_alloc_zeroed(&d->voxel_label, (size_t)d->dims[cut->across] * (size_t)d->dims[cut->down], err);
    if (!st)
        st = cts_alloc_bytes((void **)&order, labels->n, sizeof *order, err);
    for (size_t i = 0; !st && i < labels->n; i++)
        order[i] = &labels->items[i];
    if (!st)
        qsort(order, labels->n, sizeof *order, by_size);
    for (size_t i = 0; !st && i < labels->n; i++)
        for (size_t r = 0; r < order[i]->n_runs; r++)
            own_run(d, cut, order[i]->runs[r], (int32_t)(order[i] - labels->items) + 1);
    cts_free_bytes(order);
    return st;
}

/* The voxel along an axis at a pixel of a section, or -1 outside. */
static int voxel_of_pixel(const Drawing *d, int axis, int pixel)
{
    const CtsLabelGrid *const g = &d->labels->grid;
    const double at_mm = (pixel + 0.5 - SIDE / 2.0) * d->mm + d->extent_mm[axis] / 2;
    if (!(at_mm >= 0 && at_mm < d->extent_mm[axis]))
        return -1;
    if (axis < 2)
        return (int)fmin(at_mm / d->step_mm[axis], d->dims[axis] - 1);
    const double place_mm = g->at_mm[0] - g->thickness_mm[0] / 2 + d->extent_mm[2] - at_mm;
    int k = 0;
    while (k + 1 < d->dims[2] && (g->at_mm[k] + g->at_mm[k + 1]) / 2 < place_mm)
        k++;
    return k;
}

static float grey_at(const Drawing *d, const int voxel[3])
{
    const CtsVolume *const v = d->scanned->even;
    const size_t row = (size_t)(d->scanned->offset + voxel[2]) * (size_t)d->dims[1] + (size_t)voxel[1];
    const double hu = v->hu_offset + v->hu_step * v->grey[row * (size_t)d->dims[0] + (size_t)voxel[0]];
    return (float)fmin(fmax((hu - low_hu) / (high_hu - low_hu), 0), 1);
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

static void draw_pixel(const Drawing *d, const Cut *cut, int square, int x, int y, const int32_t *voxel_labels)
{
    const int32_t voxel_label = voxel_labels[y * SIDE + x];
    float *const pixel = d->picture->pixels + 4 * ((size_t)y * 3 * SIDE + (size_t)(square * SIDE + x));
    int voxel[3];
    voxel[cut->through] = d->middle[cut->through];
    voxel[cut->across] = voxel_of_pixel(d, cut->across, x);
    voxel[cut->down] = voxel_of_pixel(d, cut->down, y);
    pixel[3] = 1;
    if (voxel[cut->across] < 0 || voxel[cut->down] < 0)
        return;
    const bool edge = voxel_label > 0 && ((x > 0 && voxel_labels[y * SIDE + x - 1] != voxel_label) ||
                                          (x + 1 < SIDE && voxel_labels[y * SIDE + x + 1] != voxel_label) ||
                                          (y > 0 && voxel_labels[(y - 1) * SIDE + x] != voxel_label) ||
                                          (y + 1 < SIDE && voxel_labels[(y + 1) * SIDE + x] != voxel_label));
    if (edge)
        colour_of(voxel_label - 1, pixel);
    else
        pixel[0] = pixel[1] = pixel[2] = grey_at(d, voxel);
}

static CtsStatus draw_square(Drawing *d, int square, CtsError *err)
{
    const Cut *const cut = &cuts[square];
    int32_t *voxel_labels = NULL; /* of the section's pixels */
    CtsStatus st = find_voxel_labels(d, cut, err);
    if (!st)
        st = cts_alloc_zeroed(&voxel_labels, (size_t)SIDE * SIDE, err);
    for (int y = 0; !st && y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            const int h = voxel_of_pixel(d, cut->across, x), v = voxel_of_pixel(d, cut->down, y);
            if (h >= 0 && v >= 0)
                voxel_labels[y * SIDE + x] = d->voxel_label[(size_t)v * (size_t)d->dims[cut->across] + (size_t)h];
        }
    for (int y = 0; !st && y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            draw_pixel(d, cut, square, x, y, voxel_labels);
    cts_free(&voxel_labels);
    cts_free(&d->voxel_label);
    return st;
}

static void measure_labels(Drawing *d)
{
    const CtsLabelGrid *const g = &d->labels->grid;
    const int last = g->n_slices - 1;
    for (int a = 0; a < 2; a++) {
        d->step_mm[a] = cts_norm3(g->step_lps[a]);
        d->extent_mm[a] = d->dims[a] * d->step_mm[a];
    }
    d->extent_mm[2] = g->at_mm[last] - g->at_mm[0] + (g->thickness_mm[0] + g->thickness_mm[last]) / 2;
    d->mm = fmax(fmax(d->extent_mm[0], d->extent_mm[1]), d->extent_mm[2]) / SIDE;
}

CtsStatus cts_label_slices(const CtsScanned *scanned, const CtsLabels *labels, CtsPicture **picture, CtsError *err)
{
    const CtsLabelGrid *const g = &labels->grid;
    Drawing d = {.scanned = scanned, .labels = labels, .dims = {g->columns, g->rows, g->n_slices}};
    CtsStatus st = cts_picture_new(picture, 3 * SIDE, SIDE, 4, err);
    d.picture = *picture;
    find_middle(&d);
    measure_labels(&d);
    for (int square = 0; square < 3 && !st; square++)
        st = draw_square(&d, square, err);
    if (st)
        cts_picture_free(picture);
    return st;
}
