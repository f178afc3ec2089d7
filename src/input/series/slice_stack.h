/* Positions of the slices of a sorted stack, and the even grid of layers for them. */
#pragma once

#include "ctsplat/report.h"
#include "ctsplat/status.h"
#include "dicom/header/slice.h"
#include <stdbool.h>

CTS_C_BEGIN

typedef enum CtsStackKind {
    CTS_STACK_EVEN,    /* slice k is layer k */
    CTS_STACK_MISSING, /* slices lie on whole layers, and some layers are empty */
    CTS_STACK_UNEQUAL  /* slices lie between layers, and some may be missing */
} CtsStackKind;

typedef struct CtsSliceStack {
    CtsStackKind kind;
    int n_layers;
    double *layer;      /* position of each slice in layers: rises from 0 to n_layers - 1; owned */
    double step_lps[3]; /* from layer to layer */
    double spacing_mm;  /* median gap along the normal */
    double smallest_gap_mm, largest_gap_mm;
    double tilt_deg, sideways_mm; /* sideways: largest distance of a slice from the straight line of positions */
    int n_missing;
    int first_gap; /* the first missing slice would follow this one */
} CtsSliceStack;

/* Largest number of layers of an unequal stack, for each slice: one narrow gap must not multiply the memory further. A
 * head in slices of 5 mm with some of 1.25 mm, a usual mixture, has all of its layers. */
enum { CTS_STACK_GROWTH = 4 };

/* True if more than a tenth of all slices are missing. */
bool cts_slice_stack_lacks_many(int n_missing, int n);

/* Slices sorted along the normal, no two at one position, 2 or more. CTS_ERR_GEOMETRY when they make no volume: more
 * than a tenth is missing (unless allow_missing), or they lie beside each other rather than on a line; the numbers
 * found stay in stack then, but no layers, so that a refused series can still be described. */
CtsStatus cts_slice_stack_plan(const CtsSlice *const *slices, int n, bool allow_missing, CtsSliceStack *stack,
                               CtsError *err);
void cts_slice_stack_free(CtsSliceStack *stack);

/* The stack's warnings. */
void cts_slice_stack_diagnostics(const CtsSliceStack *stack, const CtsSlice *const *slices, int n,
                                 CtsDiagnostics *diagnostics);

/* Position along the normal of `reference`. */
double cts_slice_stack_position_mm(const CtsSlice *reference, const CtsSlice *slice);

/* The difference up to which two gaps count as equal: 0.02 mm or 1 % of the median, but at most a quarter of it. */
double cts_slice_stack_tolerance_mm(double median_gap_mm);

CTS_C_END
