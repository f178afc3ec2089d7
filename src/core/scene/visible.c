#include "core/scene/visible.h"

#include <math.h>

bool cts_scene_is_grey(const CtsPreset *preset, const CtsVoxelLabels *voxel_labels)
{
    bool grey = cts_preset_is_grey(preset, preset->mode);
    for (int i = 0; grey && voxel_labels && i < voxel_labels->n; i++) {
        const int appearance = voxel_labels->appearance[i];
        if (appearance < CTS_APPEARANCE_OWN)
            continue;
        CtsPreset own;
        cts_appearance_preset(&voxel_labels->appearances[appearance], preset, &own);
        own.background_none = true; /* the picture's is behind all of it */
        grey = cts_preset_is_grey(&own, CTS_MODE_COMPOSITE);
    }
    return grey;
}

/* HU from the skin's surface to soft tissue, and the step at which presets are evaluated. */
enum { SKIN_LOW_HU = -700, SKIN_HIGH_HU = 80, SKIN_STEP_HU = 10 };
/* Extinction per mm with which 20 mm, the path of rays along the outline of a face, have an opacity of 1/16: -ln(15/16)
 * / 20. */
static const double outline_per_mm = 0.0032;

static bool preset_shows_skin(const CtsPreset *preset, double extinction_scale)
{
    for (double hu = SKIN_LOW_HU; hu <= SKIN_HIGH_HU; hu += SKIN_STEP_HU)
        if (cts_preset_extinction_per_mm(preset, hu) * extinction_scale > outline_per_mm)
            return true;
    return false;
}

/* With a window, skin is visible against air where black lies below soft tissue. */
static bool appearance_shows_skin(const CtsPreset *preset, double extinction_scale, const CtsVoxelLabels *voxel_labels,
                                  int appearance)
{
    if (appearance == CTS_APPEARANCE_HIDDEN)
        return false;
    if (preset->mode != CTS_MODE_COMPOSITE)
        return preset->window_low_hu < SKIN_HIGH_HU;
    if (appearance < CTS_APPEARANCE_OWN)
        return preset_shows_skin(preset, extinction_scale);
    CtsPreset own;
    cts_appearance_preset(&voxel_labels->appearances[appearance], preset, &own);
    return preset_shows_skin(&own, extinction_scale);
}

bool cts_scene_shows_skin(const CtsPreset *preset, double extinction_scale, const CtsVoxelLabels *voxel_labels)
{
    bool shown = !voxel_labels && appearance_shows_skin(preset, extinction_scale, NULL, CTS_APPEARANCE_PRESET);
    for (int i = 0; !shown && voxel_labels && i < voxel_labels->n; i++)
        shown = voxel_labels->on_skin[i] &&
                appearance_shows_skin(preset, extinction_scale, voxel_labels, voxel_labels->appearance[i]);
    return shown;
}

/* An opacity that rises by more than this, a visible edge, within STEP_HU is a step: its picture is an isosurface,
 * whose thinnest parts change whole pixels, which a sample of pixels may miss. 20 HU are about the noise of soft tissue
 * in thin slices, which takes voxels of one tissue to both ends of a steeper rise; it is a fiftieth of the range from
 * air to soft tissue, as STEP_SHARE is of another quantity's from air to bright. */
#define STEP_OPACITY 0.25
#define STEP_HU 20.0
#define STEP_SHARE 0.02

bool cts_scene_has_step(const CtsPreset *preset, const CtsVolume *volume)
{
    const double width =
        volume->quantity == CTS_QUANTITY_HU ? STEP_HU : STEP_SHARE * (volume->bright_value - volume->air_value);
    for (int i = 0; i < preset->n_opacity; i++)
        for (int side = -1; side <= 1; side += 2) {
            const double hu = preset->opacity[i].hu;
            if (fabs(cts_preset_opacity(preset, hu + side * width) - cts_preset_opacity(preset, hu)) > STEP_OPACITY ||
                (i > 0 && preset->opacity[i - 1].hu == hu &&
                 fabs(preset->opacity[i].opacity - preset->opacity[i - 1].opacity) > STEP_OPACITY))
                return true;
        }
    return false;
}
