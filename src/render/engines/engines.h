/* The table of engines. Its rows are those of CTS_ENGINES (ctsplat/render.h). */
#pragma once

#include "core/scene/engine.h"
#include <stddef.h>

const CtsEngine *cts_engine(CtsEngineId id);

/* The engine that re-renders an engine's pixels for error control: itself, else the first that can. */
CtsEngineId cts_engine_march(CtsEngineId id);
/* The first engine with levels, which CTS_ENGINE_AUTO tries. */
CtsEngineId cts_engine_with_levels(void);
/* The engine of probe renderings: it has every mode and error control. */
CtsEngineId cts_engine_for_probes(void);

enum { CTS_ENGINE_FLAG = -1, CTS_ENGINE_LIST_MAX = 128 };
/* "a, b and c", for messages: the engines that have this bit in this column of their row (offsetof), or that have the
 * column true (CTS_ENGINE_FLAG). Returns list. */
const char *cts_engines_with(size_t column, int bit, char list[CTS_ENGINE_LIST_MAX]);
