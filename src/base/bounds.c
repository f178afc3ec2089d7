#include "ctsplat/bounds.h"

#include <math.h>
#include <stddef.h>

/* A kernel of less than 0.75 voxels would leave places of a sheet's lattice without any voxel; the largest tolerance
 * is the range of 16-bit grey levels. */
static const CtsBounds bounds[CTS_N_SETTINGS] = {
    [CTS_SETTING_WIDTH] = {.name = "width", .unit = "pixels", .low = 1, .high = CTS_MAX_SIDE, .whole = true},
    [CTS_SETTING_HEIGHT] = {.name = "height", .unit = "pixels", .low = 1, .high = CTS_MAX_SIDE, .whole = true},
    [CTS_SETTING_MM_PER_PIXEL] = {.name = "mm_per_pixel", .unit = "mm", .low = 1e-6, .high = 1e6, .automatic = true},
    [CTS_SETTING_AZIMUTH] = {.name = "azimuth_deg", .unit = "degrees", .low = -36000, .high = 36000},
    [CTS_SETTING_ELEVATION] = {.name = "elevation_deg", .unit = "degrees", .low = -90, .high = 90},
    [CTS_SETTING_KERNEL_RADIUS] =
        {.name = "kernel_radius", .unit = "voxels", .low = 0.75, .high = CTS_MAX_KERNEL_RADIUS, .automatic = true},
    [CTS_SETTING_SAMPLES] = {.name = "samples", .unit = "", .low = 1, .high = 64, .whole = true, .automatic = true},
    [CTS_SETTING_MAX_ERROR] = {.name = "max_error", .unit = "", .low = 1e-6, .high = 255, .automatic = true},
    [CTS_SETTING_TOLERANCE] = {.name = "tolerance_hu", .unit = "HU", .low = 0, .high = 65535},
    [CTS_SETTING_GREY_BITS] = {.name = "grey_bits", .unit = "bits", .low = 8, .high = 16, .whole = true},
    [CTS_SETTING_VERIFY] = {.name = "verify", .unit = "pixels", .low = 0, .high = 1e9, .whole = true},
    [CTS_SETTING_THREADS] = {.name = "n_threads", .unit = "", .low = 1, .high = 1024, .whole = true, .automatic = true},
    [CTS_SETTING_OCCLUSION] = {.name = "occlusion", .unit = "", .low = 0, .high = 1},
    [CTS_SETTING_FRAMES] = {.name = "frames", .unit = "", .low = 1, .high = 9999, .whole = true},
};

const CtsBounds *cts_setting_bounds(CtsSetting setting)
{
    return setting >= CTS_SETTING_WIDTH && setting < CTS_N_SETTINGS ? &bounds[setting] : NULL;
}

CtsStatus cts_setting_check(CtsSetting setting, double value, CtsError *err)
{
    const CtsBounds *b = cts_setting_bounds(setting);
    if (!b)
        return cts_fail(err, CTS_ERR_INTERNAL, "setting %d: there is none of this number", (int)setting);
    if (value >= b->low && value <= b->high && (!b->whole || value == floor(value)))
        return CTS_OK;
    if (b->automatic && value == 0)
        return CTS_OK;
    return cts_fail(err, CTS_ERR_USAGE, "`%s` %g: not a %snumber%s%s from %.10g to %.10g%s", b->name, value,
                    b->whole ? "whole " : "", *b->unit ? " of " : "", b->unit, b->low, b->high,
                    b->automatic ? " (or 0: chosen by ctsplat)" : "");
}
