/* The paper's engines: sheets of exact integers, layer by layer, with its two savings switched on or off. */
#ifndef CTS_SPLAT_PAPER_H
#define CTS_SPLAT_PAPER_H

#include "core/scene/engine.h"

typedef struct CtsPaperFeatures {
    bool reuse_layers; /* inter-layer similarity: a sheet is the previous one plus what changed */
    bool skip_void;    /* voxels and regions that cannot change the picture are left out */
} CtsPaperFeatures;

CtsStatus cts_paper_render(const CtsScene *scene, CtsPaperFeatures features, CtsPicture *picture, CtsReport *report,
                           CtsError *err);

#endif
