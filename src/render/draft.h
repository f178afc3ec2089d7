/* Pieces of a draft rendered as no draft: some to show what it errs by, whole rows in its place.
 *
 * A draft looks once a layer and may miss what is smaller, and few of the rays that are cast would meet it. So pieces
 * of eight pixels, drawn by chance from all over the picture, are rendered without a draft as well: one in
 * CTS_DRAFT_ONE_IN, or CTS_DRAFT_PIECES where that is more. What none of them meets stays unknown: some pixels in a
 * thousand, each by itself. */
#ifndef CTS_RENDER_DRAFT_H
#define CTS_RENDER_DRAFT_H

#include "scene/engine.h"

enum { CTS_DRAFT_ONE_IN = 64, CTS_DRAFT_PIECES = 1024 };

/* What a pixel, as it shows on the preset's background, is off by against rgba: its square, the mean of the channels.
 */
double cts_square_of_error(const CtsPreset *preset, const float *pixel, const double rgba[4]);

/* Mean square error of rows first to end - 1 of the band, by those of them that are drawn. scene is that of the draft.
 */
CtsStatus cts_draft_try(const CtsEngine *engine, const CtsScene *scene, const CtsPicture *band, int first, int end,
                        double *mean_square, CtsError *err);
/* Renders rows first to end - 1 of the band anew, bounds and depths as well. */
CtsStatus cts_draft_redraw(const CtsEngine *engine, const CtsScene *scene, CtsPicture *band, int first, int end,
                           CtsError *err);

#endif
