/* Known faults, planted one at a time to prove that tests catch them. In a normal build every CTS_MUTATED() is the
 * constant 0 and leaves nothing behind; the library of tests/unit/test_mutation.c has them. */
#ifndef CTS_BASE_MUTATION_H
#define CTS_BASE_MUTATION_H

#define CTS_MUTATIONS(fault)                                                                                           \
    fault(HALF_PIXEL)            /* view: pixels half a pixel off */                                                   \
        fault(MIRRORED)          /* view: left and right exchanged */                                                  \
        fault(UNIT_DISTANCE)     /* preset: opacity per mm, whatever the unit */                                       \
        fault(STEP_SIDE)         /* preset: of two points at one HU the earlier holds */                               \
        fault(CAP)               /* preset: opacity 1 is a little less */                                              \
        fault(OPACITY_STEP)      /* paper engines: opacity not corrected for the step */                               \
        fault(LAST_LAYER)        /* paper engines: last layer lost */                                                  \
        fault(END_PLANES)        /* paper engines: first and last plane count whole */                                 \
        fault(ROUNDING)          /* paper engines: levels cut off, not rounded */                                      \
        fault(FLOAT_DRIFT)       /* layers: sums of changes kept in float */                                           \
        fault(FOOTPRINT_SUM)     /* paper engines: weights not normalised */                                           \
        fault(VOID_EDGES)        /* void: patches at the edge of what shows left out */                                \
        fault(GRADIENT_STEPS)    /* lighting: spacing and shear forgotten */                                           \
        fault(ONE_SIDED_LIGHT)   /* tiled: surfaces turned away are dark */                                            \
        fault(LEAP_RANGE)        /* tiled: a block judged by its lowest level */                                       \
        fault(STOP_EARLY)        /* tiled: stops with a quarter of the light left */                                   \
        fault(ATTENUATION)       /* tiled: no attenuation along a ray */                                               \
        fault(KNOTS)             /* raycast: not cut at the transfer function's points */                              \
        fault(TURNS)             /* raycast: not cut where HU turns */                                                 \
        fault(BORDER_DIFFERENCE) /* raycast: no air beyond the border */                                               \
        fault(MODE_EXTREMES)     /* raycast: extremes looked for at cell faces alone */                                \
        fault(VOXEL_LENGTH)      /* opacity per voxel: by the largest step along the ray, not its length */            \
        fault(TOLERANCE_LESS)    /* layers: a change of exactly the tolerance counts as one */                         \
        fault(QUIET_RANGE)       /* layers: the levels of a patch that stays the same end one too low */               \
        fault(QUIET_HIGH)        /* tiled: what shows ends two levels too low */                                       \
        fault(WHOLE_LEVELS)      /* what shows between two levels is not seen */                                       \
        fault(LEAP_FAR)          /* tiled: leaps a block too far */                                                    \
        fault(GRADIENT_SIGN)     /* tiled: the gradient along the layers turned round */                               \
        fault(AVERAGE_BLOCK)     /* average: blocks of one grey level 2 % low */                                       \
        fault(DEPTH_SLAB)        /* tiled: depth a millimetre too far */                                               \
        fault(BOUND_LOW)         /* tiled: tells a twentieth of its error bound */                                     \
        fault(UNCAST)            /* tiled: pixels that are made again stay as they were */                             \
        fault(CUTS)              /* tiled: pieces are not cut at knots */                                              \
        fault(KNOT_OFF)          /* tiled: a knot above a piece is none */                                             \
        fault(MASK_NEIGHBOUR)    /* tiled: cells judged without their last corners */                                  \
        fault(LAST_PIECE)        /* tiled: rays end a millimetre early */                                              \
        fault(START_LATE)        /* tiled: rays begin a millimetre late */                                             \
        fault(GAUSS)             /* tiled: both points of a piece are its first */                                     \
        fault(FAINT)             /* tiled: faint pieces get no light */                                                \
        fault(LIT_STEPS)         /* tiled: a normal that turns is taken for one */                                     \
        fault(HALVES)            /* tiled: pieces that err too much are not halved */                                  \
        fault(HIDING)            /* labels: what is hidden stays in the gradients and in the paper engines */          \
        fault(OVERLAP)           /* labels: what several hold the last of them owns */                                 \
        fault(EDGES)             /* tiled: rays keep the look that they enter a cell with */                           \
        fault(OWNER_CUTS)        /* raycast: the owner of a cell's middle has all of it */

#define CTS_MUTATION_ENTRY(name) CTS_MUTATION_##name,
enum CtsMutation { CTS_MUTATION_NONE, CTS_MUTATIONS(CTS_MUTATION_ENTRY) CTS_N_MUTATIONS };

#if defined CTS_MUTATION_AT_RUN_TIME
extern int cts_mutation_now;
#define CTS_MUTATED(name) (cts_mutation_now == CTS_MUTATION_##name)
#else
#define CTS_MUTATED(name) 0
#endif

#endif
