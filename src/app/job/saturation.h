/* Whether a picture is little but black or white, which a user should hear of. */
#ifndef CTS_JOB_SATURATION_H
#define CTS_JOB_SATURATION_H

#include "ctsplat/picture.h"
#include "ctsplat/report.h"

typedef struct CtsSaturation {
    uint64_t n, n_black, n_white; /* pixels, and those at most, or at least, a grey level that the eye takes for it */
    uint64_t n_seen, n_full;      /* of a projection: above black, and at the top of the window */
} CtsSaturation;

/* Counts a band over its background, before anything is drawn on it. */
void cts_saturation_add(CtsSaturation *saturation, const CtsPicture *band);
/* A warning where half of what a projection shows is white, or nearly all of a picture is black or white. */
void cts_saturation_tell(const CtsSaturation *saturation, const CtsPictureInfo *info, CtsReport *report);

#endif
