/* Table removal: which connected parts are the patient. */
#ifndef CTS_TABLE_COUCH_JUDGE_H
#define CTS_TABLE_COUCH_JUDGE_H

#include "table/couch_grid.h"

/* At more than this share of the body a doubt is a warning, and nothing is taken. */
#define COUCH_UNCERTAIN_SHARE 0.05

typedef struct CouchVerdict {
    uint8_t *body; /* one flag a part */
    double body_mm3;
    double disputed_mm3; /* what of it may not be body, but is too much to be taken on a guess */
} CouchVerdict;

/* Judge each part by its shape. Body is what is 10 mm thick or more and compact, like a trunk, a limb or a finger;
 * sheets, however thick, and long rods are not. The largest such part is the body (the largest part of all if there is
 * none). A zero-initialised verdict may be freed; judging frees what it held. */
CtsStatus couch_judge(const CouchScene *scene, const CtsParts *parts, CouchVerdict *verdict, CtsError *err);
void couch_verdict_free(CouchVerdict *verdict);

/* Add to the body what lies inside it entirely, and small soft parts close to it that the last slice cuts off: the tip
 * of an ear. body_cells and inside are cells of grid. */
CtsStatus couch_adopt(const CouchScene *scene, const CouchGrid *grid, const CtsParts *parts, const CtsBits *body_cells,
                      const CtsBits *inside, CouchVerdict *verdict, bool *grew, CtsError *err);

#endif
