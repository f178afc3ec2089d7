/* Readers of the preset formats; the names are the caller's for messages. */
#pragma once

#include "base/json.h"
#include "ctsplat/preset.h"

/* Limits of all formats. */
#define CTS_PRESET_MAX_HU 1e6
#define CTS_PRESET_MAX_LIGHT 10.0
#define CTS_PRESET_MAX_POWER 1000.0
#define CTS_PRESET_MIN_UNIT_MM 1e-3
#define CTS_PRESET_MAX_UNIT_MM 1e3
enum { CTS_PRESET_MAX_BYTES = 1 << 20 };
/* Largest value of the preset's points and window: of HU a thousand times that of metal. Activities and stored values
 * have no usual range; this one leaves room for sums of them in double precision. */
static inline double cts_preset_max_value(const CtsPreset *preset)
{
    return preset->scale == CTS_SCALE_HU ? CTS_PRESET_MAX_HU : 1e12;
}

/* A valid preset except for name and points: composite, unlit, black background, 1 mm. */
void cts_preset_init(CtsPreset *preset);
/* The default window: the range of the points; and the window that another program suggests, if valid. */
void cts_preset_default_window(CtsPreset *preset);
void cts_preset_hint_window(CtsPreset *preset, double low_hu, double high_hu);
/* Text as a preset's name: at most 63 bytes, without control characters and slashes, so that it can be part of a file
 * name. */
bool cts_preset_set_name(CtsPreset *preset, const char *text);
/* Appends to the list of unsupported features. */
void cts_preset_note(CtsPreset *preset, const char *text);

/* A point's HU, opacity and colour under these keys, and lighting; HU never fall. */
CtsStatus cts_preset_read_opacity(const CtsJsonAt *point, const char *hu, const char *opacity, CtsPreset *preset,
                                  CtsError *err);
CtsStatus cts_preset_read_colour(const CtsJsonAt *point, const char *hu, const char *rgb, CtsPreset *preset,
                                 CtsError *err);
CtsStatus cts_preset_read_light(const CtsJsonAt *at, const char *power, CtsPreset *preset, CtsError *err);

/* ctsplat's own preset file, or a list of such as `ctsplat presets --json` prints. */
CtsStatus cts_preset_from_json(const CtsJson *json, const char *which, CtsPreset *preset, CtsError *err);
/* Slicer's volume property JSON. */
CtsStatus cts_preset_from_slicer_json(const CtsJson *json, const char *which, CtsPreset *preset, CtsError *err);

/* One value of a Slicer volume property as text, and the line of its file. */
typedef struct CtsVtkText {
    const char *text; /* NULL: not given */
    int line;
} CtsVtkText;

/* In the order of the lines of a .vp file. */
enum {
    CTS_VTK_INTERPOLATION,
    CTS_VTK_SHADE,
    CTS_VTK_DIFFUSE,
    CTS_VTK_AMBIENT,
    CTS_VTK_SPECULAR,
    CTS_VTK_POWER,
    CTS_VTK_OPACITY,
    CTS_VTK_GRADIENT,
    CTS_VTK_COLOUR,
    CTS_VTK_N_LINES,
    CTS_VTK_RANGE = CTS_VTK_N_LINES, /* effectiveRange, in XML alone */
    CTS_VTK_N
};
/* Their names as XML attributes. */
extern const char *const cts_vtk_names[CTS_VTK_N];

CtsStatus cts_preset_from_vtk(const char *name, const CtsVtkText values[CTS_VTK_N], CtsPreset *preset, CtsError *err);
CtsStatus cts_preset_from_vp(const char *text, size_t size, const char *name, CtsPreset *preset, CtsError *err);
CtsStatus cts_preset_from_xml(const char *text, size_t size, const char *name, const char *which, CtsPreset *preset,
                              CtsError *err);
