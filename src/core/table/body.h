/* The patient among the connected parts of what is denser than air, with what it encloses. */
#ifndef CTS_TABLE_BODY_H
#define CTS_TABLE_BODY_H

#include "core/table/morphology.h"
#include "core/table/sections.h"
#include "core/volume/body_mask.h"
#include "ctsplat/volume.h"

typedef struct CtsBody {
    CtsBits dense;   /* the patient where it is denser than air */
    CtsBits whole;   /* and what it encloses in a section */
    CtsBits foreign; /* what is no patient, of some size */
    double mm3;      /* of the dense bits */
    double thin_mm3; /* of those that stand out thin from the whole */
} CtsBody;

/* sections without extruded is what there may be of the patient; both and the volume in memory as the plan has them.
 * workers[]: one for each thread. */
CtsStatus cts_body_find(const CtsSectionPlan *plan, const CtsVolume *volume, const CtsBits *sections,
                        const CtsBits *extruded, CtsMorphology *workers, int n_threads, CtsBody *body, CtsError *err);
void cts_body_free(CtsBody *body);

/* What minip and average look at: the whole body but for its outermost 3 mm, which hold the soft edge of the skin. */
CtsStatus cts_body_inside(const CtsSectionPlan *plan, const CtsBits *whole, CtsMorphology *workers, int n_threads,
                          CtsBodyMask **mask, CtsError *err);

#endif
