/* The volume's block ranges, for engines that skip what is void. */
#ifndef CTS_SCENE_BLOCKS_H
#define CTS_SCENE_BLOCKS_H

#include "scene/engine.h"
#include "volume/blocks.h"

/* Those that the volume has, or *own, made here if need be (the caller frees them). The report says which. */
CtsStatus cts_scene_blocks(const CtsScene *scene, CtsBlocks **own, const CtsBlocks **blocks, CtsReport *report,
                           CtsError *err);

#endif
