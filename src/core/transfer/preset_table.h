/* Macros for the tables of built-in presets. */
#pragma once

#include "ctsplat/preset.h"

/* Points in order of HU, as {hu, opacity} and {hu, {red, green, blue}}; the compiler counts them. */
#define PRESET_OPACITY(...)                                                                                            \
    .n_opacity = sizeof((CtsOpacityPoint[]){__VA_ARGS__}) / sizeof(CtsOpacityPoint), .opacity = {__VA_ARGS__}
#define PRESET_COLOUR(...)                                                                                             \
    .n_colour = sizeof((CtsColourPoint[]){__VA_ARGS__}) / sizeof(CtsColourPoint), .colour = {__VA_ARGS__}
#define PRESET_LIGHT(a, d, s, p) .shade = true, .ambient = (a), .diffuse = (d), .specular = (s), .power = (p)
/* A row: name and window, then the other fields. */
#define PRESET(title, low, high, ...)                                                                                  \
    {                                                                                                                  \
        .name = (title), .unit_distance_mm = 1, .remove_table = true, .window_low_hu = (low),                          \
        .window_high_hu = (high), __VA_ARGS__                                                                          \
    }

enum { CTS_N_PRESETS_SLICER = 22 };
extern const CtsPreset cts_presets_slicer[CTS_N_PRESETS_SLICER];
