/* Table removal: the body among the connected parts, and the cut that frees it from what it touches. */
#ifndef CTS_TABLE_COUCH_BODY_H
#define CTS_TABLE_COUCH_BODY_H

#include "table/couch_judge.h"

typedef struct CouchBody {
    CtsBits mask;   /* voxels dense enough for a body */
    CtsParts parts; /* of mask, less what was cut away */
    bool is_cut;    /* something was: mask has voxels that are in no part */
    CouchVerdict verdict;
    CtsBits any, solid;  /* the cells of the body, as couch_cells() has them; made when they are wanted */
    double cut_mm3;      /* cut from the body */
    double attached_mm3; /* thin and far from anything thick, yet joined to the body */
} CouchBody;

/* Parts and verdict of body->mask less away (which may be NULL; body->parts may have been counted then). A
 * zero-initialised CouchBody may be freed. */
CtsStatus couch_body_find(const CouchScene *scene, CouchBody *body, const CtsBits *away, CtsError *err);
void couch_body_free(CouchBody *body);

/* Have body->any and body->solid; grid covers the whole volume. Who changes the verdict then keeps them up. */
CtsStatus couch_body_cells(const CouchScene *scene, const CouchGrid *grid, CouchBody *body, CtsError *err);

/* How much of the body hangs on it like a table would: less than 30 mm thick, further than an ear from anything
 * thicker, and running through all slices. Such a slab is past cutting. */
CtsStatus couch_find_slab(const CouchScene *scene, const CouchGrid *grid, CouchBody *body, double *slab_mm3,
                          CtsError *err);

/* Where thin parts reach further from the body than an ear or a nose can, cut them off if they are sheets that touch
 * it. grid covers the whole volume. */
CtsStatus couch_separate(const CouchScene *scene, const CouchGrid *grid, CouchBody *body, CtsError *err);

#endif
