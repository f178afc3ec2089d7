/* Table removal: the seam where a thin sheet (a head holder's shell, a table's skin, a blanket) touches the body. */
#ifndef CTS_TABLE_COUCH_SHEET_H
#define CTS_TABLE_COUCH_SHEET_H

#include "table/couch_grid.h"

/* What is known about the body and the sheet joined to it, in cells of grid. */
typedef struct CouchHints {
    const CouchGrid *grid;
    CtsBits core;   /* the body, deep below its surface */
    CtsBits inside; /* the body, its skin and what it encloses: no sheet there but for the place of contact */
    CtsBits far;    /* too far from the body to be a part of it */
} CouchHints;

/* What comes off, in voxels; both are made here. seam: voxels of the sheet where it touches something else. loose: the
 * sheet's parts within a slice that the seam has set free, which may still overlap the body of the next slice. */
typedef struct CouchCut {
    CtsBits seam, loose;
} CouchCut;

/* Across each slice the mask body is read in lines along both axes. Where a line meets the sheet alone it gives a run
 * of the sheet's thickness; runs are followed from the far cells as long as both faces go on without a step. Where the
 * sheet touches something, one of its faces still goes on: from a run on one side of the contact to one on the other
 * side that face is followed, and the sheet's thickness, interpolated between the two, is measured off from it. So the
 * cut falls on the sheet's other face, and what it touched loses nothing; where blur has widened the contact, slack
 * makes the cut so many voxels deeper. */
CtsStatus couch_cut(const CouchScene *scene, const CtsBits *body, const CouchHints *hints, int slack, CouchCut *cut,
                    CtsError *err);
void couch_cut_free(CouchCut *cut);

#endif
