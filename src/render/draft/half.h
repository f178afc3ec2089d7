/* Drafts of a rotation, made from the volume at half its resolution.
 *
 * That takes an eighth of the memory, which is what a draft waits for, and half of the steps; making it takes about as
 * long as a frame saves. What it errs by depends on how fine the volume is and on the preset: rays that are cast
 * through all voxels tell, as Chernoff's bound has it, each being worth the largest error that was seen, or twice what
 * is asked for, which a few pixels may err by unseen. Half of the rays are drawn evenly, the others where the picture
 * changes. Strips of CTS_BAND_ROWS rows that err by more than what is asked for are made anew as a draft of all voxels,
 * and those that stay are judged by other rays. Rays through both volumes tell beforehand whether it is worth it. */
#ifndef CTS_RENDER_HALF_H
#define CTS_RENDER_HALF_H

#include "render/error/bound.h"
#include "core/scene/resolve.h"

/* Zeroed, it is none. */
typedef struct CtsHalf {
    CtsVolume *volume; /* NULL until a draft asks for it */
    void *kept;        /* the engine's */
    bool given_up;
} CtsHalf;

/* Whether a picture of scene is worth a try. */
bool cts_half_serves(const CtsHalf *half, const CtsEngine *engine, const CtsScene *scene);
/* The same scene of the volume at half its resolution, which is made, and tried, the first time. Where there is no
 * memory for it, or it errs too much, it is given up. */
CtsStatus cts_half_init(CtsHalf *half, const CtsEngine *engine, const CtsScene *scene, CtsSceneStore *store,
                        CtsReport *report, CtsError *err);
/* Takes a band that the engine made of that, scene being the one of all voxels. */
CtsStatus cts_half_keep(CtsFrameBound *bound, const CtsEngine *engine, const CtsScene *scene, CtsPicture *band,
                        CtsError *err);
/* Gives it up where the frame cannot be shown to keep the error asked for. */
void cts_half_end(CtsHalf *half, const CtsEngine *engine, const CtsScene *scene, const CtsFrameBound *bound,
                  CtsReport *report);
void cts_half_free(CtsHalf *half, const CtsEngine *engine);

#endif
