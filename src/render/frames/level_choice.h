/* Choice of an engine's level for a frame (without --level, for engine auto or one that has levels): the cheapest for
 * which, on a probe of the picture, error control will probably meet the requested error.
 *
 * The probe is up to PROBES x PROBES tiles spread over the picture, one at random in each cell of a grid, and one pixel
 * at random in each 4 x 4 of a tile. They are rendered by the exact march once, and at each level from the cheapest on.
 * The choice depends on scene and request alone: no clock, no earlier frame, no cache. */
#pragma once

#include "core/scene/engine.h"

typedef struct CtsLevelChoice {
    CtsEngineLevel level; /* CTS_LEVEL_AUTO: no level will do */
    bool coarse_lattice;  /* CtsPlan.coarse_lattice */
    int n_tried;
    bool march_misses;  /* the march errs by more than the probe asks of it, so that nothing is tried */
    double march_error; /* of the march on pixels of the probe, rms; 0: not known */
    size_t n_pixels;    /* of the probe */
    double limit;       /* limit of the error of the last level tried, rms (cts_error_control_predict()) */
    double wall_ms, cpu_ms;
} CtsLevelChoice;

/* scene: as the engine gets it; march_scene: as the exact march does. may_march: no level is tried where the march
 * takes less time. */
CtsStatus cts_level_choose(CtsLevelChoice *choice, const CtsEngine *engine, const CtsScene *scene,
                           const CtsEngine *march, const CtsScene *march_scene, bool may_march, CtsError *err);
