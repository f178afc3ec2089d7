/* Letters and a scale bar drawn into a picture. */
#pragma once

#include "ctsplat/picture.h"
#include "ctsplat/status.h"
#include <stdbool.h>
#include <stddef.h>

CTS_API_BEGIN

/* orientation: the patient's directions at the edges, as A P L R H F and pairs like LA. scale: a bar of a round length
 * (1, 2 or 5 times a power of ten) near a fifth of the width, with its length in mm. Light with a dark outline, over a
 * light background (info.light_behind) dark with a light one, readable over the patient too; blended over the pixels,
 * so that a grey picture stays grey and transparent pixels become opaque under marks. Depth is unchanged. In a band
 * only the marks' parts within its rows are drawn. Marks without room in a small picture are omitted; n_left_out (may
 * be NULL) counts them. CTS_ERR_USAGE when a scale is requested and the picture's mm_per_pixel is unknown. */
CtsStatus cts_annotate(CtsPicture *picture, bool orientation, bool scale, int *n_left_out, CtsError *err);

/* A name in a picture, and the colour that it is written in. */
typedef struct CtsLegendEntry {
    const char *name; /* UTF-8; NULL: the line stays free */
    int number;       /* precedes a name that cannot be drawn completely */
    double rgb[3];    /* display values 0..1 */
} CtsLegendEntry;

/* Draws n names, each in its colour, one below the other in the corners without the scale; in capitals, Latin with
 * accents and Greek. For a name in other letters, or one that is too long for the picture, the number and as much of
 * the name as possible are drawn; n_in_part (may be NULL) counts these, n_left_out as above. */
CtsStatus cts_annotate_legend(CtsPicture *picture, const CtsLegendEntry *entries, size_t n, int *n_in_part,
                              int *n_left_out, CtsError *err);

CTS_API_END
