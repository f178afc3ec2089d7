#include "base/mem.h"
#include "core/volume/crop.h"
#include "core/volume/shape_interpolation.h"
#include "core/volume/volume_new.h"
#include "ctsplat/series.h"
#include "input/load/load.h"
#include <math.h>
#include <string.h>

void cts_scanned_free(CtsScanned **scanned)
{
    if (!*scanned)
        return;
    cts_volume_free(&(*scanned)->even);
    cts_free(&(*scanned)->number);
    cts_free(&(*scanned)->position_lps);
    cts_free(&(*scanned)->layer);
    cts_free(scanned);
}

void cts_report_clamped(const CtsVolume *v, CtsReport *report)
{
    const double top = cts_volume_hu(v, UINT16_MAX);
    if (v->quantity == CTS_QUANTITY_HU && v->hu_max > top)
        cts_report_diagnostic(report, CTS_DIAGNOSTIC_CLAMPED_HIGH,
                              "values up to %g HU are shown as %g HU, the largest grey level", v->hu_max, top);
}

static CtsStatus new_volume(CtsVolume **volume, const CtsVolume *like, int n_layers, CtsError *err)
{
    const double n_bytes = (double)like->dims[0] * like->dims[1] * n_layers * sizeof *like->grey;
    *volume = NULL;
    if (!cts_memory_allows(n_bytes, cts_memory_available()))
        return cts_fail(err, CTS_ERR_MEMORY, "another volume of one scan needs %.0f MiB more memory than is free",
                        n_bytes / 1048576);
    return cts_volume_new_like(volume, like, n_layers, err);
}

/* A volume in the same place, with the slices in memory of its own. */
static CtsStatus copy_slices(const CtsScanned *s, CtsVolume **volume, CtsError *err)
{
    const CtsStatus st = new_volume(volume, s->even, s->n_slices, err);
    if (!st)
        memcpy((*volume)->grey, s->even->grey,
               (size_t)s->n_slices * cts_scanned_layer_voxels(s) * sizeof *s->even->grey);
    return st;
}

static CtsStatus give_slices(CtsScanned *s, CtsVolume **volume, CtsError *err)
{
    const CtsVolume *const even = s->even;
    const CtsStatus st = cts_volume_new_empty(volume, even->dims[0], even->dims[1], even->dims[2], err);
    if (st)
        return st;
    **volume = *even;
    s->even->grey = NULL;
    return CTS_OK;
}

CtsStatus cts_scanned_volume(CtsScanned *s, CtsInterpolation how, bool hand_over, int n_threads, CtsVolume **volume,
                             CtsInterpolationCounts *made, CtsError *err)
{
    const int *const dims = s->even->dims;
    *volume = NULL;
    if (!s->even->grey)
        return cts_fail(err, CTS_ERR_INTERNAL, "the slices have been handed over");
    if (s->layer)
        return cts_scanned_box(s, how, (const int[3]){0}, (const int[3]){dims[0] - 1, dims[1] - 1, dims[2] - 1},
                               hand_over, n_threads, volume, made, err);
    return hand_over ? give_slices(s, volume, err) : copy_slices(s, volume, err);
}

CtsLinearLayers cts_scanned_linear_layers(const CtsScanned *s)
{
    return (CtsLinearLayers){s->even->grey, s->n_slices, s->layer};
}

CtsStatus cts_scanned_box(CtsScanned *s, CtsInterpolation how, const int low[3], const int high[3], bool last,
                          int n_threads, CtsVolume **volume, CtsInterpolationCounts *made, CtsError *err)
{
    CtsVolume box = *s->even;
    cts_volume_become_air_box(&box, low, high);
    const CtsStatus st = new_volume(volume, &box, box.dims[2], err);
    if (st)
        return st;
    cts_shape_interpolate_layers(&(CtsShapeStack){.slices = s->even->grey,
                                                  .layers = (*volume)->grey,
                                                  .n_columns = s->even->dims[0],
                                                  .n_rows = s->even->dims[1],
                                                  .n_slices = s->n_slices,
                                                  .low = {low[0], low[1], low[2]},
                                                  .end = {high[0] + 1, high[1] + 1, high[2] + 1},
                                                  .layer = s->layer,
                                                  .n_parts = 1,
                                                  .scale = s->even},
                                 how, n_threads, made);
    if (last)
        cts_free(&s->even->grey);
    return CTS_OK;
}

CtsStatus cts_scanned_copy(const CtsScanned *s, CtsScanned **copy, CtsError *err)
{
    const size_t n = (size_t)s->n_slices;
    CtsStatus st = cts_alloc_zeroed(copy, 1, err);
    if (st || (st = cts_alloc_array(&(*copy)->position_lps, n, err)) ||
        (s->number && (st = cts_alloc_array(&(*copy)->number, n, err))) ||
        (s->layer && (st = cts_alloc_array(&(*copy)->layer, n, err))) || (st = copy_slices(s, &(*copy)->even, err))) {
        cts_scanned_free(copy);
        return st;
    }
    (*copy)->n_slices = s->n_slices;
    memcpy((*copy)->position_lps, s->position_lps, n * sizeof *s->position_lps);
    if (s->number)
        memcpy((*copy)->number, s->number, n * sizeof *s->number);
    if (s->layer)
        memcpy((*copy)->layer, s->layer, n * sizeof *s->layer);
    return CTS_OK;
}

enum { SQUARE = 4, N_NOISE = 256 }; /* side of a square; classes of 1 HU */

/* Adds each square of soft tissue of a slice to the class of its standard deviation. Returns their number. */
static size_t count_noise(const CtsVolume *even, const uint16_t *grey, size_t classes[N_NOISE])
{
    const size_t nx = (size_t)even->dims[0], ny = (size_t)even->dims[1], n = SQUARE * SQUARE;
    size_t n_squares = 0;
    for (size_t y = 0; y + SQUARE <= ny; y += SQUARE)
        for (size_t x = 0; x + SQUARE <= nx; x += SQUARE) {
            uint64_t sum = 0, squares = 0;
            for (size_t i = 0; i < n; i++) {
                const uint64_t g = grey[(y + i / SQUARE) * nx + x + i % SQUARE];
                sum += g;
                squares += g * g;
            }
            const double mean = even->hu_offset + even->hu_step * (double)sum / (double)n;
            const double sd = even->hu_step * sqrt((double)(n * squares - sum * sum) / (double)(n * (n - 1)));
            if (mean < 0 || mean > 100)
                continue;
            n_squares++;
            classes[sd < N_NOISE - 1 ? (size_t)sd : N_NOISE - 1]++;
        }
    return n_squares;
}

/* The lower quartile, since edges of organs only add to a deviation; of Gaussian noise in n voxels it is 0.858 of the
 * true one (the chi-squared distribution of n - 1 degrees of freedom). */
double cts_scanned_noise_hu(const CtsScanned *s)
{
    enum { MAX_SLICES = 16, LEAST_SQUARES = 100 };
    static const double quartile = 0.858;
    size_t classes[N_NOISE] = {0}, n_squares = 0, below = 0;
    const int n_slices = s->n_slices < MAX_SLICES ? s->n_slices : MAX_SLICES;
    if (s->even->quantity != CTS_QUANTITY_HU || !s->even->grey)
        return 0;
    for (int i = 0; i < n_slices; i++) {
        const int slice = (int)((2 * (int64_t)i + 1) * s->n_slices / (2 * n_slices));
        n_squares += count_noise(s->even, s->even->grey + (size_t)slice * cts_scanned_layer_voxels(s), classes);
    }
    if (n_squares < LEAST_SQUARES)
        return 0;
    int sd = 0;
    while ((below += classes[sd]) < n_squares / 4)
        sd++;
    return (sd + 0.5) / quartile;
}

CtsStatus cts_series_load(const CtsSeries *series, int n_threads, const volatile sig_atomic_t *stop, CtsVolume **volume,
                          CtsReport *report, CtsError *err)
{
    CtsScanned *scanned = NULL;
    CtsInterpolationCounts made = {0};
    *volume = NULL;
    CtsStatus st = cts_series_scan(series, &(CtsWordWatch){.stop = stop}, n_threads, &scanned, report, err);
    if (!st)
        st = cts_scanned_volume(scanned, CTS_INTERPOLATION_LINEAR, true, n_threads, volume, &made, err);
    cts_scanned_free(&scanned);
    return st;
}
