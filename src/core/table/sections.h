/* A volume as sections across the scanner's axis, which run from the patient's head to the feet: what is denser than
 * air, one bit a voxel, a few slices to a section. */
#ifndef CTS_TABLE_SECTIONS_H
#define CTS_TABLE_SECTIONS_H

#include "base/bits.h"
#include "ctsplat/volume.h"

/* Where the sections of a volume lie: axis[2] runs along the scanner, nearest to the patient's z; axis[0] and axis[1]
 * are the columns and rows of a section, in the volume's order. */
typedef struct CtsSectionPlan {
    int axis[3];
    int n_slices;         /* voxels along axis[2] that one section joins */
    double spacing_mm[3]; /* between columns, rows and sections */
    double voxel_mm3;     /* of one bit of a section */
    int dims[3];          /* of the sections' bits */
} CtsSectionPlan;

/* False when the volume's steps do not span space. */
bool cts_section_plan(const CtsVolume *volume, double thickness_mm, CtsSectionPlan *plan);

/* A bit is set where any voxel of it is; dense has the volume's dimensions. */
CtsStatus cts_sections_new(const CtsSectionPlan *plan, const CtsBits *dense, int n_threads, CtsBits *sections,
                           CtsError *err);

/* The bits of the sections along row (j, k) of the volume, as a row of a CtsBits of its dimensions. */
void cts_sections_row(const CtsSectionPlan *plan, const CtsBits *sections, int nx, int j, int k, uint64_t *row);

#endif
