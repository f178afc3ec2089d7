/* The transfer function by grey level as it is: straight pieces between knots. Opacity and colour are linear in HU
 * between the preset's points, so what a march needs of a level is the piece it lies in. */
#ifndef CTS_TILED_PIECES_H
#define CTS_TILED_PIECES_H

#include "core/scene/engine.h"

/* Every point of opacity and of colour is a knot, and so is where an extinction reaches the largest there is. */
enum { TILED_KNOTS = 3 * CTS_MAX_POINTS };

/* Piece i lies between knots i - 1 and i; the first and the last go on for ever. A level g in it has the opacity
 * at[0][i] + rise[0][i] (g - from[i]), and red, green and blue likewise. */
typedef struct TiledPieces {
    int n_knots;
    float knot[TILED_KNOTS]; /* grey levels, rising */
    float rest[TILED_KNOTS]; /* what single precision leaves of them */
    /* Knots that change anything: by how much extinction per mm jumps there, and its slope per grey level changes;
     * colours count as far as they show. */
    int n_changes;
    float change[TILED_KNOTS], change_rest[TILED_KNOTS], jump[TILED_KNOTS], bend[TILED_KNOTS];
    float from[TILED_KNOTS + 1], from_rest[TILED_KNOTS + 1], at[4][TILED_KNOTS + 1], rise[4][TILED_KNOTS + 1];
    float by_log2;   /* extinction per mm is -log2(1 - opacity) times this, */
    float most;      /* and at most this; both to the base of 2 */
    float low, high; /* nothing shows at low or below, nor at high or above */
    float colours; /* by how much two colours that show differ at most in a channel, black and background among them */
} TiledPieces;

void cts_tiled_pieces_init(TiledPieces *pieces, const CtsScene *scene);

#endif
