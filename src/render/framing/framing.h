/* The picture's frame around the visible part of the volume. */
#pragma once

#include "ctsplat/model.h"
#include "ctsplat/preset.h"
#include "ctsplat/render.h"

/* Scene of the frames to be found. kept and frame: as in CtsScene, for the engine of probe renderings
 * (cts_engine_for_probes()). */
typedef struct CtsFramed {
    const CtsModel *model;
    const CtsPreset *preset; /* effective: cts_scene_preset() */
    void **cache;
    int frame;
} CtsFramed;

/* Sets mm_per_pixel and centre_lps so that the visible part fills the frame: in the settings' view, or in all
 * rotation_frames from there on. With a slab, its visible part. Uses probe renderings of 128 x 128 pixels: visible from
 * an opacity of 1/16 on (in mip, minip and average, brighter than black by 1/255), except for parts of less than 0.1 %
 * of the visible area, weighted by opacity (or brightness). Leaves settings unchanged when nothing is visible. */
CtsStatus cts_framing_find(const CtsFramed *what, CtsRenderSettings *settings, CtsError *err);

/* The same for a single picture, if the settings request it and give no scale. */
CtsStatus cts_framing_settle(const CtsModel *model, const CtsPreset *preset, CtsRenderSettings *settings,
                             CtsError *err);
