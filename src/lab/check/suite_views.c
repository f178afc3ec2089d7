/* Slabs and linear ramps from every side, near every switch, at every shape of voxel and picture. */
#include "lab/check/suite.h"

#include "ctsplat/bounds.h"

static const CtsCheckPoint even_3[] = {{0, 0.03, {0.2, 0.5, 0.9}}};
static const CtsCheckPoint even_50[] = {{0, 0.5, {0.2, 0.5, 0.9}}};
static const CtsCheckPoint even_ramp[] = {{0, 0, {1, 0, 0}}, {1000, 0.06, {0, 1, 1}}};
static const CtsCheckPoint soft[] = {{100, 0, {0.9, 0.5, 0.2}}, {900, 0.08, {0.3, 0.8, 1}}};
/* In RAMP, with its middle in view, the part at least a voxel from the faces, where the border does not affect the
 * gradient. */
static const CtsCheckPoint inner[] = {{400, 0, {0.9, 0.5, 0.2}}, {550, 0.08, {0.3, 0.8, 1}}, {690, 0, {0.3, 0.8, 1}}};
static const CtsCheckPoint hidden[] = {{2000, 0, {1, 1, 1}}, {2001, 1, {1, 1, 1}}};

/* 500 HU everywhere; a wide plate of 12 voxels, and a cube. */
#define PLATE .dims = {49, 13, 49}, .hu = {500}
#define CUBE .dims = {17, 17, 17}, .hu = {500}
/* Rises towards the back and a little to the left and the head. */
#define RAMP_OF(POINTS) .dims = {41, 15, 41}, .hu = {100, 5, 40, 3}, CHECK_POINTS(POINTS)
#define RAMP RAMP_OF(soft)
#define MIDDLE .mm_per_pixel = 0.61
#define EVEN .bound = {2e-6, 2e-6, 2e-7}
#define RISING .bound = {1e-3, 5e-4, 2e-7}

static const CtsCheckCase cases[] = {
    CHECK_LINEAR("slab: anterior", CUBE, CHECK_POINTS(even_3), CHECK_VIEW(0, 0), EVEN),
    CHECK_LINEAR("slab: posterior", CUBE, CHECK_POINTS(even_3), CHECK_VIEW(180, 0), EVEN),
    CHECK_LINEAR("slab: left", CUBE, CHECK_POINTS(even_3), CHECK_VIEW(90, 0), EVEN),
    CHECK_LINEAR("slab: right", CUBE, CHECK_POINTS(even_3), CHECK_VIEW(-90, 0), EVEN),
    CHECK_LINEAR("slab: head", CUBE, CHECK_POINTS(even_3), CHECK_VIEW(0, 90), EVEN),
    CHECK_LINEAR("slab: feet", CUBE, CHECK_POINTS(even_3), CHECK_VIEW(0, -90), EVEN),
    CHECK_LINEAR("slab: oblique plate", PLATE, CHECK_POINTS(even_3), CHECK_VIEW(20, 15), MIDDLE, EVEN),
    CHECK_LINEAR("slab: cube at exactly 45 degrees", CUBE, CHECK_POINTS(even_3), CHECK_VIEW(45, 0),
                 .bound = {2e-2, 2e-6, 2e-7}),
    CHECK_LINEAR("slab: cube at 45,35.26", CUBE, CHECK_POINTS(even_3), CHECK_VIEW(45, 35.26),
                 .bound = {4.5e-2, 2e-6, 2e-7}),
    CHECK_LINEAR("slab: opacity 0.5", PLATE, CHECK_POINTS(even_50), CHECK_VIEW(0, 0), MIDDLE,
                 .bound = {2e-6, CHECK_PROMISED, 2e-7}),
    CHECK_LINEAR("slab: invisible is exactly nothing", PLATE, CHECK_POINTS(hidden), CHECK_VIEW(10, 5),
                 .bound = {0, 0, 0}),
    CHECK_LINEAR("slab: unit distance 7 mm", PLATE, CHECK_POINTS(even_50), .unit_mm = 7, MIDDLE, EVEN),
    CHECK_LINEAR("slab: opacity per voxel", PLATE, .spacing_mm = {1, 2.5, 1}, CHECK_POINTS(even_3), .per_voxel = true,
                 MIDDLE, EVEN),
    CHECK_LINEAR("slab: opacity per voxel, oblique", PLATE, .spacing_mm = {1, 2.5, 1}, CHECK_POINTS(even_3),
                 .per_voxel = true, CHECK_VIEW(20, 15), MIDDLE, EVEN),
    CHECK_LINEAR("slab: leaning slices", PLATE, .lean = 0.33, CHECK_POINTS(even_3), CHECK_VIEW(0, 0), MIDDLE, EVEN),
    CHECK_LINEAR("slab: gaussian kernel", PLATE, CHECK_POINTS(even_ramp), .kernel = CTS_KERNEL_GAUSSIAN,
                 CHECK_VIEW(20, 15), MIDDLE, .bound = {2e-5, CHECK_NONE, 2e-7}),
    CHECK_LINEAR("slab: cone kernel", PLATE, CHECK_POINTS(even_ramp), .kernel = CTS_KERNEL_CONE, CHECK_VIEW(-20, 5),
                 MIDDLE, .bound = {2e-5, CHECK_NONE, 2e-7}),
    CHECK_LINEAR("slab: picture of 1 x 1", PLATE, CHECK_POINTS(even_3), .width = 1, .height = 1, MIDDLE, EVEN),
    CHECK_LINEAR("slab: picture of 32768 x 1", PLATE, CHECK_POINTS(even_3), .width = CTS_MAX_SIDE, .height = 1,
                 .mm_per_pixel = 0.001, EVEN),
    CHECK_LINEAR("slab: picture of 1 x 32768", PLATE, CHECK_POINTS(even_3), .width = 1, .height = CTS_MAX_SIDE,
                 .mm_per_pixel = 0.001, EVEN),
    CHECK_LINEAR("slab: 1000 mm a pixel", PLATE, CHECK_POINTS(even_3), .width = 3, .height = 3, .mm_per_pixel = 1000,
                 EVEN),
    CHECK_LINEAR("slab: 1e-6 mm a pixel", PLATE, CHECK_POINTS(even_3), .mm_per_pixel = 1e-6, EVEN),

    CHECK_LINEAR("ramp: anterior", RAMP, CHECK_VIEW(0, 0), MIDDLE, RISING),
    CHECK_LINEAR("ramp: posterior", RAMP, CHECK_VIEW(180, 0), MIDDLE, RISING),
    CHECK_LINEAR("ramp: left", RAMP, CHECK_VIEW(90, 0), MIDDLE, RISING),
    CHECK_LINEAR("ramp: head", RAMP, CHECK_VIEW(0, 90), MIDDLE, RISING),
    CHECK_LINEAR("ramp: oblique", RAMP, CHECK_VIEW(-20, 12), MIDDLE, RISING),
    CHECK_LINEAR("ramp: more samples", RAMP, CHECK_VIEW(-20, 12), MIDDLE, .samples = 8, .bound = {2e-4, 5e-5, 2e-7}),
    CHECK_LINEAR("ramp: 1e-9 degrees off the axis", RAMP, CHECK_VIEW(1e-9, -1e-9), MIDDLE, RISING),
    CHECK_LINEAR("ramp: slope of 1e-6 across the layers", RAMP, CHECK_VIEW(5.729577951308232e-5, 0), MIDDLE, RISING),
    CHECK_LINEAR("ramp: exactly 45 degrees", RAMP, CHECK_VIEW(45, 0), MIDDLE, RISING),
    CHECK_LINEAR("ramp: 1e-9 degrees below 45", RAMP, CHECK_VIEW(45 - 1e-9, 0), MIDDLE, RISING),
    CHECK_LINEAR("ramp: 1e-9 degrees past 45", RAMP, CHECK_VIEW(45 + 1e-9, 0), MIDDLE, .bound = {2e-2, 5e-4, 2e-7}),
    CHECK_LINEAR("ramp: spacing 1:1:100", .dims = {41, 15, 5}, .hu = {100, 5, 40, 30}, CHECK_POINTS(soft),
                 .spacing_mm = {1, 1, 100}, CHECK_VIEW(10, 20), MIDDLE, RISING),
    CHECK_LINEAR("ramp: spacing 1:1:0.01", .dims = {41, 15, 401}, .hu = {100, 5, 40, 0.25}, .hu_step = 0.25,
                 CHECK_POINTS(soft), .spacing_mm = {1, 1, 0.01}, CHECK_VIEW(10, 20), .mm_per_pixel = 0.171, RISING),
    CHECK_LINEAR("ramp: spacing 1:1:0.01 from the head", .dims = {21, 15, 401}, .hu = {100, 10, 20, 0.25},
                 .hu_step = 0.25, CHECK_POINTS(soft), .spacing_mm = {1, 1, 0.01}, CHECK_VIEW(3, 87),
                 .mm_per_pixel = 0.171, .bound = {1e-5, 1e-5, 2e-7}),
    CHECK_LINEAR("ramp: leaning slices", RAMP, .lean = -0.4, CHECK_VIEW(12, 9), MIDDLE, RISING),
    CHECK_LINEAR(
        "ramp: HU steps of 2^-20", .dims = {41, 15, 41}, .hu_step = 0x1p-20, .hu = {-1024, 0x1p-14, 0x1p-11, 0x1p-15},
        .points = (const CtsCheckPoint[]){{-1024 + 0x1p-10, 0, {0.9, 0.5, 0.2}}, {-1024 + 0x1p-7, 0.1, {0.3, 0.8, 1}}},
        .n_points = 2, CHECK_VIEW(-20, 12), MIDDLE, RISING),
    CHECK_LINEAR("ramp: lit", RAMP_OF(inner), .lit = true, CHECK_VIEW(25, 10), MIDDLE,
                 .bound = {5e-3, CHECK_PROMISED, 2e-7}),
    CHECK_LINEAR("ramp: lit, leaning, spacing 1:2:3", RAMP_OF(inner), .lit = true, .lean = 0.3, .spacing_mm = {1, 2, 3},
                 CHECK_VIEW(-15, 18), MIDDLE, .bound = {1.2e-2, CHECK_PROMISED, 2e-7}),
    CHECK_LINEAR("ramp: lit from behind", RAMP_OF(inner), .lit = true, CHECK_VIEW(-160, 10), MIDDLE,
                 .bound = {5e-3, CHECK_PROMISED, 2e-7}),
    CHECK_LINEAR("ramp: lit, power 1", RAMP_OF(inner), .lit = true, .power = 1, CHECK_VIEW(25, 10), MIDDLE,
                 .bound = {5e-3, CHECK_PROMISED, 2e-7}),
    CHECK_LINEAR("ramp: lit, power 1000", RAMP_OF(inner), .lit = true, .power = 1000, CHECK_VIEW(0.9, -0.1), MIDDLE,
                 .bound = {5e-3, 2e-3, 2e-7}),
    CHECK_LINEAR("slab: lit without a gradient is ambient", PLATE, CHECK_POINTS(even_3), .lit = true, MIDDLE, EVEN),
    CHECK_LINEAR("ramp: mip", RAMP, .mode = CTS_MODE_MIP, CHECK_VIEW(25, 10), .bound = {CHECK_NONE, 1e-6, 2e-7}),
    CHECK_LINEAR("ramp: minip", RAMP, .mode = CTS_MODE_MINIP, CHECK_VIEW(25, 10), .bound = {CHECK_NONE, 1e-6, 2e-7}),
    CHECK_LINEAR("ramp: average", RAMP, .mode = CTS_MODE_AVERAGE, CHECK_VIEW(25, 10),
                 .bound = {CHECK_NONE, 1e-6, 2e-7}),
    CHECK_LINEAR("slab: average of one grey level", CUBE, CHECK_POINTS(even_3), .mode = CTS_MODE_AVERAGE,
                 CHECK_VIEW(25, 10), .bound = {CHECK_NONE, 1e-6, 2e-7}),
    CHECK_LINEAR("ramp: B-spline kernel", .dims = {61, 15, 61}, .hu = {100, 5, 40, 3}, CHECK_POINTS(soft),
                 .kernel = CTS_KERNEL_BSPLINE, CHECK_VIEW(-10, 8), MIDDLE, .bound = {1e-3, CHECK_NONE, 2e-6}),

    CHECK_LINEAR("thin: one voxel", .dims = {1, 1, 1}, .hu = {500}, CHECK_POINTS(even_50), CHECK_VIEW(20, 30),
                 .mm_per_pixel = 0.1, .bound = {0, 0, 0}),
    CHECK_LINEAR("thin: one voxel, mip", .dims = {1, 1, 1}, .hu = {500}, CHECK_POINTS(even_50), CHECK_VIEW(20, 30),
                 .mm_per_pixel = 0.1, .mode = CTS_MODE_MIP, .bound = {CHECK_NONE, 0, 0}),
    CHECK_LINEAR("thin: a row of voxels from its side", .dims = {1, 40, 1}, .hu = {500}, CHECK_POINTS(even_50),
                 CHECK_VIEW(70, 30), .mm_per_pixel = 0.1, .bound = {0, 0, 0}),
    CHECK_LINEAR("thin: a row of voxels from its end", .dims = {1, 40, 1}, .hu = {100, 0, 20, 0}, CHECK_POINTS(soft),
                 .width = 5, .height = 5, .mm_per_pixel = 0.1, .bound = {5e-4, 2e-4, 2e-7}),
    CHECK_LINEAR("thin: one layer face on", .dims = {30, 30, 1}, .hu = {500}, CHECK_POINTS(even_50), CHECK_VIEW(0, 90),
                 .bound = {0, 0, 0}),
    CHECK_LINEAR("thin: one layer face on, mip", .dims = {30, 30, 1}, .hu = {100, 20, 7, 0}, CHECK_POINTS(even_50),
                 CHECK_VIEW(0, 90), .mode = CTS_MODE_MIP, .bound = {CHECK_NONE, 1e-6, 1e-6}),
    CHECK_LINEAR("thin: one layer oblique", .dims = {30, 30, 1}, .hu = {500}, CHECK_POINTS(even_50), CHECK_VIEW(20, 30),
                 .bound = {0, 0, 0}),
    CHECK_LINEAR("thin: one layer edge on", .dims = {30, 30, 1}, .hu = {100, 20, 7, 0}, CHECK_POINTS(soft),
                 CHECK_VIEW(0, 0), .width = 25, .height = 25, .bound = {1e-3, 4e-4, 2e-7}),
    CHECK_LINEAR("thin: two layers face on", .dims = {30, 30, 2}, .hu = {100, 20, 0, 300}, CHECK_POINTS(soft),
                 CHECK_VIEW(0, 90), .bound = {5e-3, CHECK_PROMISED, 2e-7}),
};

const CtsCheckTable cts_check_linear = {cases, sizeof cases / sizeof *cases};
