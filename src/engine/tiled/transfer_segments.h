/* The transfer function by grey level as linear segments between control points. Opacity and colour are linear in HU
 * between the preset's points, so that a level is evaluated by its segment. */
#pragma once

#include "core/scene/engine.h"

/* Control points: every point of opacity and of colour, and the opacity from which the extinction has its maximum. */
enum { TILED_CONTROL_POINTS = 3 * CTS_MAX_POINTS };

/* Segment i goes from level end[0][i] to end[1][i], plus remainder, the part beyond single precision; the first has no
 * begin, the last no end. A level g in it has the opacity value[0][i] + slope[0][i] (g - end[0][i]), and red, green and
 * blue likewise. At control points between segments: discontinuity of the extinction per mm, and change of its slope
 * per grey level; colours count where they are visible. */
typedef struct TiledTransfer {
    int n_control_points; /* one less than there are segments */
    float end[2][TILED_CONTROL_POINTS + 1], remainder[2][TILED_CONTROL_POINTS + 1],
        discontinuity[2][TILED_CONTROL_POINTS + 1], slope_change[2][TILED_CONTROL_POINTS + 1];
    float beyond[2][TILED_CONTROL_POINTS + 1]; /* begin of the segment before, and end of the next one */
    float value[4][TILED_CONTROL_POINTS + 1], slope[4][TILED_CONTROL_POINTS + 1];
    float max_colour_slope[TILED_CONTROL_POINTS + 1]; /* largest slope of a colour channel */
    float by_log2;                                    /* extinction per mm is -log2(1 - opacity) times this, */
    float max_extinction;                             /* and at most this; both to the base of 2 */
    float max_colour_difference; /* largest difference of two visible colours in a channel, black and background
                                    included */
} TiledTransfer;

void cts_tiled_transfer_init(TiledTransfer *transfer, const CtsScene *scene);
