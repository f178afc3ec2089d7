/* Macros for the tables of built-in presets. */
#pragma once

#include "ctsplat/preset.h"

/* Points in rising order, as {value, opacity} and {value, {red, green, blue}}; the compiler counts them. */
#define PRESET_OPACITY(...)                                                                                            \
    .n_opacity = sizeof((CtsOpacityPoint[]){__VA_ARGS__}) / sizeof(CtsOpacityPoint), .opacity = {__VA_ARGS__}
#define PRESET_COLOUR(...)                                                                                             \
    .n_colour = sizeof((CtsColourPoint[]){__VA_ARGS__}) / sizeof(CtsColourPoint), .colour = {__VA_ARGS__}
#define PRESET_LIGHT(a, d, s, p) .shade = true, .ambient = (a), .diffuse = (d), .specular = (s), .power = (p)
/* A row: name and window, then the other fields. Only a CT has a table. */
#define PRESET_OF(its_modality, its_scale, title, low, high, ...)                                                      \
    {                                                                                                                  \
        .name = (title), .modality = CTS_MODALITY_##its_modality, .scale = CTS_SCALE_##its_scale,                      \
        .unit_distance_mm = 1, .remove_table = CTS_MODALITY_##its_modality == CTS_MODALITY_CT, .window_low_hu = (low), \
        .window_high_hu = (high), __VA_ARGS__                                                                          \
    }
#define PRESET(title, low, high, ...) PRESET_OF(CT, HU, title, low, high, __VA_ARGS__)

enum { CTS_N_PRESETS_SLICER = 26 };
extern const CtsPreset cts_presets_slicer[CTS_N_PRESETS_SLICER];
