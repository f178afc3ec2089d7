#include "app/job/whole_picture.h"

#include "base/mem.h"
#include <string.h>

static CtsStatus begin_picture(CtsPicture **whole, const CtsPicture *band, CtsError *err)
{
    CtsStatus st = cts_picture_new(whole, band->width, band->whole_height, band->n_channels, err);
    if (!st && band->depth_mm)
        st = cts_alloc_array(&(*whole)->depth_mm, (size_t)band->width * (size_t)band->whole_height, err);
    if (!st) {
        (*whole)->info = band->info;
        (*whole)->has_alpha = band->has_alpha;
    }
    return st;
}

CtsStatus cts_picture_add_band(CtsPicture **whole, const CtsPicture *band, CtsError *err)
{
    const size_t first = (size_t)band->first_row * (size_t)band->width;
    const size_t n = (size_t)band->height * (size_t)band->width, n_channels = (size_t)band->n_channels;
    const CtsStatus st = *whole ? CTS_OK : begin_picture(whole, band, err);
    if (st)
        return st;
    memcpy((*whole)->pixels + first * n_channels, band->pixels, n * n_channels * sizeof *band->pixels);
    if (band->depth_mm)
        memcpy((*whole)->depth_mm + first, band->depth_mm, n * sizeof *band->depth_mm);
    return CTS_OK;
}
