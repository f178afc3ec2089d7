/* The built-in presets: ctsplat's own looks, 3D Slicer's CT presets (preset_slicer.c), and grey windows for mip, minip
 * and average with the widths and levels of reading rooms. */
#include "transfer/preset_table.h"

#define OWN(title) .name = (title), .unit_distance_mm = 1, .remove_table = true

#define GREY_WINDOW(title, its_mode, low, high)                                                                        \
    {                                                                                                                  \
        OWN(title), .mode = (its_mode), PRESET_WINDOW(low, high), .ambient = 0.2, .diffuse = 0.8, .power = 10,         \
                    PRESET_OPACITY({(low), 0}, {(high), 0.1}), PRESET_COLOUR({(low), {0, 0, 0}}, {(high), {1, 1, 1}}), \
    }

static const CtsPreset looks[] = {
    {
        OWN("bone"),
        PRESET_WINDOW(100, 2100),
        PRESET_LIGHT(0.2, 0.8, 0.3, 20),
        PRESET_OPACITY({150, 0}, {250, 0.15}, {400, 0.5}, {700, 0.85}, {1500, 0.95}),
        PRESET_COLOUR({150, {0.90, 0.60, 0.40}}, {250, {0.88, 0.70, 0.52}}, {400, {0.91, 0.82, 0.67}},
                      {700, {0.95, 0.90, 0.79}}, {1500, {0.98, 0.96, 0.90}}, {3071, {1, 1, 0.98}}),
    },
    {
        OWN("skin"),
        PRESET_WINDOW(-600, 400),
        PRESET_LIGHT(0.2, 0.8, 0.15, 15),
        PRESET_OPACITY({-500, 0}, {-350, 0.3}, {-200, 0.9}, {100, 0.95}),
        PRESET_COLOUR({-500, {0.90, 0.68, 0.56}}, {-200, {0.91, 0.71, 0.59}}, {100, {0.93, 0.74, 0.62}},
                      {400, {0.96, 0.88, 0.78}}),
    },
    {
        OWN("muscle"),
        PRESET_WINDOW(-160, 240),
        PRESET_LIGHT(0.2, 0.8, 0.2, 15),
        PRESET_OPACITY({-30, 0}, {20, 0.12}, {60, 0.5}, {180, 0.6}, {400, 0.9}),
        PRESET_COLOUR({-30, {0.50, 0.16, 0.12}}, {20, {0.62, 0.22, 0.17}}, {60, {0.74, 0.32, 0.25}},
                      {180, {0.86, 0.62, 0.50}}, {400, {0.95, 0.88, 0.77}}, {3071, {1, 0.99, 0.95}}),
    },
    {
        OWN("lung"),
        PRESET_WINDOW(-1350, 150),
        PRESET_LIGHT(0.25, 0.75, 0.1, 10),
        PRESET_OPACITY({-950, 0}, {-880, 0.03}, {-750, 0.06}, {-550, 0.05}, {-350, 0}),
        PRESET_COLOUR({-950, {0.55, 0.72, 0.85}}, {-880, {0.70, 0.78, 0.84}}, {-750, {0.92, 0.74, 0.68}},
                      {-550, {0.88, 0.52, 0.45}}, {-350, {0.70, 0.28, 0.22}}),
    },
    {
        OWN("vessel"),
        PRESET_WINDOW(-165, 485),
        PRESET_LIGHT(0.2, 0.8, 0.3, 25),
        PRESET_OPACITY({120, 0}, {180, 0.25}, {280, 0.75}, {450, 0.85}, {1000, 0.95}),
        PRESET_COLOUR({120, {0.45, 0.05, 0.03}}, {180, {0.70, 0.12, 0.08}}, {280, {0.87, 0.27, 0.18}},
                      {450, {0.95, 0.70, 0.54}}, {700, {0.95, 0.89, 0.79}}, {3071, {1, 1, 0.98}}),
    },
    {
        OWN("metal"),
        PRESET_WINDOW(1500, 8000),
        PRESET_LIGHT(0.2, 0.7, 0.6, 40),
        PRESET_OPACITY({300, 0}, {1200, 0.01}, {1900, 0.02}, {2300, 0.7}, {3071, 1}),
        PRESET_COLOUR({300, {0.80, 0.72, 0.60}}, {1900, {0.86, 0.80, 0.70}}, {2300, {0.66, 0.72, 0.80}},
                      {3071, {0.88, 0.92, 0.97}}),
    },
};

static const CtsPreset windows[] = {
    GREY_WINDOW("brain", CTS_MODE_MIP, 0, 80),
    GREY_WINDOW("soft", CTS_MODE_MIP, -160, 240),
    GREY_WINDOW("lung-window", CTS_MODE_MINIP, -1350, 150),
    GREY_WINDOW("bone-window", CTS_MODE_MIP, -700, 1300),
    GREY_WINDOW("abdomen", CTS_MODE_MIP, -125, 225),
    GREY_WINDOW("mediastinum", CTS_MODE_MIP, -125, 225),
    GREY_WINDOW("vessel-window", CTS_MODE_MIP, -165, 485),
};

const CtsPreset *cts_preset_builtin(size_t index)
{
    const size_t n_looks = sizeof looks / sizeof *looks, n_windows = sizeof windows / sizeof *windows;
    if (index < n_looks)
        return &looks[index];
    index -= n_looks;
    if (index < CTS_N_PRESETS_SLICER)
        return &cts_presets_slicer[index];
    index -= CTS_N_PRESETS_SLICER;
    return index < n_windows ? &windows[index] : NULL;
}
