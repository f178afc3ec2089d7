/* The whole C interface of ctsplat; the shared library exports the declarations of these headers. man/example.c renders
 * a folder in 30 lines. Messages write the names of settings as `max_error`. */
#pragma once

#include "ctsplat/annotate.h"
#include "ctsplat/bounds.h"
#include "ctsplat/diagnostic.h"
#include "ctsplat/export.h"
#include "ctsplat/job.h"
#include "ctsplat/mixture.h"
#include "ctsplat/model.h"
#include "ctsplat/net.h"
#include "ctsplat/picture.h"
#include "ctsplat/preset.h"
#include "ctsplat/quantity.h"
#include "ctsplat/reference.h"
#include "ctsplat/render.h"
#include "ctsplat/report.h"
#include "ctsplat/series.h"
#include "ctsplat/state.h"
#include "ctsplat/status.h"
#include "ctsplat/table.h"
#include "ctsplat/volume.h"
