#include "ctsplat/render.h"

const CtsNamedView cts_views[CTS_N_VIEWS] = {
    {"anterior", 0, 0}, {"posterior", 180, 0}, {"left", 90, 0}, {"right", -90, 0}, {"head", 0, 90}, {"feet", 0, -90},
};
