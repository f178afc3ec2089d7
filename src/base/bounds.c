#include "ctsplat/bounds.h"

#include <math.h>
#include <stddef.h>

/* A kernel of less than 0.75 voxels would leave places of a sheet's lattice without any voxel; the largest tolerance
 * is the range of 16-bit grey levels. */
static const CtsBounds bounds[CTS_N_SETTINGS] = {
    [CTS_SETTING_WIDTH] = {"width", "pixels", 1, CTS_MAX_SIDE, .whole = true},
    [CTS_SETTING_HEIGHT] = {"height", "pixels", 1, CTS_MAX_SIDE, .whole = true},
    [CTS_SETTING_MM_PER_PIXEL] = {"mm_per_pixel", "mm", 1e-6, 1e6, .automatic = true},
    [CTS_SETTING_AZIMUTH] = {"azimuth_deg", "degrees", -36000, 36000},
    [CTS_SETTING_ELEVATION] = {"elevation_deg", "degrees", -90, 90},
    [CTS_SETTING_KERNEL_RADIUS] = {"kernel_radius", "voxels", 0.75, CTS_MAX_KERNEL_RADIUS, .automatic = true},
    [CTS_SETTING_SAMPLES] = {"samples", "", 1, 64, .whole = true, .automatic = true},
    [CTS_SETTING_MAX_ERROR] = {"max_error", "", 1e-6, 255, .automatic = true},
    [CTS_SETTING_TOLERANCE] = {"tolerance_hu", "HU", 0, 65535},
    [CTS_SETTING_GREY_BITS] = {"grey_bits", "bits", 8, 16, .whole = true},
    [CTS_SETTING_VERIFY] = {"verify", "pixels", 0, 1e9, .whole = true},
    [CTS_SETTING_THREADS] = {"n_threads", "", 1, 1024, .whole = true, .automatic = true},
    [CTS_SETTING_FRAMES] = {"frames", "", 1, 9999, .whole = true},
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
