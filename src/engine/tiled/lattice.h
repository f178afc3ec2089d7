/* A draft's lattice: every second pixel of every second row is marched first. Where the pixels around a cell of it
 * agree the rest is filled in between, else marched as well. It pays where neighbours on the lattice are less than a
 * voxel apart, since the field runs straight there. */
#ifndef CTS_TILED_LATTICE_H
#define CTS_TILED_LATTICE_H

#include "engine/tiled/march.h"

/* Whether a picture is made on a lattice first. */
bool cts_lattice_pays(const TiledJob *job, const CtsScene *scene);
/* Maps, width and rows of the lattice, which covers all of job's pixels; its picture has room for 4 floats a place. */
void cts_lattice_spread(TiledJob *lattice, const TiledJob *job);
/* Fills n pixels of rows y and y + 1 from job->lattice, x, y and the lattice's first row being even; false where they
 * are to be marched: also where all is empty, as something thin may lie between. */
bool cts_lattice_fill(const TiledJob *job, int x, int y, int n);

#endif
