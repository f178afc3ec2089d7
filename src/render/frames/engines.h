/* The table of engines. */
#ifndef CTS_RENDER_ENGINES_H
#define CTS_RENDER_ENGINES_H

#include "core/scene/engine.h"

const CtsEngine *cts_engine(CtsEngineId id);
/* The engine that re-renders an engine's pixels for error control: itself, else the first that can. */
CtsEngineId cts_engine_march(CtsEngineId id);

#endif
