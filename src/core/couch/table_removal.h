/* The steps of table removal. "Measured" in comments of this folder: the volume removed, and the doubtful volume, of
 * four real series (a chest on a table with a mattress, a skull phantom on a tray, a tilted head in a holder, a slab of
 * a trunk), and the tests tests/unit/test_table.c and tests/e2e/table.sh. */
#pragma once

#include "base/bits.h"
#include "core/model/body_mask.h"
#include "core/volume/components.h"
#include "ctsplat/table.h"

/* A volume as sections across the scanner's axis, from head to feet: voxels denser than air, one bit per voxel, several
 * slices joined to a section. */

/* Orientation of the sections: axis[2] runs along the scanner, nearest to the patient's z; axis[0] and axis[1] are the
 * columns and rows of a section, in the volume's order. */
typedef struct CtsSectionPlan {
    int axis[3];
    int n_slices;         /* voxels along axis[2] that one section joins */
    double spacing_mm[3]; /* between columns, rows and sections */
    double voxel_mm3;     /* of one bit of a section */
    int dims[3];          /* of the sections' bits */
    /* Grey levels of the volume, where it has none of its own; or NULL. */
    const CtsLinearLayers *layers;
} CtsSectionPlan;

/* False when the volume's steps do not span space. */
bool cts_section_plan(const CtsVolume *volume, double thickness_mm, CtsSectionPlan *plan);

/* Dilation and opening of one section, a slice of a CtsBits. */

/* Size of a structuring element: an octagon of `diamond` steps along the axes, then a box of these half sizes, in
 * voxels. */
typedef struct CtsReach {
    int diamond, box[2];
} CtsReach;

/* The octagon nearest to a disk; at least 1 voxel along either axis. */
CtsReach cts_reach_mm(double radius_mm, const double spacing_mm[2]);

/* Scratch for sections of one size, of one thread. */
typedef struct CtsMorphology {
    size_t row_words, ny, n_words;
    uint64_t last_word;    /* mask of a row's last word inside the section */
    size_t stride, n_copy; /* of the two copies a and b, with margins: words from row to row, and in total */
    uint64_t *buffer, *a, *b;
} CtsMorphology;

/* An array of one for each thread. */
CtsStatus cts_morphologies_new(CtsMorphology **workers, const CtsBits *like, int n_threads, CtsError *err);
void cts_morphologies_free(CtsMorphology **workers, int n_threads);

/* Sections of n_words words; in and out may be the same. Outside the section all voxels are 0
 * for dilation; for opening the border voxels are continued, like a patient cut off by the field of view. */
typedef void (*cts_section_fn)(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out);
void cts_dilate_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out);
void cts_open_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out);
/* The parts that an opening removes: the section without its opening dilated by a voxel. */
void cts_thin_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out);
/* One of these functions applied to all sections, which may be changed in place. */
void cts_each_section(CtsMorphology *workers, int n_threads, cts_section_fn change, const CtsBits *in, CtsReach reach,
                      CtsBits *out);

/* The patient among the connected parts denser than air, with the voxels it encloses. */
typedef struct CtsBody {
    CtsBits dense;   /* the patient where it is denser than air */
    CtsBits whole;   /* and the voxels it encloses in a section */
    CtsBits foreign; /* parts of some size that are not the patient */
    double mm3;      /* of the dense bits */
    double thin_mm3; /* volume of its thin protrusions */
    /* The air around it, found when it is first needed: */
    double lung_hu;      /* air above this is a lung; 0: not found yet */
    bool air_is_unknown; /* a table stands in air as dense as lungs, and room air has no level of its own */
} CtsBody;

/* A search for the table; all bits are in the dimensions of the sections, unless others are stated. */
struct CtsTableSearch {
    const CtsVolume *volume;
    CtsSectionPlan plan;
    int n_threads;
    CtsMorphology *workers; /* one for each thread */
    CtsBits dense;          /* of the volume's voxels */
    uint64_t n_runs;        /* of the dense voxels in rows */
    CtsBits sections;       /* has the words of `dense` where a section is a slice */
    /* Thin structures at a constant position over 60 mm of the scanner's axis; and candidates, which may be thicker.
     * None in volumes with fewer slices. */
    CtsBits plates, doubtful;
    CtsBody body;
    /* Results: */
    CtsBits gone; /* voxels that become air */
    bool removes; /* voxels lie outside the body: those in `gone` become air */
    CtsBodyMask *inside;
    int dims[3], air_before[3]; /* of the volume that was searched */
};

/* Makes the sections, of which a bit is set where any dense voxel of it is. */
CtsStatus cts_sections_new(CtsTableSearch *r, CtsError *err);
/* The bits of `gone` along row (j, k) of the volume that was searched: in place, or made in `row`. */
const uint64_t *cts_gone_row(const CtsTableSearch *r, int j, int k, uint64_t *row);

/* Finds the plates and the doubtful ones. */
CtsStatus cts_plates_find(CtsTableSearch *r, CtsError *err);

/* A plate under the patient's back, where both are one: found between the plate's two ends that stick out. */

/* All of one section: voxels set always and ever, and the plates found in it. Adds strips that continue a plate from
 * its contact with a thicker structure to where it emerges again: along the far face, with nothing beneath, and as
 * thick as the plate. */
void cts_plate_contacts_add(const CtsBits *always, const CtsBits *ever, CtsBits *plates);

/* The HU at a place of the sections: of the first slice of section k. */
double cts_section_hu(const CtsTableSearch *r, int i, int j, int k);

/* outside[]: parts of the air that reach the border of a section and are not lung, which HU alone tell. has_table:
 * plates were found. */
CtsStatus cts_air_outside(CtsTableSearch *r, const CtsComponents *air, bool has_table, uint8_t *outside, CtsError *err);

/* HU that tables do not reach: shells of solid carbon fibre are the densest. Compact bone and metal do. Measured: of
 * five tables and holders 0 to 4 in 10,000 voxels are denser, and 0 to 22 in 100 denser than 500 HU. */
enum { CTS_TABLE_HU = 600 };

/* Finds the body, for which sections without the plates are the candidates, of which those that are mostly denser than
 * tables are none. Overwrites the plates' bits. */
CtsStatus cts_body_find(CtsTableSearch *r, CtsError *err);
/* Finds the whole of the body: these bits, and what they enclose within a section. */
CtsStatus cts_body_enclose(CtsTableSearch *r, const CtsBits *dense, bool has_table, CtsError *err);
/* Finds the voxels that minip and average use: the whole body except its outermost 3 mm, which contain the soft edge of
 * the skin. */
CtsStatus cts_body_inside(CtsTableSearch *r, CtsError *err);
