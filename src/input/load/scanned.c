#include "base/cpu.h"
#include "base/mem.h"
#include "core/volume/crop.h"
#include "core/volume/shape_interpolation.h"
#include "core/volume/volume_new.h"
#include "ctsplat/series.h"
#include "input/load/load.h"
#include <stdlib.h>
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
