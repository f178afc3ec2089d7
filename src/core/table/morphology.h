/* One section, a slice of a CtsBits, made wider and narrower. */
#ifndef CTS_TABLE_MORPHOLOGY_H
#define CTS_TABLE_MORPHOLOGY_H

#include "base/bits.h"

/* How far a shape reaches: an octagon of `diamond` steps along the axes, then a box of these half sizes, in voxels. */
typedef struct CtsReach {
    int diamond, box[2];
} CtsReach;

/* The octagon nearest to a disk; at least 1 voxel along either axis. */
CtsReach cts_reach_mm(double radius_mm, const double spacing_mm[2]);

/* Scratch for sections of one size, of one thread. */
typedef struct CtsMorphology {
    size_t row_words, n_words;
    uint64_t last_word;            /* the bits of a row's last word that lie inside */
    size_t n_rows, stride, n_copy; /* of the two copies a and b, with margins: words from row to row, and in all */
    bool avx2;
    uint64_t *buffer, *a, *b;
} CtsMorphology;

CtsStatus cts_morphology_new(CtsMorphology *m, const CtsBits *like, CtsError *err);
void cts_morphology_free(CtsMorphology *m);
/* An array of one for each thread. */
CtsStatus cts_morphologies_new(CtsMorphology **workers, const CtsBits *like, int n_threads, CtsError *err);
void cts_morphologies_free(CtsMorphology **workers, int n_threads);

/* Sections of n_words words; in and out may be the same. Outside the section lies nothing for dilation, and for opening
 * whatever lies at its border goes on, as a patient does whom the field of view cuts off. */
typedef void (*cts_section_fn)(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out);
void cts_dilate_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out);
void cts_open_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out);
/* What an opening takes away from a section for good: opened, grown back by a voxel, the rest. */
void cts_thin_section(CtsMorphology *m, const uint64_t *in, CtsReach reach, uint64_t *out);
/* One of these for all sections, which may be changed in place. */
void cts_each_section(CtsMorphology *workers, int n_threads, cts_section_fn change, const CtsBits *in, CtsReach reach,
                      CtsBits *out);

#endif
