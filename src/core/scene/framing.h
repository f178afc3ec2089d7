/* What a picture's frame holds: all that the preset can show, wherever in the volume that is. */
#ifndef CTS_SCENE_FRAMING_H
#define CTS_SCENE_FRAMING_H

#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/volume.h"

/* The macro-cells of a volume that can show something. */
typedef struct CtsVisible CtsVisible;

/* preset: its mode as it is rendered. In mode composite a level shows when 1 cm of it takes away 1/255 of the light; in
 * mip, minip and average when it is brighter than black by 1/255. volume must stay as it is. */
CtsStatus cts_visible_new(CtsVisible **visible, const CtsVolume *volume, const CtsPreset *preset, int n_threads,
                          CtsError *err);
void cts_visible_free(CtsVisible **visible);

/* False when nothing of the volume shows. */
bool cts_visible_any(const CtsVisible *visible);

/* How far what is visible reaches in a direction (patient coordinates): the largest dot product, exact to one cell
 * between voxels. */
double cts_visible_reach(const CtsVisible *visible, const double direction_lps[3]);

/* Sets mm_per_pixel and centre_lps so that what is visible fills the frame: in the settings' view, or in all
 * rotation_frames from there on. Of a slab, what it cuts out. Leaves settings as they are when nothing is visible. */
void cts_framing_find(const CtsVisible *visible, CtsRenderSettings *settings);

/* The same for a picture by itself, where the settings ask for it and say no scale. */
CtsStatus cts_framing_settle(const CtsVolume *volume, const CtsPreset *preset, CtsRenderSettings *settings,
                             CtsError *err);

#endif
