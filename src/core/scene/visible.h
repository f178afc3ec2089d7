/* Properties of a picture that follow from its scene, independent of its pixels, for all outputs. */
#pragma once

#include "core/model/voxel_labels.h"
#include "ctsplat/preset.h"
#include <stdbool.h>

/* True when no pixel can have a colour: the preset, its background, and each label's appearance are grey. preset: with
 * the settings' mode; voxel_labels: the volume's, or NULL. */
bool cts_scene_is_grey(const CtsPreset *preset, const CtsVoxelLabels *voxel_labels);

/* True when skin of a CT may be visible, so that a face may be recognised; in doubt too. extinction_scale as in
 * CtsScene. */
bool cts_scene_shows_skin(const CtsPreset *preset, double extinction_scale, const CtsVoxelLabels *voxel_labels);

/* True where a visible edge of the opacity is so steep that the picture is an isosurface. */
bool cts_scene_has_step(const CtsPreset *preset, const CtsVolume *volume);
