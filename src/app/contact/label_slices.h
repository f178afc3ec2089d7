/* For the contact sheet: slices through a scan, with the outlines of its labels. */
#ifndef CTS_LABEL_SLICES_H
#define CTS_LABEL_SLICES_H

#include "ctsplat/labels.h"
#include "ctsplat/picture.h"
#include "ctsplat/series.h"
#include "ctsplat/status.h"

enum { CTS_LABEL_SLICES_SIDE = 240 };

/* Three squares side by side, each side so many pixels: one scanned slice as it is stored, then along its rows, then
 * along its columns, the last slice at the top; through the centre of what the labels hold. All of one scale; HU in a
 * window of soft tissue. The outline of label i has the hue i times the golden ratio, which the sheet's list repeats.
 * scanned still has its grey levels, and labels are counted on it. */
CtsStatus cts_label_slices(const CtsScanned *scanned, const CtsLabels *labels, CtsPicture **picture, CtsError *err);

#endif
