#include "render/frames/engines.h"

#include "base/by_id.h"

CTS_BY_ID(char *const, cts_engine_names,
          CTS_N_ENGINES, [CTS_ENGINE_CLASSIC] = "classic", [CTS_ENGINE_LAYERS] = "layers", [CTS_ENGINE_VOID] = "void",
          [CTS_ENGINE_COMBINED] = "combined", [CTS_ENGINE_TILED] = "tiled", [CTS_ENGINE_RAYCAST] = "raycast");

static CTS_BY_ID(CtsEngine *const, engines,
                 CTS_N_ENGINES, [CTS_ENGINE_CLASSIC] = &cts_engine_classic, [CTS_ENGINE_LAYERS] = &cts_engine_layers,
                 [CTS_ENGINE_VOID] = &cts_engine_void, [CTS_ENGINE_COMBINED] = &cts_engine_combined,
                 [CTS_ENGINE_TILED] = &cts_engine_tiled, [CTS_ENGINE_RAYCAST] = &cts_engine_raycast);

CTS_BY_ID(char *const, cts_engine_level_names, CTS_N_LEVELS, [CTS_LEVEL_AUTO] = "auto", [CTS_LEVEL_LATTICE] = "lattice",
          [CTS_LEVEL_SHEETS] = "sheets", [CTS_LEVEL_HALF_SHEETS] = "half-sheets", [CTS_LEVEL_HYBRID] = "hybrid");

const CtsEngine *cts_engine(CtsEngineId id)
{
    return engines[id];
}

CtsEngineId cts_engine_march(CtsEngineId id)
{
    for (int i = 0; i < CTS_N_ENGINES && !engines[id]->render_pixels; i++)
        id = engines[i]->render_pixels ? (CtsEngineId)i : id;
    return id;
}
