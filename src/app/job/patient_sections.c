#include "app/job/patient_sections.h"

#include "base/mem.h"
#include "base/vec3.h"
#include "output/image/describe.h"
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const cts_plane_names[CTS_N_PLANES] = {"", "axial", "coronal", "sagittal"};

/* Axes of the patient (LPS): to the right in the picture, down, and across the plane. */
typedef struct Plane {
    int right, down, across;
    double down_sign;
    double azimuth_deg, elevation_deg; /* of the camera */
} Plane;
static const Plane planes[CTS_N_PLANES] = {
    [CTS_PLANE_AXIAL] = {0, 1, 2, 1, 0, -90},    /* seen from the feet */
    [CTS_PLANE_CORONAL] = {0, 2, 1, -1, 0, 0},   /* seen from the front */
    [CTS_PLANE_SAGITTAL] = {1, 2, 0, -1, 90, 0}, /* the front at the left */
};

typedef struct Drawing {
    const CtsScanned *scanned;
    const CtsLabels *labels; /* NULL: none */
    int dims[3];             /* columns, rows, slices */
    int width, height;       /* of each section, pixels */
    double inverse[3][3];    /* from LPS to columns, rows and layers */
    double centre_lps[3];    /* on all planes */
    double middle_lps[3];    /* the middle of each section, within its plane */
    double mm;               /* of a pixel */
    double low_hu, high_hu, tissue_hu;
    int32_t *voxel_label; /* of each pixel of one section: index in labels + 1; 0: none */
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

/* The point in the middle of a section. */
static void middle_of_section(const Drawing *d, const CtsSection *section, double lps[3])
{
    const int across = planes[section->plane].across;
    memcpy(lps, d->middle_lps, sizeof d->middle_lps);
    lps[across] = d->centre_lps[across] + section->at_mm;
}

/* The voxel coordinates of a pixel of a section; false outside the scan, whose outermost voxels have half their size
 * more. */
static bool voxel_of_pixel(const Drawing *d, const CtsSection *section, int x, int y, double voxel[3])
{
    const Plane *const plane = &planes[section->plane];
    bool inside = true;
    double from_origin[3];
    middle_of_section(d, section, from_origin);
    from_origin[plane->right] += (x + 0.5 - d->width / 2.0) * d->mm;
    from_origin[plane->down] += plane->down_sign * (y + 0.5 - d->height / 2.0) * d->mm;
    for (int c = 0; c < 3; c++)
        from_origin[c] -= d->scanned->even->origin_lps[c];
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
    const bool labelled = n > 0;
    for (int k = 0; !labelled && k < d->dims[2]; k++)
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

/* The scan's middle, and the scale at which it fits all the sections. */
static void find_frame(Drawing *d, const CtsSection *sections, int n)
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
    for (int c = 0; c < 3; c++)
        d->middle_lps[c] = (low[c] + high[c]) / 2;
    for (int i = 0; i < n; i++) {
        if (!sections[i].plane)
            continue;
        const int right = planes[sections[i].plane].right, down = planes[sections[i].plane].down;
        /* A pixel at each side, for half a voxel. */
        d->mm = fmax(d->mm, (high[right] - low[right]) / fmax(d->width - 2, 1));
        d->mm = fmax(d->mm, (high[down] - low[down]) / fmax(d->height - 2, 1));
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

static void list_pixels(const Drawing *d, const CtsSection *section, const RowPixels *pixels)
{
    const size_t n_rows = (size_t)d->dims[1] * (size_t)d->dims[2];
    double voxel[3];
    for (size_t r = 0; r < n_rows; r++)
        pixels->first[r] = -1;
    for (int p = 0; p < d->width * d->height; p++) {
        if (!voxel_of_pixel(d, section, p % d->width, p / d->width, voxel))
            continue;
        const size_t row = (size_t)(voxel[2] + 0.5) * (size_t)d->dims[1] + (size_t)(voxel[1] + 0.5);
        pixels->column[p] = (uint16_t)(voxel[0] + 0.5);
        pixels->next[p] = pixels->first[row];
        pixels->first[row] = p;
    }
}

/* Sets voxel_label of each pixel. */
static CtsStatus find_voxel_labels(Drawing *d, const CtsSection *section, CtsError *err)
{
    const size_t n_pixels = (size_t)d->width * (size_t)d->height;
    const size_t n = d->labels ? d->labels->n : 0;
    const CtsLabel **order = NULL;
    RowPixels pixels = {0};
    CtsStatus st;
    memset(d->voxel_label, 0, n_pixels * sizeof *d->voxel_label);
    if (!n)
        return CTS_OK;
    if (!(st = cts_alloc_array(&pixels.first, (size_t)d->dims[1] * (size_t)d->dims[2], err)) &&
        !(st = cts_alloc_array(&pixels.next, n_pixels, err)) && !(st = cts_alloc_array(&pixels.column, n_pixels, err)))
        st = cts_alloc_bytes((void **)&order, n, sizeof *order, err);
    if (!st) {
        list_pixels(d, section, &pixels);
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

static bool is_edge(const Drawing *d, int x, int y)
{
    const int w = d->width;
    const int32_t *const at = d->voxel_label + (size_t)y * (size_t)w + x, own = *at;
    return own > 0 && ((x > 0 && at[-1] != own) || (x + 1 < w && at[1] != own) || (y > 0 && at[-w] != own) ||
                       (y + 1 < d->height && at[w] != own));
}

static void describe_section(const Drawing *d, const CtsSection *section, CtsPictureInfo *info)
{
    const Plane *const plane = &planes[section->plane];
    *info = (CtsPictureInfo){.azimuth_deg = plane->azimuth_deg,
                             .elevation_deg = plane->elevation_deg,
                             .mm_per_pixel = d->mm,
                             .window_low_hu = d->low_hu,
                             .window_high_hu = d->high_hu,
                             .grey = !d->labels || !d->labels->n,
                             .is_section = true};
    snprintf(info->preset, sizeof info->preset, section->at_mm != 0 ? "%s %s mm" : "%s",
             cts_plane_names[section->plane], cts_describe_number(section->at_mm, 6).text);
    info->right_lps[plane->right] = 1;
    info->up_lps[plane->down] = -plane->down_sign;
    cts_cross3(info->up_lps, info->right_lps, info->forward_lps);
    middle_of_section(d, section, info->centre_lps);
}

static CtsStatus draw_section(Drawing *d, const CtsSection *section, CtsPicture **picture, CtsError *err)
{
    CtsStatus st = cts_picture_new(picture, d->width, d->height, 4, err);
    if (st || (st = find_voxel_labels(d, section, err)))
        return st;
    (*picture)->has_alpha = false;
    describe_section(d, section, &(*picture)->info);
    for (int y = 0; y < d->height; y++)
        for (int x = 0; x < d->width; x++) {
            const size_t at = (size_t)y * (size_t)d->width + (size_t)x;
            float *const pixel = (*picture)->pixels + 4 * at;
            double voxel[3];
            pixel[3] = 1;
            if (!voxel_of_pixel(d, section, x, y, voxel))
                continue;
            const double share = (section_value(d, voxel) - d->low_hu) / (d->high_hu - d->low_hu);
            pixel[0] = pixel[1] = pixel[2] = (float)fmin(fmax(share, 0), 1);
            if (is_edge(d, x, y))
                colour_of(d->voxel_label[at] - 1, pixel);
        }
    return st;
}

CtsStatus cts_sections(const CtsScanned *scanned, const CtsLabels *labels, const CtsRenderSettings *settings,
                       const CtsSection *sections, int n, CtsPicture **pictures, CtsError *err)
{
    const CtsVolume *const v = scanned->even;
    Drawing d = {.scanned = scanned,
                 .labels = labels,
                 .dims = {v->dims[0], v->dims[1], scanned->n_slices},
                 .width = settings->width,
                 .height = settings->height};
    CtsStatus st = cts_alloc_array(&d.voxel_label, (size_t)d.width * (size_t)d.height, err);
    if (!st && !cts_volume_inverse(v, d.inverse))
        st = cts_fail(err, CTS_ERR_GEOMETRY, "the steps of the scan do not span space");
    window(&d);
    find_centre(&d);
    find_frame(&d, sections, n);
    if (settings->mm_per_pixel > 0)
        d.mm = settings->mm_per_pixel;
    for (int c = 0; c < 3 && settings->centre_given; c++)
        d.centre_lps[c] = d.middle_lps[c] = settings->centre_lps[c];
    for (int i = 0; i < n && !st; i++)
        if (sections[i].plane)
            st = draw_section(&d, &sections[i], &pictures[i], err);
    cts_free(&d.voxel_label);
    return st;
}
