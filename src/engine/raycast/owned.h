/* Stretches of a ray within a cell, by how they look. */
#ifndef CTS_RAYCAST_OWNED_H
#define CTS_RAYCAST_OWNED_H

#include "core/volume/owners.h"
#include "engine/raycast/field.h"

typedef struct CtsOwnedStretch {
    double from, to; /* of the piece, 0 to 1 */
    int look;
} CtsOwnedStretch;

/* The piece of a trilinear field that was handed out last, stretch by stretch; returns how many. */
enum { CTS_OWNED_STRETCHES = 3 * CTS_CELL_OWNERS * CTS_CELL_OWNERS / 2 + 1 };
int cts_raycast_owned(const CtsOwners *owners, const CtsRayWalk *walk, CtsOwnedStretch *stretch);

#endif
