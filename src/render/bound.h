/* What a frame's pixels may be off by: the worst of them are cast, so that the rest keeps what was asked. */
#ifndef CTS_RENDER_BOUND_H
#define CTS_RENDER_BOUND_H

#include "raycast/raycaster.h"
#include "scene/engine.h"

/* Zeroed, it is a frame of which nothing is known. */
typedef struct CtsFrameBound {
    CtsRaycaster *caster; /* made when a pixel has to be cast */
    uint64_t pixels, cast;
    double square, most; /* sum of the squares of what is left, and the largest */
    double wall_ms, cpu_ms;
} CtsFrameBound;

/* Takes a band whose bounds the engine gave, casts the rays of its worst pixels until the rest of each strip of
 * CTS_BAND_ROWS rows stays below the error that scene->plan asks for, and puts what they are into the band. A ray costs
 * some hundred times a pixel of the march, and the few worst are not to cost more than a part of the picture: one pixel
 * in 512 by default, one in 32 where an error was asked for. */
CtsStatus cts_bound_keep(CtsFrameBound *bound, const CtsScene *scene, CtsPicture *band, CtsError *err);
/* The report's bound, and a warning where the error is larger than it should be. */
void cts_bound_tell(const CtsFrameBound *bound, const CtsScene *scene, CtsReport *report);
void cts_bound_free(CtsFrameBound *bound);

#endif
