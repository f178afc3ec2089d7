/* Whether a projection is little but white: the window's fault, which a user should hear of. */
#ifndef CTS_JOB_SATURATION_H
#define CTS_JOB_SATURATION_H

#include "ctsplat/picture.h"
#include "ctsplat/report.h"

typedef struct CtsSaturation {
    uint64_t n_seen, n_white; /* pixels above black, and those at the top of the window */
} CtsSaturation;

/* Counts a band as the engine made it, before anything is drawn on it. */
void cts_saturation_add(CtsSaturation *saturation, const CtsPicture *band);
/* A warning where half of what is seen is white. */
void cts_saturation_tell(const CtsSaturation *saturation, const CtsPictureInfo *info, CtsReport *report);

#endif
