/* What a draft errs by, and rows of it rendered anew.
 *
 * A draft keeps no bounds. Pieces of eight pixels, drawn by chance from all over the picture, are rendered without a
 * draft as well: one in CTS_DRAFT_ONE_IN, or CTS_DRAFT_PIECES where that is more. By how much the draft is beside
 * them, they tell as Chernoff's bound has it (cts_expectation_limit()), a piece being worth the largest that was seen;
 * what they err by themselves, rays tell that are cast through them (cts_bound_judge()), and both are added. Strips of
 * CTS_BAND_ROWS rows whose pieces are beside the draft by more than half of what is asked for are rendered anew. What
 * none of the pieces meets stays unknown: some pixels in a thousand, each by itself. */
#ifndef CTS_RENDER_DRAFT_H
#define CTS_RENDER_DRAFT_H

#include "render/error/bound.h"

enum { CTS_DRAFT_ONE_IN = 256, CTS_DRAFT_PIECES = 512 };

/* Takes a band that the engine made as a draft of scene. */
CtsStatus cts_draft_keep(CtsFrameBound *bound, const CtsEngine *engine, const CtsScene *scene, CtsPicture *band,
                         CtsError *err);
/* Renders rows first to end - 1 of the band, depths as well, as this scene has them. */
CtsStatus cts_draft_redraw(const CtsEngine *engine, const CtsScene *scene, CtsPicture *band, int first, int end,
                           CtsError *err);

#endif
