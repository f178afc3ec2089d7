/* Ranges of settings, the single source for callers, options, help and messages. */
#pragma once

#include "ctsplat/status.h"
#include <stdbool.h>

CTS_API_BEGIN

enum {
    CTS_MAX_SIDE = 32768,     /* pixels of a picture in each direction */
    CTS_MAX_KERNEL_RADIUS = 4 /* voxels */
};

/* From 1 on, so that 0 means none. */
typedef enum CtsSetting {
    CTS_SETTING_WIDTH = 1,
    CTS_SETTING_HEIGHT,
    CTS_SETTING_MM_PER_PIXEL,
    CTS_SETTING_AZIMUTH,
    CTS_SETTING_ELEVATION,
    CTS_SETTING_KERNEL_RADIUS,
    CTS_SETTING_SAMPLES,
    CTS_SETTING_MAX_ERROR,
    CTS_SETTING_TOLERANCE,
    CTS_SETTING_GREY_BITS,
    CTS_SETTING_VERIFY,
    CTS_SETTING_THREADS,
    CTS_SETTING_FRAMES,    /* of a rotation; a caller's own loop over cts_render_bands() */
    CTS_SETTING_OCCLUSION, /* strength of occlusion given beside the preset's */
    CTS_N_SETTINGS
} CtsSetting;

typedef struct CtsBounds {
    const char *name; /* the setting's, as messages and struct fields have it */
    const char *unit; /* "" without a unit */
    double low, high; /* both belong to the range */
    bool whole;       /* whole numbers only */
    bool automatic;   /* 0 is accepted too: chosen by ctsplat */
} CtsBounds;

/* NULL for an invalid setting. */
const CtsBounds *cts_setting_bounds(CtsSetting setting);

/* CTS_ERR_USAGE with the setting's name and range when value lies outside. */
CtsStatus cts_setting_check(CtsSetting setting, double value, CtsError *err);

CTS_API_END
