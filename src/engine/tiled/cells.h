/* The tiled engine's march: rays go through the volume cell by cell, several in the lanes of a vector.
 *
 * Between two faces of a cell the field along a ray is a cubic, known exactly by four Bernstein numbers, so that
 * nothing is missed between samples: there are none. One template (cells_tmpl.h, in the vectors of base/simd.h) is
 * compiled four times: cells_c.c in plain C, cells_avx2.c and cells_avx512.c with those instructions, and cells_exact.c
 * in double precision.
 * The first three do the same operations for a ray, whatever lane it is in and whatever goes on in the others, so their
 * pictures are the same bytes.
 *
 * A PIECE is a stretch of a ray within one cell, where the field is taken not to pass a knot of the transfer function.
 * Its optical depth and colour come from two Gauss points. What that may be wrong by is known piece by piece, and is
 * what cuts a piece, or halves it, where it exceeds the plan's tolerance:
 *
 * - The field does pass a knot. Then extinction is off by at most its jump there, and by its change of slope times how
 *   far the field goes beyond: ov, from the Bernstein numbers, which hold the cubic between them. The piece ends where
 *   the cubic crosses the knot (cut_at_knots()).
 * - Within a piece the extinction is -ln of a cubic. For a straight one Gauss' rule errs by the fourth power of how far
 *   the logarithms at its points lie apart, L / 4320 times the fourth derivative (halve_if_wrong()).
 * - Colour fades along the piece, and two points tell so much of that: square of the depth by how far colours lie
 * apart.
 *
 * Where a ray only just touches a knot, rounding decides; pieces count as wrong by all that they may hide. The sum over
 * a ray, each piece weighed with the light that reaches it, is the bound of its pixel; pixels whose bounds are too
 * large are marched again in double precision (render_pixels()), and so are those that judge what the bounds are
 * worth (render/error/error_control.h).
 *
 * LIGHT is no polynomial. It adds to a ray without changing its depth, so that stretches wait for it in a queue until
 * vectors are full, and in others where they are to be lit in steps (light_tmpl.h). What came of each is added at last,
 * since which is emptied first depends on how many lanes there are. */
#ifndef CTS_TILED_CELLS_H
#define CTS_TILED_CELLS_H

#include "base/clock.h"
#include "core/scene/shade.h"
#include "engine/tiled/looks.h"
#include "engine/tiled/pieces.h"
#include "engine/tiled/void_mask.h"

/* Everything a thread needs, read-only. */
typedef struct TiledJob {
    const uint16_t *grey, *shown; /* gradients are taken of the latter: air where labels are hidden */
    ptrdiff_t stride[3];          /* to the next voxel; 0 along an axis of one */
    int dims[3], n_cells[3];
    CtsView view;
    double step[3]; /* voxels for each mm; 0 where a ray would not leave its cells before it leaves the volume */
    TiledMask mask;
    TiledPieces pieces;
    const TiledLooks *looks; /* where owners look different; else NULL */
    float colours;           /* by how much two of them that show differ at most */
    float tolerance;         /* a piece may be off by so much, as a share of the display's range */
    float dark;              /* a ray ends when less light is left */
    float touch;             /* knots nearer than so many grey levels may be touched or not, as rounding has it */
    const CtsShade *shade;   /* NULL: unlit */
    float frame[3][3];       /* its frame */
    float least_lit;         /* what weighs less is lit together with what follows */
    float turn;              /* a stretch is lit as a whole where its weight times its normal's turning is less */
    float alike;             /* pixels that lie between others to so much are not marched; 0: all are */
    bool want_depth;
    double camera_mm; /* from the camera plane to the plane through the view's centre */
} TiledJob;

/* Rays are taken in lists. Ray i starts inside the box at start_vox[.][i] and ends length_mm[i] further on. */
enum { TILED_RAYS = 1024, TILED_TURNING = 3 };
typedef struct TiledRays {
    int n;
    uint16_t x[TILED_RAYS], y[TILED_RAYS];
    double start_vox[3][TILED_RAYS], start_mm[TILED_RAYS], length_mm[TILED_RAYS];
    int n_meeting, meeting[TILED_RAYS];             /* rays that meet something, */
    double meets_mm[TILED_RAYS];                    /* where, from their start on, */
    int meets[3][TILED_RAYS];                       /* and in which cell */
    float rgba[TILED_RAYS][4];                      /* found, with what follows */
    float bound[TILED_RAYS], lit_bound[TILED_RAYS]; /* the latter of its light, part of the former */
    float turned[TILED_TURNING][TILED_RAYS][4];     /* what was lit in steps, and its bound */
    float left[TILED_RAYS];                         /* light, of rays that have ended before the box does */
    float depth_mm[TILED_RAYS];                     /* where wanted */
} TiledRays;

typedef struct TiledCounts {
    uint64_t skips, pieces, lit; /* lanes that stepped through void, evaluated a piece, were lit */
    uint64_t between;            /* pixels that others stand for */
    uint64_t ticks, shade_ticks; /* all of a march, and its part for light */
    /* What those between err by: its square as the draws have it, and the largest of them; in 2^-32, as whole numbers
     * have the same sum in any order. */
    uint64_t missed, missed_most;
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
void cts_tiled_march_c(const TiledJob *job, TiledRays *rays, TiledCounts *counts);
/* For jobs that are_narrow. */
void cts_tiled_march_avx2(const TiledJob *job, TiledRays *rays, TiledCounts *counts);
void cts_tiled_march_avx512(const TiledJob *job, TiledRays *rays, TiledCounts *counts);
/* In double precision, with tolerances of its own. */
void cts_tiled_march_exact(const TiledJob *job, TiledRays *rays, TiledCounts *counts);
void cts_tiled_march_exact_avx2(const TiledJob *job, TiledRays *rays, TiledCounts *counts);
void cts_tiled_march_exact_avx512(const TiledJob *job, TiledRays *rays, TiledCounts *counts);

/* Adds the ray of pixel (x, y), unless it misses the box. from_mm is counted from the plane through the view centre. */
void cts_tiled_add_ray(const TiledJob *job, TiledRays *rays, int x, int y, double from_mm);
/* No ray of the pixels from x[0], y[0] to x[1], y[1] meets anything before so far, as none does before `from`;
 * INFINITY: none meets anything. */
double cts_tiled_reach_mm(const TiledJob *job, const int x[2], const int y[2], double from);

#endif
