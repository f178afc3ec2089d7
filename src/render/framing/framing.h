/* What a picture's frame holds: what the preset shows in this view, wherever in the volume that is. */
#ifndef CTS_FRAMING_FRAMING_H
#define CTS_FRAMING_FRAMING_H

#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/volume.h"

/* Whose frames are looked for. kept and frame: as in CtsScene, of the engine that draws
 * small pictures (cts_engine_for_probes()). */
typedef struct CtsFramed {
    const CtsVolume *volume;
    const CtsPreset *preset; /* effective: cts_scene_preset() */
    void **kept;
    int frame;
} CtsFramed;

/* Sets mm_per_pixel and centre_lps so that what is shown fills the frame: in the settings' view, or in all
 * rotation_frames from there on. Of a slab, what it cuts out. Small pictures are drawn for it, 128 x 128 each: shown is
 * where they are opaque to 1/16 or more (in mip, minip and average, brighter than black by 1/255), but for parts that
 * have less than 0.1 % of the shown area. Leaves settings as they are when nothing is shown. */
CtsStatus cts_framing_find(const CtsFramed *what, CtsRenderSettings *settings, CtsError *err);

/* The same for a picture by itself, where the settings ask for it and say no scale. */
CtsStatus cts_framing_settle(const CtsVolume *volume, const CtsPreset *preset, CtsRenderSettings *settings,
                             CtsError *err);

#endif
