/* Table of the fields of CtsRenderSettings: default, bounds, and the first stage to be remade when the value
 * changes. A field without a row does not compile. */
#pragma once

#include "base/remakes.h"
#include "ctsplat/bounds.h"
#include "ctsplat/render.h"
#include <stddef.h>

/* row(field, default, bounds or 0, first stage to be remade), in the order of the fields. */
/* clang-format off */
#define CTS_RENDER_SETTINGS(row)                                                                                       \
    row(width, 1024, CTS_SETTING_WIDTH, PICTURE)                                                                       \
    row(height, 1024, CTS_SETTING_HEIGHT, PICTURE)                                                                     \
    row(mm_per_pixel, 0, CTS_SETTING_MM_PER_PIXEL, PICTURE)                                                            \
    row(azimuth_deg, 0, CTS_SETTING_AZIMUTH, PICTURE)                                                                  \
    row(elevation_deg, 0, CTS_SETTING_ELEVATION, PICTURE)                                                              \
    row(fit, CTS_FIT_VOLUME, 0, PICTURE)                                                                               \
    row(rotation_frames, 0, 0, PICTURE)                                                                                \
    row(centre_given, false, 0, PICTURE)                                                                               \
    row(centre_lps, {0}, 0, PICTURE)                                                                                   \
    row(engine, CTS_ENGINE_AUTO, 0, RENDERER)                                                                          \
    row(kernel, CTS_KERNEL_TENT, 0, RENDERER)                                                                          \
    row(kernel_radius, 0, CTS_SETTING_KERNEL_RADIUS, RENDERER)                                                         \
    row(samples, 0, CTS_SETTING_SAMPLES, RENDERER)                                                                     \
    row(level, CTS_LEVEL_AUTO, 0, PICTURE)                                                                             \
    row(max_error, 0, CTS_SETTING_MAX_ERROR, PICTURE)                                                                  \
    row(void_key, false, 0, RENDERER)                                                                                  \
    row(tolerance_hu, 0, CTS_SETTING_TOLERANCE, RENDERER)                                                              \
    row(no_occlusion_culling, false, 0, RENDERER)                                                                      \
    row(always_reuse_layers, false, 0, RENDERER)                                                                       \
    row(grey_bits, 16, CTS_SETTING_GREY_BITS, RENDERER)                                                                \
    row(opacity_per_voxel, false, 0, RENDERER)                                                                         \
    row(mode, -1, 0, RENDERER)                                                                                         \
    row(slab_mm, 0, 0, PICTURE)                                                                                        \
    row(slab_at_mm, 0, 0, PICTURE)                                                                                     \
    row(shade, CTS_AS_PRESET, 0, RENDERER)                                                                             \
    row(occlusion, CTS_OCCLUSION_AS_PRESET, 0, PICTURE)                                                                \
    row(verify, 0, CTS_SETTING_VERIFY, NOTHING)                                                                        \
    row(n_threads, 0, CTS_SETTING_THREADS, NOTHING)                                                                    \
    row(explain, false, 0, NOTHING)                                                                                    \
    row(want_depth, false, 0, NOTHING)                                                                                 \
    row(stop, NULL, 0, NOTHING)
/* clang-format on */

typedef struct CtsSettingRow {
    size_t at, size; /* in CtsRenderSettings */
    CtsSetting bounds;
    CtsRemakes remakes;
} CtsSettingRow;

enum {
#define CTS_ROW_NUMBER(field, first, bounds, remakes) CTS_ROW_OF_##field,
    CTS_RENDER_SETTINGS(CTS_ROW_NUMBER) CTS_N_SETTING_ROWS
};
extern const CtsSettingRow cts_setting_rows[CTS_N_SETTING_ROWS];
