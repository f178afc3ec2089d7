/* Letters and a scale bar drawn into a picture. */
#ifndef CTSPLAT_ANNOTATE_H
#define CTSPLAT_ANNOTATE_H

#include "ctsplat/picture.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>

CTS_API_BEGIN

/* orientation: which way of the patient each edge points, as A P L R H F and pairs like LA.
 * scale: a bar of a round length (1, 2 or 5 times a power of ten) near a fifth of the width, with its length in mm.
 * Light with a dark rim, over a light background (info.light_behind) dark with a light one, so that marks stand out
 * from it and can be read over the patient too; blended over the pixels, so that a grey picture
 * stays grey and transparent places become opaque where something is drawn. Depth is left alone. Of a band what falls
 * into its rows is drawn. A mark that a small picture has no room for is left out; n_left_out (may be NULL) counts
 * them. CTS_ERR_USAGE when a scale is asked for and the picture's mm_per_pixel is not known. */
CtsStatus cts_annotate(CtsPicture *picture, bool orientation, bool scale, int *n_left_out, CtsError *err);

/* A name in a picture, and the colour that it is written in. */
typedef struct CtsLegendEntry {
    const char *name; /* UTF-8 */
    int number;       /* what stands in front of a name of which not all can be written */
    double rgb[3];    /* display values 0..1 */
} CtsLegendEntry;

/* n names, each in its colour, one below the other in the corners that the scale does not have; in capitals, Latin with
 * its accents and Greek. Of a name in other letters, or one that is too long for the picture, the number is written and
 * as much of the name as can be; n_in_part (may be NULL) counts these, n_left_out as above. */
CtsStatus cts_annotate_legend(CtsPicture *picture, const CtsLegendEntry *entries, size_t n, int *n_in_part,
                              int *n_left_out, CtsError *err);

CTS_API_END
#endif
