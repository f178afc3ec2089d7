#include "output/image/whole_picture.h"

#include "base/mem.h"
#include <string.h>

static void copy_row(const float *from, int from_channels, float *to, int to_channels, int width)
{
    if (from_channels == to_channels) {
        memcpy(to, from, (size_t)width * (size_t)to_channels * sizeof *to);
        return;
    }
    for (int x = 0; x < width; x++, to += to_channels) {
        to[0] = to[1] = to[2] = from[x];
        to[3] = 1;
    }
}

void cts_picture_place(CtsPicture *whole, const CtsPicture *part, int left, int top)
{
    for (int y = 0; y < part->height; y++) {
        const size_t from = (size_t)y * (size_t)part->width,
                     to = (size_t)(top + y) * (size_t)whole->width + (size_t)left;
        copy_row(part->pixels + from * (size_t)part->n_channels, part->n_channels,
                 whole->pixels + to * (size_t)whole->n_channels, whole->n_channels, part->width);
        if (part->depth_mm && whole->depth_mm)
            memcpy(whole->depth_mm + to, part->depth_mm + from, (size_t)part->width * sizeof *part->depth_mm);
    }
}

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
    const CtsStatus st = *whole ? CTS_OK : begin_picture(whole, band, err);
    if (!st)
        cts_picture_place(*whole, band, 0, band->first_row);
    return st;
}
