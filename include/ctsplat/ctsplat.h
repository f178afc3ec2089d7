/* Everything ctsplat offers to C callers. */
#ifndef CTSPLAT_CTSPLAT_H
#define CTSPLAT_CTSPLAT_H

#include "ctsplat/annotate.h"
#include "ctsplat/table.h"
#include "ctsplat/export.h"
#include "ctsplat/mixture.h"
#include "ctsplat/net.h"
#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/reference.h"
#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/state.h"
#include "ctsplat/status.h"
#include "ctsplat/volume.h"

#endif
