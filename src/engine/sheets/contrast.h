/* Contrast between neighbouring pixels, as a part of their error indicator. */
#pragma once

#include "engine/sheets/lattice.h"

/* Adds the contrast of pixels x0 to x1 - 1 of rows y0 to y1 - 1 of a patch to their indicators. Rows beyond these are
 * not looked at. */
void cts_sheets_add_contrast(const SheetsPatch *patch, int x0, int x1, int y0, int y1);
