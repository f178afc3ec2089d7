/* The volume's macro-cell ranges, for engines that skip what is void. */
#ifndef CTS_SCENE_MACROCELLS_H
#define CTS_SCENE_MACROCELLS_H

#include "core/scene/engine.h"
#include "core/volume/macrocells.h"

/* Those that the volume has, or *own, made here if need be (the caller frees them). The report says which. */
CtsStatus cts_scene_macrocells(const CtsScene *scene, CtsMacrocells **own, const CtsMacrocells **macrocells,
                               CtsReport *report, CtsError *err);

#endif
