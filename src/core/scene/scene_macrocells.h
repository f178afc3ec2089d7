/* The volume's macro-cell ranges, for engines with empty-space skipping. */
#pragma once

#include "core/model/macrocells.h"
#include "core/scene/engine.h"

/* The volume's own, or *own, created here if needed (the caller frees them). The report says which. */
CtsStatus cts_scene_macrocells(const CtsScene *scene, CtsMacrocells **own, const CtsMacrocells **macrocells,
                               CtsReport *report, CtsError *err);
