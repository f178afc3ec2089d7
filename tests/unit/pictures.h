/* Pictures made by formula, for the tests of image and export. */
#pragma once

#include "ctsplat/export.h"
#include "ctsplat/picture.h"
#include "folder.h"
#include "unit.h"
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* A smooth coloured ramp with a transparent border, a specular highlight above 1 in the middle. */
static inline CtsPicture *make_picture(int width, int height, int n_channels, bool has_alpha)
{
    CtsPicture *p = NULL;
    CtsError err;
    assert_int_equal(cts_picture_new(&p, width, height, n_channels, &err), CTS_OK);
    p->has_alpha = has_alpha;
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            float *v = p->pixels + ((size_t)y * width + x) * n_channels;
            const double u = (x + 0.5) / width, w = (y + 0.5) / height;
            const double r = hypot(u - 0.5, w - 0.5), alpha = has_alpha ? fmax(0, fmin(1, 1.5 - 3 * r)) : 1;
            const double rgb[3] = {u + 0.3 * exp(-200 * r * r), w, 0.5 + 0.5 * sin(9 * u * w)};
            if (n_channels == 1)
                v[0] = (float)(0.5 * (u + w));
            for (int c = 0; c < 4 && n_channels == 4; c++)
                v[c] = (float)(c < 3 ? rgb[c] * alpha : alpha);
        }
    const CtsPictureInfo info = {.preset = "bone",
                                 .engine = "tiled",
                                 .azimuth_deg = -30,
                                 .elevation_deg = 20,
                                 .mm_per_pixel = 0.5,
                                 .right_lps = {1, 0, 0},
                                 .up_lps = {0, 0, 1},
                                 .forward_lps = {0, 1, 0},
                                 .centre_lps = {10, -20, 300}};
    p->info = info;
    if (n_channels == 1) {
        p->info.mode = CTS_MODE_MIP;
        p->info.window_low_hu = -100;
        p->info.window_high_hu = 900.5;
    }
    return p;
}

/* The file at path, written in bands of so many rows (a multiple of CTS_BAND_ROWS) instead of whole pictures. */
static inline void export_in_bands(const CtsPicture *const *frames, int n_frames, bool grey, int n_rows,
                                   const char *path, const CtsExportSettings *settings)
{
    CtsExport *export = NULL;
    CtsError err = {0};
    for (int k = 0; k < n_frames; k++)
        for (int y = 0; y < frames[k]->height; y += n_rows) {
            CtsPicture band = *frames[k];
            band.first_row = y;
            band.height = band.height - y < n_rows ? band.height - y : n_rows;
            band.pixels += (size_t)y * (size_t)band.width * (size_t)band.n_channels;
            if (band.depth_mm)
                band.depth_mm += (size_t)y * (size_t)band.width;
            band.info.grey = grey;
            if (!export)
                assert_int_equal(cts_export_begin(&export, path, &band, n_frames, settings, NULL, &err), CTS_OK);
            assert_int_equal(cts_export_rows(export, &band, &err), CTS_OK);
        }
    assert_int_equal(cts_export_end(&export, NULL, &err), CTS_OK);
    assert_null(export);
}
