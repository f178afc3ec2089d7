#include "ctsplat/render.h"

#include "base/enum_table.h"

CTS_ENUM_TABLE(char *const, cts_fit_names, CTS_N_FITS, [CTS_FIT_VOLUME] = "volume", [CTS_FIT_VISIBLE] = "visible");

CTS_ENUM_TABLE(CtsNamedView, cts_views, CTS_N_VIEWS, {"anterior", 0, 0}, {"posterior", 180, 0}, {"left", 90, 0},
               {"right", -90, 0}, {"head", 0, 90}, {"feet", 0, -90});
