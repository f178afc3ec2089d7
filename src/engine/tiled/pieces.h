/* The transfer function by grey level as it is: straight pieces between knots. Opacity and colour are linear in HU
 * between the preset's points, so what a march needs of a level is the piece it lies in. */
#ifndef CTS_TILED_PIECES_H
#define CTS_TILED_PIECES_H

#include "core/scene/engine.h"

/* Every point of opacity and of colour is a knot, and so is where an extinction reaches the largest there is. */
enum { TILED_KNOTS = 3 * CTS_MAX_POINTS };

/* Piece i goes from level end[0][i] to end[1][i], and rest more, which single precision leaves of them; the first has
 * no begin, the last no end. A level g in it has the opacity at[0][i] + rise[0][i] (g - end[0][i]), and red, green and
 * blue likewise. Between pieces lie knots, where anything changes: by how much extinction per mm jumps there, and its
 * slope per grey level does; colours count as far as they show. */
typedef struct TiledPieces {
    int n_knots; /* one less than there are pieces */
    float end[2][TILED_KNOTS + 1], rest[2][TILED_KNOTS + 1], jump[2][TILED_KNOTS + 1], bend[2][TILED_KNOTS + 1];
    float beyond[2][TILED_KNOTS + 1]; /* where the piece before begins, and the next one ends */
    float at[4][TILED_KNOTS + 1], rise[4][TILED_KNOTS + 1];
    float tint[TILED_KNOTS + 1]; /* by how much that colour rises or falls that does most */
    float by_log2;               /* extinction per mm is -log2(1 - opacity) times this, */
    float most;                  /* and at most this; both to the base of 2 */
    float low, high;             /* nothing shows at low or below, nor at high or above */
    float colours; /* by how much two colours that show differ at most in a channel, black and background among them */
} TiledPieces;

void cts_tiled_pieces_init(TiledPieces *pieces, const CtsScene *scene);

#endif
