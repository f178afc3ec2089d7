/* The table of engines. */
#ifndef CTS_RENDER_ENGINES_H
#define CTS_RENDER_ENGINES_H

#include "core/scene/engine.h"

const CtsEngine *cts_engine(CtsEngineId id);

#endif
