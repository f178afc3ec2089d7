/* Linear fields: exact in trilinear interpolation, so that every view of them has a closed form. */
#ifndef CTS_CHECK_SUITE_LINEAR_H
#define CTS_CHECK_SUITE_LINEAR_H

#include "lab/check/suite.h"

typedef struct CtsLinearScene {
    int dims[3];
    double spacing_mm[3]; /* zeros: 1 */
    double lean;          /* the slices' step leans along y by this share of its length: a gantry tilt */
    double hu_step;       /* 0: 1 */
    double hu[4];         /* at voxel (0, 0, 0), and per voxel along each axis */
    const CtsCheckPoint *points;
    int n_points;
    double azimuth_deg, elevation_deg, mm_per_pixel; /* mm 0: all fits */
    int width, height;                               /* 0: 24 */
    double unit_mm;                                  /* 0: 1 */
    double power;                                    /* of the highlight; 0: 12 */
    bool per_voxel, lit;
    int mode; /* CtsMode */
    int samples;
    CtsKernelId kernel;
    double bound[CHECK_N_FAMILIES];
} CtsLinearScene;

/* A CtsCheckCase.run; data is a CtsLinearScene. */
CtsStatus cts_check_linear_scene(CtsCheckRun *run, const void *data, CtsError *err);

/* A row for a linear scene. Families it does not apply to have the bound CHECK_NONE. */
#define CHECK_LINEAR(NAME, ...)                                                                                        \
    {                                                                                                                  \
        NAME, CHECK_OF_ALL, cts_check_linear_scene, &(const CtsLinearScene)                                            \
        {                                                                                                              \
            __VA_ARGS__                                                                                                \
        }                                                                                                              \
    }

#define CHECK_POINTS(ARRAY) .points = (ARRAY), .n_points = (int)(sizeof(ARRAY) / sizeof *(ARRAY))

#endif
