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
#define RAMP_OF(BY) .dims = {41, 15, 41}, .hu = {100, 5, 40, 3}, POINTS(BY)
#define RAMP RAMP_OF(soft)
#define LIT RAMP_OF(inner), .lit = true
/* 500 HU of opacity 0.5. */
#define OF_500(NX, NY, NZ) .dims = {NX, NY, NZ}, .hu = {500}, POINTS(even_50)
#define MIDDLE .mm_per_pixel = 0.61
#define EVEN .bound = {2e-6, 2e-6, 2e-7}
#define RISING .bound = {1e-3, 5e-4, 2e-7}
#define NEARLY .bound = {5e-3, CHECK_PROMISED, 2e-7}
#define PROJECTED .bound = {CHECK_NONE, 1e-6, 2e-7}
#define EXACT .bound = {0, 0, 0}

static const CtsCheckCase cases[] = {
    LINEAR("slab: anterior", CUBE, POINTS(even_3), VIEW(0, 0), EVEN),
    LINEAR("slab: posterior", CUBE, POINTS(even_3), VIEW(180, 0), EVEN),
    LINEAR("slab: left", CUBE, POINTS(even_3), VIEW(90, 0), EVEN),
    LINEAR("slab: right", CUBE, POINTS(even_3), VIEW(-90, 0), EVEN),
    LINEAR("slab: head", CUBE, POINTS(even_3), VIEW(0, 90), EVEN),
    LINEAR("slab: feet", CUBE, POINTS(even_3), VIEW(0, -90), EVEN),
    LINEAR("slab: oblique plate", PLATE, POINTS(even_3), VIEW(20, 15), MIDDLE, EVEN),
    LINEAR("slab: cube at exactly 45 degrees", CUBE, POINTS(even_3), VIEW(45, 0), .bound = {2e-2, 2e-6, 2e-7}),
    LINEAR("slab: cube at 45,35.26", CUBE, POINTS(even_3), VIEW(45, 35.26), .bound = {4.5e-2, 2e-6, 2e-7}),
    LINEAR("slab: opacity 0.5", PLATE, POINTS(even_50), VIEW(0, 0), MIDDLE, .bound = {2e-6, CHECK_PROMISED, 2e-7}),
    LINEAR("slab: invisible is exactly nothing", PLATE, POINTS(hidden), VIEW(10, 5), EXACT),
    LINEAR("slab: unit distance 7 mm", PLATE, POINTS(even_50), .unit_mm = 7, MIDDLE, EVEN),
    LINEAR("slab: opacity per voxel", PLATE, .spacing_mm = {1, 2.5, 1}, POINTS(even_3), .per_voxel = true, MIDDLE,
           EVEN),
    LINEAR("slab: opacity per voxel, oblique", PLATE, .spacing_mm = {1, 2.5, 1}, POINTS(even_3), .per_voxel = true,
           VIEW(20, 15), MIDDLE, EVEN),
    LINEAR("slab: leaning slices", PLATE, .lean = 0.33, POINTS(even_3), VIEW(0, 0), MIDDLE, EVEN),
    LINEAR("slab: gaussian kernel", PLATE, POINTS(even_ramp), .kernel = CTS_KERNEL_GAUSSIAN, VIEW(20, 15), MIDDLE,
           .bound = {2e-5, CHECK_NONE, 2e-7}),
    LINEAR("slab: cone kernel", PLATE, POINTS(even_ramp), .kernel = CTS_KERNEL_CONE, VIEW(-20, 5), MIDDLE,
           .bound = {2e-5, CHECK_NONE, 2e-7}),
    LINEAR("slab: picture of 1 x 1", PLATE, POINTS(even_3), PIXELS(1, 1), MIDDLE, EVEN),
    LINEAR("slab: picture of 32768 x 1", PLATE, POINTS(even_3), PIXELS(CTS_MAX_SIDE, 1), .mm_per_pixel = 0.001, EVEN),
    LINEAR("slab: picture of 1 x 32768", PLATE, POINTS(even_3), PIXELS(1, CTS_MAX_SIDE), .mm_per_pixel = 0.001, EVEN),
    LINEAR("slab: 1000 mm a pixel", PLATE, POINTS(even_3), PIXELS(3, 3), .mm_per_pixel = 1000, EVEN),
    LINEAR("slab: 1e-6 mm a pixel", PLATE, POINTS(even_3), .mm_per_pixel = 1e-6, EVEN),

    LINEAR("ramp: anterior", RAMP, VIEW(0, 0), MIDDLE, RISING),
    LINEAR("ramp: posterior", RAMP, VIEW(180, 0), MIDDLE, RISING),
    LINEAR("ramp: left", RAMP, VIEW(90, 0), MIDDLE, RISING),
    LINEAR("ramp: head", RAMP, VIEW(0, 90), MIDDLE, RISING),
    LINEAR("ramp: oblique", RAMP, VIEW(-20, 12), MIDDLE, RISING),
    LINEAR("ramp: more samples", RAMP, VIEW(-20, 12), MIDDLE, .samples = 8, .bound = {2e-4, 5e-5, 2e-7}),
    LINEAR("ramp: 1e-9 degrees off the axis", RAMP, VIEW(1e-9, -1e-9), MIDDLE, RISING),
    LINEAR("ramp: slope of 1e-6 across the layers", RAMP, VIEW(5.729577951308232e-5, 0), MIDDLE, RISING),
    LINEAR("ramp: exactly 45 degrees", RAMP, VIEW(45, 0), MIDDLE, RISING),
    LINEAR("ramp: 1e-9 degrees below 45", RAMP, VIEW(45 - 1e-9, 0), MIDDLE, RISING),
    LINEAR("ramp: 1e-9 degrees past 45", RAMP, VIEW(45 + 1e-9, 0), MIDDLE, .bound = {2e-2, 5e-4, 2e-7}),
    LINEAR("ramp: spacing 1:1:100", .dims = {41, 15, 5}, .hu = {100, 5, 40, 30}, POINTS(soft),
           .spacing_mm = {1, 1, 100}, VIEW(10, 20), MIDDLE, RISING),
    LINEAR("ramp: spacing 1:1:0.01", .dims = {41, 15, 401}, .hu = {100, 5, 40, 0.25}, .hu_step = 0.25, POINTS(soft),
           .spacing_mm = {1, 1, 0.01}, VIEW(10, 20), .mm_per_pixel = 0.171, RISING),
    LINEAR("ramp: spacing 1:1:0.01 from the head", .dims = {21, 15, 401}, .hu = {100, 10, 20, 0.25}, .hu_step = 0.25,
           POINTS(soft), .spacing_mm = {1, 1, 0.01}, VIEW(3, 87), .mm_per_pixel = 0.171, .bound = {1e-5, 1e-5, 2e-7}),
    LINEAR("ramp: leaning slices", RAMP, .lean = -0.4, VIEW(12, 9), MIDDLE, RISING),
    LINEAR(
        "ramp: HU steps of 2^-20", .dims = {41, 15, 41}, .hu_step = 0x1p-20, .hu = {-1024, 0x1p-14, 0x1p-11, 0x1p-15},
        .points = (const CtsCheckPoint[]){{-1024 + 0x1p-10, 0, {0.9, 0.5, 0.2}}, {-1024 + 0x1p-7, 0.1, {0.3, 0.8, 1}}},
        .n_points = 2, VIEW(-20, 12), MIDDLE, RISING),
    LINEAR("ramp: lit", LIT, VIEW(25, 10), MIDDLE, NEARLY),
    LINEAR("ramp: lit, leaning, spacing 1:2:3", LIT, .lean = 0.3, .spacing_mm = {1, 2, 3}, VIEW(-15, 18), MIDDLE,
           .bound = {1.2e-2, CHECK_PROMISED, 2e-7}),
    LINEAR("ramp: lit from behind", LIT, VIEW(-160, 10), MIDDLE, NEARLY),
    LINEAR("ramp: lit, power 1", LIT, .power = 1, VIEW(25, 10), MIDDLE, NEARLY),
    LINEAR("ramp: lit, power 1000", LIT, .power = 1000, VIEW(0.9, -0.1), MIDDLE, .bound = {5e-3, 2e-3, 2e-7}),
    LINEAR("slab: lit without a gradient is ambient", PLATE, POINTS(even_3), .lit = true, MIDDLE, EVEN),
    LINEAR("ramp: mip", RAMP, .mode = CTS_MODE_MIP, VIEW(25, 10), PROJECTED),
    LINEAR("ramp: minip", RAMP, .mode = CTS_MODE_MINIP, VIEW(25, 10), PROJECTED),
    LINEAR("ramp: average", RAMP, .mode = CTS_MODE_AVERAGE, VIEW(25, 10), PROJECTED),
    LINEAR("slab: average of one grey level", CUBE, POINTS(even_3), .mode = CTS_MODE_AVERAGE, VIEW(25, 10), PROJECTED),
    LINEAR("ramp: B-spline kernel", .dims = {61, 15, 61}, .hu = {100, 5, 40, 3}, POINTS(soft),
           .kernel = CTS_KERNEL_BSPLINE, VIEW(-10, 8), MIDDLE, .bound = {1e-3, CHECK_NONE, 2e-6}),

    LINEAR("thin: one voxel", OF_500(1, 1, 1), VIEW(20, 30), .mm_per_pixel = 0.1, EXACT),
    LINEAR("thin: one voxel, mip", OF_500(1, 1, 1), VIEW(20, 30), .mm_per_pixel = 0.1, .mode = CTS_MODE_MIP,
           .bound = {CHECK_NONE, 0, 0}),
    LINEAR("thin: a row of voxels from its side", OF_500(1, 40, 1), VIEW(70, 30), .mm_per_pixel = 0.1, EXACT),
    LINEAR("thin: a row of voxels from its end", .dims = {1, 40, 1}, .hu = {100, 0, 20, 0}, POINTS(soft), PIXELS(5, 5),
           .mm_per_pixel = 0.1, .bound = {5e-4, 2e-4, 2e-7}),
    LINEAR("thin: one layer face on", OF_500(30, 30, 1), VIEW(0, 90), EXACT),
    LINEAR("thin: one layer face on, mip", .dims = {30, 30, 1}, .hu = {100, 20, 7, 0}, POINTS(even_50), VIEW(0, 90),
           .mode = CTS_MODE_MIP, .bound = {CHECK_NONE, 1e-6, 1e-6}),
    LINEAR("thin: one layer oblique", OF_500(30, 30, 1), VIEW(20, 30), EXACT),
    LINEAR("thin: one layer edge on", .dims = {30, 30, 1}, .hu = {100, 20, 7, 0}, POINTS(soft), VIEW(0, 0),
           PIXELS(25, 25), .bound = {1e-3, 4e-4, 2e-7}),
    LINEAR("thin: two layers face on", .dims = {30, 30, 2}, .hu = {100, 20, 0, 300}, POINTS(soft), VIEW(0, 90), NEARLY),
};

const CtsCheckTable cts_check_linear = {cases, sizeof cases / sizeof *cases};
