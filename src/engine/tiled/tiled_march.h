/* The tiled engine's march: rays traverse the volume cell by cell, several in the lanes of a vector.
 *
 * Between two faces of a cell the field along a ray is a cubic, given exactly by four Bernstein coefficients, so that
 * no sampling can miss anything. One template (tiled_march_tmpl.h, in the vectors of base/simd.h) is compiled in single
 * precision (tiled_march.c) and in double precision (tiled_march_double.c). All paths of one precision do the same
 * operations for a ray, in any lane and independent of the others, so that their pictures have the same bytes.
 *
 * A RAY SEGMENT is an interval of a ray within one cell, in which the field is assumed not to cross a control point of
 * the transfer function. Its optical depth and colour come from two Gauss points. Its error is estimated; where the
 * estimate exceeds the plan's tolerance the segment is split at a control point, or halved:
 *
 * - The field does cross a control point. Then the error of the extinction is at most its discontinuity there, and its
 *     change of slope times the overshoot of the field, from the Bernstein coefficients, which enclose the cubic. The
 *     segment ends where the cubic crosses the control point (split_at_control_points()).
 * - Within a segment the extinction is -ln of a cubic. For a linear field the error of Gauss' rule grows with the
 *     fourth power of the difference of the logarithms at its points: L / 4320 times the fourth derivative
 * (integrate()).
 * - Colour is attenuated along the segment, which two points resolve up to the square of the depth times the difference
 *     of the colours.
 *
 * For a grazing contact of a ray with a control point rounding decides; the segment's error then includes everything
 * that it may hide. The sum over a ray, each segment weighted by the transmittance before it, is the error estimate of
 * its pixel; pixels with too large an estimate are marched again in double precision (render_pixels()), and so are the
 * reference samples that validate the estimates (render/error/error_control.h).
 *
 * SHADING is not polynomial. It adds to a ray without changing its depth, so that segments are queued until vectors are
 * full, and in further queues where they are shaded in steps (shading_tmpl.h). The results of each queue are summed
 * separately and added at the end, since the order in which queues are emptied depends on the number of lanes. */
#pragma once

#include "base/clock.h"
#include "base/simd_path.h"
#include "core/scene/openness.h"
#include "core/scene/shade.h"
#include "engine/tiled/appearance_tables.h"
#include "engine/tiled/transfer_segments.h"
#include "engine/tiled/void_mask.h"

/* Read-only data of a march, shared by all threads. */
typedef struct TiledJob {
    const uint16_t *grey, *shown; /* shown: volume for gradients, air where labels are hidden */
    ptrdiff_t stride[3];          /* to the next voxel; 0 along an axis of one */
    int dims[3], n_cells[3];
    CtsView view;
    double step[3]; /* voxels for each mm; 0 where a ray would not leave its cells before it leaves the volume */
    TiledMask mask;
    bool whole_blocks; /* all cells of visible blocks count as potentially visible */
    TiledTransfer transfer;
    const TiledAppearances *appearances; /* if labels have different appearances; else NULL */
    float max_colour_difference;         /* largest difference of two visible colours in a channel */
    /* error estimate of a segment above which it is split, as a fraction of the display range */
    float tolerance;
    float min_transmittance; /* transmittance below which a ray ends */
    /* distance in grey levels within which rounding decides whether a control point is crossed (grazing contact) */
    float grazing_tolerance;
    const CtsShade *shade;   /* NULL: unlit */
    float frame[3][3];       /* its frame */
    const CtsOpenness *open; /* NULL: 1 everywhere */
    float min_shaded_weight; /* segments of smaller weight are shaded together with the next ones */
    float shading_tolerance; /* a segment is shaded at one point if its weight times its normal deviation is less */
    float interpolation_tolerance; /* largest interpolation error of pixels that are not marched; 0: all are */
    bool want_depth;
    double camera_mm; /* from the camera plane to the plane through the view's centre */
} TiledJob;

/* Rays are processed in lists. Ray i starts inside the box at start_vox[.][i] and ends length_mm[i] further on. */
enum { TILED_RAYS = 1024, TILED_SHADING_QUEUES = 4 };
typedef struct TiledRays {
    int n;
    uint16_t x[TILED_RAYS], y[TILED_RAYS];
    double start_vox[3][TILED_RAYS], start_mm[TILED_RAYS], length_mm[TILED_RAYS];
    int n_hits, hits[TILED_RAYS]; /* rays that reach a visible cell, */
    double hit_mm[TILED_RAYS];    /* the distance from their start, */
    int hit_cell[3][TILED_RAYS];  /* and the cell */
    float rgba[TILED_RAYS][4];    /* result, extended by the remaining transmittance */
    float bound[TILED_RAYS];
    /* Sums of shaded segments by the queue that they were in, and of their error estimates. */
    float light[TILED_SHADING_QUEUES][TILED_RAYS][4];
    float left[TILED_RAYS];     /* transmittance, of rays that ended before leaving the box */
    float depth_mm[TILED_RAYS]; /* if wanted */
} TiledRays;

typedef struct TiledCounts {
    uint64_t skips, segments, queues; /* lanes that skipped empty space, evaluated a segment, were shaded */
    uint64_t interpolated;            /* interpolated pixels */
    uint64_t ticks, shade_ticks;      /* of the whole march, and of shading */
    /* Of the terms that estimate the sum of squared interpolation errors, as of CtsTerms; in units of 2^-32, since
     * integers have the same sum in any order. */
    uint64_t error_sum, error_squares, largest_error;
} TiledCounts;

static inline uint64_t cts_tiled_ticks(void)
{
#if defined(__x86_64__)
    return __builtin_ia32_rdtsc();
#else
    return (uint64_t)(cts_wall_ms() * 1e6);
#endif
}

typedef struct TiledScratch {
    TiledRays rays;
    TiledCounts counts;
} TiledScratch;

typedef void (*cts_tiled_march_fn)(const TiledJob *job, TiledRays *rays, TiledCounts *counts);
/* In single precision, other paths than plain C only where offsets of voxels fit 32 bits (path_of()); and in double
 * precision, with tolerances of its own. */
#define TILED_MARCHES(path)                                                                                            \
    void cts_tiled_march_##path(const TiledJob *job, TiledRays *rays, TiledCounts *counts);                            \
    void cts_tiled_march_double_##path(const TiledJob *job, TiledRays *rays, TiledCounts *counts);
CTS_EACH_PATH(TILED_MARCHES)

/* Adds the ray of pixel (x, y), unless it misses the box. from_mm is counted from the plane through the view centre. */
void cts_tiled_add_ray(const TiledJob *job, TiledRays *rays, int x, int y, double from_mm);
/* Distance before which no ray of the pixels from x[0], y[0] to x[1], y[1] reaches a visible cell, given that none does
 * before `from`; INFINITY: none reaches any. */
double cts_tiled_reach_mm(const TiledJob *job, const int x[2], const int y[2], double from);
