/* What a picture's frame holds: what the preset shows in this view, wherever in the volume that is. */
#ifndef CTS_SCENE_FRAMING_H
#define CTS_SCENE_FRAMING_H

#include "ctsplat/preset.h"
#include "ctsplat/render.h"
#include "ctsplat/volume.h"

/* What of a volume a preset may show. */
typedef struct CtsVisible CtsVisible;

/* preset: its mode as it is rendered. volume must stay as it is. */
CtsStatus cts_visible_new(CtsVisible **visible, const CtsVolume *volume, const CtsPreset *preset, int n_threads,
                          CtsError *err);
void cts_visible_free(CtsVisible **visible);

/* False when nothing of the volume shows. */
bool cts_visible_any(const CtsVisible *visible);

/* Sets mm_per_pixel and centre_lps so that what is shown fills the frame: in the settings' view, or in all
 * rotation_frames from there on. Of a slab, what it cuts out. Rays are cast for it, 128 x 128 or a few times as many:
 * shown is where they lose 1/16 of their light or more (in mip, minip and average, meet what is brighter than black by
 * 1/255), but for parts that have less than 0.1 % of the shown area. Leaves settings as they are when nothing is shown.
 */
void cts_framing_find(const CtsVisible *visible, CtsRenderSettings *settings);

/* The same for a picture by itself, where the settings ask for it and say no scale. */
CtsStatus cts_framing_settle(const CtsVolume *volume, const CtsPreset *preset, CtsRenderSettings *settings,
                             CtsError *err);

#endif
