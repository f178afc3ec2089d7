/* The built-in presets: ctsplat's own, 3D Slicer's CT presets (preset_slicer.c), and grey windows for mip, minip and
 * average with widths and levels of radiological practice. */
#include "core/transfer/preset_table.h"

#include <string.h>

#define GREY_LIGHT .ambient = 0.2, .diffuse = 0.8, .power = 10
#define WHITE_BEHIND .background = {1, 1, 1}
#define GREY_WINDOW(title, its_mode, low, high)                                                                        \
    PRESET(title, low, high, .mode = (its_mode), GREY_LIGHT, PRESET_OPACITY({(low), 0}, {(high), 0.1}),                \
           PRESET_COLOUR({(low), {0, 0, 0}}, {(high), {1, 1, 1}}))

/* Darkening of folds, chosen by eye from pairs of seven series (tests/tools/option_page.sh): at 0.3 the vault of a
 * skull is still burnt out and ribs barely part from what is behind them, at 0.6 open skin and bone are dull. */
#define FOLDS .occlusion = 0.45

static const CtsPreset looks[] = {
    PRESET("bone", 100, 2100, PRESET_LIGHT(0.2, 0.8, 0.3, 20), FOLDS,
           PRESET_OPACITY({150, 0}, {250, 0.15}, {400, 0.5}, {700, 0.85}, {1500, 0.95}),
           PRESET_COLOUR({150, {0.90, 0.60, 0.40}}, {250, {0.88, 0.70, 0.52}}, {400, {0.91, 0.82, 0.67}},
                         {700, {0.95, 0.90, 0.79}}, {1500, {0.98, 0.96, 0.90}}, {3071, {1, 1, 0.98}})),
    PRESET("skin", -600, 400, PRESET_LIGHT(0.2, 0.8, 0.15, 15), FOLDS,
           PRESET_OPACITY({-500, 0}, {-350, 0.3}, {-200, 0.9}, {100, 0.95}),
           PRESET_COLOUR({-500, {0.90, 0.68, 0.56}}, {-200, {0.91, 0.71, 0.59}}, {100, {0.93, 0.74, 0.62}},
                         {400, {0.96, 0.88, 0.78}})),
    PRESET("muscle", -160, 240, PRESET_LIGHT(0.2, 0.8, 0.2, 15), FOLDS,
           PRESET_OPACITY({-30, 0}, {20, 0.12}, {60, 0.5}, {180, 0.6}, {400, 0.9}),
           PRESET_COLOUR({-30, {0.50, 0.16, 0.12}}, {20, {0.62, 0.22, 0.17}}, {60, {0.74, 0.32, 0.25}},
                         {180, {0.86, 0.62, 0.50}}, {400, {0.95, 0.88, 0.77}}, {3071, {1, 0.99, 0.95}})),
    /* Range between lung and soft tissue: vessels, and the lung's thin surface. Below -620 HU the noise of a low dose
     * would show as texture, above -300 HU fat and muscle hide the lung. */
    PRESET("lung", -1350, 150, PRESET_LIGHT(0.3, 0.7, 0.2, 12),
           PRESET_OPACITY({-620, 0}, {-520, 0.2}, {-420, 0.25}, {-300, 0}),
           PRESET_COLOUR({-620, {0.70, 0.35, 0.30}}, {-520, {0.85, 0.50, 0.42}}, {-420, {0.97, 0.62, 0.50}},
                         {-300, {1, 0.80, 0.70}})),
    PRESET("vessel", -165, 485, .needs_contrast = true, PRESET_LIGHT(0.2, 0.8, 0.3, 25), FOLDS,
           PRESET_OPACITY({120, 0}, {180, 0.25}, {280, 0.75}, {450, 0.85}, {1000, 0.95}),
           PRESET_COLOUR({120, {0.45, 0.05, 0.03}}, {180, {0.70, 0.12, 0.08}}, {280, {0.87, 0.27, 0.18}},
                         {450, {0.95, 0.70, 0.54}}, {700, {0.95, 0.89, 0.79}}, {3071, {1, 1, 0.98}})),
    PRESET("metal", 1500, 8000, PRESET_LIGHT(0.2, 0.7, 0.6, 40), PRESET_OPACITY({1900, 0}, {2300, 0.7}, {3071, 1}),
           PRESET_COLOUR({1900, {0.60, 0.65, 0.72}}, {2300, {0.66, 0.72, 0.80}}, {3071, {0.88, 0.92, 0.97}})),
    /* Chosen by eye, a T1 head and a T2 pelvis from six sides: skin as glass, with a thin rim of its own at 0.18; the
     * grey and white matter of a T1 lie at 0.6 to 1, and only inflowing blood beyond the 99.5th percentile is red.
     * Ambient and diffuse light make 1: with 1.3 the fat of a T2, the brightest tissue and right below the skin, was
     * burnt out. */
    PRESET_OF(MR, RELATIVE, "mr", 0, 1.4, PRESET_LIGHT(0.25, 0.75, 0.35, 25), .occlusion = 0.3,
              PRESET_OPACITY({0.1, 0}, {0.18, 0.035}, {0.3, 0.015}, {0.5, 0.03}, {0.7, 0.18}, {1, 0.25}, {1.15, 0.35},
                             {1.4, 0.95}),
              PRESET_COLOUR({0.1, {0.78, 0.50, 0.40}}, {0.35, {0.93, 0.72, 0.58}}, {0.7, {0.99, 0.88, 0.76}},
                            {1.05, {1, 0.95, 0.86}}, {1.2, {0.98, 0.45, 0.32}}, {1.6, {0.90, 0.12, 0.08}})),
};

/* Grey windows, each with a mode that suits a whole head, chest or abdomen: mip for the densest structures, minip for
 * airways, average for those in between (brain: in a slab). */
static const CtsPreset windows[] = {
    GREY_WINDOW("brain", CTS_MODE_AVERAGE, 0, 80),
    GREY_WINDOW("soft", CTS_MODE_AVERAGE, -160, 240),
    GREY_WINDOW("lung-window", CTS_MODE_MINIP, -1350, 150),
    GREY_WINDOW("bone-window", CTS_MODE_MIP, -700, 1300),
    GREY_WINDOW("abdomen", CTS_MODE_AVERAGE, -125, 225),
    GREY_WINDOW("mediastinum", CTS_MODE_AVERAGE, -125, 225),
    GREY_WINDOW("vessel-window", CTS_MODE_MIP, -165, 485),
    PRESET_OF(MR, RELATIVE, "mr-mip", 0.1, 1.6, .mode = CTS_MODE_MIP, GREY_LIGHT, PRESET_OPACITY({0.1, 0}, {1.6, 0.1}),
              PRESET_COLOUR({0.1, {0, 0, 0}}, {1.6, {1, 1, 1}})),
    PRESET_OF(PT, SUVBW, "pet-mip", 7, 0, .mode = CTS_MODE_MIP, GREY_LIGHT, WHITE_BEHIND,
              PRESET_OPACITY({0, 0}, {7, 0.1}), PRESET_COLOUR({0, {1, 1, 1}}, {7, {0, 0, 0}})),
    PRESET_OF(PT, RELATIVE, "pet-mip-relative", 1, 0, .mode = CTS_MODE_MIP, GREY_LIGHT, WHITE_BEHIND,
              PRESET_OPACITY({0, 0}, {1, 0.1}), PRESET_COLOUR({0, {1, 1, 1}}, {1, {0, 0, 0}})),
};

/* Limitations of presets, with options that help. */
static const struct {
    const char *name, *advice;
} advices[] = {
    {"brain", "the skull is brighter than the brain and surrounds it: `view` head with `slab` 10 shows a section of "
              "the brain, `slab` 10@MM another one"},
    {"vessel", "bone is as dense as blood with contrast agent, and is visible too: `slab` 60 leaves out bone before "
               "and behind, `crop` bone beside"},
    {"vessel-window", "bone is brighter than blood with contrast agent: `slab` 40 leaves out bone before and behind"},
};

const char *cts_preset_advice(const char *name)
{
    for (size_t i = 0; i < sizeof advices / sizeof *advices; i++)
        if (!strcmp(advices[i].name, name))
            return advices[i].advice;
    return NULL;
}

/* Positions in a list are preset numbers, so new presets are appended. */
enum { FIRST_LOOK = 1, FIRST_SLICER = 21, FIRST_WINDOW = 61 };
_Static_assert(sizeof looks / sizeof *looks <= FIRST_SLICER - FIRST_LOOK &&
                   CTS_N_PRESETS_SLICER <= FIRST_WINDOW - FIRST_SLICER && sizeof windows / sizeof *windows <= 20,
               "each list has numbers of its own");

enum { N_LISTS = 3 };
static const struct {
    const CtsPreset *presets;
    size_t n;
    int first;
} lists[N_LISTS] = {{looks, sizeof looks / sizeof *looks, FIRST_LOOK},
                    {cts_presets_slicer, CTS_N_PRESETS_SLICER, FIRST_SLICER},
                    {windows, sizeof windows / sizeof *windows, FIRST_WINDOW}};

int cts_preset_number(const char *name)
{
    for (int l = 0; l < N_LISTS; l++)
        for (size_t i = 0; i < lists[l].n; i++)
            if (!strcmp(lists[l].presets[i].name, name))
                return lists[l].first + (int)i;
    return 0;
}

const CtsPreset *cts_preset_builtin(size_t index)
{
    for (int l = 0; l < N_LISTS; index -= lists[l++].n)
        if (index < lists[l].n)
            return &lists[l].presets[index];
    return NULL;
}
