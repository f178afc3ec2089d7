/* Mutation testing: known faults, enabled one at a time to prove that tests detect them. In a normal build every
 * CTS_MUTATED() is the constant 0; the library of tests/unit/test_mutation.c contains them. */
#pragma once

#define CTS_MUTATIONS(fault)                                                                                           \
    fault(HALF_PIXEL)             /* view: pixels half a pixel off */                                                  \
        fault(MIRRORED)           /* view: left and right exchanged */                                                 \
        fault(UNIT_DISTANCE)      /* preset: opacity per mm for every unit distance */                                 \
        fault(STEP_SIDE)          /* preset: of two points at one HU the earlier applies */                            \
        fault(CAP)                /* preset: opacity 1 is a little less */                                             \
        fault(OPACITY_STEP)       /* paper engines: opacity not corrected for the step */                              \
        fault(LAST_LAYER)         /* paper engines: last layer missing */                                              \
        fault(END_PLANES)         /* paper engines: first and last plane with full weight */                           \
        fault(ROUNDING)           /* paper engines: levels truncated, not rounded */                                   \
        fault(FLOAT_DRIFT)        /* layers: sums of changes kept in float */                                          \
        fault(FOOTPRINT_SUM)      /* paper engines: weights not normalised */                                          \
        fault(VOID_EDGES)         /* void: patches at the edge of visible ones left out */                             \
        fault(GRADIENT_STEPS)     /* lighting: spacing and shear ignored */                                            \
        fault(ONE_SIDED_LIGHT)    /* tiled: surfaces facing away are dark */                                           \
        fault(SKIP_RANGE)         /* tiled: only the lowest level of a block is tested */                              \
        fault(STOP_EARLY)         /* tiled: rays end at a transmittance of a quarter */                                \
        fault(ATTENUATION)        /* tiled: no attenuation along a ray */                                              \
        fault(CONTROL_POINTS)     /* raycast: not split at the transfer function's points */                           \
        fault(TURNS)              /* raycast: not split at extremes of HU */                                           \
        fault(BORDER_DIFFERENCE)  /* raycast: no air beyond the border */                                              \
        fault(MODE_EXTREMES)      /* raycast: extremes at cell faces only */                                           \
        fault(VOXEL_LENGTH)       /* opacity per voxel: by the largest step along the ray, not its length */           \
        fault(TOLERANCE_LESS)     /* layers: a change of exactly the tolerance counts */                               \
        fault(QUIET_RANGE)        /* layers: the range of an unchanged patch ends one level too low */                 \
        fault(QUIET_HIGH)         /* tiled: the visible range ends two levels too low */                               \
        fault(WHOLE_LEVELS)       /* visible values between two levels are invisible */                                \
        fault(SKIP_TOO_FAR)       /* tiled: empty-space skipping goes a block too far */                               \
        fault(GRADIENT_SIGN)      /* tiled: the gradient along the layers has the wrong sign */                        \
        fault(AVERAGE_BLOCK)      /* average: blocks of one grey level 2 % low */                                      \
        fault(DEPTH_SLAB)         /* tiled: depth a millimetre too far */                                              \
        fault(BOUND_LOW)          /* tiled: reports a twentieth of its error estimate */                               \
        fault(UNCAST)             /* tiled: re-rendered pixels are not replaced */                                     \
        fault(SPLITS)             /* tiled: segments are not split at control points */                                \
        fault(CONTROL_POINT_OFF)  /* tiled: a control point above a segment is ignored */                              \
        fault(MASK_NEIGHBOUR)     /* tiled: cells tested without their last voxels */                                  \
        fault(LAST_PIECE)         /* tiled: rays end a millimetre early */                                             \
        fault(START_LATE)         /* tiled: rays begin a millimetre late */                                            \
        fault(GAUSS)              /* tiled: both points of a segment are its first */                                  \
        fault(LOW_WEIGHT)         /* tiled: low-weight segments are not shaded */                                      \
        fault(LIT_STEPS)          /* tiled: one normal for a segment whose normal varies */                            \
        fault(HALVES)             /* tiled: segments with too large an error are not halved */                         \
        fault(HIDING)             /* labels: hidden labels remain in gradients and in the paper engines */             \
        fault(OVERLAP)            /* labels: of overlapping labels the last gets the voxel */                          \
        fault(EDGES)              /* tiled: rays keep the appearance of a cell's entry */                              \
        fault(LABEL_INTERVALS)    /* raycast: the label of a cell's middle fills all of it */                          \
        fault(OPEN_PLACE)         /* openness: half a block off */                                                     \
        fault(OPEN_BEYOND)        /* openness: no light from beyond the volume */                                      \
        fault(OPEN_UNUSED)        /* tiled: openness is 1 everywhere */                                                \
        fault(SHEET_WEIGHTS)      /* sheets: the second row of a footprint is missing */                               \
        fault(SHEET_SHARE)        /* sheets: partial slabs count as whole ones */                                      \
        fault(SHEET_SHAFT)        /* sheets: groups see the block before theirs */                                     \
        fault(SHEET_OPACITY)      /* sheets: opacity of half-sheets for a whole slab */                                \
        fault(SHEET_LIGHT)        /* sheets: the gradient across the sheets has the wrong sign */                      \
        fault(INDICATOR_LEVELS)   /* sheets: indicators without the difference of sheets and half-sheets */            \
        fault(INDICATOR_LIGHT)    /* sheets: indicators without changes of the light */                                \
        fault(INDICATOR_MISSED)   /* sheets: indicators without what samples may miss */                               \
        fault(INDICATOR_CONTRAST) /* sheets: indicators without the contrast to neighbours */

#define CTS_MUTATION_ENTRY(name) CTS_MUTATION_##name,
enum CtsMutation { CTS_MUTATION_NONE, CTS_MUTATIONS(CTS_MUTATION_ENTRY) CTS_N_MUTATIONS };

#if defined CTS_MUTATION_AT_RUN_TIME
extern int cts_mutation_now;
#define CTS_MUTATED(name) (cts_mutation_now == CTS_MUTATION_##name)
#else
#define CTS_MUTATED(name) 0
#endif
