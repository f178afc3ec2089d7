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
    free((*scanned)->layer);
    cts_free(scanned);
}

/* A volume in the same place, with the slices in memory of its own. */
static CtsStatus copy(CtsScanned *s, CtsVolume **volume, CtsError *err)
{
    const CtsVolume *const even = s->even;
    const size_t n_bytes = (size_t)s->n_slots * cts_scanned_layer_voxels(s) * sizeof *even->grey;
    if (!cts_memory_allows((double)n_bytes, cts_memory_available()))
        return cts_fail(err, CTS_ERR_MEMORY, "another volume of one scan needs %.0f MiB more memory than is free",
                        (double)n_bytes / 1048576);
    const CtsStatus st = cts_volume_new_like(volume, even, s->n_slots, err);
    if (st)
        return st;
    const size_t first = (size_t)s->offset * cts_scanned_layer_voxels(s);
    memcpy((*volume)->grey + first, even->grey + first,
           (size_t)s->n_slices * cts_scanned_layer_voxels(s) * sizeof *even->grey);
    return CTS_OK;
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

/* Resampling overwrites the slices, so they are elsewhere, or are copied as far as memory allows. */
static void resample(const CtsScanned *s, CtsVolume *v, CtsInterpolation how, int n_threads,
                     CtsInterpolationCounts *made)
{
    const size_t first = (size_t)s->offset * cts_scanned_layer_voxels(s),
                 n = (size_t)s->n_slices * cts_scanned_layer_voxels(s);
    uint16_t *copied = NULL;
    const uint16_t *slices = s->even->grey ? s->even->grey + first : NULL;
    if (how == CTS_INTERPOLATION_SHAPE && !slices) {
        const double n_bytes = (double)n * sizeof *copied;
        if (cts_memory_allows(n_bytes, cts_memory_available()) && !cts_alloc_array(&copied, n, NULL))
            memcpy(copied, v->grey + first, n * sizeof *copied);
        made->no_memory |= !copied;
        slices = copied;
    }
    if (slices && how == CTS_INTERPOLATION_SHAPE)
        cts_shape_interpolate_layers(&(CtsShapeStack){.slices = slices,
                                                      .layers = v->grey,
                                                      .n_columns = v->dims[0],
                                                      .n_rows = v->dims[1],
                                                      .n_slices = s->n_slices,
                                                      .end = {v->dims[0], v->dims[1], v->dims[2]},
                                                      .layer = s->layer,
                                                      .n_parts = 1,
                                                      .scale = v},
                                     how, n_threads, made);
    else
        cts_resample_stack(v->grey,
                           &(CtsResampling){.layer_voxels = cts_scanned_layer_voxels(s),
                                            .layer = s->layer,
                                            .n_slices = s->n_slices,
                                            .n_layers = s->even->dims[2],
                                            .offset = s->offset,
                                            .linear = how == CTS_INTERPOLATION_LINEAR},
                           n_threads);
    cts_free(&copied);
}

CtsStatus cts_scanned_volume(CtsScanned *s, CtsInterpolation how, bool hand_over, int n_threads, CtsVolume **volume,
                             CtsInterpolationCounts *made, CtsError *err)
{
    *volume = NULL;
    if (!s->even->grey)
        return cts_fail(err, CTS_ERR_INTERNAL, "the slices have been handed over");
    const CtsStatus st = hand_over ? give_slices(s, volume, err) : copy(s, volume, err);
    if (st)
        return st;
    if (s->layer)
        resample(s, *volume, how, cts_threads(n_threads), made);
    return CTS_OK;
}

CtsLinearLayers cts_scanned_linear_layers(const CtsScanned *s)
{
    return (CtsLinearLayers){s->even->grey + (size_t)s->offset * cts_scanned_layer_voxels(s), s->n_slices, s->layer};
}

CtsStatus cts_scanned_box(CtsScanned *s, CtsInterpolation how, const int low[3], const int high[3], bool last,
                          int n_threads, CtsVolume **volume, CtsInterpolationCounts *made, CtsError *err)
{
    CtsVolume box = *s->even;
    cts_volume_become_air_box(&box, low, high);
    const double n_bytes = (double)cts_volume_n_voxels(&box) * sizeof *box.grey;
    *volume = NULL;
    if (!cts_memory_allows(n_bytes, cts_memory_available()))
        return cts_fail(err, CTS_ERR_MEMORY, "layers need %.0f MiB more memory than is free", n_bytes / 1048576);
    const CtsStatus st = cts_volume_new_like(volume, &box, box.dims[2], err);
    if (st)
        return st;
    cts_shape_interpolate_layers(&(CtsShapeStack){.slices = cts_scanned_linear_layers(s).slices,
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
