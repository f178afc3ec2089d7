/* Presets: window, transfer function (values -> colour and opacity), lighting, blend mode, background. */
#pragma once

#include "ctsplat/quantity.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"
#include <stdbool.h>
#include <stddef.h>

CTS_API_BEGIN

enum { CTS_MAX_POINTS = 256 };

typedef enum CtsMode { CTS_MODE_COMPOSITE, CTS_MODE_MIP, CTS_MODE_MINIP, CTS_MODE_AVERAGE, CTS_N_MODES } CtsMode;
extern const char *const cts_mode_names[CTS_N_MODES];

/* Meaning of a preset's numbers: values of a quantity, or shares of a volume's own range, whose 0 is the level of air
 * and whose 1 the 99.5th percentile of what is not air (CtsVolume). */
typedef enum CtsScale {
    CTS_SCALE_HU,
    CTS_SCALE_SUVBW,
    CTS_SCALE_BQML,
    CTS_SCALE_STORED,
    CTS_SCALE_RELATIVE,
    CTS_N_SCALES
} CtsScale;
extern const char *const cts_scale_names[CTS_N_SCALES]; /* as in preset files */

enum { CTS_ANY_MODALITY = -1 };

typedef struct CtsOpacityPoint {
    double hu, opacity; /* opacity per unit_distance_mm, 0..1 */
} CtsOpacityPoint;

typedef struct CtsColourPoint {
    double hu, rgb[3]; /* display values 0..1 */
} CtsColourPoint;

/* Plain data, no pointers: presets can be copied by assignment. Names with "hu" stand for values of the preset's scale.
 * Points never fall in HU; two at one HU are a step, of which the later one holds from that HU on. */
typedef struct CtsPreset {
    char name[64];
    CtsScale scale;
    int modality; /* CtsModality that the preset is meant for, or CTS_ANY_MODALITY */
    /* Black and white of mip, minip and average: black may be the higher one. Equal: none. */
    double window_low_hu, window_high_hu;
    bool window_absolute; /* the window is in the volume's values although the scale is relative */
    CtsMode mode;
    double unit_distance_mm;
    bool shade;
    double ambient, diffuse, specular, power;
    double occlusion;     /* darkening of folds, 0 (none) to 1 (ctsplat-preset(5)) */
    bool background_none; /* write alpha */
    double background[3]; /* display values 0..1 */
    bool remove_table;
    int n_opacity, n_colour;
    CtsOpacityPoint opacity[CTS_MAX_POINTS];
    CtsColourPoint colour[CTS_MAX_POINTS];
    bool needs_contrast; /* shows vessels by their contrast agent; without it the visible tissue is bone */
    char note[160];      /* features of the file that are not supported, for a warning; "" if none */
} CtsPreset;

/* Largest extinction, per mm: that of opacity 1. */
#define CTS_MAX_EXTINCTION_PER_MM 50.0

/* A built-in preset, a preset of the user's folder ($XDG_CONFIG_HOME/ctsplat/presets/NAME.json), or a file, in this
 * order; a name with a slash is a file, and one that begins with a brace the JSON text itself. Files are ctsplat's
 * JSON, Slicer's volume property JSON, a Slicer .vp file or Slicer's presets.xml; for a file with several presets
 * FILE#NAME selects one. CTS_ERR_PRESET with the list of names, or the file, line and reason. */
CtsStatus cts_preset_load(const char *name_or_file, CtsPreset *preset, CtsError *err);

/* A preset from text in any of these formats, size bytes. name: its source in messages, and the preset's name where the
 * text has none; which: the one to select where there are several, or NULL. */
CtsStatus cts_preset_parse(const char *text, size_t size, const char *name, const char *which, CtsPreset *preset,
                           CtsError *err);

/* Names of the presets in the user's folder, sorted: an array that ends with NULL, to be freed with one free(). NULL
 * when memory runs out. */
char **cts_preset_user_names(void);

/* True if the preset's scale fits volumes of this quantity: the same, or relative where it is not HU. */
bool cts_preset_fits(const CtsPreset *preset, CtsQuantity quantity);
/* True if it fits, and is meant for this modality. A CT that is not HU counts as MR: values without a unit. */
bool cts_preset_suits(const CtsPreset *preset, CtsModality modality, CtsQuantity quantity);
/* The name of the built-in preset of a series for which none is chosen; composite: one for mode composite. */
const char *cts_preset_default(CtsModality modality, CtsQuantity quantity, bool composite);
/* CTS_OK where the preset fits; else CTS_ERR_PRESET, and the message names built-in presets that suit. */
CtsStatus cts_preset_check(const CtsPreset *preset, CtsModality modality, CtsQuantity quantity, CtsError *err);
/* Makes a relative preset one of the volume's quantity, by its levels of air and of bright voxels; another one is only
 * checked. CTS_ERR_PIXELS for a volume without such levels: all of its voxels are equal. */
CtsStatus cts_preset_resolve(CtsPreset *preset, const CtsVolume *volume, CtsError *err);

/* The built-in presets by index; NULL past the last. */
const CtsPreset *cts_preset_builtin(size_t index);
/* Advice on limitations of the built-in preset of this name, with helpful options; NULL where there is none. */
const char *cts_preset_advice(const char *name);
/* The number that identifies the preset in series numbers, 1 to 80, the same in each version; 0 where it is not built
 * in. */
int cts_preset_number(const char *name);

/* Opacity (per unit distance), extinction per mm and colour at any HU. */
double cts_preset_opacity(const CtsPreset *preset, double hu);
double cts_preset_extinction_per_mm(const CtsPreset *preset, double hu);
void cts_preset_colour(const CtsPreset *preset, double hu, double rgb[3]);

/* True when preset and background give no colour in this mode, for any volume; labels may have colours of their own. */
bool cts_preset_is_grey(const CtsPreset *preset, CtsMode mode);

/* JSON text as in a preset file, to be freed by the caller with free(). */
char *cts_preset_to_json(const CtsPreset *preset);

CTS_API_END
