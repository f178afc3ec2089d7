/* Volumes whose grey levels the caller writes, every one: saves a pass over memory. */
#pragma once

#include "ctsplat/volume.h"

/* As cts_volume_new(), with uninitialised grey levels. */
CtsStatus cts_volume_new_unset(CtsVolume **volume, int nx, int ny, int nz, CtsError *err);
/* In the place of another and with its range, and with room for n_layers of grey levels, which are not set. */
CtsStatus cts_volume_new_like(CtsVolume **volume, const CtsVolume *like, int n_layers, CtsError *err);
/* Without grey levels, which stay NULL: a volume's place and range alone. */
CtsStatus cts_volume_new_empty(CtsVolume **volume, int nx, int ny, int nz, CtsError *err);
