/* Rows of a draft rendered as no draft: some to show what it errs by, others in its place.
 *
 * A draft looks once a layer and may miss what is smaller, and few rays of a large picture would meet it. Whole rows
 * do: of every CTS_BAND_ROWS one row or more, drawn by chance, together at least CTS_DRAFT_ROWS where the picture has
 * as many strips or eight a strip. They cost a sixty-fourth of the picture that was not wanted. */
#ifndef CTS_RENDER_DRAFT_H
#define CTS_RENDER_DRAFT_H

#include "scene/engine.h"

enum { CTS_DRAFT_ROWS = 16 };

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
